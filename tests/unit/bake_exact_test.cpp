// The baker's states against the oracle of bake_oracle.h: with no tolerances, equal to the mathematics.
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "bake/bake.h"
#include "bake_oracle.h"
#include "test_random.h"

using namespace vellum;
using test::Oracle;
using test::OraclePoint;
using test::Rational;

namespace
{

constexpr Wrap kWraps[] = {Wrap::Repeat, Wrap::Mirror, Wrap::Clamp, Wrap::Border, Wrap::MirrorOnce};

BakeOptions exactly(std::uint32_t level)
{
    BakeOptions o;
    o.level = level;
    o.threads = 1;
    o.valueTolerance = o.subtexelTolerance = o.barycentricTolerance = o.interpolationTolerance = 0;
    return o;
}

// The corners of a micro-triangle in texels, unwrapped.
template <typename N>
std::vector<OraclePoint<N>> cornersOf(const AlphaTexture &texture, const TriangleUvs &uvs, std::uint32_t index,
                                      std::uint32_t level)
{
    std::vector<OraclePoint<N>> points;
    for (const Barycentrics &b : microTriangleCorners(index, level)) {
        const auto along = [&](float TexCoord::*axis, std::uint32_t size) {
            const N first = test::numberOf(double{uvs[0].*axis}, N{});
            const N second = test::numberOf(double{uvs[1].*axis}, N{});
            const N third = test::numberOf(double{uvs[2].*axis}, N{});
            return N(std::int64_t{size}) * (first + test::numberOf(double{b.u}, N{}) * (second - first) +
                                            test::numberOf(double{b.v}, N{}) * (third - first));
        };
        points.push_back({along(&TexCoord::u, texture.width), along(&TexCoord::v, texture.height)});
    }
    return points;
}

struct Tally {
    std::size_t all = 0;
    std::size_t mixed = 0;    // as they should be
    std::size_t wrong = 0;    // claims that the oracle contradicts
    std::size_t needless = 0; // unknown states that it does not find mixed
};

State stateOf(const BakeResult &result, std::uint32_t triangle, std::uint32_t index, std::uint32_t level)
{
    const std::int32_t special = result.micromap.indices[triangle];
    if (const auto state = specialState(special))
        return *state;
    const MicromapTriangle &t = result.micromap.triangles[static_cast<std::size_t>(special)];
    EXPECT_EQ(t.subdivisionLevel, level);
    return readState(result.micromap.data.data() + t.dataOffset, index, t.format);
}

// Compares a state with the extremes of the alpha values that it stands for. Within `hidden` of the thresholds both
// answers pass.
template <typename N>
void tally(Tally &tally, State state, const N &least, const N &most, const N &transparent, const N &opaque,
           const N &hidden)
{
    ++tally.all;
    const bool isOpaque = !(least < opaque);
    const bool isTransparent = most < transparent;
    tally.mixed += isOpaque || isTransparent ? 0u : 1u;
    if (state == State::Opaque)
        tally.wrong += least < opaque - hidden ? 1u : 0u;
    else if (state == State::Transparent)
        tally.wrong += most < transparent + hidden ? 0u : 1u;
    else
        tally.needless += !(least < opaque + hidden) || most < transparent - hidden ? 1u : 0u;
}

template <typename N>
void compareAll(Tally &sum, const AlphaTexture &texture, const std::vector<TriangleUvs> &triangles,
                const BakeOptions &options, const N &hidden)
{
    const BakeResult result = bake(texture, triangles, options);
    ASSERT_EQ(result.micromap.validate(), std::nullopt);
    const N cutoff = test::numberOf(options.cutoff, N{});
    for (std::uint32_t t = 0; t < triangles.size(); ++t) {
        for (std::uint32_t i = 0; i < microTriangleCount(*options.level); ++i) {
            Oracle<N> oracle(texture);
            oracle.addPolygon(cornersOf<N>(texture, triangles[t], i, *options.level));
            const Tally before = sum;
            const State state = stateOf(result, t, i, *options.level);
            tally(sum, state, oracle.least(), oracle.most(), cutoff, cutoff, hidden);
            ASSERT_TRUE(sum.wrong == before.wrong && sum.needless == before.needless)
                << "triangle " << t << ", micro-triangle " << i << " is " << static_cast<int>(state) << ", alpha from "
                << static_cast<double>(oracle.least()) << " to " << static_cast<double>(oracle.most());
        }
    }
}

// Small textures with values of a few bits, so that alpha equals the cutoff all the time.
AlphaTexture coarseTexture(test::TestRandom &random, std::uint32_t width, std::uint32_t height)
{
    AlphaTexture t;
    t.width = width;
    t.height = height;
    const unsigned kind = random() % 3;
    for (std::uint32_t i = 0; i < width * height; ++i) {
        const unsigned bits = random();
        t.alpha.push_back(kind == 0 ? static_cast<float>(bits % 2)
                                    : static_cast<float>(bits % (kind == 1 ? 5 : 17)) / (kind == 1 ? 4.0f : 16.0f));
    }
    t.border = static_cast<float>(random() % 3) / 2;
    return t;
}

// Soft blobs, hard ones, or noise.
AlphaTexture smoothTexture(test::TestRandom &random, std::uint32_t width, std::uint32_t height)
{
    AlphaTexture t;
    t.width = width;
    t.height = height;
    const unsigned kind = random() % 3;
    const double cell = random.uniform(3, 12);
    for (std::uint32_t i = 0; i < width * height; ++i) {
        const double x = i % width / cell;
        const double y = i / width / cell;
        const double wave = 0.5 + 0.5 * std::sin(x) * std::sin(y + std::sin(x * 0.7));
        const double alpha = kind == 0 ? random.uniform(0, 1) : kind == 1 ? wave : std::round(wave);
        t.alpha.push_back(static_cast<float>(std::lround(alpha * 255)) / 255.0f);
    }
    t.border = static_cast<float>(random() % 3) / 2;
    return t;
}

// Near the origin and up to 1000 away, from a part of a texel to some twenty texels or the whole texture; some of them
// slivers.
std::vector<TriangleUvs> randomTriangles(test::TestRandom &random, std::uint32_t width, std::uint32_t height)
{
    std::vector<TriangleUvs> triangles;
    for (int n = 0; n < 3; ++n) {
        const double far = random() % 3 == 0 ? 1000 : 1.5;
        const double u = random.uniform(-far, far);
        const double v = random.uniform(-far, far);
        const double texels[] = {0.3, 3, 20, 40};
        const double size = texels[random() % std::size(texels)];
        TriangleUvs uvs;
        for (TexCoord &uv : uvs)
            uv = {static_cast<float>(u + random.uniform(0, size) / width),
                  static_cast<float>(v + random.uniform(0, size) / height)};
        if (random() % 4 == 0) { // a sliver, or no area at all
            const float along = static_cast<float>(random.uniform(0, 1));
            uvs[2] = {uvs[0].u + along * (uvs[1].u - uvs[0].u), uvs[0].v + along * (uvs[1].v - uvs[0].v)};
            if (random() % 2 == 0)
                uvs[2].v = std::nextafter(uvs[2].v, 2000.0f);
        }
        triangles.push_back(uvs);
    }
    return triangles;
}

// The Minkowski sum of a triangle and a box: the convex hull of the sums of their corners.
std::vector<OraclePoint<long double>> widened(const std::vector<OraclePoint<long double>> &corners, long double x,
                                              long double y)
{
    using P = OraclePoint<long double>;
    std::vector<P> points;
    for (const P &p : corners)
        for (const int corner : {0, 1, 2, 3})
            points.push_back({p.x + (corner % 2 == 0 ? -x : x), p.y + (corner / 2 == 0 ? -y : y)});
    std::sort(points.begin(), points.end(), [](const P &a, const P &b) { return a.x != b.x ? a.x < b.x : a.y < b.y; });
    std::vector<P> hull;
    for (const bool back : {false, true}) {
        const std::size_t start = hull.size();
        for (const P &p : points) {
            const auto turnsRight = [&] {
                const P &a = hull[hull.size() - 2];
                const P &b = hull.back();
                return (b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x) <= 0;
            };
            while (hull.size() >= start + 2 && turnsRight())
                hull.pop_back();
            hull.push_back(p);
        }
        hull.pop_back();
        std::reverse(points.begin(), points.end());
        static_cast<void>(back);
    }
    return hull;
}

void describe(testing::Message &message, const AlphaTexture &t)
{
    message << t.width << " x " << t.height << ", wraps " << static_cast<int>(t.wrapU) << ' '
            << static_cast<int>(t.wrapV) << (t.filter == Filter::Nearest ? ", nearest" : ", bilinear");
}

} // namespace

