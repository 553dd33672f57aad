// SPDX-License-Identifier: Apache-2.0
// Findings of verification compared with the oracle of bake_oracle.h, for random micromaps. Over all of them, each
// micro-triangle claims each state, so that no finding is a coincidence.
#include <gtest/gtest.h>

#include <map>

#include "verify_cases.h"

using namespace vellum;
using namespace vellum::test;
using verify::Finding;
using verify::Kind;

namespace
{

// Keyed by triangle and micro-triangle.
using Found = std::map<std::pair<uint32_t, uint32_t>, Finding>;

Found foundBy(const verify::Result &result)
{
    Found found;
    for (const Finding &f : result.findings)
        EXPECT_TRUE(found.emplace(std::pair{f.triangle, f.microTriangle}, f).second)
            << "two findings for triangle " << f.triangle << ", micro-triangle " << f.microTriangle;
    return found;
}

Micromap randomMicromap(TestRandom &random, size_t triangles, uint32_t level)
{
    Micromap micromap = emptyMicromap(triangles, level, Format::FourState);
    for (uint8_t &byte : micromap.data)
        byte = static_cast<uint8_t>(random());
    return micromap;
}

struct Sum {
    size_t all = 0;
    size_t mixed = 0;
    size_t wrong = 0;
    size_t needless = 0;
    size_t outsideMargins = 0;
};

// Checks that the finding of a micro-triangle is that of the oracle, without tolerances. The reported location must
// contradict the claim.
template <typename N>
void check(Sum &sum, const AlphaTexture &texture, const Found &found, uint32_t triangle, uint32_t micro, State state,
           const Oracle<N> &oracle, double cutoff, const N &hidden)
{
    const N limit = numberOf(cutoff, N{});
    const bool opaque = !(oracle.least() < limit);
    const bool transparent = oracle.most() < limit;
    const bool close = (oracle.least() < limit + hidden && limit - hidden < oracle.least()) ||
                       (oracle.most() < limit + hidden && limit - hidden < oracle.most());
    ++sum.all;
    sum.mixed += opaque || transparent ? 0u : 1u;
    const auto place = found.find({triangle, micro});
    testing::Message what;
    what << "triangle " << triangle << ", micro-triangle " << micro << " is " << static_cast<int>(state)
         << ", alpha from " << static_cast<double>(oracle.least()) << " to " << static_cast<double>(oracle.most());
    const bool claim = state == State::Opaque || state == State::Transparent;
    const bool wrong = claim && (state == State::Opaque ? !opaque : !transparent);
    const bool needless = !claim && (opaque || transparent);
    if (close && N{} < hidden)
        return;
    sum.wrong += wrong ? 1u : 0u;
    sum.needless += needless ? 1u : 0u;
    ASSERT_EQ(place != found.end(), wrong || needless) << what;
    if (place == found.end())
        return;
    const Finding &f = place->second;
    ASSERT_EQ(f.kind, wrong ? Kind::Wrong : Kind::Needless) << what;
    ASSERT_EQ(f.state, state) << what;
    // Values of nearest filtering jump where the numbers round.
    if (wrong && texture.filter == Filter::Bilinear) {
        ASSERT_NEAR(texture.sample(f.u, f.v), f.value, 1e-6) << what;
    }
    if (wrong) {
        ASSERT_TRUE(state == State::Opaque ? f.value < cutoff + 1e-9 : f.value > cutoff - 1e-9)
            << what << ": " << f.value;
    }
}

template <typename N>
void compare(Sum &sum, TestRandom &random, const RandomCase &c, const N &hidden)
{
    const auto &[texture, triangles, options] = c;
    const Micromap micromap = randomMicromap(random, triangles.size(), *options.level);
    const verify::Result result = verify::verify(texture, toCorners(triangles), micromap, verifyOptions(options));
    const Found found = foundBy(result);
    EXPECT_EQ(result.counts.open, 0u);
    EXPECT_EQ(result.counts.microTriangles(), triangles.size() * microTriangleCount(*options.level));
    for (uint32_t t = 0; t < triangles.size(); ++t) {
        for (uint32_t i = 0; i < microTriangleCount(*options.level); ++i) {
            Oracle<N> oracle(texture);
            oracle.addPolygon(cornersOf<N>(texture, triangles[t], i, *options.level));
            const MicromapTriangle &m = micromap.triangles[t];
            check(sum, texture, found, t, i, readState(micromap.data.data() + m.dataOffset, i, m.format), oracle,
                  options.cutoff, hidden);
            if (testing::Test::HasFatalFailure())
                return;
        }
    }
}

} // namespace

TEST(VerifyExact, FindsWhatExactArithmeticFindsOnGrids)
{
    TestRandom random(11);
    Sum sum;
    for (unsigned round = 0; round < 300 && !HasFatalFailure(); ++round) {
        const RandomCase c = caseOnGrid(random);
        SCOPED_TRACE(testing::Message() << "round " << round << ": " << c);
        compare<Rational>(sum, random, c, Rational(0));
    }
    EXPECT_GT(sum.mixed, sum.all / 10);
    EXPECT_GT(sum.wrong, sum.all / 10);
    EXPECT_GT(sum.needless, sum.all / 10);
}

TEST(VerifyExact, FindsWhatTheMathematicsFindsAnywhere)
{
    TestRandom random(12);
    Sum sum;
    for (unsigned round = 0; round < 200 && !HasFatalFailure(); ++round) {
        const RandomCase c = caseAnywhere(random, round);
        SCOPED_TRACE(testing::Message() << "round " << round << ": " << c);
        compare<long double>(sum, random, c, 1e-11L);
    }
    EXPECT_GT(sum.mixed, sum.all / 50);
    EXPECT_GT(sum.wrong, sum.all / 10);
    EXPECT_GT(sum.needless, sum.all / 10);
}

