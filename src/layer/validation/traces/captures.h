// SPDX-License-Identifier: Apache-2.0
// What is known of acceleration structures only from data on the GPU: shaders that run beside a build write it to
// memory of the host.
#pragma once

#include <memory>
#include <optional>
#include <span>

#include <vulkan/vulkan.h>

#include "layer/memory/memory_pool.h"

namespace vellum::layer
{

struct DeviceValidation;
struct AttachmentInput;
struct StructureContents;

// Words that the shaders of a command buffer write.
class Capture
{
public:
    // Null without memory. The first `zeros` words are 0; the others are undefined.
    static std::shared_ptr<Capture> make(MemoryPool &pool, size_t words, size_t zeros);
    Capture(MemoryPool &pool, const MemoryPool::Piece &piece) : pool_(pool), piece_(piece) {}
    Capture(const Capture &) = delete;
    Capture &operator=(const Capture &) = delete;
    ~Capture() { pool_.giveBack(piece_); }

    [[nodiscard]] VkDeviceAddress address() const { return piece_.address; }
    [[nodiscard]] VkBuffer buffer() const { return piece_.buffer; }
    [[nodiscard]] VkDeviceSize offset() const { return piece_.offset; } // in the buffer
    [[nodiscard]] const uint32_t *words() const { return piece_.words; }
    // The shaders count in the first word what they have written.
    [[nodiscard]] uint32_t written() const { return __atomic_load_n(piece_.words, __ATOMIC_ACQUIRE); }

private:
    MemoryPool &pool_;
    MemoryPool::Piece piece_;
};

// The references of the instances of a top-level structure.
struct CapturedInstances {
    uint32_t count = 0;
    std::shared_ptr<Capture> memory;
    // Nothing before the build was executed.
    [[nodiscard]] std::optional<std::span<const VkDeviceAddress>> references() const;
};

// The kinds of micromap indices of a geometry.
struct CapturedIndices {
    uint32_t count = 0;
    std::shared_ptr<Capture> memory;
    // Whether it has special indices and indices of the micromap. Nothing before the build was executed.
    [[nodiscard]] std::optional<bool> mixed() const;
};

// Records what fills the contents of a structure, which a direct build constructs, beside what the host knows.
void captureContents(DeviceValidation &device, VkCommandBuffer commandBuffer,
                     const VkAccelerationStructureBuildGeometryInfoKHR &info,
                     const VkAccelerationStructureBuildRangeInfoKHR *ranges, StructureContents &contents);

} // namespace vellum::layer
