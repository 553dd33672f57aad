// SPDX-License-Identifier: Apache-2.0
// A device for the layer's host commands that consists of memory to map. Everything else of Vulkan is missing.
#pragma once

#include <cstdint>
#include <vector>

#include "layer/entry/device.h"

namespace vellum::fuzz
{

class FakeDevice
{
public:
    FakeDevice();
    [[nodiscard]] VkDevice handle() const { return handle_; }
    [[nodiscard]] layer::DeviceMicromaps &micromaps() const { return state_->micromaps; }

    // A buffer with memory of its own, so that AddressSanitizer sees where it ends.
    VkBuffer makeBuffer(size_t size);
    static std::vector<uint8_t> &bytes(VkBuffer buffer);
    // Forgets all buffers.
    void clear();

    // Number of messages since the last call.
    static uint32_t takeMessages();

private:
    VkDevice handle_ = VK_NULL_HANDLE;
    layer::Device *state_ = nullptr;
};

} // namespace vellum::fuzz
