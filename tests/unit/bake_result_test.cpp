// SPDX-License-Identifier: Apache-2.0
// Results of the baker for given states: levels, formats, budgets, sharing, special indices.
#include <gtest/gtest.h>

#include <cmath>

#include "bake_options.h"
#include "test_random.h"

using namespace vellum;
using namespace vellum::test;

namespace
{

// A disc, different for each size of it.
AlphaTexture disc(double radius)
{
    AlphaTexture t;
    t.width = t.height = 64;
    t.wrapU = t.wrapV = Wrap::Clamp;
    for (int i = 0; i < 64 * 64; ++i)
        t.alpha.push_back(std::hypot(i % 64 - 31.5, i / 64 - 31.5) < radius ? 1.0f : 0.0f);
    return t;
}

std::vector<TriangleUvs> scattered(size_t count)
{
    TestRandom random(4);
    std::vector<TriangleUvs> triangles(count);
    for (TriangleUvs &uvs : triangles) {
        const double u = random.uniform(-0.2, 1.2);
        const double v = random.uniform(-0.2, 1.2);
        for (TexCoord &t : uvs)
            t = {static_cast<float>(u + random.uniform(0, 0.4)), static_cast<float>(v + random.uniform(0, 0.4))};
    }
    return triangles;
}

uint64_t bytesOf(const BakeResult &r)
{
    return r.micromap.data.size() + 8 * r.micromap.triangles.size();
}

double knownShare(const BakeResult &r)
{
    // By area: all triangles have equal weight, whatever their level.
    double known = 0;
    for (const int32_t index : r.micromap.indices) {
        if (const auto special = specialState(index)) {
            known += *special == State::Opaque || *special == State::Transparent ? 1 : 0;
            continue;
        }
        const MicromapTriangle &t = r.micromap.triangles[static_cast<size_t>(index)];
        const uint32_t count = microTriangleCount(t.subdivisionLevel);
        for (uint32_t i = 0; i < count; ++i) {
            const State state = readState(r.micromap.data.data() + t.dataOffset, i, t.format);
            known += state == State::Opaque || state == State::Transparent ? 1.0 / count : 0;
        }
    }
    return known / static_cast<double>(r.micromap.indices.size());
}

} // namespace

TEST(BakeResult, LevelsAndFormatsOfEachTriangle)
{
    const std::vector<TriangleUvs> triangles(4, {{{0.1f, 0.1f}, {0.9f, 0.2f}, {0.3f, 0.9f}}});
    const std::vector<uint8_t> levels = {5, 3, 5, 3};
    const std::vector<Format> formats = {Format::FourState, Format::FourState, Format::TwoState, Format::FourState};
    const AlphaTexture t = disc(20);
    BakeInput input{std::span(&t, 1), triangles, levels, formats};
    const BakeResult r = bake(std::span(&input, 1), {});
    EXPECT_EQ(r.micromap.indices, (std::vector<int32_t>{0, 1, 2, 1}));
    EXPECT_EQ(r.statistics.distinct, 3u);
    EXPECT_EQ(
        usageOf(r.micromap.triangles, r.micromap.indices, r.micromap.baseTriangle),
        (std::vector<MicromapUsage>{{1, 5, Format::TwoState}, {2, 3, Format::FourState}, {1, 5, Format::FourState}}));
    EXPECT_EQ(r.micromap.validate(), std::nullopt);
    input.levels = std::span(levels).first(3);
    EXPECT_THROW(bake(std::span(&input, 1), {}), BakeError);
    const std::vector<uint8_t> tooHigh = {5, 3, 13, 3};
    input.levels = tooHigh;
    EXPECT_THROW(bake(std::span(&input, 1), {}), BakeError);
}

