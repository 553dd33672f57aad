// SPDX-License-Identifier: Apache-2.0
// Descriptors (core/records.h), identified by numbers, in memory of the layer.
//
// Either the device or the host writes the descriptors of a pool. When the host has written to a part of a page of
// mapped memory, a tool between the layer and the driver may write the whole page back, as capture tools with guarded
// pages do, and so overwrite what the device has written to the rest. So the host writes to a page only while none of
// its descriptors is in use: a released descriptor is not reused before all descriptors of its page are released.
#pragma once

#include <cstdint>
#include <vector>

#include "layer/memory/gpu_memory.h"

namespace vellum::layer
{

// The location of the descriptor of an acceleration structure.
struct StructureDescriptor {
    VkDeviceAddress address = 0;
    VkBuffer buffer = VK_NULL_HANDLE;
    VkDeviceSize offset = 0;
    const uint32_t *words = nullptr; // mapped; read by the host once the device has written them
};

class StructureDescriptorPool
{
public:
    static constexpr uint32_t kNone = UINT32_MAX;
    // The granularity at which tools guard host memory: the largest page of the processor's systems.
#if defined(__x86_64__) || defined(__i386__)
    static constexpr uint32_t kPageBytes = 4096;
#else
    static constexpr uint32_t kPageBytes = 65536;
#endif

    // The number of a descriptor of zeros; kNone if there is no memory.
    uint32_t acquire(const GpuContext &context);
    void release(uint32_t descriptor);
    [[nodiscard]] StructureDescriptor location(uint32_t descriptor) const;
    [[nodiscard]] uint32_t *words(uint32_t descriptor) const;

private:
    struct Page {
        uint32_t taken = 0; // descriptors acquired since the page was empty
        uint32_t inUse = 0;
    };
    bool grow(const GpuContext &context);

    std::vector<GpuBuffer> buffers_;
    std::vector<Page> pages_;
    std::vector<uint32_t> emptyPages_; // pages without descriptors in use; they may hold old content
    uint32_t open_ = kNone;            // the page from which descriptors are acquired
};

} // namespace vellum::layer
