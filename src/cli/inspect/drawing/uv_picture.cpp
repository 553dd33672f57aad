// SPDX-License-Identifier: Apache-2.0
#include "cli/inspect/drawing/uv_picture.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

#include "cli/base/numbers.h"
#include "cli/inspect/drawing/uv_panel.h"
#include "cli/inspect/tally.h"
#include "cli/picture/text.h"
#include "cli/renderer/state_table.h"

namespace vellum::cli
{
namespace
{

constexpr double kMostPixels = 64e6;
constexpr uint32_t kSmallestEdge = 160;
constexpr int kMargin = 28;      // around everything, and between panels
constexpr int kHead = 58;        // above a panel's picture, for its name
constexpr int kScaleWidth = 58;  // beside it
constexpr int kScaleHeight = 30; // below it
constexpr int kLegend = 44;

constexpr uint32_t rgb(uint32_t rrggbb)
{
    return 0xff000000u | (rrggbb >> 16 & 255) | (rrggbb & 0xff00) | (rrggbb & 255) << 16;
}
constexpr uint32_t kInk = rgb(0x1c1e21);
constexpr uint32_t kFaint = rgb(0x666b73);
constexpr uint32_t kPaper = rgb(0xffffff);

struct Panel {
    uint32_t material = 0;
    UvWindow window;
    Tally tally;
};

void fill(Picture &picture, int x, int y, int width, int height, uint32_t color)
{
    for (int row = std::max(y, 0); row < std::min(y + height, static_cast<int>(picture.height)); ++row)
        for (int column = std::max(x, 0); column < std::min(x + width, static_cast<int>(picture.width)); ++column)
            picture.pixels[static_cast<size_t>(row) * picture.width + static_cast<size_t>(column)] = color;
}

void copy(Picture &to, const Picture &from, int x, int y)
{
    for (size_t row = 0; row < from.height; ++row)
        std::copy_n(from.pixels.begin() + static_cast<ptrdiff_t>(row * from.width), from.width,
                    to.pixels.begin() +
                        static_cast<ptrdiff_t>((static_cast<size_t>(y) + row) * to.width + static_cast<size_t>(x)));
}

UvWindow windowOf(const InspectedFile &file, uint32_t material, const UvPictureOptions &options, uint32_t edge)
{
    UvBounds b = boundsOf(file, material).value_or(UvBounds());
    if (options.whole)
        b = {std::min(b.left, 0.0), std::min(b.top, 0.0), std::max(b.right, 1.0), std::max(b.bottom, 1.0)};
    const double margin = 0.03 * std::max({b.right - b.left, b.bottom - b.top, 1e-6});
    const double width = b.right - b.left + 2 * margin;
    const double height = b.bottom - b.top + 2 * margin;
    UvWindow window{b.left - margin, b.top - margin, edge / std::max(width, height), 0, 0};
    const auto pixels = [&](double extent) {
        return static_cast<uint32_t>(std::clamp(std::ceil(extent * window.scale), 48.0, double(edge)));
    };
    window.width = pixels(width);
    window.height = pixels(height);
    return window;
}

// 1, 2 or 5 times a power of ten, so that there is a mark about every 90 pixels.
double markStep(double scale)
{
    const double wanted = 90 / scale;
    const double power = std::pow(10, std::floor(std::log10(wanted)));
    for (const double factor : {1.0, 2.0, 5.0})
        if (factor * power >= wanted)
            return factor * power;
    return 10 * power;
}

std::string markText(double value, double step)
{
    const int digits = std::clamp(static_cast<int>(std::ceil(-std::log10(step))), 0, 9);
    return fmt::format("{:.{}f}", std::abs(value) < step / 2 ? 0 : value, digits);
}

// The scales of u, below the panel at (x, y), and of v, to the left.
void drawScales(Picture &picture, const UvWindow &window, int x, int y)
{
    const double step = markStep(window.scale);
    const int width = static_cast<int>(window.width), height = static_cast<int>(window.height);
    const auto forEachMark = [&](double start, int pixels, auto &&draw) {
        const double first = std::ceil(start / step);
        for (int k = 0; k < 200; ++k) { // far from the origin, the sum may stay what it was
            const double value = (first + k) * step;
            const double at = std::round((value - start) * window.scale);
            if (!(at < pixels))
                return;
            draw(static_cast<int>(at), markText(value, step));
        }
    };
    forEachMark(window.left, width, [&](int at, const std::string &text) {
        fill(picture, x + at, y + height, 1, 6, kFaint);
        drawText(picture, x + at - textWidth(text, Font::Small) / 2, y + height + 20, text, Font::Small, kFaint);
    });
    forEachMark(window.top, height, [&](int at, const std::string &text) {
        fill(picture, x - 6, y + at, 6, 1, kFaint);
        drawText(picture, x - 10 - textWidth(text, Font::Small), y + at + 5, text, Font::Small, kFaint);
    });
    for (const auto &[dx, dy, w, h] : {std::array{-1, -1, width + 2, 1}, std::array{-1, height, width + 2, 1},
                                       std::array{-1, -1, 1, height + 2}, std::array{width, -1, 1, height + 2}})
        fill(picture, x + dx, y + dy, w, h, rgb(0xb8bcc2));
}

void drawPanel(Picture &picture, const InspectedFile &file, const Panel &panel, const UvPictureOptions &options, int x,
               int y)
{
    const Material &material = file.materials[panel.material].material;
    const int room = static_cast<int>(panel.window.width);
    const std::string name = material.name.empty() ? "default material" : material.name;
    drawText(picture, x, y + 20, fitText(name, Font::Title, room), Font::Title, kInk);
    const auto &s = panel.tally.states;
    drawText(picture, x, y + 44,
             fitText(fmt::format("{} triangle{}, {} unknown, cutoff {:.3g}", grouped(panel.tally.triangles),
                                 panel.tally.triangles == 1 ? "" : "s", percent(s[2] + s[3]), material.alphaCutoff),
                     Font::Normal, room),
             Font::Normal, kFaint);
    copy(picture, drawUvWindow(file, panel.material, panel.window, options.outlines), x, y + kHead);
    drawScales(picture, panel.window, x, y + kHead);
}

// In the order in which states.glsl and the page name them.
constexpr std::array<std::pair<State, const char *>, 4> kNames = {
    {{State::Opaque, "opaque"},
     {State::Transparent, "transparent"},
     {State::UnknownOpaque, "unknown, opaque"},
     {State::UnknownTransparent, "unknown, transparent"}}};

// Returns the width; draws nothing without a picture.
int drawLegend(Picture *picture, const Tally &tally, int x, int y)
{
    const int begin = x;
    for (const auto &[state, name] : kNames) {
        const std::string text = fmt::format("{}  {}", name, percent(tally.states[static_cast<size_t>(state)]));
        if (picture != nullptr) {
            fill(*picture, x, y, 16, 16, rgb(0x50545a));
            fill(*picture, x + 1, y + 1, 14, 14, rgb(kStateColors[static_cast<size_t>(state)]));
            drawText(*picture, x + 24, y + 13, text, Font::Normal, kInk);
        }
        x += 24 + textWidth(text, Font::Normal) + 28;
    }
    return x - 28 - begin;
}

} // namespace

Picture drawUvSpace(const InspectedFile &file, const UvPictureOptions &options)
{
    const auto count = static_cast<double>(file.materials.size());
    const auto edge =
        static_cast<uint32_t>(std::clamp(std::sqrt(kMostPixels / count), double{kSmallestEdge}, double(options.edge)));
    const auto columns = static_cast<size_t>(std::ceil(std::sqrt(count)));
    std::vector<Panel> panels(file.materials.size());
    for (uint32_t m = 0; m < panels.size(); ++m) {
        panels[m].material = m;
        panels[m].window = windowOf(file, m, options, edge);
        panels[m].tally = tallyOfMaterial(file, m);
    }
    const size_t rows = (panels.size() + columns - 1) / columns;
    std::vector<int> widths(columns), heights(rows);
    for (size_t i = 0; i < panels.size(); ++i) {
        const UvWindow &window = panels[i].window;
        widths[i % columns] = std::max(widths[i % columns], kScaleWidth + static_cast<int>(window.width));
        heights[i / columns] = std::max(heights[i / columns], kHead + static_cast<int>(window.height) + kScaleHeight);
    }
    const Tally all = tallyOf(file);
    int width = kMargin, height = kMargin;
    for (const int w : widths)
        width += w + kMargin;
    for (const int h : heights)
        height += h + kMargin / 2;
    width = std::max(width, drawLegend(nullptr, all, 0, 0) + 2 * kMargin + kScaleWidth);
    Picture picture{static_cast<uint32_t>(width), static_cast<uint32_t>(height + kLegend), {}};
    picture.pixels.assign(size_t{picture.width} * picture.height, kPaper);
    int y = kMargin;
    for (size_t row = 0; row < rows; y += heights[row] + kMargin / 2, ++row) {
        int x = kMargin;
        for (size_t column = 0; column < columns && row * columns + column < panels.size(); ++column) {
            drawPanel(picture, file, panels[row * columns + column], options, x + kScaleWidth, y);
            x += widths[column] + kMargin;
        }
    }
    drawLegend(&picture, all, kMargin + kScaleWidth, height + 6);
    return picture;
}

} // namespace vellum::cli
