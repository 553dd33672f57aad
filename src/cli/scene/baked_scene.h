// The micromaps of a scene: one for each masked geometry.
#pragma once

#include <optional>
#include <vector>

#include "bake/bake.h"
#include "gltf/scene.h"

namespace vellum::cli
{

struct BakedScene {
    std::vector<std::optional<BakeResult>> results; // by geometry; nothing where it is solid

    // For World and Renderer; valid as long as this is not changed.
    [[nodiscard]] std::vector<const Micromap *> micromaps() const;
    // Micro-triangles of all geometry triangles by State.
    [[nodiscard]] std::array<double, 4> stateShares() const;
    [[nodiscard]] std::size_t distinctTriangles() const;
};

// Bakes every masked geometry of a scene against its material's texture. `options.cutoff` is taken from the material.
// Throws BakeError.
BakedScene bakeScene(const Scene &scene, BakeOptions options);

} // namespace vellum::cli
