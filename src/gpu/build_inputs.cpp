// SPDX-License-Identifier: Apache-2.0
#include "gpu/build_inputs.h"

#include <algorithm>
#include <cstring>
#include <utility>

namespace vellum::gpu
{

std::shared_ptr<Guarded> BuildInputs::upload(const void *content, VkDeviceSize size, VkBufferUsageFlags usage,
                                             VkDeviceSize alignment)
{
    const std::lock_guard lock(mutex_);
    std::erase_if(shared_, [](const Piece &piece) { return piece.memory.expired(); });
    const std::span bytes(static_cast<const uint8_t *>(content), static_cast<size_t>(size));
    for (const Piece &piece : shared_) {
        const std::shared_ptr<Guarded> memory = piece.memory.lock();
        if (memory && piece.usage == usage && piece.content.size() >= bytes.size() &&
            std::equal(bytes.begin(), bytes.end(), piece.content.begin()) && memory->address() % alignment == 0)
            return memory;
    }
    auto memory = std::make_shared<Guarded>(uploadAligned(gpu_, content, size, usage, alignment));
    if (plan_.aliased)
        memory->alias(gpu_, usage);
    if (plan_.shared)
        shared_.push_back({{bytes.begin(), bytes.end()}, usage, memory});
    if (plan_.late && memory->bytes() != nullptr) {
        late_.push_back({{bytes.begin(), bytes.end()}, usage, memory});
        std::memset(memory->bytes(), 0x5a, bytes.size());
    }
    return memory;
}

void BuildInputs::write()
{
    const std::lock_guard lock(mutex_);
    for (const Piece &piece : std::exchange(late_, {}))
        if (const std::shared_ptr<Guarded> memory = piece.memory.lock())
            memory->write(0, piece.content.data(), piece.content.size());
}

} // namespace vellum::gpu
