// SPDX-License-Identifier: Apache-2.0
#include "seeds.h"

#include <cstdio>
#include <png.h>

#include "compressed.h"

using namespace vellum::test;

namespace
{

Bytes bytesOf(const std::string &text)
{
    return {text.begin(), text.end()};
}

// Primitives that can be read from the binary chunk of gltf_fuzz.cpp.
const char *const kPrimitives = R"({"asset": {"version": "2.0"}, "meshes": [{"primitives": [
{"attributes": {"POSITION": 0, "TEXCOORD_0": 1, "COLOR_0": 2}, "indices": 3, "material": 0, "mode": 5,
 "targets": [{"TEXCOORD_0": 1}]},
{"attributes": {"POSITION": 4}, "material": 0, "mode": 6}]}], "materials": [{"alphaMode": "MASK", "pbrMetallicRoughness":
{"baseColorTexture": {"index": 0, "texCoord": 1, "extensions": {"KHR_texture_transform": {"texCoord": 0, "offset": [1, 2],
"rotation": 1, "scale": [2, 3]}}}}}], "textures": [{"source": 0, "sampler": 0, "extensions": {"EXT_texture_webp":
{"source": 0}, "EXT_texture_avif": {"source": 0}}}], "samplers": [{"wrapS": 33071}], "images": [{"uri": "data:image/png;base64,iVBORw0KGgo="}], "accessors": [
{"bufferView": 0, "componentType": 5120, "count": 6, "type": "VEC3", "normalized": true},
{"bufferView": 0, "byteOffset": 4, "componentType": 5123, "count": 6, "type": "VEC2"},
{"bufferView": 0, "componentType": 5121, "count": 6, "type": "VEC4", "normalized": true},
{"bufferView": 0, "componentType": 5125, "count": 6, "type": "SCALAR"},
{"componentType": 5126, "count": 6, "type": "VEC3", "sparse": {"count": 1, "indices": {"bufferView": 1,
"componentType": 5121}, "values": {"bufferView": 1}}}],
"bufferViews": [{"buffer": 0, "byteLength": 256, "byteStride": 4}, {"buffer": 0, "byteOffset": 256, "byteLength": 64}],
"buffers": [{"byteLength": 1024}], "nodes": [{"mesh": 0, "children": [1], "extensions": {"EXT_mesh_gpu_instancing":
{"attributes": {"TRANSLATION": 4}}}}, {"mesh": 0, "scale": [1, 2, 3], "skin": 0}], "scenes": [{"nodes": [0]}], "scene": 0,
"skins": [{"joints": [1]}]})";

const char *const kMicromaps = R"({"asset": {"version": "2.0"}, "extensionsUsed": ["EXT_mesh_opacity_micromap"],
"extensions": {"EXT_mesh_opacity_micromap": {"micromaps": [{"data": 1, "triangles": 0,
"usageCounts": [6], "levels": [0], "formats": [1]}]}}, "meshes": [{"primitives": [{"attributes": {"POSITION": 0},
"extensions": {"EXT_mesh_opacity_micromap": {"micromap": 0, "micromapIndices": 1, "micromapBaseTriangle": 0}}}]}],
"accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
{"bufferView": 0, "componentType": 5125, "count": 1, "type": "SCALAR"}],
"bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 512, "byteLength": 64}],
"buffers": [{"byteLength": 1024}]})";

const char *const kCompressed =
    R"({"asset": {"version": "2.0"}, "meshes": [{"primitives": [{"attributes": {"POSITION": 0},
"extensions": {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}}}, {"attributes":
{"POSITION": 1}}]}], "accessors": [{"componentType": 5126, "count": 6, "type": "VEC3"}, {"bufferView": 1,
"componentType": 5126, "count": 6, "type": "VEC3"}], "bufferViews": [{"buffer": 0, "byteLength": 99}, {"buffer": 1,
"byteLength": 72, "extensions": {"EXT_meshopt_compression": {"buffer": 0, "byteLength": 99, "byteStride": 12, "count": 6,
"mode": "ATTRIBUTES", "filter": "EXPONENTIAL"}}}], "buffers": [{"byteLength": 1024}, {"byteLength": 72}]})";

// A primitive that is baked; its positions are those of the binary chunk.
const std::string kLeaf =
    R"({"asset": {"version": "2.0"}, "meshes": [{"name": "m", "primitives": [{"attributes": {"POSITION": 0,
