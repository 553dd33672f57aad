// SPDX-License-Identifier: Apache-2.0
// The contents of acceleration structures and micromaps: facts that the host knows of the build or copy, and facts that
// follow from data on the GPU, which shaders recorded with the build write to host memory.
#pragma once

#include <algorithm>
#include <atomic>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <vulkan/vulkan.h>

#include "core/push.h"
#include "layer/input/objects.h"
#include "layer/memory/memory_pool.h"
#include "vk/newer.h"

namespace vellum::layer
{

struct ValidatedStructure;
class SerializedHeader;

// Words that the shaders of a command buffer write.
class Capture
{
public:
    static constexpr size_t kCountWords = 2; // before what the shaders of builds write
    // Null without memory. The first `zeros` words are 0; the others are undefined.
    static std::shared_ptr<Capture> make(MemoryPool &pool, size_t words, size_t zeros)
    {
        const MemoryPool::Piece piece = pool.take(words * sizeof(uint32_t));
        if (piece.address == 0)
            return nullptr;
        std::fill_n(piece.words, zeros, 0u);
        return std::make_shared<Capture>(pool, piece);
    }
    Capture(MemoryPool &pool, const MemoryPool::Piece &piece) : pool_(pool), piece_(piece) {}
    Capture(const Capture &) = delete;
    Capture &operator=(const Capture &) = delete;
    ~Capture() { pool_.giveBack(piece_); }

    [[nodiscard]] VkDeviceAddress address() const { return piece_.address; }
    [[nodiscard]] VkBuffer buffer() const { return piece_.buffer; }
    [[nodiscard]] VkDeviceSize offset() const { return piece_.offset; } // in the buffer
    [[nodiscard]] const uint32_t *words() const { return piece_.words; }
    // The shaders count in the first word what they have written, in all executions of their commands.
    [[nodiscard]] uint32_t written() const { return __atomic_load_n(piece_.words, __ATOMIC_ACQUIRE); }
    // The commands were submitted so many times.
    std::atomic<uint32_t> submissions = 0;
    // Returns whether the words are those of the last submission, which writes `count` items.
    [[nodiscard]] bool isCurrent(uint32_t count) const
    {
        const uint32_t times = submissions;
        return times != 0 && written() == count * times;
    }

private:
    MemoryPool &pool_;
    MemoryPool::Piece piece_;
};

// The references and masks of the instances of a top-level structure.
struct CapturedInstances {
    uint32_t count = 0;
    std::shared_ptr<Capture> memory;
    // Nothing while a submission of the build may not be complete.
    [[nodiscard]] std::optional<std::span<const VkDeviceAddress>> references() const
    {
        if (!memory || !memory->isCurrent(count))
            return {};
        return std::span(reinterpret_cast<const VkDeviceAddress *>(memory->words() + Capture::kCountWords), count);
    }
    // The masks, where the references are known.
    [[nodiscard]] std::span<const uint32_t> masks() const
    {
        return {memory->words() + Capture::kCountWords + 2 * size_t{count}, count};
    }
    static constexpr size_t kWords = 3; // of an instance
};

// The triangles with that level and format.
inline uint64_t trianglesOf(const std::vector<VkMicromapUsageEXT> &usages, uint32_t level, uint32_t format)
{
    uint64_t count = 0;
    for (const VkMicromapUsageEXT &usage : usages)
        count += usage.subdivisionLevel == level && usage.format == format ? usage.count : 0;
    return count;
}

// The kinds of micromap indices of a geometry.
struct CapturedIndices {
    uint32_t count = 0;
    std::shared_ptr<Capture> memory;
    // Returns whether it has special indices and indices of the micromap. Nothing before the build was executed, and
    // after it was submitted again: the indices may be others.
    [[nodiscard]] std::optional<bool> mixed() const
    {
        if (!memory || memory->submissions != 1 || !memory->isCurrent(count))
            return {};
        return memory->words()[1] == (shared::kIndexKindSpecial | shared::kIndexKindMicromap);
    }
};

// A geometry of a structure that was built.
struct GeometryContents {
    VkGeometryTypeKHR type = VK_GEOMETRY_TYPE_MAX_ENUM_KHR;
    VkGeometryFlagsKHR flags = 0;
    std::optional<uint32_t> primitives{};       // unknown after an indirect build
    bool hasMicromap = false;                   // there is a structure that attaches one, with a null handle or not
    bool khr = false;                           // the structure is of VK_KHR_opacity_micromap
    ObjectHandle micromapHandle;                // 0 for a null handle
    std::weak_ptr<ValidatedStructure> micromap; // the attached micromap
    uint64_t micromapNumber = 0;                // ValidatedStructure::number of it; 0: it was not known
    std::vector<VkMicromapUsageEXT> usages;     // of VK_EXT_opacity_micromap: which triangles of it are used
    CapturedIndices indices;                    // into it
};

// The content that a build or a copy gave a structure.
struct StructureContents {
    VkAccelerationStructureTypeKHR type = VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR;
    VkFlags flags = 0; // VkBuildAccelerationStructureFlagsKHR, or for a VkMicromapEXT VkBuildMicromapFlagsEXT
    std::vector<GeometryContents> geometries;
    std::vector<VkMicromapUsageEXT> usages;   // of a micromap
    uint64_t triangles = 0;                   // of a micromap
    bool discardable = false;                 // structures that attach the micromap keep a copy of it
    mutable bool isAttached = false;          // a structure was built with the micromap, or with a copy of it
    bool deserialized = false;                // the other members are unknown, except the header
    std::shared_ptr<SerializedHeader> header; // of the data of a structure; null: unknown
    CapturedInstances instances;              // of a top-level structure

    // The build is submitted.
    void submitted() const
    {
        if (instances.memory)
            ++instances.memory->submissions;
        for (const GeometryContents &geometry : geometries)
            if (geometry.indices.memory)
                ++geometry.indices.memory->submissions;
    }
};

} // namespace vellum::layer
