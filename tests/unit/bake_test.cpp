// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "bake_options.h"

using namespace vellum;
using namespace vellum::test;

namespace
{

const TriangleUvs kLowerCard = {{{0, 0}, {1, 0}, {1, 1}}};
const TriangleUvs kUpperCard = {{{0, 0}, {1, 1}, {0, 1}}};

AlphaTexture uniformTexture(float alpha)
{
    AlphaTexture t;
    t.width = t.height = 8;
    t.alpha.assign(64, alpha);
    return t;
}

// Opaque where x < share, with sharp texels.
AlphaTexture halfTexture(uint32_t size, double share)
{
    AlphaTexture t;
    t.width = t.height = size;
    t.wrapU = t.wrapV = Wrap::Clamp;
    for (uint32_t i = 0; i < size * size; ++i)
        t.alpha.push_back(i % size < share * size ? 1.0f : 0.0f);
    return t;
}

} // namespace

TEST(Bake, UniformTexturesFoldToSpecialIndices)
{
    const std::vector<TriangleUvs> triangles = {kLowerCard, kUpperCard};
    const BakeResult clear = bake(uniformTexture(0), triangles, atLevel(4));
    EXPECT_EQ(clear.micromap.indices, (std::vector<int32_t>{-1, -1}));
    EXPECT_TRUE(clear.micromap.data.empty());
    EXPECT_EQ(clear.statistics.special[0], 2u);
    EXPECT_EQ(clear.statistics.states[0], 2u * 256);
    const BakeResult solid = bake(uniformTexture(1), triangles, atLevel(4));
    EXPECT_EQ(solid.micromap.indices, (std::vector<int32_t>{-2, -2}));
    // Within the tolerance of the cutoff nothing is proven; the guess is still right.
    EXPECT_EQ(bake(uniformTexture(0.501f), triangles, atLevel(4)).micromap.indices, (std::vector<int32_t>{-4, -4}));
    EXPECT_EQ(bake(uniformTexture(0.499f), triangles, atLevel(4)).micromap.indices, (std::vector<int32_t>{-3, -3}));
}

TEST(Bake, OnlyTheBorderIsUnknown)
{
    const BakeResult r = bake(halfTexture(256, 0.5), std::vector{kLowerCard, kUpperCard}, atLevel(6));
    const auto &s = r.statistics.states;
    const double all = 2 * 4096;
    // The border crosses 64 cells of the grid, in each of which two micro-triangles can meet it, on both of its sides.
    EXPECT_LE(static_cast<double>(s[2] + s[3]), 4.0 * 64);
    EXPECT_GT(static_cast<double>(s[0]) / all, 0.47);
    EXPECT_GT(static_cast<double>(s[1]) / all, 0.47);
}

TEST(Bake, LooksInsideCellsWhereMicroTrianglesAreSmall)
{
    // A ramp over one cell: whole-cell bounds would leave all of it unknown.
    AlphaTexture t;
    t.width = 2;
    t.height = 1;
    t.alpha = {0, 1};
    t.wrapU = t.wrapV = Wrap::Clamp;
    const BakeResult r = bake(t, std::vector<TriangleUvs>{kLowerCard}, atLevel(6));
    EXPECT_LT(static_cast<double>(r.statistics.states[2] + r.statistics.states[3]), 0.25 * 4096);
}

TEST(Bake, TwoStateKeepsTheBetterGuess)
{
    BakeOptions o = atLevel(5);
    o.format = Format::TwoState;
    const BakeResult r = bake(halfTexture(64, 0.25), std::vector{kLowerCard, kUpperCard}, o);
    EXPECT_EQ(r.micromap.validate(), std::nullopt);
    const auto &s = r.statistics.states;
    EXPECT_EQ(s[2] + s[3], 0u);
    EXPECT_NEAR(static_cast<double>(s[1]) / static_cast<double>(s[0] + s[1]), 0.25, 0.02);
}

TEST(Bake, SharesEqualTriangles)
{
    std::vector<TriangleUvs> triangles(100, kLowerCard);
    // The same part of a repeated texture as the first triangle.
    triangles.push_back({{{3, 5}, {4, 5}, {4, 6}}});
    AlphaTexture t = halfTexture(64, 0.5);
    t.wrapU = t.wrapV = Wrap::Repeat;
    const BakeResult r = bake(t, triangles, atLevel(3));
    EXPECT_EQ(r.statistics.distinct, 2u);
    EXPECT_EQ(r.micromap.triangles.size(), 1u);
    EXPECT_EQ(r.micromap.indices, std::vector<int32_t>(101, 0));
    EXPECT_EQ(usageOf(r.micromap.triangles, r.micromap.indices, r.micromap.baseTriangle),
              (std::vector<MicromapUsage>{{101, 3, Format::FourState}}));
}

