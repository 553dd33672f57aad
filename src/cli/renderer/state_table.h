// SPDX-License-Identifier: Apache-2.0
// The states of micromaps as the shader of --mode states reads them.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "cli/scene/render_scene.h"
#include "core/micromap.h"

namespace vellum::cli
{

// What a state is painted in: red, green and blue of sRGB. By State, from Wong's palette for all kinds of colour
// vision: what is known is blue, what is unknown is yellow or red. shaders/states.glsl reads them from the table.
constexpr std::array<uint32_t, 4> kStateColors = {0x56b4e9, 0x0072b2, 0xf0e442, 0xd55e00};

// Words: a colour for each State; two for each triangle of the renderer's scene, in the order of its records; then the
// micromaps' data. A triangle's first word is where its data begins, in bytes from the table's beginning, or its one
// state; the second word is which of these (kStates...), and its level and format.
// `micromaps`: one for each geometry of the scene, null for those without.
std::vector<uint32_t> makeStateTable(const RenderScene &scene, std::span<const Micromap *const> micromaps);

// Second words. With kStatesData, the level in the low bits and kStatesTwo for the 2-state format.
constexpr uint32_t kStatesNone = 0; // no micromap
constexpr uint32_t kStatesOne = 0x100;
constexpr uint32_t kStatesData = 0x200;
constexpr uint32_t kStatesTwo = 0x400;

} // namespace vellum::cli
