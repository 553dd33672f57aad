// SPDX-License-Identifier: Apache-2.0
// Results of the GPU baker for given states: records, indices and data, with any capacity.
#include <algorithm>
#include <cmath>

#include "bake_cases.h"
#include "gpu_bake_run.h"

namespace
{

using namespace vt;
using namespace vellum;

class GpuBakeResults : public GpuBakeTest
{
protected:
    GpuBakeResults()
    {
        test::TestRandom random(12);
        texture_ = test::smoothTexture(random, 61, 47);
        // Some triangles are tiny, and often of one state all over.
        for (int i = 0; i < 250; ++i)
            for (const TriangleUvs &uvs : test::randomTriangles(random, 61, 47))
                triangles_.push_back(uvs);
        options_.level = 3;
    }

    GpuBaked bake(const GpuBakeOptions &options, Steps steps = Steps::One)
    {
        return runner_.bake(texture_, triangles_, options, steps);
    }
    void expectSameStates(const GpuBaked &a, const GpuBaked &b, uint32_t level)
    {
        for (uint32_t t = 0; t < triangles_.size(); ++t)
            for (uint32_t i = 0; i < microTriangleCount(level); ++i)
                ASSERT_EQ(a.stateOf(t, i), b.stateOf(t, i)) << t << ' ' << i;
    }

    AlphaTexture texture_;
    GpuBakeOptions options_;
    std::vector<TriangleUvs> triangles_;
};

} // namespace

// A special index if and only if the states are one; records in the order of triangles.
TEST_F(GpuBakeResults, UniformTrianglesAreSpecialIndices)
{
    const GpuBaked baked = bake(options_);
    GpuBakeOptions all = options_;
    all.specialIndices = false;
    const GpuBaked plain = bake(all);
    EXPECT_EQ(baked.micromap().validate(), std::nullopt);
    expectSameStates(baked, plain, 3);
    std::array<uint32_t, 4> special{};
    int32_t next = 0;
    for (uint32_t t = 0; t < triangles_.size(); ++t) {
        ASSERT_EQ(plain.indices[t], static_cast<int32_t>(t));
        bool uniform = true;
        for (uint32_t i = 1; i < 64; ++i)
            uniform = uniform && plain.stateOf(t, i) == plain.stateOf(t, 0);
        ASSERT_EQ(baked.indices[t], uniform ? specialIndex(plain.stateOf(t, 0)) : next++);
        if (uniform)
            ++special[static_cast<size_t>(plain.stateOf(t, 0))];
    }
    EXPECT_EQ(baked.result.status, 0u);
    EXPECT_EQ(baked.result.triangles[3], static_cast<uint32_t>(next));
    EXPECT_EQ(baked.result.special, special);
    EXPECT_GT(next, 100);
    EXPECT_GT(special[0] + special[1], 100u);
    EXPECT_EQ(plain.result.triangles[3], triangles_.size());
    EXPECT_EQ(plain.result.special, (std::array<uint32_t, 4>{}));
    // Records without a triangle are as good as others.
    ASSERT_EQ(baked.records.size(), triangles_.size());
    for (size_t i = 0; i < baked.records.size(); ++i) {
        const VkMicromapTriangleEXT &record = baked.records[i];
        EXPECT_EQ(record.dataOffset, i < static_cast<size_t>(next) ? 16 * i : 0);
        EXPECT_EQ(record.subdivisionLevel, 3);
        EXPECT_EQ(record.format, VK_OPACITY_MICROMAP_FORMAT_4_STATE_EXT);
    }
}

TEST_F(GpuBakeResults, TwoStepsAreAsOne)
{
    for (const bool automatic : {false, true}) {
        options_.automatic = automatic;
        options_.level = automatic ? 5 : 3;
        const GpuBaked one = bake(options_);
        const GpuBaked two = bake(options_, Steps::Two);
        EXPECT_EQ(one.result.triangles, two.result.triangles);
        EXPECT_EQ(one.result.special, two.result.special);
        EXPECT_EQ(two.result.status, 0u);
        EXPECT_EQ(two.records.size(), static_cast<size_t>(std::count_if(two.indices.begin(), two.indices.end(),
                                                                        [](int32_t i) { return i >= 0; })));
        EXPECT_EQ(two.micromap().validate(), std::nullopt);
        for (uint32_t t = 0; t < triangles_.size(); ++t) {
            if (one.indices[t] < 0) {
                ASSERT_EQ(one.indices[t], two.indices[t]);
                continue;
            }
            const VkMicromapTriangleEXT &record = one.records[static_cast<size_t>(one.indices[t])];
            for (uint32_t i = 0; i < microTriangleCount(record.subdivisionLevel); ++i)
                ASSERT_EQ(one.stateOf(t, i), two.stateOf(t, i)) << t << ' ' << i;
        }
        // The usage counts are those of the capacity.
        GpuBakeOutput output;
        output.triangles = two.result.triangles;
        uint32_t records = 0;
        for (const VkMicromapUsageEXT &usage : GpuBaker::usage(output, options_.format)) {
            EXPECT_EQ(usage.count, static_cast<uint32_t>(std::count_if(
                                       two.records.begin(), two.records.end(), [&](const VkMicromapTriangleEXT &r) {
                                           return r.subdivisionLevel == usage.subdivisionLevel;
                                       })));
            records += usage.count;
        }
        EXPECT_EQ(records, two.records.size());
    }
}

