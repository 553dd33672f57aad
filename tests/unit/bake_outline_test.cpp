// SPDX-License-Identifier: Apache-2.0
// The outlines of bakes are what the bakes are.
#include "bake/outline.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "test_random.h"

using namespace vellum;

namespace
{

AlphaTexture noise(uint32_t seed)
{
    test::TestRandom random(seed);
    AlphaTexture t;
    t.width = t.height = 32;
    t.wrapU = t.wrapV = Wrap::Repeat;
    std::vector<float> coarse(8 * 8);
    for (float &value : coarse)
        value = static_cast<float>(random.uniform(0, 1));
    for (size_t i = 0; i < size_t{32} * 32; ++i)
        t.alpha.push_back(coarse[i / 128 * 8 + i % 32 / 4]);
    return t;
}

// Some of them are equal, and some are after a whole repetition of the texture.
std::vector<TriangleUvs> scattered(uint32_t seed, size_t count)
{
    test::TestRandom random(seed);
    std::vector<TriangleUvs> triangles;
    for (size_t i = 0; i < count; ++i) {
        TriangleUvs uvs;
        const double size = random.uniform(0.01, 1.5);
        for (TexCoord &t : uvs)
            t = {static_cast<float>(std::round(random.uniform(0, size) * 64) / 64),
                 static_cast<float>(std::round(random.uniform(0, size) * 64) / 64)};
        triangles.push_back(uvs);
        if (i % 3 == 0) {
            for (TexCoord &t : uvs)
                t.u += 2;
            triangles.push_back(uvs);
        }
    }
    return triangles;
}

// The share of a triangle that is known.
double knownOf(const Micromap &micromap, size_t triangle)
{
    const int32_t index = micromap.indices[triangle];
    if (const auto special = specialState(index))
        return *special == State::Opaque || *special == State::Transparent ? 1 : 0;
    const MicromapTriangle &t = micromap.triangles[static_cast<size_t>(index)];
    uint32_t known = 0;
    for (uint32_t i = 0; i < microTriangleCount(t.subdivisionLevel); ++i) {
        const State state = readState(micromap.data.data() + t.dataOffset, i, t.format);
        known += state == State::Opaque || state == State::Transparent ? 1u : 0u;
    }
    return static_cast<double>(known) / microTriangleCount(t.subdivisionLevel);
}

} // namespace

TEST(BakeOutline, EqualsBakes)
{
    const std::vector<AlphaTexture> textures = {noise(1), noise(2)};
    const std::vector<TriangleUvs> triangles[] = {scattered(3, 20), scattered(4, 30)};
    std::vector<BakeInput> inputs;
    for (size_t i = 0; i < 2; ++i)
        inputs.push_back(
            {.textures = std::span(&textures[i], 1), .triangles = triangles[i], .group = static_cast<uint32_t>(i)});
    const std::optional<uint32_t> levels[] = {std::nullopt, 0, 2, 5};
    const uint64_t budgets[] = {0, 100, 1000, 4000, 16000, 1000000};
    for (const double minKnown : {0.0, 0.5}) {
        BakeOptions options;
        options.minKnown = minKnown;
        options.maxLevel = 6;
        options.emptyGroupBytes = 9;
        size_t count = 0;
        outlineBakes(inputs, options, levels, budgets, [&](const BakeOutline &outline) {
            ++count;
            BakeOptions real = options;
            real.level = outline.setting.level;
            real.format = outline.setting.format;
            real.budget = outline.setting.budget;
            SCOPED_TRACE(testing::Message() << minKnown << ' ' << (real.level ? static_cast<int>(*real.level) : -1)
                                            << ' ' << static_cast<int>(real.format) << ' ' << real.budget.value_or(1));
            const BakeResult result = bake(inputs, real);
            uint64_t bytes = 0;
            size_t first = 0;
            std::array<uint64_t, 13> withData{};
            // Groups store what triangles of both share twice.
            for (const BakeInput &input : inputs) {
                std::vector<int32_t> used(result.micromap.indices.begin() + static_cast<ptrdiff_t>(first),
                                          result.micromap.indices.begin() +
                                              static_cast<ptrdiff_t>(first + input.triangles.size()));
                first += input.triangles.size();
                for (const int32_t index : used)
                    if (index >= 0)
                        ++withData[result.micromap.triangles[static_cast<size_t>(index)].subdivisionLevel];
                std::sort(used.begin(), used.end());
                used.erase(std::unique(used.begin(), used.end()), used.end());
                used.erase(used.begin(), std::lower_bound(used.begin(), used.end(), 0));
                for (const int32_t index : used) {
                    const MicromapTriangle &t = result.micromap.triangles[static_cast<size_t>(index)];
                    bytes += packedBytes(t.subdivisionLevel, t.format) + 8;
                }
                bytes += used.empty() ? 9u : 0u;
            }
            EXPECT_EQ(outline.bytes, bytes);
            EXPECT_EQ(outline.levels, withData);
            EXPECT_FALSE(outline.tooLarge);
            ASSERT_EQ(outline.known.size(), result.micromap.indices.size());
            if (outline.setting.format == Format::FourState) {
                for (size_t t = 0; t < outline.known.size(); ++t)
                    EXPECT_EQ(outline.known[t], knownOf(result.micromap, t)) << t;
            }
        });
        EXPECT_EQ(count, 2 * std::size(levels) + std::size(budgets));
    }
}

TEST(BakeOutline, FindsWhatIsTooLarge)
{
    const AlphaTexture texture = noise(1);
    const std::vector<TriangleUvs> triangles = scattered(3, 20);
    const BakeInput input{.textures = std::span(&texture, 1), .triangles = triangles};
    BakeOptions options;
    options.maxDataBytes = 1000;
    const std::optional<uint32_t> levels[] = {1, 6};
    std::vector<bool> tooLarge;
    outlineBakes(std::span(&input, 1), options, levels, {},
                 [&](const BakeOutline &outline) { tooLarge.push_back(outline.tooLarge); });
    EXPECT_EQ(tooLarge, (std::vector<bool>{false, false, true, true}));
    options.level = 6;
    EXPECT_THROW(bake(std::span(&input, 1), options), BakeTooLarge);
}
