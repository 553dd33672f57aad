// SPDX-License-Identifier: Apache-2.0
// Descriptor sets: the acceleration structures in them.
#include "layer/base/pnext.h"
#include "layer/validation/commands.h"

namespace vellum::layer::validation
{
namespace
{

// The structures of descriptors are top-level ones.
void checkWrites(DeviceValidation &device, const char *command, uint32_t count, const VkWriteDescriptorSet *writes)
{
    const Place place(command);
    for (uint32_t w = 0; w < count && device.checks.core; ++w) {
        const auto *given = findInChain<VkWriteDescriptorSetAccelerationStructureKHR>(
            writes[w].pNext, VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET_ACCELERATION_STRUCTURE_KHR);
        for (uint32_t i = 0; writes[w].descriptorType == VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR && given &&
                             i < given->accelerationStructureCount;
             ++i) {
            const auto handle = given->pAccelerationStructures[i];
            const auto structure = handle ? device.objects.structures.get(handle) : nullptr;
            if (!structure || structure->type == VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR ||
                structure->type == VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR)
                continue;
            const Place element = place.element("pDescriptorWrites", w);
            device.at(element.element("pAccelerationStructures", i), structure->handle)
                .report("VUID-VkWriteDescriptorSetAccelerationStructureKHR-pAccelerationStructures-03579", nullptr,
                        "the structure was created as neither TOP_LEVEL nor GENERIC");
        }
    }
}

// Calls bind(sets of a bind point) for each bind point that has one of the stages.
template <typename Bind>
void eachPoint(TraceBindings &bindings, VkShaderStageFlags stages, Bind bind)
{
    constexpr VkShaderStageFlags kCompute = VK_SHADER_STAGE_COMPUTE_BIT;
    constexpr VkShaderStageFlags kRayTracing = VK_SHADER_STAGE_RAYGEN_BIT_KHR | VK_SHADER_STAGE_ANY_HIT_BIT_KHR |
                                               VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR | VK_SHADER_STAGE_MISS_BIT_KHR |
                                               VK_SHADER_STAGE_INTERSECTION_BIT_KHR | VK_SHADER_STAGE_CALLABLE_BIT_KHR;
    if ((stages & kCompute) != 0)
        bind(bindings.at(VK_PIPELINE_BIND_POINT_COMPUTE).sets);
    constexpr VkShaderStageFlags kSubpass = VK_SHADER_STAGE_SUBPASS_SHADING_BIT_HUAWEI;
    if ((stages & kRayTracing) != 0)
        bind(bindings.at(VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR).sets);
    if ((stages & kSubpass) != 0)
        bind(bindings.at(VK_PIPELINE_BIND_POINT_SUBPASS_SHADING_HUAWEI).sets);
    if ((stages & ~(kCompute | kRayTracing | kSubpass)) != 0)
        bind(bindings.at(VK_PIPELINE_BIND_POINT_GRAPHICS).sets);
}

VkShaderStageFlags stagesOf(VkPipelineBindPoint point)
{
    switch (point) {
    case VK_PIPELINE_BIND_POINT_COMPUTE: return VK_SHADER_STAGE_COMPUTE_BIT;
    case VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR: return VK_SHADER_STAGE_RAYGEN_BIT_KHR;
    case VK_PIPELINE_BIND_POINT_GRAPHICS: return VK_SHADER_STAGE_VERTEX_BIT;
    case VK_PIPELINE_BIND_POINT_SUBPASS_SHADING_HUAWEI: return VK_SHADER_STAGE_SUBPASS_SHADING_BIT_HUAWEI;
    default: return 0;
    }
}

void bindSets(DeviceValidation &device, VkCommandBuffer commandBuffer, VkShaderStageFlags stages, uint32_t first,
              uint32_t count, const VkDescriptorSet *handles)
{
    const auto log = device.checks.gpu ? device.logs.get(commandBuffer) : nullptr;
    if (!log)
        return;
    const DescriptorAccess access(device);
    eachPoint(log->traces, stages, [&](BoundSets &sets) {
        for (uint32_t i = 0; i < count; ++i)
            sets[first + i] = handles[i] ? access.set(handles[i]) : nullptr;
    });
}

// A push keeps the descriptors that were pushed before. Earlier commands have the set as it was.
template <typename Write>
void push(const DescriptorAccess &access, VkCommandBuffer commandBuffer, VkShaderStageFlags stages, uint32_t number,
          Write write)
{
    const auto log = access.device.logs.get(commandBuffer);
    if (!log)
        return;
    eachPoint(log->traces, stages, [&](BoundSets &sets) {
        auto &set = sets[number];
        set = set ? std::make_shared<StructureSet>(*set) : std::make_shared<StructureSet>();
        write(*set);
    });
}

void pushWrites(DeviceValidation &device, VkCommandBuffer commandBuffer, VkShaderStageFlags stages, uint32_t number,
                uint32_t count, const VkWriteDescriptorSet *writes)
{
    if (!device.checks.gpu)
        return;
    const DescriptorAccess access(device);
    push(access, commandBuffer, stages, number, [&](StructureSet &set) {
        for (uint32_t i = 0; i < count; ++i)
            access.write(set, writes[i]);
    });
}

void pushTemplate(DeviceValidation &device, VkCommandBuffer commandBuffer, VkDescriptorUpdateTemplate handle,
                  uint32_t number, const void *data)
{
    if (!device.checks.gpu)
        return;
    const DescriptorAccess access(device);
    const StructureTemplate form = access.form(handle);
    push(access, commandBuffer, form.stages, number, [&](StructureSet &set) { access.write(set, form, data); });
}

} // namespace

VkResult createDescriptorSetLayout(DeviceValidation &device, VkDevice handle,
                                   const VkDescriptorSetLayoutCreateInfo *info, const VkAllocationCallbacks *allocator,
                                   VkDescriptorSetLayout *layout)
{
    const VkResult result = device.next.CreateDescriptorSetLayout(handle, info, allocator, layout);
    if (result != VK_SUCCESS)
        return result;
    remember(device.objects, [&] {
        const DescriptorAccess access(device);
        const auto *flags = findInChain<VkDescriptorSetLayoutBindingFlagsCreateInfo>(
            info->pNext, VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_BINDING_FLAGS_CREATE_INFO);
        constexpr VkDescriptorBindingFlags kMayBeUnused =
            VK_DESCRIPTOR_BINDING_PARTIALLY_BOUND_BIT | VK_DESCRIPTOR_BINDING_UPDATE_UNUSED_WHILE_PENDING_BIT;
        auto &bindings = access.layouts()[*layout];
        bindings.clear();
        for (uint32_t i = 0; i < info->bindingCount; ++i)
            bindings[info->pBindings[i].binding] = {info->pBindings[i].descriptorCount,
                                                    flags && i < flags->bindingCount &&
                                                        (flags->pBindingFlags[i] & kMayBeUnused) != 0};
    });
    return result;
}

void destroyDescriptorSetLayout(DeviceValidation &device, VkDevice handle, VkDescriptorSetLayout layout,
                                const VkAllocationCallbacks *allocator)
{
    DescriptorAccess(device).layouts().erase(layout);
    device.next.DestroyDescriptorSetLayout(handle, layout, allocator);
}

void destroyDescriptorPool(DeviceValidation &device, VkDevice handle, VkDescriptorPool pool,
                           const VkAllocationCallbacks *allocator)
{
    DescriptorAccess(device).removePool(pool);
    device.next.DestroyDescriptorPool(handle, pool, allocator);
}

VkResult resetDescriptorPool(DeviceValidation &device, VkDevice handle, VkDescriptorPool pool,
                             VkDescriptorPoolResetFlags flags)
{
    DescriptorAccess(device).removePool(pool);
    return device.next.ResetDescriptorPool(handle, pool, flags);
}

VkResult allocateDescriptorSets(DeviceValidation &device, VkDevice handle, const VkDescriptorSetAllocateInfo *info,
                                VkDescriptorSet *sets)
{
    const VkResult result = device.next.AllocateDescriptorSets(handle, info, sets);
    if (result != VK_SUCCESS || !device.checks.gpu)
        return result;
    remember(device.objects, [&] {
        const DescriptorAccess access(device);
        for (uint32_t i = 0; i < info->descriptorSetCount; ++i) {
            auto set = std::make_shared<StructureSet>();
            set->bindings = access.layouts()[info->pSetLayouts[i]];
            access.pools()[info->descriptorPool].insert(sets[i]);
            access.sets()[sets[i]] = std::move(set);
        }
    });
    return result;
}

VkResult freeDescriptorSets(DeviceValidation &device, VkDevice handle, VkDescriptorPool pool, uint32_t count,
                            const VkDescriptorSet *sets)
{
    {
        const DescriptorAccess access(device);
        const auto known = access.pools().find(pool);
        for (uint32_t i = 0; i < count && known != access.pools().end(); ++i) {
            access.sets().erase(sets[i]);
            known->second.erase(sets[i]);
        }
    }
    return device.next.FreeDescriptorSets(handle, pool, count, sets);
}

void updateDescriptorSets(DeviceValidation &device, VkDevice handle, uint32_t writeCount,
                          const VkWriteDescriptorSet *writes, uint32_t copyCount, const VkCopyDescriptorSet *copies)
{
    checkWrites(device, "vkUpdateDescriptorSets", writeCount, writes);
    if (device.checks.gpu) {
        const DescriptorAccess access(device);
        for (uint32_t i = 0; i < writeCount; ++i)
            if (const auto set = access.set(writes[i].dstSet))
                access.write(*set, writes[i]);
        for (uint32_t i = 0; i < copyCount; ++i)
            access.copy(copies[i]);
    }
    device.next.UpdateDescriptorSets(handle, writeCount, writes, copyCount, copies);
}

VkResult createDescriptorUpdateTemplate(DeviceValidation &device, VkDevice handle,
                                        const VkDescriptorUpdateTemplateCreateInfo *info,
                                        const VkAllocationCallbacks *allocator, VkDescriptorUpdateTemplate *result)
{
    const VkResult created = device.next.CreateDescriptorUpdateTemplate(handle, info, allocator, result);
    if (created != VK_SUCCESS)
        return created;
    remember(device.objects, [&] {
        const DescriptorAccess access(device);
        StructureTemplate &form = access.templates()[*result];
        form.stages = info->templateType == VK_DESCRIPTOR_UPDATE_TEMPLATE_TYPE_PUSH_DESCRIPTORS_KHR
                          ? stagesOf(info->pipelineBindPoint)
                          : 0;
        auto &entries = form.entries;
        entries.assign(info->pDescriptorUpdateEntries,
                       info->pDescriptorUpdateEntries + info->descriptorUpdateEntryCount);
        std::erase_if(entries, [](const auto &entry) {
            return entry.descriptorType != VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR;
        });
    });
    return created;
}

void destroyDescriptorUpdateTemplate(DeviceValidation &device, VkDevice handle, VkDescriptorUpdateTemplate old,
                                     const VkAllocationCallbacks *allocator)
{
    DescriptorAccess(device).templates().erase(old);
    device.next.DestroyDescriptorUpdateTemplate(handle, old, allocator);
}

void updateDescriptorSetWithTemplate(DeviceValidation &device, VkDevice handle, VkDescriptorSet set,
                                     VkDescriptorUpdateTemplate entries, const void *data)
{
    if (device.checks.gpu) {
        const DescriptorAccess access(device);
        if (const auto known = access.set(set))
            access.write(*known, access.form(entries), data);
    }
    device.next.UpdateDescriptorSetWithTemplate(handle, set, entries, data);
}

void cmdBindDescriptorSets(DeviceValidation &device, VkCommandBuffer commandBuffer, VkPipelineBindPoint point,
                           VkPipelineLayout layout, uint32_t first, uint32_t count, const VkDescriptorSet *sets,
                           uint32_t offsetCount, const uint32_t *offsets)
{
    bindSets(device, commandBuffer, stagesOf(point), first, count, sets);
    leaveHeaps<&DeviceTable::CmdBindDescriptorSets>(device.commands, commandBuffer, point, layout, first, count, sets,
                                                    offsetCount, offsets);
}

void cmdBindDescriptorSets2(DeviceValidation &device, VkCommandBuffer commandBuffer,
                            const VkBindDescriptorSetsInfoKHR *info)
{
    bindSets(device, commandBuffer, info->stageFlags, info->firstSet, info->descriptorSetCount, info->pDescriptorSets);
    leaveHeaps<&DeviceTable::CmdBindDescriptorSets2KHR>(device.commands, commandBuffer, info);
}

void cmdPushDescriptorSet(DeviceValidation &device, VkCommandBuffer commandBuffer, VkPipelineBindPoint point,
                          VkPipelineLayout layout, uint32_t number, uint32_t count, const VkWriteDescriptorSet *writes)
{
    checkWrites(device, "vkCmdPushDescriptorSetKHR", count, writes);
    pushWrites(device, commandBuffer, stagesOf(point), number, count, writes);
    leaveHeaps<&DeviceTable::CmdPushDescriptorSetKHR>(device.commands, commandBuffer, point, layout, number, count,
                                                      writes);
}

void cmdPushDescriptorSet2(DeviceValidation &device, VkCommandBuffer commandBuffer,
                           const VkPushDescriptorSetInfoKHR *info)
{
    checkWrites(device, "vkCmdPushDescriptorSet2", info->descriptorWriteCount, info->pDescriptorWrites);
    pushWrites(device, commandBuffer, info->stageFlags, info->set, info->descriptorWriteCount, info->pDescriptorWrites);
    leaveHeaps<&DeviceTable::CmdPushDescriptorSet2KHR>(device.commands, commandBuffer, info);
}

void cmdPushDescriptorSetWithTemplate(DeviceValidation &device, VkCommandBuffer commandBuffer,
                                      VkDescriptorUpdateTemplate entries, VkPipelineLayout layout, uint32_t number,
                                      const void *data)
{
    pushTemplate(device, commandBuffer, entries, number, data);
    leaveHeaps<&DeviceTable::CmdPushDescriptorSetWithTemplateKHR>(device.commands, commandBuffer, entries, layout,
                                                                  number, data);
}

void cmdPushDescriptorSetWithTemplate2(DeviceValidation &device, VkCommandBuffer commandBuffer,
                                       const VkPushDescriptorSetWithTemplateInfoKHR *info)
{
    pushTemplate(device, commandBuffer, info->descriptorUpdateTemplate, info->set, info->pData);
    leaveHeaps<&DeviceTable::CmdPushDescriptorSetWithTemplate2KHR>(device.commands, commandBuffer, info);
}

void cmdBindDescriptorBuffers(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t count,
                              const VkDescriptorBufferBindingInfoEXT *infos)
{
    leaveHeaps<&DeviceTable::CmdBindDescriptorBuffersEXT>(device.commands, commandBuffer, count, infos);
}

} // namespace vellum::layer::validation
