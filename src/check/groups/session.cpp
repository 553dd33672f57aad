// SPDX-License-Identifier: Apache-2.0
#include "check/groups/session.h"

#include "check/case/case.h"

namespace vellum::check
{
Session::Session(const SessionOptions &options) : options_(options)
{
    limits_ = limitsOf(device(Memory::Apart));
}

Device &Session::device(Memory memory)
{
    std::unique_ptr<Device> &device = devices_[memory];
    if (!device) {
        InstanceOptions instance;
        if (options_.layer)
            instance.layers.emplace_back(kLayerName);
        instance.onMessage = [this](const Message &message) {
            if (message.severity < VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT)
                return;
            const std::lock_guard lock(mutex_);
            errors_.push_back(message.id + ": " + message.text);
        };
        device = std::make_unique<Device>(
            std::move(instance),
            DeviceOptions{
                .physicalDevice = options_.device,
                .api = options_.api,
                .privateData = true,
                .extensions = {VK_KHR_RAY_TRACING_MAINTENANCE_1_EXTENSION_NAME, VK_EXT_MESH_SHADER_EXTENSION_NAME,
                               "VK_KHR_maintenance5", "VK_KHR_maintenance6", "VK_EXT_shader_object",
                               "VK_KHR_ray_tracing_position_fetch", VK_EXT_PIPELINE_CREATION_FEEDBACK_EXTENSION_NAME,
                               VK_EXT_PIPELINE_ROBUSTNESS_EXTENSION_NAME},
                .memory = memory});
    }
    return *device;
}

std::vector<std::string> Session::takeErrors()
{
    const std::lock_guard lock(mutex_);
    return std::exchange(errors_, {});
}

std::shared_ptr<Session> openSession(const SessionOptions &options)
{
    return std::make_shared<Session>(options);
}

} // namespace vellum::check
