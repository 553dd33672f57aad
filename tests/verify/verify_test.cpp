// SPDX-License-Identifier: Apache-2.0
// Findings of verification: none for micromaps of the baker, and the damage for those that were damaged.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "verify/walk.h"
#include "verify_cases.h"

using namespace vellum;
using namespace vellum::test;
using verify::Finding;
using verify::Kind;
using verify::TriangleCorners;

namespace
{

AlphaTexture leaves(uint32_t size)
{
    TestRandom random(5);
    AlphaTexture t;
    t.width = t.height = size;
    for (uint32_t y = 0; y < size; ++y) {
        for (uint32_t x = 0; x < size; ++x) {
            const double wave = std::sin(x * 0.21) * std::sin(y * 0.17 + std::sin(x * 0.1));
            t.alpha.push_back(static_cast<float>(std::lround(std::clamp(0.5 + 1.6 * wave, 0.0, 1.0) * 255)) / 255.0f);
        }
    }
    return t;
}

const std::vector<TriangleUvs> kCard = {{{{0, 0}, {1, 0}, {0, 1}}}, {{{1, 1}, {0, 1}, {1, 0}}}};

bool known(State state)
{
    return state == State::Opaque || state == State::Transparent;
}

} // namespace

TEST(Verify, FindsNothingInWhatTheBakerMakes)
{
    TestRandom random(21);
    constexpr std::array<uint32_t, 2> kSizes[] = {{1, 1}, {3, 5}, {16, 16}, {64, 48}, {255, 129}};
    uint64_t claims = 0;
    uint64_t unknown = 0;
    for (unsigned round = 0; round < 300; ++round) {
        const auto [width, height] = kSizes[round % std::size(kSizes)];
        RandomCase c{.texture =
                         round % 2 == 0 ? smoothTexture(random, width, height) : coarseTexture(random, width, height),
                     .triangles = randomTriangles(random, width, height)};
        setRandomSampler(random, c.texture);
        auto &[texture, triangles, options] = c;
        SCOPED_TRACE(testing::Message() << "round " << round << ": " << c);
        if (random() % 2 == 0)
            options.exactly();
        if (random() % 3 != 0)
            options.level = random() % 7;
        options.cutoff = random() % 2 == 0 ? 0.5 : random.uniform(0.05, 0.95);
        const BakeResult baked = bake(texture, triangles, options);
        const verify::Result result =
            verify::verify(texture, toCorners(triangles), baked.micromap, verifyOptions(options));
        for (const Finding &f : result.findings)
            ADD_FAILURE() << "kind " << static_cast<int>(f.kind) << ", triangle " << f.triangle << ", micro-triangle "
                          << f.microTriangle << ", level " << f.level << ", state " << static_cast<int>(f.state) << ", "
                          << f.u << ' ' << f.v << ": " << f.value;
        ASSERT_EQ(result.counts.open, 0u);
        claims += result.counts.opaque + result.counts.transparent;
        unknown += result.counts.unknown;
    }
    EXPECT_GT(claims, 10000u);
    EXPECT_GT(unknown, 10000u);
}

TEST(Verify, FindsEachSingleWrongState)
{
    const AlphaTexture texture = leaves(64);
    for (const bool exactly : {false, true}) {
        BakeOptions options;
        options.level = 3;
        if (exactly)
            options.exactly();
        const Micromap good = unshared(bake(texture, kCard, options).micromap, *options.level);
        const verify::Options verifying = verifyOptions(options);
        ASSERT_EQ(verify::verify(texture, toCorners(kCard), good, verifying).findings.size(), 0u);
        for (uint32_t t = 0; t < kCard.size(); ++t) {
            for (uint32_t i = 0; i < microTriangleCount(*options.level); ++i) {
                const State right = readState(good.data.data() + good.triangles[t].dataOffset, i, Format::FourState);
                for (const State state :
                     {State::Opaque, State::Transparent, State::UnknownOpaque, State::UnknownTransparent}) {
                    if (state == right || (!known(state) && !known(right)))
                        continue;
                    Micromap bad = good;
                    setState(bad, t, i, state);
                    const verify::Result result = verify::verify(texture, toCorners(kCard), bad, verifying);
                    ASSERT_EQ(result.findings.size(), 1u);
                    const Finding &f = result.findings[0];
                    ASSERT_EQ(f.triangle, t);
                    ASSERT_EQ(f.microTriangle, i);
                    ASSERT_EQ(f.level, *options.level);
                    ASSERT_EQ(f.state, state);
                    ASSERT_FALSE(f.special);
                    if (!known(state)) {
                        ASSERT_EQ(f.kind, Kind::Needless);
                    } else if (exactly || known(right)) {
                        ASSERT_EQ(f.kind, Kind::Wrong);
                        ASSERT_NEAR(texture.sample(f.u, f.v), f.value, 1e-6);
                        ASSERT_TRUE(state == State::Opaque ? f.value < 0.5 : f.value >= 0.5) << f.value;
                    } else {
                        ASSERT_NE(f.kind, Kind::Needless);
                    }
                }
            }
        }
    }
}

