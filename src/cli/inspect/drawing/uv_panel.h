// SPDX-License-Identifier: Apache-2.0
// One material's part of the UV plane, drawn: its texture, the states over it, the outlines of triangles.
#pragma once

#include <optional>

#include "cli/inspect/drawing/uv_raster.h"
#include "cli/inspect/inspected_file.h"
#include "cli/picture/picture.h"

namespace vellum::cli
{

// The bounds of the selected triangles of a material; none if none of their coordinates is finite.
struct UvBounds {
    double left = 0, top = 0, right = 1, bottom = 1;
};
std::optional<UvBounds> boundsOf(const InspectedFile &file, uint32_t material);

// Every pixel of the window.
Picture drawUvWindow(const InspectedFile &file, uint32_t material, const UvWindow &window, bool outlines);

} // namespace vellum::cli
