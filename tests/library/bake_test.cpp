// SPDX-License-Identifier: Apache-2.0
// vellumBake() makes what the baker makes of the same inputs and options.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "bake/bake.h"
#include "bake/inputs.h"
#include "sample.h"

using vellum::test::Sample;

namespace
{

// The sample by the baker itself.
vellum::BakeResult bakeSample(const Sample &sample, const vellum::BakeOptions &options,
                              const vellum::AlphaTexture &texture)
{
    std::vector<vellum::TriangleUvs> triangles(sample.indices.size() / 3);
    for (size_t i = 0; i < sample.indices.size(); ++i)
        triangles[i / 3][i % 3] = {sample.uvs[2u * sample.indices[i]], sample.uvs[2u * sample.indices[i] + 1]};
    return vellum::bake(texture, triangles, options);
}

vellum::AlphaTexture sampleTexture(const Sample &sample)
{
    return vellum::AlphaTexture::fromUnorm8(Sample::kSize, Sample::kSize, sample.texels.data() + 3, 4,
                                            4 * Sample::kSize);
}

vellum::BakeOptions sampleOptions()
{
    vellum::BakeOptions options;
    options.level = 3;
    return options;
}

void expectSame(const Sample &sample, const vellum::BakeResult &expected)
{
    const VellumMicromapInfo info = sample.info();
    const vellum::Micromap &m = expected.micromap;
    EXPECT_EQ(std::vector<uint8_t>(info.data, info.data + info.dataSize), m.data);
    EXPECT_EQ(std::vector<int32_t>(info.indices, info.indices + info.indexCount), m.indices);
    ASSERT_EQ(info.triangleCount, m.triangles.size());
    for (size_t i = 0; i < info.triangleCount; ++i) {
        EXPECT_EQ(info.triangles[i].dataOffset, m.triangles[i].dataOffset);
        EXPECT_EQ(info.triangles[i].subdivisionLevel, m.triangles[i].subdivisionLevel);
        EXPECT_EQ(info.triangles[i].format, static_cast<unsigned>(m.triangles[i].format));
    }
    const auto usages = usageOf(m.triangles);
    ASSERT_EQ(info.usageCount, usages.size());
    for (size_t i = 0; i < info.usageCount; ++i) {
        EXPECT_EQ(info.usages[i].count, usages[i].count);
        EXPECT_EQ(info.usages[i].subdivisionLevel, usages[i].subdivisionLevel);
        EXPECT_EQ(info.usages[i].format, static_cast<unsigned>(usages[i].format));
    }
    for (size_t s = 0; s < 4; ++s) {
        EXPECT_EQ(info.stateCounts[s], expected.statistics.states[s]);
        EXPECT_EQ(info.specialCounts[s], expected.statistics.special[s]);
    }
    EXPECT_EQ(info.distinctCount, expected.statistics.distinct);
}

} // namespace

TEST(LibraryBake, EqualsTheBaker)
{
    Sample sample;
    ASSERT_EQ(sample.bake(), VELLUM_SUCCESS) << sample.message;
    const vellum::BakeResult expected = bakeSample(sample, sampleOptions(), sampleTexture(sample));
    EXPECT_GT(expected.statistics.states[0], 0u);
    EXPECT_GT(expected.statistics.states[1], 0u);
    EXPECT_EQ(expected.statistics.distinct, 5u);
    expectSame(sample, expected);
    EXPECT_EQ(sample.messages, 0);

    // Null options are the same defaults.
    vellumDestroyMicromap(sample.micromap);
    ASSERT_EQ(vellumBake(&sample.input, 1, nullptr, &sample.micromap), VELLUM_SUCCESS);
    expectSame(sample, bakeSample(sample, {}, sampleTexture(sample)));
}

