// SPDX-License-Identifier: Apache-2.0
#include "gpu/programs/helper_scene.h"

namespace vellum::gpu
{
namespace
{

Geometry triangleGeometry()
{
    Geometry geometry;
    geometry.vertices = {{-2, -2, 0}, {2, -2, 0}, {0, 3, 0}};
    geometry.flags = VK_GEOMETRY_NO_DUPLICATE_ANY_HIT_INVOCATION_BIT_KHR;
    return geometry;
}

Geometry boxGeometry()
{
    Geometry geometry;
    geometry.boxes = {{-1, -1, -1, 1, 1, 0.5f}};
    geometry.flags = VK_GEOMETRY_NO_DUPLICATE_ANY_HIT_INVOCATION_BIT_KHR;
    return geometry;
}

} // namespace

HelperScene::HelperScene(Device &gpu, uint32_t record)
    : triangle_(gpu, {triangleGeometry()}), box_(gpu, {boxGeometry()}), top_(gpu)
{
    std::vector instances{instance(triangle_, {}, 0), instance(box_, {10, 0, 0}, 1)};
    for (VkAccelerationStructureInstanceKHR &i : instances)
        i.instanceShaderBindingTableRecordOffset = record & 0xffffffu;
    top_.prepare(instances);
    gpu.submit([this](VkCommandBuffer commands) {
        barrier(commands); // after the builds of the others
        top_.record(commands);
        barrier(commands);
    });
}

} // namespace vellum::gpu
