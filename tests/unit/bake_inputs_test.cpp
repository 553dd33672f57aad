// SPDX-License-Identifier: Apache-2.0
// Inputs of the baker: pixel formats, vertices, alpha tests, mip chains.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#ifdef __linux__
#include <sys/mman.h>
#include <unistd.h>
#endif

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

// The stored values, row by row.
std::vector<float> valuesOf(const AlphaTexture &texture)
{
    std::vector<float> values;
    for (uint32_t y = 0; y < texture.height; ++y)
        for (uint32_t x = 0; x < texture.width; ++x)
            values.push_back(texture.value(texture.place(x, y)));
    return values;
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

BakeOptions exactlyAtLevel(uint32_t level)
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
    EXPECT_EQ(valuesOf(readAlpha(pixels)), (std::vector<float>{0, 1, 0.2f, 0.4f}));
    pixels.scale = 0.5f;
    EXPECT_EQ(valuesOf(readAlpha(pixels)), (std::vector<float>{0, 0.5f, 0.1f, 0.2f}));
    const auto shorts = bytesOf<uint16_t>({0, 65535, 13107, 0});
    EXPECT_EQ(readAlpha({4, 1, AlphaFormat::Unorm16, shorts, 0, 2}).alpha, (std::vector<float>{0, 1, 0.2f, 0}));
    const auto halves = bytesOf<uint16_t>({0x3c00, 0x3800});
    EXPECT_EQ(readAlpha({1, 2, AlphaFormat::Float16, halves, 0, 2}).alpha, (std::vector<float>{1, 0.5f}));
    const auto floats = bytesOf<float>({7, 0.25f, 7, 0.75f});
    EXPECT_EQ(readAlpha({2, 1, AlphaFormat::Float32, floats, 4, 8}).alpha, (std::vector<float>{0.25f, 0.75f}));
}

// Codes of 8 bits give the same result as their values in single precision, for any strides, wrap modes and tests.
TEST(BakeInputs, CodesAreBakedAsTheirValues)
{
    test::TestRandom random(11);
    uint64_t unknown = 0;
    uint64_t known = 0;
    for (int n = 0; n < 300; ++n) {
        const uint32_t width = 1 + random() % 150;
        const uint32_t height = 1 + random() % 150;
        const size_t pixelStride = 1 + random() % 5;
        const size_t rowStride = width * pixelStride + random() % 3;
        std::vector<uint8_t> bytes(rowStride * height);
        const unsigned patch = 1 + random() % 9;
        for (size_t y = 0; y < height; ++y)
            for (size_t x = 0; x < width; ++x)
                bytes[y * rowStride + x * pixelStride] =
                    static_cast<uint8_t>((x / patch + y / patch) % 2 * 200 + random() % (random() % 8 == 0 ? 256 : 56));
        const float scales[] = {1, 0.7f, -1, 0};
        AlphaTexture codes =
            AlphaTexture::fromUnorm8(width, height, bytes.data(), pixelStride, rowStride, scales[random() % 16 / 5]);
        codes.wrapU = static_cast<Wrap>(random() % 5);
        codes.wrapV = static_cast<Wrap>(random() % 5);
        codes.filter = random() % 3 == 0 ? Filter::Nearest : Filter::Bilinear;
        codes.border = static_cast<float>(random() % 3) / 2;
        AlphaTexture values = codes;
        values.codes = {};
        values.alpha = valuesOf(codes);
        std::vector<TriangleUvs> triangles(2);
        for (TriangleUvs &uvs : triangles)
            for (TexCoord &corner : uvs)
                corner = {static_cast<float>(random.uniform(-1, 2)), static_cast<float>(random.uniform(-1, 2))};
        BakeOptions options = exactlyAtLevel(random() % 6);
        options.test = static_cast<AlphaTest>(random() % 4);
        const BakeResult a = bake(codes, triangles, options);
        const BakeResult b = bake(values, triangles, options);
        ASSERT_EQ(a.micromap.data, b.micromap.data) << n;
        ASSERT_EQ(a.micromap.indices, b.micromap.indices) << n;
        known += a.statistics.states[0] + a.statistics.states[1];
        unknown += a.statistics.states[2] + a.statistics.states[3];
    }
    EXPECT_GT(known, 10000u);
    EXPECT_GT(unknown, 10000u);
}

#ifdef __linux__
// Texels that no triangle comes near are not read: their memory is not even there.
TEST(BakeInputs, ReadsNoTexelFarFromTriangles)
{
    constexpr uint32_t kSize = 8192;
    constexpr size_t kBytes = size_t{kSize} * kSize;
    auto *const bytes = static_cast<uint8_t *>(mmap(nullptr, kBytes, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0));
    ASSERT_NE(bytes, MAP_FAILED);
    // Texels (1024, 2048) to (1535, 2559), two tiles of 64 around those that are covered.
    constexpr uint32_t kLeft = 1024;
    constexpr uint32_t kTop = 2048;
    constexpr uint32_t kSide = 512;
    const auto page = static_cast<size_t>(sysconf(_SC_PAGESIZE));
    for (size_t y = kTop; y < kTop + kSide; ++y) {
        const size_t first = (y * kSize + kLeft) / page * page;
        const size_t last = (y * kSize + kLeft + kSide + page - 1) / page * page;
        ASSERT_EQ(mprotect(bytes + first, last - first, PROT_READ | PROT_WRITE), 0);
        for (size_t x = kLeft; x < kLeft + kSide; ++x)
            bytes[y * kSize + x] =
                std::hypot(static_cast<double>(x) - 1280, static_cast<double>(y) - 2304) < 80 ? 255 : 0;
    }
    const AlphaTexture texture = AlphaTexture::fromUnorm8(kSize, kSize, bytes, 1, kSize);
    const auto at = [](float x, float y) { return TexCoord{x / kSize, y / kSize}; };
    const std::vector<TriangleUvs> triangles = {{{at(1160, 2184), at(1400, 2184), at(1160, 2424)}}};
    BakeOptions options;
    options.level = 6;
    options.threads = 2;
    const BakeResult result = bake(texture, triangles, options);
    EXPECT_GT(result.statistics.states[0], 100u);
    EXPECT_GT(result.statistics.states[1], 100u);
    munmap(bytes, kBytes);
}
#endif

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
        BakeOptions o = exactlyAtLevel(2);
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
    BakeOptions o = exactlyAtLevel(4);
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
    const BakeOptions o = exactlyAtLevel(5);
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
