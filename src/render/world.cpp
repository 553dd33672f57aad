// SPDX-License-Identifier: Apache-2.0
#include "render/world.h"

#include <cstring>
#include <utility>

namespace vellum::render
{
namespace
{

constexpr VkBuildAccelerationStructureFlagsKHR kFastTrace = VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR;

// The matrix of an object at `place` in a copy with that placement.
VkTransformMatrixKHR matrixOf(const Placement &placement, const Transform &place)
{
    VkTransformMatrixKHR matrix{};
    for (size_t column = 0; column < 4; ++column) {
        const Vec3 axis = {place[0][column], place[1][column], place[2][column]};
        const Vec3 image =
            Placement{placement.angle, placement.scale, column < 3 ? Vec3{} : placement.offset}.apply(axis);
        for (size_t row = 0; row < 3; ++row)
            matrix.matrix[row][column] = image[row];
    }
    return matrix;
}

gpu::MicromapInput inputOf(const Micromap &micromap)
{
    static_assert(sizeof(MicromapTriangle) == sizeof(VkMicromapTriangleEXT));
    gpu::MicromapInput input;
    input.data = micromap.data;
    input.triangles.resize(micromap.triangles.size());
    std::memcpy(input.triangles.data(), micromap.triangles.data(),
                input.triangles.size() * sizeof(VkMicromapTriangleEXT));
    return input;
}

gpu::Geometry geometryOf(const Geometry &from, bool masked)
{
    gpu::Geometry geometry;
    geometry.vertices = from.positions;
    geometry.indices = from.indices;
    geometry.indexType = VK_INDEX_TYPE_UINT32;
    geometry.flags = masked ? VkGeometryFlagsKHR{0} : VkGeometryFlagsKHR{VK_GEOMETRY_OPAQUE_BIT_KHR};
    return geometry;
}

} // namespace

DeviceMicromap::DeviceMicromap(gpu::Device &device, const Micromap &micromap)
    : device_(device), indices_(micromap.indices), base_(micromap.baseTriangle)
{
    if (!micromap.triangles.empty())
        micromap_ =
            std::make_unique<gpu::Micromap>(device, inputOf(micromap), VK_BUILD_MICROMAP_PREFER_FAST_TRACE_BIT_EXT);
}

gpu::Milliseconds DeviceMicromap::build()
{
    if (!micromap_)
        return {};
    const gpu::GpuTimer timer(device_);
    return timer.time([&] {
        device_.submit([&](VkCommandBuffer commands) {
            timer.begin(commands);
            micromap_->record(commands);
            timer.end(commands);
        });
    });
}

gpu::Attachment DeviceMicromap::attachment() const
{
    return {.micromap = micromap_.get(), .indexType = VK_INDEX_TYPE_UINT32, .indices = indices_, .base = base_};
}

VkDeviceSize DeviceMicromap::bytes() const
{
    return (micromap_ ? micromap_->size() : 0) + indices_.size() * sizeof(int32_t);
}

void DeviceMicromap::forgetInput()
{
    if (micromap_)
        micromap_->forgetInput();
}

World::World(gpu::Device &device, const RenderScene &scene, std::span<const Micromap *const> micromaps)
    : top_(std::make_unique<gpu::Tlas>(device))
{
    for (const Mesh &mesh : scene.scene.meshes) {
        const auto part = [&](auto all) { return all.subspan(mesh.firstGeometry, mesh.geometryCount); };
        meshes_.push_back(buildBottom(device, part(std::span(scene.scene.geometries)), &scene.scene,
                                      micromaps.empty() ? micromaps : part(micromaps)));
    }
    ground_ = buildBottom(device, std::span(&scene.ground, 1), nullptr, {});
    buildTop(scene);
}

std::unique_ptr<gpu::Blas> World::buildBottom(gpu::Device &device, std::span<const Geometry> geometries,
                                              const Scene *materials, std::span<const Micromap *const> micromaps)
{
    std::vector<gpu::Geometry> inputs;
    for (size_t i = 0; i < geometries.size(); ++i) {
        const bool masked = materials != nullptr && materials->materials[geometries[i].material].masked();
        inputs.push_back(geometryOf(geometries[i], masked));
        if (i >= micromaps.size() || micromaps[i] == nullptr)
            continue;
        DeviceMicromap &micromap = *micromaps_.emplace_back(std::make_unique<DeviceMicromap>(device, *micromaps[i]));
        micromap.build();
        inputs.back().micromap = micromap.attachment();
        micromap.forgetInput();
    }
    auto bottom = std::make_unique<gpu::Blas>(device, std::move(inputs), kFastTrace);
    bottom->forgetInput();
    return bottom;
}

void World::buildTop(const RenderScene &scene)
{
    std::vector<VkAccelerationStructureInstanceKHR> instances;
    const auto add = [&](const VkTransformMatrixKHR &transform, size_t firstRecord, const gpu::Blas &bottom) {
        VkAccelerationStructureInstanceKHR &instance = instances.emplace_back();
        instance.transform = transform;
        instance.instanceCustomIndex = static_cast<uint32_t>(firstRecord) & 0xffffffu;
        instance.mask = 0xff;
        instance.flags = VK_GEOMETRY_INSTANCE_TRIANGLE_FACING_CULL_DISABLE_BIT_KHR;
        instance.accelerationStructureReference = bottom.address();
    };
    for (const Placement &copy : scene.copies)
        for (const MeshInstance &i : scene.scene.instances)
            add(matrixOf(copy, i.transform), scene.scene.meshes[i.mesh].firstGeometry, *meshes_[i.mesh]);
    add(matrixOf({}, kInPlace), scene.records.size() - 1, *ground_);
    top_->build(instances, kFastTrace);
    top_->forgetInput();
}

VkDeviceSize World::structureBytes() const
{
    VkDeviceSize bytes = top_->size() + ground_->size();
    for (const auto &mesh : meshes_)
        bytes += mesh->size();
    return bytes;
}

VkDeviceSize World::micromapBytes() const
{
    VkDeviceSize bytes = 0;
    for (const auto &micromap : micromaps_)
        bytes += micromap->bytes();
    return bytes;
}

} // namespace vellum::render
