// SPDX-License-Identifier: Apache-2.0
// Inputs of the GPU baker: indices, texture coordinates and images of all kinds, and invalid ones.
#include <bit>
#include <cmath>
#include <limits>

#include "bake_cases.h"
#include "gpu_bake_run.h"

namespace
{

using namespace vt;
using namespace vellum;

class GpuBakeInputs : public GpuBakeTest
{
protected:
    GpuBakeInputs()
    {
        // A disc on nothing.
        texture_.width = 32;
        texture_.height = 24;
        for (uint32_t i = 0; i < 32 * 24; ++i)
            texture_.alpha.push_back(std::hypot(i % 32 - 15.7, i / 32 - 11.2) < 9 ? 1.0f : 0.0f);
        options_.level = 3;
        triangles_ = {
            {{{0, 0}, {1, 0}, {0, 1}}}, {{{1, 1}, {0, 1}, {1, 0}}}, {{{0.25f, 0.5f}, {0.75f, 0.25f}, {0, 0}}}};
    }

    GpuBaked bake(const Mesh &mesh)
    {
        const AlphaImage image(gpu(), std::span(&texture_, 1), AlphaImage::Format::Float);
        return runner_.bake(image, mesh, options_);
    }
    // Checks that the first triangles have the same states as those of triangles_.
    void expectSame(const GpuBaked &baked)
    {
        const GpuBaked expected = bake(Mesh::of(triangles_));
        for (uint32_t t = 0; t < triangles_.size(); ++t)
            for (uint32_t i = 0; i < microTriangleCount(options_.level); ++i)
                ASSERT_EQ(baked.stateOf(t, i), expected.stateOf(t, i)) << t << ' ' << i;
    }

    AlphaTexture texture_;
    GpuBakeOptions options_;
    std::vector<TriangleUvs> triangles_;
};

template <typename T>
void append(std::vector<uint8_t> &bytes, T value)
{
    const auto *raw = reinterpret_cast<const uint8_t *>(&value);
    bytes.insert(bytes.end(), raw, raw + sizeof value);
}

// Exact for k/64, 0 <= k <= 64.
uint16_t halfOf(float value)
{
    const uint32_t bits = std::bit_cast<uint32_t>(value);
    return bits == 0 ? uint16_t{0} : static_cast<uint16_t>((bits >> 13) - ((127u - 15u) << 10));
}

} // namespace

// The vertices of triangles_ backwards, so that they are reached by indices only.
TEST_F(GpuBakeInputs, IndicesOfAllTypes)
{
    for (const VkIndexType type : {VK_INDEX_TYPE_UINT8_EXT, VK_INDEX_TYPE_UINT16, VK_INDEX_TYPE_UINT32}) {
        SCOPED_TRACE(type);
        Mesh mesh = Mesh::of(triangles_);
        std::vector<TexCoord> uvs;
        for (const TriangleUvs &triangle : triangles_)
            uvs.insert(uvs.end(), triangle.begin(), triangle.end());
        std::reverse(uvs.begin(), uvs.end());
        std::memcpy(mesh.uvs.data(), uvs.data(), mesh.uvs.size());
        mesh.indexType = type;
        for (uint32_t i = 9; i-- > 0;) {
            if (type == VK_INDEX_TYPE_UINT8_EXT)
                append(mesh.indices, static_cast<uint8_t>(i));
            else if (type == VK_INDEX_TYPE_UINT16)
                append(mesh.indices, static_cast<uint16_t>(i));
            else
                append(mesh.indices, i);
        }
        expectSame(bake(mesh));
    }
}

TEST_F(GpuBakeInputs, IndicesOutOfRangeMakeUnknownTriangles)
{
    for (const uint32_t wrong : {9u, 1000000u, 0x7fffffffu, 0xffffffffu}) {
        SCOPED_TRACE(wrong);
        Mesh mesh = Mesh::of(triangles_);
        mesh.indexType = VK_INDEX_TYPE_UINT32;
        mesh.triangles = 6;
        for (uint32_t i = 0; i < 9; ++i)
            append(mesh.indices, i);
        for (uint32_t t = 0; t < 3; ++t)
            for (uint32_t corner = 0; corner < 3; ++corner)
                append(mesh.indices, corner == t ? wrong : corner);
        const GpuBaked baked = bake(mesh);
        expectSame(baked);
        for (uint32_t t = 3; t < 6; ++t)
            EXPECT_EQ(baked.indices[t], specialIndex(State::UnknownOpaque));
    }
}

