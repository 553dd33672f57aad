// SPDX-License-Identifier: Apache-2.0
// The baker's promise on random textures and triangles: no sample contradicts a proven state.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "bake/bake.h"
#include "test_random.h"

using namespace vellum;

namespace
{

class BakeCase
{
public:
    explicit BakeCase(unsigned seed) : random_(seed)
    {
        texture.width = 1 + random_() % 24;
        texture.height = 1 + random_() % 24;
        texture.wrapU = static_cast<Wrap>(random_() % 3);
        texture.wrapV = static_cast<Wrap>(random_() % 3);
        texture.filter = random_() % 4 == 0 ? Filter::Nearest : Filter::Bilinear;
        fillTexture();
        options.level = random_() % 6;
        options.cutoff = random_() % 2 == 0 ? 0.5 : uniform(0.05, 0.95);
        options.threads = 1;
        // The sharpest that is allowed in half of the cases, so that nothing hides behind tolerances.
        if (random_() % 2 == 0) {
            options.valueTolerance = 0;
            options.subtexelTolerance = 1.0 / 256;
            options.barycentricTolerance = 0;
        }
        for (int i = 0; i < 4; ++i)
            triangles.push_back(randomTriangle());
    }

    double uniform(double low, double high) { return random_.uniform(low, high); }

    AlphaTexture texture;
    BakeOptions options;
    std::vector<TriangleUvs> triangles;

private:
    void fillTexture()
    {
        texture.alpha.resize(size_t{texture.width} * texture.height);
        const unsigned kind = random_() % 3;
        const double radius = uniform(0.1, 0.6);
        for (size_t i = 0; i < texture.alpha.size(); ++i) {
            const double x = (static_cast<double>(i % texture.width) + 0.5) / texture.width - 0.5;
            const double y = (static_cast<double>(i / texture.width) + 0.5) / texture.height - 0.5;
            double a = uniform(0, 1);
            if (kind == 1)
                a = std::hypot(x, y) < radius ? 1 : 0;
            if (kind == 2)
                a = std::clamp((radius - std::hypot(x, y)) * 8 + 0.5, 0.0, 1.0);
            texture.alpha[i] = static_cast<float>(std::lround(a * 255)) / 255.0f;
        }
    }

    TriangleUvs randomTriangle()
    {
        // Within a texel, about the texture, several repetitions, or a plain card; some degenerate.
        const double sizes[] = {0.5 / texture.width, 0.7, 3.0, 1.0};
        const unsigned kind = random_() % 4;
        if (kind == 3)
            return random_() % 2 == 0 ? TriangleUvs{{{0, 0}, {1, 0}, {1, 1}}} : TriangleUvs{{{0, 0}, {1, 1}, {0, 1}}};
        const double x = uniform(-2, 2);
        const double y = uniform(-2, 2);
        TriangleUvs uvs;
        for (TexCoord &t : uvs)
            t = {static_cast<float>(x + uniform(0, sizes[kind])), static_cast<float>(y + uniform(0, sizes[kind]))};
        if (random_() % 8 == 0)
            uvs[2] = uvs[1];
        return uvs;
    }

    test::TestRandom random_;
};

// Samples one micro-triangle at its corners, edges and inside, moved by as much as the options allow.
void checkMicroTriangle(BakeCase &c, const TriangleUvs &uvs, uint32_t index, State state)
{
    const auto corners = microTriangleCorners(index, *c.options.level);
    constexpr int kSteps = 6;
    for (int i = 0; i <= kSteps; ++i) {
        for (int j = 0; i + j <= kSteps; ++j) {
            const double b = static_cast<double>(i) / kSteps;
            const double d = static_cast<double>(j) / kSteps;
            const double a = 1 - b - d;
            const double pu = a * corners[0].u + b * corners[1].u + d * corners[2].u;
            const double pv = a * corners[0].v + b * corners[1].v + d * corners[2].v;
            const double reach = c.options.subtexelTolerance * 0.99;
            const double u =
                (1 - pu - pv) * uvs[0].u + pu * uvs[1].u + pv * uvs[2].u + c.uniform(-reach, reach) / c.texture.width;
            const double v =
                (1 - pu - pv) * uvs[0].v + pu * uvs[1].v + pv * uvs[2].v + c.uniform(-reach, reach) / c.texture.height;
            const double noise = c.options.valueTolerance * 0.99;
            const double alpha = c.texture.sample(u, v) + c.uniform(-noise, noise);
            ASSERT_EQ(state == State::Opaque, alpha >= c.options.cutoff)
                << "micro-triangle " << index << " at " << u << ", " << v << " has alpha " << alpha;
        }
    }
}

} // namespace

TEST(BakeProperty, NoSampleContradictsAProvenState)
{
    size_t proven = 0;
    size_t all = 0;
    for (unsigned seed = 0; seed < 1500 && !testing::Test::HasFailure(); ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        BakeCase c(seed);
        const BakeResult result = bake(c.texture, c.triangles, c.options);
        ASSERT_EQ(result.micromap.validate(), std::nullopt);
        for (uint32_t t = 0; t < c.triangles.size(); ++t) {
            for (uint32_t i = 0; i < microTriangleCount(*c.options.level); ++i) {
                const auto corners = microTriangleCorners(i, *c.options.level);
                const float u = (corners[0].u + corners[1].u + corners[2].u) / 3;
                const float v = (corners[0].v + corners[1].v + corners[2].v) / 3;
                const State state = result.micromap.stateAt(t, u, v);
                ++all;
                if (state != State::Opaque && state != State::Transparent)
                    continue;
                ++proven;
                checkMicroTriangle(c, c.triangles[t], i, state);
            }
        }
    }
    // A baker that proves nothing would pass, too.
    EXPECT_GT(static_cast<double>(proven) / static_cast<double>(all), 0.3);
}

