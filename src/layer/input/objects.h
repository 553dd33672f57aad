// SPDX-License-Identifier: Apache-2.0
// Objects as commands name them, and the facts about them that rules use.
#pragma once

#include <cstdint>

#include <vulkan/vulkan.h>

#include "vk/newer.h"

namespace vellum::layer
{

// An object that a command or a message names.
struct ObjectHandle {
    ObjectHandle() = default;
    ObjectHandle(VkObjectType t, uint64_t h) : type(t), handle(h) {}
    ObjectHandle(VkBuffer buffer) : ObjectHandle(VK_OBJECT_TYPE_BUFFER, uint64_t(buffer)) {}
    ObjectHandle(VkMicromapEXT micromap) : ObjectHandle(VK_OBJECT_TYPE_MICROMAP_EXT, uint64_t(micromap)) {}
    ObjectHandle(VkAccelerationStructureKHR structure)
        : ObjectHandle(VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR, uint64_t(structure))
    {
    }
    ObjectHandle(VkCommandBuffer commandBuffer) : ObjectHandle(VK_OBJECT_TYPE_COMMAND_BUFFER, uint64_t(commandBuffer))
    {
    }
    explicit operator bool() const { return handle != 0; }
    VkObjectType type = VK_OBJECT_TYPE_UNKNOWN;
    uint64_t handle = 0;
};

// Bytes of device memory; that of buffers that share memory is the same.
struct MemoryRange {
    uint64_t memory = 0; // 0: unknown
    uint64_t begin = 0;
    uint64_t end = 0;
    [[nodiscard]] bool empty() const { return memory == 0 || begin >= end; }
    [[nodiscard]] bool overlaps(const MemoryRange &other) const
    {
        return memory == other.memory && begin < other.end && other.begin < end;
    }
    bool operator==(const MemoryRange &) const = default;
};

// A micromap or an acceleration structure, as it was created.
struct ObjectFacts {
    bool exists = false;
    bool destroyed = false; // it existed
    VkAccelerationStructureTypeKHR type = VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR;
    VkAccelerationStructureTypeKHR content = VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR; // GENERIC: unknown
    VkDeviceSize size = 0;
    const char *lacksMemory = nullptr; // why it has no memory, as a clause
    bool hostVisible = true;           // its memory; known for host commands

    [[nodiscard]] bool isMicromap() const { return type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR; }
    [[nodiscard]] bool holdsMicromap() const
    {
        return isMicromap() || content == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR;
    }
    [[nodiscard]] bool canHoldMicromap() const
    {
        return isMicromap() || type == VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR;
    }
};

} // namespace vellum::layer
