// The baker: triangles, their texture coordinates and an alpha texture in, a micromap out.
//
// A micro-triangle becomes Opaque or Transparent only if that is proven for every point of it: the values that the
// texture filter can return there are bounded by the texels it can reach, and both those bounds lie on one side of the
// cutoff. Everything else is unknown, so that a renderer which samples the texture for unknown micro-triangles draws
// exactly the picture of one that samples it everywhere. docs/baking.md has the whole argument.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <stdexcept>

#include "bake/texture.h"
#include "core/micromap.h"

namespace vellum
{

struct TexCoord {
    float u = 0;
    float v = 0;
    bool operator==(const TexCoord &) const = default;
};

// The texture coordinates of a triangle's vertices 0, 1, 2. Any values are safe: a triangle with one that is not finite
// or more than 2^24 texels from the origin becomes unknown, and a degenerate one is classified as the segment or point
// that it is.
using TriangleUvs = std::array<TexCoord, 3>;

struct BakeOptions {
    // FourState keeps unknown states. TwoState keeps their better guess: smaller, and an approximation.
    Format format = Format::FourState;
    // Subdivision level of every triangle, 0..12. Without it each triangle gets the level at which the legs of its
    // micro-triangles are about `texelsPerEdge` texels long, at most `maxLevel`.
    std::optional<std::uint32_t> level;
    std::uint32_t maxLevel = 8;
    double texelsPerEdge = 4.0;

    // A sample is opaque where alpha >= cutoff (glTF's alphaCutoff, after `scale` of AlphaTexture::fromUnorm8).
    double cutoff = 0.5;
    // What a GPU may do differently from the mathematics. A micro-triangle is opaque if every point of it, and every
    // point in the box of what the last three allow around it, filters to at least cutoff + valueTolerance; it is
    // transparent if all of them filter to less than cutoff - valueTolerance. With all four at 0 (exactly()) that is
    // decided exactly, without them unknown where rounding hides it.
    //
    // How far a filtered value may be from the exact one. The default covers filters that interpolate 8-bit texels
    // with 8-bit weights and round twice, as lavapipe's do.
    double valueTolerance = 2.0 / 255.0;
    // How far, in texels, a sample may be from where it was asked for. Vulkan lets subTexelPrecisionBits be as low as
    // 4, hence the default.
    double subtexelTolerance = 1.0 / 16.0;
    // How far, in barycentrics, a hit that traversal assigns to a micro-triangle may lie outside of it: the rounding
    // of the barycentrics and of their sum.
    double barycentricTolerance = 1e-5;
    // How far interpolation may move a texture coordinate, relative to the largest of the triangle: single precision,
    // whose products and sums are as large as the coordinates themselves.
    double interpolationTolerance = 16.0 / (1 << 24);

    // Worker threads; 0 takes one per processor. The result does not depend on it.
    unsigned threads = 0;
    // Bytes of micromap data after which to give up with BakeError. At most 2^32 - 1, what dataOffset can address.
    std::uint64_t maxDataBytes = std::uint64_t{1} << 30;
    // Called now and then with triangles done and in all, from any worker but one at a time.
    std::function<void(std::size_t done, std::size_t total)> progress;
};

struct BakeStatistics {
    std::array<std::uint64_t, 4> states{};  // micro-triangles of all triangles by State, folded ones included
    std::array<std::uint64_t, 4> special{}; // triangles that became a special index, by State
    std::size_t distinct = 0;               // triangles with different texture coordinates
};

struct BakeResult {
    Micromap micromap; // valid; indices has one entry per input triangle, baseTriangle is 0
    BakeStatistics statistics;
};

class BakeError : public std::runtime_error
{
public:
    using std::runtime_error::runtime_error;
};

// Bakes one micromap for `triangles`. Triangles with the same result share a micromap triangle; those that are one
// state all over become a special index. Throws BakeError for options or a texture out of range and for a result above
// maxDataBytes.
BakeResult bake(const AlphaTexture &texture, std::span<const TriangleUvs> triangles, const BakeOptions &options);

} // namespace vellum
