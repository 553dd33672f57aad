// Buffers that the layer owns, with a device address. Most are host-visible and coherent: the host prepares what the
// GPU reads.
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
    // The device's, each once: command buffers of all of them use the layer's buffers, and nobody transfers those.
    std::shared_ptr<const std::vector<uint32_t>> queueFamilies;
    bool importsHostMemory = false; // VK_EXT_external_memory_host is enabled, and device addresses may be the host's
    bool driversMicromaps = false;  // VK_EXT_opacity_micromap is enabled
    bool replaysAddresses = false;  // bufferDeviceAddressCaptureReplay is enabled, and not by the application
};

// What a driver is to be told to put a buffer where it was before (VkBufferOpaqueCaptureAddressCreateInfo and
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

    // DevicesOnly: undefined, and the host does not see it.
    enum class Content { Zero, Undefined, DevicesOnly };
    // On failure nothing is left behind.
    VkResult create(const GpuContext &context, VkDeviceSize bytes, VkBufferUsageFlags extraUsage = 0,
                    Content content = Content::Zero);
    // A buffer on memory of the host's, of which begin and size are aligned to FixedMemory::kAlignment, and which
    // outlives it; the content is what is there. Fails, too, where the device has another address for it.
    VkResult createOn(const GpuContext &context, void *memory, VkDeviceSize bytes, VkBufferUsageFlags extraUsage = 0);
    // A buffer of zeros where `address` says, and if that cannot be had, where the driver puts it. Afterwards `address`
    // says where it is. Needs bufferDeviceAddressCaptureReplay.
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
