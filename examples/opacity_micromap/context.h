// SPDX-License-Identifier: Apache-2.0
// The Vulkan that both programs share: device, buffers, commands, acceleration structures, and the rays.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include <vulkan/vulkan.h>

// Throws std::runtime_error if `result` is an error.
void check(VkResult result, const char *function);

struct Buffer {
    VkBuffer buffer = VK_NULL_HANDLE;
    VkDeviceMemory memory = VK_NULL_HANDLE;
    VkDeviceAddress address = 0; // of the data: a multiple of 256, not always the buffer's own address
    void *data = nullptr;        // the data as the host sees it; null in device memory
};

// The counters of rays.comp.
struct Counts {
    uint32_t passed = 0;     // rays that hit nothing
    uint32_t candidates = 0; // alpha tests that the shader did
    uint32_t wrong = 0;      // rays that the micromap sent another way than the texture does
};

class Context
{
public:
    // Creates a device with ray queries and `extensions`. `features` starts a pNext chain for VkDeviceCreateInfo.
    Context(std::vector<const char *> extensions, void *features);
    ~Context();
    Context(const Context &) = delete;
    Context &operator=(const Context &) = delete;

    [[nodiscard]] VkDevice device() const { return device_; }
    [[nodiscard]] VkPhysicalDevice physicalDevice() const { return physicalDevice_; }
    [[nodiscard]] std::string deviceName() const;

    // Commands of extensions are not exported by the loader.
    template <typename Function>
    [[nodiscard]] Function load(const char *name) const
    {
        return reinterpret_cast<Function>(vkGetDeviceProcAddr(device_, name));
    }

    // The context owns all buffers and acceleration structures.
    Buffer createBuffer(VkDeviceSize size, VkBufferUsageFlags usage, bool forHost = false);
    template <typename T>
    Buffer upload(std::span<const T> values, VkBufferUsageFlags usage)
    {
        return uploadBytes(std::as_bytes(values), usage);
    }

    // Records commands, submits them and waits.
    void submit(const std::function<void(VkCommandBuffer)> &record);

    // Builds a bottom level of the card. `opacityMicromap` is chained to its triangles.
    VkDeviceAddress buildCard(const void *opacityMicromap);
    // Builds a top level with one instance of `bottomLevel`, traces width x height rays through it and counts.
    Counts trace(VkDeviceAddress bottomLevel, uint32_t width, uint32_t height, std::span<const float> alpha);

    void onDestroy(std::function<void()> destroy) { destroy_.push_back(std::move(destroy)); }

private:
    void createInstance();
    void choosePhysicalDevice(const std::vector<const char *> &extensions);
    void createDevice(const std::vector<const char *> &extensions, void *features);
    Buffer uploadBytes(std::span<const std::byte> bytes, VkBufferUsageFlags usage);
    VkDeviceAddress buildStructure(VkAccelerationStructureTypeKHR type,
                                   const VkAccelerationStructureGeometryKHR &geometry, uint32_t primitives);

    VkInstance instance_ = VK_NULL_HANDLE;
    VkPhysicalDevice physicalDevice_ = VK_NULL_HANDLE;
    VkDevice device_ = VK_NULL_HANDLE;
    VkQueue queue_ = VK_NULL_HANDLE;
    VkCommandPool commandPool_ = VK_NULL_HANDLE;
    VkDeviceSize alignment_ = 256;
    std::vector<std::function<void()>> destroy_; // last one first
};
