// SPDX-License-Identifier: Apache-2.0
// vellum/bake.h: nothing is lost between C++ and C.
#include <gtest/gtest.h>

#include <stdexcept>
#include <thread>

#include "sample.h"
#include "vellum/bake.h"

using namespace vellum;

namespace
{

struct Mesh {
    test::Sample c;
    Texture texture{.texels = std::as_bytes(std::span(c.texels)),
                    .width = test::Sample::kSize,
                    .height = test::Sample::kSize,
                    .offset = 3,
                    .pixelStride = 4};
    BakeInput input{.textures = {&texture, 1},
                    .uvs = std::as_bytes(std::span(c.uvs)),
                    .indices = std::as_bytes(std::span(c.indices)),
                    .indexType = IndexType::Uint16};
};

VellumResult resultOf(const std::function<void()> &function)
{
    try {
        function();
    } catch (const Error &error) {
        return error.result();
    }
    return VELLUM_SUCCESS;
}

} // namespace

TEST(LibraryWrapper, SameAsC)
{
    Mesh mesh;
    const Micromap micromap = bake(mesh.input, {.level = 3});
    ASSERT_EQ(mesh.c.bake(), VELLUM_SUCCESS);
    const VellumMicromapInfo info = mesh.c.info();
    EXPECT_TRUE(std::ranges::equal(micromap.data(), std::span(info.data, info.dataSize)));
    EXPECT_TRUE(std::ranges::equal(micromap.indices(), std::span(info.indices, info.indexCount)));
    ASSERT_EQ(micromap.triangles().size(), info.triangleCount);
    ASSERT_EQ(micromap.usages().size(), info.usageCount);
    EXPECT_EQ(micromap.usages()[0].count, info.usages[0].count);
    EXPECT_EQ(micromap.stateCount(State::Opaque), info.stateCounts[1]);
    EXPECT_EQ(micromap.stateCount(State::UnknownOpaque), info.stateCounts[3]);
    EXPECT_EQ(micromap.specialCount(State::Transparent), info.specialCounts[0]);
    EXPECT_EQ(micromap.distinctCount(), 5u);
    EXPECT_EQ(micromap.geometry(0).indices.data(), micromap.indices().data());
    EXPECT_EQ(micromap.geometry(0).indices.size(), 6u);
    EXPECT_FALSE(micromap.geometry(0).usages.empty());
    EXPECT_EQ(resultOf([&] { (void)micromap.geometry(1); }), VELLUM_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(resultOf([&] { (void)micromap.state(6, 0, 0); }), VELLUM_ERROR_INVALID_ARGUMENT);
    const auto message = [](auto &&call) -> std::string {
        try {
            call();
        } catch (const Error &error) {
            return error.what();
        }
        return "";
    };
    EXPECT_EQ(message([&] { (void)micromap.geometry(5); }), "there is no input 5");
    EXPECT_EQ(message([&] { (void)micromap.state(6, 0, 0); }), "there is no triangle 6");
    EXPECT_EQ(message([] { (void)Micromap().geometry(0); }), "there is no micromap");
    uint32_t state = 9;
    ASSERT_EQ(vellumGetState(micromap.get(), 1, 0.3f, 0.2f, &state), VELLUM_SUCCESS);
    EXPECT_EQ(static_cast<uint32_t>(micromap.state(1, 0.3f, 0.2f)), state);
}

// The defaults in bake.h are those of the library.
TEST(LibraryWrapper, DefaultsAreThoseOfC)
{
    const BakeOptions defaults;
    detail::Listener listener(defaults);
    VellumBakeOptions options = detail::toC(defaults, listener);
    VellumBakeOptions expected;
    vellumInitBakeOptions(&expected, sizeof expected);
    options.message = nullptr;
    options.userData = nullptr;
    EXPECT_EQ(std::memcmp(&options, &expected, sizeof expected), 0);

    const VellumTexture texture = detail::toC(Texture{});
    VellumTexture expectedTexture;
    vellumInitTexture(&expectedTexture, sizeof expectedTexture);
    EXPECT_EQ(std::memcmp(&texture, &expectedTexture, sizeof texture), 0);

    const std::vector<VellumTexture> none;
    const VellumBakeInput input = detail::toC(BakeInput{}, none);
    VellumBakeInput expectedInput;
    vellumInitBakeInput(&expectedInput, sizeof expectedInput);
    EXPECT_EQ(std::memcmp(&input, &expectedInput, sizeof input), 0);
}

TEST(LibraryWrapper, MembersReachC)
{
    BakeOptions o{.format = MicromapFormat::TwoState,
                  .twoStateRule = TwoStateRule::UnknownIsTransparent,
                  .level = 7,
                  .maxLevel = 9,
                  .texelsPerEdge = 2,
                  .compareOp = CompareOp::Less,
                  .disallowMixedSpecialIndices = true,
                  .budget = 12345,
                  .minKnown = 0.25,
                  .valueTolerance = 1,
                  .subtexelTolerance = 2,
                  .barycentricTolerance = 3,
                  .interpolationTolerance = 4,
                  .maxDataSize = 99,
                  .threads = 5};
    detail::Listener listener(o);
    const VellumBakeOptions c = detail::toC(o, listener);
    EXPECT_EQ(c.format, 1u);
    EXPECT_EQ(c.twoStateRule, 2u);
    EXPECT_EQ(c.level, 7);
    EXPECT_EQ(c.maxLevel, 9u);
    EXPECT_EQ(c.texelsPerEdge, 2);
    EXPECT_EQ(c.compareOp, 1u);
    EXPECT_EQ(c.flags, 1u);
    EXPECT_EQ(c.budget, 12345u);
    EXPECT_EQ(c.minKnown, 0.25);
    EXPECT_EQ(c.valueTolerance, 1);
    EXPECT_EQ(c.subtexelTolerance, 2);
    EXPECT_EQ(c.barycentricTolerance, 3);
    EXPECT_EQ(c.interpolationTolerance, 4);
    EXPECT_EQ(c.maxDataSize, 99u);
    EXPECT_EQ(c.threads, 5u);
    o.exactly();
    EXPECT_EQ(o.valueTolerance + o.subtexelTolerance + o.barycentricTolerance + o.interpolationTolerance, 0);
    o.level = 0xffffffff;
    EXPECT_EQ(detail::toC(o, listener).level, 255);

    const std::vector<std::byte> bytes(64);
    const VellumTexture t = detail::toC(Texture{.texels = bytes,
                                                .width = 2,
                                                .height = 3,
                                                .format = AlphaFormat::R16Sfloat,
                                                .filter = Filter::Nearest,
                                                .addressModeU = AddressMode::ClampToBorder,
                                                .addressModeV = AddressMode::ClampToEdge,
                                                .offset = 5,
                                                .pixelStride = 6,
                                                .rowStride = 7,
                                                .scale = 8,
                                                .border = 9});
    EXPECT_EQ(t.texels, bytes.data());
    EXPECT_EQ(t.texelsSize, 64u);
    EXPECT_EQ(t.width, 2u);
    EXPECT_EQ(t.height, 3u);
    EXPECT_EQ(t.format, 76u);
    EXPECT_EQ(t.filter, 0u);
    EXPECT_EQ(t.addressModeU, 3u);
    EXPECT_EQ(t.addressModeV, 2u);
    EXPECT_EQ(t.offset, 5u);
    EXPECT_EQ(t.pixelStride, 6u);
    EXPECT_EQ(t.rowStride, 7u);
    EXPECT_EQ(t.scale, 8);
    EXPECT_EQ(t.border, 9);

    const std::vector<VellumTexture> textures(2);
    const std::vector<uint8_t> levels(5, 1);
    const std::vector<MicromapFormat> formats(5, MicromapFormat::TwoState);
    BakeInput in{.uvs = bytes,
                 .uvStride = 9,
                 .uvFormat = UvFormat::R16G16Unorm,
                 .indices = std::span(bytes).first(15),
                 .indexType = IndexType::Uint8,
                 .uvTransform = {1, 2, 3, 4, 5, 6},
                 .levels = levels,
                 .formats = formats,
                 .cutoff = 0.7};
    const VellumBakeInput i = detail::toC(in, textures);
    EXPECT_EQ(i.textures, textures.data());
    EXPECT_EQ(i.textureCount, 2u);
    EXPECT_EQ(i.uvs, bytes.data());
    EXPECT_EQ(i.uvsSize, 64u);
    EXPECT_EQ(i.uvStride, 9u);
    EXPECT_EQ(i.indices, bytes.data());
    EXPECT_EQ(i.indicesSize, 15u);
    EXPECT_EQ(i.triangleCount, 5u);
    EXPECT_EQ(i.uvFormat, 77u);
    EXPECT_EQ(i.indexType, 1000265000u);
    EXPECT_EQ(i.uvTransform[5], 6);
    EXPECT_EQ(i.levels, levels.data());
    EXPECT_EQ(i.formats[4], 1);
    EXPECT_EQ(i.cutoff, 0.7);
    in.indexType = IndexType::None; // 7 vertices, at 0, 9 .. 54
    EXPECT_EQ(in.triangleCount(), 2u);
    EXPECT_EQ(resultOf([&] { detail::toC(in, textures); }), VELLUM_ERROR_INVALID_ARGUMENT);
}

TEST(LibraryWrapper, Errors)
{
    Mesh mesh;
    mesh.texture.width = 33;
    try {
        bake(mesh.input);
        FAIL();
    } catch (const Error &error) {
        EXPECT_EQ(error.result(), VELLUM_ERROR_INVALID_ARGUMENT);
        EXPECT_STREQ(error.what(),
                     "input 0: texture 0: the alpha values of 33 x 32 texels do not lie within 4096 bytes");
    }
    mesh.texture.width = 32;
    EXPECT_EQ(resultOf([&] { bake(mesh.input, {.level = 3, .maxDataSize = 1}); }), VELLUM_ERROR_TOO_LARGE);
    EXPECT_EQ(resultOf([&] { Micromap none(nullptr); }), VELLUM_ERROR_INVALID_ARGUMENT);
}

TEST(LibraryWrapper, Callbacks)
{
    Mesh mesh;
    uint64_t last = 0;
    BakeOptions options{.level = 3, .threads = 2, .progress = [&](uint64_t done, uint64_t) { last = done; }};
    bake(mesh.input, options);
    EXPECT_EQ(last, 6u);
    options.cancelled = [] { return true; };
    EXPECT_THROW(bake(mesh.input, options), Cancelled);
    options.cancelled = []() -> bool { throw std::out_of_range("a poll"); };
    EXPECT_THROW(bake(mesh.input, options), std::out_of_range);
    options.cancelled = {};
    options.progress = [](uint64_t, uint64_t) { throw std::logic_error("a report"); };
    EXPECT_THROW(bake(mesh.input, options), std::logic_error);
}

TEST(LibraryWrapper, MicromapsMove)
{
    Mesh mesh;
    Micromap a = bake(mesh.input, {.level = 3});
    const auto *data = a.data().data();
    Micromap b = std::move(a);
    EXPECT_EQ(b.data().data(), data);
    EXPECT_EQ(a.get(), nullptr); // NOLINT(bugprone-use-after-move): empty, as it says
    EXPECT_TRUE(a.indices().empty());
    a = std::move(b);
    EXPECT_EQ(a.data().data(), data);
    EXPECT_EQ(b.get(), nullptr); // NOLINT(bugprone-use-after-move)
    EXPECT_TRUE(Micromap().data().empty());
}
