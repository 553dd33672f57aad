// SPIR-V as words, instruction by instruction: for what need not be taken apart (module.h).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "spirv/module/opcodes.h"

namespace vellum::spirv
{

using Words = std::span<const uint32_t>;

inline constexpr size_t kHeaderWords = 5;

inline bool isSpirv(Words words)
{
    return words.size() >= kHeaderWords && words[0] == spv::MagicNumber;
}

inline uint32_t opcodeOf(Words instruction)
{
    return instruction[0] & 0xffff;
}

// Calls visit(words of an instruction) for one after the other until it returns false. Returns where the first one
// begins that was not visited, or is cut short.
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
