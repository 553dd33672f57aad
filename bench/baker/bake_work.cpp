// SPDX-License-Identifier: Apache-2.0
#include "bake_work.h"

#include "bake_scene.h"
#include "gltf/scene.h"

namespace vellum::bench
{
AlphaTexture BakeMesh::texture() const
{
    AlphaTexture texture = AlphaTexture::fromUnorm8(width, height, alpha.data(), 1, width);
    texture.wrapU = wrapU;
    texture.wrapV = wrapV;
    return texture;
}

BakeWork leaves(uint32_t size, size_t triangles)
{
    BakeMesh mesh;
    mesh.width = mesh.height = size;
    mesh.alpha = paintLeaves(size);
    mesh.triangles = scatter(triangles, size);
    return {"leaves, " + std::to_string(size) + ", " + std::to_string(triangles), {std::move(mesh)}};
}

BakeWork leafCards(const std::filesystem::path &file)
{
    BakeWork work{file.stem().string(), {}};
    const Scene scene = readGltf(file);
    for (const Geometry &geometry : scene.geometries) {
        const Material &material = scene.materials[geometry.material];
        if (!material.masked())
            continue;
        const Image &image = scene.images[static_cast<size_t>(material.image)];
        BakeMesh mesh;
        mesh.width = image.width;
        mesh.height = image.height;
        for (size_t i = 3; i < image.rgba.size(); i += 4)
            mesh.alpha.push_back(image.rgba[i]);
        mesh.wrapU = material.wrapU;
        mesh.wrapV = material.wrapV;
        mesh.cutoff = static_cast<double>(material.alphaCutoff);
        for (size_t i = 0; i + 2 < geometry.indices.size(); i += 3)
            mesh.triangles.push_back({geometry.uvs[geometry.indices[i]], geometry.uvs[geometry.indices[i + 1]],
                                      geometry.uvs[geometry.indices[i + 2]]});
        work.meshes.push_back(std::move(mesh));
    }
    return work;
}

} // namespace vellum::bench
