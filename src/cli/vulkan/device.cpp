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
    if (m_device == VK_NULL_HANDLE)
        return;
    vkDeviceWaitIdle(m_device);
    vkDestroyFence(m_device, m_fence, nullptr);
    vkDestroyCommandPool(m_device, m_pool, nullptr);
    m_bufferMemory.reset();
    vkDestroyDevice(m_device, nullptr);
}

void Device::readProperties()
{
    VkPhysicalDeviceAccelerationStructurePropertiesKHR structures{};
    structures.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_PROPERTIES_KHR;
    VkPhysicalDeviceProperties2 properties{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &structures, {}};
    vkGetPhysicalDeviceProperties2(m_info.handle, &properties);
    m_limits = properties.properties.limits;
    m_scratchAlignment = structures.minAccelerationStructureScratchOffsetAlignment;
    vkGetPhysicalDeviceMemoryProperties(m_info.handle, &m_memory);

    std::uint32_t count = 0;
    vkGetPhysicalDeviceQueueFamilyProperties(m_info.handle, &count, nullptr);
    std::vector<VkQueueFamilyProperties> families(count);
    vkGetPhysicalDeviceQueueFamilyProperties(m_info.handle, &count, families.data());
    const auto found = std::find_if(families.begin(), families.end(), [](const VkQueueFamilyProperties &f) {
        return (f.queueFlags & VK_QUEUE_COMPUTE_BIT) != 0;
    });
    if (found == families.end())
        throw Error(m_info.name + " has no queue for compute shaders");
    m_family = static_cast<std::uint32_t>(found - families.begin());
    // On a CPU driver the host's clock is the device's own, and it includes nothing more.
    m_timestamps = found->timestampValidBits != 0 && m_info.type != VK_PHYSICAL_DEVICE_TYPE_CPU;
}

void Device::create(const DeviceNeeds &needs)
{
    VkPhysicalDeviceVulkan12Features supported{};
    supported.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES;
    VkPhysicalDeviceFeatures2 query{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, &supported, {}};
    vkGetPhysicalDeviceFeatures2(m_info.handle, &query);
    if (supported.shaderSampledImageArrayNonUniformIndexing == VK_FALSE)
        throw Error(m_info.name + " cannot index textures freely (shaderSampledImageArrayNonUniformIndexing)");

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
    queue.queueFamilyIndex = m_family;
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
    info.enabledExtensionCount = static_cast<std::uint32_t>(extensions.size());
    info.ppEnabledExtensionNames = extensions.data();
    check(vkCreateDevice(m_info.handle, &info, nullptr, &m_device), "creating a Vulkan device");
    m_bufferMemory = std::make_unique<MemoryPool>(m_device);
    vkGetDeviceQueue(m_device, m_family, 0, &m_queue);
    const VkCommandPoolCreateInfo pool{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO, nullptr, 0, m_family};
    check(vkCreateCommandPool(m_device, &pool, nullptr, &m_pool), "creating a command pool");
    const VkFenceCreateInfo fence{VK_STRUCTURE_TYPE_FENCE_CREATE_INFO, nullptr, 0};
    check(vkCreateFence(m_device, &fence, nullptr, &m_fence), "creating a fence");
}

void Device::loadFunctions(const DeviceNeeds &needs)
{
    const auto load = [this](auto &function, const char *name) {
        function = reinterpret_cast<std::remove_reference_t<decltype(function)>>(vkGetDeviceProcAddr(m_device, name));
        if (function == nullptr)
            throw Error(m_info.name + " lacks the function " + name);
    };
    load(m_functions.createAccelerationStructure, "vkCreateAccelerationStructureKHR");
    load(m_functions.destroyAccelerationStructure, "vkDestroyAccelerationStructureKHR");
    load(m_functions.getAccelerationStructureBuildSizes, "vkGetAccelerationStructureBuildSizesKHR");
    load(m_functions.getAccelerationStructureDeviceAddress, "vkGetAccelerationStructureDeviceAddressKHR");
    load(m_functions.cmdBuildAccelerationStructures, "vkCmdBuildAccelerationStructuresKHR");
    if (needs.micromaps == MicromapApi::Khr)
        load(m_functions.createAccelerationStructure2, "vkCreateAccelerationStructure2KHR");
    if (needs.micromaps == MicromapApi::Ext) {
        load(m_functions.createMicromap, "vkCreateMicromapEXT");
        load(m_functions.destroyMicromap, "vkDestroyMicromapEXT");
        load(m_functions.getMicromapBuildSizes, "vkGetMicromapBuildSizesEXT");
        load(m_functions.cmdBuildMicromaps, "vkCmdBuildMicromapsEXT");
    }
    if (needs.rayTracingPipelines) {
        load(m_functions.createRayTracingPipelines, "vkCreateRayTracingPipelinesKHR");
        load(m_functions.getRayTracingShaderGroupHandles, "vkGetRayTracingShaderGroupHandlesKHR");
        load(m_functions.cmdTraceRays, "vkCmdTraceRaysKHR");
    }
}

std::optional<std::uint32_t> Device::memoryType(std::uint32_t allowed, VkMemoryPropertyFlags needed,
                                                VkMemoryPropertyFlags preferred) const
{
    for (const VkMemoryPropertyFlags flags : {needed | preferred, needed})
        for (std::uint32_t i = 0; i < m_memory.memoryTypeCount; ++i)
            if ((allowed & (1u << i)) != 0 && (m_memory.memoryTypes[i].propertyFlags & flags) == flags)
                return i;
    return std::nullopt;
}

VkCommandBuffer Device::allocateCommands()
{
    const VkCommandBufferAllocateInfo info{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO, nullptr, m_pool,
                                           VK_COMMAND_BUFFER_LEVEL_PRIMARY, 1};
    VkCommandBuffer commands = VK_NULL_HANDLE;
    check(vkAllocateCommandBuffers(m_device, &info, &commands), "allocating a command buffer");
    return commands;
}

void Device::submitAndWait(VkCommandBuffer commands)
{
    VkSubmitInfo submit{};
    submit.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO;
    submit.commandBufferCount = 1;
    submit.pCommandBuffers = &commands;
    check(vkResetFences(m_device, 1, &m_fence), "resetting a fence");
    check(vkQueueSubmit(m_queue, 1, &submit, m_fence), "submitting work");
    check(vkWaitForFences(m_device, 1, &m_fence, VK_TRUE, UINT64_MAX), "waiting for the device");
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
    vkFreeCommandBuffers(m_device, m_pool, 1, &commands);
}

} // namespace vellum::cli
