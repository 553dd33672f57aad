// SPDX-License-Identifier: Apache-2.0
// Inputs of the baker: pixel formats, vertices, alpha tests, mip chains.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "bake/inputs.h"
#include "test_random.h"

using namespace vellum;

namespace
{

template <typename T>
std::vector<std::byte> bytesOf(const std::vector<T> &values)
{
    std::vector<std::byte> bytes(values.size() * sizeof(T));
    std::memcpy(bytes.data(), values.data(), bytes.size());
    return bytes;
}

AlphaTexture noise(unsigned seed, uint32_t width, uint32_t height)
{
    test::TestRandom random(seed);
    AlphaTexture t;
    t.width = width;
    t.height = height;
    for (uint32_t i = 0; i < width * height; ++i)
        t.alpha.push_back(static_cast<float>(random() % 5) / 4);
    return t;
}

// Cuts a square of `width` texels at texel borders and centres.
const std::vector<TriangleUvs> kTriangles = {
    {{{0, 0}, {1, 0}, {0, 1}}}, {{{0.25f, 0.5f}, {0.875f, 0.125f}, {0.5f, 1.5f}}}, {{{2, 2}, {1, 1}, {3, 1.0f}}}};

BakeOptions atLevel(uint32_t level)
{
    BakeOptions o;
    o.level = level;
    o.threads = 1;
    return o.exactly();
}

State stateOf(const BakeResult &r, uint32_t triangle, uint32_t i)
{
    const int32_t index = r.micromap.indices[triangle];
    if (const auto special = specialState(index))
        return *special;
    const MicromapTriangle &t = r.micromap.triangles[static_cast<size_t>(index)];
    return readState(r.micromap.data.data() + t.dataOffset, i, t.format);
}

} // namespace

TEST(BakeInputs, HalvesAreExact)
{
    EXPECT_EQ(halfToFloat(0x3c00), 1.0f);
    EXPECT_EQ(halfToFloat(0xb800), -0.5f);
    EXPECT_EQ(halfToFloat(0x0001), 0x1p-24f);
    EXPECT_EQ(halfToFloat(0x7bff), 65504.0f);
    EXPECT_EQ(halfToFloat(0x7c00), std::numeric_limits<float>::infinity());
    EXPECT_TRUE(std::isnan(halfToFloat(0x7e00)));
}

TEST(BakeInputs, AlphaOfAnyFormatAndStride)
{
    const auto rgba = bytesOf<uint8_t>({9, 9, 9, 0, 9, 9, 9, 255, 1, 1, 9, 9, 9, 51, 9, 9, 9, 102});
    AlphaPixels pixels{2, 2, AlphaFormat::Unorm8, rgba, 3, 4, 10};
    EXPECT_EQ(readAlpha(pixels).alpha, (std::vector<float>{0, 1, 0.2f, 0.4f}));
    pixels.scale = 0.5f;
    EXPECT_EQ(readAlpha(pixels).alpha, (std::vector<float>{0, 0.5f, 0.1f, 0.2f}));
    const auto shorts = bytesOf<uint16_t>({0, 65535, 13107, 0});
    EXPECT_EQ(readAlpha({4, 1, AlphaFormat::Unorm16, shorts, 0, 2}).alpha, (std::vector<float>{0, 1, 0.2f, 0}));
    const auto halves = bytesOf<uint16_t>({0x3c00, 0x3800});
    EXPECT_EQ(readAlpha({1, 2, AlphaFormat::Float16, halves, 0, 2}).alpha, (std::vector<float>{1, 0.5f}));
    const auto floats = bytesOf<float>({7, 0.25f, 7, 0.75f});
    EXPECT_EQ(readAlpha({2, 1, AlphaFormat::Float32, floats, 4, 8}).alpha, (std::vector<float>{0.25f, 0.75f}));
}

TEST(BakeInputs, RejectsAlphaOutsideItsBytes)
{
    const std::vector<std::byte> bytes(16);
    EXPECT_NO_THROW(readAlpha({4, 1, AlphaFormat::Unorm8, bytes, 3, 4}));
    EXPECT_THROW(readAlpha({4, 1, AlphaFormat::Unorm8, bytes, 4, 4}), BakeError);
    EXPECT_THROW(readAlpha({4, 2, AlphaFormat::Unorm8, bytes, 3, 4}), BakeError);
    EXPECT_THROW(readAlpha({2, 2, AlphaFormat::Float32, bytes, 0, 4, 9}), BakeError);
    EXPECT_THROW(readAlpha({1, 1, AlphaFormat::Unorm8, bytes, 17, 4}), BakeError);
    const uint32_t most = std::numeric_limits<uint32_t>::max();
    EXPECT_THROW(readAlpha({most, most, AlphaFormat::Unorm8, bytes, 0, size_t{1} << 60}), BakeError);
}