TEST(BakeExact, EqualsExactArithmeticOnGrids)
{
    test::TestRandom random(1);
    constexpr std::array<std::uint32_t, 2> kSizes[] = {{1, 1}, {3, 5}, {4, 4}, {7, 2}, {1, 6}};
    Tally sum;
    for (unsigned round = 0; round < 500 && !HasFatalFailure(); ++round) {
        const auto [width, height] = kSizes[random() % std::size(kSizes)];
        AlphaTexture t = coarseTexture(random, width, height);
        t.wrapU = kWraps[random() % 5];
        t.wrapV = kWraps[random() % 5];
        t.filter = random() % 3 == 0 ? Filter::Nearest : Filter::Bilinear;
        testing::Message message;
        message << "round " << round << ": ";
        describe(message, t);
        SCOPED_TRACE(message);
        // Corners on texel centres, sides and quarters, and some nowhere; slivers, segments and points.
        const unsigned steps = random() % 2 == 0 ? 2 * width : 8;
        const auto coordinate = [&](std::int64_t shift) {
            const auto k = static_cast<std::int64_t>(random() % (3 * steps)) + shift;
            return static_cast<float>(k) / static_cast<float>(steps);
        };
        std::vector<TriangleUvs> triangles;
        for (int n = 0; n < 3; ++n) {
            const auto shift = static_cast<std::int64_t>(random() % 64) - 32;
            TriangleUvs uvs;
            for (TexCoord &uv : uvs) {
                uv = {coordinate(shift), coordinate(-shift)};
                // 1/3 and the like are longer than the fractions of the oracle can be.
                uv.u = std::round(uv.u * 64) / 64;
                uv.v = std::round(uv.v * 64) / 64;
            }
            if (random() % 6 == 0)
                uvs[2] = uvs[0];
            if (random() % 12 == 0)
                uvs[1] = uvs[0];
            triangles.push_back(uvs);
        }
        BakeOptions options = exactly(random() % 4);
        const double cutoffs[] = {0.5, 0.25, 0.75, 0.4375, 1, 0};
        options.cutoff = cutoffs[random() % std::size(cutoffs)];
        compareAll<Rational>(sum, t, triangles, options, Rational(0));
    }
    EXPECT_EQ(sum.wrong, 0u);
    EXPECT_EQ(sum.needless, 0u);
    EXPECT_GT(sum.mixed, sum.all / 10);
    EXPECT_LT(sum.mixed, sum.all - sum.all / 10);
    RecordProperty("microTriangles", std::to_string(sum.all));
    RecordProperty("mixed", std::to_string(sum.mixed));
}

