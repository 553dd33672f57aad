// SPDX-License-Identifier: Apache-2.0
// The share of a scene's alpha-tested surface that its micromaps decide.
#pragma once

#include <array>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "gltf/micromaps/stored_micromaps.h"
#include "gltf/scene.h"

namespace vellum
{

// Shares of the states in each triangle of a micromap.
std::vector<std::array<double, 4>> stateShares(std::span<const MicromapTriangle> triangles,
                                               std::span<const uint8_t> data);

// Shares of all alpha-tested triangles by their area in the world, those of every instance counted; in sum 1.
struct SurfaceShares {
    std::array<double, 4> states{}; // by State, of triangles with a micromap
    double withoutMicromap = 0;
    double twoStates = 0; // of triangles with 2-state data, which is never unknown

    [[nodiscard]] double known() const
    {
        return states[static_cast<size_t>(State::Transparent)] + states[static_cast<size_t>(State::Opaque)];
    }
};

// `micromapOf` returns the micromap of a geometry of the scene, valid until the next call, or null. No result if no
// alpha-tested triangle has an area, or if there are more than 2^27 of them.
std::optional<SurfaceShares> surfaceShares(const Scene &scene,
                                           const std::function<const Micromap *(size_t)> &micromapOf);

// By alpha-tested primitive of the default scene, the areas of its triangles in the world, those of every instance
// added up.
using SurfaceAreas = std::map<PrimitivePlace, std::vector<double>>;
// Empty if the scene cannot be read, or in the cases above.
SurfaceAreas surfaceAreas(const Document &document);

// The shares with the micromaps of a file, which must outlive this. Their states are counted once, however many
// primitives they have.
class StoredShares
{
public:
    explicit StoredShares(const StoredMicromaps &stored);

    // No result without areas.
    [[nodiscard]] std::optional<SurfaceShares> of(const SurfaceAreas &areas) const;

private:
    struct Counted {
        std::vector<std::array<double, 4>> shares; // of each triangle
        bool approximate = false;
    };
    const StoredMicromaps &stored_;
    std::vector<Counted> counted_; // of each micromap
};

} // namespace vellum
