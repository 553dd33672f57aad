// SPDX-License-Identifier: Apache-2.0
// What is flushed and invalidated of memory that is not coherent.
#include <gtest/gtest.h>

#include "layer/memory/host_memory.h"

namespace
{

void expectAtoms(VkDeviceSize memory, VkDeviceSize begin, VkDeviceSize bytes, VkDeviceSize atom, VkDeviceSize first,
                 VkDeviceSize size)
{
    const VkMappedMemoryRange range = vellum::layer::atomsOf(VK_NULL_HANDLE, memory, begin, bytes, atom);
    EXPECT_EQ(range.sType, VK_STRUCTURE_TYPE_MAPPED_MEMORY_RANGE);
    EXPECT_EQ(range.offset, first);
    EXPECT_EQ(range.size, size);
}

TEST(HostMemory, AtomsOfABuffer)
{
    expectAtoms(4096, 256, 512, 64, 256, 512);
    expectAtoms(4096, 300, 1, 64, 256, 64);
    expectAtoms(4096, 300, 20, 64, 256, 64);
    expectAtoms(4096, 300, 21, 64, 256, 128);
    expectAtoms(4096, 0, 4096, 256, 0, 4096);
    expectAtoms(4000, 3900, 100, 64, 3840, 160); // ends with the memory, which is no multiple of an atom
    expectAtoms(4096, 17, 5, 1, 17, 5);
}

} // namespace
