// SPDX-License-Identifier: Apache-2.0
#include "layer/memory/fixed_memory.h"

#include <cstdint>

#ifdef __linux__
#include <sys/mman.h>
#endif

namespace vellum::layer
{

// ThreadSanitizer has no shadow memory for the addresses below.
#if defined(__linux__) && defined(MAP_FIXED_NOREPLACE) && UINTPTR_MAX > UINT32_MAX && !defined(__SANITIZE_THREAD__)

namespace
{

// Far from the programs, heaps, libraries and stacks of Linux with 47 bits of address space or more.
constexpr uintptr_t kFirst = 0x2f00'0000'0000;
constexpr uintptr_t kAddresses = 64;

} // namespace

FixedMemory::~FixedMemory()
{
    if (data_)
        munmap(data_, bytes_);
}

bool FixedMemory::reserve(size_t bytes)
{
    if (data_ || bytes == 0 || bytes > kMostBytes)
        return false;
    for (uintptr_t i = 0; i < kAddresses; ++i) {
        void *wanted = reinterpret_cast<void *>(kFirst + i * kMostBytes);
        void *got = mmap(wanted, bytes, PROT_READ | PROT_WRITE,
                         MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE | MAP_FIXED_NOREPLACE, -1, 0);
        if (got == wanted) {
            data_ = static_cast<std::byte *>(got);
            bytes_ = bytes;
            return true;
        }
        if (got != MAP_FAILED) // by an older kernel, for which the address is a hint
            munmap(got, bytes);
    }
    return false;
}

#else

FixedMemory::~FixedMemory() = default;

bool FixedMemory::reserve(size_t)
{
    return false;
}

#endif

} // namespace vellum::layer
