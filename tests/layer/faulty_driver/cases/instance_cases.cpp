// SPDX-License-Identifier: Apache-2.0
// Faults of instances.cpp.
#include "gpu/copies.h"
#include "faulty_driver/cases/cases.h"

namespace faults
{
namespace
{

using namespace vt;
using Instance = VkAccelerationStructureInstanceKHR;

// Four triangles with the states 0 to 3, at x = 0, 1.5, 3 and 4.5.
class States
{
public:
    explicit States(Gpu &gpu)
        : micromap_(built(gpu, uniform({0, 1, 2, 3}))),
          row_(gpu, micromap_.get(), 4, {}, 0, VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_DISABLE_OPACITY_MICROMAPS_EXT)
    {
    }
    [[nodiscard]] Instance instance(uint32_t flags, Vec3 place = {}, uint32_t mask = 0xff) const
    {
        return vt::instance(row_.blas(), place, 0x12345, flags, mask);
    }

private:
    std::unique_ptr<Micromap> micromap_;
    RowScene row_;
};

std::string disabled(Gpu &gpu)
{
    const States states(gpu);
    const Tlas scene(gpu, {states.instance(kFlagDisable), states.instance(kFlagDisable, {6, 0, 0})});
    return statesOf(gpu, scene, 8);
}

std::string twoState(Gpu &gpu)
{
    const States states(gpu);
    return statesOf(gpu, Tlas(gpu, {states.instance(kFlagTwoState)}), 4);
}

std::string customIndex(Gpu &gpu)
{
    const States states(gpu);
    const Ray ray{.origin = {1.8f, 0.3f, 1}};
    const Tlas scene(gpu, {states.instance(0)});
    return std::to_string(Tracer(gpu).trace(scene, std::span(&ray, 1))[0].customIndex);
}

std::string highestMaskBit(Gpu &gpu)
{
    const States states(gpu);
    return hitsOf(gpu, Tlas(gpu, {states.instance(0, {}, 0x80)}), 4, 0, 0x80);
}

std::string mirrored(Gpu &gpu)
{
    const States states(gpu);
    Instance instance = states.instance(0);
    instance.transform.matrix[0][0] = -1;
    const Ray ray{.origin = {-1.8f, 0.3f, 1}};
    const Tlas scene(gpu, {instance});
    return (Tracer(gpu).trace(scene, std::span(&ray, 1))[0].frontFace & 1) != 0 ? "front" : "back";
}

std::string forcedOpaque(Gpu &gpu)
{
    const States states(gpu);
    return statesOf(gpu, Tlas(gpu, {states.instance(VK_GEOMETRY_INSTANCE_FORCE_OPAQUE_BIT_KHR)}), 4);
}

std::string updatedFlags(Gpu &gpu)
{
    const States states(gpu);
    constexpr VkBuildAccelerationStructureFlagsKHR kFlags = VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR;
    Tlas scene(gpu);
    scene.build(std::array{states.instance(0)}, kFlags);
    scene.build(std::array{states.instance(kFlagTwoState)}, kFlags, VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR);
    return statesOf(gpu, scene, 4);
}

std::string copied(Gpu &gpu)
{
    const States states(gpu);
    const Tlas scene(gpu, {states.instance(kFlagTwoState)});
    Structure clone(gpu, VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR);
    clone.create(scene.size());
    copy(gpu, scene, clone);
    return statesOf(gpu, clone, 4);
}

// A ray that passes near the edge u = 0.
std::string nearEdge(Gpu &gpu)
{
    const auto micromap = built(gpu, uniform({1}));
    const RowScene scene(gpu, micromap.get(), 1);
    const Vec3 place{0.005f, 0.3f, 1};
    return statesAt(gpu, scene.tlas(), std::span(&place, 1));
}

// A ray that passes a box near its side.
std::string nearSide(Gpu &gpu)
{
    const Blas blas(gpu, {Geometry{.boxes = {{-1, -1, -1, 1, 1, 1}}}});
    const Tlas tlas(gpu, std::vector{instance(blas, {}, 1)});
    const Ray ray{.origin = {0.98f, 0, 5}};
    return Tracer(gpu).trace(tlas, std::span(&ray, 1))[0].candidateCount > 0 ? "met" : "missed";
}

// The states of the last of so many instances, which forces two states; the others are elsewhere.
template <uint32_t count>
std::string lastInstance(Gpu &gpu)
{
    const States states(gpu);
    std::vector<Instance> instances(count, states.instance(kFlagTwoState, {0, 9, 0}));
    instances.back() = states.instance(kFlagTwoState);
    return statesOf(gpu, Tlas(gpu, instances), 4);
}

} // namespace

std::span<const Case> instanceCases()
{
    static const std::array cases{
        Case{"disable-in-first-instance-only", disabled, "nnnnnnnn", "nnnn0123"},
        Case{"instance-2-state-ignored", twoState, "0101", "0123"},
        Case{"custom-index-16-bits", customIndex, "74565", "9029"},
        Case{"instance-mask-7-bits", highestMaskBit, ".Onn", "...."},
        Case{"mirrored-instance-faces-away", mirrored, "front", "back"},
        Case{"force-opaque-disables-micromaps", forcedOpaque, "0111", "1111"},
        Case{"update-keeps-instance-flags", updatedFlags, "0101", "0123"},
        Case{"instances-displaced", nearEdge, "1", "0"},
        Case{"boxes-shrunk", nearSide, "met", "missed"},
        Case{"copy-loses-instance-flags", copied, "0101", "0123"},
        Case{"instance-flags-lost-from-64", lastInstance<65>, "0101", "0123"},
        Case{"instance-flags-lost-from-256", lastInstance<257>, "0101", "0123"},
        Case{"instance-flags-lost-from-65536", lastInstance<65537>, "0101", "0123"},
    };
    return cases;
}

} // namespace faults