TEST(LibraryBake, TakesEveryOption)
{
    struct Change {
        const char *name;
        std::function<void(Sample &)> given;
        std::function<void(vellum::BakeOptions &, vellum::AlphaTexture &)> expected;
    };
    using vellum::AlphaTest, vellum::TwoStateRule, vellum::Wrap;
    const auto twoState = [](TwoStateRule rule) {
        return [rule](auto &o, auto &) {
            o.format = vellum::Format::TwoState;
            o.twoStateRule = rule;
        };
    };
    const auto giveTwoState = [](uint32_t rule) {
        return [rule](Sample &s) {
            s.options.format = VELLUM_MICROMAP_FORMAT_2_STATE;
            s.options.twoStateRule = rule;
        };
    };
    const Change changes[] = {
        {"2-state", giveTwoState(VELLUM_TWO_STATE_NEAREST), twoState(TwoStateRule::Nearest)},
        {"opaque", giveTwoState(VELLUM_TWO_STATE_UNKNOWN_IS_OPAQUE), twoState(TwoStateRule::UnknownIsOpaque)},
        {"transparent", giveTwoState(VELLUM_TWO_STATE_UNKNOWN_IS_TRANSPARENT),
         twoState(TwoStateRule::UnknownIsTransparent)},
        {"level", [](Sample &s) { s.options.level = 5; }, [](auto &o, auto &) { o.level = 5; }},
        {"automatic", [](Sample &s) { s.options.level = VELLUM_LEVEL_AUTOMATIC; },
         [](auto &o, auto &) { o.level.reset(); }},
        {"maxLevel",
         [](Sample &s) {
             s.options.level = VELLUM_LEVEL_AUTOMATIC;
             s.options.maxLevel = 2;
         },
         [](auto &o, auto &) {
             o.level.reset();
             o.maxLevel = 2;
         }},
        {"texelsPerEdge",
         [](Sample &s) {
             s.options.level = VELLUM_LEVEL_AUTOMATIC;
             s.options.texelsPerEdge = 1;
         },
         [](auto &o, auto &) {
             o.level.reset();
             o.texelsPerEdge = 1;
         }},
        {"less", [](Sample &s) { s.options.compareOp = VELLUM_COMPARE_OP_LESS; },
         [](auto &o, auto &) { o.test = AlphaTest::Less; }},
        {"less or equal",
         [](Sample &s) {
             s.options.compareOp = VELLUM_COMPARE_OP_LESS_OR_EQUAL;
             s.input.cutoff = 0;
             s.options.valueTolerance = 0;
         },
         [](auto &o, auto &) {
             o.test = AlphaTest::LessOrEqual;
             o.cutoff = 0;
             o.valueTolerance = 0;
         }},
        {"greater",
         [](Sample &s) {
             s.options.compareOp = VELLUM_COMPARE_OP_GREATER;
             s.input.cutoff = 0;
             s.options.valueTolerance = 0;
         },
         [](auto &o, auto &) {
             o.test = AlphaTest::Greater;
             o.cutoff = 0;
             o.valueTolerance = 0;
         }},
        {"mixed special indices", [](Sample &s) { s.options.flags = VELLUM_BAKE_DISALLOW_MIXED_SPECIAL_INDICES_BIT; },
         [](auto &o, auto &) { o.disallowMixedSpecialIndices = true; }},
        {"budget", [](Sample &s) { s.options.budget = 50; }, [](auto &o, auto &) { o.budget = 50; }},
        {"minKnown", [](Sample &s) { s.options.minKnown = 0.6; }, [](auto &o, auto &) { o.minKnown = 0.6; }},
        {"valueTolerance", [](Sample &s) { s.options.valueTolerance = 0.3; },
         [](auto &o, auto &) { o.valueTolerance = 0.3; }},
        {"subtexelTolerance", [](Sample &s) { s.options.subtexelTolerance = 2; },
         [](auto &o, auto &) { o.subtexelTolerance = 2; }},
        {"barycentricTolerance", [](Sample &s) { s.options.barycentricTolerance = 0.1; },
         [](auto &o, auto &) { o.barycentricTolerance = 0.1; }},
        {"interpolationTolerance", [](Sample &s) { s.options.interpolationTolerance = 0x1p-10; },
         [](auto &o, auto &) { o.interpolationTolerance = 0x1p-10; }},
        {"cutoff", [](Sample &s) { s.input.cutoff = 0.01; }, [](auto &o, auto &) { o.cutoff = 0.01; }},
        {"filter", [](Sample &s) { s.texture.filter = VELLUM_FILTER_NEAREST; },
         [](auto &, auto &t) { t.filter = vellum::Filter::Nearest; }},
        {"mirrored", [](Sample &s) { s.texture.addressModeU = VELLUM_ADDRESS_MODE_MIRRORED_REPEAT; },
         [](auto &, auto &t) { t.wrapU = Wrap::Mirror; }},
        {"clamped", [](Sample &s) { s.texture.addressModeV = VELLUM_ADDRESS_MODE_CLAMP_TO_EDGE; },
         [](auto &, auto &t) { t.wrapV = Wrap::Clamp; }},
        {"mirrored once", [](Sample &s) { s.texture.addressModeU = VELLUM_ADDRESS_MODE_MIRROR_CLAMP_TO_EDGE; },
         [](auto &, auto &t) { t.wrapU = Wrap::MirrorOnce; }},
        {"border",
         [](Sample &s) {
             s.texture.addressModeU = VELLUM_ADDRESS_MODE_CLAMP_TO_BORDER;
             s.texture.border = 0.9f;
         },
         [](auto &, auto &t) {
             t.wrapU = Wrap::Border;
             t.border = 0.9f;
         }},
        {"scale",
         [](Sample &s) {
             s.texture.scale = 0.6f;
             s.texture.addressModeU = VELLUM_ADDRESS_MODE_CLAMP_TO_BORDER;
             s.texture.border = 0.9f;
         },
         [](auto &, auto &t) {
             for (float &value : t.codes.values)
                 value *= 0.6f;
             t.wrapU = Wrap::Border;
             t.border = 0.9f * 0.6f;
         }},
    };
    Sample plain;
    ASSERT_EQ(plain.bake(), VELLUM_SUCCESS);
    for (const Change &change : changes) {
        SCOPED_TRACE(change.name);
        Sample sample;
        change.given(sample);
        ASSERT_EQ(sample.bake(), VELLUM_SUCCESS) << sample.message;
        EXPECT_NE(sample.bytes(), plain.bytes()) << "the sample does not show it";
        vellum::BakeOptions options = sampleOptions();
        vellum::AlphaTexture texture = sampleTexture(sample);
        change.expected(options, texture);
        expectSame(sample, bakeSample(sample, options, texture));
    }
}