"TEXCOORD_0": 1}, "material": 0}]}], "materials": [{"name": "leaf", "alphaMode": "MASK", "pbrMetallicRoughness":
{"baseColorTexture": {"index": 0}}}], "textures": [{"source": 0, "sampler": 0}], "samplers": [{"wrapS": 33071}],
"images": [{"uri": "data:image/png;base64,)"
    "iVBORw0KGgoAAAANSUhEUgAAAAgAAAAICAYAAADED76LAAAAHUlEQVR42mPg5ORkAOL/UIzBxiuJrACnQoahYAUAHysxlm5lv34A"
    "AAAASUVORK5CYII="
    R"("}], "accessors": [{"bufferView": 0, "componentType": 5121, "count": 3, "type": "VEC3"}, {"bufferView": 1,
"componentType": 5126, "count": 3, "type": "VEC2"}], "bufferViews": [{"buffer": 0, "byteLength": 36, "byteStride": 4},
{"buffer": 1, "byteLength": 24}], "buffers": [{"byteLength": 1024}, {"byteLength": 24, "uri": "data:;base64,)"
    "AAAAAAAAAAAAAIA/AAAAAAAAAAAAAIA/"
    R"("}], "nodes": [{"mesh": 0}]})";

// An input that gltf_input.h expands: `part`, which follows `after`, is repeated.
Bytes repeatedPart(const std::string &json, const std::string &after, const std::string &part)
{
    const size_t begin = json.find(after) + after.size();
    constexpr size_t kTimes = 2000;
    Bytes bytes;
    for (const size_t number : {begin, part.size(), kTimes})
        bytes.insert(bytes.end(), {static_cast<uint8_t>(number), static_cast<uint8_t>(number >> 8)});
    const std::string text = json.substr(0, begin) + part + json.substr(begin);
    bytes.insert(bytes.end(), text.begin(), text.end());
    return bytes;
}

} // namespace

void writeGltfSeeds(const std::filesystem::path &folder)
{
    const Bytes rgba(8 * 8 * 4, 99);
    const std::vector<uint32_t> indices = {0, 1, 2, 2, 1, 3};
    const auto seed = [&](uint8_t kind, const char *name, Bytes bytes, const Bytes &head = {}) {
        bytes.insert(bytes.begin(), head.begin(), head.end());
        bytes.insert(bytes.begin(), kind);
        writeFile(folder / name, bytes);
    };
    seed(0, "card.glb", cardGlb());
    seed(0, "text.gltf", bytesOf(kPrimitives));
    seed(1, "primitives.json", bytesOf(kPrimitives));
    seed(1, "micromaps.json", bytesOf(kMicromaps));
    seed(1, "compressed.json", bytesOf(kCompressed));
    seed(1, "leaf.json", bytesOf(kLeaf));
    const std::string primitive = R"({"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0},)";
    const std::string material =
        R"({"alphaMode": "MASK", "alphaCutoff": 0.#1, "pbrMetallicRoughness": {"baseColorTexture":
{"index": 0}}},)";
    seed(5, "attributes.json", repeatedPart(kLeaf, "\"attributes\": {", "\"_#\":0,"));
    seed(5, "primitives_of_one.json", repeatedPart(kLeaf, "\"primitives\": [", primitive));
    seed(5, "materials.json", repeatedPart(kLeaf, "\"materials\": [", material));
    seed(5, "targets.json", repeatedPart(kLeaf, "\"material\": 0", R"(, "_#": 0)"));
    seed(5, "nodes.json", repeatedPart(kLeaf, "\"nodes\": [", R"({"mesh": 0, "weights": [#]},)"));
    seed(5, "names.json", repeatedPart(kLeaf, "\"name\": \"", "#mm"));
    seed(5, "required.json", repeatedPart(kLeaf, "{\"asset\"", R"(: {"version": "2.0"}, "x#")"));
    seed(2, "rgba.png", pngImage(8, 8, 8, PNG_COLOR_TYPE_RGBA, false, rgba));
    seed(2, "interlaced.png", pngImage(8, 4, 16, PNG_COLOR_TYPE_GRAY_ALPHA, true, Bytes(128)));
    seed(2, "image.webp", webpImage(8, 8, rgba));
    seed(2, "image.jpg", jpegImage(8, 8, rgba));
    const std::vector<uint16_t> wide(rgba.begin(), rgba.end());
    seed(2, "image.avif", avifImage(8, 8, wide));
    seed(2, "wide.avif", avifImage(8, 8, wide, {.depth = 10}));
    seed(2, "grid.avif", avifImage(64, 64, std::vector<uint16_t>(size_t{4} * 64 * 64, 9), {.columns = 2}));
    const std::vector<std::array<float, 3>> positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0},
                                                         {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
    const std::vector<std::array<float, 2>> uvs(6);
    seed(3, "edgebreaker.drc", dracoTriangles(positions, uvs));
    seed(3, "sequential.drc", dracoTriangles(positions, uvs, true));
    seed(4, "attributes.meshopt", meshoptAttributes(Bytes(64), 16), {0, 3, 4, 0});
    seed(4, "triangles.meshopt", meshoptTriangles(indices), {1, 0, 6, 0});
    seed(4, "indices.meshopt", meshoptIndices(indices), {2, 1, 6, 0});
}
