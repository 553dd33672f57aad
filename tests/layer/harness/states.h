// SPDX-License-Identifier: Apache-2.0
// Random states for micromaps, the same in every run, and the memory of compacted micromaps.
#pragma once

#include <cstdint>
#include <vector>

#include "core/micromap_memory.h"
#include "gpu/scene.h"
#include "harness/harness.h"

namespace vt
{

// xorshift32
class Random
{
public:
    explicit Random(uint32_t seed) : state_(seed * 2654435761u + 1u) {}
    uint32_t operator()()
    {
        state_ ^= state_ << 13;
        state_ ^= state_ >> 17;
        state_ ^= state_ << 5;
        return state_;
    }

private:
    uint32_t state_;
};

// Whole runs of one state, so that sub-triangles of every kind come up.
inline std::vector<uint8_t> randomStates(Random &random, uint32_t level, uint16_t format)
{
    std::vector<uint8_t> states(size_t{1} << (2 * level));
    const uint32_t limit = format == kTwoState ? 2 : 4;
    for (size_t i = 0; i < states.size();) {
        const auto state = static_cast<uint8_t>((random() >> 8) % limit);
        size_t run = size_t{1} << (random() >> 8) % (2 * level + 1);
        for (; run > 0 && i < states.size(); --run)
            states[i++] = state;
    }
    return states;
}

// The compacted copy of the emulation's micromap at `memory`, as the host makes it.
inline std::vector<uint8_t> compactedMemory(const uint8_t *memory)
{
    const vellum::CompactedMicromap copy(memory);
    std::vector<uint8_t> bytes(copy.bytes());
    copy.write(bytes.data());
    return bytes;
}

} // namespace vt
