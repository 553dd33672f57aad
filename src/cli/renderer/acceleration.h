// Acceleration structures, and the micromaps that they refer to.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "cli/scene/render_scene.h"
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
    [[nodiscard]] VkDeviceSize bytes() const { return m_micromapBytes + m_indices.size(); }

protected:
    // Uploads what both extensions read in the same way.
    GpuMicromap(Device &device, const Micromap &micromap);

    Device &m_device;
    Buffer m_indices;
    VkDeviceSize m_micromapBytes = 0; // of the micromap object, where there is one
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
                          std::span<const std::uint32_t> counts);
    ~AccelerationStructure();
    AccelerationStructure(const AccelerationStructure &) = delete;
    AccelerationStructure &operator=(const AccelerationStructure &) = delete;

    [[nodiscard]] VkAccelerationStructureKHR handle() const { return m_structure; }
    [[nodiscard]] VkDeviceAddress address() const;

private:
    explicit AccelerationStructure(Device &device) : m_owner(&device) {}

    Device *m_owner = nullptr;
    Buffer m_storage;
    VkAccelerationStructureKHR m_structure = VK_NULL_HANDLE;
};

// The scene to trace: a bottom level for each mesh, one for the ground, and a top level with the instances of all
// copies.
class World
{
public:
    // `micromaps`: none, or one for each geometry of the scene (null for geometries without).
    World(Device &device, const RenderScene &scene, std::span<const Micromap *const> micromaps);

    [[nodiscard]] VkAccelerationStructureKHR top() const { return m_top->handle(); }
    [[nodiscard]] VkDeviceSize micromapBytes() const;

private:
    std::unique_ptr<AccelerationStructure> buildBottom(Device &device, std::span<const Geometry> geometries,
                                                       const Scene *materials,
                                                       std::span<const Micromap *const> micromaps);
    void buildTop(Device &device, const RenderScene &scene);

    std::vector<std::unique_ptr<GpuMicromap>> m_micromaps;
    std::vector<std::unique_ptr<AccelerationStructure>> m_meshes;
    std::unique_ptr<AccelerationStructure> m_ground;
    std::unique_ptr<AccelerationStructure> m_top;
};

} // namespace vellum::cli
