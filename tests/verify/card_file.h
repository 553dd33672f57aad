// SPDX-License-Identifier: Apache-2.0
// A GLB with cards (two triangles each) whose alpha is a disc, and a micromap for them.
#pragma once

#include <string>
#include <vector>

#include "bake/bake.h"
#include "glb_file.h"

namespace vellum::test
{

struct CardFile {
    Micromap micromap; // of each card; baseTriangle must be 0
    std::string material = R"("alphaMode": "MASK", "alphaCutoff": 0.5)";
    std::vector<float> alphas; // of COLOR_0 at the 4 corners, of all cards or of each; none: no colours
    unsigned cards = 1;        // primitives of one mesh
    bool textured = true;      // has TEXCOORD_0
    bool extension = true;
    std::string usageCounts; // instead of the right ones

    [[nodiscard]] Bytes bytes() const;
    // Fills `micromap` with what the baker makes of the file that this is.
    void bake(const BakeOptions &options);
};

} // namespace vellum::test
