// SPDX-License-Identifier: Apache-2.0
#include "check/gpu/execution_mode.h"

#include <cstring>
#include <stdexcept>

namespace vellum::check
{

std::vector<uint32_t> withMode(std::span<const uint32_t> words, Mode mode)
{
    constexpr uint32_t kCapability = 17, kEntryPoint = 15, kDecorate = 71, kTypeBool = 20, kTypeVoid = 19;
    constexpr uint32_t kSource = 3, kExecutionModeId = 331, kFalse = 42, kTrue = 41, kSpecFalse = 49;
    std::vector<uint32_t> out(words.begin(), words.begin() + 5);
    if (mode == Mode::Absent)
        return {words.begin(), words.end()};
    const uint32_t constant = out[3]++;
    uint32_t function = 0;
    bool begun = false, decorated = mode != Mode::Specialized;
    const auto put = [&out](uint32_t opcode, std::initializer_list<uint32_t> operands) {
        out.push_back(static_cast<uint32_t>(operands.size() + 1) << 16 | opcode);
        out.insert(out.end(), operands);
    };
    put(kCapability, {6032});
    bool named = false;
    for (size_t at = 5; at < words.size(); at += words[at] >> 16) {
        const uint32_t opcode = words[at] & 0xffff;
        if (opcode != kCapability && !named) {
            // OpExtension "SPV_KHR_opacity_micromap"
            constexpr char kExtension[24 + 4] = "SPV_KHR_opacity_micromap";
            out.push_back((1 + sizeof(kExtension) / 4) << 16 | 10);
            out.resize(out.size() + sizeof(kExtension) / 4);
            std::memcpy(&out[out.size() - sizeof(kExtension) / 4], kExtension, sizeof(kExtension));
            named = true;
        }
        if (opcode == kEntryPoint)
            function = words[at + 2];
        if (opcode == kSource && !begun) {
            put(kExecutionModeId, {function, 6031, constant});
            begun = true;
        }
        if (opcode == kTypeVoid && !decorated) {
            put(kDecorate, {constant, 1 /* SpecId */, 0});
            decorated = true;
        }
        out.insert(out.end(), words.begin() + static_cast<ptrdiff_t>(at),
                   words.begin() + static_cast<ptrdiff_t>(at + (words[at] >> 16)));
        if (opcode == kTypeBool)
            put(mode == Mode::True ? kTrue : mode == Mode::False ? kFalse : kSpecFalse, {words[at + 1], constant});
    }
    if (!begun || !decorated)
        throw std::runtime_error("a module that the execution mode cannot be put into");
    return out;
}

std::vector<uint32_t> withModeWhereNeeded(std::span<const uint32_t> words)
{
    constexpr uint32_t kRayQuery = 4472, kExecutionMode = 6032;
    bool queries = false, declared = false;
    for (size_t at = 5; at < words.size() && words[at] == (2u << 16 | 17u); at += 2) {
        queries = queries || words[at + 1] == kRayQuery;
        declared = declared || words[at + 1] == kExecutionMode;
    }
    return withMode(words, queries && !declared ? Mode::True : Mode::Absent);
}

} // namespace vellum::check
