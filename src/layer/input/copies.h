// SPDX-License-Identifier: Apache-2.0
// Copies of micromaps and acceleration structures, to each other and to memory, and queries of their properties, as
// values: those of both extensions, on the device and on the host.
#pragma once

#include <cstddef>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/input/objects.h"
#include "vk/newer.h"

namespace vellum::layer::input
{

// A command is executed by the device or by the host.
enum class Executor { Device, Host };

// A clone or a compaction.
struct Copy {
    ObjectHandle source, target;
    Executor executor = Executor::Device;
    bool isClone = false, isCompaction = false; // neither: the mode is another one
    bool rightType = true;                      // the structure has the sType that it should
    bool hasChain = false;
    bool accepted = true; // set by the check of the rules: the layer's implementation carries it out

    [[nodiscard]] ObjectHandle subject() const { return target; } // messages are about it
    [[nodiscard]] bool khr() const { return target.type == VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR; }
};
inline Copy parse(const VkCopyMicromapInfoEXT &info, Executor executor)
{
    return {.source = info.src,
            .target = info.dst,
            .executor = executor,
            .isClone = info.mode == VK_COPY_MICROMAP_MODE_CLONE_EXT,
            .isCompaction = info.mode == VK_COPY_MICROMAP_MODE_COMPACT_EXT,
            .rightType = info.sType == VK_STRUCTURE_TYPE_COPY_MICROMAP_INFO_EXT,
            .hasChain = info.pNext != nullptr};
}
inline Copy parse(const VkCopyAccelerationStructureInfoKHR &info, Executor = Executor::Device)
{
    return {.source = info.src,
            .target = info.dst,
            .isClone = info.mode == VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR,
            .isCompaction = info.mode == VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR};
}

// A copy to or from serialized data.
struct SerializedCopy {
    ObjectHandle object;
    bool saves = false; // to memory
    VkDeviceOrHostAddressConstKHR data{};
    Executor executor = Executor::Device;
    bool rightMode = true;
    bool rightType = true;
    bool hasChain = false;
    bool accepted = true;
    bool isReported = false; // the data is wrong, and that was reported

    [[nodiscard]] ObjectHandle subject() const { return object; }
    [[nodiscard]] bool khr() const { return object.type == VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR; }
};
inline SerializedCopy parse(const VkCopyMicromapToMemoryInfoEXT &info, Executor executor)
{
    return {.object = info.src,
            .saves = true,
            .data = {.deviceAddress = info.dst.deviceAddress},
            .executor = executor,
            .rightMode = info.mode == VK_COPY_MICROMAP_MODE_SERIALIZE_EXT,
            .rightType = info.sType == VK_STRUCTURE_TYPE_COPY_MICROMAP_TO_MEMORY_INFO_EXT,
            .hasChain = info.pNext != nullptr};
}
inline SerializedCopy parse(const VkCopyMemoryToMicromapInfoEXT &info, Executor executor)
{
    return {.object = info.dst,
            .data = info.src,
            .executor = executor,
            .rightMode = info.mode == VK_COPY_MICROMAP_MODE_DESERIALIZE_EXT,
            .rightType = info.sType == VK_STRUCTURE_TYPE_COPY_MEMORY_TO_MICROMAP_INFO_EXT,
            .hasChain = info.pNext != nullptr};
}
inline SerializedCopy parse(const VkCopyAccelerationStructureToMemoryInfoKHR &info, Executor = Executor::Device)
{
    return {.object = info.src,
            .saves = true,
            .data = {.deviceAddress = info.dst.deviceAddress},
            .rightMode = info.mode == VK_COPY_ACCELERATION_STRUCTURE_MODE_SERIALIZE_KHR};
}
inline SerializedCopy parse(const VkCopyMemoryToAccelerationStructureInfoKHR &info, Executor = Executor::Device)
{
    return {.object = info.dst,
            .data = info.src,
            .rightMode = info.mode == VK_COPY_ACCELERATION_STRUCTURE_MODE_DESERIALIZE_KHR};
}

// A query of a property of several objects, which a command writes to a pool of queries or to memory of the host.
struct PropertyQuery {
    std::vector<ObjectHandle> objects;
    VkQueryType type = VK_QUERY_TYPE_MAX_ENUM;
    uint32_t first = 0; // of the pool's queries
    bool khr = false;
    // Memory of the host.
    size_t bytes = 0, stride = 0;
    const void *memory = nullptr;
    bool byValidation = false; // not a command of the application
    bool accepted = true;
};
template <typename Handle>
PropertyQuery parseQuery(uint32_t count, const Handle *handles, VkQueryType type, uint32_t first)
{
    PropertyQuery query;
    query.objects.assign(handles, handles + count);
    query.type = type;
    query.first = first;
    query.khr = ObjectHandle(Handle{}).type == VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR;
    return query;
}

} // namespace vellum::layer::input