TEST(BakeResult, SharesAcrossInputs)
{
    const std::vector<TriangleUvs> triangles = scattered(20);
    const AlphaTexture t = disc(20);
    const AlphaTexture copy = t;
    const AlphaTexture other = disc(12);
    const BakeInput inputs[] = {{std::span(&t, 1), triangles},
                                {std::span(&t, 1), triangles},
                                {std::span(&copy, 1), triangles},
                                {std::span(&other, 1), triangles}};
    const BakeResult all = bake(inputs, atLevel(4));
    const BakeResult first = bake(t, triangles, atLevel(4));
    const BakeResult last = bake(other, triangles, atLevel(4));
    ASSERT_EQ(all.micromap.indices.size(), 80u);
    EXPECT_EQ(all.statistics.distinct, 60u); // coordinates are looked up by texture, results are not
    EXPECT_LE(all.micromap.triangles.size(), first.micromap.triangles.size() + last.micromap.triangles.size());
    for (uint32_t i = 0; i < 20; ++i) {
        EXPECT_EQ(all.micromap.indices[i], all.micromap.indices[20 + i]);
        EXPECT_EQ(all.micromap.indices[i], all.micromap.indices[40 + i]);
        EXPECT_EQ(all.micromap.stateAt(i, 0.3f, 0.3f), first.micromap.stateAt(i, 0.3f, 0.3f));
        EXPECT_EQ(all.micromap.stateAt(60 + i, 0.3f, 0.3f), last.micromap.stateAt(i, 0.3f, 0.3f));
    }
}

TEST(BakeResult, CutoffOfAnInput)
{
    AlphaTexture t;
    t.width = t.height = 1;
    t.alpha = {0.5f};
    const std::vector<TriangleUvs> triangles = scattered(1);
    const BakeInput inputs[] = {{std::span(&t, 1), triangles, {}, {}, 0.25},
                                {std::span(&t, 1), triangles, {}, {}, 0.75}};
    EXPECT_EQ(bake(inputs, atLevel(3)).micromap.indices, (std::vector<int32_t>{-2, -1}));
}

TEST(BakeResult, KeepsBudgets)
{
    const std::vector<TriangleUvs> triangles = scattered(60);
    const AlphaTexture t = disc(20);
    const BakeResult whole = bake(t, triangles, atLevel(6));
    const uint64_t bytes = bytesOf(whole);
    double before = knownShare(whole);
    for (const uint64_t budget : {bytes, bytes / 2, bytes / 4, bytes / 16, bytes / 64, uint64_t{0}}) {
        BakeOptions o = atLevel(6);
        o.budget = budget;
        const BakeResult r = bake(t, triangles, o);
        EXPECT_EQ(r.micromap.validate(), std::nullopt);
        EXPECT_LE(bytesOf(r), budget);
        const double known = knownShare(r);
        EXPECT_LE(known, before);
        before = known;
        if (budget == bytes) {
            EXPECT_EQ(r.micromap.data, whole.micromap.data);
        }
        // A lower level claims nothing that the higher one does not.
        for (uint32_t k = 0; k < triangles.size(); ++k) {
            for (int i = 0; i < 300; ++i) {
                const float u = static_cast<float>(i % 20) / 20 + 0.013f;
                const float v = static_cast<float>(i / 20) / 20 + 0.007f;
                const State state = r.micromap.stateAt(k, u, v);
                if (u + v < 1 && (state == State::Opaque || state == State::Transparent)) {
                    EXPECT_EQ(state, whole.micromap.stateAt(k, u, v));
                }
            }
        }
    }
    // Half the bytes lose little: the levels with the least information are removed first.
    BakeOptions o = atLevel(6);
    o.budget = bytes / 2;
    const BakeResult half = bake(t, triangles, o);
    const BakeResult lower = bake(t, triangles, atLevel(5));
    EXPECT_GT(bytesOf(half), bytes / 4);
    EXPECT_GT(knownShare(half), knownShare(lower));
}

