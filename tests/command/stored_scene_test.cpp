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
