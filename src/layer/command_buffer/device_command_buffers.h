// SPDX-License-Identifier: Apache-2.0
// The subsystem of command buffers: their state, GPU work that the layer adds, synchronization, probes of the driver,
// and deferred operations.
#pragma once

#include <functional>
#include <memory>

#include "layer/command_buffer/command_state.h"
#include "layer/command_buffer/deferred_operation.h"
#include "layer/command_buffer/driver_probe.h"
#include "layer/command_buffer/injected_work.h"
#include "layer/memory/device_buffers.h"

namespace vellum::layer
{

struct DeviceCommandBuffers {
    Driver &driver;
    DeviceBuffers &buffers;
    InjectedPipelines injected{};
    CommandStates states{};
    HandleMap<VkDeferredOperationKHR, std::shared_ptr<DeferredOperation>> deferredOperations{};
    std::function<void()> onBegin = [] {}; // called when a command buffer begins
    ProbeQueue probes{};                   // destroyed first: unfinished probes may use the other members
};

// The stage that the driver gets in commands that take exactly one (synchronization.cpp).
VkPipelineStageFlags2 driverStage(VkPipelineStageFlags2 stage);

// A command after which shaders find descriptors in heaps, or in descriptor sets and descriptor buffers.
template <auto command, bool heaps>
struct DescriptorCommand;
template <typename... Arguments, void (VKAPI_PTR *DeviceTable::*command)(VkCommandBuffer, Arguments...), bool heaps>
struct DescriptorCommand<command, heaps> {
    static void call(DeviceCommandBuffers &device, VkCommandBuffer commandBuffer, Arguments... arguments)
    {
        device.states.setHeaps(commandBuffer, heaps);
        (device.driver.next.*command)(commandBuffer, arguments...);
    }
};
template <auto command>
inline constexpr auto enterHeaps = &DescriptorCommand<command, true>::call;
template <auto command>
inline constexpr auto leaveHeaps = &DescriptorCommand<command, false>::call;

} // namespace vellum::layer
