// SPDX-License-Identifier: Apache-2.0
#include "render/baked_scene.h"

#include <algorithm>
#include <map>

#include "gltf/file/gltf_error.h"
#include "gltf/micromaps/known_surface.h"

namespace vellum::render
{
namespace
{

// Gives each geometry its part of a micromap that was baked for all of them.
void divide(const Scene &scene, const std::vector<size_t> &geometries, Micromap whole, BakedScene &baked)
{
    if (geometries.size() == 1) {
        baked.results[geometries.front()] = std::move(whole);
        return;
    }
    StoredMicromaps stored;
    stored.micromaps.push_back({std::move(whole.triangles), std::move(whole.data), {}});
    auto next = whole.indices.begin();
    for (const size_t i : geometries) {
        const auto end = next + static_cast<ptrdiff_t>(scene.geometries[i].indices.size() / 3);
        const PrimitivePlace place{0, static_cast<uint32_t>(i)};
        stored.primitives[place] = {0, {next, end}, whole.baseTriangle};
        baked.results[i] = stored.of(place);
        next = end;
    }
}

} // namespace

std::vector<const Micromap *> BakedScene::micromaps() const
{
    std::vector<const Micromap *> pointers;
    for (const std::optional<Micromap> &r : results)
        pointers.push_back(r ? &*r : nullptr);
    return pointers;
}

std::array<double, 4> BakedScene::stateShares() const
{
    std::array<double, 4> sum{};
    size_t triangles = 0;
    for (const std::optional<Micromap> &r : results) {
        if (!r)
            continue;
        const auto ofTriangle = vellum::stateShares(r->triangles, r->data);
        for (const int32_t index : r->indices) {
            if (const auto state = specialState(index))
                sum[static_cast<size_t>(*state)] += 1;
            else
                for (size_t s = 0; s < 4; ++s)
                    sum[s] += ofTriangle[static_cast<uint32_t>(index) + r->baseTriangle][s];
        }
        triangles += r->indices.size();
    }
    for (double &share : sum)
        share /= static_cast<double>(std::max<size_t>(triangles, 1));
    return sum;
}

size_t BakedScene::count() const
{
    size_t count = 0;
    for (const std::optional<Micromap> &r : results)
        count += r ? 1u : 0u;
    return count;
}

BakedScene bakeScene(const Scene &scene, BakeOptions options, BlendRule blend)
{
    std::map<uint32_t, std::vector<size_t>> ofMaterial;
    for (size_t i = 0; i < scene.geometries.size(); ++i)
        if (scene.materials[scene.geometries[i].material].masked() && scene.geometries[i].alphas.empty())
            ofMaterial[scene.geometries[i].material].push_back(i);
    BakedScene baked;
    baked.results.resize(scene.geometries.size());
    for (const auto &[material, geometries] : ofMaterial) {
        const Material &m = scene.materials[material];
        if (m.alphaMode == AlphaMode::Blend && blend == BlendRule::Skip)
            continue;
        options.cutoff = static_cast<double>(m.alphaCutoff);
        std::vector<TriangleUvs> triangles;
        BakeInput input;
        if (m.alphaMode == AlphaMode::Blend && blend == BlendRule::Exact) {
            input.cutoff = kBlendCutoff;
            input.valueTolerance = kBlendBand;
        }
        for (const size_t i : geometries) {
            const Geometry &g = scene.geometries[i];
            input.uvTerms = std::max(input.uvTerms, static_cast<double>(g.uvTerms));
            for (size_t t = 0; t + 2 < g.indices.size(); t += 3)
                triangles.push_back({g.uvs[g.indices[t]], g.uvs[g.indices[t + 1]], g.uvs[g.indices[t + 2]]});
        }
        const AlphaTexture texture = alphaTexture(m, scene.images[static_cast<size_t>(m.image)]);
        input.textures = {&texture, 1};
        input.triangles = triangles;
        BakeResult whole = bake({&input, 1}, options);
        baked.distinctTriangles += whole.statistics.distinct;
        divide(scene, geometries, std::move(whole.micromap), baked);
    }
    return baked;
}

BakedScene storedScene(const Scene &scene, const StoredMicromaps &stored, uint64_t mostBytes)
{
    BakedScene baked;
    uint64_t bytes = 0;
    baked.extension = stored.extension;
    std::vector<std::vector<bool>> used; // by micromap, its triangles
    for (const StoredMicromap &micromap : stored.micromaps)
        used.emplace_back(micromap.triangles.size());
    for (const Geometry &g : scene.geometries) {
        baked.results.emplace_back();
        if (!g.place || !scene.materials[g.material].masked())
            continue;
        if (auto &micromap = baked.results.back() = stored.of(*g.place)) {
            bytes += micromap->data.size() + micromap->triangles.size() * sizeof(MicromapTriangle);
            if (bytes > mostBytes)
                throw GltfError("mesh " + std::to_string(g.place->mesh) + " primitive " +
                                std::to_string(g.place->primitive) +
                                ": the micromaps of all primitives have more than " + std::to_string(mostBytes) +
                                " bytes together");
            const PrimitiveMicromap &primitive = stored.primitives.at(*g.place);
            for (const int32_t index : primitive.indices)
                if (index >= 0)
                    used[primitive.micromap][static_cast<uint32_t>(index) + primitive.baseTriangle] = true;
        }
    }
    for (const std::vector<bool> &triangles : used)
        baked.distinctTriangles += static_cast<size_t>(std::count(triangles.begin(), triangles.end(), true));
    return baked;
}

} // namespace vellum::render
