// SPDX-License-Identifier: Apache-2.0
// The memory of what builds read, in arrangements that an application may choose.
#pragma once

#include "gpu/arena.h"

#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

namespace vellum::gpu
{

class BuildInputs
{
public:
    struct Plan {
        bool shared = false;  // content that other content begins with has no memory of its own
        bool aliased = false; // a second buffer has the first half of each piece of memory
        bool late = false;    // memory has its content from write() on, and garbage before
    };

    BuildInputs(Device &gpu, Plan plan) : gpu_(gpu), plan_(plan) {}
    // Memory that begins with the content, and is freed when nobody holds it.
    std::shared_ptr<Guarded> upload(const void *content, VkDeviceSize size, VkBufferUsageFlags usage,
                                    VkDeviceSize alignment);
    // Writes what is not written yet. Called when commands are recorded, before they are submitted.
    void write();

private:
    struct Piece {
        std::vector<uint8_t> content;
        VkBufferUsageFlags usage = 0;
        std::weak_ptr<Guarded> memory;
    };

    Device &gpu_;
    Plan plan_;
    std::mutex mutex_;
    std::vector<Piece> shared_, late_;
};

} // namespace vellum::gpu
