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

struct DeviceValidation;
struct ValidatedStructure;

using StructurePointers = std::vector<std::weak_ptr<ValidatedStructure>>;

// A descriptor set, or the descriptors that a command buffer has pushed for one.
struct StructureSet {
    std::map<uint32_t, uint32_t> sizes;               // of the bindings of the layout
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
    [[nodiscard]] std::vector<std::shared_ptr<ValidatedStructure>> structures(const StructureSet &set, uint32_t binding,
                                                                              std::optional<uint32_t> element) const;

private:
    friend struct DescriptorAccess;
    mutable std::mutex mutex_; // guards everything, and the content of sets
    std::unordered_map<VkDescriptorSetLayout, std::map<uint32_t, uint32_t>> layouts_;
    std::unordered_map<VkDescriptorPool, std::unordered_set<VkDescriptorSet>> pools_;
    std::unordered_map<VkDescriptorSet, std::shared_ptr<StructureSet>> sets_;
    std::unordered_map<VkDescriptorUpdateTemplate, StructureTemplate> templates_;
};

namespace validation
{

VkResult createDescriptorSetLayout(DeviceValidation &, VkDevice, const VkDescriptorSetLayoutCreateInfo *,
                                   const VkAllocationCallbacks *, VkDescriptorSetLayout *);
void destroyDescriptorSetLayout(DeviceValidation &, VkDevice, VkDescriptorSetLayout, const VkAllocationCallbacks *);
void destroyDescriptorPool(DeviceValidation &, VkDevice, VkDescriptorPool, const VkAllocationCallbacks *);
VkResult resetDescriptorPool(DeviceValidation &, VkDevice, VkDescriptorPool, VkDescriptorPoolResetFlags);
VkResult allocateDescriptorSets(DeviceValidation &, VkDevice, const VkDescriptorSetAllocateInfo *, VkDescriptorSet *);
VkResult freeDescriptorSets(DeviceValidation &, VkDevice, VkDescriptorPool, uint32_t, const VkDescriptorSet *);
void updateDescriptorSets(DeviceValidation &, VkDevice, uint32_t, const VkWriteDescriptorSet *, uint32_t,
                          const VkCopyDescriptorSet *);
VkResult createDescriptorUpdateTemplate(DeviceValidation &, VkDevice, const VkDescriptorUpdateTemplateCreateInfo *,
                                        const VkAllocationCallbacks *, VkDescriptorUpdateTemplate *);
void destroyDescriptorUpdateTemplate(DeviceValidation &, VkDevice, VkDescriptorUpdateTemplate,
                                     const VkAllocationCallbacks *);
void updateDescriptorSetWithTemplate(DeviceValidation &, VkDevice, VkDescriptorSet, VkDescriptorUpdateTemplate,
                                     const void *);
void cmdBindDescriptorSets(DeviceValidation &, VkCommandBuffer, VkPipelineBindPoint, VkPipelineLayout, uint32_t,
                           uint32_t, const VkDescriptorSet *, uint32_t, const uint32_t *);
void cmdBindDescriptorSets2(DeviceValidation &, VkCommandBuffer, const VkBindDescriptorSetsInfoKHR *);
void cmdPushDescriptorSet(DeviceValidation &, VkCommandBuffer, VkPipelineBindPoint, VkPipelineLayout, uint32_t,
                          uint32_t, const VkWriteDescriptorSet *);
void cmdPushDescriptorSet2(DeviceValidation &, VkCommandBuffer, const VkPushDescriptorSetInfoKHR *);
void cmdPushDescriptorSetWithTemplate(DeviceValidation &, VkCommandBuffer, VkDescriptorUpdateTemplate, VkPipelineLayout,
                                      uint32_t, const void *);
void cmdPushDescriptorSetWithTemplate2(DeviceValidation &, VkCommandBuffer,
                                       const VkPushDescriptorSetWithTemplateInfoKHR *);

} // namespace validation
} // namespace vellum::layer
