// SPDX-License-Identifier: Apache-2.0
// Meshes in the colours of their micromaps' states.
#pragma once

#include <cstdint>

#include "base/picture.h"
#include "inspect/inspected_file.h"

namespace vellum::inspect
{

// `file`'s mesh from the front and a little from above, without perspective, `edge` pixels wide and high, on nothing
// (alpha 0). Triangles without a micromap are grey; what is transparent is a veil.
// Not all of it where more than about 400 million pixels would have to be drawn.
Picture drawMesh(const Document &document, const InspectedFile &file, uint32_t mesh, uint32_t edge);

} // namespace vellum::inspect