// Triangles beyond the capacity are unknown; the others are as they were, and nothing is written beyond (see BakeJob).
TEST_F(GpuBakeResults, CapacityThatIsTooSmall)
{
    const AlphaImage image(gpu(), std::span(&texture_, 1), AlphaImage::Format::Float);
    const Mesh mesh = Mesh::of(triangles_);
    const GpuBaked enough = runner_.bake(image, mesh, options_);
    for (const uint32_t few : {0u, 1u, 37u}) {
        GpuBakeOutput output;
        output.triangles[3] = few;
        output.triangles[5] = 2; // of no use, but valid
        const GpuBaked baked = runner_.bake(image, mesh, options_, Steps::One, &output);
        EXPECT_EQ(baked.result.status, kGpuBakeOverCapacity);
        EXPECT_EQ(baked.result.triangles, enough.result.triangles) << "what would do";
        EXPECT_EQ(baked.records.size(), few + 2);
        EXPECT_EQ(baked.micromap().validate(), std::nullopt);
        for (uint32_t t = 0; t < triangles_.size(); ++t) {
            const bool fits = enough.indices[t] < static_cast<int32_t>(few);
            ASSERT_EQ(baked.indices[t], fits ? enough.indices[t] : specialIndex(State::UnknownOpaque)) << t;
            for (uint32_t i = 0; i < 64 && fits; ++i)
                ASSERT_EQ(baked.stateOf(t, i), enough.stateOf(t, i)) << t << ' ' << i;
        }
    }
}

TEST_F(GpuBakeResults, NoTriangles)
{
    triangles_.clear();
    for (const Steps steps : {Steps::One, Steps::Two}) {
        const GpuBaked baked = bake(options_, steps);
        EXPECT_TRUE(baked.indices.empty() && baked.records.empty());
        EXPECT_EQ(baked.result.status, 0u);
        EXPECT_EQ(baked.result.triangles, (std::array<uint32_t, kGpuBakeLevels>{}));
        EXPECT_EQ(baked.result.special, (std::array<uint32_t, 4>{}));
    }
}

// 2-state data is the 4-state data with a rule.
TEST_F(GpuBakeResults, TwoStates)
{
    for (const uint32_t level : {0u, 2u, 3u, 4u}) {
        options_.level = level;
        options_.format = VK_OPACITY_MICROMAP_FORMAT_4_STATE_EXT;
        const GpuBaked four = bake(options_);
        options_.format = VK_OPACITY_MICROMAP_FORMAT_2_STATE_EXT;
        for (const GpuTwoStateRule rule :
             {GpuTwoStateRule::Nearest, GpuTwoStateRule::UnknownIsOpaque, GpuTwoStateRule::UnknownIsTransparent}) {
            options_.twoStateRule = rule;
            const GpuBaked two = bake(options_);
            EXPECT_EQ(two.micromap().validate(), std::nullopt);
            for (uint32_t t = 0; t < triangles_.size(); ++t) {
                for (uint32_t i = 0; i < microTriangleCount(level); ++i) {
                    const State state = four.stateOf(t, i);
                    State expected = state;
                    if (state == State::UnknownOpaque || state == State::UnknownTransparent)
                        expected = rule == GpuTwoStateRule::UnknownIsOpaque        ? State::Opaque
                                   : rule == GpuTwoStateRule::UnknownIsTransparent ? State::Transparent
                                   : state == State::UnknownOpaque                 ? State::Opaque
                                                                                   : State::Transparent;
                    ASSERT_EQ(two.stateOf(t, i), expected) << level << ": " << t << ' ' << i;
                }
            }
        }
    }
}

