// SPDX-License-Identifier: Apache-2.0
// The baker: triangles, their texture coordinates and an alpha texture in, a micromap out.
//
// A micro-triangle becomes Opaque or Transparent only if every point of it is, filtered as the sampler does it.
// Everything else is unknown, so that a renderer which samples the texture for unknown micro-triangles draws exactly
// the picture of one that samples it everywhere. docs/design/baker.md has the argument.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <stdexcept>

#include "bake/texture/texture.h"
#include "core/micromap.h"

namespace vellum
{

// Raised whenever the result for the same input may differ from that of earlier versions: caches keep results by it. A
// test (unit.BakeVersion) compares results with those of this version.
inline constexpr uint32_t kBakeVersion = 2;

struct TexCoord {
    float u = 0;
    float v = 0;
    bool operator==(const TexCoord &) const = default;
};

// The texture coordinates of a triangle's vertices 0, 1, 2. Any values are safe: a triangle with one that is not finite
// or more than 2^24 texels from the origin becomes unknown, and a degenerate one is classified as the segment or point
// that it is.
using TriangleUvs = std::array<TexCoord, 3>;

// The comparison that makes a filtered value opaque.
enum class AlphaTest : uint8_t { GreaterOrEqual, Greater, LessOrEqual, Less };

// The 2-state state that an unknown state becomes.
enum class TwoStateRule : uint8_t {
    Nearest,              // the most frequent state of the micro-triangle
    UnknownIsOpaque,      // nothing opaque is lost
    UnknownIsTransparent, // nothing transparent is hit
};

struct BakeOptions {
    // FourState keeps unknown states. TwoState makes them known by `twoStateRule`: smaller, and an approximation.
    Format format = Format::FourState;
    TwoStateRule twoStateRule = TwoStateRule::Nearest;
    // Subdivision level of every triangle, 0..12. Without it each triangle gets the level at which the legs of its
    // micro-triangles are about `texelsPerEdge` texels long (at most 1.2 times that), at most `maxLevel`.
    std::optional<uint32_t> level;
    uint32_t maxLevel = 8;
    double texelsPerEdge = 4.0;
    // Most bytes of the result: data, and 8 for each micromap triangle. If it has more, levels are lowered where that
    // turns the least from known to unknown, down to special indices, which are free. If it has less, those that
    // `texelsPerEdge` chose are raised where that makes the most known, by at most 3 and up to `maxLevel`. 2-state data
    // is chosen as if it were 4-state.
    std::optional<uint64_t> budget;
    // Instead of a budget: the smallest result of which at least that is known, in the unit of BakeInput::weights.
    // bake() throws BakeTooLittleKnown where no level makes that known. Automatic levels are raised as for a budget.
    // For 4-state data.
    std::optional<double> leastKnown;
    // What the budget counts for a BakeInput::group of which no triangle has data.
    uint64_t emptyGroupBytes = 0;
    // A 4-state triangle less of which is known than this share (0..1) gets a special index for unknown instead of
    // data.
    double minKnown = 0;
    // Keeps special indices from mixing with others among the triangles of one BakeInput, as
    // VK_PIPELINE_CREATE_2_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_KHR demands of a geometry: triangles that
    // are one state all over get a micromap triangle of level 0 if any other triangle has data.
    bool disallowMixedSpecialIndices = false;

    // A sample is opaque where alpha >= cutoff (glTF's alphaCutoff, after `scale` of AlphaTexture::fromUnorm8), or what
    // `test` says instead.
    double cutoff = 0.5;
    AlphaTest test = AlphaTest::GreaterOrEqual;
    // The limits of how a GPU may differ from the mathematics. A micro-triangle is opaque if every point of it, and
    // every point in the box of what the last three allow around it, filters to at least cutoff + valueTolerance; it is
    // transparent if all of them filter to less than cutoff - valueTolerance. With all four at 0 (exactly()) every
    // micro-triangle for which that is so gets its state. With others, it may be unknown instead where the rounding of
    // double precision hides it.
    //
    // How far a filtered value may be from the exact one. The default covers filters that interpolate 8-bit texels
    // with 8-bit weights and round twice, as lavapipe's do.
    double valueTolerance = 2.0 / 255.0;
    // The largest distance, in texels, of a sample from its exact position. Vulkan lets subTexelPrecisionBits be as low
    // as 4, hence the default. At most 1024.
    double subtexelTolerance = 1.0 / 16.0;
    // The largest distance, in barycentrics, of a hit from the micro-triangle that traversal assigns it to: the
    // rounding of the barycentrics and of their sum. At most 1.
    double barycentricTolerance = 1e-5;
    // The largest error of an interpolated texture coordinate, relative to the largest of the triangle: single
    // precision, whose products and sums are as large as the coordinates themselves. At most 2^-10.
    double interpolationTolerance = 16.0 / (1 << 24);

