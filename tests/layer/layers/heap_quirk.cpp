// SPDX-License-Identifier: Apache-2.0
// The quirk "heaps": VK_EXT_descriptor_heap for shaders that reach everything by the addresses in their push data. Push
// data is lavapipe's push constants. What a command invalidates (Using Heaps) is lost: constants and data become
// garbage, and what needs state that is gone is reported.
#include "layers/driver.h"
#include "vk/newer.h"

#include <array>
#include <cstring>
#include <optional>
#include <set>

namespace
{

using namespace driver;
constexpr Level kLevel = Level::Heaps;

constexpr uint32_t kPushBytes = 256; // the least maxPushDataSize

struct State {
    bool heap = false;      // a resource heap is bound or inherited
    bool heapLost = false;  // it was invalidated
    bool data = false;      // and data was pushed
    bool sets = false;      // descriptor sets or push constants are set
    bool setsLost = false;  // these were invalidated
    bool inherited = false; // a secondary command buffer that inherits heaps
    bool disturbed = false; // it has recorded a command that invalidates these
    std::map<VkPipelineBindPoint, VkPipeline> bound;
};
std::mutex mutex;
std::map<VkCommandBuffer, State> states;
std::map<void *, VkPipelineLayout> layouts; // of pipelines for heaps, by the key of the device
std::set<VkPipeline> heapPipelines;

// Overwrites what was pushed.
void lose(VkCommandBuffer handle)
{
    std::array<uint8_t, kPushBytes> garbage;
    garbage.fill(0xb7);
    DRIVER_NEXT(vkCmdPushConstants)
    (handle, layouts.at(keyOf(handle)), VK_SHADER_STAGE_ALL, 0, kPushBytes, garbage.data());
}

void useHeaps(VkCommandBuffer handle)
{
    State &state = states[handle];
    if (state.sets) {
        state.sets = false;
        state.setsLost = true;
        lose(handle);
    }
}

void useSets(VkCommandBuffer handle)
{
    const std::lock_guard lock(mutex);
    State &state = states[handle];
    if (state.heap || state.data)
        lose(handle);
    state.heapLost |= state.heap;
    state.heap = state.data = state.setsLost = false;
    state.sets = state.disturbed = true;
}

// A command that sets descriptors or push constants.
template <class Function>
struct SetCommand;
template <class... Arguments>
struct SetCommand<void(VKAPI_PTR *)(VkCommandBuffer, Arguments...)> {
    template <const char *const &name>
    static VKAPI_ATTR void VKAPI_CALL call(VkCommandBuffer handle, Arguments... arguments)
    {
        useSets(handle);
        next<void(VKAPI_PTR *)(VkCommandBuffer, Arguments...)>(kLevel, keyOf(handle), name)(handle, arguments...);
    }
};

VKAPI_ATTR void VKAPI_CALL bindHeap(VkCommandBuffer handle, const VkBindHeapInfoEXT *info)
{
    const std::lock_guard lock(mutex);
    if (info->heapRange.address == 0)
        report("VkBindHeapInfoEXT: a heap at the address 0");
    useHeaps(handle);
    states[handle].heap = true;
    states[handle].heapLost = false;
}

VKAPI_ATTR void VKAPI_CALL pushData(VkCommandBuffer handle, const VkPushDataInfoEXT *info)
{
    const std::lock_guard lock(mutex);
    if (info->offset % 4 != 0 || info->data.size % 4 != 0 || info->offset + info->data.size > kPushBytes)
        report("VUID-VkPushDataInfoEXT-offset-11243, -11418 or VUID-VkPushDataInfoEXT-data-11419");
    useHeaps(handle);
    states[handle].data = true;
    DRIVER_NEXT(vkCmdPushConstants)
    (handle, layouts.at(keyOf(handle)), VK_SHADER_STAGE_ALL, info->offset, static_cast<uint32_t>(info->data.size),
     info->data.address);
}

// Reports what a dispatch or trace needs and the command buffer does not have.
void checkState(VkCommandBuffer handle, VkPipelineBindPoint point)
{
    const std::lock_guard lock(mutex);
    State &state = states[handle];
    if (state.bound[point] == VK_NULL_HANDLE) // a shader object
        return;
    if (heapPipelines.contains(state.bound[point])) {
        if (state.heapLost)
            report("a shader for descriptor heaps runs after a command has invalidated the heap");
        if (!state.data)
            report("a shader for descriptor heaps runs without its push data");
    } else if (state.setsLost) {
        report("a shader runs without the descriptor sets that a command for descriptor heaps has invalidated");
    }
}

VKAPI_ATTR void VKAPI_CALL dispatch(VkCommandBuffer handle, uint32_t x, uint32_t y, uint32_t z)
{
    checkState(handle, VK_PIPELINE_BIND_POINT_COMPUTE);
    DRIVER_NEXT(vkCmdDispatch)(handle, x, y, z);
}

VKAPI_ATTR void VKAPI_CALL dispatchIndirect(VkCommandBuffer handle, VkBuffer buffer, VkDeviceSize offset)
{
    checkState(handle, VK_PIPELINE_BIND_POINT_COMPUTE);
    DRIVER_NEXT(vkCmdDispatchIndirect)(handle, buffer, offset);
}

VKAPI_ATTR void VKAPI_CALL traceRays(VkCommandBuffer handle, const VkStridedDeviceAddressRegionKHR *raygen,
                                     const VkStridedDeviceAddressRegionKHR *miss,
                                     const VkStridedDeviceAddressRegionKHR *hit,
                                     const VkStridedDeviceAddressRegionKHR *callable, uint32_t width, uint32_t height,
                                     uint32_t depth)
{
    checkState(handle, VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR);
    DRIVER_NEXT(vkCmdTraceRaysKHR)(handle, raygen, miss, hit, callable, width, height, depth);
}

VKAPI_ATTR void VKAPI_CALL bindPipeline(VkCommandBuffer handle, VkPipelineBindPoint point, VkPipeline pipeline)
{
    {
        const std::lock_guard lock(mutex);
        states[handle].bound[point] = pipeline;
    }
    DRIVER_NEXT(vkCmdBindPipeline)(handle, point, pipeline);
}

VKAPI_ATTR VkResult VKAPI_CALL beginCommandBuffer(VkCommandBuffer handle, const VkCommandBufferBeginInfo *info)
{
    {
        const std::lock_guard lock(mutex);
        State &state = states[handle] = {};
        const auto *heaps = info->pInheritanceInfo == nullptr
                                ? nullptr
                                : inChain<VkCommandBufferInheritanceDescriptorHeapInfoEXT>(
                                      info->pInheritanceInfo->pNext,
                                      VK_STRUCTURE_TYPE_COMMAND_BUFFER_INHERITANCE_DESCRIPTOR_HEAP_INFO_EXT);
        state.heap = state.inherited = heaps != nullptr && heaps->pResourceHeapBindInfo != nullptr;
    }
    return DRIVER_NEXT(vkBeginCommandBuffer)(handle, info);
}

VKAPI_ATTR void VKAPI_CALL executeCommands(VkCommandBuffer handle, uint32_t count, const VkCommandBuffer *buffers)
{
    DRIVER_NEXT(vkCmdExecuteCommands)(handle, count, buffers);
    const std::lock_guard lock(mutex);
    const bool hadHeap = states[handle].heap;
    const bool keepsHeap = hadHeap && std::all_of(buffers, buffers + count, [](VkCommandBuffer buffer) {
                               return states[buffer].inherited && !states[buffer].disturbed;
                           });
    states[handle] = {};
    states[handle].heap = keepsHeap;
    states[handle].heapLost = hadHeap && !keepsHeap;
}

// The layout that pipelines for heaps get, for which they must have none; nothing for other pipelines.
std::optional<VkPipelineLayout> heapLayout(VkDevice handle, const void *chain, VkPipelineLayout layout)
{
    const auto *flags =
        inChain<VkPipelineCreateFlags2CreateInfoKHR>(chain, VK_STRUCTURE_TYPE_PIPELINE_CREATE_FLAGS_2_CREATE_INFO_KHR);
    if (flags == nullptr || (flags->flags & VK_PIPELINE_CREATE_2_DESCRIPTOR_HEAP_BIT_EXT) == 0)
        return std::nullopt;
    if (layout != VK_NULL_HANDLE)
        report("a pipeline for descriptor heaps has a layout");
    const std::lock_guard lock(mutex);
    return layouts.at(keyOf(handle));
}

template <class Info>
VkResult createPipelines(VkDevice handle, std::span<const Info> infos, VkPipeline *pipelines, auto &&create)
{
    std::vector<Info> below(infos.begin(), infos.end());
    std::vector<bool> forHeaps;
    for (Info &info : below) {
        const auto layout = heapLayout(handle, info.pNext, info.layout);
        forHeaps.push_back(layout.has_value());
        info.layout = layout.value_or(info.layout);
    }
    const VkResult result = create(below.data());
    const std::lock_guard lock(mutex);
    for (size_t i = 0; i < infos.size(); ++i) {
        if (forHeaps[i])
            heapPipelines.insert(pipelines[i]);
        else
            heapPipelines.erase(pipelines[i]);
    }
    return result;
}

VKAPI_ATTR VkResult VKAPI_CALL createComputePipelines(VkDevice handle, VkPipelineCache cache, uint32_t count,
                                                      const VkComputePipelineCreateInfo *infos,
                                                      const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    return createPipelines(handle, std::span(infos, count), pipelines, [&](const auto *below) {
        return DRIVER_NEXT(vkCreateComputePipelines)(handle, cache, count, below, allocator, pipelines);
    });
}

VKAPI_ATTR VkResult VKAPI_CALL createRayTracingPipelines(VkDevice handle, VkDeferredOperationKHR operation,
                                                         VkPipelineCache cache, uint32_t count,
                                                         const VkRayTracingPipelineCreateInfoKHR *infos,
                                                         const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    return createPipelines(handle, std::span(infos, count), pipelines, [&](const auto *below) {
        return DRIVER_NEXT(vkCreateRayTracingPipelinesKHR)(handle, operation, cache, count, below, allocator,
                                                           pipelines);
    });
}

VKAPI_ATTR VkResult VKAPI_CALL enumerateExtensions(VkPhysicalDevice handle, const char *layer, uint32_t *count,
                                                   VkExtensionProperties *properties)
{
    return listExtensions(kLevel, handle, layer, count, properties, [](std::vector<VkExtensionProperties> &all) {
        std::strcpy(all.emplace_back().extensionName, VK_EXT_DESCRIPTOR_HEAP_EXTENSION_NAME);
        all.back().specVersion = 1;
    });
}

VKAPI_ATTR void VKAPI_CALL getFeatures(VkPhysicalDevice handle, VkPhysicalDeviceFeatures2 *features)
{
    DRIVER_NEXT(vkGetPhysicalDeviceFeatures2)(handle, features);
    if (auto *heaps = inChainOut<VkPhysicalDeviceDescriptorHeapFeaturesEXT>(
            features->pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DESCRIPTOR_HEAP_FEATURES_EXT)) {
        heaps->descriptorHeap = VK_TRUE;
        heaps->descriptorHeapCaptureReplay = VK_FALSE;
    }
}

VKAPI_ATTR VkResult VKAPI_CALL createDevice(VkPhysicalDevice handle, const VkDeviceCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkDevice *device)
{
    std::vector<const char *> names(info->ppEnabledExtensionNames,
                                    info->ppEnabledExtensionNames + info->enabledExtensionCount);
    std::erase_if(names,
                  [](const char *name) { return std::strcmp(name, VK_EXT_DESCRIPTOR_HEAP_EXTENSION_NAME) == 0; });
    VkDeviceCreateInfo below = *info;
    below.enabledExtensionCount = static_cast<uint32_t>(names.size());
    below.ppEnabledExtensionNames = names.data();
    const VkResult result = DRIVER_NEXT(vkCreateDevice)(handle, &below, allocator, device);
    if (result != VK_SUCCESS)
        return result;
    const VkPushConstantRange range{VK_SHADER_STAGE_ALL, 0, kPushBytes};
    auto layout = vkInit<VkPipelineLayoutCreateInfo>({.pushConstantRangeCount = 1, .pPushConstantRanges = &range});
    const auto create = next<PFN_vkCreatePipelineLayout>(kLevel, keyOf(*device), "vkCreatePipelineLayout");
    const std::lock_guard lock(mutex);
    return create(*device, &layout, nullptr, &layouts[keyOf(*device)]);
}

VKAPI_ATTR void VKAPI_CALL destroyDevice(VkDevice handle, const VkAllocationCallbacks *allocator)
{
    VkPipelineLayout layout = VK_NULL_HANDLE;
    {
        const std::lock_guard lock(mutex);
        if (auto node = layouts.extract(keyOf(handle)))
            layout = node.mapped();
    }
    if (handle != VK_NULL_HANDLE)
        DRIVER_NEXT(vkDestroyPipelineLayout)(handle, layout, nullptr);
    DRIVER_NEXT(vkDestroyDevice)(handle, allocator);
}

// The commands that set descriptors or push constants, and the suffixes of their types.
#define FOR_SET_COMMANDS(X)                                                                                            \
    X(vkCmdBindDescriptorSets, )                                                                                       \
    X(vkCmdBindDescriptorSets2, KHR)                                                                                   \
    X(vkCmdPushConstants, )                                                                                            \
    X(vkCmdPushConstants2, KHR)                                                                                        \
    X(vkCmdPushDescriptorSet, KHR)                                                                                     \
    X(vkCmdPushDescriptorSet2, KHR)                                                                                    \
    X(vkCmdPushDescriptorSetWithTemplate, KHR)                                                                         \
    X(vkCmdPushDescriptorSetWithTemplate2, KHR)                                                                        \
    X(vkCmdBindDescriptorBuffersEXT, )                                                                                 \
    X(vkCmdSetDescriptorBufferOffsetsEXT, )                                                                            \
    X(vkCmdSetDescriptorBufferOffsets2EXT, )                                                                           \
    X(vkCmdBindDescriptorBufferEmbeddedSamplersEXT, )                                                                  \
    X(vkCmdBindDescriptorBufferEmbeddedSamplers2EXT, )
#define NAME(command, suffix) const char *const k_##command = #command;
FOR_SET_COMMANDS(NAME)
#undef NAME

} // namespace

