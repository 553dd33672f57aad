// SPDX-License-Identifier: Apache-2.0
// Visits the words of SPIR-V, instruction by instruction, without parsing it as a Module (module.h).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "spirv/module/numbers.h"

namespace vellum::spirv
{

using Words = std::span<const uint32_t>;

inline constexpr size_t kHeaderWords = 5;
inline constexpr uint32_t kVersion14 = 0x00010400;
inline constexpr uint32_t kVersion15 = 0x00010500;

inline bool isSpirv(Words words)
{
    return words.size() >= kHeaderWords && words[0] == spv::MagicNumber;
}

inline uint32_t opcodeOf(Words instruction)
{
    return instruction[0] & 0xffff;
}

// Calls visit(words of an instruction) for each instruction until it returns false. Returns the beginning of the first
// instruction that was not accepted, or is incomplete.
template <typename Visit>
size_t visitInstructions(Words words, Visit visit)
{
    size_t at = kHeaderWords;
    while (at < words.size()) {
        const size_t count = words[at] >> 16;
        if (count == 0 || count > words.size() - at || !visit(words.subspan(at, count)))
            break;
        at += count;
    }
    return at;
}

// The literal string that the words begin with.
inline std::string textOf(Words words)
{
    std::string text;
    for (const uint32_t word : words)
        for (uint32_t shift = 0; shift < 32; shift += 8) {
            const char c = static_cast<char>(word >> shift & 0xff);
            if (c == 0)
                return text;
            text += c;
        }
    return text;
}

} // namespace vellum::spirv
