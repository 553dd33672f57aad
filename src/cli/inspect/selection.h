// SPDX-License-Identifier: Apache-2.0
// Which triangles of a file are inspected.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace vellum::cli
{

// Numbers from `first` to `last`, both included.
struct NumberRange {
    uint32_t first = 0;
    uint32_t last = 0;
};

// "7", "3-9" or several with commas. Throws UsageError, which names `option`.
std::vector<NumberRange> parseRanges(const std::string &text, const std::string &option);

// Whether `ranges` have `number`; no ranges have every number.
bool contains(const std::vector<NumberRange> &ranges, uint32_t number);

// What is chosen is in all of them. Empty ones choose everything.
struct Selection {
    std::vector<NumberRange> meshes;
    std::vector<NumberRange> primitives; // of each mesh
    std::vector<NumberRange> triangles;  // of each primitive
    std::vector<std::string> materials;  // names or numbers

    // Whether the material is chosen.
    [[nodiscard]] bool hasMaterial(int index, const std::string &name) const;
    [[nodiscard]] bool everything() const;
};

} // namespace vellum::cli
