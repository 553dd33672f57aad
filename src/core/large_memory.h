// SPDX-License-Identifier: Apache-2.0
// Capacity for vectors of many megabytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#ifdef __linux__
#include <sys/mman.h>
#endif

namespace vellum
{

// Reserves capacity for `count` elements. Where the system can, it comes in large pages: a fault for each 4 KiB of a
// texture takes longer than to fill it.
template <typename T>
void reserveLarge(std::vector<T> &vector, size_t count)
{
    vector.reserve(count);
#if defined(__linux__) && defined(MADV_HUGEPAGE)
    constexpr size_t kLarge = size_t{2} << 20;
    const size_t bytes = count * sizeof(T);
    if (bytes < 2 * kLarge)
        return;
    // Whole large pages only: the memory around them has other owners.
    const auto address = reinterpret_cast<uintptr_t>(vector.data());
    const uintptr_t first = (address + kLarge - 1) / kLarge * kLarge;
    const uintptr_t last = (address + bytes) / kLarge * kLarge;
    // The system may reject the advice.
    (void)madvise(reinterpret_cast<void *>(first), last - first, MADV_HUGEPAGE);
#endif
}

} // namespace vellum