TEST(Verify, SpecialIndicesAreClaimsOfTheWholeTriangle)
{
    const AlphaTexture texture = leaves(64);
    // A place of each kind: opaque, transparent, mixed.
    BakeOptions options;
    options.level = 0;
    std::array<std::optional<TriangleUvs>, 3> of;
    for (int y = 0; y < 16; ++y) {
        for (int x = 0; x < 16; ++x) {
            const float u = static_cast<float>(x) / 16;
            const float v = static_cast<float>(y) / 16;
            const TriangleUvs uvs{{{u, v}, {u + 0.03f, v}, {u, v + 0.03f}}};
            const State state = *specialState(bake(texture, {&uvs, 1}, options).micromap.indices[0]);
            of[known(state) ? static_cast<size_t>(state) : 2] = uvs;
        }
    }
    for (size_t truth = 0; truth < 3; ++truth) {
        ASSERT_TRUE(of[truth].has_value());
        for (int index = -4; index < 0; ++index) {
            Micromap micromap;
            micromap.indices = {index};
            const verify::Result result =
                verify::verify(texture, toCorners({*of[truth]}), micromap, verifyOptions(options));
            const State said = *specialState(index);
            EXPECT_EQ(result.counts.microTriangles(), 1u);
            if (known(said) ? static_cast<size_t>(said) == truth : truth == 2) {
                EXPECT_TRUE(result.findings.empty()) << truth << ' ' << index;
                continue;
            }
            ASSERT_EQ(result.findings.size(), 1u) << truth << ' ' << index;
            EXPECT_EQ(result.findings[0].kind, known(said) ? Kind::Wrong : Kind::Needless);
            EXPECT_TRUE(result.findings[0].special);
            EXPECT_EQ(result.findings[0].state, said);
        }
    }
}

TEST(Verify, TwoStateDataIsAnApproximationByDefault)
{
    const AlphaTexture texture = leaves(64);
    BakeOptions options = BakeOptions{}.exactly();
    options.level = 5;
    const BakeResult four = bake(texture, kCard, options);
    options.format = Format::TwoState;
    const Micromap two = bake(texture, kCard, options).micromap;
    verify::Options verifying = verifyOptions(options);
    const verify::Result loose = verify::verify(texture, toCorners(kCard), two, verifying);
    const auto number = [&](State state) { return four.statistics.states[static_cast<size_t>(state)]; };
    const uint64_t mixed = number(State::UnknownOpaque) + number(State::UnknownTransparent);
    EXPECT_EQ(loose.findings.size(), 0u);
    EXPECT_EQ(loose.counts.twoStateMixed, mixed);
    EXPECT_EQ(loose.counts.twoStateReversed, 0u);
    EXPECT_EQ(loose.counts.twoStateTrue, 2 * microTriangleCount(5) - mixed);
    EXPECT_EQ(loose.counts.microTriangles(), 2 * microTriangleCount(5));
    verifying.strictTwoState = true;
    const verify::Result strict = verify::verify(texture, toCorners(kCard), two, verifying);
    EXPECT_EQ(strict.counts.of(Kind::Wrong), mixed);
    EXPECT_EQ(strict.counts.of(Kind::Needless), 0u);

    Micromap reversed = two;
    for (uint8_t &byte : reversed.data)
        byte = static_cast<uint8_t>(~byte);
    const verify::Result wrong = verify::verify(texture, toCorners(kCard), reversed, verifyOptions(options));
    EXPECT_EQ(wrong.counts.twoStateReversed, loose.counts.twoStateTrue);
    EXPECT_EQ(wrong.counts.twoStateMixed, mixed);
}

