// SPDX-License-Identifier: Apache-2.0
// Vulkan instances and devices.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>
#include <vulkan/vulkan.h>

#include "cli/base/error.h"
#include "cli/vulkan/memory.h"
#include "vellum/vulkan_opacity_micromap.h"

namespace vellum::cli
{

// Throws Error, saying what failed and how, for everything but VK_SUCCESS.
void check(VkResult result, const char *what);

class Instance
{
public:
    // Enables the layer where `wantLayer` and the loader finds it.
    explicit Instance(bool wantLayer);
    ~Instance();
    Instance(const Instance &) = delete;
    Instance &operator=(const Instance &) = delete;

    [[nodiscard]] VkInstance handle() const { return instance_; }
    [[nodiscard]] bool layerEnabled() const { return layerEnabled_; }

private:
    VkInstance instance_ = VK_NULL_HANDLE;
    bool layerEnabled_ = false;
};

// The extension that micromaps are made and used with.
enum class MicromapApi {
    Khr, // VK_KHR_opacity_micromap, with VK_KHR_device_address_commands, which it depends on
    Ext, // VK_EXT_opacity_micromap
};
// The extension's name.
const char *nameOf(MicromapApi api);

struct DeviceInfo {
    VkPhysicalDevice handle = VK_NULL_HANDLE;
    uint32_t number = 0; // in Vulkan's list, for --device
    std::string name;
    std::set<std::string> extensions;
    VkPhysicalDeviceType type = VK_PHYSICAL_DEVICE_TYPE_OTHER;
    bool rayQuery = false; // and what else the renderer needs
    bool rayTracingPipelines = false;
    bool khrMicromaps = false; // from whomever
    bool extMicromaps = false;
    std::string implementation; // of micromaps, in words

    [[nodiscard]] bool has(MicromapApi api) const { return api == MicromapApi::Khr ? khrMicromaps : extMicromaps; }
};

std::vector<DeviceInfo> listDevices(const Instance &instance);

// The device that --device names: a text of digits is a number in the list and nothing else, any other text a part of a
// name. Of several, and without a wish of all, the most powerful kind that has ray queries, and the first of these.
// Throws Error where there is none.
DeviceInfo chooseDevice(std::span<const DeviceInfo> devices, const std::optional<std::string> &wish);
DeviceInfo chooseDevice(const Instance &instance, const std::optional<std::string> &wish);

// Throws Error where the device lacks the extension. `layer`: the layer was turned on.
void requireMicromaps(const DeviceInfo &device, MicromapApi api, bool layer);

// Functions of extensions, which the loader does not export.
struct DeviceFunctions {
    PFN_vkCreateAccelerationStructureKHR createAccelerationStructure;
    PFN_vkDestroyAccelerationStructureKHR destroyAccelerationStructure;
    PFN_vkGetAccelerationStructureBuildSizesKHR getAccelerationStructureBuildSizes;
    PFN_vkGetAccelerationStructureDeviceAddressKHR getAccelerationStructureDeviceAddress;
    PFN_vkCmdBuildAccelerationStructuresKHR cmdBuildAccelerationStructures;
    // Null without VK_KHR_device_address_commands, which is there for VK_KHR_opacity_micromap only.
    PFN_vkCreateAccelerationStructure2KHR createAccelerationStructure2;
    // Null without VK_EXT_opacity_micromap.
    PFN_vkCreateMicromapEXT createMicromap;
    PFN_vkDestroyMicromapEXT destroyMicromap;
    PFN_vkGetMicromapBuildSizesEXT getMicromapBuildSizes;
    PFN_vkCmdBuildMicromapsEXT cmdBuildMicromaps;
    // Null without VK_KHR_ray_tracing_pipeline.
    PFN_vkCreateRayTracingPipelinesKHR createRayTracingPipelines;
    PFN_vkGetRayTracingShaderGroupHandlesKHR getRayTracingShaderGroupHandles;
    PFN_vkCmdTraceRaysKHR cmdTraceRays;
};

// What a device is to have enabled besides ray queries.
struct DeviceNeeds {
    std::optional<MicromapApi> micromaps;
    bool rayTracingPipelines = false; // VK_KHR_ray_tracing_pipeline
};

class Device
{
public:
    // Throws Error where the device cannot do what is needed.
    Device(const DeviceInfo &info, const DeviceNeeds &needs);
    ~Device();
    Device(const Device &) = delete;
    Device &operator=(const Device &) = delete;

    [[nodiscard]] VkDevice handle() const { return device_; }
    [[nodiscard]] const DeviceInfo &info() const { return info_; }
    // What micromaps are made with, where they are enabled.
    [[nodiscard]] std::optional<MicromapApi> micromapApi() const { return micromapApi_; }
    [[nodiscard]] const DeviceFunctions &functions() const { return functions_; }
    [[nodiscard]] VkDeviceSize scratchAlignment() const { return scratchAlignment_; }
    [[nodiscard]] const VkPhysicalDeviceLimits &limits() const { return limits_; }
    // Timestamps are worth more than the host's clock: a processor that is not the host's, with a timer.
    [[nodiscard]] bool hasTimestamps() const { return timestamps_; }

    [[nodiscard]] MemoryPool &bufferMemory() { return *bufferMemory_; }
    // A memory type of `allowed` with all `needed` properties, best with `preferred` too; nothing where there is none.
    [[nodiscard]] std::optional<uint32_t> memoryType(uint32_t allowed, VkMemoryPropertyFlags needed,
                                                     VkMemoryPropertyFlags preferred) const;
    // Records commands, submits them and waits until they are done.
    void run(const std::function<void(VkCommandBuffer)> &record);
    // For work that is recorded once and submitted often.
    [[nodiscard]] VkCommandBuffer allocateCommands();
    void submitAndWait(VkCommandBuffer commands);

private:
    Device(const DeviceInfo &info, std::optional<MicromapApi> micromaps) : info_(info), micromapApi_(micromaps) {}
    void create(const DeviceNeeds &needs);
    void loadFunctions(const DeviceNeeds &needs);
    void readProperties();

    DeviceInfo info_;
    std::optional<MicromapApi> micromapApi_;
    VkDevice device_ = VK_NULL_HANDLE;
    VkQueue queue_ = VK_NULL_HANDLE;
    uint32_t family_ = 0;
    bool timestamps_ = false;
    VkCommandPool pool_ = VK_NULL_HANDLE;
    VkFence fence_ = VK_NULL_HANDLE;
    std::unique_ptr<MemoryPool> bufferMemory_;
    DeviceFunctions functions_{};
    VkPhysicalDeviceMemoryProperties memory_{};
    VkPhysicalDeviceLimits limits_{};
    VkDeviceSize scratchAlignment_ = 0;
};

} // namespace vellum::cli
