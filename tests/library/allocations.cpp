// SPDX-License-Identifier: Apache-2.0
#include "allocations.h"

#include <cstdlib>
#include <new>

namespace vellum::test
{

std::atomic<long> allocationsLeft{-1};
std::atomic<long> allocationsAlive{0};

namespace
{

void *allocate(size_t size)
{
    if (allocationsLeft >= 0 && allocationsLeft-- == 0)
        throw std::bad_alloc();
    void *memory = std::malloc(size != 0 ? size : 1);
    if (memory == nullptr)
        throw std::bad_alloc();
    ++allocationsAlive;
    return memory;
}

void release(void *memory)
{
    if (memory == nullptr)
        return;
    --allocationsAlive;
    std::free(memory);
}

} // namespace
} // namespace vellum::test

void *operator new(size_t size)
{
    return vellum::test::allocate(size);
}
void *operator new(size_t size, const std::nothrow_t &) noexcept
{
    try {
        return vellum::test::allocate(size);
    } catch (const std::bad_alloc &) {
        return nullptr;
    }
}
void operator delete(void *memory) noexcept
{
    vellum::test::release(memory);
}
void operator delete(void *memory, size_t) noexcept
{
    vellum::test::release(memory);
}
