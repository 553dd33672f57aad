// SPDX-License-Identifier: Apache-2.0
#include "cli/info/device_details.h"

#include <utility>

#include "vk/vk_init.h"

namespace vellum::cli
{
namespace
{

const char *nameOf(VkPhysicalDeviceType type)
{
    switch (type) {
    case VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU: return "discrete GPU";
    case VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU: return "integrated GPU";
    case VK_PHYSICAL_DEVICE_TYPE_VIRTUAL_GPU: return "virtual GPU";
    case VK_PHYSICAL_DEVICE_TYPE_CPU: return "CPU";
    default: return "other device";
    }
}

std::string apiVersionText(uint32_t version)
{
    return std::to_string(VK_API_VERSION_MAJOR(version)) + "." + std::to_string(VK_API_VERSION_MINOR(version)) + "." +
           std::to_string(VK_API_VERSION_PATCH(version));
}

// What the layer requires of a device (docs/limitations.md).
void findMissing(DeviceDetails &details, VkPhysicalDevice device, uint32_t version)
{
    if (version < VK_API_VERSION_1_1) {
        details.missing.push_back("Vulkan 1.1 (it has " + apiVersionText(version) + ")");
        return;
    }
    auto structures = vkInit<VkPhysicalDeviceAccelerationStructureFeaturesKHR>();
    auto addresses = vkInit<VkPhysicalDeviceBufferDeviceAddressFeatures>();
    auto features = vkInit<VkPhysicalDeviceFeatures2>();
    // It depends on Vulkan 1.2 or VK_KHR_buffer_device_address.
    if (details.extensions.contains(VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME)) {
        addresses.pNext = &structures;
        features.pNext = &addresses;
    }
    vkGetPhysicalDeviceFeatures2(device, &features);
    details.accelerationStructures = structures.accelerationStructure == VK_TRUE;
    if (!details.accelerationStructures)
        details.missing.push_back("acceleration structures (VK_KHR_acceleration_structure)");
    else if (addresses.bufferDeviceAddress == VK_FALSE)
        details.missing.push_back("buffer device addresses (bufferDeviceAddress)");
    if (version < VK_API_VERSION_1_3 && !details.extensions.contains(VK_KHR_SYNCHRONIZATION_2_EXTENSION_NAME))
        details.missing.push_back("Vulkan 1.3 or VK_KHR_synchronization2");
}

void addHeaps(DeviceDetails &details, VkPhysicalDevice device)
{
    VkPhysicalDeviceMemoryProperties memory;
    vkGetPhysicalDeviceMemoryProperties(device, &memory);
    for (uint32_t i = 0; i < memory.memoryHeapCount; ++i) {
        const bool local = (memory.memoryHeaps[i].flags & VK_MEMORY_HEAP_DEVICE_LOCAL_BIT) != 0;
        details.limits.push_back(
            {"memory heap " + std::to_string(i) + (local ? ", device-local" : ""), memory.memoryHeaps[i].size});
    }
}

void readProperties(DeviceDetails &details, VkPhysicalDevice device)
{
    auto driver = vkInit<VkPhysicalDeviceDriverProperties>();
    auto subgroups = vkInit<VkPhysicalDeviceSubgroupProperties>();
    auto memory = vkInit<VkPhysicalDeviceMaintenance3Properties>();
    auto ext = vkInit<VkPhysicalDeviceOpacityMicromapPropertiesEXT>();
    auto khr = vkInit<VkPhysicalDeviceOpacityMicromapPropertiesKHR>();
    auto structures = vkInit<VkPhysicalDeviceAccelerationStructurePropertiesKHR>();
    auto pipelines = vkInit<VkPhysicalDeviceRayTracingPipelinePropertiesKHR>();
    auto properties = vkInit<VkPhysicalDeviceProperties2>();
    const auto chain = [&](auto &part) { part.pNext = std::exchange(properties.pNext, &part); };
    chain(driver);
    chain(subgroups);
    chain(memory);
    if (details.extensions.contains(VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME))
        chain(ext);
    if (details.extensions.contains(VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME))
        chain(khr);
    if (details.extensions.contains(VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME))
        chain(structures);
    if (details.rayTracingPipelines)
        chain(pipelines);
    vkGetPhysicalDeviceProperties2(device, &properties);
    details.driver = std::string(driver.driverName) + " " + driver.driverInfo;
    details.most2StateLevel = std::max(ext.maxOpacity2StateSubdivisionLevel, khr.maxOpacity2StateSubdivisionLevel);
    details.most4StateLevel = std::max(ext.maxOpacity4StateSubdivisionLevel, khr.maxOpacity4StateSubdivisionLevel);

    const VkPhysicalDeviceLimits &limits = properties.properties.limits;
    const auto add = [&](const char *name, uint64_t value) { details.limits.push_back({name, value}); };
    add("subgroupSize", subgroups.subgroupSize);
    add("maxComputeSharedMemorySize", limits.maxComputeSharedMemorySize);
    add("maxComputeWorkGroupInvocations", limits.maxComputeWorkGroupInvocations);
    add("maxStorageBufferRange", limits.maxStorageBufferRange);
    add("maxMemoryAllocationCount", limits.maxMemoryAllocationCount);
    add("maxMemoryAllocationSize", memory.maxMemoryAllocationSize);
    if (details.extensions.contains(VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME)) {
        add("maxGeometryCount", structures.maxGeometryCount);
        add("maxInstanceCount", structures.maxInstanceCount);
        add("maxPrimitiveCount", structures.maxPrimitiveCount);
        add("minAccelerationStructureScratchOffsetAlignment",
            structures.minAccelerationStructureScratchOffsetAlignment);
    }
    if (details.rayTracingPipelines) {
        add("shaderGroupHandleSize", pipelines.shaderGroupHandleSize);
        add("maxRayRecursionDepth", pipelines.maxRayRecursionDepth);
        add("maxRayDispatchInvocationCount", pipelines.maxRayDispatchInvocationCount);
        add("maxRayHitAttributeSize", pipelines.maxRayHitAttributeSize);
    }
    addHeaps(details, device);
}

// "driver", "emulated" or "translated" by the layer, "none".
const char *codeOf(Provider provider)
{
    switch (provider) {
    case Provider::Driver: return "driver";
    case Provider::Layer: return "emulated";
    case Provider::Translated: return "translated";
    case Provider::Nobody: break;
    }
    return "none";
}

} // namespace

std::vector<DeviceDetails> describeDevices(const gpu::Instance &instance)
{
    std::vector<DeviceDetails> all;
    for (const gpu::DeviceInfo &info : gpu::listDevices(instance)) {
        VkPhysicalDeviceProperties properties;
        vkGetPhysicalDeviceProperties(info.handle, &properties);
        DeviceDetails &details = all.emplace_back();
        details.extensions = info.extensions;
        const std::set<std::string> &extensions = details.extensions;
        details.number = info.number;
        details.name = info.name;
        details.kind = nameOf(info.type);
        details.version = apiVersionText(properties.apiVersion);
        details.rayQueries = extensions.contains(VK_KHR_RAY_QUERY_EXTENSION_NAME);
        details.rayTracingPipelines = extensions.contains(VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME);
        findMissing(details, info.handle, properties.apiVersion);
        if (properties.apiVersion >= VK_API_VERSION_1_2)
            readProperties(details, info.handle);
        // The layer reports what it does for the device.
        const Provider provider = info.implementation.starts_with("emulated") ? Provider::Layer : Provider::Driver;
        if (extensions.contains(VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME))
            details.ext = provider;
        if (extensions.contains(VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME))
            details.khr = info.implementation.find("translates") != std::string::npos ? Provider::Translated : provider;
    }
    return all;
}

void writeMembers(const DeviceDetails &details, JsonWriter &json)
{
    json.member("name", details.name).member("kind", details.kind).member("driver", details.driver);
    json.member("vulkan", details.version)
        .member("accelerationStructures", details.accelerationStructures)
        .member("rayQueries", details.rayQueries)
        .member("rayTracingPipelines", details.rayTracingPipelines);
    json.member("VK_KHR_opacity_micromap", codeOf(details.khr)).member("VK_EXT_opacity_micromap", codeOf(details.ext));
    json.member("max2StateSubdivisionLevel", details.most2StateLevel)
        .member("max4StateSubdivisionLevel", details.most4StateLevel);
    json.values("missing", details.missing).values("extensions", details.extensions);
    json.key("limits").beginObject();
    for (const DeviceLimit &limit : details.limits)
        json.member(limit.name, limit.value);
    json.end();
}

} // namespace vellum::cli
