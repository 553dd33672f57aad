// A command buffer that is recorded, submitted and waited for while the device is being made: what can only be found
// out about a driver by trying is tried there, on a queue of the application that nobody has yet.
#pragma once

#include <vulkan/vk_layer.h>
#include <vulkan/vulkan.h>

namespace vellum::layer
{

struct Driver;

class StartUpCommands
{
public:
    explicit StartUpCommands(const Driver &driver) : driver_(driver) {}
    ~StartUpCommands();
    StartUpCommands(const StartUpCommands &) = delete;
    StartUpCommands &operator=(const StartUpCommands &) = delete;

    // Chooses a queue that can run compute shaders. False where the application asked for none. `info` as the
    // application passed it to vkCreateDevice.
    bool chooseQueue(const VkDeviceCreateInfo &info);
    // On the chosen queue. False where the driver fails, or there is no callback.
    bool begin(PFN_vkSetDeviceLoaderData setLoaderData);
    // Returns whether everything was carried out.
    bool submitAndWait();
    [[nodiscard]] VkCommandBuffer handle() const { return commands_; }

private:
    const Driver &driver_;
    uint32_t family_ = 0;
    VkDeviceQueueCreateFlags flags_ = 0;
    VkQueue queue_ = VK_NULL_HANDLE;
    VkCommandPool pool_ = VK_NULL_HANDLE;
    VkCommandBuffer commands_ = VK_NULL_HANDLE;
};

} // namespace vellum::layer
