// SPDX-License-Identifier: Apache-2.0
#include "inspect/mesh_picture.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/picture.h"
#include "inspect/inspected_file.h"

namespace vellum::inspect
{
namespace
{

constexpr uint32_t kSamples = 2; // in each direction of a pixel
constexpr uint64_t kMostPixelsOfAll = 400'000'000;
constexpr double kVeil = 0.18; // how much of what is behind it a transparent layer hides
constexpr uint32_t kSolidColor = 0x9a9a9a;

using Point = std::array<double, 3>; // right, down and away from the viewer

// Turns a point as the camera sees it: 25 degrees around, 12 from above.
Point seen(const Vec3 &p)
{
    constexpr double kYaw = 25 * 3.14159265358979 / 180;
    constexpr double kPitch = 12 * 3.14159265358979 / 180;
    const double x = std::cos(kYaw) * p[0] - std::sin(kYaw) * p[2];
    const double z = std::sin(kYaw) * p[0] + std::cos(kYaw) * p[2];
    const double y = std::cos(kPitch) * p[1] - std::sin(kPitch) * z;
    return {x, -y, -(std::sin(kPitch) * p[1] + std::cos(kPitch) * z)};
}

bool finite(const Point &p)
{
    return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
}

struct Sample {
    float depth = INFINITY;
    uint32_t color = 0;
    float shade = 0;
    float behind = 1; // the share of light that earlier veils leave
};

struct Part {
    std::vector<Point> points;
    std::vector<uint32_t> indices;
    const InspectedPrimitive *primitive = nullptr; // null without a micromap
};

class MeshDrawing
{
public:
    MeshDrawing(const InspectedFile &file, uint32_t edge)
        : file_(file), edge_(edge), size_(edge * kSamples), samples_(size_t{size_} * size_)
    {
    }

    void add(Part part) { parts_.push_back(std::move(part)); }
    Picture draw();

private:
    enum class Pass : uint8_t { Solid, Veils };
    void fit();
    void drawPart(const Part &part, Pass pass);
    void drawTriangle(const std::array<Point, 3> &corners, const std::optional<StatesOf> &states, Pass pass);
    [[nodiscard]] Picture resolve() const;

