// SPDX-License-Identifier: Apache-2.0
#include "job/shard.h"

#include <charconv>

#include "base/error.h"
#include "core/hash.h"

namespace vellum::job
{

Shard parseShard(const std::string &text)
{
    constexpr uint32_t kMostShards = 1000000;
    Shard shard;
    const char *end = text.data() + text.size();
    const auto number = std::from_chars(text.data(), end, shard.number);
    const bool divided = number.ec == std::errc() && number.ptr != end && *number.ptr == '/';
    const auto count = std::from_chars(divided ? number.ptr + 1 : end, end, shard.count);
    if (!divided || count.ec != std::errc() || count.ptr != end || shard.number == 0 || shard.number > shard.count ||
        shard.count > kMostShards)
        throw UsageError("--shard must be K/N with K from 1 to N, and N at most 1000000, got " + text);
    return shard;
}

bool isInShard(const std::filesystem::path &name, const Shard &shard)
{
    const std::u8string text = name.lexically_normal().generic_u8string();
    uint64_t hash = Hash::of(text);
    hash ^= hash >> 32; // the low bits of the sum depend on few bits of the name
    return hash % shard.count == shard.number - 1;
}

} // namespace vellum::job
