// SPDX-License-Identifier: Apache-2.0
// Copies of acceleration structures for tests: the commands with less to write, serialized data, and scenes whose every
// place is looked at.
#pragma once

#include "gpu/tracer.h"

namespace vellum::gpu
{

void recordCopy(Device &gpu, VkCommandBuffer commands, VkAccelerationStructureKHR from, VkAccelerationStructureKHR to,
                VkCopyAccelerationStructureModeKHR mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR);
void copy(Device &gpu, const Structure &from, const Structure &to,
          VkCopyAccelerationStructureModeKHR mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR);

// Serialized data as an application keeps it in a file.
class Serialized
{
public:
    Serialized() = default;
    explicit Serialized(std::vector<uint8_t> bytes) : bytes_(std::move(bytes)) {}
    [[nodiscard]] std::vector<uint8_t> &bytes() { return bytes_; }
    [[nodiscard]] const std::vector<uint8_t> &bytes() const { return bytes_; }
    [[nodiscard]] uint64_t total() const { return number(4); }
    [[nodiscard]] uint64_t deserializedSize() const { return number(5); }
    [[nodiscard]] uint64_t handleCount() const { return number(6); }
    [[nodiscard]] uint64_t handle(size_t i) const { return number(7 + i); }
    void setHandle(size_t i, uint64_t value) { std::memcpy(bytes_.data() + (7 + i) * 8, &value, 8); }
    // Replaces handles by what `change` gives for them.
    void relocate(const std::function<uint64_t(uint64_t)> &change);

private:
    [[nodiscard]] uint64_t number(size_t i) const
    {
        uint64_t value = 0;
        std::memcpy(&value, bytes_.data() + i * 8, 8);
        return value;
    }
    std::vector<uint8_t> bytes_;
};

// The size that a query reports, read on the host.
VkDeviceSize queried(Device &gpu, const Structure &structure, VkQueryType type);

void recordSerialize(Device &gpu, VkCommandBuffer commands, const Structure &structure, VkDeviceAddress to);
Serialized serialize(Device &gpu, const Structure &structure);
// `capacity` bytes are readable; 0: as many as there are.
void deserialize(Device &gpu, const Serialized &data, const Structure &to, VkDeviceSize capacity = 0);
// Into a structure of the size that the data names.
std::unique_ptr<Structure> deserialized(Device &gpu, const Serialized &data, VkAccelerationStructureTypeKHR type);

// Bottom-level geometry with everything that records can hold: two micromaps with states of several levels, indices of
// both sizes, special ones and a base triangle, a plain geometry between them, and a null micromap.
class Patchwork
{
public:
    // Different seeds: different states, in the same places.
    explicit Patchwork(Device &gpu, uint32_t seed = 1);
    [[nodiscard]] std::vector<Geometry> geometries() const;
    [[nodiscard]] Micromap &micromap(size_t i) const { return *micromaps_[i]; }

    // Rays at several places of every triangle of an instance at that place.
    static std::vector<Ray> rays(Vec3 place = {}, uint32_t flags = 0);

private:
    std::vector<std::unique_ptr<Micromap>> micromaps_;
};

// The results of the shader as comparable text.
std::vector<std::string> seen(Device &gpu, const Structure &scene, std::span<const Ray> rays);
// The results for a bottom-level structure, by a scene of one instance.
std::vector<std::string> seenOf(Device &gpu, const Structure &blas, uint32_t instanceFlags = 0);

} // namespace vellum::gpu