// Sharing counts: the same triangles on three repetitions of the texture.
TEST(BakeResult, ABudgetOfItsOwnBytesChangesNothing)
{
    AlphaTexture t = disc(20);
    t.wrapU = Wrap::Repeat;
    std::vector<TriangleUvs> triangles;
    for (const TriangleUvs &uvs : scattered(20))
        for (const float shift : {0.0f, 4.0f, 8.0f}) {
            triangles.push_back(uvs);
            for (TexCoord &corner : triangles.back())
                corner.u = std::round(corner.u * 256) / 256 + shift;
        }
    for (const std::optional<uint32_t> level : {std::optional<uint32_t>(5), std::optional<uint32_t>()})
        for (const double minKnown : {0.0, 0.8})
            for (const Format format : {Format::FourState, Format::TwoState}) {
                BakeOptions o;
                o.level = level;
                o.texelsPerEdge = 2;
                o.minKnown = minKnown;
                o.format = format;
                const BakeResult whole = bake(t, triangles, o);
                EXPECT_LT(whole.micromap.triangles.size(), 21u);
                o.budget = bytesOf(whole);
                const BakeResult same = bake(t, triangles, o);
                EXPECT_EQ(same.micromap.data, whole.micromap.data);
                EXPECT_EQ(same.micromap.indices, whole.micromap.indices);
                *o.budget -= 1;
                const BakeResult less = bake(t, triangles, o);
                EXPECT_LE(bytesOf(less), *o.budget);
                EXPECT_GT(bytesOf(less), 0u);
            }
}

TEST(BakeResult, ABudgetIsSpent)
{
    const std::vector<TriangleUvs> triangles = scattered(60);
    const AlphaTexture t = disc(20);
    BakeOptions o;
    o.texelsPerEdge = 8;
    const BakeResult whole = bake(t, triangles, o);
    double before = knownShare(whole);
    for (const uint64_t factor : {2u, 4u, 16u}) {
        o.budget = factor * bytesOf(whole);
        const BakeResult r = bake(t, triangles, o);
        EXPECT_EQ(r.micromap.validate(), std::nullopt);
        EXPECT_LE(bytesOf(r), *o.budget);
        EXPECT_GT(bytesOf(r), *o.budget / 2);
        EXPECT_GT(knownShare(r), before + 0.01);
        before = knownShare(r);
    }
    o.budget = uint64_t{1} << 63;
    o.maxLevel = 4;
    for (const MicromapTriangle &triangle : bake(t, triangles, o).micromap.triangles)
        EXPECT_LE(triangle.subdivisionLevel, 4);
    // A level that was asked for is the highest.
    o.level = 3;
    const BakeResult high = bake(t, triangles, o);
    o.budget.reset();
    EXPECT_EQ(high.micromap.data, bake(t, triangles, o).micromap.data);
}

// As small as the best of all budgets that reach it, or smaller.
TEST(BakeResult, TheLeastBytesForWhatIsKnown)
{
    const std::vector<TriangleUvs> triangles = scattered(60);
    const AlphaTexture t = disc(20);
    BakeOptions o;
    o.texelsPerEdge = 8;
    for (const double share : {0.0, 0.3, 0.6, 0.8, 0.9}) {
        o.budget.reset();
        o.leastKnown = share * 60;
        const BakeResult r = bake(t, triangles, o);
        EXPECT_EQ(r.micromap.validate(), std::nullopt);
        EXPECT_GE(knownShare(r), share - 1e-12);
        o.leastKnown.reset();
        uint64_t low = 0;
        uint64_t high = 1u << 20;
        while (low < high) {
            o.budget = (low + high) / 2;
            if (knownShare(bake(t, triangles, o)) < share)
                low = *o.budget + 1;
            else
                high = *o.budget;
        }
        EXPECT_LE(static_cast<double>(bytesOf(r)), 1.01 * static_cast<double>(high)) << share;
    }
    // Levels that are given are the highest.
    o = atLevel(4);
    o.leastKnown = 60 * knownShare(bake(t, triangles, o));
    EXPECT_EQ(knownShare(bake(t, triangles, o)), *o.leastKnown / 60);
    const double most = *o.leastKnown;
    *o.leastKnown += 0.001;
    try {
        bake(t, triangles, o);
        FAIL();
    } catch (const BakeTooLittleKnown &error) {
        EXPECT_NEAR(error.most(), most, 1e-9);
    }
    o.budget = 1000;
    EXPECT_THROW(bake(t, triangles, o), BakeError);
}

