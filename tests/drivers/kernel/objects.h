// SPDX-License-Identifier: Apache-2.0
// Memory that a GPU's driver allocates: pieces of a file, so that the driver maps them as it maps those of a GPU, by
// their place in the file.
#pragma once

#include <map>
#include <mutex>

#include "drm_interface.h"

namespace vellum::test::kernel
{

constexpr u32 kPageSize = 0x10000; // the largest page size of the simulated GPUs

class Objects
{
public:
    explicit Objects(int file) : file_(file) {}
    // Functions return 0 or an error of errno.h.
    int create(u64 size, u32 &handle);
    int offset(u32 handle, u64 &offset);
    int close(u32 handle);
    // A handle for an object without memory.
    u32 newHandle();

private:
    struct Piece {
        u64 offset = 0, size = 0;
    };
    int file_;
    std::mutex mutex_;
    std::map<u32, Piece> pieces_;
    u64 end_ = kPageSize; // no object is at 0, which turnip takes for an error
    u32 last_ = 0;
};

} // namespace vellum::test::kernel
