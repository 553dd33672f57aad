// SPDX-License-Identifier: Apache-2.0
// Two bakes side by side: bytes, levels and the share of the surface that is known, of all, by material and by mesh.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/json_writer.h"
#include "inspect/inspected_file.h"

namespace vellum::inspect
{

struct ComparedBake {
    std::optional<double> known;       // share of the alpha-tested surface; nothing if it has none
    uint64_t bytes = 0;                // of data and records; what others share as well counts for each
    uint64_t triangles = 0;            // with a micromap
    std::array<uint64_t, 13> levels{}; // triangles with data by level
    bool twoStates = false;            // some of that data has 2 states
};

// A material or a mesh, matched by name, or by number where it has no name.
struct ComparedPart {
    std::string name;
    std::array<std::optional<ComparedBake>, 2> bakes; // nothing where a file does not have the part
};

struct Comparison {
    std::array<std::string, 2> files;
    ComparedPart all;
    std::vector<ComparedPart> materials; // in the order of the first file, then those that only the second has
    std::vector<ComparedPart> meshes;
};

// The files must be inspected whole.
Comparison compare(const InspectedFile &first, const InspectedFile &second);

std::string textOf(const Comparison &comparison);           // a table for a terminal
std::string pageOf(const Comparison &comparison);           // HTML
void write(const Comparison &comparison, JsonWriter &json); // an object

} // namespace vellum::inspect
