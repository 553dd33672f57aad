// SPDX-License-Identifier: Apache-2.0
#include "job/shard.h"

#include <algorithm>
#include <charconv>
#include <numeric>
#include <set>
#include <tuple>
#include <utility>

#include "base/error.h"

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

std::vector<uint32_t> shardOfEach(const std::vector<Weighted> &all, uint32_t count)
{
    std::vector<size_t> order(all.size());
    std::iota(order.begin(), order.end(), size_t{0});
    std::sort(order.begin(), order.end(), [&](size_t a, size_t b) {
        return std::tie(all[b].weight, all[a].name) < std::tie(all[a].weight, all[b].name);
    });
    std::set<std::pair<uint64_t, uint32_t>> loads; // and whose each is
    for (uint32_t shard = 1; shard <= count; ++shard)
        loads.emplace(0, shard);
    std::vector<uint32_t> shards(all.size());
    for (const size_t i : order) {
        auto least = loads.extract(loads.begin());
        shards[i] = least.value().second;
        least.value().first += all[i].weight;
        loads.insert(std::move(least));
    }
    return shards;
}

} // namespace vellum::job
