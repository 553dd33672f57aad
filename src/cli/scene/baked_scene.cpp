#include "cli/scene/baked_scene.h"

namespace vellum::cli
{

std::vector<const Micromap *> BakedScene::micromaps() const
{
    std::vector<const Micromap *> pointers;
    for (const std::optional<BakeResult> &r : results)
        pointers.push_back(r ? &r->micromap : nullptr);
    return pointers;
}

std::array<double, 4> BakedScene::stateShares() const
{
    std::array<double, 4> shares{};
    double total = 0;
    for (const std::optional<BakeResult> &r : results) {
        for (std::size_t s = 0; r && s < 4; ++s) {
            shares[s] += static_cast<double>(r->statistics.states[s]);
            total += static_cast<double>(r->statistics.states[s]);
        }
    }
    for (double &share : shares)
        share = total > 0 ? share / total : 0;
    return shares;
}

std::size_t BakedScene::distinctTriangles() const
{
    std::size_t count = 0;
    for (const std::optional<BakeResult> &r : results)
        count += r ? r->statistics.distinct : 0;
    return count;
}

BakedScene bakeScene(const Scene &scene, BakeOptions options)
{
    BakedScene baked;
    for (const Geometry &g : scene.geometries) {
        const Material &m = scene.materials[g.material];
        if (!m.masked()) {
            baked.results.emplace_back();
            continue;
        }
        const Image &image = scene.images[static_cast<std::size_t>(m.image)];
        AlphaTexture texture =
            AlphaTexture::fromUnorm8(image.width, image.height, image.rgba.data() + 3, 4, m.baseColor[3]);
        texture.wrapU = m.wrapU;
        texture.wrapV = m.wrapV;
        texture.filter = m.filter;
        options.cutoff = static_cast<double>(m.alphaCutoff);
        std::vector<TriangleUvs> triangles;
        for (std::size_t i = 0; i + 2 < g.indices.size(); i += 3)
            triangles.push_back({g.uvs[g.indices[i]], g.uvs[g.indices[i + 1]], g.uvs[g.indices[i + 2]]});
        baked.results.emplace_back(bake(texture, triangles, options));
    }
    return baked;
}

} // namespace vellum::cli
