// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/model/device_model.h"

namespace vellum::layer
{

ObjectFacts DeviceModel::factsOf(ObjectHandle handle) const
{
    const auto structure = objects.structureOf(handle);
    if (!structure)
        return {.exists = handle && objects.anyUnknown,
                .destroyed = handle && objects.destroyed.contains(handle),
                .size = UINT64_MAX};
    ObjectFacts found{.exists = true,
                      .type = structure->isMicromap() ? VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR
                                                      : structure->type,
                      .size = structure->size};
    found.content = found.type;
    if (found.type == VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR && rules.content)
        found.content = rules.content(handle);
    found.lacksMemory = lacksMemory(*this, *structure);
    if (const ValidatedBuffer *buffer = structure->buffer.get())
        found.hostVisible = buffer->memory && objects.memories.get(buffer->memory).hostVisible;
    return found;
}

} // namespace vellum::layer
