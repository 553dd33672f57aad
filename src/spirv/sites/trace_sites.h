// SPDX-License-Identifier: Apache-2.0
// The instructions of an entry point that trace rays: which descriptor their acceleration structure comes from, and a
// mark in memory that each sets when it is executed. For validation.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

namespace vellum::spirv
{

// The descriptor of an acceleration structure, as far as the module shows it.
struct StructureBinding {
    uint32_t set = 0;
    uint32_t binding = 0;
    std::optional<uint32_t> element; // nothing: an index that is computed
    bool operator==(const StructureBinding &) const = default;
};

struct TraceSite {
    bool query = false;                      // OpRayQueryInitializeKHR; otherwise a ray of a pipeline
    std::optional<StructureBinding> binding; // nothing: by an address, or in another way that is not followed
    std::optional<uint32_t> cullMask{};      // 8 bits; nothing: it is computed
    bool operator==(const TraceSite &) const = default;
};

struct StageName {
    std::string_view entryPoint;
    uint32_t executionModel = 0; // SPIR-V's
};

// The sites that the entry point reaches, in the order of the module. Empty for words that are malformed.
std::vector<TraceSite> traceSites(std::span<const uint32_t> words, const StageName &stage);

// The module, in which site i of the entry point stores 1 in the 32-bit word `marks[i]` of the buffer at `address`,
// before it traces. UINT32_MAX: it stores nothing. Empty if the module cannot be changed.
std::vector<uint32_t> markTraces(std::span<const uint32_t> words, const StageName &stage, uint64_t address,
                                 std::span<const uint32_t> marks);

} // namespace vellum::spirv