TEST(Bake, HopelessCoordinatesAreUnknown)
{
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const float infinity = std::numeric_limits<float>::infinity();
    const std::vector<TriangleUvs> triangles = {{{{nan, 0}, {1, 0}, {0, 1}}},
                                                {{{0, 0}, {infinity, 0}, {0, 1}}},
                                                {{{0, 0}, {1, -infinity}, {0, 1}}},
                                                {{{0, 0}, {1e30f, 0}, {0, 1}}}};
    for (const auto &level : {std::optional<uint32_t>(3), std::optional<uint32_t>()}) {
        BakeOptions o;
        o.level = level;
        const BakeResult r = bake(halfTexture(64, 0.5), triangles, o);
        EXPECT_EQ(r.micromap.indices, (std::vector<int32_t>{-4, -4, -4, -4}));
    }
}

TEST(Bake, LargeCoordinatesAreSafe)
{
    // Ten thousand repetitions across: everything is somewhere, so all is unknown, and quickly.
    const std::vector<TriangleUvs> triangles = {{{{0, 0}, {10000, 0}, {0, 10000}}}};
    AlphaTexture t = halfTexture(64, 0.5);
    t.wrapU = Wrap::Repeat;
    const BakeResult r = bake(t, triangles, atLevel(4));
    EXPECT_EQ(r.statistics.states[2] + r.statistics.states[3], 256u);
    // Clamped, it is all outside, except the micro-triangles at the texture's side.
    const BakeResult clamped = bake(halfTexture(64, 0.5), triangles, atLevel(4));
    EXPECT_EQ(clamped.statistics.states[0], 256u - 31);
    EXPECT_EQ(clamped.statistics.states[2] + clamped.statistics.states[3], 31u);
}

TEST(Bake, DegenerateTriangles)
{
    const AlphaTexture t = halfTexture(64, 0.5);
    const std::vector<TriangleUvs> triangles = {
        {{{0.1f, 0.5f}, {0.1f, 0.5f}, {0.1f, 0.5f}}},  // a point that is opaque
        {{{0.9f, 0.1f}, {0.9f, 0.5f}, {0.9f, 0.9f}}},  // a line that is transparent
        {{{0.1f, 0.5f}, {0.9f, 0.5f}, {0.9f, 0.5f}}}}; // a line across the border
    const BakeResult r = bake(t, triangles, atLevel(4));
    EXPECT_EQ(r.micromap.indices[0], -2);
    EXPECT_EQ(r.micromap.indices[1], -1);
    EXPECT_EQ(r.micromap.indices[2], 0);
    BakeOptions automatic;
    EXPECT_EQ(bake(t, triangles, automatic).micromap.validate(), std::nullopt);
}

TEST(Bake, NanTexelsProveNothing)
{
    AlphaTexture t = uniformTexture(std::numeric_limits<float>::quiet_NaN());
    const BakeResult r = bake(t, std::vector{kLowerCard}, atLevel(2));
    EXPECT_EQ(r.statistics.states[0] + r.statistics.states[1], 0u);
}

TEST(Bake, AutomaticLevelsFollowTheTexture)
{
    BakeOptions o;
    o.texelsPerEdge = 4;
    const AlphaTexture t = halfTexture(256, 0.5);
    const TriangleUvs quarter = {{{0.25f, 0.25f}, {0.75f, 0.25f}, {0.75f, 0.75f}}};
    const BakeResult r = bake(t, std::vector{kLowerCard, quarter}, o);
    ASSERT_EQ(r.micromap.triangles.size(), 2u);
    EXPECT_EQ(r.micromap.triangles[0].subdivisionLevel, 6); // 256 texels / 4 = 2^6
    EXPECT_EQ(r.micromap.triangles[1].subdivisionLevel, 5);
    o.maxLevel = 3;
    EXPECT_EQ(bake(t, std::vector{kLowerCard}, o).micromap.triangles[0].subdivisionLevel, 3);
}

// Optimizers quantize coordinates: a card over the whole texture then reaches from 0 to 1.0002.
TEST(Bake, AutomaticLevelsAreNotRaisedByRounding)
{
    for (const auto &[width, height] : {std::pair{256u, 256u},
                                        {512u, 256u},
                                        {1024u, 128u},
                                        {384u, 256u},
                                        {1280u, 1024u},
                                        {640u, 512u},
                                        {1920u, 1080u},
                                        {1000u, 1000u}}) {
        AlphaTexture t = halfTexture(1, 0.5);
        t.width = width;
        t.height = height;
        t.alpha.resize(size_t{width} * height);
        for (size_t i = 0; i < t.alpha.size(); ++i)
            t.alpha[i] = i % width < width / 3 ? 1.0f : 0.0f;
        std::vector<uint16_t> levels;
        for (const float scale : {1.0f, 0.999f, 0.9998f, 0.99999f, 1.00001f, 1.0002f, 1.001f}) {
            TriangleUvs uvs = kLowerCard;
            for (TexCoord &corner : uvs)
                corner = {corner.u * scale, corner.v * scale};
            const BakeResult r = bake(t, std::vector{uvs}, {});
            ASSERT_EQ(r.micromap.triangles.size(), 1u);
            levels.push_back(r.micromap.triangles[0].subdivisionLevel);
        }
        EXPECT_EQ(levels, std::vector<uint16_t>(levels.size(), levels[0])) << width << " x " << height;
    }
}