TEST(LibraryBake, ReadsEveryFormatOfAlpha)
{
    Sample sample;
    ASSERT_EQ(sample.bake(), VELLUM_SUCCESS);
    const auto expected = sample.bytes();
    const size_t count = Sample::kSize * Sample::kSize;
    // Values of 16 bits that are those of 8, and floats; rows lie apart, and nothing is aligned.
    std::vector<uint8_t> bytes(1 + count * 8 + Sample::kSize);
    for (const uint32_t format : {VELLUM_FORMAT_R16_UNORM, VELLUM_FORMAT_R32_SFLOAT}) {
        for (size_t i = 0; i < count; ++i) {
            const uint8_t alpha = sample.texels[4 * i + 3];
            const auto wide = static_cast<uint16_t>(alpha * 257);
            const float single = static_cast<float>(alpha) / 255.0f;
            uint8_t *to = &bytes[1 + i * 8 + i / Sample::kSize];
            if (format == VELLUM_FORMAT_R16_UNORM)
                std::memcpy(to, &wide, sizeof wide);
            else
                std::memcpy(to, &single, sizeof single);
        }
        sample.texture.texels = bytes.data();
        sample.texture.texelsSize = bytes.size();
        sample.texture.format = format;
        sample.texture.offset = 1;
        sample.texture.pixelStride = 8;
        sample.texture.rowStride = 8 * Sample::kSize + 1;
        ASSERT_EQ(sample.bake(), VELLUM_SUCCESS) << sample.message;
        EXPECT_EQ(sample.bytes(), expected) << format;
    }
    // Half precision cannot hold 255ths: one and zero.
    Sample half;
    std::vector<uint16_t> halves(count);
    for (size_t i = 0; i < count; ++i) {
        halves[i] = half.texels[4 * i + 3] >= 128 ? 0x3c00 : 0;
        half.texels[4 * i + 3] = half.texels[4 * i + 3] >= 128 ? 255 : 0;
    }
    ASSERT_EQ(half.bake(), VELLUM_SUCCESS);
    const auto sharp = half.bytes();
    half.texture.texels = halves.data();
    half.texture.texelsSize = halves.size() * 2;
    half.texture.format = VELLUM_FORMAT_R16_SFLOAT;
    half.texture.offset = half.texture.pixelStride = 0;
    ASSERT_EQ(half.bake(), VELLUM_SUCCESS) << half.message;
    EXPECT_EQ(half.bytes(), sharp);
    EXPECT_NE(sharp, expected);
}

