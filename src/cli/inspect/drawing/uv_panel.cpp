// SPDX-License-Identifier: Apache-2.0
#include "cli/inspect/drawing/uv_panel.h"

#include <algorithm>
#include <cmath>

#include "cli/inspect/states_of.h"
#include "cli/renderer/state_table.h"

namespace vellum::cli
{
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

Picture drawUvWindow(const InspectedFile &file, uint32_t material, const UvWindow &window, bool outlines)
{
    const uint32_t samples = std::max(window.width, window.height) <= kMostSamples ? 2 : 1;
    UvWindow fine = window;
    fine.width *= samples;
    fine.height *= samples;
    fine.scale *= samples;
    const std::vector<Shown> shown = trianglesOf(file, material);
    UvRaster raster(fine);
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

} // namespace vellum::cli