    const InspectedFile &file_;
    uint32_t edge_;
    uint32_t size_;
    std::vector<Sample> samples_;
    std::vector<Part> parts_;
    uint64_t pixels_ = 0;
};

// Scales all points to the picture.
void MeshDrawing::fit()
{
    Point low{INFINITY, INFINITY, INFINITY};
    Point high{-INFINITY, -INFINITY, -INFINITY};
    for (const Part &part : parts_)
        for (const uint32_t index : part.indices)
            for (size_t axis = 0; finite(part.points[index]) && axis < 3; ++axis) {
                low[axis] = std::min(low[axis], part.points[index][axis]);
                high[axis] = std::max(high[axis], part.points[index][axis]);
            }
    const double extent = std::max({high[0] - low[0], high[1] - low[1], 1e-30});
    const double scale = 0.94 * size_ / extent;
    for (Part &part : parts_)
        for (Point &p : part.points) {
            p[0] = (p[0] - (low[0] + high[0]) / 2) * scale + size_ / 2.0;
            p[1] = (p[1] - (low[1] + high[1]) / 2) * scale + size_ / 2.0;
            p[2] = (p[2] - low[2]) * scale;
        }
}

void MeshDrawing::drawTriangle(const std::array<Point, 3> &p, const std::optional<StatesOf> &states, Pass pass)
{
    const double ux = p[1][0] - p[0][0], uy = p[1][1] - p[0][1], uz = p[1][2] - p[0][2];
    const double vx = p[2][0] - p[0][0], vy = p[2][1] - p[0][1], vz = p[2][2] - p[0][2];
    const double area = ux * vy - uy * vx;
    if (!(std::abs(area) > 1e-12))
        return;
    // The light is at the viewer, and triangles have two sides.
    const double nx = uy * vz - uz * vy, ny = uz * vx - ux * vz;
    const double facing = std::abs(area) / std::sqrt(nx * nx + ny * ny + area * area);
    const auto shade = static_cast<float>(0.62 + 0.38 * facing);
    const auto bound = [&](size_t axis, bool upper) {
        const auto [least, most] = std::minmax({p[0][axis], p[1][axis], p[2][axis]});
        return static_cast<int64_t>(std::clamp(upper ? std::ceil(most) : std::floor(least), 0.0, double(size_)));
    };
    for (int64_t y = bound(1, false); y < bound(1, true); ++y) {
        for (int64_t x = bound(0, false), end = bound(0, true); x < end; ++x) {
            ++pixels_;
            const double dx = static_cast<double>(x) + 0.5 - p[0][0], dy = static_cast<double>(y) + 0.5 - p[0][1];
            const double u = (dx * vy - dy * vx) / area;
            const double v = (dy * ux - dx * uy) / area;
            if (u < 0 || v < 0 || u + v > 1)
                continue;
            Sample &sample = samples_[static_cast<size_t>(y) * size_ + static_cast<size_t>(x)];
            const auto depth = static_cast<float>(p[0][2] + u * uz + v * vz);
            if (!(depth < sample.depth))
                continue;
            const auto state = states ? std::optional(states->at(u, v)) : std::nullopt;
            const bool veil = state == State::Transparent;
            if (veil && pass == Pass::Veils)
                sample.behind *= static_cast<float>(1 - kVeil);
            else if (!veil && pass == Pass::Solid)
                sample = {depth, state ? kStateColors[static_cast<size_t>(*state)] : kSolidColor, shade, 1};
        }
    }
}

void MeshDrawing::drawPart(const Part &part, Pass pass)
{
    size_t chosen = 0; // position among the primitive's chosen triangles
    for (uint32_t t = 0; t < part.indices.size() / 3 && pixels_ < kMostPixelsOfAll; ++t) {
        std::optional<StatesOf> states;
        if (part.primitive != nullptr && chosen < part.primitive->numbers.size() &&
            part.primitive->numbers[chosen] == t)
            states.emplace(file_, part.primitive->records[chosen++]);
        const std::array<Point, 3> corners = {part.points[part.indices[3 * t]], part.points[part.indices[3 * t + 1]],
                                              part.points[part.indices[3 * t + 2]]};
        if (finite(corners[0]) && finite(corners[1]) && finite(corners[2]))
            drawTriangle(corners, states, pass);
    }
}

Picture MeshDrawing::resolve() const
{
    Picture picture{edge_, edge_, std::vector<uint32_t>(size_t{edge_} * edge_)};
    const uint32_t veil = kStateColors[static_cast<size_t>(State::Transparent)];
    for (size_t y = 0; y < edge_; ++y)
        for (size_t x = 0; x < edge_; ++x) {
            std::array<double, 4> sum{}; // premultiplied
            for (size_t i = 0; i < kSamples * kSamples; ++i) {
                const Sample &s = samples_[(y * kSamples + i / kSamples) * size_ + x * kSamples + i % kSamples];
                const double solid = std::isfinite(s.depth) ? s.behind : 0;
                for (unsigned channel = 0; channel < 3; ++channel) {
                    const unsigned shift = 16 - 8 * channel; // colours are 0xrrggbb
                    sum[channel] +=
                        solid * s.shade * ((s.color >> shift) & 255) + (1 - double{s.behind}) * ((veil >> shift) & 255);
                }
                sum[3] += solid + 1 - double{s.behind};
            }
            uint32_t pixel = static_cast<uint32_t>(std::lround(255 * sum[3] / (kSamples * kSamples))) << 24;
            for (unsigned channel = 0; channel < 3 && sum[3] > 0; ++channel)
                pixel |= static_cast<uint32_t>(std::lround(std::min(sum[channel] / sum[3], 255.0))) << (8 * channel);
            picture.pixels[y * edge_ + x] = pixel;
        }
    return picture;
}

Picture MeshDrawing::draw()
{
    fit();
    for (const Part &part : parts_)
        drawPart(part, Pass::Solid);
    for (const Part &part : parts_)
        if (part.primitive != nullptr)
            drawPart(part, Pass::Veils);
    return resolve();
}

} // namespace

Picture drawMesh(const Document &document, const InspectedFile &file, uint32_t mesh, uint32_t edge)
{
    MeshDrawing drawing(file, edge);
    for (const PrimitivePlace place : trianglePrimitives(document)) {
        if (place.mesh != mesh)
            continue;
        Primitive source;
        try {
            source = readPrimitive(document, place, Positions::Read);
        } catch (const GltfUnsupported &) { // it may have micromaps, and nothing to draw
            continue;
        }
        Part part;
        part.indices = std::move(source.indices);
        std::transform(source.positions.begin(), source.positions.end(), std::back_inserter(part.points), seen);
        const auto known =
            std::lower_bound(file.primitives.begin(), file.primitives.end(), place,
                             [](const InspectedPrimitive &p, PrimitivePlace at) { return p.place < at; });
        part.primitive = known != file.primitives.end() && known->place == place ? &*known : nullptr;
        drawing.add(std::move(part));
    }
    return drawing.draw();
}

} // namespace vellum::inspect
