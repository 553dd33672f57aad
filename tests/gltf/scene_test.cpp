// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "glb_file.h"
#include "gltf/file/uri.h"
#include "gltf/scene.h"
#include "test_random.h"

using namespace vellum;
using namespace vellum::test;

namespace
{

// Reads what the bytes of a file mean.
Scene sceneOf(const Bytes &bytes)
{
    const TemporaryFolder folder;
    writeFile(folder / "test.glb", bytes);
    return readGltf(folder / "test.glb");
}

// The error for a card whose JSON was changed: without the file's name, which it must begin with.
std::string errorOfCard(const Replacements &replacements)
{
    try {
        sceneOf(cardGlb(replacements));
    } catch (const GltfError &error) {
        const std::string text = error.what();
        EXPECT_EQ(text.find('\n'), std::string::npos);
        EXPECT_NE(text.find("test.glb: "), std::string::npos);
        return text.substr(text.find("test.glb: ") + 10);
    }
    return "none";
}

} // namespace

TEST(Gltf, ReadsACard)
{
    const Scene scene = sceneOf(cardGlb());
    ASSERT_EQ(scene.geometries.size(), 2u);
    ASSERT_EQ(scene.materials.size(), 2u);
    ASSERT_EQ(scene.images.size(), 1u);
    const Material &leaf = scene.materials[0];
    EXPECT_EQ(leaf.name, "leaf");
    EXPECT_TRUE(leaf.masked());
    EXPECT_EQ(leaf.alphaCutoff, 0.25f);
    EXPECT_EQ(leaf.baseColor, (std::array<float, 4>{1, 0.5f, 0.25f, 0.75f}));
    EXPECT_EQ(leaf.wrapU, Wrap::Clamp);
    EXPECT_EQ(leaf.wrapV, Wrap::Mirror);
    EXPECT_EQ(leaf.filter, Filter::Nearest);
    const Image &image = scene.images[0];
    EXPECT_EQ(image.width, 16u);
    EXPECT_EQ(image.height, 16u);
    EXPECT_EQ(image.rgba[3], 0);
    EXPECT_EQ(image.rgba[4 * (8 * 16 + 8) + 3], 255);
    const Geometry &card = scene.geometries[0];
    EXPECT_EQ(card.indices, (std::vector<uint32_t>{0, 1, 2, 0, 2, 3}));
    EXPECT_EQ(card.positions[2], (Vec3{1, 2, 0}));
    EXPECT_EQ(card.place, (PrimitivePlace{0, 0}));
    ASSERT_EQ(scene.meshes.size(), 1u);
    EXPECT_EQ(scene.meshes[0].geometryCount, 2u);
    ASSERT_EQ(scene.instances.size(), 1u);
    EXPECT_EQ(transformed(scene.instances[0].transform, card.positions[2]), (Vec3{1, 4, 0})); // moved by its node
    EXPECT_EQ(card.uvs[0], (TexCoord{0, 1}));
    EXPECT_FALSE(scene.materials[1].masked());
    EXPECT_EQ(scene.geometries[1].indices, (std::vector<uint32_t>{0, 1, 2}));
}

TEST(Gltf, AppliesTransforms)
{
    const Scene turned = sceneOf(cardGlb(
        {{"\"translation\": [0, 2, 0]", "\"rotation\": [0, 0, 0.70710678, 0.70710678], \"scale\": [2, 1, 1]"}}));
    const Vec3 corner = transformed(turned.instances[0].transform, turned.geometries[0].positions[1]);
    EXPECT_NEAR(corner[0], 0, 1e-5); // (1, 0, 0) -> (2, 0, 0) -> (0, 2, 0)
    EXPECT_NEAR(corner[1], 2, 1e-5);
    const Scene matrix =
        sceneOf(cardGlb({{"\"translation\": [0, 2, 0]", "\"matrix\": [1,0,0,0, 0,1,0,0, 0,0,1,0, 5,6,7,1]"}}));
    EXPECT_EQ(transformed(matrix.instances[0].transform, matrix.geometries[0].positions[1]), (Vec3{6, 6, 7}));
    const Scene uvs =
        sceneOf(cardGlb({{"\"baseColorTexture\": {\"index\": 0}",
                          "\"baseColorTexture\": {\"index\": 0, \"extensions\": {\"KHR_texture_transform\": "
                          "{\"offset\": [0.5, 0.25], \"scale\": [2, 4]}}}"}}));
    EXPECT_EQ(uvs.geometries[0].uvs[1], (TexCoord{2.5f, 4.25f}));
}

