// SPDX-License-Identifier: Apache-2.0
#include "gpu/pipeline_builder.h"

#include <algorithm>
#include <array>
#include <utility>

namespace vellum::gpu
{
namespace
{

VkDeviceSize roundUp(VkDeviceSize value, VkDeviceSize alignment)
{
    return (value + alignment - 1) / alignment * alignment;
}

template <class T>
void fill(std::vector<T> &values)
{
    if (!values.empty())
        std::memset(static_cast<void *>(values.data()), 0x5a, values.size() * sizeof(T));
}

} // namespace

PipelineInfo::PipelineInfo(Device &gpu, const PipelineSetup &setup) : gpu_(gpu), inlined_(setup.stages.size())
{
    std::vector<std::pair<const uint32_t *, VkShaderModule>> shared;
    for (size_t i = 0; i < setup.stages.size(); ++i)
        names_.emplace_back(setup.stages[i].entry);
    for (size_t i = 0; i < setup.stages.size(); ++i) {
        const PipelineStage &from = setup.stages[i];
        auto stage = vkInit<VkPipelineShaderStageCreateInfo>(
            {.stage = from.stage, .pName = names_[i].c_str(), .pSpecializationInfo = from.specialization});
        if (from.inlineModule) {
            words_.push_back(gpu.code(from.words));
            inlined_[i] = vkInit<VkShaderModuleCreateInfo>(
                {.codeSize = words_.back().size() * sizeof(uint32_t), .pCode = words_.back().data()});
            stage.pNext = &inlined_[i];
        } else {
            const auto same = std::find_if(shared.begin(), shared.end(),
                                           [&from](const auto &s) { return s.first == from.words.data(); });
            if (setup.sharedModules && same != shared.end()) {
                stage.module = same->second;
            } else {
                stage.module = gpu_.shader(from.words);
                modules_.push_back(stage.module);
                shared.emplace_back(from.words.data(), stage.module);
            }
        }
        stages_.push_back(stage);
    }
    for (const PipelineGroup &from : setup.groups) {
        auto group = vkInit<VkRayTracingShaderGroupCreateInfoKHR>(
            {.type = from.general != kUnused        ? VK_RAY_TRACING_SHADER_GROUP_TYPE_GENERAL_KHR
                     : from.intersection != kUnused ? VK_RAY_TRACING_SHADER_GROUP_TYPE_PROCEDURAL_HIT_GROUP_KHR
                                                    : VK_RAY_TRACING_SHADER_GROUP_TYPE_TRIANGLES_HIT_GROUP_KHR,
             .generalShader = from.general,
             .closestHitShader = from.closestHit,
             .anyHitShader = from.anyHit,
             .intersectionShader = from.intersection});
        groups_.push_back(group);
    }
    libraries_ = setup.libraries;

    info_ = vkInit<VkRayTracingPipelineCreateInfoKHR>({.stageCount = static_cast<uint32_t>(stages_.size()),
                                                       .pStages = stages_.data(),
                                                       .groupCount = static_cast<uint32_t>(groups_.size()),
                                                       .pGroups = groups_.data(),
                                                       .maxPipelineRayRecursionDepth = setup.recursion,
                                                       .layout = setup.layout,
                                                       .basePipelineIndex = -1});
    if (!setup.flags2)
        info_.flags = static_cast<VkPipelineCreateFlags>(setup.flags);
    chainInfos(setup);
    if (!libraries_.empty() || (setup.flags & VK_PIPELINE_CREATE_LIBRARY_BIT_KHR) != 0) {
        interface_ = vkInit<VkRayTracingPipelineInterfaceCreateInfoKHR>(
            {.maxPipelineRayPayloadSize = setup.payloadSize, .maxPipelineRayHitAttributeSize = setup.attributeSize});
        info_.pLibraryInterface = &interface_;
    }
    if (!libraries_.empty()) {
        libraryInfo_ = vkInit<VkPipelineLibraryCreateInfoKHR>(
            {.libraryCount = static_cast<uint32_t>(libraries_.size()), .pLibraries = libraries_.data()});
        info_.pLibraryInfo = &libraryInfo_;
    }
    if (setup.dynamicStackSize) {
        states_ = {VK_DYNAMIC_STATE_RAY_TRACING_PIPELINE_STACK_SIZE_KHR};
        dynamic_ = vkInit<VkPipelineDynamicStateCreateInfo>({.dynamicStateCount = 1, .pDynamicStates = states_.data()});
        info_.pDynamicState = &dynamic_;
    }
}

void PipelineInfo::chainInfos(const PipelineSetup &setup)
{
    const void **tail = &info_.pNext;
    const auto chain = [&tail](auto &info) {
        *tail = &info;
        tail = &info.pNext;
    };
    const bool flagsFirst = (setup.chained & kChainFlagsFirst) != 0;
    flags2_ = vkInit<VkPipelineCreateFlags2CreateInfoKHR>({.flags = setup.flags});
    if (setup.flags2 && flagsFirst)
        chain(flags2_);
    if ((setup.chained & kChainFeedback) != 0) {
        feedbackOfStages_.resize(stages_.size());
        feedbackInfo_ = vkInit<VkPipelineCreationFeedbackCreateInfo>(
            {.pPipelineCreationFeedback = &feedback_,
             .pipelineStageCreationFeedbackCount = static_cast<uint32_t>(stages_.size()),
             .pPipelineStageCreationFeedbacks = feedbackOfStages_.data()});
        chain(feedbackInfo_);
    }
    if ((setup.chained & kChainRobustness) != 0) {
        robustness_ = vkInit<VkPipelineRobustnessCreateInfoEXT>();
        chain(robustness_);
    }
    if (setup.flags2 && !flagsFirst)
        chain(flags2_);
}

PipelineInfo::~PipelineInfo()
{
    for (const VkShaderModule module : modules_)
        vkDestroyShaderModule(gpu_.device(), module, nullptr);
}

void PipelineInfo::scribble()
{
    for (std::vector<uint32_t> &words : words_)
        fill(words);
    for (std::string &name : names_)
        std::fill(name.begin(), name.end(), 'z');
    fill(inlined_);
    fill(stages_);
    fill(groups_);
    fill(libraries_);
    fill(states_);
    std::memset(static_cast<void *>(&info_), 0x5a, sizeof info_);
    std::memset(static_cast<void *>(&interface_), 0x5a, sizeof interface_);
    std::memset(static_cast<void *>(&libraryInfo_), 0x5a, sizeof libraryInfo_);
    std::memset(static_cast<void *>(&dynamic_), 0x5a, sizeof dynamic_);
    std::memset(static_cast<void *>(&flags2_), 0x5a, sizeof flags2_);
    std::memset(static_cast<void *>(&feedbackInfo_), 0x5a, sizeof feedbackInfo_);
    std::memset(static_cast<void *>(&robustness_), 0x5a, sizeof robustness_);
}

RayPipeline::RayPipeline(Device &gpu, const PipelineSetup &setup) : gpu_(&gpu)
{
    PipelineInfo info(gpu, setup);
    std::vector<VkRayTracingPipelineCreateInfoKHR> infos{info.get()};
    if ((setup.creation & kCreateSeveral) != 0) {
        infos.insert(infos.begin(), infos[0]);
        // VUID-VkRayTracingPipelineCreateInfoKHR-flags-07403: what is linked has the bit if the others do.
        if (!setup.flags2 && setup.libraries.empty() && (setup.flags & VK_PIPELINE_CREATE_LIBRARY_BIT_KHR) == 0 &&
            gpu.options().micromaps)
            infos[0].flags ^= kMicromapBit;
        infos.push_back(info.get());
        infos.back().groupCount /= 2;
    }
    const size_t own = infos.size() / 2;
    VkPipelineCache cache = VK_NULL_HANDLE;
    if ((setup.creation & kCreateCached) != 0) {
        const auto create = vkInit<VkPipelineCacheCreateInfo>();
        CHECK_VK(vkCreatePipelineCache(gpu.device(), &create, nullptr, &cache));
    }
    VkResult result = VK_SUCCESS;
    for (int times = cache != VK_NULL_HANDLE ? 2 : 1; times > 0 && result == VK_SUCCESS; --times) {
        std::vector<VkPipeline> pipelines(infos.size());
        const auto create = [&](VkDeferredOperationKHR operation) {
            return gpu.vk().CreateRayTracingPipelinesKHR(gpu.device(), operation, cache,
                                                         static_cast<uint32_t>(infos.size()), infos.data(), nullptr,
                                                         pipelines.data());
        };
        result = (setup.creation & kCreateDeferred) != 0 ? deferred(gpu, create) : create(VK_NULL_HANDLE);
        if (times == 1)
            pipeline_ = std::exchange(pipelines[own], VK_NULL_HANDLE);
        for (const VkPipeline pipeline : pipelines)
            vkDestroyPipeline(gpu.device(), pipeline, nullptr);
    }
    vkDestroyPipelineCache(gpu.device(), cache, nullptr);
    checkResult(result, "vkCreateRayTracingPipelinesKHR");
}

RayPipeline::~RayPipeline()
{
    vkDestroyPipeline(gpu_->device(), pipeline_, nullptr);
}

std::vector<uint8_t> RayPipeline::groupHandles(uint32_t first, uint32_t count) const
{
    std::vector<uint8_t> handles(size_t{gpu_->pipelineProperties().shaderGroupHandleSize} * count, 0xee);
    CHECK_VK(gpu_->vk().GetRayTracingShaderGroupHandlesKHR(gpu_->device(), pipeline_, first, count, handles.size(),
                                                           handles.data()));
    return handles;
}

VkDeviceSize RayPipeline::stackSize(uint32_t group, VkShaderGroupShaderKHR shader) const
{
    return gpu_->vk().GetRayTracingShaderGroupStackSizeKHR(gpu_->device(), pipeline_, group, shader);
}

namespace
{

// Where the content of a buffer begins, so that its address has that alignment.
VkDeviceSize startOf(const Buffer &buffer, VkDeviceSize alignment)
{
    return roundUp(buffer.address(), alignment) - buffer.address();
}

std::span<const uint8_t> handleOf(std::span<const uint8_t> handles, uint32_t group, VkDeviceSize size)
{
    return handles.subspan(static_cast<size_t>(group * size), static_cast<size_t>(size));
}

} // namespace

BindingTable::BindingTable(Device &gpu, const RayPipeline &pipeline, const BindingRecords &records)
    : gpu_(gpu), otherStride_(records.layout.otherStride)
{
    const auto &limits = gpu.pipelineProperties();
    const TableLayout &layout = records.layout;
    const VkDeviceSize base = std::max(limits.shaderGroupBaseAlignment, 64u);
    alignment_ = base;
    const VkDeviceSize handle = limits.shaderGroupHandleSize;
    const VkDeviceSize alignment = std::max<VkDeviceSize>(limits.shaderGroupHandleAlignment, 4);
    const VkDeviceSize used = handle + VkDeviceSize{records.dataWords} * 4; // of a record
    struct Part {
        VkStridedDeviceAddressRegionKHR *region;
        std::vector<BindingRecord> records;
        VkDeviceSize stride, offset = 0;
    };
    const VkDeviceSize stride = roundUp(used, alignment);
    std::array<Part, 4> parts{{{&raygen, {records.raygen}, stride},
                               {&miss, records.miss, stride + layout.missPadding * alignment},
                               {&hit, records.hit, stride + layout.hitPadding * alignment},
                               {&callable, records.callable, stride + layout.missPadding * alignment}}};
    if (layout.reversed)
        std::ranges::reverse(parts);
    VkDeviceSize size = base * (1 + layout.before);
    for (Part &part : parts) {
        part.offset = size;
        size = roundUp(size + part.stride * part.records.size(), base) + base;
    }
    const bool local = gpu.options().memory == Memory::DeviceLocal;
    buffer_ = Buffer(gpu, size + base,
                     VK_BUFFER_USAGE_SHADER_BINDING_TABLE_BIT_KHR | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT |
                         VK_BUFFER_USAGE_TRANSFER_SRC_BIT |
                         (local ? VkBufferUsageFlags{VK_BUFFER_USAGE_TRANSFER_DST_BIT} : 0),
                     local ? Buffer::Place::Device : Buffer::Place::Host);
    std::vector<uint8_t> content(static_cast<size_t>(size));
    const VkDeviceSize start = startOf(buffer_, base);
    // All groups up to the last one used, by one call.
    uint32_t groups = 0;
    for (const Part &part : parts)
        for (const BindingRecord &record : part.records)
            groups = std::max(groups, record.group ? *record.group + 1 : 0);
    const std::vector<uint8_t> handles = pipeline.groupHandles(0, groups);
    for (uint32_t group = 0; group < groups; ++group)
        if (!std::ranges::equal(pipeline.groupHandles(group), handleOf(handles, group, handle)))
            gpu.fault("the handle of group " + std::to_string(group) + " is another one alone than among those of all");
    for (Part &part : parts) {
        for (size_t i = 0; i < part.records.size(); ++i) {
            const BindingRecord &record = part.records[i];
            uint8_t *at = content.data() + part.offset + i * part.stride;
            if (record.group) {
                const std::span<const uint8_t> bytes = handleOf(handles, *record.group, handle);
                std::memcpy(at, bytes.data(), bytes.size());
            }
            if (record.data.size() > records.dataWords)
                throw std::runtime_error("too much data in a binding table record");
            if (!record.data.empty())
                std::memcpy(at + handle, record.data.data(), record.data.size() * 4);
        }
        if (part.records.empty())
            continue;
        const bool cut = layout.cut && (part.region == &miss || part.region == &hit);
        const VkDeviceSize bytes = part.stride * (part.records.size() - 1) + (cut ? used : part.stride);
        const bool still = layout.zeroStride && part.region == &hit;
        *part.region = {buffer_.address() + start + part.offset, still ? 0 : part.stride, bytes};
    }
    buffer_.write(start, content.data(), content.size());
}

void BindingTable::trace(VkCommandBuffer commands, uint32_t width, uint32_t height, uint32_t depth) const
{
    gpu_.vk().CmdTraceRaysKHR(commands, &raygen, &miss, &hit, &callable, width, height, depth);
}

Buffer BindingTable::bufferForCopies(Device &gpu, VkDeviceSize bytes)
{
    return Buffer(gpu, bytes,
                  VK_BUFFER_USAGE_SHADER_BINDING_TABLE_BIT_KHR | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT |
                      VK_BUFFER_USAGE_TRANSFER_DST_BIT,
                  Buffer::Place::Device);
}

BindingTable::Regions BindingTable::regions() const
{
    Regions all{raygen, miss, hit, callable};
    if (copy_ == nullptr)
        return all;
    const VkDeviceAddress from = buffer_.address() + startOf(buffer_, alignment_);
    const VkDeviceAddress to = copy_->address() + startOf(*copy_, alignment_);
    for (VkStridedDeviceAddressRegionKHR *region : {&all.raygen, &all.miss, &all.hit, &all.callable})
        if (region->deviceAddress != 0)
            region->deviceAddress += to - from;
    return all;
}

void BindingTable::prepare(const LaunchPlan &launch, uint32_t rays, const Buffer *copy, uint32_t barrier)
{
    launch_ = launch;
    copy_ = copy;
    barrier_ = barrier;
    const uint32_t rows = launch.height * launch.depth;
    width_ = (rays + rows - 1) / rows;
    if (launch.command != Launch::Indirect2) {
        command_ = IndirectCommand(gpu_, launch, VkTraceRaysIndirectCommandKHR{width_, launch.height, launch.depth});
        return;
    }
    const Regions r = regions();
    command_ =
        IndirectCommand(gpu_, launch,
                        VkTraceRaysIndirectCommand2KHR{r.raygen.deviceAddress, r.raygen.size, r.miss.deviceAddress,
                                                       r.miss.size, r.miss.stride, r.hit.deviceAddress, r.hit.size,
                                                       r.hit.stride, r.callable.deviceAddress, r.callable.size,
                                                       r.callable.stride, width_, launch.height, launch.depth});
}

void BindingTable::trace(VkCommandBuffer commands) const
{
    if (copy_ != nullptr) {
        const VkDeviceSize from = startOf(buffer_, alignment_), to = startOf(*copy_, alignment_);
        const VkBufferCopy whole{from, to, buffer_.size() - alignment_};
        // The traces before have read what is overwritten.
        vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_RAY_TRACING_SHADER_BIT_KHR, VK_PIPELINE_STAGE_TRANSFER_BIT, 0,
                             0, nullptr, 0, nullptr, 0, nullptr);
        vkCmdCopyBuffer(commands, buffer_.handle(), copy_->handle(), 1, &whole);
        const bool forTables = (barrier_ & kBarrierForTables) != 0, ofMemory = (barrier_ & kBarrierOfMemory) != 0;
        const auto all = vkInit<VkMemoryBarrier2>(
            {.srcStageMask = VK_PIPELINE_STAGE_2_TRANSFER_BIT,
             .srcAccessMask = VK_ACCESS_2_TRANSFER_WRITE_BIT,
             .dstStageMask = VK_PIPELINE_STAGE_2_RAY_TRACING_SHADER_BIT_KHR,
             .dstAccessMask = forTables ? VK_ACCESS_2_SHADER_BINDING_TABLE_READ_BIT_KHR : VK_ACCESS_2_SHADER_READ_BIT});
        const auto one = vkInit<VkBufferMemoryBarrier2>({.srcStageMask = all.srcStageMask,
                                                         .srcAccessMask = all.srcAccessMask,
                                                         .dstStageMask = all.dstStageMask,
                                                         .dstAccessMask = all.dstAccessMask,
                                                         .srcQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED,
                                                         .dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED,
                                                         .buffer = copy_->handle(),
                                                         .size = VK_WHOLE_SIZE});
        const auto dependency =
            ofMemory ? vkInit<VkDependencyInfo>({.memoryBarrierCount = 1, .pMemoryBarriers = &all})
                     : vkInit<VkDependencyInfo>({.bufferMemoryBarrierCount = 1, .pBufferMemoryBarriers = &one});
        if (gpu_.hasSynchronization2())
            vkCmdPipelineBarrier2(commands, &dependency);
        else
            barrier(commands);
    }
    const Regions r = regions();
    if (otherStride_ && r.hit.deviceAddress != 0) {
        VkStridedDeviceAddressRegionKHR other = r.hit;
        other.stride = r.hit.stride == 0 ? r.miss.stride : 2 * r.hit.stride;
        if (other.stride > gpu_.pipelineProperties().maxShaderGroupStride)
            other.stride = 0;
        gpu_.vk().CmdTraceRaysKHR(commands, &r.raygen, &r.miss, &other, &r.callable, 0, 1, 1);
    }
    if (launch_.command == Launch::Direct)
        gpu_.vk().CmdTraceRaysKHR(commands, &r.raygen, &r.miss, &r.hit, &r.callable, width_, launch_.height,
                                  launch_.depth);
    else if (launch_.command == Launch::Indirect)
        gpu_.vk().CmdTraceRaysIndirectKHR(commands, &r.raygen, &r.miss, &r.hit, &r.callable, command_.range().address);
    else
        gpu_.vk().CmdTraceRaysIndirect2KHR(commands, command_.range().address);
}

