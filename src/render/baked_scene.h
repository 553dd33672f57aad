// SPDX-License-Identifier: Apache-2.0
// The micromaps of a scene: for masked geometries, baked or from the scene's file.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "bake/bake.h"
#include "gltf/micromaps/stored_micromaps.h"
#include "gltf/scene.h"

namespace vellum::render
{

struct BakedScene {
    // By geometry. Nothing if it is solid, if the file has none for it, and for baked ones if its vertices have alphas,
    // which the baker does not support, or by BlendRule::Skip.
    std::vector<std::optional<Micromap>> results;
    std::string extension; // of the file that they are from; empty if they were baked
    // Of the file: micromap triangles that geometries refer to. Of a bake: triangles with different texture
    // coordinates, by material.
    size_t distinctTriangles = 0;

    // For World and Renderer; valid as long as this object is unchanged.
    [[nodiscard]] std::vector<const Micromap *> micromaps() const;
    // Shares of the states in all triangles of these geometries, each counted alike.
    [[nodiscard]] std::array<double, 4> stateShares() const;
    // Geometries with a micromap.
    [[nodiscard]] size_t count() const;
};

// What is baked for alphaMode BLEND.
enum class BlendRule : uint8_t {
    Skip,
    Exact, // opaque only where alpha is 1, transparent only where it is 0
    Mask,  // by the cutoff of the material
};

// Bakes every masked geometry of a scene against its material's texture: one bake for each material, after which each
// geometry has a micromap of its own. `options.cutoff` is taken from the material. Throws BakeError.
BakedScene bakeScene(const Scene &scene, BakeOptions options, BlendRule blend = BlendRule::Skip);

// The micromaps that the scene's file has for its masked geometries; those of solid ones are ignored. Primitives may
// share a micromap in the file, but each gets its own copy, here and on the device: throws GltfError if the copies
// have more than `mostBytes` together.
BakedScene storedScene(const Scene &scene, const StoredMicromaps &stored, uint64_t mostBytes = uint64_t{512} << 20);

} // namespace vellum::render