TEST(Verify, ListsTheFirstOfEachKindAndCountsAll)
{
    const AlphaTexture texture = leaves(64);
    BakeOptions options;
    options.level = 5;
    std::vector<TriangleUvs> cards;
    for (int i = 0; i < 5; ++i)
        cards.insert(cards.end(), kCard.begin(), kCard.end());
    Micromap micromap = unshared(bake(texture, cards, options).micromap, 5);
    uint64_t wrong = 0;
    uint64_t needless = 0;
    for (uint32_t t = 0; t < cards.size(); ++t) {
        for (uint32_t i = 0; i < microTriangleCount(5); ++i) {
            const State state =
                readState(micromap.data.data() + micromap.triangles[t].dataOffset, i, Format::FourState);
            if (state == State::Opaque) {
                setState(micromap, t, i, t % 2 == 0 ? State::Transparent : State::UnknownOpaque);
                ++(t % 2 == 0 ? wrong : needless);
            }
        }
    }
    verify::Options verifying = verifyOptions(options);
    verifying.maxFindings = 7;
    std::vector<verify::Result> results;
    for (const unsigned threads : {1u, 2u, 5u}) {
        verifying.threads = threads;
        results.push_back(verify::verify(texture, toCorners(cards), micromap, verifying));
    }
    for (const verify::Result &result : results) {
        EXPECT_EQ(result.counts.of(Kind::Wrong), wrong);
        EXPECT_EQ(result.counts.of(Kind::Needless), needless);
        EXPECT_EQ(result.distinct, 10u); // each has data of its own
        ASSERT_EQ(result.findings.size(), 14u);
        for (size_t i = 0; i < 14; ++i) {
            EXPECT_EQ(result.findings[i].kind, i < 7 ? Kind::Wrong : Kind::Needless);
            EXPECT_EQ(result.findings[i].triangle, i < 7 ? 0u : 1u);
            EXPECT_EQ(result.findings[i].microTriangle, results[0].findings[i].microTriangle);
        }
    }
}

TEST(Verify, EqualTrianglesAreWalkedOnce)
{
    const AlphaTexture texture = leaves(32);
    BakeOptions options;
    options.level = 3;
    std::vector<TriangleUvs> cards;
    for (int i = 0; i < 50; ++i)
        cards.insert(cards.end(), kCard.begin(), kCard.end());
    const BakeResult baked = bake(texture, cards, options);
    size_t reported = 0;
    verify::Options verifying = verifyOptions(options);
    verifying.progress = [&](size_t done, size_t total) {
        EXPECT_EQ(total, 2u);
        reported = done;
    };
    const verify::Result result = verify::verify(texture, toCorners(cards), baked.micromap, verifying);
    EXPECT_EQ(result.distinct, 2u);
    EXPECT_EQ(reported, 2u);
    EXPECT_EQ(result.counts.microTriangles(), 100 * microTriangleCount(3));
}

TEST(Verify, ConstantFactorsScaleTheValue)
{
    TestRandom random(31);
    for (unsigned round = 0; round < 100; ++round) {
        AlphaTexture texture = smoothTexture(random, 24, 17);
        const float factors[] = {0.5f, 0.25f, 2.0f, 0.75f};
        const float factor = factors[round % 4];
        const std::vector<TriangleUvs> triangles = randomTriangles(random, 24, 17);
        BakeOptions options = BakeOptions{}.exactly();
        options.level = 3;
        options.cutoff = 0.4;
        const BakeResult plain = bake(texture, triangles, options);
        // The same values by a factor for each vertex. All products are exact.
        std::vector<TriangleCorners> corners = toCorners(triangles);
        for (TriangleCorners &c : corners)
            c.alpha = {factor, factor, factor};
        options.cutoff = 0.4 * double{factor};
        const verify::Result result = verify::verify(texture, corners, plain.micromap, verifyOptions(options));
        EXPECT_TRUE(result.findings.empty()) << round;
    }
}

