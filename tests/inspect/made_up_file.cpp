// SPDX-License-Identifier: Apache-2.0
#include "made_up_file.h"

#include <cmath>

namespace vellum::test
{

inspect::InspectedFile madeUpFile()
{
    StoredMicromap micromap;
    micromap.triangles = {{1, 2, Format::FourState}, {5, 3, Format::TwoState}};
    micromap.data.resize(13);
    for (uint32_t i = 0; i < 16; ++i)
        writeState(micromap.data.data() + 1, i, Format::FourState, static_cast<State>(i % 4));
    for (uint32_t i = 0; i < 64; ++i)
        writeState(micromap.data.data() + 5, i, Format::TwoState, i < 32 ? State::Opaque : State::Transparent);
    inspect::InspectedFile file;
    file.name = "made up";
    file.bytes = 1000;
    file.stored.extension = "EXT_mesh_opacity_micromap";
    file.stored.micromaps = {micromap};
    file.stored.primitives[{0, 0}] = {0, {0, 1, 1, -2, -3}, 0};
    file.materials.resize(1);
    file.materials[0].index = 0;
    file.materials[0].material.name = "leaf";
    file.materials[0].material.alphaMode = AlphaMode::Mask;
    const TriangleUvs lower = {{{0, 0}, {1, 0}, {0, 1}}};
    const TriangleUvs upper = {{{1, 1}, {0, 1}, {1, 0}}};
    file.primitives = {{.place = {0, 0},
                        .mesh = "tree",
                        .material = 0,
                        .triangles = 5,
                        .numbers = {0, 1, 2, 3, 4},
                        .uvs = {lower, upper, upper, {{{1, 0}, {2, 0}, {1, 1}}}, {{{NAN, 0}, {1, 0}, {0, INFINITY}}}},
                        .records = {0, 1, 1, -2, -3},
                        .indexBytes = 10}};
    const StateCounter counter(file.stored.micromaps[0].data);
    for (const MicromapTriangle &triangle : micromap.triangles)
        file.records.push_back({0, triangle, counter.count(triangle)});
    file.meshCount = file.primitiveCount = 1;
    return file;
}

} // namespace vellum::test