// Levels, and all four alpha tests, as on the CPU; the guesses are nearly all the same.
TEST_F(GpuBakeResults, EqualTheCpuBaker)
{
    size_t guesses = 0;
    size_t unlike = 0;
    for (const AlphaTest test :
         {AlphaTest::GreaterOrEqual, AlphaTest::Greater, AlphaTest::LessOrEqual, AlphaTest::Less}) {
        BakeOptions options;
        options.test = test;
        options.cutoff = 0.4;
        options.maxLevel = 4;
        options.texelsPerEdge = 1.5;
        options.disallowMixedSpecialIndices = true; // so that all triangles with states of several kinds have records
        const vellum::Micromap cpu = vellum::bake(texture_, triangles_, options).micromap;
        const GpuBaked baked = bake(onGpu(options));
        for (uint32_t t = 0; t < triangles_.size(); ++t) {
            ASSERT_GE(baked.indices[t], 0);
            const uint32_t level = baked.records[static_cast<size_t>(baked.indices[t])].subdivisionLevel;
            const MicromapTriangle &other = cpu.triangles[static_cast<size_t>(cpu.indices[t])];
            if (other.subdivisionLevel != 0) { // special indices of the CPU baker became triangles of level 0
                ASSERT_EQ(level, other.subdivisionLevel) << t;
            }
            for (uint32_t i = 0; i < microTriangleCount(level); ++i) {
                const auto corners = microTriangleCorners(i, level);
                const State expected = cpu.stateAt(t, (corners[0].u + corners[1].u + corners[2].u) / 3,
                                                   (corners[0].v + corners[1].v + corners[2].v) / 3);
                const State state = baked.stateOf(t, i);
                if (state == State::Opaque || state == State::Transparent)
                    ASSERT_EQ(state, expected) << t << ' ' << i;
                else if (expected != State::Opaque && expected != State::Transparent) {
                    ++guesses;
                    unlike += state != expected ? 1u : 0u;
                }
            }
        }
    }
    EXPECT_GT(guesses, 1000u);
    EXPECT_LE(unlike * 200, guesses);
}

// Triangles of thousands of texels at level 0 are divided on the way.
TEST_F(GpuBakeResults, LargeMicroTriangles)
{
    texture_.width = texture_.height = 256;
    texture_.wrapU = texture_.wrapV = Wrap::Clamp;
    texture_.filter = Filter::Bilinear;
    texture_.alpha.clear();
    for (int i = 0; i < 256 * 256; ++i)
        texture_.alpha.push_back(i % 256 < i / 256 ? 1.0f : 0.0f); // below the diagonal
    triangles_ = {
        {{{0, 0.02f}, {0, 1}, {0.98f, 1}}},       // along it, on one side
        {{{0.02f, 0}, {1, 0}, {1, 0.98f}}},       // and on the other
        {{{-3, 0.02f}, {-3, 4}, {0.95f, 1.02f}}}, // far outside, too
        {{{0, 0.01f}, {0, 1}, {0.999f, 0.98f}}},  // across it in one corner
        {{{0.5f, 0.5f}, {200, 0.3f}, {900, 0.1f}}},
    };
    options_.level = 0;
    const GpuBaked baked = bake(options_);
    EXPECT_EQ(baked.indices[0], specialIndex(State::Opaque));
    EXPECT_EQ(baked.indices[1], specialIndex(State::Transparent));
    EXPECT_EQ(baked.indices[2], specialIndex(State::Opaque));
    EXPECT_EQ(baked.indices[3], specialIndex(State::UnknownOpaque));
    EXPECT_EQ(baked.indices[4], specialIndex(State::UnknownTransparent));
}

// Levels of more words than a workgroup has invocations, where each state is looked at once.
TEST_F(GpuBakeResults, HighLevels)
{
    triangles_ = {{{{0, 0}, {1, 0}, {0, 1}}}, {{{0.1f, 0.3f}, {0.11f, 0.3f}, {0.1f, 0.31f}}}};
    options_.level = 8;
    BakeOptions options;
    options.level = 8;
    const vellum::Micromap cpu = vellum::bake(texture_, triangles_, options).micromap;
    const GpuBaked baked = bake(options_, Steps::Two);
    size_t known = 0;
    for (uint32_t i = 0; i < microTriangleCount(8); ++i) {
        const auto corners = microTriangleCorners(i, 8);
        const State state = baked.stateOf(0, i);
        if (state != State::Opaque && state != State::Transparent)
            continue;
        ++known;
        ASSERT_EQ(state, cpu.stateAt(0, (corners[0].u + corners[1].u + corners[2].u) / 3,
                                     (corners[0].v + corners[1].v + corners[2].v) / 3));
    }
    EXPECT_GT(known, microTriangleCount(8) / 2);
}
