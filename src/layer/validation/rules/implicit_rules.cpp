// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/rules/implicit_rules.h"

namespace vellum::layer
{

void checkCommand(DeviceModel &device, VkCommandBuffer commandBuffer, const char *command, VkQueueFlags queues)
{
    const auto log = device.checks.core ? device.logs.get(commandBuffer) : nullptr;
    if (!log)
        return;
    const auto &families = device.facts.queueFamilies;
    const struct {
        bool broken;
        const char *end; // of the id
        const char *text;
    } rules[] = {
        {!log->isRecording, "-commandBuffer-recording", "the command buffer is not in the recording state"},
        {log->family < families.size() && (families[log->family] & queues) == 0, "-commandBuffer-cmdpool",
         "the queue family of the command pool does not support the command"},
        {log->isRendering, "-renderpass", "the command is recorded inside a render pass instance"},
        {log->isSuspended, "-suspended", "the command is recorded between suspended render pass instances"},
    };
    for (const auto &rule : rules) {
        if (rule.broken)
            device.at(Place(command), commandBuffer)
                .report((std::string("VUID-") + command + rule.end).c_str(), nullptr, rule.text);
    }
}

void checkFeature(const InputCheck &check, const char *vuid)
{
    if (!check.device().driver.enabled.extFeature)
        check.report(vuid, nullptr, "the feature micromap is not enabled", Severity::Report);
}

void checkCount(DeviceModel &device, const char *command, const char *member, uint32_t count, const char *vuid)
{
    if (device.checks.core && count == 0)
        device.at(Place(command)).report(vuid, member, "it is 0");
}

} // namespace vellum::layer