// Any textures and coordinates, in long double: what is within its rounding of the cutoff may be either.
TEST(BakeExact, EqualsTheMathematicsAnywhere)
{
    test::TestRandom random(2);
    constexpr std::array<std::uint32_t, 2> kSizes[] = {{1, 1}, {3, 5}, {16, 16}, {64, 48}, {1023, 769}};
    Tally sum;
    for (unsigned round = 0; round < 400 && !HasFatalFailure(); ++round) {
        const auto [width, height] = kSizes[round % std::size(kSizes)];
        AlphaTexture t = smoothTexture(random, width, height);
        t.wrapU = kWraps[random() % 5];
        t.wrapV = kWraps[random() % 5];
        t.filter = random() % 4 == 0 ? Filter::Nearest : Filter::Bilinear;
        testing::Message message;
        message << "round " << round << ": ";
        describe(message, t);
        SCOPED_TRACE(message);
        BakeOptions options = exactly(random() % 5);
        options.cutoff = random() % 2 == 0 ? 0.5 : random.uniform(0.05, 0.95);
        compareAll<long double>(sum, t, randomTriangles(random, width, height), options, 1e-11L);
    }
    EXPECT_EQ(sum.wrong, 0u);
    EXPECT_EQ(sum.needless, 0u);
    EXPECT_GT(sum.mixed, sum.all / 50);
    RecordProperty("microTriangles", std::to_string(sum.all));
    RecordProperty("mixed", std::to_string(sum.mixed));
}

