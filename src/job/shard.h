// SPDX-License-Identifier: Apache-2.0
// Shards: which part of a job each of several machines does, without a word between them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace vellum::job
{

struct Shard {
    uint32_t number = 1; // from 1
    uint32_t count = 1;
};

// "2/8". Throws UsageError.
Shard parseShard(const std::string &text);

// Returns whether the file with this name is in the shard: by a hash of the name, so that nothing that changes between
// runs moves a file to another shard, such as its size or the other files. `./a/b` and `a/b` are one name.
bool isInShard(const std::filesystem::path &name, const Shard &shard);

} // namespace vellum::job
