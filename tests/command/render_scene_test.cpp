// SPDX-License-Identifier: Apache-2.0
// What vellum render makes of a scene's instances.
#include <cmath>
#include <ctime>
#include <gtest/gtest.h>

#include "render/render_scene.h"

using namespace vellum;
using namespace vellum::render;

// An instance has an inverse on the device. What is flat is drawn nevertheless, where it stands.
TEST(RenderScene, FlattenedInstancesAreDrawn)
{
    Scene scene;
    scene.materials.emplace_back();
    vellum::Geometry &card = scene.geometries.emplace_back();
    card.positions = {{0, 0, 0}, {1, 0, 0.5f}, {0, 1, 1}};
    card.uvs.resize(3);
    card.indices = {0, 1, 2};
    scene.meshes = {{0, 1}};
    const Transform visible[] = {
        kInPlace,
        {{{1, 0, 0, 5}, {0, 1, 0, 6}, {0, 0, 0, 7}}},
        {{{0, 0, 0, 0}, {0, 20, 0, 0}, {0, 0, -0.1f, 0}}},
        {{{0.5f, 0.5f, 0, 0}, {0.5f, 0.5f, 0, 0}, {0, 0, 3, 0}}}, // along a diagonal
    };
    for (const Transform &transform : visible)
        scene.instances.push_back({0, transform});
    scene.instances.push_back({0, {{{1, 0, 0, 5}, {0, 0, 0, 6}, {0, 0, 0, 7}}}}); // a line
    scene.instances.push_back({0, {{{0, 0, 0, 5}, {0, 0, 0, 6}, {0, 0, 0, 7}}}});
    const Scene prepared = prepareScene(scene, 1).scene;
    ASSERT_EQ(prepared.instances.size(), std::size(visible));
    for (size_t i = 0; i < std::size(visible); ++i) {
        EXPECT_GT(std::abs(determinant(prepared.instances[i].transform)), 1e-5) << i;
        for (const Vec3 &position : card.positions) {
            const Vec3 moved = transformed(prepared.instances[i].transform, position);
            EXPECT_LT(length(moved - transformed(visible[i], position)), 3e-3f) << i;
        }
    }
}

TEST(RenderScene, VerticesThatNoTriangleHasCostLittle)
{
    Scene scene;
    scene.materials.emplace_back();
    vellum::Geometry &card = scene.geometries.emplace_back();
    card.positions.resize(4'000'000, {0.25f, 0.25f, 0.5f});
    card.positions[1] = {1, 0, 0.5f};
    card.positions[2] = {0, 1, 1};
    card.uvs.resize(card.positions.size());
    card.indices = {0, 1, 2};
    scene.meshes = {{0, 1}};
    scene.instances = {{0, kInPlace}};
    const std::clock_t begin = std::clock();
    prepareScene(std::move(scene), 1);
    EXPECT_LT(static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC, 5);
}
