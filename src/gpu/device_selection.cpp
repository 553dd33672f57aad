// SPDX-License-Identifier: Apache-2.0
#include "gpu/device_selection.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <stdexcept>

#include "vellum/vulkan_opacity_micromap.h"
#include "vk/vk_init.h"

namespace vellum::gpu
{
namespace
{

std::set<std::string> extensionsOf(VkPhysicalDevice device)
{
    uint32_t count = 0;
    CHECK_VK(vkEnumerateDeviceExtensionProperties(device, nullptr, &count, nullptr));
    std::vector<VkExtensionProperties> extensions(count);
    CHECK_VK(vkEnumerateDeviceExtensionProperties(device, nullptr, &count, extensions.data()));
    std::set<std::string> names;
    for (const VkExtensionProperties &e : extensions)
        names.insert(e.extensionName);
    return names;
}

// The layers and other tools that are active for a device; none below Vulkan 1.3.
std::vector<VkPhysicalDeviceToolProperties> toolsOf(VkPhysicalDevice device, uint32_t version)
{
    uint32_t count = 0;
    if (version < VK_API_VERSION_1_3 || vkGetPhysicalDeviceToolProperties(device, &count, nullptr) != VK_SUCCESS)
        return {};
    std::vector<VkPhysicalDeviceToolProperties> tools(count, vkInit<VkPhysicalDeviceToolProperties>());
    vkGetPhysicalDeviceToolProperties(device, &count, tools.data());
    return tools;
}

// Who implements the extensions: the layer reports itself as a tool, with its description for the device.
std::string describeImplementation(VkPhysicalDevice device, uint32_t version)
{
    for (const VkPhysicalDeviceToolProperties &tool : toolsOf(device, version)) {
        if (std::strcmp(tool.layer, kLayerName) != 0)
            continue;
        if (std::strcmp(tool.description, "emulated") == 0)
            return std::string("emulated by the layer ") + kLayerName;
        if (std::strcmp(tool.description, "translated") == 0)
            return std::string("the driver's VK_EXT_opacity_micromap, to which the layer ") + kLayerName +
                   " translates VK_KHR_opacity_micromap";
        return std::string("the driver's (the layer ") + kLayerName + " passes it through)";
    }
    return "the driver's";
}

DeviceInfo describe(VkPhysicalDevice device)
{
    VkPhysicalDeviceProperties properties;
    vkGetPhysicalDeviceProperties(device, &properties);
    DeviceInfo info;
    info.handle = device;
    info.name = properties.deviceName;
    info.type = properties.deviceType;
    info.extensions = extensionsOf(device);
    const std::set<std::string> &extensions = info.extensions;
    if (properties.apiVersion < VK_API_VERSION_1_3 ||
        !extensions.contains(VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME))
        return info;
    auto addressCommands = vkInit<VkPhysicalDeviceDeviceAddressCommandsFeaturesKHR>();
    auto khrMicromap = vkInit<VkPhysicalDeviceOpacityMicromapFeaturesKHR>();
    auto extMicromap = vkInit<VkPhysicalDeviceOpacityMicromapFeaturesEXT>();
    auto pipelines = vkInit<VkPhysicalDeviceRayTracingPipelineFeaturesKHR>();
    auto rayQuery = vkInit<VkPhysicalDeviceRayQueryFeaturesKHR>();
    auto features = vkInit<VkPhysicalDeviceFeatures2>();
    const auto add = [&](auto &feature, const char *extension) {
        if (extensions.contains(extension))
            feature.pNext = std::exchange(features.pNext, &feature);
    };
    add(rayQuery, VK_KHR_RAY_QUERY_EXTENSION_NAME);
    add(addressCommands, VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME);
    add(khrMicromap, VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME);
    add(extMicromap, VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME);
    add(pipelines, VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME);
    vkGetPhysicalDeviceFeatures2(device, &features);
    info.rayQueries = rayQuery.rayQuery == VK_TRUE;
    info.rayTracingPipelines = pipelines.rayTracingPipeline == VK_TRUE;
    info.khrMicromaps = khrMicromap.micromap == VK_TRUE && addressCommands.deviceAddressCommands == VK_TRUE;
    info.extMicromaps = extMicromap.micromap == VK_TRUE;
    info.implementation =
        info.khrMicromaps || info.extMicromaps ? describeImplementation(device, properties.apiVersion) : "none";
    return info;
}

bool contains(std::string text, std::string part)
{
    const auto lower = [](std::string &s) {
        std::transform(s.begin(), s.end(), s.begin(),
                       [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    };
    lower(text);
    lower(part);
    return text.find(part) != std::string::npos;
}

// "0 (llvmpipe), 1 (Radeon)"
std::string listOf(std::span<const DeviceInfo> devices)
{
    std::string list;
    for (const DeviceInfo &device : devices)
        list += (list.empty() ? "" : ", ") + std::to_string(device.number) + " (" + device.name + ")";
    return list;
}

int rank(VkPhysicalDeviceType type)
{
    switch (type) {
    case VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU: return 4;
    case VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU: return 3;
    case VK_PHYSICAL_DEVICE_TYPE_VIRTUAL_GPU: return 2;
    case VK_PHYSICAL_DEVICE_TYPE_CPU: return 1;
    default: return 0;
    }
}

} // namespace

void requireMicromaps(const DeviceInfo &device, Api api, bool layer)
{
    if (device.has(api))
        return;
    std::string text = device.name + " has no " + extensionOf(api);
    const Api other = api == Api::Khr ? Api::Ext : Api::Khr;
    if (device.has(other))
        text += std::string(", but ") + extensionOf(other) + ": --api " + (other == Api::Khr ? "khr" : "ext");
    else if (!layer)
        text += ", and the layer that brings it is not turned on";
    throw std::runtime_error(text);
}

bool isLavapipe26(VkPhysicalDevice device)
{
    auto driver = vkInit<VkPhysicalDeviceDriverProperties>();
    auto properties = vkInit<VkPhysicalDeviceProperties2>({.pNext = &driver});
    vkGetPhysicalDeviceProperties2(device, &properties);
    return driver.driverID == VK_DRIVER_ID_MESA_LLVMPIPE &&
           properties.properties.driverVersion >= VK_MAKE_API_VERSION(0, 26, 0, 0);
}

std::vector<DeviceInfo> listDevices(const Instance &instance)
{
    uint32_t count = 0;
    // Without a driver, some loaders fail here and not at the creation of the instance.
    if (vkEnumeratePhysicalDevices(instance.handle(), &count, nullptr) != VK_SUCCESS)
        count = 0;
    std::vector<VkPhysicalDevice> handles(count);
    if (count != 0)
        CHECK_VK(vkEnumeratePhysicalDevices(instance.handle(), &count, handles.data()));
    std::vector<DeviceInfo> devices;
    for (const VkPhysicalDevice handle : handles) {
        DeviceInfo &device = devices.emplace_back(describe(handle));
        device.instance = &instance;
        device.number = static_cast<uint32_t>(devices.size() - 1);
    }
    return devices;
}

std::optional<uint32_t> DeviceSelection::number() const
{
    uint32_t number = 0;
    if (!text_ || std::from_chars(text_->data(), text_->data() + text_->size(), number).ec != std::errc() ||
        std::to_string(number) != *text_)
        return std::nullopt;
    return number;
}

DeviceInfo DeviceSelection::from(std::span<const DeviceInfo> devices) const
{
    if (devices.empty())
        throw std::runtime_error("there is no Vulkan device");
    const DeviceInfo *named = nullptr;
    const DeviceInfo *best = nullptr;
    // Digits are a number even where they are a part of a name.
    const bool byNumber = text_ && text_->find_first_not_of("0123456789") == std::string::npos;
    for (const DeviceInfo &d : devices) {
        if (text_ && !(byNumber ? number() == d.number : contains(d.name, *text_)))
            continue;
        named = named != nullptr ? named : &d;
        if (d.tracesRays() && (best == nullptr || rank(d.type) > rank(best->type)))
            best = &d;
    }
    if (best != nullptr)
        return *best;
    if (!text_)
        throw std::runtime_error("no Vulkan device has Vulkan 1.3 and ray queries or ray tracing pipelines; there is " +
                                 listOf(devices));
    if (named == nullptr)
        throw std::runtime_error("--device " + *text_ +
                                 " is neither the number of a Vulkan device nor a part of the name of one; " +
                                 "there is " + listOf(devices));
    throw std::runtime_error("the Vulkan device " + named->name + " has neither ray queries nor ray tracing pipelines");
}

namespace
{

constexpr uint32_t kMesa26 = VK_MAKE_API_VERSION(0, 26, 0, 0);
constexpr uint32_t kNotFixed = UINT32_MAX; // in any version that is known

struct OfDriver {
    KnownFault known;
    VkDriverId driver;
    uint32_t first, end; // versions that have it: from `first`, and before `end`
};

constexpr std::array<OfDriver, 9> kOfDrivers{{
    {{Fault::ReportChangesAttributes,
      "a hit that an intersection shader reports and that is not accepted changes the attributes of the committed hit",
      "attributes of such committed hits are not checked"},
     VK_DRIVER_ID_MESA_LLVMPIPE,
     0,
     kNotFixed},
    {{Fault::SharedIntersectionStage,
      "where two hit groups share an intersection shader, the any-hit shader of one of them runs for both",
      "hit groups do not share intersection shaders"},
     VK_DRIVER_ID_MESA_LLVMPIPE,
     0,
     kNotFixed},
    {{Fault::RayGenerationInLibrary, "a ray generation shader of a pipeline library does not run",
      "ray generation shaders are not in libraries"},
     VK_DRIVER_ID_MESA_LLVMPIPE,
     0,
     kNotFixed},
    {{Fault::InstanceBehindInvisible,
      "an instance behind one that is inactive or has mask 0 crashes shaders that trace",
      "such instances are active and have another mask, except at the end"},
     VK_DRIVER_ID_MESA_LLVMPIPE,
     kMesa26,
     kNotFixed},
    {{Fault::AddressWithConstantFlags,
      "ray queries in ray tracing stages with constant ray flags, of an acceleration structure by its address, meet "
      "nothing, meet wrong things or crash",
      "ray queries in these stages get structures from descriptors where their flags are constant"},
     VK_DRIVER_ID_MESA_LLVMPIPE,
     kMesa26,
     kNotFixed},
    // Mesa 25.0 builds on the CPU. Later ones build as RADV does (vk_acceleration_structure.c), which is right in
    // these two.
    {{Fault::FirstVertexIgnored, "builds ignore firstVertex", "it is 0"}, VK_DRIVER_ID_MESA_LLVMPIPE, 0, kMesa26},
    {{Fault::FourthComponentTransformed,
      "transformData moves vertices by as much as their fourth component, which is to be ignored",
      "geometries whose vertex format has four components have no transformData"},
     VK_DRIVER_ID_MESA_LLVMPIPE,
     0,
     kMesa26},
    // Mesa 26.1.6 leaves their nodes as the memory was.
    {{Fault::InactiveHideOthers,
      "inactive triangles and AABBs hide others of their structure, are met, or crash shaders that trace",
      "degenerate ones are in their place"},
     VK_DRIVER_ID_MESA_LLVMPIPE,
     0,
     kNotFixed},
    {{Fault::ConditionalBuilds, "a build within conditional rendering whose predicate is false crashes",
      "builds, copies and queries are not within it"},
     VK_DRIVER_ID_MESA_LLVMPIPE,
     kMesa26,
     kNotFixed},
}};

struct OfLayer {
    KnownFault known;
    std::string_view description; // the fault as the layer reports it
};

constexpr std::array<OfLayer, 3> kOfLayer{{
    {{Fault::LayerIntersectionShaders,
      "Vellum's layer emulates: intersection shaders may lack ray flags, and run for boxes that a ray flag culls",
      "neither is checked"},
     "emulated"},
    {{Fault::LayerSerializedStructures,
      "Vellum's layer translates to VK_EXT_opacity_micromap, and rejects serializing a BLAS with micromaps",
      "with VK_KHR_opacity_micromap, such structures are not serialized"},
     "translated"},
    {{Fault::LayerMixedLibraries,
      "Vellum's layer emulates: it creates no pipelines of libraries with and without the micromap bit",
      "all libraries of a pipeline have it, or none"},
     "emulated"},
}};

} // namespace

std::vector<KnownFault> knownFaults(VkPhysicalDevice device, bool includesTools)
{
    auto driver = vkInit<VkPhysicalDeviceDriverProperties>();
    auto properties = vkInit<VkPhysicalDeviceProperties2>({.pNext = &driver});
    vkGetPhysicalDeviceProperties2(device, &properties);
    const uint32_t version = properties.properties.driverVersion;
    std::vector<KnownFault> faults;
    for (const OfDriver &row : kOfDrivers)
        if (row.driver == driver.driverID && version >= row.first && version < row.end)
            faults.push_back(row.known);
    if (!includesTools)
        return faults;
    for (const VkPhysicalDeviceToolProperties &tool : toolsOf(device, properties.properties.apiVersion))
        for (const OfLayer &row : kOfLayer)
            if (std::string_view(tool.layer).starts_with("VK_LAYER_VELLUM_") && tool.description == row.description)
                faults.push_back(row.known);
    return faults;
}

} // namespace vellum::gpu
