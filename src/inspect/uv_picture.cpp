// SPDX-License-Identifier: Apache-2.0
#include "inspect/uv_picture.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

#include "base/error.h"
#include "base/text.h"

namespace vellum::inspect
{
UvRaster::UvRaster(const UvWindow &window, uint64_t &rowsLeft)
    : window_(window), numbers_(size_t{window.width} * window.height, -1),
      next_(size_t{window.width + 1} * window.height), free_(numbers_.size()), rowsLeft_(rowsLeft)
{
    for (size_t i = 0; i < next_.size(); ++i)
        next_[i] = static_cast<uint32_t>(i % (window.width + 1));
}

uint32_t UvRaster::nextFree(uint32_t *row, uint32_t x) const
{
    uint32_t found = x;
    while (row[found] != found)
        found = row[found];
    while (row[x] != found) { // the way is shorter the next time
        const uint32_t next = row[x];
        row[x] = found;
        x = next;
    }
    return found;
}

void UvRaster::add(const TriangleUvs &uvs, int32_t number)
{
    std::array<double, 3> x{};
    std::array<double, 3> y{};
    for (size_t i = 0; i < 3; ++i) {
        x[i] = (uvs[i].u - window_.left) * window_.scale;
        y[i] = (uvs[i].v - window_.top) * window_.scale;
        if (!std::isfinite(x[i]) || !std::isfinite(y[i]))
            return;
    }
    const auto [least, most] = std::minmax({y[0], y[1], y[2]});
    const auto first = static_cast<uint32_t>(std::clamp(std::ceil(least - 0.5), 0.0, double(window_.height)));
    const auto end = static_cast<uint32_t>(std::clamp(std::floor(most - 0.5) + 1, 0.0, double(window_.height)));
    for (uint32_t row = first; row < end && !full(); ++row, --rowsLeft_) {
        const double at = row + 0.5; // pixels whose centres are inside
        double low = INFINITY;
        double high = -INFINITY;
        for (size_t i = 0; i < 3; ++i) {
            const size_t j = (i + 1) % 3;
            if (std::min(y[i], y[j]) > at || std::max(y[i], y[j]) < at)
                continue;
            const double crossing = y[i] == y[j] ? x[i] : x[i] + (at - y[i]) / (y[j] - y[i]) * (x[j] - x[i]);
            low = std::min({low, crossing, y[i] == y[j] ? x[j] : crossing});
            high = std::max({high, crossing, y[i] == y[j] ? x[j] : crossing});
        }
        if (!(low <= high))
            continue;
        const double width = window_.width;
        const auto from = static_cast<uint32_t>(std::clamp(std::ceil(low - 0.5), 0.0, width));
        const auto to = static_cast<uint32_t>(std::clamp(std::floor(high - 0.5) + 1, 0.0, width));
        uint32_t *next = next_.data() + size_t{row} * (window_.width + 1);
        for (uint32_t pixel = nextFree(next, from); pixel < to; pixel = nextFree(next, pixel)) {
            numbers_[size_t{row} * window_.width + pixel] = number;
            next[pixel] = pixel + 1;
            --free_;
        }
    }
}

UvBarycentrics::UvBarycentrics(const TriangleUvs &uvs) : originU_(uvs[0].u), originV_(uvs[0].v)
{
    const double ax = uvs[1].u - originU_, ay = uvs[1].v - originV_;
    const double bx = uvs[2].u - originU_, by = uvs[2].v - originV_;
    const double area = ax * by - ay * bx;
    usable_ = std::isfinite(area) && area != 0;
    if (!usable_)
        return;
    uPerU_ = by / area;
    uPerV_ = -bx / area;
    vPerU_ = -ay / area;
    vPerV_ = ax / area;
    slopeU_ = std::hypot(uPerU_, uPerV_);
    slopeV_ = std::hypot(vPerU_, vPerV_);
    slopeW_ = std::hypot(uPerU_ + vPerU_, uPerV_ + vPerV_);
}

namespace
{

constexpr double kStrength = 0.62;      // of a state's colour over the texture
constexpr uint32_t kMostSamples = 4096; // pixels in a direction up to which there are four samples for each

struct Rgb {
    double red = 0, green = 0, blue = 0;
    void add(const Rgb &other, double weight)
    {
        red += weight * other.red;
        green += weight * other.green;
        blue += weight * other.blue;
    }
};

Rgb mixed(const Rgb &a, const Rgb &b, double share)
{
    Rgb result;
    result.add(a, 1 - share);
    result.add(b, share);
    return result;
}

Rgb colorOf(State state)
{
    const uint32_t c = kStateColors[static_cast<size_t>(state)];
    return {double((c >> 16) & 255), double((c >> 8) & 255), double(c & 255)};
}

// The texture over a checkerboard, in the grey of its brightness: colours are those of states.
class Backdrop
{
public:
    explicit Backdrop(const InspectedMaterial &material) : material_(material) {}

