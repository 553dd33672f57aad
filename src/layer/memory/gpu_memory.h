// SPDX-License-Identifier: Apache-2.0
// Buffers of the layer, with a device address. Most are host-visible and coherent: the host prepares what the GPU
// reads.
#pragma once

#include <memory>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/base/dispatch.h"

namespace vellum::layer
{

struct DeviceTable;

struct GpuContext {
    VkDevice device = VK_NULL_HANDLE;
    const DeviceTable *next = nullptr;
    VkPhysicalDeviceMemoryProperties memory{};
    // Queue families of the device, each once: command buffers of all of them use the layer's buffers, whose ownership
    // is never transferred.
    std::shared_ptr<const std::vector<uint32_t>> queueFamilies;
    bool importsHostMemory =
        false;                     // VK_EXT_external_memory_host is enabled, and device addresses may be host addresses
    bool driversMicromaps = false; // VK_EXT_opacity_micromap is enabled
    bool replaysAddresses = false; // bufferDeviceAddressCaptureReplay is enabled, and not by the application
};

// The values that create a buffer at its earlier address (VkBufferOpaqueCaptureAddressCreateInfo and
// VkMemoryOpaqueCaptureAddressAllocateInfo).
struct ReplayAddress {
    uint64_t buffer = 0; // 0: not known
    uint64_t memory = 0;
    bool operator==(const ReplayAddress &) const = default;
};

class GpuBuffer
{
public:
    GpuBuffer() = default;
    ~GpuBuffer() { reset(); }
    GpuBuffer(GpuBuffer &&other) noexcept { *this = static_cast<GpuBuffer &&>(other); }
    GpuBuffer &operator=(GpuBuffer &&other) noexcept;
    GpuBuffer(const GpuBuffer &) = delete;
    GpuBuffer &operator=(const GpuBuffer &) = delete;

    // DevicesOnly: undefined, and not mapped.
    enum class Content { Zero, Undefined, DevicesOnly };
    // On failure the object is empty.
    VkResult create(const GpuContext &context, VkDeviceSize bytes, VkBufferUsageFlags extraUsage = 0,
                    Content content = Content::Zero);
    // Creates a buffer on host memory whose address and size are multiples of FixedMemory::kAlignment, and which
    // outlives the buffer. The content stays. Fails as well if the device address is not the host address.
    VkResult createOn(const GpuContext &context, void *memory, VkDeviceSize bytes, VkBufferUsageFlags extraUsage = 0);
    // Creates a buffer of zeros at `address`, or if that is not possible, at an address that the driver chooses, which
    // `address` then is. Needs bufferDeviceAddressCaptureReplay.
    VkResult createAgain(const GpuContext &context, VkDeviceSize bytes, ReplayAddress &address);
    void reset();

    [[nodiscard]] VkBuffer buffer() const { return buffer_; }
    [[nodiscard]] VkDeviceAddress address() const { return address_; }
    [[nodiscard]] uint32_t *words() const { return mapped_; }

private:
    VkResult make(const GpuContext &context, VkDeviceSize bytes, VkBufferUsageFlags extraUsage, Content content,
                  ReplayAddress *replay);
    VkResult makeOn(void *memory, VkDeviceSize bytes, VkBufferUsageFlags extraUsage);

    GpuContext context_;
    VkBuffer buffer_ = VK_NULL_HANDLE;
    VkDeviceMemory memory_ = VK_NULL_HANDLE;
    VkDeviceAddress address_ = 0;
    uint32_t *mapped_ = nullptr;
};

} // namespace vellum::layer
