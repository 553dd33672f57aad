// SPDX-License-Identifier: Apache-2.0
#include "gpu/execution_mode.h"

#include <cstring>
#include <initializer_list>
#include <map>
#include <set>
#include <stdexcept>

namespace vellum::gpu
{

namespace
{

constexpr size_t kHeader = 5; // words before the first instruction
constexpr uint32_t kSource = 3, kExtension = 10, kEntryPoint = 15, kExecutionMode = 16, kCapability = 17,
                   kTypeVoid = 19, kTypeBool = 20, kTypeInt = 21, kTrue = 41, kFalse = 42, kConstant = 43,
                   kSpecFalse = 49, kSpecConstant = 50, kSpecOperation = 52, kFunction = 54, kFunctionEnd = 56,
                   kFunctionCall = 57, kDecorate = 71, kBitcast = 124, kLogicalAnd = 167, kLogicalNot = 168,
                   kSelect = 169, kEqual = 170, kLabel = 248, kReturn = 253, kExecutionModeId = 331;
constexpr uint32_t kSpecId = 1; // a decoration

// The word of the ray flags in an instruction; 0: it has none.
uint32_t flagsOf(uint32_t opcode)
{
    constexpr uint32_t kTraceRay = 4445, kInitialize = 4473;
    return opcode == kTraceRay ? 2 : opcode == kInitialize ? 3 : 0;
}

// An instruction
void put(std::vector<uint32_t> &out, uint32_t opcode, std::initializer_list<uint32_t> operands)
{
    out.push_back(static_cast<uint32_t>(operands.size() + 1) << 16 | opcode);
    out.insert(out.end(), operands);
}

// OpExtension
template <size_t kSize>
void putExtension(std::vector<uint32_t> &out, const char (&name)[kSize])
{
    constexpr size_t kWords = kSize / 4 + 1;
    out.push_back((1 + kWords) << 16 | kExtension);
    out.resize(out.size() + kWords);
    std::memcpy(&out[out.size() - kWords], name, kSize);
}

} // namespace

std::vector<uint32_t> withMode(std::span<const uint32_t> words, Mode mode, uint32_t specId)
{
    std::vector<uint32_t> out(words.begin(), words.begin() + kHeader);
    if (mode == Mode::Absent)
        return {words.begin(), words.end()};
    const bool computed = mode == Mode::Computed;
    const uint32_t constant = out[3]++;
    // Of the computation.
    const uint32_t one = computed ? out[3]++ : constant, other = computed ? out[3]++ : 0,
                   inverse = computed ? out[3]++ : 0;
    uint32_t function = 0;
    bool begun = false, decorated = mode != Mode::Specialized && !computed;
    put(out, kCapability, {6032});
    bool named = false;
    for (size_t at = kHeader; at < words.size(); at += words[at] >> 16) {
        const uint32_t opcode = words[at] & 0xffff;
        if (opcode != kCapability && !named) {
            putExtension(out, "SPV_KHR_opacity_micromap");
            named = true;
        }
        if (opcode == kEntryPoint)
            function = words[at + 2];
        if (opcode == kSource && !begun) {
            put(out, kExecutionModeId, {function, 6031, constant});
            begun = true;
        }
        if (opcode == kTypeVoid && !decorated) {
            put(out, kDecorate, {one, kSpecId, specId});
            if (computed)
                put(out, kDecorate, {other, kSpecId, specId + 1});
            decorated = true;
        }
        out.insert(out.end(), words.begin() + static_cast<ptrdiff_t>(at),
                   words.begin() + static_cast<ptrdiff_t>(at + (words[at] >> 16)));
        if (opcode != kTypeBool)
            continue;
        const uint32_t type = words[at + 1];
        put(out, mode == Mode::True ? kTrue : mode == Mode::False ? kFalse : kSpecFalse, {type, one});
        if (computed) {
            put(out, kSpecFalse, {type, other});
            put(out, kSpecOperation, {type, inverse, kLogicalNot, other});
            put(out, kSpecOperation, {type, constant, kLogicalAnd, one, inverse});
        }
    }
    if (!begun || !decorated)
        throw std::runtime_error("a module that the execution mode cannot be put into");
    return out;
}

std::vector<uint32_t> withOtherEntry(std::span<const uint32_t> words, Mode mode, OtherEntry kind)
{
    std::vector<uint32_t> out(words.begin(), words.begin() + kHeader);
    const bool shared = kind != OtherEntry::Empty, after = kind == OtherEntry::SharedAfter;
    const uint32_t added = out[3], constant = added + 1, body = shared ? added + 2 : added;
    out[3] += 3;
    uint32_t main = 0, other = 0; // the functions of the two entry points: one is new, one has the id of the first
    std::vector<uint32_t> wrappers, modes;
    for (size_t at = kHeader; at < words.size(); at += words[at] >> 16) {
        const uint32_t opcode = words[at] & 0xffff;
        std::vector<uint32_t> in(words.begin() + static_cast<ptrdiff_t>(at),
                                 words.begin() + static_cast<ptrdiff_t>(at + (words[at] >> 16)));
        if (opcode == kEntryPoint) {
            main = after ? in[2] : added;
            other = after ? added : in[2];
            std::vector<uint32_t> entry{0, in[1], other, 'o' | 't' << 8 | 'h' << 16 | 'e' << 24, 'r'};
            // The variables that both use follow the name "main".
            if (shared)
                entry.insert(entry.end(), in.begin() + 5, in.end());
            entry[0] = static_cast<uint32_t>(entry.size()) << 16 | kEntryPoint;
            in[2] = main;
            if (after)
                entry.swap(in);
            out.insert(out.end(), entry.begin(), entry.end());
        } else if (opcode == kExecutionMode || opcode == kExecutionModeId) {
            if (opcode == kExecutionMode) {
                modes.insert(modes.end(), {in[0], other});
                modes.insert(modes.end(), in.begin() + 2, in.end());
            }
            in[1] = main;
        } else if (opcode == kSource) {
            if (mode != Mode::Absent)
                put(modes, kExecutionModeId, {other, 6031, constant});
            out.insert(out.end(), modes.begin(), modes.end());
        } else if (opcode == kFunction && (in[2] == main || in[2] == other)) {
            const auto putFunction = [&](uint32_t function) {
                put(wrappers, kFunction, {in[1], function, 0, in[4]});
                put(wrappers, kLabel, {out[3]++});
                if (shared)
                    put(wrappers, kFunctionCall, {in[1], out[3]++, body});
                put(wrappers, kReturn, {});
                put(wrappers, kFunctionEnd, {});
            };
            putFunction(other);
            if (shared)
                putFunction(main);
            in[2] = body;
        }
        out.insert(out.end(), in.begin(), in.end());
        if (opcode == kTypeBool && mode != Mode::Absent)
            put(out, mode == Mode::True ? kTrue : kFalse, {in[1], constant});
    }
    out.insert(out.end(), wrappers.begin(), wrappers.end());
    return out;
}

std::vector<uint32_t> withModeWhereNeeded(std::span<const uint32_t> words)
{
    constexpr uint32_t kRayQuery = 4472, kExecutionMode = 6032;
    bool queries = false, declared = false;
    for (size_t at = kHeader; at < words.size() && words[at] == (2u << 16 | 17u); at += 2) {
        queries = queries || words[at + 1] == kRayQuery;
        declared = declared || words[at + 1] == kExecutionMode;
    }
    return withMode(words, queries && !declared ? Mode::True : Mode::Absent);
}

std::vector<uint32_t> withMicromapFlag(std::span<const uint32_t> words)
{
    constexpr uint32_t kMicromapFlag = 5381; // RayTracingOpacityMicromapEXT
    std::vector<uint32_t> out(words.begin(), words.begin() + kHeader);
    size_t at = kHeader;
    for (; (words[at] & 0xffff) == kCapability; at += words[at] >> 16) {
        if (words[at + 1] == kMicromapFlag)
            return {words.begin(), words.end()};
        out.insert(out.end(), {words[at], words[at + 1]});
    }
    out.insert(out.end(), {2u << 16 | kCapability, kMicromapFlag});
    putExtension(out, "SPV_EXT_opacity_micromap");
    out.insert(out.end(), words.begin() + static_cast<ptrdiff_t>(at), words.end());
    return out;
}

std::vector<uint32_t> withPrimitiveCulling(std::span<const uint32_t> words)
{
    constexpr uint32_t kPrimitiveCulling = 4478; // RayTraversalPrimitiveCullingKHR
    std::vector<uint32_t> out(words.begin(), words.begin() + kHeader);
    put(out, kCapability, {kPrimitiveCulling});
    out.insert(out.end(), words.begin() + kHeader, words.end());
    return out;
}

std::vector<uint32_t> withLiteral(std::span<const uint32_t> words, uint32_t specId, uint32_t value)
{
    std::vector<uint32_t> out(words.begin(), words.begin() + kHeader);
    uint32_t constant = 0;
    for (size_t at = kHeader; at < words.size(); at += words[at] >> 16) {
        const std::span<const uint32_t> instruction = words.subspan(at, words[at] >> 16);
        const uint32_t opcode = instruction[0] & 0xffff;
        if (opcode == kDecorate && instruction[2] == kSpecId && instruction[3] == specId)
            constant = instruction[1];
        else if (opcode == kSpecConstant && instruction[2] == constant)
            out.insert(out.end(), {4u << 16 | kConstant, instruction[1], constant, value});
        else
            out.insert(out.end(), instruction.begin(), instruction.end());
    }
    if (constant == 0)
        throw std::runtime_error("a module without the specialization constant");
    return out;
}

std::vector<uint32_t> withSignedFlags(std::span<const uint32_t> words)
{
    uint32_t type = 0;
    std::map<uint32_t, uint32_t> values;         // of ordinary constants of 32 bits
    std::map<uint32_t, uint32_t> signedConstant; // the constants that are flags
    for (size_t at = kHeader; at < words.size(); at += words[at] >> 16) {
        const std::span<const uint32_t> in = words.subspan(at, words[at] >> 16);
        const uint32_t opcode = in[0] & 0xffff;
        if (opcode == kTypeInt && in[2] == 32 && in[3] == 1)
            type = in[1];
        else if (opcode == kConstant && in.size() == 4)
            values[in[2]] = in[3];
        else if (flagsOf(opcode) != 0 && values.contains(in[flagsOf(opcode)]))
            signedConstant[in[flagsOf(opcode)]] = 0;
    }
    if (type == 0)
        throw std::runtime_error("a module without the type of signed integers");
    std::vector<uint32_t> out(words.begin(), words.begin() + kHeader);
    bool declared = false;
    for (size_t at = kHeader; at < words.size(); at += words[at] >> 16) {
        std::vector<uint32_t> in(words.begin() + static_cast<ptrdiff_t>(at),
                                 words.begin() + static_cast<ptrdiff_t>(at + (words[at] >> 16)));
        const uint32_t opcode = in[0] & 0xffff;
        if (opcode == kFunction && !declared) {
            for (auto &[from, to] : signedConstant) {
                to = out[3]++;
                out.insert(out.end(), {4u << 16 | kConstant, type, to, values.at(from)});
            }
            declared = true;
        }
        if (const uint32_t place = flagsOf(opcode); place != 0) {
            const auto constant = signedConstant.find(in[place]);
            if (constant == signedConstant.end())
                out.insert(out.end(), {4u << 16 | kBitcast, type, out[3], in[place]});
            in[place] = constant == signedConstant.end() ? out[3]++ : constant->second;
        }
        out.insert(out.end(), in.begin(), in.end());
    }
    return out;
}

std::vector<uint32_t> withSelectedFlags(std::span<const uint32_t> words, uint32_t first, uint32_t second)
{
    std::vector<uint32_t> out(words.begin(), words.begin() + kHeader);
    const uint32_t constants = out[3];
    out[3] += 2;
    uint32_t boolean = 0, type = 0;
    std::set<uint32_t> known; // ids of ordinary constants
    bool declared = false;
    for (size_t at = kHeader; at < words.size(); at += words[at] >> 16) {
        std::vector<uint32_t> in(words.begin() + static_cast<ptrdiff_t>(at),
                                 words.begin() + static_cast<ptrdiff_t>(at + (words[at] >> 16)));
        const uint32_t opcode = in[0] & 0xffff;
        if (opcode == kTypeBool)
            boolean = in[1];
        else if (opcode == kTypeInt && in[2] == 32 && in[3] == 0)
            type = in[1];
        else if (opcode == kConstant)
            known.insert(in[2]);
        if (opcode == kFunction && !declared) {
            if (boolean == 0 || type == 0)
                throw std::runtime_error("a module without the types that a selection needs");
            put(out, kConstant, {type, constants, first});
            put(out, kConstant, {type, constants + 1, second});
            declared = true;
        }
        if (const uint32_t place = flagsOf(opcode); place != 0 && !known.contains(in[place])) {
            const uint32_t equal = out[3]++, selected = out[3]++;
            put(out, kEqual, {boolean, equal, in[place], constants});
            put(out, kSelect, {type, selected, equal, constants, constants + 1});
            in[place] = selected;
        }
        out.insert(out.end(), in.begin(), in.end());
    }
    return out;
}

} // namespace vellum::gpu