    [[nodiscard]] Rgb at(double u, double v, size_t x, size_t y) const
    {
        const double board = (x / 8 + y / 8) % 2 == 0 ? 255 : 232;
        if (!material_.image)
            return {board, board, board};
        const Image &image = *material_.image;
        const double s = u * image.width - 0.5;
        const double t = v * image.height - 0.5;
        if (!(std::abs(s) < 1e9) || !(std::abs(t) < 1e9))
            return {board, board, board};
        double grey = 0;
        if (material_.material.filter == Filter::Nearest)
            return greyOf(std::floor(s + 0.5), std::floor(t + 0.5), board);
        const double x0 = std::floor(s), y0 = std::floor(t);
        for (int corner = 0; corner < 4; ++corner) {
            const int dx = corner % 2, dy = corner / 2;
            const double weight = (dx != 0 ? s - x0 : 1 - s + x0) * (dy != 0 ? t - y0 : 1 - t + y0);
            grey += weight * greyOf(x0 + dx, y0 + dy, board).red;
        }
        return {grey, grey, grey};
    }

private:
    [[nodiscard]] Rgb greyOf(double x, double y, double board) const
    {
        const Image &image = *material_.image;
        const auto column = wrapTexel(static_cast<int64_t>(x), image.width, material_.material.wrapU);
        const auto row = wrapTexel(static_cast<int64_t>(y), image.height, material_.material.wrapV);
        const uint8_t *texel =
            image.rgba.data() + 4 * (static_cast<size_t>(row) * image.width + static_cast<size_t>(column));
        const double light = 0.3 * texel[0] + 0.59 * texel[1] + 0.11 * texel[2];
        const double alpha = texel[3] / 255.0;
        const double grey = board + (light - board) * alpha;
        return {grey, grey, grey};
    }

