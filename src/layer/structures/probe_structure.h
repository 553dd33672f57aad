// The smallest acceleration structure that there is, for trials (command_buffer/driver_probe.h).
#pragma once

#include <vulkan/vulkan.h>

#include "layer/memory/gpu_memory.h"

namespace vellum::layer
{

// The driver's, without anything of the layer's in it. It has the memory that its build needs, too.
class ProbeStructure
{
public:
    explicit ProbeStructure(const GpuContext &context) : context_(context) {}
    ~ProbeStructure();
    ProbeStructure(const ProbeStructure &) = delete;
    ProbeStructure &operator=(const ProbeStructure &) = delete;

    // Records the build of a bottom-level structure of one triangle, (0,0,0) (1,0,0) (0,1,0); the structure is made
    // larger by `spareBytes` than the driver asks for. Commands after it may use the structure. False where the driver
    // could not make what is needed.
    bool buildTriangle(VkCommandBuffer commands, VkGeometryFlagsKHR flags, VkDeviceSize spareBytes = 0);

    [[nodiscard]] VkAccelerationStructureKHR handle() const { return handle_; }
    [[nodiscard]] VkDeviceSize size() const { return size_; }

private:
    bool makeInput(const void *data, size_t bytes);
    bool build(VkCommandBuffer commands, const VkAccelerationStructureGeometryKHR &geometry, VkDeviceSize spareBytes);

    const GpuContext &context_;
    GpuBuffer input_, memory_, scratch_;
    VkDeviceSize size_ = 0;
    VkAccelerationStructureKHR handle_ = VK_NULL_HANDLE;
};

} // namespace vellum::layer
