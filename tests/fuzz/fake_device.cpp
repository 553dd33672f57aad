// SPDX-License-Identifier: Apache-2.0
#include "fake_device.h"

#include <cstdlib>
#include <cstring>
#include <memory>
#include <string_view>
#include <utility>

#include <vulkan/vk_layer.h>

#include "check.h"
#include "layer/base/commands.h"
#include "layer/entry/instance.h"
#include "layer/micromaps/micromap_input.h"
#include "layer/structures/emulated_backend.h"

namespace vellum::fuzz
{
namespace
{

// Dispatchable handles point to these.
void *instanceHandle = &instanceHandle;
void *deviceHandle = &deviceHandle;
std::vector<std::vector<uint8_t>> memories;
uint32_t messages = 0;

template <typename Handle>
Handle handleOf(size_t i)
{
    return reinterpret_cast<Handle>(i + 1);
}

template <typename Handle>
std::vector<uint8_t> &memoryOf(Handle handle)
{
    return memories[reinterpret_cast<uintptr_t>(handle) - 1];
}

VKAPI_ATTR VkResult VKAPI_CALL fakeCreateInstance(const VkInstanceCreateInfo *, const VkAllocationCallbacks *,
                                                  VkInstance *instance)
{
    *instance = reinterpret_cast<VkInstance>(&instanceHandle);
    return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL fakeCreateDevice(VkPhysicalDevice, const VkDeviceCreateInfo *,
                                                const VkAllocationCallbacks *, VkDevice *device)
{
    *device = reinterpret_cast<VkDevice>(&deviceHandle);
    return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL fakeMapMemory(VkDevice, VkDeviceMemory memory, VkDeviceSize offset, VkDeviceSize,
                                             VkMemoryMapFlags, void **data)
{
    *data = memoryOf(memory).data() + offset;
    return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL fakeUnmapMemory(VkDevice, VkDeviceMemory) {}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL instanceCommand(VkInstance, const char *name)
{
    const std::string_view command = name;
    if (command == "vkCreateInstance")
        return reinterpret_cast<PFN_vkVoidFunction>(fakeCreateInstance);
    return command == "vkCreateDevice" ? reinterpret_cast<PFN_vkVoidFunction>(fakeCreateDevice) : nullptr;
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL deviceCommand(VkDevice, const char *name)
{
    const std::string_view command = name;
    if (command == "vkMapMemory")
        return reinterpret_cast<PFN_vkVoidFunction>(fakeMapMemory);
    return command == "vkUnmapMemory" ? reinterpret_cast<PFN_vkVoidFunction>(fakeUnmapMemory) : nullptr;
}

VKAPI_ATTR VkBool32 VKAPI_CALL countMessage(VkDebugUtilsMessageSeverityFlagBitsEXT, VkDebugUtilsMessageTypeFlagsEXT,
                                            const VkDebugUtilsMessengerCallbackDataEXT *, void *)
{
    ++messages;
    return VK_FALSE;
}

} // namespace

FakeDevice::FakeDevice()
{
    // Create information as the loader passes it, for a driver without the extension: the layer then passes everything
    // on, until micromaps are enabled below.
    VkLayerInstanceLink instanceLink{nullptr, instanceCommand, nullptr};
    VkLayerInstanceCreateInfo instanceLayer{};
    instanceLayer.sType = VK_STRUCTURE_TYPE_LOADER_INSTANCE_CREATE_INFO;
    instanceLayer.function = VK_LAYER_LINK_INFO;
    instanceLayer.u.pLayerInfo = &instanceLink;
    VkInstanceCreateInfo instanceInfo{VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO};
    instanceInfo.pNext = &instanceLayer;
    VkInstance instance = VK_NULL_HANDLE;
    setenv("VELLUM_MESSAGE_LIMIT", "0", 1); // the first message of an id counts as much as any later one
    FUZZ_CHECK(layer::createInstance(&instanceInfo, nullptr, &instance) == VK_SUCCESS);

    VkLayerDeviceLink deviceLink{nullptr, instanceCommand, deviceCommand};
    VkLayerDeviceCreateInfo deviceLayer{};
    deviceLayer.sType = VK_STRUCTURE_TYPE_LOADER_DEVICE_CREATE_INFO;
    deviceLayer.function = VK_LAYER_LINK_INFO;
    deviceLayer.u.pLayerInfo = &deviceLink;
    VkDeviceCreateInfo deviceInfo{VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO};
    deviceInfo.pNext = &deviceLayer;
    FUZZ_CHECK(layer::createDevice(reinterpret_cast<VkPhysicalDevice>(instance), &deviceInfo, nullptr, &handle_) ==
               VK_SUCCESS);
    state_ = &layer::deviceOf(handle_);
    state_->driver.enabled.hostCommands = true;
    state_->structures.backend = std::make_unique<layer::EmulatedBackend>(state_->structures);
    state_->objects.rules.ext = layer::kEmulatedSupport;
    state_->objects.rules.needs = [this](const layer::input::MicromapBuild &build) {
        return state_->structures.backend->needs(build);
    };

    VkDebugUtilsMessengerCreateInfoEXT messenger{VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT};
    messenger.messageSeverity = VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT;
    messenger.messageType = ~0u;
    messenger.pfnUserCallback = countMessage;
    state_->driver.report().addMessenger(handleOf<VkDebugUtilsMessengerEXT>(0), messenger);
}

VkBuffer FakeDevice::makeBuffer(size_t size)
{
    const size_t i = memories.size();
    memories.emplace_back(size);
    const auto buffer = handleOf<VkBuffer>(i);
    const auto memory = handleOf<VkDeviceMemory>(i);
    state_->buffers.host.allocated(memory, size,
                                   VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT);
    state_->buffers.host.bound(buffer, memory, 0);
    layer::BufferInfo info{};
    info.size = size;
    state_->buffers.infos.set(buffer, info);
    return buffer;
}

std::vector<uint8_t> &FakeDevice::bytes(VkBuffer buffer)
{
    return memoryOf(buffer);
}

void FakeDevice::clear()
{
    for (size_t i = 0; i < memories.size(); ++i) {
        state_->buffers.host.destroyed(handleOf<VkBuffer>(i));
        state_->buffers.host.freed(handleOf<VkDeviceMemory>(i), state_->buffers.addresses);
        state_->buffers.infos.take(handleOf<VkBuffer>(i));
    }
    memories.clear();
}

uint32_t FakeDevice::takeMessages()
{
    return std::exchange(messages, 0);
}

} // namespace vellum::fuzz
