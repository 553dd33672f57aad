// SPDX-License-Identifier: Apache-2.0
// Verification: whether the states of a micromap hold for the texture, by a method that shares nothing with the baker's
// (docs/design/verifier.md).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "bake/texture/texture.h"
#include "core/micromap.h"
#include "verify/polygon.h"
#include "verify/region.h"
#include "verify/texels.h"

namespace vellum::verify
{

struct Options {
    // A value is opaque where it is at least this.
    double cutoff = 0.5;
    // Values that are nearer to the cutoff are neither opaque nor transparent (alphaMode BLEND).
    double band = 0;
    // Tolerances for margins, and for findings of needlessly unknown; the baker's defaults. A wrong claim is wrong
    // without tolerances.
    Tolerances tolerances;
    // Claims of 2-state data count as those of 4-state data: as wrong unless they hold all over the micro-triangle.
    // Otherwise they are treated as the approximation that they usually are, and only counted.
    bool strictTwoState = false;
    // Special indices are such claims as well: all else of the micromap has 2 states.
    bool twoStateSpecials = false;
    // Triangles of this micromap have more vertex alphas than the baker decides: those that are unknown as a whole are
    // not needlessly so.
    bool manyAlphas = false;
    // Most findings of each kind that are listed; all are counted.
    size_t maxFindings = 20;
    // 0 takes one for each processor. The result does not depend on it.
    unsigned threads = 0;
    // The most work to do for all triangles together, in parts of triangles looked at; a fraction of a microsecond
    // each. The rest is counted as open, and not by its states.
    uint64_t work = ~uint64_t{0};
    // Called now and then, by one thread at a time, with triangles done and in all.
    std::function<void(size_t done, size_t total)> progress;

    [[nodiscard]] AlphaRule rule() const { return {cutoff - band, cutoff + band}; }
};

enum class Kind : uint8_t {
    Wrong,          // opaque or transparent, but not everywhere
    OutsideMargins, // the claim holds, but not with the margins of GPUs
    Needless,       // unknown, though it is opaque or transparent with all margins
};
inline constexpr size_t kKinds = 3;

struct Finding {
    Kind kind = Kind::Wrong;
    uint32_t triangle = 0;
    // The micro-triangle, and the level that it is of. A special index is one micro-triangle of level 0.
    uint32_t microTriangle = 0;
    uint32_t level = 0;
    bool special = false;
    State state = State::Opaque; // claimed by the micromap
    // A place that contradicts it, or for Kind::Needless the middle, and the value there. Not a number where texture
    // coordinates or texels are not.
    double u = 0;
    double v = 0;
    double value = 0;
};

// Numbers of micro-triangles, with a special index counting as one.
struct Counts {
    uint64_t opaque = 0; // by the micromap, without 2-state data
    uint64_t transparent = 0;
    uint64_t unknown = 0;
    std::array<uint64_t, kKinds> findings{}; // by Kind
    // Claims that could be neither proven nor refuted with a bounded amount of work, or because the factor changes
    // within the triangle and the value comes as near to the cutoff as the bounds are apart.
    uint64_t open = 0;
    // 2-state data: what is so all over the micro-triangle; what stands for both outcomes; what is the other state all
    // over it.
    uint64_t twoStateTrue = 0;
    uint64_t twoStateMixed = 0;
    uint64_t twoStateReversed = 0;

    Counts &operator+=(const Counts &other);
    [[nodiscard]] uint64_t microTriangles() const;
    [[nodiscard]] uint64_t of(Kind kind) const { return findings[static_cast<size_t>(kind)]; }
};

struct Result {
    Counts counts;
    std::vector<Finding> findings; // the first of each kind, by triangle and micro-triangle
    size_t distinct = 0;           // triangles that differ in coordinates or index
    uint64_t work = 0;             // work done
};

// `micromap` must be valid and have an index for each triangle, the texture a value for each texel and at least one
// texel; throws std::invalid_argument where that is not so.
Result verify(const AlphaTexture &texture, std::span<const TriangleCorners> triangles, const Micromap &micromap,
              const Options &options);
// Verifies with a texture that was prepared before, which takes most of the time where triangles are few.
Result verify(const Texels &texels, std::span<const TriangleCorners> triangles, const Micromap &micromap,
              const Options &options);

} // namespace vellum::verify
