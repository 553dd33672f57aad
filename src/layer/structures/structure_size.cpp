// SPDX-License-Identifier: Apache-2.0
#include "layer/structures/structure_size.h"

#include "core/records.h"
#include "layer/structures/device_structures.h"

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

} // namespace

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

} // namespace vellum::layer
