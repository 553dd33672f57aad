// SPDX-License-Identifier: Apache-2.0
// Shards: which part of a job each of several machines does, without a word between them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace vellum::job
{

struct Shard {
    uint32_t number = 1; // from 1
    uint32_t count = 1;
};

// "2/8". Throws UsageError.
Shard parseShard(const std::string &text);

struct Weighted {
    std::string name; // different for each
    uint64_t weight = 0;
};

// The number of the shard that each belongs to. From the heaviest to the lightest, those of one weight by name, each
// goes to the shard that has least so far, the first of several. The order of `all` therefore does not matter; names
// and weights do.
std::vector<uint32_t> shardOfEach(const std::vector<Weighted> &all, uint32_t count);

} // namespace vellum::job
