// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/sync/sync_report.h"

#include "layer/validation/device_validation.h"

namespace vellum::layer::sync
{
namespace
{

std::string stagesText(VkPipelineStageFlags2 stages)
{
    if (stages & VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR)
        return "ACCELERATION_STRUCTURE_BUILD";
    if (stages & VK_PIPELINE_STAGE_2_MICROMAP_BUILD_BIT_EXT)
        return "MICROMAP_BUILD";
    return "COPY";
}

// The access that a program should name: the last of those that are accepted.
std::string accessText(const Access &access)
{
    const VkAccessFlags2 accesses = access.scope.accesses;
    if (access.writes) {
        return accesses & VK_ACCESS_2_ACCELERATION_STRUCTURE_WRITE_BIT_KHR ? "ACCELERATION_STRUCTURE_WRITE"
               : accesses & VK_ACCESS_2_MICROMAP_WRITE_BIT_EXT             ? "MICROMAP_WRITE"
                                                                           : "TRANSFER_WRITE";
    }
    return accesses & VK_ACCESS_2_SHADER_READ_BIT             ? "SHADER_READ"
           : accesses & VK_ACCESS_2_INDIRECT_COMMAND_READ_BIT ? "INDIRECT_COMMAND_READ"
           : accesses & VK_ACCESS_2_MICROMAP_READ_BIT_EXT     ? "MICROMAP_READ"
           : accesses & VK_ACCESS_2_TRANSFER_READ_BIT         ? "TRANSFER_READ"
                                                              : "ACCELERATION_STRUCTURE_READ";
}

const char *whereText(const Hazard &hazard)
{
    return hazard.sameBatch ? " in the same batch" : hazard.sameQueue ? " in an earlier batch" : " on another queue";
}

std::string reasonText(const Hazard &hazard)
{
    const std::string stage = stagesText(hazard.later.scope.stages);
    if (hazard.kind == HazardKind::Ownership)
        return "the buffer is exclusive, and this queue family has not acquired it";
    if (!hazard.sameQueue)
        return "no semaphore orders the two";
    if (hazard.kind == HazardKind::WriteAfterRead)
        return "no barrier orders stage " + stagesText(hazard.earlier.scope.stages) + " before stage " + stage;
    if (!hazard.executionOrdered)
        return "no barrier makes the write (stage " + stagesText(hazard.earlier.scope.stages) + ", access " +
               accessText(hazard.earlier) + ") available to stage " + stage + ", access " + accessText(hazard.later);
    return "a barrier orders the stages, but does not make access " + accessText(hazard.earlier) +
           " available to stage " + stage + ", access " + accessText(hazard.later);
}

} // namespace

std::string placeOf(const Access &access)
{
    const Place command(access.command);
    return access.array ? command.element(access.array, access.element).text() : command.text();
}

void report(DeviceValidation &device, const Hazard &hazard)
{
    const char *id = hazard.kind == HazardKind::ReadAfterWrite    ? "VELLUM-sync-read-after-write"
                     : hazard.kind == HazardKind::WriteAfterRead  ? "VELLUM-sync-write-after-read"
                     : hazard.kind == HazardKind::WriteAfterWrite ? "VELLUM-sync-write-after-write"
                                                                  : "VELLUM-sync-ownership";
    const Access &later = hazard.later;
    std::string text = placeOf(later);
    text += text.find(": ") == std::string::npos ? ": " : " ";
    text += later.writes ? "writes " : "reads ";
    text += std::string(later.subject) + " " + device.nameOf(later.object) + " that " + placeOf(hazard.earlier) +
            (hazard.earlier.writes ? " wrote" : " read");
    if (hazard.earlier.object.handle != later.object.handle)
        text += std::string(" as ") + hazard.earlier.subject + " " + device.nameOf(hazard.earlier.object);
    text += whereText(hazard) + std::string("; ") + reasonText(hazard);
    device.driver.report().error(id, text, later.object.type, later.object.handle);
}

void reportDestroyed(DeviceValidation &device, const char *command,
                     const std::vector<std::shared_ptr<ValidatedStructure>> &structures)
{
    for (const auto &structure : structures) {
        const bool buffer = structure->buffer && structure->buffer->destroyed;
        if (!structure->destroyed && !buffer)
            continue;
        device.driver.report().error("VELLUM-sync-destroyed",
                                     std::string(command) + ": " +
                                         (structure->isMicromap() ? "micromap " : "structure ") +
                                         device.nameOf(structure->handle) +
                                         (structure->destroyed ? " was destroyed" : "'s buffer was destroyed") +
                                         " before the command buffer was submitted",
                                     structure->handle.type, structure->handle.handle);
    }
}

} // namespace vellum::layer::sync
