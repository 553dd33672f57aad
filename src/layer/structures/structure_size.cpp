#include "layer/structures/structure_size.h"

#include "layer/objects/acceleration_structure.h"
#include "layer/structures/device_structures.h"

namespace vellum::layer
{
namespace
{

constexpr uint32_t kSerializationSize = 1;

// kProperty* of shaders/structure_size.comp; ~0: not one of these.
uint32_t propertyOf(VkQueryType type)
{
    switch (type) {
    case VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR: return 0;
    case VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR: return kSerializationSize;
    case VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SIZE_KHR: return 2;
    case VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_BOTTOM_LEVEL_POINTERS_KHR: return 3;
    default: return UINT32_MAX;
    }
}

} // namespace

bool isStructureProperty(VkQueryType type)
{
    return propertyOf(type) != UINT32_MAX;
}

void recordStructureProperty(InjectedWork &work, DeviceStructures &device, VkAccelerationStructureKHR structure,
                             VkQueryType type, VkDeviceAddress value)
{
    const auto known = device.objects.accelerationStructures.get(structure);
    if (!known)
        return;
    StructureSizePush push{};
    push.cell = cellOf(device.objects, *known, structure).address;
    push.begin = beginOf(device.driver, *known);
    push.value = value;
    push.structureUnits = unitsOf(known->size);
    push.property = propertyOf(type);
    if (push.property == kSerializationSize)
        push.wholeCopies = blankStructure(device).wholeCopies;
    if (push.cell)
        work.dispatch(InjectedShader::StructureSize, push, 1, 1);
}

} // namespace vellum::layer
