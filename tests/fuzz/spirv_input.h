// SPDX-License-Identifier: Apache-2.0
// An input of the rewriter's fuzz target is a module as it lies in a file. The options to rewrite it with are in its
// header, in the word that names the generator, which means nothing to the rewriter: so the modules of the other tests
// are inputs as they are, and what is found can be looked at with the usual tools.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "spirv/module/scan.h"
#include "spirv/rewrite.h"

namespace vellum::fuzz
{

inline constexpr size_t kHeaderWords = 5;
inline constexpr size_t kOptionsWord = 2;

// Bits of the options.
inline constexpr uint32_t kQueriesKeepConstants = 1; // constant ray flags like others
inline constexpr uint32_t kInPayload = 2;            // hidden flags lie in the payload
inline constexpr uint32_t kInPipeline = 4;           // for a stage of a pipeline
inline constexpr uint32_t kPrologueShift = 3;        // two bits, Prologue
inline constexpr uint32_t kEntryPointShift = 5;      // two bits, which one
inline constexpr uint32_t kOtherStage = 0x80;        // its entry point has another execution model
inline constexpr uint32_t kNoEntryPoint = 0x100;     // of a name that the module does not have
inline constexpr uint32_t kConstantFlags = 0x200;    // all rays have the same hidden flags
inline constexpr uint32_t kQueriesDeclare = 0x400;   // ray queries need the execution mode to use micromaps
inline constexpr uint32_t kEitherHits = 0x800;       // for a library: Prologue::EitherHits, whatever the two bits
inline constexpr uint32_t kAllOptions = 0xfff;

struct SpirvInput {
    spirv::RewriteOptions options;
    std::string entryPoint; // named by the options
    uint32_t model = 0;     // execution model of that entry point
};

// The options that a module carries. `input` must stay where it is.
inline void readOptions(std::span<const uint32_t> words, SpirvInput &input)
{
    const uint32_t bits = words.size() > kOptionsWord ? words[kOptionsWord] : 0;
    input.options = {.rootAddress = 0xfedcba9876543210, .firstSlots = 0x0123456789abcde0};
    input.options.constantQueryFlags = (bits & kQueriesKeepConstants) == 0;
    if ((bits & kQueriesDeclare) != 0)
        input.options.queriesConsume = spirv::QueriesConsume::WhereDeclared;
    uint32_t skip = bits >> kEntryPointShift & 3;
    uint32_t model = 5313;
    constexpr uint32_t kOpEntryPoint = 15;
    for (size_t at = kHeaderWords; at + 3 < words.size(); at += words[at] >> 16) {
        if (words[at] >> 16 == 0)
            break;
        if ((words[at] & 0xffff) != kOpEntryPoint)
            continue;
        model = words[at + 1];
        input.entryPoint.clear();
        for (size_t i = (at + 3) * 4; i < words.size() * 4; ++i) {
            const char c = static_cast<char>(words[i / 4] >> (i % 4 * 8));
            if (c == 0)
                break;
            input.entryPoint += c;
        }
        if (skip-- == 0)
            break;
    }
    if ((bits & kNoEntryPoint) != 0)
        input.entryPoint += "?";
    if ((bits & kOtherStage) != 0)
        ++model;
    input.model = model;
    if ((bits & kInPipeline) == 0)
        return;
    const uint32_t constant = (bits & kConstantFlags) != 0 ? 0x481 : 0;
    const uint32_t fixed = (bits & kInPayload) != 0 ? 0x80 : 0x481;
    const spirv::HiddenFlags hidden{fixed, constant & fixed};
    // by position, so that inputs keep their meaning
    constexpr std::array prologues{spirv::Prologue::None, spirv::Prologue::TriangleHits, spirv::Prologue::BoxHits,
                                   spirv::Prologue::BoxCulling};
    const spirv::Prologue prologue =
        (bits & kEitherHits) != 0 ? spirv::Prologue::EitherHits : prologues[bits >> kPrologueShift & 3];
    input.options.pipelineStage = {input.entryPoint, model, prologue, hidden};
}

} // namespace vellum::fuzz