TEST(LibraryBake, ReadsEveryFormOfCoordinates)
{
    Sample sample;
    // Exact in all three formats.
    sample.uvs = {0, 0, 1, 0, 0, 1, 1, 1, 0, 0, 1, 1, 0, 1};
    sample.input.uvs = sample.uvs.data();
    ASSERT_EQ(sample.bake(), VELLUM_SUCCESS);
    const auto expected = sample.bytes();

    std::vector<uint8_t> narrow;
    std::vector<uint32_t> wide;
    std::vector<float> straight;
    for (const uint16_t index : sample.indices) {
        narrow.push_back(static_cast<uint8_t>(index));
        wide.push_back(index);
        straight.insert(straight.end(), {-1.0f, sample.uvs[2u * index], sample.uvs[2u * index + 1]});
    }
    sample.input.indexType = VELLUM_INDEX_TYPE_UINT8;
    sample.input.indices = narrow.data();
    sample.input.indicesSize = narrow.size();
    ASSERT_EQ(sample.bake(), VELLUM_SUCCESS) << sample.message;
    EXPECT_EQ(sample.bytes(), expected);
    sample.input.indexType = VELLUM_INDEX_TYPE_UINT32;
    sample.input.indices = wide.data();
    sample.input.indicesSize = wide.size() * 4;
    ASSERT_EQ(sample.bake(), VELLUM_SUCCESS) << sample.message;
    EXPECT_EQ(sample.bytes(), expected);

    for (const uint32_t format : {VELLUM_FORMAT_R16G16_UNORM, VELLUM_FORMAT_R16G16_SFLOAT}) {
        std::vector<uint16_t> uvs;
        for (const float value : sample.uvs)
            uvs.push_back(value == 0 ? 0 : format == VELLUM_FORMAT_R16G16_UNORM ? 0xffff : 0x3c00);
        sample.input.uvs = uvs.data();
        sample.input.uvsSize = uvs.size() * 2;
        sample.input.uvFormat = format;
        ASSERT_EQ(sample.bake(), VELLUM_SUCCESS) << sample.message;
        EXPECT_EQ(sample.bytes(), expected) << format;
    }

    // Without indices, vertices with other data in between, and fewer triangles than there are vertices for.
    sample.input.indexType = VELLUM_INDEX_TYPE_NONE;
    sample.input.uvFormat = VELLUM_FORMAT_R32G32_SFLOAT;
    sample.input.uvs = straight.data() + 1;
    sample.input.uvsSize = straight.size() * 4 - 4;
    sample.input.uvStride = 12;
    ASSERT_EQ(sample.bake(), VELLUM_SUCCESS) << sample.message;
    EXPECT_EQ(sample.bytes(), expected);
    sample.input.triangleCount = 2;
    ASSERT_EQ(sample.bake(), VELLUM_SUCCESS) << sample.message;
    EXPECT_EQ(sample.info().indexCount, 2u);

    // u and v exchanged, twice.
    std::vector<float> exchanged = sample.uvs;
    for (size_t i = 0; i < exchanged.size(); i += 2)
        std::swap(exchanged[i], exchanged[i + 1]);
    Sample other;
    other.input.uvs = exchanged.data();
    const float transform[6] = {0, 1, 0, 1, 0, 0};
    std::copy_n(transform, 6, other.input.uvTransform);
    ASSERT_EQ(other.bake(), VELLUM_SUCCESS) << other.message;
    EXPECT_EQ(other.bytes(), expected);
}

