// SPDX-License-Identifier: Apache-2.0
// Results of libvellum on bad input, structures of other versions, lack of memory, and cancellation.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <thread>

#include "allocations.h"
#include "sample.h"

using vellum::test::allocationsAlive;
using vellum::test::allocationsLeft;
using vellum::test::Sample;

namespace
{

// A structure with members that the library does not know.
template <typename T>
struct Later {
    T known;
    uint64_t more[2];
};

} // namespace

TEST(LibraryFailure, BadMembersAreNamed)
{
    struct Mistake {
        const char *says;
        std::function<void(Sample &)> make;
    };
    static const float nan = std::numeric_limits<float>::quiet_NaN();
    static const double infinite = std::numeric_limits<double>::infinity();
    static uint8_t levels[] = {1, 1, 13, 1, 1, 1};
    static uint8_t formats[] = {1, 2, 3, 2, 2, 2};
    static uint16_t indices[] = {0, 1, 2, 0, 1, 7, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2};
    const Mistake mistakes[] = {
        {"input 0: texture 0: width is 0", [](Sample &s) { s.texture.width = 0; }},
        {"width is 16777217", [](Sample &s) { s.texture.width = 16777217; }},
        {"height is 0", [](Sample &s) { s.texture.height = 0; }},
        {"height is 4294967295", [](Sample &s) { s.texture.height = UINT32_MAX; }},
        {"format is 37", [](Sample &s) { s.texture.format = 37; }},
        {"filter is 2", [](Sample &s) { s.texture.filter = 2; }},
        {"addressModeU is 5", [](Sample &s) { s.texture.addressModeU = 5; }},
        {"addressModeV is 7", [](Sample &s) { s.texture.addressModeV = 7; }},
        {"texels is null", [](Sample &s) { s.texture.texels = nullptr; }},
        {"do not lie within 4095 bytes", [](Sample &s) { s.texture.texelsSize -= 1; }},
        {"do not lie within", [](Sample &s) { s.texture.offset = SIZE_MAX; }},
        {"do not lie within", [](Sample &s) { s.texture.width = s.texture.height = 1u << 24; }},
        {"do not lie within", [](Sample &s) { s.texture.rowStride = SIZE_MAX; }},
        {"pixelStride is 1,",
         [](Sample &s) {
             s.texture.format = VELLUM_FORMAT_R16_UNORM;
             s.texture.pixelStride = 1;
         }},
        {"pixelStride is 18446744073709551615", [](Sample &s) { s.texture.pixelStride = SIZE_MAX; }},
        {"rowStride is 127", [](Sample &s) { s.texture.rowStride = 127; }},
        {"input 0: there is no texture", [](Sample &s) { s.input.textures = nullptr; }},
        {"there is no texture", [](Sample &s) { s.input.textureCount = 0; }},
        {"textureCount is 257", [](Sample &s) { s.input.textureCount = 257; }},
        {"uvFormat is 9", [](Sample &s) { s.input.uvFormat = VELLUM_FORMAT_R8_UNORM; }},
        {"uvStride is 7", [](Sample &s) { s.input.uvStride = 7; }},
        {"uvs is null", [](Sample &s) { s.input.uvs = nullptr; }},
        {"index 5 is 7, of 7 vertices", [](Sample &s) { s.input.indices = indices; }},
        {"index 17 is 6, of 6 vertices", [](Sample &s) { s.input.uvsSize -= 1; }},
        {"indices is null", [](Sample &s) { s.input.indices = nullptr; }},
        {"6 triangles have 18 indices, but there are 17", [](Sample &s) { s.input.indicesSize -= 1; }},
        {"6 triangles have 18 vertices, but uvs has 7", [](Sample &s) { s.input.indexType = VELLUM_INDEX_TYPE_NONE; }},
        {"more than 2^28 triangles", [](Sample &s) { s.input.triangleCount = SIZE_MAX / 3 + 2; }},
        {"indexType is 2", [](Sample &s) { s.input.indexType = 2; }},
        {"the level of triangle 2 is 13", [](Sample &s) { s.input.levels = levels; }},
        {"triangle 2: format is 3", [](Sample &s) { s.input.formats = formats; }},
        {"cutoff is not a number", [](Sample &s) { s.input.cutoff = nan; }},
        {"format is 0", [](Sample &s) { s.options.format = 0; }},
        {"twoStateRule is 3", [](Sample &s) { s.options.twoStateRule = 3; }},
        {"level is -2", [](Sample &s) { s.options.level = -2; }},
        {"level is 13", [](Sample &s) { s.options.level = 13; }},
        {"maxLevel is 13", [](Sample &s) { s.options.maxLevel = 13; }},
        {"texelsPerEdge is nan", [](Sample &s) { s.options.texelsPerEdge = nan; }},
        {"compareOp is 0", [](Sample &s) { s.options.compareOp = 0; }},
        {"flags is 2", [](Sample &s) { s.options.flags = 2; }},
        {"minKnown is 1.5", [](Sample &s) { s.options.minKnown = 1.5; }},
        {"valueTolerance is -1", [](Sample &s) { s.options.valueTolerance = -1; }},
        {"subtexelTolerance is 1024.5", [](Sample &s) { s.options.subtexelTolerance = 1024.5; }},
        {"barycentricTolerance is 1.5", [](Sample &s) { s.options.barycentricTolerance = 1.5; }},
        {"interpolationTolerance is 0.5", [](Sample &s) { s.options.interpolationTolerance = 0.5; }},
        {"valueTolerance is inf", [](Sample &s) { s.options.valueTolerance = infinite; }},
        {"subtexelTolerance is inf", [](Sample &s) { s.options.subtexelTolerance = infinite; }},
        {"barycentricTolerance is nan", [](Sample &s) { s.options.barycentricTolerance = nan; }},
        {"interpolationTolerance is -1", [](Sample &s) { s.options.interpolationTolerance = -1; }},
        {"maxDataSize is 4294967296", [](Sample &s) { s.options.maxDataSize = 1ull << 32; }},
        {"threads is 1025", [](Sample &s) { s.options.threads = 1025; }},
        {"reserved is 1", [](Sample &s) { s.options.reserved = 1; }},
        {"structSize of VellumTexture is 0", [](Sample &s) { s.texture.structSize = 0; }},
        {"structSize of VellumTexture is", [](Sample &s) { s.texture.structSize = 1u << 20; }},
        {"structSize of VellumBakeInput is 16", [](Sample &s) { s.input.structSize = 16; }},
    };
    for (const Mistake &mistake : mistakes) {
        SCOPED_TRACE(mistake.says);
        Sample sample;
        mistake.make(sample);
        EXPECT_EQ(sample.bake(), VELLUM_ERROR_INVALID_ARGUMENT);
        EXPECT_EQ(sample.messages, 1);
        EXPECT_EQ(sample.reported, VELLUM_ERROR_INVALID_ARGUMENT);
        EXPECT_NE(sample.message.find(mistake.says), std::string::npos) << sample.message;
        EXPECT_EQ(sample.micromap, nullptr);
    }
    Sample sample;
    VellumBakeInput inputs[2] = {sample.input, sample.input};
    inputs[1].indexType = 9;
    EXPECT_EQ(vellumBake(inputs, 2, &sample.options, &sample.micromap), VELLUM_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(sample.message.find("input 1: indexType is 9"), 0u) << sample.message;
    EXPECT_EQ(vellumBake(nullptr, 2, &sample.options, &sample.micromap), VELLUM_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(vellumBake(&sample.input, 1, &sample.options, nullptr), VELLUM_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(sample.messages, 3);
    sample.options.structSize = 0; // so the callback cannot be read
    EXPECT_EQ(sample.bake(), VELLUM_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(sample.messages, 0);
    sample.options.message = nullptr;
    EXPECT_EQ(sample.bake(), VELLUM_ERROR_INVALID_ARGUMENT);
}

TEST(LibraryFailure, TooLarge)
{
    Sample sample;
    sample.options.maxDataSize = 20;
    EXPECT_EQ(sample.bake(), VELLUM_ERROR_TOO_LARGE);
    EXPECT_EQ(sample.reported, VELLUM_ERROR_TOO_LARGE);
    EXPECT_NE(sample.message.find("larger than 20 bytes"), std::string::npos) << sample.message;
    EXPECT_EQ(sample.micromap, nullptr);
}

TEST(LibraryFailure, StructuresOfLaterVersions)
{
    Sample sample;
    ASSERT_EQ(sample.bake(), VELLUM_SUCCESS);
    const auto expected = sample.bytes();

    Later<VellumTexture> textures[2];
    Later<VellumBakeInput> inputs[2];
    Later<VellumBakeOptions> options;
    for (auto &texture : textures)
        vellumInitTexture(&texture.known, sizeof texture);
    for (auto &input : inputs)
        vellumInitBakeInput(&input.known, sizeof input);
    vellumInitBakeOptions(&options.known, sizeof options);
    EXPECT_EQ(options.more[0] | options.more[1] | inputs[1].more[1] | textures[0].more[0], 0u);
    EXPECT_EQ(options.known.structSize, sizeof options);
    for (auto &texture : textures) {
        const size_t size = texture.known.structSize;
        texture.known = sample.texture;
        texture.known.structSize = size;
    }
    for (auto &input : inputs) {
        const size_t size = input.known.structSize;
        input.known = sample.input;
        input.known.structSize = size;
        input.known.textures = &textures[0].known;
        input.known.textureCount = 2;
    }
    options.known = sample.options;
    options.known.structSize = sizeof options;
    VellumMicromap *micromap = nullptr;
    const auto bake = [&] {
        vellumDestroyMicromap(micromap);
        return vellumBake(&inputs[0].known, 2, &options.known, &micromap);
    };
    ASSERT_EQ(bake(), VELLUM_SUCCESS) << sample.message;
    Later<VellumMicromapInfo> info;
    info.known.structSize = sizeof info;
    info.more[1] = 1;
    ASSERT_EQ(vellumGetMicromapInfo(micromap, &info.known), VELLUM_SUCCESS);
    EXPECT_EQ(info.more[0] | info.more[1], 0u);
    EXPECT_EQ(info.known.structSize, sizeof info);
    EXPECT_EQ(info.known.indexCount, 12u);
    const VellumMicromapInfo plain = sample.info();
    ASSERT_EQ(info.known.dataSize, plain.dataSize);
    EXPECT_EQ(std::memcmp(info.known.data, plain.data, plain.dataSize), 0);

    for (uint64_t *member : {&textures[1].more[1], &inputs[1].more[0], &options.more[1]}) {
        *member = 1;
        sample.messages = 0;
        EXPECT_EQ(bake(), VELLUM_ERROR_UNSUPPORTED);
        EXPECT_EQ(sample.messages, 1);
        EXPECT_NE(sample.message.find("does not know"), std::string::npos) << sample.message;
        *member = 0;
    }
    textures[1].known.structSize -= 8;
    EXPECT_EQ(bake(), VELLUM_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(sample.message, "input 0: texture 1: structSize is not that of texture 0");

    VellumMicromapInfo small{};
    small.structSize = sizeof small - 1;
    EXPECT_EQ(vellumGetMicromapInfo(sample.micromap, &small), VELLUM_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(vellumGetMicromapInfo(sample.micromap, nullptr), VELLUM_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(vellumGetMicromapInfo(nullptr, &small), VELLUM_ERROR_INVALID_ARGUMENT);
    VellumGeometryInfo geometry{};
    geometry.structSize = sizeof geometry;
    EXPECT_EQ(vellumGetGeometryInfo(sample.micromap, 1, &geometry), VELLUM_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(vellumGetGeometryInfo(nullptr, 0, &geometry), VELLUM_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(vellumGetGeometryInfo(sample.micromap, 0, nullptr), VELLUM_ERROR_INVALID_ARGUMENT);
}

TEST(LibraryFailure, InitializersRespectTheSizeOfTheCaller)
{
    std::vector<unsigned char> memory(sizeof(VellumBakeOptions) + 8, 0xcd);
    auto *options = reinterpret_cast<VellumBakeOptions *>(memory.data());
    vellumInitBakeOptions(options, 24);
    EXPECT_EQ(options->structSize, 24u);
    EXPECT_EQ(options->level, VELLUM_LEVEL_AUTOMATIC);
    for (size_t i = 24; i < memory.size(); ++i)
        EXPECT_EQ(memory[i], 0xcd);
    vellumInitBakeOptions(options, 3);
    EXPECT_EQ(options->structSize, 24u);
    vellumInitBakeOptions(nullptr, 100);
    vellumInitBakeInput(nullptr, 100);
    vellumInitTexture(nullptr, 100);
}

// Whichever allocation fails, the result says so, and nothing is left behind.
TEST(LibraryFailure, OutOfMemory)
{
    Sample sample;
    sample.message.reserve(200);
    const std::vector<uint8_t> formats = {1, 2, 1, 2, 1, 2};
    sample.input.formats = formats.data();
    sample.options.threads = 2;
    sample.options.budget = 400;
    sample.options.flags = VELLUM_BAKE_DISALLOW_MIXED_SPECIAL_INDICES_BIT;
    sample.options.compareOp = VELLUM_COMPARE_OP_GREATER;
    sample.options.cancelled = [](void *) { return 0; };
    ASSERT_EQ(sample.bake(), VELLUM_SUCCESS);
    const auto expected = sample.bytes();
    vellumDestroyMicromap(sample.micromap);
    sample.micromap = nullptr;

    long failures = 0;
    for (long n = 0;; ++n) {
        ASSERT_LT(n, 10000);
        const long before = allocationsAlive;
        sample.messages = 0;
        allocationsLeft = n;
        const VellumResult result = vellumBake(&sample.input, 1, &sample.options, &sample.micromap);
        const bool reached = allocationsLeft < 0;
        allocationsLeft = -1;
        if (result == VELLUM_SUCCESS) {
            // If the memory for the second thread was missing, the bake uses one thread.
            const auto made = sample.bytes();
            EXPECT_EQ(made, expected);
            vellumDestroyMicromap(sample.micromap);
            sample.micromap = nullptr;
        } else {
            EXPECT_EQ(result, VELLUM_ERROR_OUT_OF_MEMORY);
            EXPECT_EQ(sample.messages, 1);
            EXPECT_EQ(sample.message, "out of memory");
            EXPECT_EQ(sample.micromap, nullptr);
            ++failures;
        }
        EXPECT_EQ(allocationsAlive, before) << "at allocation " << n;
        if (!reached)
            break;
    }
    EXPECT_GT(failures, 20);
}

TEST(LibraryFailure, CancelledByProgress)
{
    struct Counts {
        uint64_t done = 0;
        uint64_t total = 0;
        uint64_t end = 0; // where to cancel
    } counts;
    Sample sample;
    sample.options.message = nullptr;
    sample.options.userData = &counts;
    sample.options.progress = [](void *data, uint64_t done, uint64_t total) {
        auto &c = *static_cast<Counts *>(data);
        EXPECT_GT(done, c.done);
        c.done = done;
        c.total = total;
        return done >= c.end ? -1 : 0;
    };
    for (const uint64_t end : {2u, 6u}) { // in between, and at the last moment
        counts = {0, 0, end};
        EXPECT_EQ(sample.bake(), VELLUM_CANCELLED);
        EXPECT_EQ(sample.micromap, nullptr);
        EXPECT_EQ(counts.done, end);
        EXPECT_EQ(counts.total, 6u);
    }
    counts = {0, 0, 7};
    EXPECT_EQ(sample.bake(), VELLUM_SUCCESS);
    EXPECT_EQ(counts.done, 6u);
}

TEST(LibraryFailure, CancelledWithinATriangle)
{
    struct Polls {
        std::atomic<int> count = 0;
        int end = 0;
    } polls;
    Sample sample;
    sample.options.message = nullptr;
    sample.options.userData = &polls;
    sample.options.level = 9;
    sample.input.triangleCount = 1;
    sample.options.cancelled = [](void *data) {
        auto &p = *static_cast<Polls *>(data);
        return ++p.count >= p.end ? 1 : 0;
    };
    polls.end = 1 << 30;
    ASSERT_EQ(sample.bake(), VELLUM_SUCCESS);
    const int all = polls.count;
    EXPECT_GT(all, 20);
    polls.count = 0;
    polls.end = all - 1;
    EXPECT_EQ(sample.bake(), VELLUM_CANCELLED);
    EXPECT_EQ(polls.count, all - 1);
    EXPECT_EQ(sample.micromap, nullptr);
}

TEST(LibraryFailure, CancelledByAFlag)
{
    int32_t flag = 0;
    Sample sample;
    sample.options.message = nullptr;
    sample.options.userData = &flag;
    sample.options.cancelled = vellumIsFlagSet;
    ASSERT_EQ(sample.bake(), VELLUM_SUCCESS);
    flag = INT32_MIN;
    EXPECT_EQ(sample.bake(), VELLUM_CANCELLED);
    sample.options.userData = nullptr;
    EXPECT_EQ(sample.bake(), VELLUM_SUCCESS);
}

TEST(LibraryFailure, ManyThreadsAtOnce)
{
    Sample sample;
    ASSERT_EQ(sample.bake(), VELLUM_SUCCESS);
    const auto expected = sample.bytes();
    std::vector<std::jthread> threads;
    for (int t = 0; t < 4; ++t)
        threads.emplace_back([&expected, t] {
            Sample own;
            own.options.threads = 1 + static_cast<uint32_t>(t);
            for (int i = 0; i < 5; ++i) {
                own.texture.filter = VELLUM_FILTER_LINEAR;
                EXPECT_EQ(own.bake(), VELLUM_SUCCESS);
                EXPECT_EQ(own.bytes(), expected);
                own.texture.filter = 8;
                EXPECT_EQ(own.bake(), VELLUM_ERROR_INVALID_ARGUMENT);
                EXPECT_EQ(own.message, "input 0: texture 0: filter is 8, not a VellumFilter");
            }
        });
}

TEST(LibraryFailure, NamesAndVersion)
{
    EXPECT_EQ(vellumGetVersion(), VELLUM_HEADER_VERSION);
    EXPECT_GE(vellumGetBakeVersion(), 1u);
    EXPECT_STREQ(vellumResultName(VELLUM_SUCCESS), "VELLUM_SUCCESS");
    EXPECT_STREQ(vellumResultName(VELLUM_CANCELLED), "VELLUM_CANCELLED");
    EXPECT_STREQ(vellumResultName(VELLUM_ERROR_INVALID_ARGUMENT), "VELLUM_ERROR_INVALID_ARGUMENT");
    EXPECT_STREQ(vellumResultName(VELLUM_ERROR_OUT_OF_MEMORY), "VELLUM_ERROR_OUT_OF_MEMORY");
    EXPECT_STREQ(vellumResultName(VELLUM_ERROR_TOO_LARGE), "VELLUM_ERROR_TOO_LARGE");
    EXPECT_STREQ(vellumResultName(VELLUM_ERROR_UNSUPPORTED), "VELLUM_ERROR_UNSUPPORTED");
    EXPECT_STREQ(vellumResultName(VELLUM_ERROR_INTERNAL), "VELLUM_ERROR_INTERNAL");
    EXPECT_STREQ(vellumResultName(VELLUM_ERROR_FILE), "VELLUM_ERROR_FILE");
    EXPECT_STREQ(vellumResultName(static_cast<VellumResult>(7)), "unknown VellumResult");
    vellumDestroyMicromap(nullptr);
}
