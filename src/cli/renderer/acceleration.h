// SPDX-License-Identifier: Apache-2.0
// Acceleration structures, and the micromaps that they refer to.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>

#include "cli/scene/render_scene.h"
#include "cli/vulkan/gpu_timer.h"
#include "cli/vulkan/resources.h"

namespace vellum::cli
{

// A micromap in the device's memory, made with either extension.
class GpuMicromap
{
public:
    virtual ~GpuMicromap() = default;
    GpuMicromap(const GpuMicromap &) = delete;
    GpuMicromap &operator=(const GpuMicromap &) = delete;

    // What to put into the pNext chain of the triangles of its geometry; valid as long as this lives.
    [[nodiscard]] virtual const void *attachment() const = 0;
    // Bytes of the micromap and of its index buffer.
    [[nodiscard]] VkDeviceSize bytes() const { return micromapBytes_ + indices_.size(); }
    // How long the build took, by the clock from its recording to its end; without its buffers and uploads.
    [[nodiscard]] Milliseconds buildTime() const { return buildTime_; }

protected:
    // Uploads what both extensions read in the same way.
    GpuMicromap(Device &device, const Micromap &micromap);
    // Builds it.
    void run(const std::function<void(VkCommandBuffer)> &recordBuild);

    Device &device_;
    Buffer indices_;
    VkDeviceSize micromapBytes_ = 0; // of the micromap object, where there is one
    Milliseconds buildTime_;
};

// Builds it, on a device that has micromaps enabled. `micromap` must be valid; where it has nothing but special indices
// there is no micromap object.
std::unique_ptr<GpuMicromap> makeMicromap(Device &device, const Micromap &micromap);
// The two that makeMicromap chooses from.
std::unique_ptr<GpuMicromap> makeKhrMicromap(Device &device, const Micromap &micromap);
std::unique_ptr<GpuMicromap> makeExtMicromap(Device &device, const Micromap &micromap);

class AccelerationStructure
{
public:
    // Builds the structure. geometries[i] has counts[i] primitives.
    AccelerationStructure(Device &device, VkAccelerationStructureTypeKHR type,
                          std::span<const VkAccelerationStructureGeometryKHR> geometries,
                          std::span<const uint32_t> counts);
    ~AccelerationStructure();
    AccelerationStructure(const AccelerationStructure &) = delete;
    AccelerationStructure &operator=(const AccelerationStructure &) = delete;

    [[nodiscard]] VkAccelerationStructureKHR handle() const { return structure_; }
    [[nodiscard]] VkDeviceAddress address() const;
    [[nodiscard]] VkDeviceSize bytes() const { return storage_.size(); }

private:
    explicit AccelerationStructure(Device &device) : owner_(&device) {}

    Device *owner_ = nullptr;
    Buffer storage_;
    VkAccelerationStructureKHR structure_ = VK_NULL_HANDLE;
};

// The scene to trace: a bottom level for each mesh, one for the ground, and a top level with the instances of all
// copies.
class World
{
public:
    // `micromaps`: none, or one for each geometry of the scene (null for geometries without).
    World(Device &device, const RenderScene &scene, std::span<const Micromap *const> micromaps);

    [[nodiscard]] VkAccelerationStructureKHR top() const { return top_->handle(); }
    [[nodiscard]] VkDeviceSize micromapBytes() const;
    // Bytes of the acceleration structures.
    [[nodiscard]] VkDeviceSize structureBytes() const;

private:
    std::unique_ptr<AccelerationStructure> buildBottom(Device &device, std::span<const Geometry> geometries,
                                                       const Scene *materials,
                                                       std::span<const Micromap *const> micromaps);
    void buildTop(Device &device, const RenderScene &scene);

    std::vector<std::unique_ptr<GpuMicromap>> micromaps_;
    std::vector<std::unique_ptr<AccelerationStructure>> meshes_;
    std::unique_ptr<AccelerationStructure> ground_;
    std::unique_ptr<AccelerationStructure> top_;
};

} // namespace vellum::cli