// A shader computes u - 1000 of coordinates near 1000 with an error of 2^-14, which is a quarter of these texels.
TEST(LibraryBake, MarginsFollowTheTermsOfATransform)
{
    std::vector<uint8_t> texels(4096);
    std::fill(texels.begin() + 2048, texels.end(), uint8_t{255});
    const std::vector<float> uvs = {1000.4999f, 0.2f, 1000.5001f, 0.2f, 1000.4999f, 0.8f};
    Sample sample;
    sample.texture.width = 4096;
    sample.texture.height = 1;
    sample.texture.texels = texels.data();
    sample.texture.texelsSize = texels.size();
    sample.texture.pixelStride = 0;
    sample.texture.offset = 0;
    sample.texture.filter = VELLUM_FILTER_NEAREST;
    sample.input.indexType = VELLUM_INDEX_TYPE_NONE;
    sample.input.uvs = uvs.data();
    sample.input.uvsSize = uvs.size() * sizeof(float);
    sample.input.triangleCount = 1;
    const float transform[6] = {1, 0, -1000, 0, 1, 0};
    std::copy_n(transform, 6, sample.input.uvTransform);
    sample.options.level = 6;
    ASSERT_EQ(sample.bake(), VELLUM_SUCCESS) << sample.message;
    const VellumMicromapInfo info = sample.info();
    EXPECT_EQ(info.stateCounts[0] + info.stateCounts[1], 0u);
}

TEST(LibraryBake, SeveralInputs)
{
    Sample sample;
    const std::vector<uint8_t> levels = {1, 2, 3, 4, 5, 6};
    const std::vector<uint8_t> formats = {1, 2, 1, 2, 1, 2};
    VellumBakeInput inputs[3] = {sample.input, sample.input, sample.input};
    inputs[1].levels = levels.data();
    inputs[1].formats = formats.data();
    inputs[2].cutoff = 0.2;
    ASSERT_EQ(vellumBake(inputs, 3, &sample.options, &sample.micromap), VELLUM_SUCCESS);
    const VellumMicromapInfo info = sample.info();
    ASSERT_EQ(info.indexCount, 18u);
    EXPECT_EQ(info.distinctCount, 5u + 6u + 5u);
    for (size_t i = 0; i < 3; ++i) {
        VellumGeometryInfo geometry{};
        geometry.structSize = sizeof geometry;
        ASSERT_EQ(vellumGetGeometryInfo(sample.micromap, i, &geometry), VELLUM_SUCCESS);
        EXPECT_EQ(geometry.indices, info.indices + 6 * i);
        EXPECT_EQ(geometry.indexCount, 6u);
        size_t used = 0;
        for (size_t k = 0; k < geometry.usageCount; ++k) {
            used += geometry.usages[k].count;
            const auto uses = std::count_if(geometry.indices, geometry.indices + 6, [&](int32_t index) {
                return index >= 0 && info.triangles[index].format == geometry.usages[k].format &&
                       info.triangles[index].subdivisionLevel == geometry.usages[k].subdivisionLevel;
            });
            EXPECT_EQ(uses, geometry.usages[k].count);
        }
        EXPECT_EQ(static_cast<long>(used),
                  std::count_if(geometry.indices, geometry.indices + 6, [](int32_t index) { return index >= 0; }));
        for (size_t t = 0; t < 6; ++t) {
            if (geometry.indices[t] < 0)
                continue;
            EXPECT_EQ(info.triangles[geometry.indices[t]].subdivisionLevel, i == 1 ? levels[t] : 3);
            EXPECT_EQ(info.triangles[geometry.indices[t]].format, i == 1 ? formats[t] : 2);
        }
    }
    EXPECT_NE(std::vector<int32_t>(info.indices, info.indices + 6),
              std::vector<int32_t>(info.indices + 12, info.indices + 18));
}