// A factor that falls from 1 to 0 along a triangle of full alpha: the outline is the line of the cutoff.
TEST(Verify, FactorsThatChangeAreInterpolated)
{
    AlphaTexture white;
    white.width = white.height = 1;
    white.alpha = {1};
    TriangleCorners corners{{0.1f, 0.7f, 0.2f}, {0, 0.3f, 0.9f}, {1, 0, 1}};
    constexpr uint32_t kLevel = 4;
    verify::Options options;
    options.tolerances = {0, 0, 0, 0};
    options.cutoff = 0.40; // between two lines of the lattice
    options.maxFindings = 1000;
    for (const State state : {State::Opaque, State::Transparent, State::UnknownOpaque}) {
        Micromap micromap = emptyMicromap(1, kLevel, Format::FourState);
        for (uint32_t i = 0; i < microTriangleCount(kLevel); ++i)
            setState(micromap, 0, i, state);
        const verify::Result result = verify::verify(white, {&corners, 1}, micromap, options);
        EXPECT_EQ(result.counts.open, 0u);
        std::vector<bool> found(microTriangleCount(kLevel));
        for (const Finding &f : result.findings)
            found[f.microTriangle] = true;
        for (uint32_t i = 0; i < microTriangleCount(kLevel); ++i) {
            // The factor is 1 - u.
            const auto points = microTriangleCorners(i, kLevel);
            const float least = 1 - std::max({points[0].u, points[1].u, points[2].u});
            const float most = 1 - std::min({points[0].u, points[1].u, points[2].u});
            const bool opaque = least >= options.cutoff;
            const bool transparent = most < options.cutoff;
            const bool expected = state == State::Opaque        ? !opaque
                                  : state == State::Transparent ? !transparent
                                                                : opaque || transparent;
            EXPECT_EQ(found[i], expected) << "micro-triangle " << i << " is " << static_cast<int>(state);
        }
    }
}

TEST(Verify, NanProvesNothing)
{
    BakeOptions options;
    options.level = 2;
    AlphaTexture texture = leaves(16);
    texture.wrapU = texture.wrapV = Wrap::Clamp;
    for (float &alpha : texture.alpha)
        alpha = 1;
    const float bad[] = {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()};
    for (const float value : bad) {
        // In a texel: micro-triangles that touch it cannot be known, the others can.
        AlphaTexture spoiled = texture;
        spoiled.alpha[16 * 8 + 8] = value;
        for (const Filter filter : {Filter::Bilinear, Filter::Nearest}) {
            spoiled.filter = filter;
            const Micromap good = unshared(bake(spoiled, kCard, options).micromap, 2);
            EXPECT_TRUE(verify::verify(spoiled, toCorners(kCard), good, verifyOptions(options)).findings.empty());
            Micromap bold = good;
            uint64_t unknown = 0;
            for (uint32_t t = 0; t < 2; ++t)
                for (uint32_t i = 0; i < 16; ++i) {
                    unknown += known(readState(good.data.data() + good.triangles[t].dataOffset, i, Format::FourState))
                                   ? 0u
                                   : 1u;
                    setState(bold, t, i, State::Opaque);
                }
            EXPECT_GT(unknown, 0u);
            const verify::Result result = verify::verify(spoiled, toCorners(kCard), bold, verifyOptions(options));
            EXPECT_EQ(result.counts.of(Kind::Wrong) + result.counts.of(Kind::OutsideMargins), unknown);
        }
        // In a coordinate.
        TriangleCorners corners{{0, value, 1}, {0, 0, 1}, {1, 1, 1}};
        Micromap micromap;
        micromap.indices = {specialIndex(State::Opaque)};
        EXPECT_TRUE(verify::verify(texture, {&corners, 1}, micromap, verifyOptions(options)).findings.empty());
        AlphaTexture other = texture;
        other.alpha[3] = 0;
        const verify::Result result = verify::verify(other, {&corners, 1}, micromap, verifyOptions(options));
        ASSERT_EQ(result.findings.size(), 1u);
        EXPECT_EQ(result.findings[0].kind, Kind::Wrong);
        EXPECT_TRUE(std::isnan(result.findings[0].value));
        micromap.indices = {specialIndex(State::UnknownOpaque)};
        EXPECT_TRUE(verify::verify(other, {&corners, 1}, micromap, verifyOptions(options)).findings.empty());
    }
}

