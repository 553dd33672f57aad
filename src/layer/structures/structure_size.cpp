#include "layer/structures/structure_size.h"

#include "core/records.h"
#include "layer/micromaps/micromap.h"
#include "layer/structures/device_structures.h"
#include "layer/structures/emulated_backend.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

// kProperty*; ~0: not one of these.
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

} // namespace

bool isStructureProperty(VkQueryType type)
{
    return propertyOf(type) != UINT32_MAX;
}

namespace
{

void recordStructureProperty(InjectedWork &work, DeviceStructures &device, AccelerationStructure &structure,
                             VkQueryType type, VkDeviceAddress value)
{
    StructureSizePush push{};
    push.descriptor = descriptorOf(device.objects, structure).address;
    push.begin = beginOf(device.driver, structure);
    push.value = value;
    push.structureUnits = unitsOf(structure.size);
    push.property = propertyOf(type);
    if (push.property == kPropertySerializationSize)
        push.wholeCopies = fallbackStructure(device).wholeCopies;
    if (push.descriptor)
        work.dispatch(InjectedShader::StructureSize, push, 1, 1);
}

} // namespace

void EmulatedBackend::recordCorrection(InjectedWork &work, const Property &property)
{
    if (!property.micromap)
        return recordStructureProperty(work, device_, property.structure, property.type, property.address);
    switch (property.type) {
    case VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR:
        return recordMicromapProperty(work, device_.driver, micromapIn(property.structure), kQueryMicromapSerialized,
                                      property.address);
    // The size is that of a clone: VUID-VkCopyAccelerationStructureInfoKHR-mode-12418.
    case VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR:
    case VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SIZE_KHR:
        return recordMicromapProperty(work, device_.driver, micromapIn(property.structure),
                                      kQueryMicromapCompacted | kQueryMarked, property.address);
    default: // the bottom-level pointers of a top-level structure: the query was reset to none
        return;
    }
}

} // namespace vellum::layer
