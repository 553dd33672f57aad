// SPDX-License-Identifier: Apache-2.0
#include "layer/pipelines/rewrite_cache.h"

#include <algorithm>

#include "core/hash.h"

namespace vellum::layer
{

size_t RewriteCache::Entry::bytes() const
{
    return sizeof *this + sizeof *result + (words.size() + result->words.size()) * sizeof(uint32_t);
}

std::shared_ptr<const spirv::RewriteResult> RewriteCache::rewrite(std::span<const uint32_t> words,
                                                                  const spirv::RewriteOptions &options)
{
    const uint64_t hash = hashBytes(words.data(), words.size_bytes());
    {
        std::lock_guard lock(mutex_);
        if (auto known = find(hash, words, options)) {
            ++counts_.hits;
            return known;
        }
        ++counts_.misses;
    }
    auto result = std::make_shared<const spirv::RewriteResult>(spirv::rewrite(words, options));
    if (result->status == spirv::RewriteResult::Status::Failed)
        return result;
    Entries made;
    Entry &entry = made.emplace_back(Entry{hash, {words.begin(), words.end()}, {}, options, result});
    if (entry.options.pipelineStage) {
        entry.entryPoint = entry.options.pipelineStage->entryPoint;
        entry.options.pipelineStage->entryPoint = entry.entryPoint;
    }
    std::lock_guard lock(mutex_);
    if (auto first = find(hash, words, options)) // another thread has added it meanwhile
        return first;
    byHash_.emplace(hash, made.begin());
    counts_.bytes += entry.bytes();
    entries_.splice(entries_.begin(), made);
    while (counts_.bytes > mostBytes_)
        dropOldest();
    return result;
}

std::shared_ptr<const spirv::RewriteResult> RewriteCache::find(uint64_t hash, std::span<const uint32_t> words,
                                                               const spirv::RewriteOptions &options)
{
    const auto [first, last] = byHash_.equal_range(hash);
    for (auto it = first; it != last; ++it) {
        const auto entry = it->second;
        if (entry->options != options || !std::ranges::equal(entry->words, words))
            continue;
        entries_.splice(entries_.begin(), entries_, entry);
        return entry->result;
    }
    return nullptr;
}

void RewriteCache::dropOldest()
{
    const auto oldest = std::prev(entries_.end());
    const auto [first, last] = byHash_.equal_range(oldest->hash);
    byHash_.erase(std::find_if(first, last, [&](const auto &known) { return known.second == oldest; }));
    counts_.bytes -= oldest->bytes();
    entries_.erase(oldest);
}

RewriteCache::Counts RewriteCache::counts() const
{
    std::lock_guard lock(mutex_);
    return counts_;
}

} // namespace vellum::layer