PipelineResources::PipelineResources(Device &gpu, uint32_t buffers, uint32_t pushSize,
                                     std::span<const VkPushConstantRange> others, VkShaderStageFlags stages)
    : gpu_(gpu)
{
    std::vector<VkDescriptorSetLayoutBinding> bindings;
    for (uint32_t i = 0; i <= buffers; ++i)
        bindings.push_back({i,
                            i == 0 ? VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR : VK_DESCRIPTOR_TYPE_STORAGE_BUFFER,
                            1, VK_SHADER_STAGE_ALL, nullptr});
    auto setInfo = vkInit<VkDescriptorSetLayoutCreateInfo>(
        {.bindingCount = static_cast<uint32_t>(bindings.size()), .pBindings = bindings.data()});
    CHECK_VK(vkCreateDescriptorSetLayout(gpu.device(), &setInfo, nullptr, &setLayout_));
    std::vector<VkPushConstantRange> ranges(others.begin(), others.end());
    ranges.insert(ranges.begin(), {stages, 0, pushSize});
    auto layout = vkInit<VkPipelineLayoutCreateInfo>({.setLayoutCount = 1,
                                                      .pSetLayouts = &setLayout_,
                                                      .pushConstantRangeCount = static_cast<uint32_t>(ranges.size()),
                                                      .pPushConstantRanges = ranges.data()});
    CHECK_VK(vkCreatePipelineLayout(gpu.device(), &layout, nullptr, &layout_));
    const std::array<VkDescriptorPoolSize, 2> sizes{
        {{VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR, 1}, {VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, buffers}}};
    auto pool = vkInit<VkDescriptorPoolCreateInfo>(
        {.maxSets = 1, .poolSizeCount = static_cast<uint32_t>(sizes.size()), .pPoolSizes = sizes.data()});
    CHECK_VK(vkCreateDescriptorPool(gpu.device(), &pool, nullptr, &pool_));
    auto allocation = vkInit<VkDescriptorSetAllocateInfo>(
        {.descriptorPool = pool_, .descriptorSetCount = 1, .pSetLayouts = &setLayout_});
    CHECK_VK(vkAllocateDescriptorSets(gpu.device(), &allocation, &set_));
}

