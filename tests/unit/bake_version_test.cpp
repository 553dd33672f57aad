// SPDX-License-Identifier: Apache-2.0
// Caches keep results by kBakeVersion: the results of a version never change.
#include <gtest/gtest.h>

#include <cmath>

#include "bake/bake.h"
#include "core/hash.h"
#include "test_random.h"

using namespace vellum;

namespace
{

AlphaTexture blobs(Filter filter)
{
    AlphaTexture texture;
    texture.width = texture.height = 64;
    texture.filter = filter;
    texture.wrapU = Wrap::Mirror;
    test::TestRandom random(7);
    std::vector<uint32_t> coarse(64);
    for (uint32_t &value : coarse)
        value = random() % 256;
    for (uint32_t i = 0; i < 64 * 64; ++i)
        texture.alpha.push_back(static_cast<float>((coarse[i / 512 * 8 + i % 64 / 8] + random() % 64) % 256) / 255.0f);
    return texture;
}

uint64_t hashOf(const Micromap &micromap)
{
    uint64_t hash = hashBytes(micromap.data.data(), micromap.data.size());
    hash = hashBytes(micromap.triangles.data(), micromap.triangles.size() * sizeof(MicromapTriangle), hash);
    return hashBytes(micromap.indices.data(), micromap.indices.size() * sizeof(int32_t), hash);
}

} // namespace

TEST(BakeVersion, ResultsAreThoseOfTheVersion)
{
    test::TestRandom random(1);
    std::vector<TriangleUvs> triangles(200);
    for (TriangleUvs &uvs : triangles) {
        const double u = random.uniform(-1, 2);
        const double v = random.uniform(-1, 2);
        for (TexCoord &corner : uvs)
            corner = {static_cast<float>(u + random.uniform(0, 0.5)), static_cast<float>(v + random.uniform(0, 0.5))};
    }
    const AlphaTexture linear = blobs(Filter::Bilinear);
    const AlphaTexture nearest = blobs(Filter::Nearest);
    BakeOptions exact;
    exact.level = 3;
    exact.exactly();
    BakeOptions twoState;
    twoState.format = Format::TwoState;
    BakeOptions lowered;
    lowered.budget = 2000;
    BakeOptions raised;
    raised.budget = 200000;
    BakeOptions rest;
    rest.minKnown = 0.3;
    rest.test = AlphaTest::Less;
    rest.disallowMixedSpecialIndices = true;
    uint64_t all = 0;
    for (const BakeOptions &options : {BakeOptions{}, exact, twoState, lowered, raised, rest})
        for (const AlphaTexture &texture : {linear, nearest})
            all = all * 31 + hashOf(bake(texture, triangles, options).micromap);
    // Of codes of 8 bits likewise.
    std::vector<uint8_t> codes;
    for (const float alpha : linear.alpha)
        codes.push_back(static_cast<uint8_t>(std::lround(alpha * 255)));
    AlphaTexture texture = AlphaTexture::fromUnorm8(64, 64, codes.data(), 1, 64);
    texture.wrapU = Wrap::Mirror;
    for (const BakeOptions &options : {BakeOptions{}, exact, twoState, lowered, raised, rest})
        EXPECT_EQ(hashOf(bake(texture, triangles, options).micromap),
                  hashOf(bake(linear, triangles, options).micromap));
    // If results have to differ: raise kBakeVersion, and write the new hash here.
    EXPECT_EQ(kBakeVersion, 2u);
    EXPECT_EQ(all, 14165157693520460600u);
}
