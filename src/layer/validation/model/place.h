// SPDX-License-Identifier: Apache-2.0
// Where a fault is: a command, the way from its parameters to a member, and an object.
#pragma once

#include <cstdint>
#include <string>

#include <vulkan/vulkan.h>

namespace vellum::layer
{

// An object that a message names.
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
    VkObjectType type = VK_OBJECT_TYPE_UNKNOWN;
    uint64_t handle = 0;
};

// A place refers to the one around it, which must outlive it. Its text is made only for a fault.
class Place
{
public:
    explicit Place(const char *command) : name_(command) {}

    [[nodiscard]] Place member(const char *name) const & { return {name, this, kNoIndex}; }
    [[nodiscard]] Place element(const char *array, uint32_t index) const & { return {array, this, index}; }
    Place member(const char *) && = delete;
    Place element(const char *, uint32_t) && = delete;

    // Such as "vkCmdBuildMicromapsEXT: pInfos[2].pUsageCounts[1]".
    [[nodiscard]] std::string text() const
    {
        if (!outer_)
            return name_;
        std::string text = outer_->text() + (outer_->outer_ ? "." : ": ") + name_;
        if (index_ != kNoIndex)
            text += "[" + std::to_string(index_) + "]";
        return text;
    }

private:
    static constexpr uint32_t kNoIndex = UINT32_MAX;
    Place(const char *name, const Place *outer, uint32_t index) : name_(name), outer_(outer), index_(index) {}

    const char *name_;
    const Place *outer_ = nullptr;
    uint32_t index_ = kNoIndex;
};

} // namespace vellum::layer
