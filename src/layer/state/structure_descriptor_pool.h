// SPDX-License-Identifier: Apache-2.0
// Descriptors (core/records.h), identified by numbers, in memory of the layer.
//
// Either the device or the host writes the descriptors of a pool. When the host has written to a part of a page of
// mapped memory, a tool between the layer and the driver may write the whole page back, as capture tools with guarded
// pages do, and so overwrite what the device has written to the rest. So the host never writes to descriptors of the
// device. A released one is reused as it is, with the next generation, by which shaders see that it states nothing.
#pragma once

#include <cstdint>
#include <vector>

#include "layer/memory/gpu_memory.h"

namespace vellum::layer
{

// The location of the descriptor of an acceleration structure.
struct StructureDescriptor {
    VkDeviceAddress address = 0; // and the generation, in its low bits
    VkBuffer buffer = VK_NULL_HANDLE;
    VkDeviceSize offset = 0;
    const uint32_t *words = nullptr; // mapped; read by the host once the device has written them
};

class StructureDescriptorPool
{
public:
    static constexpr uint32_t kNone = UINT32_MAX;
    enum class Writer { Device, Host };
    explicit StructureDescriptorPool(Writer writer) : writer_(writer) {}

    // The number of a descriptor that states nothing; kNone if memory runs out. A descriptor that the host writes is
    // zeroed.
    uint32_t acquire(const GpuContext &context);
    // The device must have finished everything that uses it.
    void release(uint32_t descriptor);
    [[nodiscard]] StructureDescriptor location(uint32_t descriptor) const;
    [[nodiscard]] uint32_t *words(uint32_t descriptor) const;

private:
    bool grow(const GpuContext &context);

    const Writer writer_;
    std::vector<GpuBuffer> buffers_;
    std::vector<uint8_t> generations_; // of all descriptors
    std::vector<uint32_t> free_;       // the last one is next
};

} // namespace vellum::layer
