// SPDX-License-Identifier: Apache-2.0
#include "context.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <utility>

#include "leaf.h"

namespace
{

constexpr const char *kLayer = "VK_LAYER_VELLUM_opacity_micromap";

bool hasLayer()
{
    uint32_t count = 0;
    vkEnumerateInstanceLayerProperties(&count, nullptr);
    std::vector<VkLayerProperties> layers(count);
    vkEnumerateInstanceLayerProperties(&count, layers.data());
    return std::any_of(layers.begin(), layers.end(),
                       [](const VkLayerProperties &layer) { return std::strcmp(layer.layerName, kLayer) == 0; });
}

bool hasExtensions(VkPhysicalDevice device, const std::vector<const char *> &names)
{
    uint32_t count = 0;
    vkEnumerateDeviceExtensionProperties(device, nullptr, &count, nullptr);
    std::vector<VkExtensionProperties> list(count);
    vkEnumerateDeviceExtensionProperties(device, nullptr, &count, list.data());
    return std::all_of(names.begin(), names.end(), [&](const char *name) {
        return std::any_of(list.begin(), list.end(), [&](const VkExtensionProperties &extension) {
            return std::strcmp(extension.extensionName, name) == 0;
        });
    });
}

uint32_t findComputeFamily(VkPhysicalDevice device)
{
    uint32_t count = 0;
    vkGetPhysicalDeviceQueueFamilyProperties(device, &count, nullptr);
    std::vector<VkQueueFamilyProperties> families(count);
    vkGetPhysicalDeviceQueueFamilyProperties(device, &count, families.data());
    const auto found = std::find_if(families.begin(), families.end(), [](const VkQueueFamilyProperties &family) {
        return (family.queueFlags & VK_QUEUE_COMPUTE_BIT) != 0;
    });
    return static_cast<uint32_t>(found - families.begin());
}

std::vector<uint32_t> readShader()
{
    std::ifstream file(RAYS_SPV, std::ios::binary);
    const std::vector<char> bytes{std::istreambuf_iterator<char>(file), {}};
    if (bytes.empty())
        throw std::runtime_error(RAYS_SPV " cannot be read");
    std::vector<uint32_t> words(bytes.size() / sizeof(uint32_t));
    std::memcpy(words.data(), bytes.data(), words.size() * sizeof(uint32_t));
    return words;
}

} // namespace

void check(VkResult result, const char *function)
{
    if (result != VK_SUCCESS)
        throw std::runtime_error(std::string(function) + ": VkResult " + std::to_string(result));
}

Context::Context(std::vector<const char *> extensions, void *features)
{
    extensions.insert(extensions.end(),
                      {VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME, VK_KHR_RAY_QUERY_EXTENSION_NAME,
                       VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME}); // the first one needs the last one
    createInstance();
    choosePhysicalDevice(extensions);
    createDevice(extensions, features);
}

Context::~Context()
{
    std::for_each(destroy_.rbegin(), destroy_.rend(), [](const auto &destroy) { destroy(); });
    vkDestroyCommandPool(device_, commandPool_, nullptr);
    vkDestroyDevice(device_, nullptr);
    vkDestroyInstance(instance_, nullptr);
}

void Context::createInstance()
{
    const VkApplicationInfo application{.sType = VK_STRUCTURE_TYPE_APPLICATION_INFO, .apiVersion = VK_API_VERSION_1_3};
    const VkInstanceCreateInfo info{.sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO,
                                    .pApplicationInfo = &application,
                                    .enabledLayerCount = hasLayer() ? 1u : 0u,
                                    .ppEnabledLayerNames = &kLayer};
    check(vkCreateInstance(&info, nullptr, &instance_), "vkCreateInstance");
}

void Context::choosePhysicalDevice(const std::vector<const char *> &extensions)
{
    uint32_t count = 0;
    vkEnumeratePhysicalDevices(instance_, &count, nullptr);
    std::vector<VkPhysicalDevice> devices(count);
    vkEnumeratePhysicalDevices(instance_, &count, devices.data());
    const auto found = std::find_if(devices.begin(), devices.end(),
                                    [&](VkPhysicalDevice device) { return hasExtensions(device, extensions); });
    if (found == devices.end())
        throw std::runtime_error(std::string("no Vulkan device has ") + extensions.front() + " and ray queries" +
                                 (hasLayer() ? "" : ", and the loader does not find the layer"));
    physicalDevice_ = *found;
}