// Numbers of any bits: nothing to say about the states, but that there are some.
TEST(BakeProperty, AnyInputIsSafe)
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
    for (unsigned round = 0; round < 150; ++round) {
        SCOPED_TRACE("round " + std::to_string(round));
        AlphaTexture t;
        t.width = 1 + random() % 9;
        t.height = 1 + random() % 9;
        t.wrapU = static_cast<Wrap>(random() % 5);
        t.wrapV = static_cast<Wrap>(random() % 5);
        t.filter = random() % 2 == 0 ? Filter::Nearest : Filter::Bilinear;
        t.border = anyFloat();
        const bool tame = random() % 2 == 0;
        for (uint32_t i = 0; i < t.width * t.height; ++i)
            t.alpha.push_back(tame ? static_cast<float>(random() % 3) / 2 : anyFloat());
        std::vector<TriangleUvs> triangles(3);
        for (TriangleUvs &uvs : triangles)
            for (TexCoord &uv : uvs)
                uv = {anyFloat(), anyFloat()};
        BakeOptions o;
        o.threads = 1;
        o.level = random() % 4;
        if (random() % 2 == 0)
            o.level.reset();
        o.maxLevel = 4;
        o.test = static_cast<AlphaTest>(random() % 4);
        const float cutoff = anyFloat();
        o.cutoff = std::isnan(cutoff) || random() % 2 == 0 ? 0.5 : double{cutoff};
        if (random() % 2 == 0)
            o.exactly();
        if (random() % 4 == 0)
            o.budget = random() % 200;
        const BakeResult r = bake(t, triangles, o);
        EXPECT_EQ(r.micromap.validate(), std::nullopt);
        ASSERT_EQ(r.micromap.indices.size(), 3u);
        if (o.budget) {
            EXPECT_LE(r.micromap.data.size() + 8 * r.micromap.triangles.size(), *o.budget);
        }
    }
}

// Triangles of millions of texels over a texture that does not repeat, or has outlines elsewhere: soon done.
TEST(BakeProperty, FarTrianglesAreSkipped)
{
    AlphaTexture t;
    t.width = 16;
    t.height = 16;
    for (int i = 0; i < 256; ++i)
        t.alpha.push_back(i % 16 < 4 ? 1.0f : 0.0f);
    BakeOptions o;
    o.level = 5;
    o.threads = 1;
    o.exactly();
    // All of the triangle is next to the stripe.
    const std::vector<TriangleUvs> beside = {{{{0.5f, -900000}, {0.75f, 900000}, {0.6f, 0}}}};
    EXPECT_EQ(bake(t, beside, o).micromap.indices, std::vector<int32_t>{-1});
    for (const Wrap wrap : {Wrap::Clamp, Wrap::Border, Wrap::MirrorOnce}) {
        t.wrapU = t.wrapV = wrap;
        const std::vector<TriangleUvs> outside = {{{{10, -900000}, {900, 900000}, {500, 0}}}};
        EXPECT_EQ(bake(t, outside, o).micromap.indices, std::vector<int32_t>{-1});
    }
}

// Textures of one outcome, whatever triangles and margins cover: those that span it in one direction, in both, and by
// margins alone, which have to end somewhere.
TEST(BakeProperty, TexturesOfOneOutcomeAreSoonDone)
{
    const std::vector<TriangleUvs> wide = {{{{0, 0}, {260000, 0}, {0, 0.5f}}}};
    const std::vector<TriangleUvs> small = {{{{0.1f, 0.1f}, {0.2f, 0.1f}, {0.1f, 0.2f}}}};
    BakeOptions options;
    options.level = 9;
    options.threads = 1;
    for (const auto &[width, height] : {std::pair{64u, 16384u}, {1u, 1u}, {1024u, 1024u}, {16384u, 1u}}) {
        std::vector<uint8_t> codes(size_t{width} * height, 255);
        for (const Wrap wrap : {Wrap::Repeat, Wrap::Mirror, Wrap::Clamp}) {
            AlphaTexture texture = AlphaTexture::fromUnorm8(width, height, codes.data(), 1, width);
            texture.wrapU = texture.wrapV = wrap;
            if (260000.0 * width < 0x1p24) {
                EXPECT_EQ(bake(texture, wide, options).micromap.indices, std::vector<int32_t>{-2});
            }
            for (const double terms : {1.0, 1e12, 1e30}) {
                BakeInput input{std::span(&texture, 1), small};
                input.uvTerms = terms;
                EXPECT_EQ(bake(std::span(&input, 1), options).micromap.indices, std::vector<int32_t>{-2});
            }
        }
        // A margin that covers an outline leaves nothing known.
        codes.back() = 0;
        const AlphaTexture texture = AlphaTexture::fromUnorm8(width, height, codes.data(), 1, width);
        BakeInput input{std::span(&texture, 1), small};
        input.uvTerms = 1e30;
        BakeOptions low = options;
        low.level = 2;
        const BakeResult unknown = bake(std::span(&input, 1), low);
        EXPECT_EQ(unknown.statistics.states[0] + unknown.statistics.states[1], width * height == 1 ? 16u : 0u);
    }
}
