// SPDX-License-Identifier: Apache-2.0
// Buffers at the addresses of others, which the application does not use and destroys first. Commands that take
// addresses must execute as if they had never existed.
#pragma once

#include <vector>

#include "harness/harness.h"

namespace vt
{

class Decoys
{
public:
    explicit Decoys(Gpu &gpu) : gpu_(gpu) {}
    ~Decoys() { destroy(); }
    Decoys(const Decoys &) = delete;
    Decoys &operator=(const Decoys &) = delete;

    // A buffer with the memory, size, and address of another. `usage`: that of the other one, which has an address.
    void add(const Buffer &other, VkBufferUsageFlags usage, const VkAllocationCallbacks *allocator = nullptr)
    {
        auto info = vkInit<VkBufferCreateInfo>(
            {.size = other.size(), .usage = usage | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT});
        VkBuffer buffer = VK_NULL_HANDLE;
        VT_CHECK(vkCreateBuffer(gpu_.device(), &info, allocator, &buffer));
        buffers_.push_back({buffer, allocator});
        VkMemoryRequirements needs; // a validation layer requires the query
        vkGetBufferMemoryRequirements(gpu_.device(), buffer, &needs);
        VT_CHECK(vkBindBufferMemory(gpu_.device(), buffer, other.memory(), other.begin()));
        EXPECT_EQ(gpu_.address(buffer), other.address());
    }
    void destroy()
    {
        for (const auto &[buffer, allocator] : buffers_)
            vkDestroyBuffer(gpu_.device(), buffer, allocator);
        buffers_.clear();
    }

private:
    struct Decoy {
        VkBuffer buffer;
        const VkAllocationCallbacks *allocator;
    };
    Gpu &gpu_;
    std::vector<Decoy> buffers_;
};

} // namespace vt
