// SPDX-License-Identifier: Apache-2.0
// Micromaps that a file has for the geometries of a scene.
#include <gtest/gtest.h>

#include "gltf/file/gltf_error.h"
#include "render/baked_scene.h"

using namespace vellum;
using namespace vellum::render;

// Many primitives of a small file may share one large micromap triangle; each copy of it takes memory.
TEST(StoredScene, CopiesAreBounded)
{
    StoredMicromaps stored;
    stored.micromaps.push_back({{{0, 5, Format::FourState}}, std::vector<uint8_t>(256), {}});
    Scene scene;
    scene.materials.emplace_back().alphaMode = AlphaMode::Mask;
    for (uint32_t i = 0; i < 4; ++i) {
        scene.geometries.emplace_back().place = PrimitivePlace{0, i};
        stored.primitives[{0, i}] = {0, {0, 0}, 0};
    }
    const uint64_t four = 4 * (256 + sizeof(MicromapTriangle));
    EXPECT_EQ(storedScene(scene, stored, four).count(), 4u);
    EXPECT_THROW(static_cast<void>(storedScene(scene, stored, four - 1)), GltfError);
}

// Primitives that share micromap triangles, special indices and a base count each triangle of the file once.
TEST(StoredScene, SharedTrianglesCountOnce)
{
    StoredMicromaps stored;
    const MicromapTriangle triangle{0, 0, Format::FourState};
    stored.micromaps.push_back({{triangle, triangle, triangle}, {0}, {}});
    stored.micromaps.push_back({{triangle}, {0}, {}});
    Scene scene;
    scene.materials.emplace_back().alphaMode = AlphaMode::Mask;
    for (uint32_t i = 0; i < 4; ++i)
        scene.geometries.emplace_back().place = PrimitivePlace{0, i};
    stored.primitives[{0, 0}] = {0, {0, 1}, 0};
    stored.primitives[{0, 1}] = {0, {0, -1}, 1};
    stored.primitives[{0, 2}] = {1, {0, -4}, 0};
    EXPECT_EQ(storedScene(scene, stored).distinctTriangles, 3u);
}

// So do those of a bake, however many geometries a material has: triangles with equal texture coordinates.
TEST(BakedScene, EqualTrianglesOfAMaterialCountOnce)
{
    const std::vector<uint8_t> halves = {0, 0, 0, 255, 0, 0, 0, 0};
    for (const size_t geometries : {size_t{1}, size_t{3}}) {
        Scene scene;
        scene.images.push_back({2, 1, halves});
        Material &material = scene.materials.emplace_back();
        material.alphaMode = AlphaMode::Mask;
        material.image = 0;
        for (size_t i = 0; i < geometries; ++i) {
            vellum::Geometry &geometry = scene.geometries.emplace_back();
            geometry.uvs = {{0, 0}, {1, 0}, {0, 1}, {0.05f, 0}, {0.1f, 0}, {0.05f, 0.1f}};
            geometry.positions.resize(geometry.uvs.size());
            geometry.indices = {0, 1, 2, 3, 4, 5, 0, 1, 2};
        }
        EXPECT_EQ(bakeScene(scene, {}).distinctTriangles, 2u) << geometries;
    }
}

// A special index weighs as much as a micromap triangle, baked or stored, of one geometry or of several.
TEST(BakedScene, TrianglesCountAlike)
{
    const std::vector<uint8_t> halves = {0, 0, 0, 255, 0, 0, 0, 0};
    const std::vector<TexCoord> mixed = {{0, 0}, {1, 0}, {0, 1}}, transparent = {{0.75f, 0}, {0.8f, 0}, {0.75f, 0.1f}};
    for (const size_t geometries : {size_t{1}, size_t{2}}) {
        Scene scene;
        scene.images.push_back({2, 1, halves});
        Material &material = scene.materials.emplace_back();
        material.alphaMode = AlphaMode::Mask;
        material.image = 0;
        for (size_t i = 0; i < geometries; ++i) {
            vellum::Geometry &geometry = scene.geometries.emplace_back();
            for (const auto *uvs : {&mixed, &transparent})
                geometry.uvs.insert(geometry.uvs.end(), uvs->begin(), uvs->end());
            geometry.positions.resize(geometry.uvs.size());
            geometry.indices = {0, 1, 2, 3, 4, 5};
        }
        BakeOptions options;
        options.level = 0;
        const std::array<double, 4> shares = bakeScene(scene, options).stateShares();
        EXPECT_EQ(shares[0], 0.5) << geometries; // the transparent one; the other is unknown
        EXPECT_EQ(shares[2] + shares[3], 0.5) << geometries;
        options.level = 5;
        EXPECT_GT(bakeScene(scene, options).stateShares()[1], 0.1) << geometries;
    }
    StoredMicromaps stored;
    stored.micromaps.push_back({{{0, 5, Format::FourState}}, std::vector<uint8_t>(256, 0x55), {}});
    Scene scene;
    scene.materials.emplace_back().alphaMode = AlphaMode::Mask;
    scene.geometries.emplace_back().place = PrimitivePlace{0, 0};
    stored.primitives[{0, 0}] = {0, {0, -1, -1, -4}, 0};
    EXPECT_EQ(storedScene(scene, stored).stateShares(), (std::array<double, 4>{0.5, 0.25, 0, 0.25}));
}