driver::LevelRows driver::heapRows()
{
    static const Row device[]{{"vkDestroyDevice", DRIVER_FUNCTION(destroyDevice)},
                              {"vkCreateComputePipelines", DRIVER_FUNCTION(createComputePipelines)},
                              {"vkCreateRayTracingPipelines", DRIVER_FUNCTION(createRayTracingPipelines)},
                              {"vkBeginCommandBuffer", DRIVER_FUNCTION(beginCommandBuffer)},
                              {"vkCmdExecuteCommands", DRIVER_FUNCTION(executeCommands)},
                              {"vkCmdBindPipeline", DRIVER_FUNCTION(bindPipeline)},
                              {"vkCmdDispatch", DRIVER_FUNCTION(dispatch)},
                              {"vkCmdDispatchIndirect", DRIVER_FUNCTION(dispatchIndirect)},
                              {"vkCmdTraceRays", DRIVER_FUNCTION(traceRays)},
                              {"vkCmdBindSamplerHeapEXT", DRIVER_FUNCTION(bindHeap), Row::Where::Always},
                              {"vkCmdBindResourceHeapEXT", DRIVER_FUNCTION(bindHeap), Row::Where::Always},
                              {"vkCmdPushDataEXT", DRIVER_FUNCTION(pushData), Row::Where::Always},
#define ROW(command, suffix) {#command, DRIVER_FUNCTION(&SetCommand<PFN_##command##suffix>::call<k_##command>)},
                              FOR_SET_COMMANDS(ROW)
#undef ROW
    };
    static const Row instance[]{
        {"vkCreateDevice", DRIVER_FUNCTION(createDevice)},
        {"vkEnumerateDeviceExtensionProperties", DRIVER_FUNCTION(enumerateExtensions)},
        {"vkGetPhysicalDeviceFeatures2", DRIVER_FUNCTION(getFeatures)},
    };
    return {device, instance};
}
