// SPDX-License-Identifier: Apache-2.0
#include "render/heat.h"

#include <algorithm>
#include <cmath>

namespace vellum::render
{
namespace
{

constexpr uint32_t kBackground = 0xff181818u;
constexpr uint32_t kInk = 0xe8e8e8; // grey: the same in both orders of channels
constexpr uint32_t kTextSize = 12;

// Björn Ottosson's Oklab: lightness 0..1, and two axes from green to red and from blue to yellow.
uint32_t fromOklab(double lightness, double a, double b)
{
    const auto cube = [](double x) { return x * x * x; };
    const double l = cube(lightness + 0.3963377774 * a + 0.2158037573 * b);
    const double m = cube(lightness - 0.1055613458 * a - 0.0638541728 * b);
    const double s = cube(lightness - 0.0894841775 * a - 1.2914855480 * b);
    const double linear[3] = {4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
                              -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
                              -0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s};
    uint32_t color = 0xff000000u;
    for (unsigned channel = 0; channel < 3; ++channel) {
        const double x = std::clamp(linear[channel], 0.0, 1.0);
        const double encoded = x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055; // sRGB
        color |= static_cast<uint32_t>(std::lround(255 * encoded)) << (8 * channel);
    }
    return color;
}

// A bar with marks, and what they mean, in kHeatFoot pixels from `top` on.
void drawLegend(LabelledPicture &drawing, uint32_t top, float scale, const std::string &what)
{
    constexpr uint32_t kMargin = 6;
    constexpr uint32_t kThick = 10;
    Picture &picture = drawing.picture;
    const auto label = [&](double x, double y, const std::string &text, Label::Anchor anchor = Label::Anchor::Start) {
        drawing.labels.push_back({x, y, text, kTextSize, kInk, anchor});
    };
    const uint32_t bar = std::max(std::min(picture.width, 300u), 2 * kMargin + 2) - 2 * kMargin;
    for (uint32_t x = 0; x < bar; ++x)
        fillRectangle(picture, kMargin + x, top, 1, kThick,
                      heatColor(static_cast<float>(x) / static_cast<float>(std::max(bar - 1, 1u))));
    // About four steps make the scale; counts have none below 1.
    const auto step = static_cast<float>(std::max(roundStep(std::max(scale / 5, 1e-6f)), 1.0));
    const double baseline = top + kThick + 16;
    for (float value = 0; value <= scale; value += step) {
        const auto x = kMargin + static_cast<uint32_t>(value / scale * static_cast<float>(bar - 1));
        fillRectangle(picture, x, top + kThick, 1, 3, 0xff000000u | kInk);
        label(x, baseline, std::to_string(std::lround(value)),
              value == 0 ? Label::Anchor::Start : Label::Anchor::Middle);
    }
    const double beside = bar + 4 * kMargin;
    if (beside + textWidth(what, kTextSize) <= picture.width)
        label(beside, top + 10, what);
    else
        label(kMargin, baseline + 16, what);
}

} // namespace

uint32_t heatColor(float value)
{
    const double t = std::clamp(static_cast<double>(value), 0.0, 1.0);
    const double lightness = 0.10 + 0.85 * t;
    // From blue over red to yellow, strongest in the middle, where the screen has the strongest colours.
    const double hue = (280 + 190 * t) / 180 * 3.14159265358979;
    const double chroma = 0.03 + 0.14 * std::sin(3.14159265358979 * std::pow(t, 0.8)) + 0.09 * t * t;
    return fromOklab(lightness, chroma * std::cos(hue), chroma * std::sin(hue));
}

float heatScale(const std::vector<HeatMap> &maps)
{
    std::vector<float> all;
    for (const HeatMap &map : maps)
        all.insert(all.end(), map.values.begin(), map.values.end());
    if (all.empty())
        return 1;
    const auto place = all.begin() + static_cast<ptrdiff_t>((all.size() - 1) * 999 / 1000);
    std::nth_element(all.begin(), place, all.end());
    return std::max(std::ceil(*place), 1.0f);
}

LabelledPicture drawHeat(const std::vector<HeatMap> &maps, float scale, const std::string &what)
{
    const uint32_t height = maps.front().height;
    LabelledPicture drawing;
    Picture &picture = drawing.picture;
    for (const HeatMap &map : maps)
        picture.width += map.width;
    picture.height = kHeatHead + height + kHeatFoot;
    picture.pixels.assign(size_t{picture.width} * picture.height, kBackground);
    uint32_t left = 0;
    for (const HeatMap &map : maps) {
        drawing.labels.push_back({left + 6.0, 16, fitText(map.title, kTextSize, map.width - 8.0), kTextSize, kInk});
        for (uint32_t y = 0; y < height; ++y)
            for (uint32_t x = 0; x < map.width; ++x)
                picture.pixels[size_t{kHeatHead + y} * picture.width + left + x] =
                    heatColor(map.values[size_t{y} * map.width + x] / scale);
        left += map.width;
    }
    drawLegend(drawing, kHeatHead + height + 6, scale, what);
    return drawing;
}

} // namespace vellum::render