TEST(LibraryBake, MipChains)
{
    Sample sample;
    const std::vector<uint8_t> low = vellum::test::discTexels(8);
    VellumTexture levels[2] = {sample.texture, sample.texture};
    levels[1].texels = low.data();
    levels[1].texelsSize = low.size();
    levels[1].width = levels[1].height = 8;
    ASSERT_EQ(sample.bake(), VELLUM_SUCCESS);
    const VellumMicromapInfo one = sample.info();
    sample.input.textures = levels;
    sample.input.textureCount = 2;
    VellumMicromap *both = nullptr;
    ASSERT_EQ(vellumBake(&sample.input, 1, &sample.options, &both), VELLUM_SUCCESS);
    VellumMicromapInfo two{};
    two.structSize = sizeof two;
    ASSERT_EQ(vellumGetMicromapInfo(both, &two), VELLUM_SUCCESS);
    EXPECT_GT(two.stateCounts[2] + two.stateCounts[3], one.stateCounts[2] + one.stateCounts[3]);
    vellumDestroyMicromap(both);
}

TEST(LibraryBake, NoInputsAndNoTriangles)
{
    Sample sample;
    ASSERT_EQ(vellumBake(nullptr, 0, &sample.options, &sample.micromap), VELLUM_SUCCESS) << sample.message;
    EXPECT_EQ(sample.info().indexCount, 0u);
    sample.input.triangleCount = 0;
    sample.input.uvs = sample.input.indices = nullptr;
    sample.input.uvsSize = sample.input.indicesSize = 0;
    ASSERT_EQ(sample.bake(), VELLUM_SUCCESS) << sample.message;
    EXPECT_EQ(sample.info().indexCount, 0u);
    EXPECT_EQ(sample.info().triangleCount, 0u);
}

TEST(LibraryBake, StatesAtPoints)
{
    Sample sample;
    ASSERT_EQ(sample.bake(), VELLUM_SUCCESS);
    const vellum::Micromap expected = bakeSample(sample, sampleOptions(), sampleTexture(sample)).micromap;
    bool seen[4] = {};
    for (uint32_t t = 0; t < 6; ++t)
        for (float u = -0.25f; u <= 1.25f; u += 0.125f)
            for (float v = -0.25f; v <= 1.25f; v += 0.125f) {
                uint32_t state = 99;
                ASSERT_EQ(vellumGetState(sample.micromap, t, u, v, &state), VELLUM_SUCCESS);
                ASSERT_LT(state, 4u);
                EXPECT_EQ(state, static_cast<uint32_t>(expected.stateAt(t, u, v)));
                seen[state] = true;
            }
    EXPECT_TRUE(seen[0] && seen[1] && (seen[2] || seen[3]));
    uint32_t state = 0;
    EXPECT_EQ(vellumGetState(sample.micromap, 0, std::nanf(""), 2, &state), VELLUM_SUCCESS);
    EXPECT_EQ(vellumGetState(sample.micromap, 6, 0, 0, &state), VELLUM_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(vellumGetState(nullptr, 0, 0, 0, &state), VELLUM_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(vellumGetState(sample.micromap, 0, 0, 0, nullptr), VELLUM_ERROR_INVALID_ARGUMENT);
}
