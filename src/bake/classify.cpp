#include "bake/classify.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace vellum
{
namespace
{

// Above this many texels from the origin, single precision no longer tells texels apart.
constexpr double kMaxTexels = 16777216.0;

bool usable(const TriangleUvs &uvs, const AlphaTexture &texture)
{
    return std::all_of(uvs.begin(), uvs.end(), [&](const TexCoord &t) {
        return std::isfinite(t.u) && std::isfinite(t.v) && std::abs(double{t.u}) * texture.width < kMaxTexels &&
               std::abs(double{t.v}) * texture.height < kMaxTexels;
    });
}

void fill(std::vector<std::uint8_t> &packed, std::uint32_t first, std::uint32_t count, State state)
{
    if (count < 4) {
        for (std::uint32_t i = first; i < first + count; ++i)
            writeState(packed.data(), i, Format::FourState, state);
        return;
    }
    // A sub-triangle's micro-triangles are a run whose start and length are multiples of four states, one byte.
    const int byte = static_cast<int>(state) * 0x55;
    std::memset(packed.data() + first / 4, byte, count / 4);
}

} // namespace

struct Classifier::Work {
    const TriangleUvs &uvs;
    TriangleStates &result;
    double marginX; // in cells
    double marginY;

    [[nodiscard]] std::array<double, 2> at(double u, double v) const
    {
        const double w = 1 - u - v;
        return {w * uvs[0].u + u * uvs[1].u + v * uvs[2].u, w * uvs[0].v + u * uvs[1].v + v * uvs[2].v};
    }
};

Classifier::Classifier(const AlphaTexture &texture, const BakeOptions &options)
    : m_texture(texture), m_options(options), m_grid(texture, options.cutoff, options.valueTolerance)
{
}

std::uint32_t Classifier::levelFor(const TriangleUvs &uvs) const
{
    if (m_options.level)
        return *m_options.level;
    const auto edge = [&](const TexCoord &from, const TexCoord &to) {
        return std::array<double, 2>{(double{to.u} - from.u) * m_texture.width,
                                     (double{to.v} - from.v) * m_texture.height};
    };
    const auto a = edge(uvs[0], uvs[1]);
    const auto b = edge(uvs[0], uvs[2]);
    const double area = std::abs(a[0] * b[1] - a[1] * b[0]);
    const double wanted = std::ceil(0.5 * std::log2(area / (m_options.texelsPerEdge * m_options.texelsPerEdge)));
    if (!(wanted > 0)) // a zero area gives -infinity, which must not be converted
        return 0;
    return static_cast<std::uint32_t>(std::min<double>(wanted, m_options.maxLevel));
}

TriangleStates Classifier::classify(const TriangleUvs &uvs) const
{
    TriangleStates result;
    if (!usable(uvs, m_texture)) {
        result.level = m_options.level.value_or(0);
        result.packed.assign(packedBytes(result.level, Format::FourState), 0);
        fill(result.packed, 0, microTriangleCount(result.level), State::UnknownOpaque);
        return result;
    }
    result.level = levelFor(uvs);
    result.packed.assign(packedBytes(result.level, Format::FourState), 0);

    // Where a sample can fall around the exact place: sub-texel precision; single-precision interpolation, whose
    // products and sums are as large as the coordinates themselves; and hits beside the micro-triangle.
    const auto margin = [&](float TexCoord::*axis, double texels) {
        const double largest = std::max({std::abs(uvs[0].*axis), std::abs(uvs[1].*axis), std::abs(uvs[2].*axis)});
        const double slope =
            std::abs(double{uvs[1].*axis} - uvs[0].*axis) + std::abs(double{uvs[2].*axis} - uvs[0].*axis);
        constexpr double kInterpolation = 16.0 / (1 << 24);
        return m_options.subtexelTolerance +
               texels * (largest * kInterpolation + slope * m_options.barycentricTolerance);
    };
    const Work work{uvs, result, margin(&TexCoord::u, m_texture.width), margin(&TexCoord::v, m_texture.height)};
    descend(work, 0, 0);
    return result;
}

// Classifies sub-triangle `index` of level `depth`: all of its micro-triangles at once where that is proven.
void Classifier::descend(const Work &work, std::uint32_t index, std::uint32_t depth) const
{
    Footprint footprint{{}, work.marginX, work.marginY};
    const auto corners = microTriangleCorners(index, depth);
    for (std::size_t i = 0; i < 3; ++i) {
        const auto uv = work.at(corners[i].u, corners[i].v);
        footprint.corners[i] = m_grid.position(uv[0], uv[1]);
    }
    const unsigned possible = m_grid.outcomes(footprint);
    const std::uint32_t below = microTriangleCount(work.result.level - depth);
    if (possible != kMayBeEither) {
        const State proven = possible == kMayBeOpaque ? State::Opaque : State::Transparent;
        fill(work.result.packed, index * below, below, proven);
    } else if (depth == work.result.level) {
        writeState(work.result.packed.data(), index, Format::FourState, guess(work, index, depth));
    } else {
        for (std::uint32_t child = 0; child < 4; ++child)
            descend(work, index * 4 + child, depth + 1);
    }
}

// What most of an unknown micro-triangle is, by sampling.
State Classifier::guess(const Work &work, std::uint32_t index, std::uint32_t depth) const
{
    constexpr std::uint32_t kFiner = 2;
    const std::uint32_t level = std::min(kFiner, 12 - depth);
    const std::uint32_t count = microTriangleCount(level);
    std::uint32_t opaque = 0;
    for (std::uint32_t i = 0; i < count; ++i) {
        const auto c = microTriangleCorners(index * count + i, depth + level);
        const auto uv = work.at((double{c[0].u} + c[1].u + c[2].u) / 3, (double{c[0].v} + c[1].v + c[2].v) / 3);
        opaque += m_texture.sample(uv[0], uv[1]) >= m_options.cutoff ? 1u : 0u;
    }
    return 2 * opaque >= count ? State::UnknownOpaque : State::UnknownTransparent;
}

} // namespace vellum