TEST(BakeInputs, CoordinatesOfAnyFormat)
{
    const std::vector<TriangleUvs> expected = {{{{0, 1}, {0.5f, 0.25f}, {0, 0}}}};
    const auto floats = bytesOf<float>({0, 1, 0.5f, 0.25f, 0, 0});
    EXPECT_EQ(readUvs({UvFormat::Float32, floats}), expected);
    const auto halves = bytesOf<uint16_t>({0, 0x3c00, 7, 0x3800, 0x3400, 7, 0, 0});
    EXPECT_EQ(readUvs({UvFormat::Float16, halves, 6}), expected);
    const auto shorts = bytesOf<uint16_t>({0, 65535, 13107, 0, 0, 0});
    EXPECT_EQ(readUvs({UvFormat::Unorm16, shorts}), (std::vector<TriangleUvs>{{{{0, 1}, {0.2f, 0}, {0, 0}}}}));

    const std::vector<TriangleUvs> indexed = {{{{0, 0}, {0.5f, 0.25f}, {0, 1}}}};
    const auto bytes = bytesOf<uint8_t>({2, 1, 0, 0});
    EXPECT_EQ(readUvs({UvFormat::Float32, floats, 0, IndexFormat::Uint8, bytes}), indexed);
    const auto words = bytesOf<uint16_t>({2, 1, 0});
    EXPECT_EQ(readUvs({UvFormat::Float32, floats, 0, IndexFormat::Uint16, words}), indexed);
    const auto longs = bytesOf<uint32_t>({2, 1, 0, 2, 1, 3});
    EXPECT_THROW(readUvs({UvFormat::Float32, floats, 0, IndexFormat::Uint32, longs}), BakeError);
    EXPECT_EQ(readUvs({UvFormat::Float32, floats, 0, IndexFormat::Uint32, std::span(longs).first(12)}), indexed);

    UvVertices turned{UvFormat::Float32, floats};
    turned.transform = {0, 2, 1, -1, 0, 3};
    EXPECT_EQ(readUvs(turned), (std::vector<TriangleUvs>{{{{3, 3}, {1.5f, 2.5f}, {1, 3}}}}));
}

// At the cutoff itself, each alpha test has the outcome of its comparison.
TEST(BakeInputs, AlphaTests)
{
    for (const AlphaTest test :
         {AlphaTest::GreaterOrEqual, AlphaTest::Greater, AlphaTest::LessOrEqual, AlphaTest::Less}) {
        const bool greater = test == AlphaTest::GreaterOrEqual || test == AlphaTest::Greater;
        const bool orEqual = test == AlphaTest::GreaterOrEqual || test == AlphaTest::LessOrEqual;
        BakeOptions o = atLevel(2);
        o.test = test;
        for (const float alpha : {0.25f, 0.5f, 0.75f}) {
            AlphaTexture t;
            t.width = t.height = 1;
            t.alpha = {alpha};
            const bool opaque = alpha == 0.5f ? orEqual : (alpha > 0.5f) == greater;
            EXPECT_EQ(bake(t, kTriangles, o).micromap.indices, std::vector<int32_t>(3, opaque ? -2 : -1))
                << static_cast<int>(test) << ' ' << alpha;
        }
    }
    // Elsewhere, one is the contrary of the other.
    const AlphaTexture t = noise(5, 7, 3);
    BakeOptions o = atLevel(4);
    const BakeResult at = bake(t, kTriangles, o);
    o.test = AlphaTest::Less;
    const BakeResult below = bake(t, kTriangles, o);
    for (uint32_t k = 0; k < kTriangles.size(); ++k)
        for (uint32_t i = 0; i < 256; ++i)
            EXPECT_EQ(static_cast<int>(stateOf(at, k, i)), static_cast<int>(stateOf(below, k, i)) ^ 1);
}

// A state of a mip chain is claimed exactly if it holds on each level.
TEST(BakeInputs, MipChains)
{
    const std::vector<AlphaTexture> mips = {noise(1, 9, 6), noise(2, 4, 3), noise(3, 2, 1), noise(4, 1, 1)};
    const BakeOptions o = atLevel(5);
    const BakeInput input{mips, kTriangles};
    const BakeResult together = bake(std::span(&input, 1), o);
    std::vector<BakeResult> alone;
    for (const AlphaTexture &mip : mips)
        alone.push_back(bake(mip, kTriangles, o));
    size_t known = 0;
    for (uint32_t k = 0; k < kTriangles.size(); ++k) {
        for (uint32_t i = 0; i < microTriangleCount(5); ++i) {
            const State first = stateOf(alone[0], k, i);
            bool agree = first == State::Opaque || first == State::Transparent;
            for (const BakeResult &r : alone)
                agree = agree && stateOf(r, k, i) == first;
            const State state = stateOf(together, k, i);
            EXPECT_EQ(state == State::Opaque || state == State::Transparent, agree);
            known += agree ? 1u : 0u;
            if (agree) {
                EXPECT_EQ(state, first);
            }
        }
    }
    EXPECT_GT(known, 0u);
}