TEST_F(GpuBakeInputs, TextureCoordinatesThatAreNotFinite)
{
    constexpr float kWrong[] = {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(),
                                -std::numeric_limits<float>::infinity(), 3e38f, -524288.0f};
    std::vector<TriangleUvs> all = triangles_;
    for (const float wrong : kWrong) {
        for (size_t k = 0; k < 6; ++k) {
            TriangleUvs uvs = triangles_[0];
            (k % 2 == 0 ? uvs[k / 2].u : uvs[k / 2].v) = wrong;
            if (wrong == -524288.0f) // times 24 that is near enough
                uvs[k / 2].u = wrong;
            all.push_back(uvs);
        }
    }
    const GpuBaked baked = bake(Mesh::of(all));
    expectSame(baked);
    for (size_t t = triangles_.size(); t < all.size(); ++t)
        EXPECT_EQ(baked.indices[t], specialIndex(State::UnknownOpaque)) << t;
}

TEST_F(GpuBakeInputs, FormatsAndStridesOfTextureCoordinates)
{
    const GpuBaked expected = bake(Mesh::of(triangles_));
    for (const VkFormat format : {VK_FORMAT_R32G32_SFLOAT, VK_FORMAT_R16G16_SFLOAT}) {
        for (const uint32_t gap : {0u, 4u, 6u}) {
            if (format == VK_FORMAT_R32G32_SFLOAT && gap == 6)
                continue; // not a multiple of a component
            SCOPED_TRACE(testing::Message() << format << " with " << gap);
            Mesh mesh = Mesh::of(triangles_);
            mesh.uvFormat = format;
            mesh.uvStride = (format == VK_FORMAT_R32G32_SFLOAT ? 8 : 4) + gap;
            mesh.uvs.clear();
            for (const TriangleUvs &triangle : triangles_) {
                for (const TexCoord &uv : triangle) {
                    for (const float c : {uv.u, uv.v}) {
                        if (format == VK_FORMAT_R32G32_SFLOAT)
                            append(mesh.uvs, c);
                        else
                            append(mesh.uvs, halfOf(c));
                    }
                    mesh.uvs.resize(mesh.uvs.size() + gap, 0x77);
                }
            }
            expectSame(bake(mesh));
        }
    }
    // Halves and quarters are no 65535ths: only the corners of the texture are alike.
    triangles_.resize(2);
    Mesh mesh = Mesh::of(triangles_);
    mesh.uvFormat = VK_FORMAT_R16G16_UNORM;
    mesh.uvStride = 4;
    mesh.uvs.clear();
    for (const TriangleUvs &triangle : triangles_)
        for (const TexCoord &uv : triangle)
            for (const float c : {uv.u, uv.v})
                append(mesh.uvs, static_cast<uint16_t>(std::lround(c * 65535.0f)));
    expectSame(bake(mesh));
    // A denormal half is not nothing.
    mesh.uvFormat = VK_FORMAT_R16G16_SFLOAT;
    mesh.triangles = 1;
    mesh.vertices = 3;
    mesh.uvs.clear();
    for (const unsigned half : {0x0000u, 0x8001u, 0x03ffu, 0x83ffu, 0x0001u, 0x0000u})
        append(mesh.uvs, static_cast<uint16_t>(half));
    texture_.wrapU = texture_.wrapV = Wrap::Border;
    texture_.border = 1; // and the corner of the texture is 0: nothing but 0.5 at its very corner
    texture_.filter = Filter::Nearest;
    options_.subtexelTolerance = options_.barycentricTolerance = options_.interpolationTolerance = 0;
    const GpuBaked small = bake(mesh);
    EXPECT_GE(small.indices[0], 0) << "both inside and outside of the texture";
}

TEST_F(GpuBakeInputs, TexelsOfFourComponents)
{
    test::TestRandom random(4);
    AlphaTexture t = test::smoothTexture(random, 37, 21);
    std::vector<TriangleUvs> triangles;
    for (int i = 0; i < 10; ++i)
        for (const TriangleUvs &uvs : test::randomTriangles(random, 37, 21))
            triangles.push_back(uvs);
    options_.cutoff = 0.4321; // far from a 255th
    const AlphaImage floats(gpu(), std::span(&t, 1), AlphaImage::Format::Float);
    const AlphaImage bytes(gpu(), std::span(&t, 1), AlphaImage::Format::Unorm8);
    const GpuBaked expected = runner_.bake(floats, Mesh::of(triangles), options_);
    const GpuBaked baked = runner_.bake(bytes, Mesh::of(triangles), options_);
    EXPECT_EQ(baked.indices, expected.indices);
    size_t different = 0;
    for (uint32_t k = 0; k < triangles.size(); ++k)
        for (uint32_t i = 0; i < 64; ++i)
            different += baked.stateOf(k, i) != expected.stateOf(k, i) ? 1u : 0u;
    EXPECT_LE(different, 2u) << "a driver may turn bytes into floats in a way of its own";
}

