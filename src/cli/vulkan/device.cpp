// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <utility>

#include "cli/vulkan/context.h"

namespace vellum::cli
{

// Delegates, so that the destructor also runs where this throws.
Device::Device(const DeviceInfo &info, const DeviceNeeds &needs) : Device(info, needs.micromaps)
{
    if (needs.micromaps && !info.has(*needs.micromaps))
        throw Error(info.name + " has no " + nameOf(*needs.micromaps));
    if (needs.rayTracingPipelines && !info.rayTracingPipelines)
        throw Error(info.name + " has no ray tracing pipelines (VK_KHR_ray_tracing_pipeline)");
    readProperties();
    create(needs);
    loadFunctions(needs);
}

Device::~Device()
{
    if (device_ == VK_NULL_HANDLE)
        return;
    vkDeviceWaitIdle(device_);
    vkDestroyFence(device_, fence_, nullptr);
    vkDestroyCommandPool(device_, pool_, nullptr);
    bufferMemory_.reset();
    vkDestroyDevice(device_, nullptr);
}

void Device::readProperties()
{
    VkPhysicalDeviceAccelerationStructurePropertiesKHR structures{};
    structures.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_PROPERTIES_KHR;
    VkPhysicalDeviceProperties2 properties{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &structures, {}};
    vkGetPhysicalDeviceProperties2(info_.handle, &properties);
    limits_ = properties.properties.limits;
    scratchAlignment_ = structures.minAccelerationStructureScratchOffsetAlignment;
    vkGetPhysicalDeviceMemoryProperties(info_.handle, &memory_);

    uint32_t count = 0;
    vkGetPhysicalDeviceQueueFamilyProperties(info_.handle, &count, nullptr);
    std::vector<VkQueueFamilyProperties> families(count);
    vkGetPhysicalDeviceQueueFamilyProperties(info_.handle, &count, families.data());
    const auto found = std::find_if(families.begin(), families.end(), [](const VkQueueFamilyProperties &f) {
        return (f.queueFlags & VK_QUEUE_COMPUTE_BIT) != 0;
    });
    if (found == families.end())
        throw Error(info_.name + " has no queue for compute shaders");
    family_ = static_cast<uint32_t>(found - families.begin());
    // On a CPU driver the host's clock is the device's own, and it includes nothing more.
    timestamps_ = found->timestampValidBits != 0 && info_.type != VK_PHYSICAL_DEVICE_TYPE_CPU;
}

void Device::create(const DeviceNeeds &needs)
{
    VkPhysicalDeviceVulkan12Features supported{};
    supported.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES;
    VkPhysicalDeviceFeatures2 query{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, &supported, {}};
    vkGetPhysicalDeviceFeatures2(info_.handle, &query);
    if (supported.shaderSampledImageArrayNonUniformIndexing == VK_FALSE)
        throw Error(info_.name + " cannot index textures freely (shaderSampledImageArrayNonUniformIndexing)");

    VkPhysicalDeviceDeviceAddressCommandsFeaturesKHR addressCommands{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DEVICE_ADDRESS_COMMANDS_FEATURES_KHR, nullptr, VK_TRUE};
    VkPhysicalDeviceOpacityMicromapFeaturesKHR khrMicromap{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_KHR, nullptr, VK_TRUE};
    VkPhysicalDeviceOpacityMicromapFeaturesEXT extMicromap{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_EXT, nullptr, VK_TRUE, VK_FALSE, VK_FALSE};
    VkPhysicalDeviceRayTracingPipelineFeaturesKHR pipelines{};
    pipelines.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_TRACING_PIPELINE_FEATURES_KHR;
    pipelines.rayTracingPipeline = VK_TRUE;
    VkPhysicalDeviceRayQueryFeaturesKHR rayQuery{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_QUERY_FEATURES_KHR, nullptr,
                                                 VK_TRUE};
    VkPhysicalDeviceAccelerationStructureFeaturesKHR structures{};
    structures.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR;
    structures.pNext = &rayQuery;
    structures.accelerationStructure = VK_TRUE;
    VkPhysicalDeviceVulkan13Features features13{};
    features13.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_FEATURES;
    features13.pNext = &structures;
    features13.synchronization2 = VK_TRUE;
    VkPhysicalDeviceVulkan12Features features12{};
    features12.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES;
    features12.pNext = &features13;
    features12.bufferDeviceAddress = VK_TRUE;
    features12.descriptorIndexing = supported.descriptorIndexing;
    features12.shaderSampledImageArrayNonUniformIndexing = VK_TRUE;
    const VkPhysicalDeviceFeatures2 features{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, &features12, {}};

    const float priority = 1;
    VkDeviceQueueCreateInfo queue{};
    queue.sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO;
    queue.queueFamilyIndex = family_;
    queue.queueCount = 1;
    queue.pQueuePriorities = &priority;
    std::vector<const char *> extensions = {VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME,
                                            VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME,
                                            VK_KHR_RAY_QUERY_EXTENSION_NAME};
    const auto add = [&](auto &feature, const char *extension) {
        feature.pNext = std::exchange(rayQuery.pNext, &feature);
        extensions.push_back(extension);
    };
    if (needs.micromaps == MicromapApi::Khr) {
        add(addressCommands, VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME);
        add(khrMicromap, VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME);
    } else if (needs.micromaps == MicromapApi::Ext) {
        add(extMicromap, VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME);
    }
    if (needs.rayTracingPipelines)
        add(pipelines, VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME);
    VkDeviceCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO;
    info.pNext = &features;
    info.queueCreateInfoCount = 1;
    info.pQueueCreateInfos = &queue;
    info.enabledExtensionCount = static_cast<uint32_t>(extensions.size());
    info.ppEnabledExtensionNames = extensions.data();
    check(vkCreateDevice(info_.handle, &info, nullptr, &device_), "creating a Vulkan device");
    bufferMemory_ = std::make_unique<MemoryPool>(device_);
    vkGetDeviceQueue(device_, family_, 0, &queue_);
    const VkCommandPoolCreateInfo pool{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO, nullptr, 0, family_};
    check(vkCreateCommandPool(device_, &pool, nullptr, &pool_), "creating a command pool");
    const VkFenceCreateInfo fence{VK_STRUCTURE_TYPE_FENCE_CREATE_INFO, nullptr, 0};
    check(vkCreateFence(device_, &fence, nullptr, &fence_), "creating a fence");
}

void Device::loadFunctions(const DeviceNeeds &needs)
{
    const auto load = [this](auto &function, const char *name) {
        function = reinterpret_cast<std::remove_reference_t<decltype(function)>>(vkGetDeviceProcAddr(device_, name));
        if (function == nullptr)
            throw Error(info_.name + " lacks the function " + name);
    };
    load(functions_.createAccelerationStructure, "vkCreateAccelerationStructureKHR");
    load(functions_.destroyAccelerationStructure, "vkDestroyAccelerationStructureKHR");
    load(functions_.getAccelerationStructureBuildSizes, "vkGetAccelerationStructureBuildSizesKHR");
    load(functions_.getAccelerationStructureDeviceAddress, "vkGetAccelerationStructureDeviceAddressKHR");
    load(functions_.cmdBuildAccelerationStructures, "vkCmdBuildAccelerationStructuresKHR");
    if (needs.micromaps == MicromapApi::Khr)
        load(functions_.createAccelerationStructure2, "vkCreateAccelerationStructure2KHR");
    if (needs.micromaps == MicromapApi::Ext) {
        load(functions_.createMicromap, "vkCreateMicromapEXT");
        load(functions_.destroyMicromap, "vkDestroyMicromapEXT");
        load(functions_.getMicromapBuildSizes, "vkGetMicromapBuildSizesEXT");
        load(functions_.cmdBuildMicromaps, "vkCmdBuildMicromapsEXT");
    }
    if (needs.rayTracingPipelines) {
        load(functions_.createRayTracingPipelines, "vkCreateRayTracingPipelinesKHR");
        load(functions_.getRayTracingShaderGroupHandles, "vkGetRayTracingShaderGroupHandlesKHR");
        load(functions_.cmdTraceRays, "vkCmdTraceRaysKHR");
    }
}

std::optional<uint32_t> Device::memoryType(uint32_t allowed, VkMemoryPropertyFlags needed,
                                           VkMemoryPropertyFlags preferred) const
{
    for (const VkMemoryPropertyFlags flags : {needed | preferred, needed})
        for (uint32_t i = 0; i < memory_.memoryTypeCount; ++i)
            if ((allowed & (1u << i)) != 0 && (memory_.memoryTypes[i].propertyFlags & flags) == flags)
                return i;
    return std::nullopt;
}

VkCommandBuffer Device::allocateCommands()
{
    const VkCommandBufferAllocateInfo info{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO, nullptr, pool_,
                                           VK_COMMAND_BUFFER_LEVEL_PRIMARY, 1};
    VkCommandBuffer commands = VK_NULL_HANDLE;
    check(vkAllocateCommandBuffers(device_, &info, &commands), "allocating a command buffer");
    return commands;
}

void Device::submitAndWait(VkCommandBuffer commands)
{
    VkSubmitInfo submit{};
    submit.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO;
    submit.commandBufferCount = 1;
    submit.pCommandBuffers = &commands;
    check(vkResetFences(device_, 1, &fence_), "resetting a fence");
    check(vkQueueSubmit(queue_, 1, &submit, fence_), "submitting work");
    check(vkWaitForFences(device_, 1, &fence_, VK_TRUE, UINT64_MAX), "waiting for the device");
}

void Device::run(const std::function<void(VkCommandBuffer)> &record)
{
    const VkCommandBuffer commands = allocateCommands();
    const VkCommandBufferBeginInfo begin{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO, nullptr,
                                         VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT, nullptr};
    check(vkBeginCommandBuffer(commands, &begin), "recording commands");
    record(commands);
    check(vkEndCommandBuffer(commands), "recording commands");
    submitAndWait(commands);
    vkFreeCommandBuffers(device_, pool_, 1, &commands);
}

} // namespace vellum::cli
