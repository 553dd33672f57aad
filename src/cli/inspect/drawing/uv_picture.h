// SPDX-License-Identifier: Apache-2.0
// PNG pictures of states over the texture, in UV space.
#pragma once

#include <cstdint>

#include "cli/inspect/inspected_file.h"
#include "cli/picture/picture.h"

namespace vellum::cli
{

struct UvPictureOptions {
    uint32_t edge = 1024; // pixels of a material's longer side
    bool outlines = true;
    bool whole = true; // the unit square, even where the triangles are in a part of it
};

// A panel for each material, with its name, a scale and the shares of states, and a legend. Panels are smaller where
// there are so many that the picture would have more than 64 million pixels.
Picture drawUvSpace(const InspectedFile &file, const UvPictureOptions &options);

} // namespace vellum::cli
