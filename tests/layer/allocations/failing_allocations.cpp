// SPDX-License-Identifier: Apache-2.0
#include "allocations/failing_allocations.h"

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <cstring>
#include <new>

#include <link.h>
#include <unwind.h>

namespace
{

struct Range {
    uintptr_t begin = 0, end = 0;
    [[nodiscard]] bool contains(const void *address) const
    {
        const auto at = reinterpret_cast<uintptr_t>(address);
        return at >= begin && at < end;
    }
};

std::atomic<bool> counting;
std::atomic<uint64_t> allocations, failsAt;
std::atomic<vt::Failing> how;
Range layer, standardLibrary; // written while nothing is counted

int findRange(dl_phdr_info *info, size_t, void *)
{
    const bool isLayer = std::strstr(info->dlpi_name, "libVkLayer_vellum_opacity_micromap.so") != nullptr;
    if (!isLayer && std::strstr(info->dlpi_name, "libstdc++.so") == nullptr)
        return 0;
    Range range{UINTPTR_MAX, 0};
    for (size_t i = 0; i < info->dlpi_phnum; ++i) {
        const ElfW(Phdr) &segment = info->dlpi_phdr[i];
        if (segment.p_type != PT_LOAD)
            continue;
        range.begin = std::min<uintptr_t>(range.begin, info->dlpi_addr + segment.p_vaddr);
        range.end = std::max<uintptr_t>(range.end, info->dlpi_addr + segment.p_vaddr + segment.p_memsz);
    }
    (isLayer ? layer : standardLibrary) = range;
    return 0;
}

// The function on whose behalf the standard library allocates, for example in std::string.
_Unwind_Reason_Code findCaller(_Unwind_Context *context, void *found)
{
    auto *const address = reinterpret_cast<void *>(_Unwind_GetIP(context));
    const bool seen = *static_cast<void **>(found) != nullptr;
    if (standardLibrary.contains(address)) {
        *static_cast<void **>(found) = address;
        return _URC_NO_REASON;
    }
    if (!seen) // of this file
        return _URC_NO_REASON;
    *static_cast<void **>(found) = address;
    return _URC_END_OF_STACK;
}

bool isLayers(const void *caller)
{
    if (!standardLibrary.contains(caller))
        return layer.contains(caller);
    void *found = nullptr;
    _Unwind_Backtrace(findCaller, &found);
    return layer.contains(found);
}

bool fails(const void *caller)
{
    if (!counting || !isLayers(caller))
        return false;
    const uint64_t number = ++allocations;
    return failsAt != 0 && (how == vt::Failing::Once ? number == failsAt : number >= failsAt);
}

void *allocate(size_t size, size_t alignment, const void *caller)
{
    const size_t rounded = (std::max<size_t>(size, 1) + alignment - 1) / alignment * alignment;
    return fails(caller) ? nullptr : std::aligned_alloc(alignment, rounded);
}

void *orThrow(void *memory)
{
    if (memory == nullptr)
        throw std::bad_alloc();
    return memory;
}

constexpr size_t kAlignment = __STDCPP_DEFAULT_NEW_ALIGNMENT__;

} // namespace

uint64_t vt::failAllocations(uint64_t n, Failing failing)
{
    counting = false;
    dl_iterate_phdr(findRange, nullptr);
    failsAt = n;
    how = failing;
    const uint64_t before = allocations.exchange(0);
    counting = n != 0;
    return before;
}

#define CALLER __builtin_return_address(0)

void *operator new(size_t size)
{
    return orThrow(allocate(size, kAlignment, CALLER));
}
void *operator new(size_t size, std::align_val_t alignment)
{
    return orThrow(allocate(size, static_cast<size_t>(alignment), CALLER));
}
void *operator new(size_t size, const std::nothrow_t &) noexcept
{
    return allocate(size, kAlignment, CALLER);
}
void operator delete(void *memory) noexcept
{
    std::free(memory);
}
void operator delete(void *memory, size_t) noexcept
{
    std::free(memory);
}
void operator delete(void *memory, std::align_val_t) noexcept
{
    std::free(memory);
}
void operator delete(void *memory, size_t, std::align_val_t) noexcept
{
    std::free(memory);
}
void operator delete(void *memory, const std::nothrow_t &) noexcept
{
    std::free(memory);
}