    // Worker threads; 0 takes one per processor. The result does not depend on it.
    unsigned threads = 0;
    // Bytes of micromap data after which to give up with BakeError. At most 2^32 - 1, what dataOffset can address.
    uint64_t maxDataBytes = uint64_t{1} << 30;
    // Called now and then with triangles done and in all, from any worker but one at a time. With a budget or
    // leastKnown, each triangle counts twice.
    std::function<void(size_t done, size_t total)> progress;
    // Makes bake() throw BakeCancelled soon after it returns true. Called often, from several workers at a time.
    std::function<bool()> cancelled;

    // Sets all tolerances to 0: states are those of the texture in exact arithmetic.
    BakeOptions &exactly()
    {
        valueTolerance = subtexelTolerance = barycentricTolerance = interpolationTolerance = 0;
        return *this;
    }
};

// Triangles with one texture. The spans must outlive the call of bake().
struct BakeInput {
    // The mip levels that the shader's sampler may read, in any number: a claim holds on each of them, and so for
    // whatever mixes two. One for a shader that reads one.
    std::span<const AlphaTexture> textures;
    std::span<const TriangleUvs> triangles;
    // The level and the format of each triangle. If empty, the options decide.
    std::span<const uint8_t> levels{};
    std::span<const Format> formats{};
    // Instead of those of the options.
    std::optional<double> cutoff{};
    std::optional<double> valueTolerance{};
    // The largest value in the single-precision computation of the coordinates: interpolationTolerance is relative to
    // this, where it is more than the largest coordinate of a triangle. Finite, and not below 0.
    double uvTerms = 0;
    // How much each triangle counts where a budget chooses what is known, 0 or more; if empty, each counts 1.
    std::span<const double> weights{};
    // For the budget, triangles share data only with those of inputs with the same number: those whose micromaps are
    // separated from the result.
    uint32_t group = 0;
};

struct BakeStatistics {
    std::array<uint64_t, 4> states{};  // micro-triangles of all triangles by State, folded ones included
    std::array<uint64_t, 4> special{}; // triangles that became a special index, by State
    size_t distinct = 0;               // triangles with different texture coordinates
};

struct BakeResult {
    // Valid, with baseTriangle 0. `indices` has one entry per triangle, those of the first input first.
    Micromap micromap;
    BakeStatistics statistics;
};

class BakeError : public std::runtime_error
{
public:
    using std::runtime_error::runtime_error;
};

// A result above maxDataBytes.
class BakeTooLarge : public BakeError
{
public:
    using BakeError::BakeError;
};

// Less than BakeOptions::leastKnown can be known.
class BakeTooLittleKnown : public BakeError
{
public:
    explicit BakeTooLittleKnown(double most) : BakeError("no level makes as much known as wanted"), most_(most) {}
    // What can be known, in the unit of the weights.
    [[nodiscard]] double most() const { return most_; }

private:
    double most_;
};

class BakeCancelled : public BakeError
{
public:
    BakeCancelled() : BakeError("the bake was cancelled") {}
};

// Bakes one micromap for the triangles of all inputs. Triangles with the same result share a micromap triangle,
// whatever their input; those that are one state all over become a special index. Throws BakeError for options, levels
// or a texture out of range, BakeTooLarge for a result above maxDataBytes.
BakeResult bake(std::span<const BakeInput> inputs, const BakeOptions &options);
BakeResult bake(const AlphaTexture &texture, std::span<const TriangleUvs> triangles, const BakeOptions &options);

} // namespace vellum