// A claim holds on each mip level, as with the CPU baker.
TEST_F(GpuBakeInputs, MipLevels)
{
    test::TestRandom random(5);
    size_t known = 0;
    for (int round = 0; round < 10; ++round) {
        std::vector<AlphaTexture> levels;
        for (uint32_t n = 0; n < 4; ++n) {
            levels.push_back(test::smoothTexture(random, 27u >> n, 40u >> n));
            levels.back().wrapU = test::kWraps[round % 5];
            levels.back().wrapV = test::kWraps[round / 2 % 5];
            levels.back().filter = round % 4 == 3 ? Filter::Nearest : Filter::Bilinear;
            levels.back().border = 0;
        }
        std::vector<TriangleUvs> triangles;
        for (int i = 0; i < 5; ++i)
            for (const TriangleUvs &uvs : test::randomTriangles(random, 27, 40))
                triangles.push_back(uvs);
        BakeOptions options;
        options.level = 4;
        const BakeInput input{levels, triangles};
        const vellum::Micromap cpu = vellum::bake(std::span(&input, 1), options).micromap;
        const AlphaImage image(gpu(), levels, AlphaImage::Format::Float);
        const GpuBaked baked = runner_.bake(image, Mesh::of(triangles), onGpu(options));
        for (uint32_t k = 0; k < triangles.size(); ++k) {
            for (uint32_t i = 0; i < 256; ++i) {
                const auto corners = microTriangleCorners(i, 4);
                const State expected = cpu.stateAt(k, (corners[0].u + corners[1].u + corners[2].u) / 3,
                                                   (corners[0].v + corners[1].v + corners[2].v) / 3);
                const State state = baked.stateOf(k, i);
                if (state == State::Opaque || state == State::Transparent) {
                    ASSERT_EQ(state, expected) << round << ": " << k << ' ' << i;
                    ++known;
                }
            }
        }
    }
    EXPECT_GT(known, 3000u);
}

// Numbers of any bits, in textures, coordinates and cutoffs: claims are those of the CPU baker. Where it has none,
// because some texel is huge and its bound for rounding with it, the oracle decides.
TEST_F(GpuBakeInputs, AnyNumbersAreSafe)
{
    test::TestRandom random(9);
    const auto anyFloat = [&] {
        const uint32_t bits = random();
        switch (random() % 4) {
        case 0: return static_cast<float>(random.uniform(-3, 3));
        case 1: return std::bit_cast<float>(bits);
        case 2: return std::ldexp(static_cast<float>(random.uniform(-1, 1)), static_cast<int>(bits % 40) - 24);
        default: return static_cast<float>(bits % 9) / 4 - 1;
        }
    };
    size_t known = 0;
    size_t unlike = 0;
    for (unsigned round = 0; round < 150; ++round) {
        SCOPED_TRACE(round);
        AlphaTexture t;
        t.width = 1 + random() % 9;
        t.height = 1 + random() % 9;
        t.wrapU = test::kWraps[random() % 5];
        t.wrapV = test::kWraps[random() % 5];
        t.filter = random() % 2 == 0 ? Filter::Nearest : Filter::Bilinear;
        t.border = anyFloat();
        const bool tame = random() % 2 == 0;
        for (uint32_t i = 0; i < t.width * t.height; ++i)
            t.alpha.push_back(tame ? static_cast<float>(random() % 3) / 2 : anyFloat());
        std::vector<TriangleUvs> triangles(8);
        for (TriangleUvs &uvs : triangles)
            for (TexCoord &uv : uvs)
                uv = {anyFloat(), anyFloat()};
        BakeOptions o;
        o.threads = 1;
        o.level = random() % 4;
        o.test = static_cast<AlphaTest>(random() % 4);
        const float cutoff = anyFloat();
        o.cutoff = std::isnan(cutoff) || random() % 2 == 0 ? 0.5 : double{cutoff};
        if (random() % 2 == 0)
            o.exactly();
        const vellum::Micromap cpu = vellum::bake(t, triangles, o).micromap;
        const GpuBaked baked = runner_.bake(t, triangles, onGpu(o));
        ASSERT_EQ(baked.micromap().validate(), std::nullopt);
        const bool swapped = o.test == AlphaTest::Less || o.test == AlphaTest::LessOrEqual;
        for (uint32_t k = 0; k < triangles.size(); ++k) {
            for (uint32_t i = 0; i < microTriangleCount(*o.level); ++i) {
                const State state = baked.stateOf(k, i);
                if (state != State::Opaque && state != State::Transparent)
                    continue;
                ++known;
                const auto corners = microTriangleCorners(i, *o.level);
                const State expected = cpu.stateAt(k, (corners[0].u + corners[1].u + corners[2].u) / 3,
                                                   (corners[0].v + corners[1].v + corners[2].v) / 3);
                if (state == expected)
                    continue;
                ASSERT_TRUE(expected != State::Opaque && expected != State::Transparent) << k << ' ' << i;
                ++unlike;
                const auto [marginX, marginY] = test::marginsOf(o, t, triangles[k]);
                test::Oracle<long double> oracle(t);
                oracle.addPolygon(
                    test::widened(test::cornersOf<long double>(t, triangles[k], i, *o.level), marginX, marginY));
                if ((state == State::Opaque) != swapped)
                    ASSERT_GE(oracle.least(), o.cutoff + o.valueTolerance) << k << ' ' << i;
                else
                    ASSERT_LE(oracle.most(), o.cutoff - o.valueTolerance) << k << ' ' << i;
            }
        }
    }
    EXPECT_LT(unlike * 100, known);
    EXPECT_GT(known, 3000u);
}

