// SPDX-License-Identifier: Apache-2.0
#include "layer/structures/emulated_backend.h"

#include <algorithm>

#include "core/curve.h"
#include "core/records.h"
#include "layer/micromaps/device_micromaps.h"
#include "layer/structures/device_structures.h"
#include "layer/structures/exact_size_handle.h"
#include "layer/structures/structure_layout.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

// kProperty* of a type of query; ~0: another type.
uint32_t propertyOf(VkQueryType type)
{
    switch (type) {
    case VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR: return kPropertyCompactedSize;
    case VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR: return kPropertySerializationSize;
    case VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SIZE_KHR: return kPropertySize;
    case VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_BOTTOM_LEVEL_POINTERS_KHR: return kPropertyPointers;
    default: return UINT32_MAX;
    }
}

// Corrects the driver's answer about a structure that is not a micromap.
void recordStructureProperty(InjectedWork &work, DeviceStructures &device, const Backend::Property &property)
{
    StructureSizePush push{};
    push.descriptor = descriptorOf(device.objects, property.structure).address;
    push.begin = beginOf(device.driver, property.structure);
    push.value = property.address;
    push.structureUnits = unitsOf(property.structure.size);
    push.property = propertyOf(property.type);
    if (push.property == kPropertySerializationSize)
        push.wholeCopies = fallbackStructure(device).wholeCopies;
    if (push.descriptor)
        work.dispatch(InjectedShader::StructureSize, push, 1, 1);
}

} // namespace

bool EmulatedBackend::begin(VkCommandBuffer commandBuffer, const char *command)
{
    reportGpuErrors(device_.objects);
    return !InjectedWork::rejectedIn(device_.commands, commandBuffer, command);
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
    // Instances can only reference a structure whose address was queried: from now on copies of top-level structures
    // find it.
    descriptorOf(device_.objects, structure);
}

void EmulatedBackend::getSizes(VkAccelerationStructureBuildTypeKHR type, StructureBuild &build,
                               const uint32_t *primitives, VkAccelerationStructureBuildSizesInfoKHR &sizes)
{
    hideMicromaps(build);
    const Driver &driver = device_.driver;
    driver.next.GetAccelerationStructureBuildSizesKHR(driver.handle, type, &build.driverInfo(), primitives, &sizes);
    if (build.topLevel && build.geometryCount() == 1) {
        const TopLevelLayout layout(driver, build.info.flags, primitives[0]);
        sizes.accelerationStructureSize = layout.reportedBytes();
        sizes.buildScratchSize = sizes.updateScratchSize = layout.scratchBytes; // an update is a build
    } else {
        sizes.accelerationStructureSize =
            alignUp(sizes.accelerationStructureSize, kPartAlignment) + bottomLevelTailBytes(build, primitives);
    }
}

VkAccelerationStructureKHR EmulatedBackend::driverHandle(AccelerationStructure &structure)
{
    return exactSizeHandle(device_, structure);
}

void EmulatedBackend::recordCorrections(VkCommandBuffer commandBuffer, InjectedWork &work,
                                        std::span<const Property> properties)
{
    std::vector<CompactedSize> compacted;
    for (const Property &property : properties) {
        const Driver &driver = device_.driver;
        const Micromap micromap = property.micromap ? micromapIn(property.structure) : Micromap{};
        if (!property.micromap)
            recordStructureProperty(work, device_, property);
        else if (property.type == VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR)
            recordMicromapProperty(work, driver, micromap, kQueryMicromapSerialized, property.address);
        else if (property.type == VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR ||
                 property.type == VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SIZE_KHR)
            recordMicromapProperty(work, driver, micromap, kQueryMicromapSize | kQueryMarked, property.address);
        // The bottom-level pointers of a top-level structure have no other type: the query was reset to none.
        if (property.micromap && property.type == VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR)
            compacted.push_back({micromap, property.address, true});
    }
    if (!compacted.empty())
        recordCompactedSizes(device_.micromaps, commandBuffer, work, compacted);
}

} // namespace vellum::layer
