// SPDX-License-Identifier: Apache-2.0
#include "layer/memory/fixed_memory.h"

#include <cstdint>

#include "layer/base/system.h"

namespace vellum::layer
{
namespace
{

#if defined(__SANITIZE_THREAD__) || UINTPTR_MAX == UINT32_MAX
constexpr uint64_t kAddresses = 0; // ThreadSanitizer has no shadow memory for the addresses below
#else
constexpr uint64_t kAddresses = 64;
#endif
// Far from the programs, heaps, libraries and stacks of Linux and Windows with 47 bits of address space or more.
constexpr uint64_t kFirst = 0x2f00'0000'0000;

} // namespace

FixedMemory::~FixedMemory()
{
    if (data_)
        unmapMemory(data_, bytes_);
}

bool FixedMemory::reserve(size_t bytes)
{
    if (data_ || bytes == 0 || bytes > kMostBytes)
        return false;
    for (uint64_t i = 0; i < kAddresses && !data_; ++i) {
        const auto address = static_cast<uintptr_t>(kFirst + i * kMostBytes);
        data_ = static_cast<std::byte *>(mapMemoryAt(reinterpret_cast<void *>(address), bytes));
    }
    bytes_ = data_ ? bytes : 0;
    return data_ != nullptr;
}

} // namespace vellum::layer