// With tolerances, the same over the micro-triangle with its margins: their Minkowski sum.
TEST(BakeExact, TolerancesCostNoMoreThanTheyAskFor)
{
    test::TestRandom random(3);
    constexpr std::array<std::uint32_t, 2> kSizes[] = {{3, 5}, {16, 16}, {64, 48}, {255, 129}};
    Tally sum;
    for (unsigned round = 0; round < 300 && !HasFatalFailure(); ++round) {
        const auto [width, height] = kSizes[round % std::size(kSizes)];
        AlphaTexture t = smoothTexture(random, width, height);
        t.wrapU = kWraps[random() % 5];
        t.wrapV = kWraps[random() % 5];
        t.filter = random() % 4 == 0 ? Filter::Nearest : Filter::Bilinear;
        testing::Message message;
        message << "round " << round << ": ";
        describe(message, t);
        SCOPED_TRACE(message);
        BakeOptions options;
        options.threads = 1;
        options.level = random() % 5;
        const std::vector<TriangleUvs> triangles = randomTriangles(random, width, height);
        const BakeResult result = bake(t, triangles, options);
        for (std::uint32_t k = 0; k < triangles.size(); ++k) {
            const TriangleUvs &uvs = triangles[k];
            // As docs/baking.md has it.
            const auto margin = [&](float TexCoord::*axis, double texels) {
                const double largest =
                    std::max({std::abs(uvs[0].*axis), std::abs(uvs[1].*axis), std::abs(uvs[2].*axis)});
                const double slope =
                    std::abs(double{uvs[1].*axis} - uvs[0].*axis) + std::abs(double{uvs[2].*axis} - uvs[0].*axis);
                return options.subtexelTolerance +
                       texels * (largest * options.interpolationTolerance + slope * options.barycentricTolerance);
            };
            const long double marginX = margin(&TexCoord::u, width);
            const long double marginY = margin(&TexCoord::v, height);
            for (std::uint32_t i = 0; i < microTriangleCount(*options.level); ++i) {
                Oracle<long double> oracle(t);
                oracle.addPolygon(widened(cornersOf<long double>(t, uvs, i, *options.level), marginX, marginY));
                tally<long double>(sum, stateOf(result, k, i, *options.level), oracle.least(), oracle.most(),
                                   options.cutoff - options.valueTolerance, options.cutoff + options.valueTolerance,
                                   1e-11L);
            }
        }
        ASSERT_EQ(sum.wrong, 0u);
    }
    EXPECT_LE(sum.needless * 1000, sum.all);
    EXPECT_GT(sum.mixed, sum.all / 50);
    RecordProperty("microTriangles", std::to_string(sum.all));
    RecordProperty("mixed", std::to_string(sum.mixed));
    RecordProperty("needless", std::to_string(sum.needless));
}
