// SPDX-License-Identifier: Apache-2.0
// Shared by the tests of device address commands: ranges of buffers, buffers that share memory, and commands that must
// be rejected.
#pragma once

#include <random>

#include "harness/decoys.h"
#include "harness/harness.h"

namespace vt
{

constexpr VkBufferUsageFlags kAddressed = VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;
constexpr VkAddressCommandFlagsKHR kAnyUsage = VK_ADDRESS_COMMAND_FULLY_BOUND_BIT_KHR |
                                               VK_ADDRESS_COMMAND_UNKNOWN_STORAGE_BUFFER_USAGE_BIT_KHR |
                                               VK_ADDRESS_COMMAND_UNKNOWN_TRANSFORM_FEEDBACK_BUFFER_USAGE_BIT_KHR;

inline VkDeviceAddressRangeKHR rangeOf(const Buffer &buffer, VkDeviceSize offset, VkDeviceSize size)
{
    return {buffer.address() + offset, size};
}
inline VkStridedDeviceAddressRangeKHR rangeOf(const Buffer &buffer, VkDeviceSize offset, VkDeviceSize size,
                                              VkDeviceSize stride)
{
    return {buffer.address() + offset, size, stride};
}

// Two buffers bound to the same memory, so at the same address.
class Aliases
{
public:
    Aliases(Gpu &gpu, VkDeviceSize size, VkBufferUsageFlags first, VkBufferUsageFlags second) : gpu_(gpu)
    {
        const std::array<VkBufferUsageFlags, 2> usages{first, second};
        uint32_t types = ~0u;
        VkDeviceSize bytes = 0;
        for (size_t i = 0; i < 2; ++i) {
            auto info = vkInit<VkBufferCreateInfo>({.size = size, .usage = usages[i] | kAddressed});
            VT_CHECK(vkCreateBuffer(gpu.device(), &info, nullptr, &buffers_[i]));
            VkMemoryRequirements needs;
            vkGetBufferMemoryRequirements(gpu.device(), buffers_[i], &needs);
            types &= needs.memoryTypeBits;
            bytes = std::max(bytes, needs.size);
        }
        memory_ = gpu.allocate({.size = bytes, .memoryTypeBits = types},
                               VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT);
        for (const VkBuffer buffer : buffers_)
            VT_CHECK(vkBindBufferMemory(gpu.device(), buffer, memory_, 0));
        void *mapped = nullptr;
        VT_CHECK(vkMapMemory(gpu.device(), memory_, 0, VK_WHOLE_SIZE, 0, &mapped));
        bytes_ = static_cast<uint8_t *>(mapped);
        std::memset(bytes_, 0, static_cast<size_t>(size));
    }
    Aliases(const Aliases &) = delete;
    Aliases &operator=(const Aliases &) = delete;
    ~Aliases()
    {
        destroy(0);
        destroy(1);
        vkFreeMemory(gpu_.device(), memory_, nullptr);
    }
    [[nodiscard]] VkDeviceAddress address(size_t which) const { return gpu_.address(buffers_[which]); }
    void destroy(size_t which)
    {
        vkDestroyBuffer(gpu_.device(), buffers_[which], nullptr);
        buffers_[which] = VK_NULL_HANDLE;
    }
    [[nodiscard]] VkBuffer handle(size_t which) const { return buffers_[which]; }
    [[nodiscard]] uint8_t *bytes() const { return bytes_; }

private:
    Gpu &gpu_;
    std::array<VkBuffer, 2> buffers_{};
    VkDeviceMemory memory_ = VK_NULL_HANDLE;
    uint8_t *bytes_ = nullptr;
};

class AddressTest : public GpuTest
{
protected:
    explicit AddressTest(const Options &options = {.addressCommands = true}) : GpuTest(options) {}

    Buffer buffer(VkDeviceSize size, VkBufferUsageFlags usage) { return {gpu(), size, usage | kAddressed}; }
    Buffer randomBuffer(VkDeviceSize size, VkBufferUsageFlags usage)
    {
        Buffer result = buffer(size, usage);
        for (uint8_t &byte : result.as<uint8_t>())
            byte = static_cast<uint8_t>(random_());
        return result;
    }
    static std::vector<uint8_t> bytesOf(const Buffer &buffer)
    {
        return {buffer.bytes(), buffer.bytes() + buffer.size()};
    }
    uint32_t random() { return static_cast<uint32_t>(random_()); }
    // A buffer, zeroed or random, at whose address `decoys` has another one.
    Buffer shadowed(Decoys &decoys, VkDeviceSize size, VkBufferUsageFlags usage, bool random = false)
    {
        Buffer result = random ? randomBuffer(size, usage) : buffer(size, usage);
        decoys.add(result, usage);
        return result;
    }

    // The layer rejects what is recorded, with a message that names the rule, and nothing below reports an error.
    void expectRejected(const std::string &rule, const std::function<void(VkCommandBuffer)> &record)
    {
        gpu().submit(record);
        bool reported = false;
        for (const Message &m : gpu().takeUnexpectedMessages()) {
            EXPECT_EQ(m.id, "VELLUM-VUID-" + rule) << m.text;
            reported = true;
        }
        EXPECT_TRUE(reported) << "not reported: " << rule;
    }
    // A tolerated fault: one warning, and the command is executed unless the layer is strict. Returns true if it is
    // executed.
    bool done(const std::string &rule, const std::function<void(VkCommandBuffer)> &record)
    {
        gpu().submit(record);
        const std::vector<Message> messages = gpu().takeUnexpectedMessages();
        EXPECT_EQ(messages.size(), 1u) << rule;
        for (const Message &m : messages)
            EXPECT_EQ(m.id, "VELLUM-VUID-" + rule) << m.text;
        return !strictTests();
    }
    // Every way in which a range can be wrong. `record` records a command with that range for a buffer of `size` bytes
    // with the right usage; `other` has another usage, which only a strict layer rejects. `all`: the command accesses
    // all of the range; of others, only a strict layer rejects what ends behind the buffer.
    void expectBadRangesRejected(const Buffer &good, const Buffer &other, const std::string &structure,
                                 const std::string &usageRule,
                                 const std::function<void(VkCommandBuffer, const VkDeviceAddressRangeKHR &)> &record,
                                 bool all = true)
    {
        const VkDeviceSize size = 64;
        const auto rejected = [&](const std::string &rule, const VkDeviceAddressRangeKHR &range) {
            SCOPED_TRACE(rule);
            expectRejected(rule, [&](VkCommandBuffer commands) { record(commands, range); });
        };
        rejected(structure + "-size-11411", {0, size});
        rejected(structure + "-address-11365", {0x10, size});
        rejected(structure + "-address-11365", {good.address() + good.size(), size});
        if (all || strictTests()) {
            rejected(structure + "-address-11365", {good.address() + good.size() - size + 4, size});
            rejected(structure + "-address-11365", {good.address() + 16, UINT64_MAX - 15});
        }
        if (strictTests())
            rejected(usageRule, {other.address(), size});
        VkDeviceAddress gone = 0;
        {
            const Buffer destroyed = buffer(good.size(), VK_BUFFER_USAGE_TRANSFER_SRC_BIT);
            gone = destroyed.address();
        }
        rejected(structure + "-address-11365", {gone, size});
    }

private:
    std::mt19937 random_{7};
};

} // namespace vt