PipelineResources::~PipelineResources()
{
    vkDestroyDescriptorPool(gpu_.device(), pool_, nullptr);
    vkDestroyPipelineLayout(gpu_.device(), layout_, nullptr);
    vkDestroyDescriptorSetLayout(gpu_.device(), setLayout_, nullptr);
}

void PipelineResources::write(VkAccelerationStructureKHR scene, std::span<const Buffer *const> buffers) const
{
    auto structure = vkInit<VkWriteDescriptorSetAccelerationStructureKHR>(
        {.accelerationStructureCount = 1, .pAccelerationStructures = &scene});
    auto write = vkInit<VkWriteDescriptorSet>({.pNext = &structure,
                                               .dstSet = set_,
                                               .descriptorCount = 1,
                                               .descriptorType = VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR});
    vkUpdateDescriptorSets(gpu_.device(), 1, &write, 0, nullptr);
    write.pNext = nullptr;
    write.descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
    for (const Buffer *buffer : buffers) {
        const VkDescriptorBufferInfo info{buffer->handle(), 0, VK_WHOLE_SIZE};
        ++write.dstBinding;
        write.pBufferInfo = &info;
        vkUpdateDescriptorSets(gpu_.device(), 1, &write, 0, nullptr);
    }
}

void PipelineResources::bind(VkCommandBuffer commands, VkPipelineBindPoint point) const
{
    vkCmdBindDescriptorSets(commands, point, layout_, 0, 1, &set_, 0, nullptr);
}

} // namespace vellum::gpu
