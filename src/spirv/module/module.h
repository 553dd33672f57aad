// SPDX-License-Identifier: Apache-2.0
// A SPIR-V module parsed into sections of instructions, to be edited and serialized. Instructions with unknown opcodes
// stay between the same known ones; before the first of a section they belong to it, not to the section before.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <span>
#include <string>
#include <vector>

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

using Id = uint32_t;

// Sections of the logical layout (SPIR-V specification, 2.4).
enum class Section : uint8_t {
    Capabilities,
    Extensions,
    Imports,
    MemoryModel,
    EntryPoints,
    ExecutionModes,
    Sources, // OpString, OpSource...
    Names,
    Processed, // OpModuleProcessed
    Decorations,
    Globals, // types, constants, module-scope variables
    Functions,
    Count
};

// An instruction: the position of its words in the module that made it. Remains valid when the module grows.
struct Instruction {
    uint32_t first = 0;
    uint16_t count = 0; // words, with the opcode's
    uint16_t opcode = 0;
};

// The operands of an instruction begin with a result type, if it has one, and a result. Unknown opcodes have neither.
struct ResultShape {
    bool hasResult = false, hasType = false;
};
ResultShape resultShape(uint32_t opcode);

// Universal limit of ids (SPIR-V specification, 2.17). It also bounds what a hostile header makes us allocate.
inline constexpr uint32_t kMaxBound = 4'194'303;
inline constexpr size_t kMaxInstructionWords = 65535;
inline constexpr const char *kTooLongInterface = "an entry point has too long an interface";

class Module
{
public:
    // Checks what this library requires: the layout of instructions in words, a limited id bound, result ids that are
    // in bounds and defined once, enough operands in every interpreted instruction, functions that begin and end.
    // Decoration groups are replaced by what they decorate. Returns nothing on failure, and sets `error`.
    static std::optional<Module> parse(Words words, std::string &error);

    std::vector<uint32_t> serialize() const;

    uint32_t version() const { return version_; }
    uint32_t bound() const { return bound_; }
    std::vector<Instruction> &section(Section s) { return sections_[static_cast<size_t>(s)]; }
    const std::vector<Instruction> &section(Section s) const { return sections_[static_cast<size_t>(s)]; }

    // Word i of an instruction; word 0 holds the opcode. 0 beyond its end.
    uint32_t word(Instruction in, uint32_t i) const { return i < in.count ? arena_[in.first + i] : 0; }
    // All of its words. Valid until the next make().
    Words words(Instruction in) const { return {arena_.data() + in.first, in.count}; }
    // The literal string that starts at word i.
    std::string string(Instruction in, uint32_t i) const;

    // Result id of an instruction, and the id of its type; 0 where it has none.
    Id result(Instruction in) const;
    Id resultType(Instruction in) const;

    // The instruction that defines an id; one with opcode 0 (OpNop) if no known instruction does.
    Instruction definition(Id id) const { return id < definitions_.size() ? definitions_[id] : Instruction{}; }
    // The id is defined outside of functions, in the module as it was parsed or by append().
    bool isGlobal(Id id) const { return id < global_.size() && global_[id]; }

    Id newId() { return bound_++; }
    // Makes an instruction that belongs to no section yet.
    Instruction make(uint32_t opcode, Words operands);
    Instruction make(uint32_t opcode, std::initializer_list<uint32_t> operands)
    {
        return make(opcode, Words(operands.begin(), operands.size()));
    }
    // Makes an instruction at the end of a section before Functions.
    void append(Section s, uint32_t opcode, Words operands);
    void append(Section s, uint32_t opcode, std::initializer_list<uint32_t> operands)
    {
        append(s, opcode, Words(operands.begin(), operands.size()));
    }
    // A copy of an instruction with one word replaced; the instruction itself where it has no word i but the first.
    Instruction with(Instruction in, uint32_t i, uint32_t value);
    // Replaces a word of the instruction itself, wherever it is used.
    void set(Instruction in, uint32_t i, uint32_t value);

    bool hasCapability(uint32_t capability) const;
    bool hasExtension(const char *name) const;
    // Adds module-scope variables to the interfaces of all entry points, where the version of SPIR-V wants that:
    // from 1.4 on an interface has all that the entry point uses. False if one gets too long.
    bool addToInterfaces(const std::vector<Id> &variables);

private:
    bool split(Words words, std::string &error);
    void moveLines();
    bool define(Instruction in, bool global, std::string &error);
    bool checkReferences(std::string &error) const;
    bool expandDecorationGroups(std::string &error);

    std::vector<uint32_t> arena_; // the parsed words, then those of new instructions
    std::array<std::vector<Instruction>, static_cast<size_t>(Section::Count)> sections_;
    std::vector<Instruction> definitions_;
    std::vector<bool> global_;
    uint32_t version_ = 0;
    uint32_t generator_ = 0;
    uint32_t bound_ = 0;
};

// Operand words of a literal string.
std::vector<uint32_t> stringWords(const char *text);

} // namespace vellum::spirv
