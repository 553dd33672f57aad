// SPDX-License-Identifier: Apache-2.0
// Results of rewriting shaders. Applications create many pipelines from the same code: libraries that share modules,
// and pipelines that are created again.
#pragma once

#include <cstdint>
#include <list>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "spirv/rewrite.h"

namespace vellum::layer
{

class RewriteCache
{
public:
    // `mostBytes`: limit of the memory for kept code. The results that were used least recently are dropped.
    explicit RewriteCache(size_t mostBytes = size_t{32} << 20) : mostBytes_(mostBytes) {}

    // spirv::rewrite(words, options). The result is known if words and options are equal to those of an earlier call.
    // Code is rewritten without a lock, so that threads can rewrite different shaders at the same time.
    std::shared_ptr<const spirv::RewriteResult> rewrite(std::span<const uint32_t> words,
                                                        const spirv::RewriteOptions &options);

    struct Counts {
        uint64_t hits = 0, misses = 0;
        size_t bytes = 0; // of kept code
    };
    [[nodiscard]] Counts counts() const;

private:
    struct Entry {
        uint64_t hash;
        std::vector<uint32_t> words;
        std::string entryPoint; // of the pipeline stage in `options`
        spirv::RewriteOptions options;
        std::shared_ptr<const spirv::RewriteResult> result;
        [[nodiscard]] size_t bytes() const;
    };
    using Entries = std::list<Entry>;

    // The following are called with the mutex.
    std::shared_ptr<const spirv::RewriteResult> find(uint64_t hash, std::span<const uint32_t> words,
                                                     const spirv::RewriteOptions &options);
    void dropOldest();

    const size_t mostBytes_;
    mutable std::mutex mutex_; // guards what is below
    Entries entries_;          // the one that was used last first
    std::unordered_multimap<uint64_t, Entries::iterator> byHash_;
    Counts counts_;
};

} // namespace vellum::layer
