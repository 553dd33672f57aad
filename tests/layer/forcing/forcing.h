// SPDX-License-Identifier: Apache-2.0
// The forcing layer: a layer above Vellum's that gives every triangle geometry of any program a micromap that changes
// nothing, so that the program tests Vellum. It enables the extension on each device that has acceleration structures,
// builds one micromap there, and attaches it to all geometries that have none, sets the micromap bit of ray tracing
// pipelines and, with VK_KHR_opacity_micromap, the execution mode of shaders with ray queries. A device that enables
// one of the extensions itself is forced by that one; one that enables both, by VELLUM_FORCING_API. In the environment:
//
//   VELLUM_FORCING        what the micromaps are made of
//     mixed               data of several levels and formats, and special indices; also where it is not set. Unknown
//                         states are unknown-opaque, so that a test can say what 2-state flags make of them
//     data                subdivision level 4 for every triangle, both unknown states in turn
//     special             special indices only, and no micromap
//     transparent         this changes every picture, and shows that forcing works
//   VELLUM_FORCING_API    ext (also where it is not set) or khr
//
// When the process ends, the layer says on stderr how much it forced. It changes what a program sees where that sets
// VK_GEOMETRY_INSTANCE_FORCE_OPACITY_MICROMAP_2_STATE_BIT_EXT or the ray flag ForceOpacityMicromap2State, looks at the
// sizes of its structures, or builds structures on the host.
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include <vulkan/vk_layer.h>

#include "vk/vk_init.h"

#include "layer/base/dispatch.h"

namespace forcing
{

using vellum::layer::DeviceTable;
using vellum::layer::InstanceTable;

enum class Api { Ext, Khr };
enum class Content { Mixed, Data, Special, Transparent };

struct Settings {
    Content content = Content::Mixed;
    Api api = Api::Ext;
};
// Returns nothing, and prints a line to stderr, if a variable has an invalid value.
std::optional<Settings> settingsOfEnvironment();

// Printed when the process ends, or unloads the layer.
struct Counts {
    ~Counts();
    std::atomic<uint64_t> devices{0}, geometries{0}, pipelines{0}, shaders{0};
};
extern Counts counts;

struct Buffer {
    VkBuffer handle = VK_NULL_HANDLE;
    VkDeviceMemory memory = VK_NULL_HANDLE;
    VkDeviceAddress address = 0;
    void *bytes = nullptr;
};

// The queue that the micromap is built on, before the application has the device.
struct BuildQueue {
    VkQueue handle = VK_NULL_HANDLE;
    uint32_t family = 0;
    PFN_vkSetDeviceLoaderData setLoaderData = nullptr;
};

// The micromap attachment of one geometry.
struct Attachment {
    VkAccelerationStructureTrianglesOpacityMicromapEXT ext{};
    VkAccelerationStructureTrianglesOpacityMicromapKHR khr{};
    std::vector<VkMicromapUsageEXT> usage;
};

// The micromap of a device, and index buffers for geometries of any size.
class ForcedMicromap
{
public:
    ForcedMicromap(const DeviceTable &next, VkDevice device, const VkPhysicalDeviceMemoryProperties &memory,
                   std::vector<uint32_t> families, const Settings &settings)
        : next_(next), device_(device), memory_(memory), families_(std::move(families)), settings_(settings)
    {
    }
    ~ForcedMicromap();
    ForcedMicromap(const ForcedMicromap &) = delete;
    ForcedMicromap &operator=(const ForcedMicromap &) = delete;

    VkResult build(const BuildQueue &queue);
    // Attaches the micromap to a geometry with this flag and at most `triangles` triangles, as the head of `chain`.
    // Returns false if memory runs out.
    bool attach(bool opaque, uint32_t triangles, const void *&chain, Attachment &attachment);

private:
    Buffer makeBuffer(VkDeviceSize size, VkBufferUsageFlags usage);
    void destroy(const Buffer &buffer);
    [[nodiscard]] Buffer upload(std::span<const std::byte> bytes);
    VkResult buildExt(const BuildQueue &queue);
    VkResult buildKhr(const BuildQueue &queue);
    template <class Record>
    VkResult run(const BuildQueue &queue, Record record);
    VkDeviceAddress indices(bool opaque, uint32_t triangles);

    const DeviceTable &next_;
    VkDevice device_;
    VkPhysicalDeviceMemoryProperties memory_;
    std::vector<uint32_t> families_;
    Settings settings_;
    Buffer storage_;
    VkMicromapEXT ext_ = VK_NULL_HANDLE;
    VkAccelerationStructureKHR khr_ = VK_NULL_HANDLE;
    std::mutex mutex_;
    struct Indices {
        Buffer buffer;
        uint32_t triangles = 0;
    };
    // By the geometry's opaque flag. Each buffer is twice as large as the one before it, which commands may still read.
    std::vector<Indices> indices_[2];
};

struct Pipelines; // read by a deferred operation, shaders.cpp

struct Device {
    Device();
    ~Device();
    VkDevice handle = VK_NULL_HANDLE;
    DeviceTable next;
    Api api = Api::Ext;
    std::unique_ptr<ForcedMicromap> micromap; // null: the device is left alone
    std::mutex mutex;
    std::map<VkDeferredOperationKHR, std::unique_ptr<Pipelines>> deferred;
};
Device &deviceOfKey(void *key);
template <class Handle>
Device &deviceOf(Handle handle)
{
    return deviceOfKey(*reinterpret_cast<void **>(handle));
}

struct Row {
    const char *name;
    PFN_vkVoidFunction function;
};
#define FORCING_ROW(name, function)                                                                                    \
    forcing::Row                                                                                                       \
    {                                                                                                                  \
        name, reinterpret_cast<PFN_vkVoidFunction>(function)                                                           \
    }
std::span<const Row> buildRows();
std::span<const Row> shaderRows();

} // namespace forcing