void Context::createDevice(const std::vector<const char *> &extensions, void *features)
{
    VkPhysicalDeviceRayQueryFeaturesKHR rayQuery{
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_QUERY_FEATURES_KHR, .pNext = features, .rayQuery = VK_TRUE};
    VkPhysicalDeviceAccelerationStructureFeaturesKHR structures{
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR,
        .pNext = &rayQuery,
        .accelerationStructure = VK_TRUE};
    VkPhysicalDeviceVulkan12Features vulkan12{.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES,
                                              .pNext = &structures,
                                              .bufferDeviceAddress = VK_TRUE};
    VkPhysicalDeviceVulkan13Features vulkan13{.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_FEATURES,
                                              .pNext = &vulkan12,
                                              .synchronization2 = VK_TRUE};
    const float priority = 1;
    const VkDeviceQueueCreateInfo queue{.sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO,
                                        .queueFamilyIndex = findComputeFamily(physicalDevice_),
                                        .queueCount = 1,
                                        .pQueuePriorities = &priority};
    const VkDeviceCreateInfo info{.sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO,
                                  .pNext = &vulkan13,
                                  .queueCreateInfoCount = 1,
                                  .pQueueCreateInfos = &queue,
                                  .enabledExtensionCount = static_cast<uint32_t>(extensions.size()),
                                  .ppEnabledExtensionNames = extensions.data()};
    check(vkCreateDevice(physicalDevice_, &info, nullptr, &device_), "vkCreateDevice");
    vkGetDeviceQueue(device_, queue.queueFamilyIndex, 0, &queue_);
    const VkCommandPoolCreateInfo pool{.sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO,
                                       .queueFamilyIndex = queue.queueFamilyIndex};
    check(vkCreateCommandPool(device_, &pool, nullptr, &commandPool_), "vkCreateCommandPool");

    VkPhysicalDeviceAccelerationStructurePropertiesKHR limits{
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_PROPERTIES_KHR};
    VkPhysicalDeviceProperties2 properties{.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, .pNext = &limits};
    vkGetPhysicalDeviceProperties2(physicalDevice_, &properties);
    alignment_ = std::max<VkDeviceSize>(256, limits.minAccelerationStructureScratchOffsetAlignment);
}

std::string Context::deviceName() const
{
    VkPhysicalDeviceProperties properties;
    vkGetPhysicalDeviceProperties(physicalDevice_, &properties);
    return properties.deviceName;
}

Buffer Context::createBuffer(VkDeviceSize size, VkBufferUsageFlags usage, bool forHost)
{
    Buffer result;
    const VkBufferCreateInfo info{.sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO,
                                  .size = size + alignment_,
                                  .usage = usage | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT};
    check(vkCreateBuffer(device_, &info, nullptr, &result.buffer), "vkCreateBuffer");
    VkMemoryRequirements needs;
    vkGetBufferMemoryRequirements(device_, result.buffer, &needs);
    VkPhysicalDeviceMemoryProperties memory;
    vkGetPhysicalDeviceMemoryProperties(physicalDevice_, &memory);
    const VkMemoryPropertyFlags wanted =
        forHost ? VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT
                : VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT;
    uint32_t type = 0;
    while (type + 1 < memory.memoryTypeCount &&
           ((needs.memoryTypeBits & 1u << type) == 0 || (memory.memoryTypes[type].propertyFlags & wanted) != wanted))
        ++type;
    const VkMemoryAllocateFlagsInfo flags{.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO,
                                          .flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT};
    const VkMemoryAllocateInfo allocation{.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO,
                                          .pNext = &flags,
                                          .allocationSize = needs.size,
                                          .memoryTypeIndex = type};
    check(vkAllocateMemory(device_, &allocation, nullptr, &result.memory), "vkAllocateMemory");
    check(vkBindBufferMemory(device_, result.buffer, result.memory, 0), "vkBindBufferMemory");
    onDestroy([device = device_, result] {
        vkDestroyBuffer(device, result.buffer, nullptr);
        vkFreeMemory(device, result.memory, nullptr);
    });

    const VkBufferDeviceAddressInfo address{.sType = VK_STRUCTURE_TYPE_BUFFER_DEVICE_ADDRESS_INFO,
                                            .buffer = result.buffer};
    const VkDeviceAddress begin = vkGetBufferDeviceAddress(device_, &address);
    result.address = (begin + alignment_ - 1) / alignment_ * alignment_;
    if (forHost) {
        check(vkMapMemory(device_, result.memory, 0, VK_WHOLE_SIZE, 0, &result.data), "vkMapMemory");
        result.data = static_cast<std::byte *>(result.data) + (result.address - begin);
    }
    return result;
}

Buffer Context::uploadBytes(std::span<const std::byte> bytes, VkBufferUsageFlags usage)
{
    const Buffer result = createBuffer(bytes.size(), usage, true);
    std::memcpy(result.data, bytes.data(), bytes.size());
    return result;
}

