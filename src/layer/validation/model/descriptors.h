// SPDX-License-Identifier: Apache-2.0
// The acceleration structures in descriptor sets. Sets whose content is not known, such as those in descriptor buffers,
// have none.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include <vulkan/vulkan.h>

#include "vk/newer.h"

namespace vellum::layer
{

struct DeviceModel;
struct ValidatedStructure;

// Includes structures that were destroyed.
using StructurePointers = std::vector<std::shared_ptr<ValidatedStructure>>;

struct DescriptorBinding {
    uint32_t size = 0;
    bool mayBeUnused = false; // what descriptors are not used by shaders need not be valid
};
using DescriptorBindings = std::map<uint32_t, DescriptorBinding>; // of a layout

// A descriptor set, or the descriptors that a command buffer has pushed for one.
struct StructureSet {
    DescriptorBindings bindings;                      // none: they are not known
    std::map<uint32_t, StructurePointers> structures; // by binding
};

// The sets of a bind point of a command buffer, by number.
using BoundSets = std::map<uint32_t, std::shared_ptr<StructureSet>>;

// The entries of a template that are acceleration structures.
struct StructureTemplate {
    VkShaderStageFlags stages = 0; // of its bind point, for descriptors that are pushed
    std::vector<VkDescriptorUpdateTemplateEntry> entries;
};

class DescriptorTracker
{
public:
    // The structures of a binding: one, or with no `element` all.
    [[nodiscard]] StructurePointers structures(const StructureSet &set, uint32_t binding,
                                               std::optional<uint32_t> element) const;

private:
    friend struct DescriptorAccess;
    mutable std::mutex mutex_; // guards everything, and the content of sets
    std::unordered_map<VkDescriptorSetLayout, DescriptorBindings> layouts_;
    std::unordered_map<VkDescriptorPool, std::unordered_set<VkDescriptorSet>> pools_;
    std::unordered_map<VkDescriptorSet, std::shared_ptr<StructureSet>> sets_;
    std::unordered_map<VkDescriptorUpdateTemplate, StructureTemplate> templates_;
};

// The descriptors of a device while it is locked.
struct DescriptorAccess {
    explicit DescriptorAccess(DeviceModel &model);

    auto &layouts() const { return tracker.layouts_; }
    auto &pools() const { return tracker.pools_; }
    auto &sets() const { return tracker.sets_; }
    auto &templates() const { return tracker.templates_; }

    [[nodiscard]] std::shared_ptr<StructureSet> set(VkDescriptorSet handle) const;
    [[nodiscard]] StructureTemplate form(VkDescriptorUpdateTemplate handle) const;
    void removePool(VkDescriptorPool pool) const;
    void write(StructureSet &set, const VkWriteDescriptorSet &write) const;
    void write(StructureSet &set, const StructureTemplate &form, const void *data) const;
    void copy(const VkCopyDescriptorSet &copy) const;

    DeviceModel &device;
    DescriptorTracker &tracker;
    std::lock_guard<std::mutex> lock;

private:
    [[nodiscard]] std::shared_ptr<ValidatedStructure> structure(VkAccelerationStructureKHR handle) const;
};

} // namespace vellum::layer