// With tolerances, a state is wrong if it is wrong without them; otherwise the margins (a Minkowski sum) decide.
TEST(VerifyExact, FindsStatesThatHoldOnlyWithoutMargins)
{
    TestRandom random(13);
    Sum sum;
    for (unsigned round = 0; round < 150 && !HasFatalFailure(); ++round) {
        const RandomCase c = caseWithTolerances(random, round);
        SCOPED_TRACE(testing::Message() << "round " << round << ": " << c);
        const auto &[texture, triangles, options] = c;
        const Micromap micromap = randomMicromap(random, triangles.size(), *options.level);
        const Found found = foundBy(verify::verify(texture, toCorners(triangles), micromap, verifyOptions(options)));
        for (uint32_t k = 0; k < triangles.size(); ++k) {
            const auto [marginX, marginY] = marginsOf(options, texture, triangles[k]);
            for (uint32_t i = 0; i < microTriangleCount(*options.level); ++i) {
                const auto corners = cornersOf<long double>(texture, triangles[k], i, *options.level);
                Oracle<long double> wide(texture);
                wide.addPolygon(widened(corners, marginX, marginY));
                Oracle<long double> bare(texture);
                bare.addPolygon(corners);
                const long double high = options.cutoff + options.valueTolerance;
                const long double low = options.cutoff - options.valueTolerance;
                constexpr long double kHidden = 1e-11L;
                const auto near = [&](long double a, long double b) { return std::abs(a - b) < kHidden; };
                ++sum.all;
                if (near(wide.least(), high) || near(wide.most(), low) || near(bare.least(), options.cutoff) ||
                    near(bare.most(), options.cutoff))
                    continue;
                // Where long double rounds, the oracle of nearest filtering may miss a texel that is only touched.
                const MicromapTriangle &m = micromap.triangles[k];
                const State state = readState(micromap.data.data() + m.dataOffset, i, m.format);
                const bool wideOpaque = wide.least() >= high;
                const bool wideTransparent = wide.most() < low;
                const auto place = found.find({k, i});
                std::optional<Kind> expected;
                if (state == State::Opaque || state == State::Transparent) {
                    const bool opaque = state == State::Opaque;
                    if (opaque ? bare.least() < options.cutoff : bare.most() >= options.cutoff)
                        expected = Kind::Wrong;
                    else if (opaque ? !wideOpaque : !wideTransparent)
                        expected = Kind::OutsideMargins;
                } else if (wideOpaque || wideTransparent) {
                    expected = Kind::Needless;
                }
                sum.wrong += expected == Kind::Wrong ? 1u : 0u;
                sum.outsideMargins += expected == Kind::OutsideMargins ? 1u : 0u;
                sum.needless += expected == Kind::Needless ? 1u : 0u;
                ASSERT_EQ(place != found.end(), expected.has_value())
                    << "triangle " << k << ", micro-triangle " << i << " is " << static_cast<int>(state)
                    << ", alpha from " << bare.least() << " to " << bare.most() << ", with margins " << wide.least()
                    << " to " << wide.most();
                if (expected) {
                    ASSERT_EQ(place->second.kind, *expected);
                }
            }
        }
    }
    EXPECT_GT(sum.wrong, sum.all / 10);
    EXPECT_GT(sum.needless, sum.all / 10);
    EXPECT_GT(sum.outsideMargins, sum.all / 500);
}

// s t over the triangle below s + t = 1: it reaches 1/4 in the middle of that side, and nowhere else.
TEST(VerifyExact, AValueThatIsReachedAtOnePointCounts)
{
    AlphaTexture texture;
    texture.width = texture.height = 2;
    texture.wrapU = texture.wrapV = Wrap::Clamp;
    const TriangleUvs uvs{{{0.25f, 0.25f}, {0.75f, 0.25f}, {0.25f, 0.75f}}};
    const double quarter = 0.25;
    const auto kindOf = [&](State state, double cutoff) -> std::optional<Kind> {
        Micromap micromap;
        micromap.indices = {specialIndex(state)};
        BakeOptions options = BakeOptions{}.exactly();
        options.cutoff = cutoff;
        const verify::Result result = verify::verify(texture, toCorners({uvs}), micromap, verifyOptions(options));
        return result.findings.empty() ? std::nullopt : std::optional(result.findings[0].kind);
    };
    texture.alpha = {0, 0, 0, 1};
    EXPECT_EQ(kindOf(State::Transparent, quarter), Kind::Wrong);
    EXPECT_EQ(kindOf(State::UnknownTransparent, quarter), std::nullopt);
    EXPECT_EQ(kindOf(State::Transparent, std::nextafter(quarter, 1)), std::nullopt);
    EXPECT_EQ(kindOf(State::UnknownTransparent, std::nextafter(quarter, 1)), Kind::Needless);
    // The other way round, 3/4 is still opaque.
    texture.alpha = {1, 1, 1, 0};
    EXPECT_EQ(kindOf(State::Opaque, 3 * quarter), std::nullopt);
    EXPECT_EQ(kindOf(State::UnknownOpaque, 3 * quarter), Kind::Needless);
    EXPECT_EQ(kindOf(State::Opaque, std::nextafter(3 * quarter, 1)), Kind::Wrong);
    EXPECT_EQ(kindOf(State::UnknownOpaque, std::nextafter(3 * quarter, 1)), std::nullopt);
}
