// SPDX-License-Identifier: Apache-2.0
#include "command_sides.h"

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include "base/error.h"
#include "shaders/command_bench_any_hit.h"
#include "shaders/command_bench_closest_hit.h"
#include "shaders/command_bench_compute.h"
#include "shaders/command_bench_fragment.h"
#include "shaders/command_bench_miss.h"
#include "shaders/command_bench_queries.h"
#include "shaders/command_bench_raygen.h"
#include "shaders/command_bench_vertex.h"

namespace vellum::bench
{
namespace
{

using gpu::checkResult;

constexpr VkBufferUsageFlags kUsage = VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT |
                                      VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_INDEX_BUFFER_BIT |
                                      VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT |
                                      VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR;

bool hasExtension(VkPhysicalDevice device, const char *name)
{
    uint32_t count = 0;
    checkResult(vkEnumerateDeviceExtensionProperties(device, nullptr, &count, nullptr), "listing device extensions");
    std::vector<VkExtensionProperties> extensions(count);
    checkResult(vkEnumerateDeviceExtensionProperties(device, nullptr, &count, extensions.data()),
                "listing device extensions");
    return std::any_of(extensions.begin(), extensions.end(),
                       [name](const auto &e) { return std::string_view(e.extensionName) == name; });
}

} // namespace

CommandSide::CommandSide(std::string sideName, const gpu::DeviceInfo &info, std::optional<gpu::Api> micromaps,
                         uint32_t objects)
    : name(std::move(sideName)), api(micromaps), physical_(info.handle)
{
    createDevice(info);
    createObjects(objects);
}

void CommandSide::createDevice(const gpu::DeviceInfo &info)
{
    auto addressCommands = vkInit<VkPhysicalDeviceDeviceAddressCommandsFeaturesKHR>({.deviceAddressCommands = VK_TRUE});
    auto khr = vkInit<VkPhysicalDeviceOpacityMicromapFeaturesKHR>({.micromap = VK_TRUE});
    auto ext = vkInit<VkPhysicalDeviceOpacityMicromapFeaturesEXT>(
        {.micromap = VK_TRUE, .micromapCaptureReplay = VK_FALSE, .micromapHostCommands = VK_FALSE});
    auto conditional = vkInit<VkPhysicalDeviceConditionalRenderingFeaturesEXT>(
        {.conditionalRendering = VK_TRUE, .inheritedConditionalRendering = VK_FALSE});
    auto pipelines = vkInit<VkPhysicalDeviceRayTracingPipelineFeaturesKHR>({.rayTracingPipeline = VK_TRUE});
    auto rayQuery = vkInit<VkPhysicalDeviceRayQueryFeaturesKHR>({.pNext = &pipelines, .rayQuery = VK_TRUE});
    auto structures = vkInit<VkPhysicalDeviceAccelerationStructureFeaturesKHR>(
        {.pNext = &rayQuery, .accelerationStructure = VK_TRUE});
    auto features13 = vkInit<VkPhysicalDeviceVulkan13Features>({.pNext = &structures});
    features13.synchronization2 = features13.dynamicRendering = features13.privateData = VK_TRUE;
    auto features12 = vkInit<VkPhysicalDeviceVulkan12Features>({.pNext = &features13, .bufferDeviceAddress = VK_TRUE});
    const auto features = vkInit<VkPhysicalDeviceFeatures2>({.pNext = &features12});
    std::vector<const char *> extensions = {
        VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME, VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME,
        VK_KHR_RAY_QUERY_EXTENSION_NAME, VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME};
    const auto add = [&](auto &feature, const char *extension) {
        feature.pNext = std::exchange(pipelines.pNext, &feature);
        extensions.push_back(extension);
    };
    if (hasExtension(physical_, VK_EXT_CONDITIONAL_RENDERING_EXTENSION_NAME))
        add(conditional, VK_EXT_CONDITIONAL_RENDERING_EXTENSION_NAME);
    if (api == gpu::Api::Khr) {
        add(addressCommands, VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME);
        add(khr, VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME);
    } else if (api == gpu::Api::Ext) {
        add(ext, VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME);
    }
    const float priority = 1;
    auto queueInfo = vkInit<VkDeviceQueueCreateInfo>({.queueCount = 1, .pQueuePriorities = &priority});
    auto deviceInfo = vkInit<VkDeviceCreateInfo>({.pNext = &features,
                                                  .queueCreateInfoCount = 1,
                                                  .pQueueCreateInfos = &queueInfo,
                                                  .enabledExtensionCount = static_cast<uint32_t>(extensions.size()),
                                                  .ppEnabledExtensionNames = extensions.data()});
    checkResult(vkCreateDevice(info.handle, &deviceInfo, nullptr, &device), "creating a Vulkan device");
    const auto load = [this](auto &function, const char *command) {
        function = reinterpret_cast<std::remove_reference_t<decltype(function)>>(vkGetDeviceProcAddr(device, command));
    };
#define VELLUM_LOAD(command)                                                                                           \
    load(vk.command, "vk" #command);                                                                                   \
    if (!vk.command)                                                                                                   \
        throw Error("the device lacks the command vk" #command);
    VELLUM_BENCH_COMMANDS(VELLUM_LOAD)
#undef VELLUM_LOAD
#define VELLUM_LOAD(command) load(vk.command, "vk" #command);
    VELLUM_BENCH_OPTIONAL_COMMANDS(VELLUM_LOAD)
#undef VELLUM_LOAD
    // The queue is the loader's, which puts its table into the handles that it returns.
    vkGetDeviceQueue(device, 0, 0, &queue);
}

void CommandSide::createObjects(uint32_t objects)
{
    const VkDescriptorSetLayoutBinding bindings[] = {
        {0, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1, VK_SHADER_STAGE_COMPUTE_BIT, nullptr},
        {1, VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR, 1,
         VK_SHADER_STAGE_COMPUTE_BIT | VK_SHADER_STAGE_RAYGEN_BIT_KHR, nullptr}};
    const auto setInfo = vkInit<VkDescriptorSetLayoutCreateInfo>({.bindingCount = 2, .pBindings = bindings});
    checkResult(vk.CreateDescriptorSetLayout(device, &setInfo, nullptr, &setLayout),
                "creating a descriptor set layout");
    const VkPushConstantRange range{VK_SHADER_STAGE_ALL, 0, 128};
    const auto layoutInfo = vkInit<VkPipelineLayoutCreateInfo>(
        {.setLayoutCount = 1, .pSetLayouts = &setLayout, .pushConstantRangeCount = 1, .pPushConstantRanges = &range});
    checkResult(vk.CreatePipelineLayout(device, &layoutInfo, nullptr, &layout), "creating a pipeline layout");
    plain = makeModule(command_bench_compute, sizeof command_bench_compute);
    queries = makeModule(command_bench_queries, sizeof command_bench_queries);
    vertex = makeModule(command_bench_vertex, sizeof command_bench_vertex);
    fragment = makeModule(command_bench_fragment, sizeof command_bench_fragment);
    raygen = makeModule(command_bench_raygen, sizeof command_bench_raygen);
    miss = makeModule(command_bench_miss, sizeof command_bench_miss);
    closestHit = makeModule(command_bench_closest_hit, sizeof command_bench_closest_hit);
    anyHit = makeModule(command_bench_any_hit, sizeof command_bench_any_hit);
    compute = makeCompute(plain);
    graphics = makeGraphics();
    rayTracing = makeRayTracing(false);

    buffer = makeBuffer(65536, kUsage);
    other = makeBuffer(65536, kUsage);
    storage = makeBuffer(65536, VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR |
                                    VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    auto structureInfo = vkInit<VkAccelerationStructureCreateInfoKHR>(
        {.buffer = storage.buffer, .size = 16384, .type = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR});
    checkResult(vk.CreateAccelerationStructureKHR(device, &structureInfo, nullptr, &structure),
                "creating an acceleration structure");
    const auto queryInfo = vkInit<VkQueryPoolCreateInfo>({.queryType = VK_QUERY_TYPE_TIMESTAMP, .queryCount = 64});
    checkResult(vk.CreateQueryPool(device, &queryInfo, nullptr, &timestamps), "creating a query pool");
    const auto eventInfo = vkInit<VkEventCreateInfo>();
    checkResult(vk.CreateEvent(device, &eventInfo, nullptr, &event), "creating an event");
    const auto fenceInfo = vkInit<VkFenceCreateInfo>({.flags = VK_FENCE_CREATE_SIGNALED_BIT});
    checkResult(vk.CreateFence(device, &fenceInfo, nullptr, &fence), "creating a fence");
    const auto slotInfo = vkInit<VkPrivateDataSlotCreateInfo>();
    checkResult(vk.CreatePrivateDataSlot(device, &slotInfo, nullptr, &slot), "creating a private data slot");

    secondaryPool = makePool();
    secondary = allocate(secondaryPool, VK_COMMAND_BUFFER_LEVEL_SECONDARY);
    begin(secondary, VK_COMMAND_BUFFER_USAGE_SIMULTANEOUS_USE_BIT);
    checkResult(vk.EndCommandBuffer(secondary), "recording");
    constexpr VkDeviceSize kSmall = 256;
    manyStorage_ =
        makeBuffer((VkDeviceSize{objects} + 1) * kSmall,
                   VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    structureInfo.buffer = manyStorage_.buffer;
    structureInfo.size = kSmall;
    for (uint32_t i = 0; i < objects; ++i) {
        structureInfo.offset = i * kSmall;
        checkResult(vk.CreateAccelerationStructureKHR(device, &structureInfo, nullptr, &structures_.emplace_back()),
                    "creating an acceleration structure");
        const auto query =
            vkInit<VkAccelerationStructureDeviceAddressInfoKHR>({.accelerationStructure = structures_.back()});
        (void)vk.GetAccelerationStructureDeviceAddressKHR(device, &query);
        if (i % 256 == 0)
            pools_.push_back(makePool());
        (void)allocate(pools_.back(), VK_COMMAND_BUFFER_LEVEL_PRIMARY);
        buffers_.push_back(makeBuffer(256, kUsage));
    }
}

CommandSide::~CommandSide()
{
    vk.DeviceWaitIdle(device);
    for (const BenchBuffer &b : buffers_)
        destroy(b);
    for (const VkCommandPool pool : pools_)
        vk.DestroyCommandPool(device, pool, nullptr);
    vk.DestroyCommandPool(device, secondaryPool, nullptr);
    vk.DestroyPrivateDataSlot(device, slot, nullptr);
    vk.DestroyFence(device, fence, nullptr);
    vk.DestroyEvent(device, event, nullptr);
    vk.DestroyQueryPool(device, timestamps, nullptr);
    vk.DestroyAccelerationStructureKHR(device, structure, nullptr);
    for (const VkAccelerationStructureKHR s : structures_)
        vk.DestroyAccelerationStructureKHR(device, s, nullptr);
    for (const BenchBuffer &b : {buffer, other, storage, manyStorage_})
        destroy(b);
    for (const VkPipeline p : {compute, graphics, rayTracing})
        vk.DestroyPipeline(device, p, nullptr);
    for (const VkShaderModule m : {plain, queries, vertex, fragment, raygen, miss, closestHit, anyHit})
        vk.DestroyShaderModule(device, m, nullptr);
    vk.DestroyPipelineLayout(device, layout, nullptr);
    vk.DestroyDescriptorSetLayout(device, setLayout, nullptr);
    vk.DestroyDevice(device, nullptr);
}

VkCommandPool CommandSide::makePool() const
{
    const auto info = vkInit<VkCommandPoolCreateInfo>({.flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT});
    VkCommandPool pool = VK_NULL_HANDLE;
    checkResult(vk.CreateCommandPool(device, &info, nullptr, &pool), "creating a command pool");
    return pool;
}

VkCommandBuffer CommandSide::allocate(VkCommandPool pool, VkCommandBufferLevel level) const
{
    const auto info =
        vkInit<VkCommandBufferAllocateInfo>({.commandPool = pool, .level = level, .commandBufferCount = 1});
    VkCommandBuffer commands = VK_NULL_HANDLE;
    // The command buffer is the loader's, like the queue.
    checkResult(vkAllocateCommandBuffers(device, &info, &commands), "allocating a command buffer");
    return commands;
}

void CommandSide::begin(VkCommandBuffer commands, VkCommandBufferUsageFlags flags) const
{
    const auto inherited = vkInit<VkCommandBufferInheritanceInfo>();
    const auto info = vkInit<VkCommandBufferBeginInfo>({.flags = flags, .pInheritanceInfo = &inherited});
    checkResult(vk.BeginCommandBuffer(commands, &info), "recording");
}

BenchBuffer CommandSide::makeBuffer(VkDeviceSize bytes, VkBufferUsageFlags usage) const
{
    BenchBuffer result;
    auto info = vkInit<VkBufferCreateInfo>({.size = bytes, .usage = usage});
    checkResult(vk.CreateBuffer(device, &info, nullptr, &result.buffer), "creating a buffer");
    VkMemoryRequirements needs{};
    vk.GetBufferMemoryRequirements(device, result.buffer, &needs);
    VkPhysicalDeviceMemoryProperties memory{};
    vkGetPhysicalDeviceMemoryProperties(physical_, &memory);
    uint32_t type = 0;
    while ((needs.memoryTypeBits >> type & 1u) == 0 ||
           (memory.memoryTypes[type].propertyFlags & VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT) == 0)
        ++type;
    const auto flags = vkInit<VkMemoryAllocateFlagsInfo>({.flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT});
    const auto allocation =
        vkInit<VkMemoryAllocateInfo>({.pNext = &flags, .allocationSize = needs.size, .memoryTypeIndex = type});
    checkResult(vk.AllocateMemory(device, &allocation, nullptr, &result.memory), "allocating memory");
    checkResult(vk.BindBufferMemory(device, result.buffer, result.memory, 0), "binding memory");
    const auto query = vkInit<VkBufferDeviceAddressInfo>({.buffer = result.buffer});
    result.address = vk.GetBufferDeviceAddress(device, &query);
    return result;
}

void CommandSide::destroy(const BenchBuffer &b) const
{
    vk.DestroyBuffer(device, b.buffer, nullptr);
    vk.FreeMemory(device, b.memory, nullptr);
}

VkShaderModule CommandSide::makeModule(const uint32_t *words, size_t bytes) const
{
    const auto info = vkInit<VkShaderModuleCreateInfo>({.codeSize = bytes, .pCode = words});
    VkShaderModule module = VK_NULL_HANDLE;
    checkResult(vk.CreateShaderModule(device, &info, nullptr, &module), "creating a shader module");
    return module;
}

VkPipeline CommandSide::makeCompute(VkShaderModule module) const
{
    auto info = vkInit<VkComputePipelineCreateInfo>(
        {.stage = vkInit<VkPipelineShaderStageCreateInfo>(
             {.stage = VK_SHADER_STAGE_COMPUTE_BIT, .module = module, .pName = "main"}),
         .layout = layout});
    VkPipeline pipeline = VK_NULL_HANDLE;
    checkResult(vk.CreateComputePipelines(device, VK_NULL_HANDLE, 1, &info, nullptr, &pipeline), "creating a pipeline");
    return pipeline;
}

VkPipeline CommandSide::makeGraphics() const
{
    VkPipelineShaderStageCreateInfo stages[2] = {};
    for (auto &stage : stages) {
        stage = vkInit<VkPipelineShaderStageCreateInfo>();
        stage.stage = &stage == stages ? VK_SHADER_STAGE_VERTEX_BIT : VK_SHADER_STAGE_FRAGMENT_BIT;
        stage.module = &stage == stages ? vertex : fragment;
        stage.pName = "main";
    }
    const VkFormat format = VK_FORMAT_R8G8B8A8_UNORM;
    auto rendering =
        vkInit<VkPipelineRenderingCreateInfo>({.colorAttachmentCount = 1, .pColorAttachmentFormats = &format});
    const auto vertexInput = vkInit<VkPipelineVertexInputStateCreateInfo>();
    auto assembly = vkInit<VkPipelineInputAssemblyStateCreateInfo>({.topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_STRIP});
    const VkViewport viewport{0, 0, 16, 16, 0, 1};
    const VkRect2D scissor{{0, 0}, {16, 16}};
    const auto viewports = vkInit<VkPipelineViewportStateCreateInfo>(
        {.viewportCount = 1, .pViewports = &viewport, .scissorCount = 1, .pScissors = &scissor});
    auto raster = vkInit<VkPipelineRasterizationStateCreateInfo>({.lineWidth = 1});
    auto samples = vkInit<VkPipelineMultisampleStateCreateInfo>({.rasterizationSamples = VK_SAMPLE_COUNT_1_BIT});
    VkPipelineColorBlendAttachmentState attachment{};
    attachment.colorWriteMask = 0xf;
    auto blend = vkInit<VkPipelineColorBlendStateCreateInfo>({.attachmentCount = 1, .pAttachments = &attachment});
    auto info = vkInit<VkGraphicsPipelineCreateInfo>({.pNext = &rendering,
                                                      .stageCount = 2,
                                                      .pStages = stages,
                                                      .pVertexInputState = &vertexInput,
                                                      .pInputAssemblyState = &assembly,
                                                      .pViewportState = &viewports,
                                                      .pRasterizationState = &raster,
                                                      .pMultisampleState = &samples,
                                                      .pColorBlendState = &blend,
                                                      .layout = layout});
    VkPipeline pipeline = VK_NULL_HANDLE;
    checkResult(vk.CreateGraphicsPipelines(device, VK_NULL_HANDLE, 1, &info, nullptr, &pipeline),
                "creating a pipeline");
    return pipeline;
}

VkPipeline CommandSide::makeRayTracing(bool micromaps) const
{
    const std::pair<VkShaderStageFlagBits, VkShaderModule> modules[] = {
        {VK_SHADER_STAGE_RAYGEN_BIT_KHR, raygen},
        {VK_SHADER_STAGE_MISS_BIT_KHR, miss},
        {VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR, closestHit},
        {VK_SHADER_STAGE_ANY_HIT_BIT_KHR, anyHit}};
    std::vector<VkPipelineShaderStageCreateInfo> stages;
    for (const auto &[stage, module] : modules)
        stages.push_back(
            {VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO, nullptr, 0, stage, module, "main", nullptr});
    constexpr uint32_t kNone = VK_SHADER_UNUSED_KHR;
    const auto group = [](VkRayTracingShaderGroupTypeKHR type, uint32_t general, uint32_t closest, uint32_t any) {
        return VkRayTracingShaderGroupCreateInfoKHR{VK_STRUCTURE_TYPE_RAY_TRACING_SHADER_GROUP_CREATE_INFO_KHR,
                                                    nullptr,
                                                    type,
                                                    general,
                                                    closest,
                                                    any,
                                                    VK_SHADER_UNUSED_KHR,
                                                    nullptr};
    };
    const std::array groups = {group(VK_RAY_TRACING_SHADER_GROUP_TYPE_GENERAL_KHR, 0, kNone, kNone),
                               group(VK_RAY_TRACING_SHADER_GROUP_TYPE_GENERAL_KHR, 1, kNone, kNone),
                               group(VK_RAY_TRACING_SHADER_GROUP_TYPE_TRIANGLES_HIT_GROUP_KHR, kNone, 2, 3)};
    auto info = vkInit<VkRayTracingPipelineCreateInfoKHR>(
        {.flags = micromaps ? VkFlags{VK_PIPELINE_CREATE_RAY_TRACING_OPACITY_MICROMAP_BIT_EXT} : 0,
         .stageCount = static_cast<uint32_t>(stages.size()),
         .pStages = stages.data(),
         .groupCount = static_cast<uint32_t>(groups.size()),
         .pGroups = groups.data(),
         .maxPipelineRayRecursionDepth = 1,
         .layout = layout});
    VkPipeline pipeline = VK_NULL_HANDLE;
    checkResult(vk.CreateRayTracingPipelinesKHR(device, VK_NULL_HANDLE, VK_NULL_HANDLE, 1, &info, nullptr, &pipeline),
                "creating a pipeline");
    return pipeline;
}

} // namespace vellum::bench
