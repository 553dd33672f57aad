// SPDX-License-Identifier: Apache-2.0
#include "job/shard.h"

#include <algorithm>

#include "base/error.h"
#include "base/text.h"
#include "core/hash.h"

namespace vellum::job
{

Shard parseShard(const std::string &text)
{
    constexpr uint32_t kMostShards = 1000000;
    const size_t slash = std::min(text.find('/'), text.size());
    const auto number = parseNumber<uint32_t>(text.substr(0, slash));
    const auto count = parseNumber<uint32_t>(text.substr(std::min(slash + 1, text.size())));
    if (!number || !count || *number == 0 || *number > *count || *count > kMostShards)
        throw UsageError("--shard must be K/N with K from 1 to N, and N at most 1000000, got " + text);
    return {*number, *count};
}

bool isInShard(const std::filesystem::path &name, const Shard &shard)
{
    const std::u8string text = name.lexically_normal().generic_u8string();
    uint64_t hash = Hash::of(text);
    hash ^= hash >> 32; // the low bits of the sum depend on few bits of the name
    return hash % shard.count == shard.number - 1;
}

} // namespace vellum::job
