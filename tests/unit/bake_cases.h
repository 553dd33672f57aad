// SPDX-License-Identifier: Apache-2.0
// Random textures and triangles for the tests of the bakers, and checks of the resulting states.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <ostream>
#include <vector>

#include <gtest/gtest.h>

#include "bake/bake.h"
#include "bake_oracle.h"
#include "test_random.h"

namespace vellum::test
{

inline constexpr Wrap kWraps[] = {Wrap::Repeat, Wrap::Mirror, Wrap::Clamp, Wrap::Border, Wrap::MirrorOnce};

// The corners of a micro-triangle in texels, unwrapped.
template <typename N>
std::vector<OraclePoint<N>> cornersOf(const AlphaTexture &texture, const TriangleUvs &uvs, uint32_t index,
                                      uint32_t level)
{
    std::vector<OraclePoint<N>> points;
    for (const Barycentrics &b : microTriangleCorners(index, level)) {
        const auto along = [&](float TexCoord::*axis, uint32_t size) {
            const N first = numberOf(double{uvs[0].*axis}, N{});
            const N second = numberOf(double{uvs[1].*axis}, N{});
            const N third = numberOf(double{uvs[2].*axis}, N{});
            return N(int64_t{size}) * (first + numberOf(double{b.u}, N{}) * (second - first) +
                                       numberOf(double{b.v}, N{}) * (third - first));
        };
        points.push_back({along(&TexCoord::u, texture.width), along(&TexCoord::v, texture.height)});
    }
    return points;
}

struct Tally {
    size_t all = 0;
    size_t mixed = 0;    // correct
    size_t wrong = 0;    // claims that the oracle contradicts
    size_t needless = 0; // unknown states that it does not find mixed
};

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

// Small textures with values of a few bits, so that alpha equals the cutoff all the time.
inline AlphaTexture coarseTexture(TestRandom &random, uint32_t width, uint32_t height)
{
    AlphaTexture t;
    t.width = width;
    t.height = height;
    const unsigned kind = random() % 3;
    for (uint32_t i = 0; i < width * height; ++i) {
        const unsigned bits = random();
        t.alpha.push_back(kind == 0 ? static_cast<float>(bits % 2)
                                    : static_cast<float>(bits % (kind == 1 ? 5 : 17)) / (kind == 1 ? 4.0f : 16.0f));
    }
    t.border = static_cast<float>(random() % 3) / 2;
    return t;
}

// Soft blobs, hard ones, or noise.
inline AlphaTexture smoothTexture(TestRandom &random, uint32_t width, uint32_t height)
{
    AlphaTexture t;
    t.width = width;
    t.height = height;
    const unsigned kind = random() % 3;
    const double cell = random.uniform(3, 12);
    for (uint32_t i = 0; i < width * height; ++i) {
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
inline std::vector<TriangleUvs> randomTriangles(TestRandom &random, uint32_t width, uint32_t height)
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
inline std::vector<OraclePoint<long double>> widened(const std::vector<OraclePoint<long double>> &corners,
                                                     long double x, long double y)
{
    using P = OraclePoint<long double>;
    std::vector<P> points;
    for (const P &p : corners)
        for (const int corner : {0, 1, 2, 3})
            points.push_back({p.x + (corner % 2 == 0 ? -x : x), p.y + (corner / 2 == 0 ? -y : y)});
    std::sort(points.begin(), points.end(), [](const P &a, const P &b) { return a.x != b.x ? a.x < b.x : a.y < b.y; });
    std::vector<P> hull;
    for (const bool back : {false, true}) {
        const size_t start = hull.size();
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

// The largest distance of samples from a triangle's micro-triangles, in texels along x and y, by the formula of
// docs/baking.md.
inline std::array<long double, 2> marginsOf(const BakeOptions &options, const AlphaTexture &texture,
                                            const TriangleUvs &uvs)
{
    const auto margin = [&](float TexCoord::*axis, double texels) -> long double {
        const double largest = std::max({std::abs(uvs[0].*axis), std::abs(uvs[1].*axis), std::abs(uvs[2].*axis)});
        const double slope =
            std::abs(double{uvs[1].*axis} - uvs[0].*axis) + std::abs(double{uvs[2].*axis} - uvs[0].*axis);
        return options.subtexelTolerance +
               texels * (largest * options.interpolationTolerance + slope * options.barycentricTolerance);
    };
    return {margin(&TexCoord::u, texture.width), margin(&TexCoord::v, texture.height)};
}

// A texture with a sampler, three triangles, and options without tolerances.
struct RandomCase {
    AlphaTexture texture;
    std::vector<TriangleUvs> triangles;
    BakeOptions options;
};

// Prints itself for SCOPED_TRACE.
inline std::ostream &operator<<(std::ostream &out, const RandomCase &c)
{
    const AlphaTexture &t = c.texture;
    return out << t.width << " x " << t.height << ", wraps " << static_cast<int>(t.wrapU) << ' '
               << static_cast<int>(t.wrapV) << (t.filter == Filter::Nearest ? ", nearest" : ", bilinear");
}

inline void setRandomSampler(TestRandom &random, AlphaTexture &t)
{
    t.wrapU = kWraps[random() % 5];
    t.wrapV = kWraps[random() % 5];
    t.filter = random() % 4 == 0 ? Filter::Nearest : Filter::Bilinear;
}

// Corners on texel centres, sides and quarters, and some nowhere, alpha equal to the cutoff all the time; slivers,
// segments and points. All numbers are fractions that the oracle's Rational can hold.
inline RandomCase caseOnGrid(TestRandom &random)
{
    constexpr std::array<uint32_t, 2> kSizes[] = {{1, 1}, {3, 5}, {4, 4}, {7, 2}, {1, 6}};
    const auto [width, height] = kSizes[random() % std::size(kSizes)];
    RandomCase c{.texture = coarseTexture(random, width, height)};
    setRandomSampler(random, c.texture);
    const unsigned steps = random() % 2 == 0 ? 2 * width : 8;
    const auto coordinate = [&random, steps](int64_t shift) {
        const auto k = static_cast<int64_t>(random() % (3 * steps)) + shift;
        return std::round(static_cast<float>(k) / static_cast<float>(steps) * 64) / 64;
    };
    for (int n = 0; n < 3; ++n) {
        const auto shift = static_cast<int64_t>(random() % 64) - 32;
        TriangleUvs uvs;
        for (TexCoord &uv : uvs)
            uv = {coordinate(shift), coordinate(-shift)};
        if (random() % 6 == 0)
            uvs[2] = uvs[0];
        if (random() % 12 == 0)
            uvs[1] = uvs[0];
        c.triangles.push_back(uvs);
    }
    c.options.exactly().level = random() % 4;
    const double cutoffs[] = {0.5, 0.25, 0.75, 0.4375, 1, 0};
    c.options.cutoff = cutoffs[random() % std::size(cutoffs)];
    return c;
}

// Textures and coordinates of all kinds. The sizes take turns.
inline RandomCase caseAnywhere(TestRandom &random, unsigned round)
{
    constexpr std::array<uint32_t, 2> kSizes[] = {{1, 1}, {3, 5}, {16, 16}, {64, 48}, {1023, 769}};
    const auto [width, height] = kSizes[round % std::size(kSizes)];
    RandomCase c{.texture = smoothTexture(random, width, height)};
    setRandomSampler(random, c.texture);
    c.triangles = randomTriangles(random, width, height);
    c.options.exactly().level = random() % 5;
    c.options.cutoff = random() % 2 == 0 ? 0.5 : random.uniform(0.05, 0.95);
    return c;
}

// A random case with the default tolerances and cutoff.
inline RandomCase caseWithTolerances(TestRandom &random, unsigned round)
{
    constexpr std::array<uint32_t, 2> kSizes[] = {{3, 5}, {16, 16}, {64, 48}, {255, 129}};
    const auto [width, height] = kSizes[round % std::size(kSizes)];
    RandomCase c{.texture = smoothTexture(random, width, height)};
    setRandomSampler(random, c.texture);
    c.triangles = randomTriangles(random, width, height);
    c.options.level = random() % 5;
    return c;
}

} // namespace vellum::test