TEST(Gltf, ReadsTextFilesWithSeparateFiles)
{
    const TemporaryFolder folder;
    const Bytes glb = cardGlb();
    const Bytes png = discPng();
    std::string json = cardJson(png.size(), 92 + png.size());
    const std::string embedded = "\"mimeType\": \"image/png\", \"bufferView\": 3";
    json.replace(json.find(embedded), embedded.size(), "\"uri\": \"disc.png\"");
    json.insert(json.find("\"byteLength\": " + std::to_string(92 + png.size())), "\"uri\": \"card.bin\", ");
    writeFile(folder / "card.gltf", Bytes(json.begin(), json.end()));
    EXPECT_THROW(readGltf(folder / "card.gltf"), GltfError);
    const size_t jsonChunk = glb[12] + 256u * glb[13];
    const auto binary = glb.begin() + static_cast<ptrdiff_t>(28 + jsonChunk);
    writeFile(folder / "card.bin", Bytes(binary, binary + static_cast<ptrdiff_t>(92 + png.size())));
    EXPECT_THROW(readGltf(folder / "card.gltf"), GltfError);
    writeFile(folder / "disc.png", png);
    EXPECT_EQ(readGltf(folder / "card.gltf").images[0].width, 16u);
    // A path may go up as far as it went down.
    json.replace(json.find("\"card.bin\""), 10, "\"x/../card.bin\"");
    json.replace(json.find("\"disc.png\""), 10, "\"x/%2e%2e/disc.png\"");
    writeFile(folder / "card.gltf", Bytes(json.begin(), json.end()));
    EXPECT_EQ(readGltf(folder / "card.gltf").images[0].width, 16u);
}

// RFC 3986: schemes and "%3D" are the same in any case, and percent-encoding may be anywhere.
TEST(Gltf, ReadsDataUris)
{
    const std::string expected("\x00\x01\xff\xfe", 4);
    for (const char *uri :
         {"data:application/octet-stream;base64,AAH//g==", "data:;base64,AAH//g", "data:;base64,AAH%2F%2fg%3D%3D",
          "DATA:;BASE64,AAH//g==", "Data:text/plain;charset=x;Base64,AAH//g==", "dAtA:,%00%01%ff%FE"}) {
        ASSERT_TRUE(isDataUri(uri)) << uri;
        const std::vector<uint8_t> bytes = readDataUri(uri).bytes;
        EXPECT_EQ(std::string(bytes.begin(), bytes.end()), expected) << uri;
    }
    EXPECT_FALSE(isDataUri("data"));
    EXPECT_FALSE(isDataUri("datum:,x"));
}

// glTF 2.0, "pbrMetallicRoughness": a texture that is not there reads as 1.
TEST(Gltf, MaskedWithoutTexture)
{
    const Scene scene = sceneOf(cardGlb({{", \"baseColorTexture\": {\"index\": 0}", ""}}));
    const Material &leaf = scene.materials[0];
    ASSERT_GE(leaf.image, 0);
    EXPECT_EQ(scene.images[static_cast<size_t>(leaf.image)].rgba, (std::vector<uint8_t>{255, 255, 255, 255}));
    EXPECT_EQ(alphaTexture(leaf, scene.images[static_cast<size_t>(leaf.image)]).texel(0, 0), leaf.baseColor[3]);
}

TEST(Gltf, ReportsErrors)
{
    EXPECT_EQ(errorOfCard({{", \"TEXCOORD_0\": 1", ""}}),
              "mesh 0 primitive 0 has the masked material \"leaf\" but no texture coordinates (TEXCOORD_0)");
    EXPECT_EQ(errorOfCard({{"\"baseColorTexture\": {\"index\": 0}", "\"baseColorTexture\": {\"index\": 3}"}}),
              "texture 3 does not exist");
    EXPECT_EQ(errorOfCard({{"\"source\": 0, ", ""}}), "texture 0 has no image that is known here");
    EXPECT_EQ(errorOfCard({{"\"source\": 0", "\"source\": 9"}}), "image 9 does not exist");
    EXPECT_EQ(errorOfCard({{"\"sampler\": 0", "\"sampler\": 9"}}), "sampler 9 does not exist");
    EXPECT_EQ(errorOfCard({{"\"material\": 0", "\"material\": 7"}}), "material 7 does not exist");
    EXPECT_EQ(errorOfCard({{"\"mesh\": 0", "\"mesh\": 1"}}), "mesh 1 does not exist");
    EXPECT_EQ(errorOfCard({{"\"scenes\": [{\"nodes\": [0]}]", "\"scenes\": [{\"nodes\": [4]}]"}}),
              "node 4 does not exist");
    EXPECT_EQ(errorOfCard({{"\"nodes\": [{\"mesh\": 0", "\"nodes\": [{\"children\": [0], \"mesh\": 0"}}),
              "node 0 is used more than once");
    EXPECT_EQ(errorOfCard({{"\"scenes\": [{\"nodes\": [0]}]", "\"scenes\": [{\"nodes\": []}]"}}),
              "there are no triangles in it");
}

