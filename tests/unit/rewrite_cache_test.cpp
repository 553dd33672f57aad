// SPDX-License-Identifier: Apache-2.0
// Results of rewriting that are kept: the words are those of the rewriter, for each of the options.
#include <gtest/gtest.h>

#include <string>
#include <thread>
#include <vector>

#include "layer/pipelines/rewrite_cache.h"
#include "shaders/any_hit.h"
#include "spirv/module/numbers.h"

namespace vellum::test
{
namespace
{

using layer::RewriteCache;

spirv::RewriteOptions anyHitOptions(spirv::Prologue prologue, uint32_t fixed, std::string_view name = "main")
{
    spirv::RewriteOptions options{.rootAddress = 0x1000, .firstSlots = 0x2000};
    options.pipelineStage = spirv::PipelineStage{name, spv::ExecutionModelAnyHitKHR, prologue, {.fixed = fixed}};
    return options;
}

// Rewrites by the cache; checks that the result is the rewriter's.
std::shared_ptr<const spirv::RewriteResult> rewrite(RewriteCache &cache, const spirv::RewriteOptions &options)
{
    auto result = cache.rewrite(any_hit, options);
    const spirv::RewriteResult expected = spirv::rewrite(any_hit, options);
    EXPECT_EQ(result->status, expected.status);
    EXPECT_EQ(result->words, expected.words);
    EXPECT_EQ(result->error, expected.error);
    return result;
}

TEST(RewriteCaches, EqualRequestsAreRewrittenOnce)
{
    RewriteCache cache;
    const std::string name = "main"; // elsewhere than the literal: the cache must keep no view of it
    const auto first = rewrite(cache, anyHitOptions(spirv::Prologue::TriangleHits, 0, name));
    EXPECT_EQ(rewrite(cache, anyHitOptions(spirv::Prologue::TriangleHits, 0)), first);
    EXPECT_EQ(cache.counts().hits, 1u);
    EXPECT_EQ(cache.counts().misses, 1u);
}

TEST(RewriteCaches, DifferentOptionsHaveDifferentResults)
{
    RewriteCache cache;
    std::vector<spirv::RewriteOptions> all = {anyHitOptions(spirv::Prologue::TriangleHits, 0),
                                              anyHitOptions(spirv::Prologue::EitherHits, 0),
                                              anyHitOptions(spirv::Prologue::TriangleHits, shared::kHiddenRayFlags)};
    all.push_back(all[0]);
    all.back().rootAddress = 0x3000;
    all.push_back(all[0]);
    all.back().firstSlots = 0x4000;
    all.push_back(all[0]);
    all.back().pipelineStage->hidden.payload = {spv::OpTypeFloat, 32};
    all.push_back(all[2]);
    all.back().pipelineStage->hidden.constant = shared::kHiddenRayFlags;
    for (int round = 0; round < 2; ++round)
        for (const spirv::RewriteOptions &options : all)
            rewrite(cache, options);
    EXPECT_EQ(cache.counts().misses, all.size());
    EXPECT_EQ(cache.counts().hits, all.size());
}

TEST(RewriteCaches, FailuresAreNotKept)
{
    RewriteCache cache;
    const auto options = anyHitOptions(spirv::Prologue::TriangleHits, 0, "missing");
    EXPECT_EQ(rewrite(cache, options)->status, spirv::RewriteResult::Status::Failed);
    rewrite(cache, options);
    EXPECT_EQ(cache.counts().hits, 0u);
    EXPECT_EQ(cache.counts().bytes, 0u);
}

TEST(RewriteCaches, MemoryIsLimited)
{
    RewriteCache unlimited;
    rewrite(unlimited, anyHitOptions(spirv::Prologue::TriangleHits, 0));
    const size_t one = unlimited.counts().bytes;
    RewriteCache cache(one * 5 / 2);
    const auto options = [](uint64_t i) {
        auto made = anyHitOptions(spirv::Prologue::TriangleHits, 0);
        made.rootAddress = 0x1000 * (i + 1);
        return made;
    };
    for (uint64_t i = 0; i < 4; ++i) {
        rewrite(cache, options(i));
        rewrite(cache, options(0)); // used last, so that it is kept
        EXPECT_LE(cache.counts().bytes, one * 5 / 2);
    }
    EXPECT_EQ(cache.counts().misses, 4u);
    rewrite(cache, options(1));
    EXPECT_EQ(cache.counts().misses, 5u) << "had been dropped";
}

TEST(RewriteCaches, Threads)
{
    RewriteCache cache;
    std::vector<std::thread> threads;
    for (int i = 0; i < 4; ++i)
        threads.emplace_back([&] {
            for (uint64_t j = 0; j < 8; ++j) {
                auto options = anyHitOptions(spirv::Prologue::TriangleHits, 0);
                options.rootAddress = 0x1000 * (j % 2 + 1);
                rewrite(cache, options);
            }
        });
    for (std::thread &thread : threads)
        thread.join();
    EXPECT_EQ(cache.counts().hits + cache.counts().misses, 32u);
    EXPECT_GE(cache.counts().hits, 24u);
}

} // namespace
} // namespace vellum::test
