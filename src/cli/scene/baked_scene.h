// The micromaps of a scene: for masked geometries, baked or from the scene's file.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "bake/bake.h"
#include "gltf/micromaps/stored_micromaps.h"
#include "gltf/scene.h"

namespace vellum::cli
{

struct BakedScene {
    // By geometry. Nothing where it is solid, where the file has none for it, and for baked ones where its vertices
    // have alphas, which the baker does not know.
    std::vector<std::optional<BakeResult>> results;
    std::string extension; // that the file has them by; empty where they were baked

    // For World and Renderer; valid as long as this is not changed.
    [[nodiscard]] std::vector<const Micromap *> micromaps() const;
    // Micro-triangles of all geometry triangles by State.
    [[nodiscard]] std::array<double, 4> stateShares() const;
    [[nodiscard]] size_t distinctTriangles() const;
    // Geometries with a micromap.
    [[nodiscard]] size_t count() const;
};

// Bakes every masked geometry of a scene against its material's texture: one bake for each material, after which each
// geometry has a micromap of its own. `options.cutoff` is taken from the material. Throws BakeError.
BakedScene bakeScene(const Scene &scene, BakeOptions options);

// The micromaps that the scene's file has for its masked geometries. A solid one is drawn as it is, whatever the file
// says of it. Primitives may share what the file has, and each gets a copy, for a device too: throws GltfError where
// those have more than `mostBytes` together.
BakedScene storedScene(const Scene &scene, const StoredMicromaps &stored, uint64_t mostBytes = uint64_t{512} << 20);

} // namespace vellum::cli