    const InspectedMaterial &material_;
};

// A triangle of the panel.
struct Shown {
    TriangleUvs uvs;
    int32_t record;
};

std::vector<Shown> trianglesOf(const InspectedFile &file, uint32_t material)
{
    std::vector<Shown> shown;
    for (const InspectedPrimitive &primitive : file.primitives)
        for (size_t t = 0; primitive.material == material && t < primitive.uvs.size(); ++t)
            shown.push_back({primitive.uvs[t], primitive.records[t]});
    return shown;
}

// The colour at a place in a triangle: its state's, with lines between micro-triangles where they are large.
Rgb paint(const InspectedFile &file, const Shown &shown, const UvBarycentrics &plane, const UvWindow &window, double u,
          double v, const Rgb &below, bool outlines)
{
    const StatesOf states(file, shown.record);
    const UvBarycentrics::Weights at = plane.at(u, v);
    Rgb color = mixed(below, colorOf(states.at(at.u, at.v)), kStrength);
    if (!outlines)
        return color;
    // Distances in pixels: a weight divided by its slope.
    const auto distance = [&](double weight, double slope) { return weight / slope * window.scale; };
    const double steps = std::ldexp(1.0, static_cast<int>(states.level()));
    const double height = window.scale / (std::max({plane.slopeU(), plane.slopeV(), plane.slopeW()}) * steps);
    if (height >= 6 && states.level() > 0) {
        const auto toLine = [&](double weight, double slope) {
            const double part = weight * steps - std::floor(weight * steps);
            return distance(std::min(part, 1 - part) / steps, slope);
        };
        const double line =
            std::min({toLine(at.u, plane.slopeU()), toLine(at.v, plane.slopeV()), toLine(at.w(), plane.slopeW())});
        color = mixed(color, {255, 255, 255}, 0.4 * std::clamp(1 - line, 0.0, 1.0));
    }
    const double edge =
        std::min({distance(at.u, plane.slopeU()), distance(at.v, plane.slopeV()), distance(at.w(), plane.slopeW())});
    return mixed(color, {20, 20, 24}, 0.75 * std::clamp(1.2 - edge, 0.0, 1.0));
}

} // namespace

std::optional<UvBounds> boundsOf(const InspectedFile &file, uint32_t material)
{
    UvBounds bounds{INFINITY, INFINITY, -INFINITY, -INFINITY};
    for (const InspectedPrimitive &primitive : file.primitives)
        for (size_t t = 0; primitive.material == material && t < primitive.uvs.size(); ++t)
            for (const TexCoord &uv : primitive.uvs[t]) {
                if (!std::isfinite(uv.u) || !std::isfinite(uv.v))
                    continue;
                bounds.left = std::min(bounds.left, double{uv.u});
                bounds.right = std::max(bounds.right, double{uv.u});
                bounds.top = std::min(bounds.top, double{uv.v});
                bounds.bottom = std::max(bounds.bottom, double{uv.v});
            }
    if (bounds.left > bounds.right)
        return std::nullopt;
    return bounds;
}

Picture drawUvWindow(const InspectedFile &file, uint32_t material, const UvWindow &window, bool outlines,
                     uint64_t &rowsLeft)
{
    const uint32_t samples = std::max(window.width, window.height) <= kMostSamples ? 2 : 1;
    UvWindow fine = window;
    fine.width *= samples;
    fine.height *= samples;
    fine.scale *= samples;
    const std::vector<Shown> shown = trianglesOf(file, material);
    UvRaster raster(fine, rowsLeft);
    for (size_t i = 0; i < shown.size() && !raster.full(); ++i)
        raster.add(shown[i].uvs, static_cast<int32_t>(i));

    const Backdrop backdrop(file.materials[material]);
    Picture picture{window.width, window.height, {}};
    picture.pixels.reserve(size_t{window.width} * window.height);
    for (size_t y = 0; y < window.height; ++y)
        for (size_t x = 0; x < window.width; ++x) {
            Rgb sum;
            for (size_t i = 0; i < samples * samples; ++i) {
                const size_t fx = x * samples + i % samples, fy = y * samples + i / samples;
                const double u = fine.left + (static_cast<double>(fx) + 0.5) / fine.scale;
                const double v = fine.top + (static_cast<double>(fy) + 0.5) / fine.scale;
                const Rgb below = backdrop.at(u, v, x, y);
                const int32_t number = raster.at(fx, fy);
                if (number < 0) {
                    sum.add(mixed(below, {255, 255, 255}, 0.35), 1);
                    continue;
                }
                const Shown &triangle = shown[static_cast<size_t>(number)];
                const UvBarycentrics plane(triangle.uvs);
                sum.add(plane.usable() ? paint(file, triangle, plane, window, u, v, below, outlines) : below, 1);
            }
            const double count = samples * samples;
            const auto channel = [&](double value) {
                return static_cast<uint32_t>(std::lround(std::clamp(value / count, 0.0, 255.0)));
            };
            picture.pixels.push_back(0xff000000u | channel(sum.red) | (channel(sum.green) << 8) |
                                     (channel(sum.blue) << 16));
        }
    return picture;
}

namespace
{

constexpr double kMostPixels = 64e6;
constexpr double kSmallestEdge = 160;
constexpr int kMargin = 28;      // around everything, and between panels
constexpr int kHead = 58;        // above a panel's picture, for its name
constexpr int kScaleWidth = 58;  // next to it
constexpr int kScaleHeight = 30; // below it
constexpr int kLegend = 44;

constexpr uint32_t rgb(uint32_t rrggbb)
{
    return 0xff000000u | (rrggbb >> 16 & 255) | (rrggbb & 0xff00) | (rrggbb & 255) << 16;
}
constexpr uint32_t kInk = 0x1c1e21;
constexpr uint32_t kFaint = 0x666b73;
constexpr uint32_t kPaper = rgb(0xffffff);
constexpr uint32_t kSmall = 12, kNormal = 14, kTitle = 19; // sizes of text

struct Panel {
    uint32_t material = 0;
    UvWindow window;
    Tally tally;
};

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
        return static_cast<uint32_t>(std::min<double>(std::max(std::ceil(extent * window.scale), 48.0), edge));
    };
    window.width = pixels(width);
    window.height = pixels(height);
    return window;
}

std::string markText(double value, double step)
{
    const int digits = std::clamp(static_cast<int>(std::ceil(-std::log10(step))), 0, 9);
    return fmt::format("{:.{}f}", std::abs(value) < step / 2 ? 0 : value, digits);
}

// The scales of u, below the panel at (x, y), and of v, to the left.
void drawScales(LabelledPicture &drawing, const UvWindow &window, int x, int y)
{
    Picture &picture = drawing.picture;
    const double step = roundStep(90 / window.scale); // a mark about every 90 pixels
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
        fillRectangle(picture, x + at, y + height, 1, 6, rgb(kFaint));
        drawing.labels.push_back({x + at + 0.5, y + height + 20.0, text, kSmall, kFaint, Label::Anchor::Middle});
    });
    forEachMark(window.top, height, [&](int at, const std::string &text) {
        fillRectangle(picture, x - 6, y + at, 6, 1, rgb(kFaint));
        drawing.labels.push_back({x - 10.0, y + at + 5.0, text, kSmall, kFaint, Label::Anchor::End});
    });
    for (const auto &[dx, dy, w, h] : {std::array{-1, -1, width + 2, 1}, std::array{-1, height, width + 2, 1},
                                       std::array{-1, -1, 1, height + 2}, std::array{width, -1, 1, height + 2}})
        fillRectangle(picture, x + dx, y + dy, w, h, rgb(0xb8bcc2));
}