void Context::submit(const std::function<void(VkCommandBuffer)> &record)
{
    const VkCommandBufferAllocateInfo allocation{.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO,
                                                 .commandPool = commandPool_,
                                                 .level = VK_COMMAND_BUFFER_LEVEL_PRIMARY,
                                                 .commandBufferCount = 1};
    VkCommandBuffer commands = VK_NULL_HANDLE;
    check(vkAllocateCommandBuffers(device_, &allocation, &commands), "vkAllocateCommandBuffers");
    const VkCommandBufferBeginInfo begin{.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO,
                                         .flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT};
    check(vkBeginCommandBuffer(commands, &begin), "vkBeginCommandBuffer");
    record(commands);
    check(vkEndCommandBuffer(commands), "vkEndCommandBuffer");
    const VkSubmitInfo info{
        .sType = VK_STRUCTURE_TYPE_SUBMIT_INFO, .commandBufferCount = 1, .pCommandBuffers = &commands};
    check(vkQueueSubmit(queue_, 1, &info, VK_NULL_HANDLE), "vkQueueSubmit");
    check(vkQueueWaitIdle(queue_), "vkQueueWaitIdle");
    vkFreeCommandBuffers(device_, commandPool_, 1, &commands);
}

VkDeviceAddress Context::buildStructure(VkAccelerationStructureTypeKHR type,
                                        const VkAccelerationStructureGeometryKHR &geometry, uint32_t primitives)
{
    VkAccelerationStructureBuildGeometryInfoKHR build{
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_GEOMETRY_INFO_KHR,
        .type = type,
        .flags = VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR,
        .mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR,
        .geometryCount = 1,
        .pGeometries = &geometry};
    VkAccelerationStructureBuildSizesInfoKHR sizes{.sType =
                                                       VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR};
    load<PFN_vkGetAccelerationStructureBuildSizesKHR>("vkGetAccelerationStructureBuildSizesKHR")(
        device_, VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &build, &primitives, &sizes);
    const Buffer storage =
        createBuffer(sizes.accelerationStructureSize, VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR);
    const Buffer scratch = createBuffer(sizes.buildScratchSize, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    const VkAccelerationStructureCreateInfoKHR info{.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_KHR,
                                                    .buffer = storage.buffer,
                                                    .size = sizes.accelerationStructureSize,
                                                    .type = type};
    check(load<PFN_vkCreateAccelerationStructureKHR>("vkCreateAccelerationStructureKHR")(
              device_, &info, nullptr, &build.dstAccelerationStructure),
          "vkCreateAccelerationStructureKHR");
    onDestroy([device = device_, handle = build.dstAccelerationStructure,
               destroy = load<PFN_vkDestroyAccelerationStructureKHR>("vkDestroyAccelerationStructureKHR")] {
        destroy(device, handle, nullptr);
    });
    build.scratchData.deviceAddress = scratch.address;
    const VkAccelerationStructureBuildRangeInfoKHR range{.primitiveCount = primitives};
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = &range;
    submit([&](VkCommandBuffer commands) {
        load<PFN_vkCmdBuildAccelerationStructuresKHR>("vkCmdBuildAccelerationStructuresKHR")(commands, 1, &build,
                                                                                             &ranges);
        // Makes the build visible to the top level that refers to it, and to the rays.
        const VkMemoryBarrier2 barrier{.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER_2,
                                       .srcStageMask = VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
                                       .srcAccessMask = VK_ACCESS_2_ACCELERATION_STRUCTURE_WRITE_BIT_KHR,
                                       .dstStageMask = VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR |
                                                       VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT,
                                       .dstAccessMask = VK_ACCESS_2_ACCELERATION_STRUCTURE_READ_BIT_KHR};
        const VkDependencyInfo dependency{
            .sType = VK_STRUCTURE_TYPE_DEPENDENCY_INFO, .memoryBarrierCount = 1, .pMemoryBarriers = &barrier};
        vkCmdPipelineBarrier2(commands, &dependency);
    });
    const VkAccelerationStructureDeviceAddressInfoKHR address{
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_DEVICE_ADDRESS_INFO_KHR,
        .accelerationStructure = build.dstAccelerationStructure};
    return load<PFN_vkGetAccelerationStructureDeviceAddressKHR>("vkGetAccelerationStructureDeviceAddressKHR")(device_,
                                                                                                              &address);
}

VkDeviceAddress Context::buildCard(const void *opacityMicromap)
{
    constexpr VkBufferUsageFlags kInput = VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR;
    const Buffer positions = upload(std::span<const float>(kCardPositions), kInput);
    const Buffer indices = upload(std::span<const uint16_t>(kCardIndices), kInput);
    VkAccelerationStructureGeometryKHR geometry{.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR,
                                                .geometryType = VK_GEOMETRY_TYPE_TRIANGLES_KHR};
    geometry.geometry.triangles = {.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_TRIANGLES_DATA_KHR,
                                   .pNext = opacityMicromap, // chained to the triangles, not to the geometry
                                   .vertexFormat = VK_FORMAT_R32G32B32_SFLOAT,
                                   .vertexData = {.deviceAddress = positions.address},
                                   .vertexStride = 3 * sizeof(float),
                                   .maxVertex = 3,
                                   .indexType = VK_INDEX_TYPE_UINT16,
                                   .indexData = {.deviceAddress = indices.address}};
    return buildStructure(VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR, geometry, kCardTriangles);
}

Counts Context::trace(VkDeviceAddress bottomLevel, uint32_t width, uint32_t height, std::span<const float> alpha)
{
    const VkAccelerationStructureInstanceKHR instance{.transform = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}},
                                                      .mask = 0xff,
                                                      .accelerationStructureReference = bottomLevel};
    const Buffer instances =
        upload(std::span(&instance, 1), VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR);
    VkAccelerationStructureGeometryKHR geometry{.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR,
                                                .geometryType = VK_GEOMETRY_TYPE_INSTANCES_KHR};
    geometry.geometry.instances = {.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_INSTANCES_DATA_KHR,
                                   .data = {.deviceAddress = instances.address}};

    const Counts zeros;
    const Buffer counts = upload(std::span(&zeros, 1), VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    struct Push {
        VkDeviceAddress scene;
        VkDeviceAddress alpha;
        VkDeviceAddress counts;
        uint32_t alphaSize;
        float cutoff;
    };
    const Push push{.scene = buildStructure(VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR, geometry, 1),
                    .alpha = upload(alpha, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT).address,
                    .counts = counts.address,
                    .alphaSize = kLeafSize,
                    .cutoff = static_cast<float>(kLeafCutoff)};

    const VkPushConstantRange range{.stageFlags = VK_SHADER_STAGE_COMPUTE_BIT, .size = sizeof(Push)};
    const VkPipelineLayoutCreateInfo layoutInfo{.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO,
                                                .pushConstantRangeCount = 1,
                                                .pPushConstantRanges = &range};
    VkPipelineLayout layout = VK_NULL_HANDLE;
    check(vkCreatePipelineLayout(device_, &layoutInfo, nullptr, &layout), "vkCreatePipelineLayout");
    const std::vector<uint32_t> code = readShader();
    const VkShaderModuleCreateInfo moduleInfo{.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO,
                                              .codeSize = code.size() * sizeof(uint32_t),
                                              .pCode = code.data()};
    VkShaderModule module = VK_NULL_HANDLE;
    check(vkCreateShaderModule(device_, &moduleInfo, nullptr, &module), "vkCreateShaderModule");
    const VkComputePipelineCreateInfo info{.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO,
                                           .stage = {.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO,
                                                     .stage = VK_SHADER_STAGE_COMPUTE_BIT,
                                                     .module = module,
                                                     .pName = "main"},
                                           .layout = layout};
    VkPipeline pipeline = VK_NULL_HANDLE;
    check(vkCreateComputePipelines(device_, VK_NULL_HANDLE, 1, &info, nullptr, &pipeline), "vkCreateComputePipelines");
    submit([&](VkCommandBuffer commands) {
        vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
        vkCmdPushConstants(commands, layout, VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof push, &push);
        vkCmdDispatch(commands, width, height, 1);
        const VkMemoryBarrier2 barrier{.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER_2,
                                       .srcStageMask = VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT,
                                       .srcAccessMask = VK_ACCESS_2_SHADER_WRITE_BIT,
                                       .dstStageMask = VK_PIPELINE_STAGE_2_HOST_BIT,
                                       .dstAccessMask = VK_ACCESS_2_HOST_READ_BIT};
        const VkDependencyInfo dependency{
            .sType = VK_STRUCTURE_TYPE_DEPENDENCY_INFO, .memoryBarrierCount = 1, .pMemoryBarriers = &barrier};
        vkCmdPipelineBarrier2(commands, &dependency);
    });
    vkDestroyPipeline(device_, pipeline, nullptr);
    vkDestroyShaderModule(device_, module, nullptr);
    vkDestroyPipelineLayout(device_, layout, nullptr);
    Counts result;
    std::memcpy(&result, counts.data, sizeof result);
    return result;
}