TEST(Verify, CoordinatesFarAwayAreNeitherWrongNorNeedless)
{
    const AlphaTexture texture = leaves(32);
    for (const float far : {1e6f, 1e7f, 1e12f, 1e30f}) {
        const TriangleUvs uvs{{{far, -far}, {-far, far}, {far, far}}};
        BakeOptions options;
        options.level = 3;
        const BakeResult baked = bake(texture, {&uvs, 1}, options);
        const verify::Result result = verify::verify(texture, toCorners({uvs}), baked.micromap, verifyOptions(options));
        EXPECT_TRUE(result.findings.empty()) << far;
    }
}

// A thin sliver over a texture of noise along a line that it never crosses is what costs most; it must end.
TEST(Verify, WorkIsBounded)
{
    AlphaTexture texture;
    texture.width = texture.height = 64;
    for (uint32_t i = 0; i < 64 * 64; ++i)
        texture.alpha.push_back(i / 64 % 2 == 0 ? 1.0f : 0.0f);
    // The value is 1 along the middle of a row, and less to both sides.
    const float v = 10.5f / 64;
    const std::vector<TriangleUvs> sliver = {{{{0, v}, {2e5f, v}, {1e5f, v}}}};
    Micromap micromap;
    micromap.indices = {specialIndex(State::Opaque)};
    BakeOptions options;
    options.cutoff = 0.999;
    const verify::Result result =
        verify::verify(texture, toCorners(sliver), micromap, verifyOptions(options.exactly()));
    EXPECT_EQ(result.counts.of(Kind::Wrong), 0u);
    EXPECT_EQ(result.counts.open, 1u);
}

TEST(Verify, TheChildrenAreThoseOfTheCurve)
{
    for (const uint32_t level : {1u, 2u, 3u, 5u}) {
        for (uint32_t micro = 0; micro < microTriangleCount(level); ++micro) {
            verify::MicroCorners corners{{{0, 0}, {1, 0}, {0, 1}}};
            for (uint32_t l = level; l-- > 0;)
                corners = verify::childrenOnCurve(corners)[(micro >> (2 * l)) & 3];
            const auto expected = microTriangleCorners(micro, level);
            const auto scale = static_cast<float>(1u << level);
            for (size_t c = 0; c < 3; ++c) {
                EXPECT_EQ(static_cast<float>(corners[c].i), expected[c].u * scale);
                EXPECT_EQ(static_cast<float>(corners[c].j), expected[c].v * scale);
            }
        }
    }
}

TEST(Verify, RejectsWhatItCannotRead)
{
    const AlphaTexture texture = leaves(8);
    const std::vector<TriangleCorners> triangles = toCorners(kCard);
    Micromap micromap;
    micromap.indices = {-1};
    EXPECT_THROW(verify::verify(texture, triangles, micromap, {}), std::invalid_argument); // one index for two
    micromap.indices = {-1, 0};
    EXPECT_THROW(verify::verify(texture, triangles, micromap, {}), std::invalid_argument); // no such triangle
    micromap.indices = {-1, -2};
    EXPECT_THROW(verify::verify({}, triangles, micromap, {}), std::invalid_argument);
}

// The margins include the rounding errors of the terms from which a coordinate was computed in single precision.
TEST(Verify, MarginsFollowTheTermsOfCoordinates)
{
    const AlphaTexture texture = leaves(64);
    BakeOptions bakeOptions;
    bakeOptions.level = 5;
    const Micromap micromap = bake(texture, kCard, bakeOptions).micromap;
    std::vector<TriangleCorners> corners = toCorners(kCard);
    EXPECT_EQ(verify::verify(texture, corners, micromap, {}).counts.of(Kind::OutsideMargins), 0u);
    BakeInput input;
    input.textures = {&texture, 1};
    input.triangles = kCard;
    for (const float terms : {4096.0f, 65536.0f}) {
        for (TriangleCorners &triangle : corners)
            triangle.terms = terms;
        EXPECT_GT(verify::verify(texture, corners, micromap, {}).counts.of(Kind::OutsideMargins), 0u);
        input.uvTerms = static_cast<double>(terms);
        const verify::Counts counts =
            verify::verify(texture, corners, bake({&input, 1}, bakeOptions).micromap, {}).counts;
        EXPECT_EQ(counts.of(Kind::OutsideMargins), 0u);
        EXPECT_EQ(counts.of(Kind::Needless), 0u);
    }
}