TEST(BakeResult, ABudgetGoesToWhatWeighsMost)
{
    const std::vector<TriangleUvs> triangles = {{{{0, 0}, {1, 0}, {0, 1}}}, {{{1, 1}, {0.1f, 1}, {1, 0}}}};
    const AlphaTexture t = disc(20);
    for (const uint32_t heavy : {0u, 1u}) {
        std::vector<double> weights = {1, 1};
        weights[heavy] = 1000;
        BakeInput input{std::span(&t, 1), triangles};
        input.weights = weights;
        BakeOptions o = atLevel(5);
        o.budget = 300; // one of them has 264 bytes
        const BakeResult r = bake(std::span(&input, 1), o);
        const auto levelOf = [&](uint32_t which) {
            const int32_t index = r.micromap.indices[which];
            return index < 0 ? 0 : r.micromap.triangles[static_cast<size_t>(index)].subdivisionLevel;
        };
        EXPECT_EQ(levelOf(heavy), 5);
        EXPECT_LT(levelOf(1 - heavy), 5);
        weights.pop_back();
        input.weights = weights;
        EXPECT_THROW(bake(std::span(&input, 1), o), BakeError);
    }
}

TEST(BakeResult, TwoStateRules)
{
    const std::vector<TriangleUvs> triangles = scattered(10);
    const AlphaTexture t = disc(20);
    const BakeResult four = bake(t, triangles, atLevel(5));
    BakeOptions o = atLevel(5);
    o.format = Format::TwoState;
    for (const TwoStateRule rule :
         {TwoStateRule::Nearest, TwoStateRule::UnknownIsOpaque, TwoStateRule::UnknownIsTransparent}) {
        o.twoStateRule = rule;
        const BakeResult two = bake(t, triangles, o);
        EXPECT_EQ(two.micromap.validate(), std::nullopt);
        const auto &s = four.statistics.states;
        const uint64_t opaque = s[1] + (rule == TwoStateRule::UnknownIsOpaque ? s[2] + s[3]
                                        : rule == TwoStateRule::Nearest       ? s[3]
                                                                              : 0);
        EXPECT_EQ(two.statistics.states, (std::array<uint64_t, 4>{10 * 1024 - opaque, opaque, 0, 0}));
        for (uint32_t k = 0; k < triangles.size(); ++k) {
            for (uint32_t i = 0; i < 1024; ++i) {
                const auto c = microTriangleCorners(i, 5);
                const float u = (c[0].u + c[1].u + c[2].u) / 3;
                const float v = (c[0].v + c[1].v + c[2].v) / 3;
                const State state = four.micromap.stateAt(k, u, v);
                const bool unknown = state == State::UnknownOpaque || state == State::UnknownTransparent;
                const bool isOpaque = unknown && rule != TwoStateRule::Nearest
                                          ? rule == TwoStateRule::UnknownIsOpaque
                                          : state == State::Opaque || state == State::UnknownOpaque;
                EXPECT_EQ(two.micromap.stateAt(k, u, v), isOpaque ? State::Opaque : State::Transparent);
            }
        }
    }
}

