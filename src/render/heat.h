// SPDX-License-Identifier: Apache-2.0
// Pictures of counts.
#pragma once

#include <string>
#include <vector>

#include "base/picture.h"

namespace vellum::render
{

// A value at each pixel of a picture, and the picture's title.
struct HeatMap {
    uint32_t width = 0;
    uint32_t height = 0;
    std::vector<float> values; // zero or above
    std::string title;
};

// The colour of a value of 0 to 1, as a pixel of a Picture: almost black for 0, as much lighter with each step as the
// eye sees it (lightness and hue are those of the Oklab colour space).
uint32_t heatColor(float value);

// The value that the scale ends at: all but one in a thousand are below it, of all maps together. Above zero.
float heatScale(const std::vector<HeatMap> &maps);

constexpr uint32_t kHeatHead = 22; // pixels above the maps
constexpr uint32_t kHeatFoot = 54; // and below them

// The maps side by side, all in one scale from 0 to `scale`, above them their titles and below them a legend that says
// what is counted and which colour means how many. All must have the same height.
LabelledPicture drawHeat(const std::vector<HeatMap> &maps, float scale, const std::string &what);

} // namespace vellum::render