TEST(Bake, TheResultDoesNotDependOnThreads)
{
    std::vector<TriangleUvs> triangles;
    for (int i = 0; i < 200; ++i) {
        const auto x = static_cast<float>(i) * 0.017f;
        triangles.push_back({{{x, 0}, {x + 0.4f, 0.1f}, {x, 0.9f}}});
    }
    const AlphaTexture t = halfTexture(64, 0.5);
    BakeOptions o = atLevel(4);
    o.threads = 1;
    const BakeResult one = bake(t, triangles, o);
    o.threads = 7;
    size_t calls = 0;
    size_t last = 0;
    o.progress = [&](size_t done, size_t total) {
        ++calls;
        EXPECT_EQ(total, 200u);
        EXPECT_GT(done, last);
        last = done;
    };
    const BakeResult seven = bake(t, triangles, o);
    EXPECT_EQ(one.micromap.data, seven.micromap.data);
    EXPECT_EQ(one.micromap.indices, seven.micromap.indices);
    EXPECT_EQ(calls, 200u);
    EXPECT_EQ(last, 200u);
}

TEST(Bake, Level12)
{
    const BakeResult r = bake(halfTexture(64, 0.5), std::vector{kLowerCard}, atLevel(12));
    EXPECT_EQ(r.micromap.data.size(), size_t{4} << 20);
    EXPECT_EQ(r.micromap.validate(), std::nullopt);
    EXPECT_EQ(r.micromap.stateAt(0, 0.1f, 0.1f), State::Opaque);
    EXPECT_EQ(r.micromap.stateAt(0, 0.9f, 0.05f), State::Transparent);
}

TEST(Bake, RejectsWhatItCannotDo)
{
    const AlphaTexture good = uniformTexture(1);
    const std::vector<TriangleUvs> triangles = {kLowerCard};
    EXPECT_THROW(bake(AlphaTexture{}, triangles, {}), BakeError);
    AlphaTexture cut = good;
    cut.alpha.pop_back();
    EXPECT_THROW(bake(cut, triangles, {}), BakeError);
    EXPECT_THROW(bake(good, triangles, atLevel(13)), BakeError);
    BakeOptions o;
    o.valueTolerance = -1;
    EXPECT_THROW(bake(good, triangles, o), BakeError);
    o = {};
    o.subtexelTolerance = 1025;
    EXPECT_THROW(bake(good, triangles, o), BakeError);
    o = {};
    o.interpolationTolerance = 0.1;
    EXPECT_THROW(bake(good, triangles, o), BakeError);
    o = {};
    o.cutoff = std::numeric_limits<double>::quiet_NaN();
    EXPECT_THROW(bake(good, triangles, o), BakeError);
    o = atLevel(8);
    o.maxDataBytes = 1000;
    EXPECT_THROW(bake(halfTexture(64, 0.5), triangles, o), BakeError);
    EXPECT_TRUE(bake(good, {}, {}).micromap.indices.empty());
}

TEST(AlphaTexture, WrapsAndFilters)
{
    AlphaTexture t;
    t.width = 4;
    t.height = 1;
    t.alpha = {0, 0.25f, 0.5f, 1};
    t.wrapV = Wrap::Clamp;
    t.wrapU = Wrap::Repeat;
    EXPECT_EQ(t.texel(-1, 7), 1.0f);
    EXPECT_EQ(t.texel(5, 0), 0.25f);
    EXPECT_DOUBLE_EQ(t.sample(0, 0.5), 0.5);      // between the last and the first
    EXPECT_DOUBLE_EQ(t.sample(0.25, 0.5), 0.125); // between the first two
    t.wrapU = Wrap::Mirror;
    EXPECT_EQ(t.texel(-1, 0), 0.0f);
    EXPECT_EQ(t.texel(4, 0), 1.0f);
    EXPECT_EQ(t.texel(7, 0), 0.0f);
    EXPECT_EQ(t.texel(8, 0), 0.0f);
    t.wrapU = Wrap::Clamp;
    EXPECT_EQ(t.texel(99, 0), 1.0f);
    EXPECT_DOUBLE_EQ(t.sample(-3, 0), 0);
    t.filter = Filter::Nearest;
    EXPECT_DOUBLE_EQ(t.sample(0.74, 0), 0.5);
    EXPECT_DOUBLE_EQ(t.sample(0.76, 0), 1);
}

TEST(AlphaTexture, TakesBytes)
{
    const uint8_t rgba[] = {9, 9, 9, 0, 9, 9, 9, 255};
    const AlphaTexture t = AlphaTexture::fromUnorm8(2, 1, rgba + 3, 4, 8, 0.5f);
    EXPECT_EQ(t.texel(0, 0), 0);
    EXPECT_EQ(t.texel(1, 0), 0.5f);
}