TEST(BakeResult, TooLittleIsKnown)
{
    const std::vector<TriangleUvs> triangles = scattered(40);
    const AlphaTexture t = disc(20);
    BakeOptions o = atLevel(2);
    const BakeResult all = bake(t, triangles, o);
    o.minKnown = 0.8;
    const BakeResult some = bake(t, triangles, o);
    size_t dropped = 0;
    for (uint32_t k = 0; k < triangles.size(); ++k) {
        int known = 0;
        for (uint32_t i = 0; i < 16; ++i) {
            const auto c = microTriangleCorners(i, 2);
            const State state = all.micromap.stateAt(k, (c[0].u + c[1].u + c[2].u) / 3, (c[0].v + c[1].v + c[2].v) / 3);
            known += state == State::Opaque || state == State::Transparent ? 1 : 0;
        }
        const int32_t index = some.micromap.indices[k];
        EXPECT_EQ(index == -3 || index == -4, known < 0.8 * 16) << k;
        dropped += index == -3 || index == -4 ? 1u : 0u;
    }
    EXPECT_GT(dropped, 0u);
    EXPECT_LT(dropped, triangles.size());
}

TEST(BakeResult, SpecialIndicesStandAlone)
{
    const AlphaTexture t = disc(20);
    const std::vector<TriangleUvs> mixed = {{{{0, 0}, {1, 0}, {0, 1}}},
                                            {{{0.5f, 0.5f}, {0.51f, 0.5f}, {0.5f, 0.51f}}},
                                            {{{0, 0}, {0.01f, 0}, {0, 0.01f}}},
                                            {{{0, 0}, {0.02f, 0}, {0, 0.01f}}}};
    const std::vector<TriangleUvs> uniform = {mixed[1], mixed[2]};
    const BakeInput inputs[] = {{std::span(&t, 1), mixed}, {std::span(&t, 1), uniform}};
    BakeOptions o = atLevel(4);
    const BakeResult with = bake(inputs, o);
    EXPECT_EQ(with.micromap.indices, (std::vector<int32_t>{0, -2, -1, -1, -2, -1}));
    for (const Format format : {Format::FourState, Format::TwoState}) {
        o.format = format;
        o.disallowMixedSpecialIndices = true;
        const BakeResult r = bake(inputs, o);
        EXPECT_EQ(r.micromap.indices, (std::vector<int32_t>{0, 1, 2, 2, -2, -1}));
        EXPECT_EQ(r.micromap.validate(), std::nullopt);
        EXPECT_EQ(r.micromap.triangles[1].subdivisionLevel, 0);
        EXPECT_EQ(r.micromap.stateAt(1, 0.2f, 0.2f), State::Opaque);
        EXPECT_EQ(r.micromap.stateAt(2, 0.2f, 0.2f), State::Transparent);
    }
    o.format = Format::FourState;
    o.budget = bytesOf(with);
    EXPECT_LE(bytesOf(bake(inputs, o)), *o.budget);
}

TEST(BakeResult, CanBeCancelled)
{
    const std::vector<TriangleUvs> triangles = scattered(500);
    std::stop_source stop;
    BakeOptions o = atLevel(5);
    o.cancelled = [&] { return stop.stop_requested(); };
    size_t done = 0;
    o.progress = [&](size_t now, size_t total) {
        EXPECT_EQ(total, 500u);
        done = now;
        if (now >= 100)
            stop.request_stop();
    };
    EXPECT_THROW(bake(disc(20), triangles, o), BakeCancelled);
    EXPECT_GE(done, 100u);
    EXPECT_LT(done, 500u);
}

TEST(BakeResult, SameForAnyNumberOfThreads)
{
    const std::vector<TriangleUvs> triangles = scattered(700);
    const AlphaTexture t = disc(20);
    BakeOptions o = atLevel(6); // several batches
    o.threads = 1;
    const BakeResult one = bake(t, triangles, o);
    for (const unsigned threads : {2u, 5u}) {
        o.threads = threads;
        const BakeResult more = bake(t, triangles, o);
        EXPECT_EQ(more.micromap.data, one.micromap.data);
        EXPECT_EQ(more.micromap.indices, one.micromap.indices);
    }
    o.budget = bytesOf(one) / 3;
    const BakeResult some = bake(t, triangles, o);
    o.threads = 1;
    EXPECT_EQ(bake(t, triangles, o).micromap.data, some.micromap.data);
}