TEST_F(GpuBakeInputs, RejectsArgumentsOutOfRange)
{
    const AlphaImage image(gpu(), std::span(&texture_, 1), AlphaImage::Format::Float);
    const Mesh mesh = Mesh::of(triangles_);
    const auto accepts = [&](const GpuBakeOptions &options, const std::function<void(GpuBakeInput &)> &change = {}) {
        BakeJob job(gpu(), runner_.baker(), image, mesh, options);
        job.setOutput({});
        if (change)
            change(job.input());
        bool accepted = false;
        gpu().submit([&](VkCommandBuffer commands) { accepted = job.record(commands); });
        return accepted;
    };
    EXPECT_TRUE(accepts(options_));
    const auto with = [&](const std::function<void(GpuBakeOptions &)> &change) {
        GpuBakeOptions options = options_;
        change(options);
        return options;
    };
    EXPECT_FALSE(accepts(with([](GpuBakeOptions &o) { o.level = 13; })));
    EXPECT_FALSE(accepts(with([](GpuBakeOptions &o) { o.test = VK_COMPARE_OP_EQUAL; })));
    EXPECT_FALSE(accepts(with([](GpuBakeOptions &o) { o.cutoff = std::nan(""); })));
    EXPECT_FALSE(accepts(with([](GpuBakeOptions &o) { o.subtexelTolerance = -1; })));
    EXPECT_FALSE(accepts(with([](GpuBakeOptions &o) { o.valueTolerance = std::nan(""); })));
    EXPECT_FALSE(accepts(options_, [](GpuBakeInput &i) { i.uvFormat = VK_FORMAT_R8G8_UNORM; }));
    EXPECT_FALSE(accepts(options_, [](GpuBakeInput &i) { i.uvStride = 6; }));
    EXPECT_FALSE(accepts(options_, [](GpuBakeInput &i) { i.triangles = (1u << 24) + 1; }));

    for (const auto &change : std::initializer_list<std::function<void(GpuAlphaInfo &)>>{
             [](GpuAlphaInfo &i) { i.width = 0; }, [](GpuAlphaInfo &i) { i.height = 65537; },
             [](GpuAlphaInfo &i) { i.component = 4; }, [](GpuAlphaInfo &i) { i.mipLevels = 0; },
             [](GpuAlphaInfo &i) { i.filter = VK_FILTER_CUBIC_EXT; },
             [](GpuAlphaInfo &i) { i.view = VK_NULL_HANDLE; }}) {
        GpuAlphaInfo info = image.info();
        change(info);
        std::unique_ptr<GpuAlpha> alpha;
        EXPECT_EQ(runner_.baker().createAlpha(info, alpha), VK_ERROR_FORMAT_NOT_SUPPORTED);
        EXPECT_EQ(alpha, nullptr);
    }
}