TEST(Gltf, ChecksAccessors)
{
    EXPECT_EQ(errorOfCard({{"\"componentType\": 5123, \"count\": 6", "\"componentType\": 5123, \"count\": 9"}}),
              "mesh 0 primitive 0 indices: accessor 2 reaches outside of its buffer view");
    EXPECT_EQ(errorOfCard({{"\"componentType\": 5123, \"count\": 6", "\"componentType\": 5123, \"count\": 4"}}),
              "mesh 0 primitive 0 has 4 indices, no multiple of 3");
    EXPECT_EQ(errorOfCard({{"\"componentType\": 5123", "\"componentType\": 5126"}}),
              "mesh 0 primitive 0 indices: accessor 2 reaches outside of its buffer view");
    EXPECT_EQ(errorOfCard({{"{\"bufferView\": 0, \"componentType\": 5126, \"count\": 4",
                            "{\"bufferView\": 0, \"componentType\": 5126, \"count\": 2"}}),
              "mesh 0 primitive 0: index 2 of 2 vertices");
    EXPECT_EQ(errorOfCard({{"\"count\": 4, \"type\": \"VEC2\"", "\"count\": 4, \"type\": \"VEC3\""}}),
              "mesh 0 primitive 0 TEXCOORD_0: accessor 1 has the wrong type");
    EXPECT_EQ(errorOfCard({{"\"count\": 4, \"type\": \"VEC2\"", "\"count\": 3, \"type\": \"VEC2\""}}),
              "mesh 0 primitive 0 has 3 texture coordinates for 4 vertices");
    EXPECT_EQ(errorOfCard({{"\"byteOffset\": 12, ", "\"byteOffset\": 9223372036854775807, "}}),
              "mesh 0 primitive 1 POSITION: accessor 3 reaches outside of its buffer view");
    EXPECT_EQ(errorOfCard({{"\"byteOffset\": 48, \"byteLength\": 32", "\"byteOffset\": 480000, \"byteLength\": 32"}}),
              "mesh 0 primitive 0 TEXCOORD_0: buffer view 1 reaches outside of its buffer");
    EXPECT_EQ(errorOfCard({{"{\"buffer\": 0, \"byteLength\": 48}", "{\"buffer\": 5, \"byteLength\": 48}"}}),
              "mesh 0 primitive 0 POSITION: buffer view 0: buffer 5 does not exist");
    EXPECT_NE(
        errorOfCard({{"\"count\": 4, \"type\": \"VEC3\"", "\"count\": 18446744073709551615, \"type\": \"VEC3\""}}),
        "none");
}

TEST(Gltf, ChecksImages)
{
    EXPECT_EQ(errorOfCard({{"\"byteOffset\": 92, ", "\"byteOffset\": 93, "}}),
              "image 0: buffer view 3 reaches outside of its buffer");
    EXPECT_EQ(errorOfCard({{"\"image/png\", \"bufferView\": 3", "\"image/png\", \"bufferView\": 0"}}).substr(0, 26),
              "image 0 cannot be decoded:");
    EXPECT_EQ(errorOfCard({{"\"mimeType\": \"image/png\", \"bufferView\": 3", "\"uri\": \"nowhere.png\""}}),
              "image 0 (nowhere.png): no such file");
}

TEST(Gltf, NestingIsLimited)
{
    std::string deep;
    for (int i = 0; i < 100000; ++i)
        deep += "[";
    EXPECT_EQ(errorOfCard({{"\"scene\": 0", "\"extras\": " + deep}}), "the JSON is nested too deeply");
}

TEST(Gltf, EveryTruncationIsAnError)
{
    const Bytes whole = cardGlb();
    for (size_t length = 0; length < whole.size(); length += length < 64 ? 1 : 13) {
        EXPECT_THROW(sceneOf(Bytes(whole.begin(), whole.begin() + static_cast<ptrdiff_t>(length))), GltfError)
            << length << " bytes";
        // The header's length adapted, so that more than the header has to notice.
        Bytes cut(whole.begin(), whole.begin() + static_cast<ptrdiff_t>(length));
        if (length < 12)
            continue;
        cut[8] = static_cast<uint8_t>(length);
        cut[9] = static_cast<uint8_t>(length >> 8);
        EXPECT_THROW(sceneOf(cut), GltfError) << length << " bytes";
    }
}

TEST(Gltf, RandomDamageNeverCrashes)
{
    const Bytes whole = cardGlb();
    test::TestRandom random(1);
    for (int i = 0; i < 3000; ++i) {
        Bytes damaged = whole;
        for (unsigned k = 0; k < 1 + random() % 4; ++k)
            damaged[random() % damaged.size()] = static_cast<uint8_t>(random());
        try {
            sceneOf(damaged);
        } catch (const GltfError &error) {
            EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
        }
    }
}

TEST(Gltf, OtherFiles)
{
    const TemporaryFolder folder;
    EXPECT_THROW(readGltf(folder / "missing.glb"), GltfError);
    EXPECT_THROW(readGltf(folder.path()), GltfError);
    EXPECT_THROW(sceneOf({}), GltfError);
    EXPECT_THROW(sceneOf(Bytes(1000, 0x5a)), GltfError);
    EXPECT_THROW(sceneOf({'{', '}'}), GltfError);
}
