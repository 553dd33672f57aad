#include "layer/structures/emulated_backend.h"

#include <algorithm>

#include "core/curve.h"
#include "layer/micromaps/micromap.h"
#include "layer/structures/device_structures.h"
#include "layer/structures/exact_size_handle.h"
#include "layer/structures/structure_layout.h"

namespace vellum::layer
{

using namespace shared;

bool EmulatedBackend::begin(VkCommandBuffer commandBuffer, const char *command)
{
    reportGpuErrors(device_.objects);
    return !InjectedWork::refusedIn(device_.commands, commandBuffer, command);
}

const MicromapLimits *EmulatedBackend::limits() const
{
    static constexpr MicromapLimits kLimits{kMaxSubdivisionLevel, kMaxSubdivisionLevel, kMaxSubdivisionLevel, true};
    return &kLimits;
}

MicromapBuildSizes EmulatedBackend::sizes(const MicromapBuild &build) const
{
    return {build.extent.bytes(), build.extent.scratchBytes()};
}

void EmulatedBackend::record(VkCommandBuffer commandBuffer, const char *, std::vector<MicromapBuild> builds)
{
    for (const MicromapBuild &build : builds)
        becomeMicromap(device_.objects, *build.structure);
    recordMicromapBuilds(device_.micromaps, commandBuffer, builds);
}

void EmulatedBackend::created(const std::shared_ptr<AccelerationStructure> &structure)
{
    publishMicromapOnceBound(device_.objects, structure);
}

void EmulatedBackend::addressTaken(AccelerationStructure &structure)
{
    // Whoever names a structure to an instance asks for its address: from now on copies of top-level structures know
    // that it exists.
    descriptorOf(device_.objects, structure);
}

void EmulatedBackend::getSizes(VkAccelerationStructureBuildTypeKHR type, StructureBuild &build,
                               const uint32_t *primitives, VkAccelerationStructureBuildSizesInfoKHR &sizes)
{
    hideMicromaps(build);
    const Driver &driver = device_.driver;
    driver.next.GetAccelerationStructureBuildSizesKHR(driver.handle, type, &build.driverInfo(), primitives, &sizes);
    if (build.topLevel && build.geometryCount() == 1) {
        const TopLevelLayout layout(driver, build.info.flags, primitives ? primitives[0] : 0);
        sizes.accelerationStructureSize = layout.bytes();
        sizes.buildScratchSize = sizes.updateScratchSize = layout.scratchBytes(); // an update is a build
    } else if (const VkDeviceSize tail = bottomLevelTailBytes(build, primitives)) {
        sizes.accelerationStructureSize = alignUp(sizes.accelerationStructureSize, kPartAlignment) + tail;
    } else if (driver.clearsWholeHandles) {
        // The layer's copies count in units.
        sizes.accelerationStructureSize = alignUp(sizes.accelerationStructureSize, 16);
    }
}

VkAccelerationStructureKHR EmulatedBackend::driverHandle(AccelerationStructure &structure)
{
    return exactSizeHandle(device_, structure);
}

uint64_t copyInvocations(VkDeviceSize bytes)
{
    constexpr VkDeviceSize kBytesPerInvocation = 256;
    return std::clamp<uint64_t>(bytes / kBytesPerInvocation, 64, 16384);
}

} // namespace vellum::layer