void drawPanel(LabelledPicture &drawing, const InspectedFile &file, const Panel &panel, const UvPictureOptions &options,
               int x, int y, uint64_t &rowsLeft)
{
    copy(drawing.picture, drawUvWindow(file, panel.material, panel.window, options.outlines, rowsLeft), x, y + kHead);
    const Material &material = file.materials[panel.material].material;
    const double width = panel.window.width;
    const std::string name = material.name.empty() ? "default material" : material.name;
    const auto &s = panel.tally.states;
    const std::optional<float> cutoff = file.materials[panel.material].cutoff;
    const std::string facts = fmt::format("{}{}, {} unknown, {}", counted(panel.tally.triangles, "triangle"),
                                          rowsLeft == 0 ? " (not all are drawn)" : "", percent(s[2] + s[3]),
                                          cutoff ? fmt::format("cutoff {:.3g}", *cutoff)
                                          : material.alphaMode == AlphaMode::Blend ? "alphaMode BLEND"
                                                                                   : "no alpha test");
    drawing.labels.push_back(
        {static_cast<double>(x), y + 20.0, fitText(name, kTitle, width), kTitle, kInk, Label::Anchor::Start, true});
    drawing.labels.push_back({static_cast<double>(x), y + 44.0, fitText(facts, kNormal, width), kNormal, kFaint});
    drawScales(drawing, panel.window, x, y + kHead);
}

// In the order of their names in states.glsl and the page.
constexpr std::array<std::pair<State, const char *>, 4> kNames = {
    {{State::Opaque, "opaque"},
     {State::Transparent, "transparent"},
     {State::UnknownOpaque, "unknown, opaque"},
     {State::UnknownTransparent, "unknown, transparent"}}};

// Returns the width; draws nothing without a picture.
int drawLegend(LabelledPicture *drawing, const Tally &tally, int x, int y)
{
    const int begin = x;
    for (const auto &[state, name] : kNames) {
        const std::string text = fmt::format("{}  {}", name, percent(tally.states[static_cast<size_t>(state)]));
        if (drawing != nullptr) {
            fillRectangle(drawing->picture, x, y, 16, 16, rgb(0x50545a));
            fillRectangle(drawing->picture, x + 1, y + 1, 14, 14, rgb(kStateColors[static_cast<size_t>(state)]));
            drawing->labels.push_back({x + 24.0, y + 13.0, text, kNormal, kInk});
        }
        x += 24 + static_cast<int>(textWidth(text, kNormal)) + 28;
    }
    return x - 28 - begin;
}

} // namespace

LabelledPicture drawUvSpace(const InspectedFile &file, const UvPictureOptions &options)
{
    const size_t count = file.materials.size();
    const auto columns = static_cast<size_t>(std::ceil(std::sqrt(static_cast<double>(count))));
    const size_t rows = (count + columns - 1) / columns;
    constexpr int kAround = std::max(kScaleWidth + kMargin, kHead + kScaleHeight + kMargin / 2); // a panel's picture
    const double fitting = std::sqrt(kMostPixels / static_cast<double>(rows * columns)) - kAround;
    if (fitting < std::min<double>(options.edge, kSmallestEdge))
        throw Error(grouped(count) + " materials are too many for a picture; --material chooses some");
    const auto edge = static_cast<uint32_t>(std::min<double>(options.edge, fitting));
    const std::vector<Tally> tallies = talliesOfMaterials(file);
    std::vector<Panel> panels(count);
    for (uint32_t m = 0; m < panels.size(); ++m) {
        panels[m].material = m;
        panels[m].window = windowOf(file, m, options, edge);
        panels[m].tally = tallies[m];
    }
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
    LabelledPicture drawing{{static_cast<uint32_t>(width), static_cast<uint32_t>(height + kLegend), {}}, {}};
    drawing.picture.pixels.assign(size_t{drawing.picture.width} * drawing.picture.height, kPaper);
    uint64_t rowsLeft = kMostRows;
    int y = kMargin;
    for (size_t row = 0; row < rows; y += heights[row] + kMargin / 2, ++row) {
        int x = kMargin;
        for (size_t column = 0; column < columns && row * columns + column < panels.size(); ++column) {
            drawPanel(drawing, file, panels[row * columns + column], options, x + kScaleWidth, y, rowsLeft);
            x += widths[column] + kMargin;
        }
    }
    drawLegend(&drawing, all, kMargin + kScaleWidth, height + 6);
    return drawing;
}

} // namespace vellum::inspect
