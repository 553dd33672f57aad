// SPDX-License-Identifier: Apache-2.0
// Geometry that is compressed reads as what was compressed.
#include <algorithm>
#include <cstring>
#include <gtest/gtest.h>

#include "compressed.h"
#include "gltf/micromaps/document_bake.h"
#include "gltf/primitive.h"

using namespace vellum;
using namespace vellum::test;

namespace
{

const std::vector<std::array<float, 3>> kPositions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
const std::vector<std::array<float, 2>> kUvs = {{0, 0}, {1, 0}, {0, 1}, {1, 0}, {1, 1}, {0, 1}};

std::string glbOf(const std::string &primitive, const std::string &accessors, const std::string &views,
                  size_t binaryBytes, size_t fallbackBytes)
{
    return R"({"asset": {"version": "2.0"}, "meshes": [{"primitives": [)" + primitive +
           R"(]}], "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}], "textures": [{"source": 0}],
           "images": [{"uri": "none.png"}], "accessors": [)" +
           accessors + "], \"bufferViews\": [" + views +
           "], \"buffers\": [{\"byteLength\": " + std::to_string(binaryBytes) +
           "}, {\"byteLength\": " + std::to_string(fallbackBytes) + "}]}";
}

Primitive readFirst(const std::string &json, const Bytes &binary)
{
    const TemporaryFolder folder;
    writeFile(folder / "test.glb", packGlb(json, binary));
    return readPrimitive(Document(folder / "test.glb"), {0, 0}, Positions::Read);
}

std::string errorOfPrimitive(const std::string &json, const Bytes &binary)
{
    try {
        static_cast<void>(readFirst(json, binary));
    } catch (const GltfUnsupported &error) {
        return std::string("unsupported: ") + (std::strstr(error.what(), "test.glb: ") + 10);
    } catch (const GltfError &error) {
        return std::strstr(error.what(), "test.glb: ") + 10;
    }
    return "none";
}

std::string dracoJson(size_t bytes, const std::string &ids = R"({"POSITION": 0, "TEXCOORD_0": 1})")
{
    return glbOf(
        R"({"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0, "extensions":
                    {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": )" +
            ids + "}}}",
        R"({"componentType": 5126, "count": 6, "type": "VEC3"}, {"componentType": 5126, "count": 6, "type": "VEC2"},
                    {"componentType": 5123, "count": 6, "type": "SCALAR"})",
        "{\"buffer\": 0, \"byteLength\": " + std::to_string(bytes) + "}", bytes, 1);
}

// The corners of each triangle, in an order that does not depend on which comes first.
using Corner = std::array<float, 5>;
std::vector<std::array<Corner, 3>> trianglesOf(const Primitive &primitive)
{
    std::vector<std::array<Corner, 3>> triangles;
    for (size_t t = 0; t < primitive.triangleCount(); ++t) {
        std::array<Corner, 3> corners{};
        for (size_t c = 0; c < 3; ++c) {
            const size_t i = primitive.indices[3 * t + c];
            const Vec3 &p = primitive.positions[i];
            corners[c] = {p[0], p[1], p[2], primitive.uvs[i].u, primitive.uvs[i].v};
        }
        std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
        triangles.push_back(corners);
    }
    std::sort(triangles.begin(), triangles.end());
    return triangles;
}

Primitive uncompressed()
{
    Primitive primitive;
    for (size_t i = 0; i < kPositions.size(); ++i) {
        primitive.positions.push_back(kPositions[i]);
        primitive.uvs.push_back({kUvs[i][0], kUvs[i][1]});
        primitive.indices.push_back(static_cast<uint32_t>(i));
    }
    return primitive;
}

// What a message about something that the library cannot decode goes on with.
std::string whichNeeds(const std::string &needed)
{
    return ", which the meshoptimizer of this build (" + std::to_string(kMeshoptVersion / 1000) + '.' +
           std::to_string(kMeshoptVersion % 1000 / 10) +
           ") cannot decode: use gltfpack -c in place of -cz, or build with " + needed;
}

} // namespace

TEST(GltfCompressed, Draco)
{
    for (const bool sequential : {false, true}) {
        const Bytes encoded = dracoTriangles(kPositions, kUvs, sequential);
        EXPECT_EQ(trianglesOf(readFirst(dracoJson(encoded.size()), encoded)), trianglesOf(uncompressed()));
    }
}

// Without indices, readers of micromaps count triangles by positions, of which compressed data has fewer.
TEST(GltfCompressed, DracoWithoutIndicesIsNotBaked)
{
    const Bytes encoded = dracoTriangles(kPositions, kUvs, false);
    for (const auto &[count, micromaps] : {std::pair("4", 0u), std::pair("6", 1u)}) {
        std::string json = dracoJson(encoded.size());
        const auto replace = [&](const std::string &from, const std::string &to) {
            ASSERT_NE(json.find(from), std::string::npos);
            json.replace(json.find(from), from.size(), to);
        };
        replace("\"indices\": 2, ", "");
        replace(R"("count": 6, "type": "VEC3")", std::string("\"count\": ") + count + ", \"type\": \"VEC3\"");
        replace(
            R"("materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}])",
            R"("materials": [{"alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.75]}}])");
        const TemporaryFolder folder;
        writeFile(folder / "test.glb", packGlb(json, encoded));
        const DocumentBake bake = bakeDocument(Document(folder / "test.glb"), {});
        EXPECT_EQ(bake.micromaps.size(), micromaps) << count;
        EXPECT_EQ(bake.skipped.size(), 1 - micromaps) << count;
    }
}

// Attributes that move vertices (JOINTS_0, WEIGHTS_0) are compressed as well.
TEST(GltfCompressed, EveryAttributeOfDraco)
{
    const Bytes encoded = dracoTriangles(kPositions, kUvs);
    const TemporaryFolder folder;
    writeFile(folder / "test.glb", packGlb(dracoJson(encoded.size()), encoded));
    const Document document(folder / "test.glb");
    const Primitive primitive = readPrimitive(document, {0, 0}, Positions::Read);
    const std::vector<float> values = readAttribute(document, {0, 0}, "TEXCOORD_0", 2);
    ASSERT_EQ(values.size(), 2 * primitive.uvs.size());
    for (size_t i = 0; i < primitive.uvs.size(); ++i)
        EXPECT_EQ((TexCoord{values[2 * i], values[2 * i + 1]}), primitive.uvs[i]);
    EXPECT_THROW(static_cast<void>(readAttribute(document, {0, 0}, "JOINTS_0", 4)), GltfError);
}

TEST(GltfCompressed, DamagedDraco)
{
    Bytes encoded = dracoTriangles(kPositions, kUvs);
    const std::string json = dracoJson(encoded.size());
    EXPECT_EQ(errorOfPrimitive(dracoJson(encoded.size(), R"({"POSITION": 0, "TEXCOORD_0": 9})"), encoded),
              "mesh 0 primitive 0 TEXCOORD_0: Draco's attribute 9 does not exist");
    EXPECT_EQ(errorOfPrimitive(dracoJson(encoded.size(), R"({"POSITION": 1, "TEXCOORD_0": 1})"), encoded),
              "mesh 0 primitive 0 POSITION: Draco's attribute 1 has the wrong type");
    for (const bool required : {false, true}) {
        std::string masked = json;
        masked.replace(masked.find("\"indices\": 2"), 12, "\"indices\": 2000000000");
        masked.replace(masked.find("{\"pbr"), 1, "{\"alphaMode\": \"MASK\", ");
        if (required)
            masked.replace(1, 0, "\"extensionsRequired\": [\"KHR_draco_mesh_compression\"], ");
        EXPECT_EQ(errorOfPrimitive(masked, encoded), "mesh 0 primitive 0 indices: accessor 2000000000 does not exist");
    }
    // Positions that are not compressed, of one vertex.
    std::string few = dracoJson(encoded.size(), R"({"TEXCOORD_0": 1})");
    few.replace(few.find("\"count\": 6"), 10, "\"count\": 1");
    EXPECT_EQ(errorOfPrimitive(few, encoded), "mesh 0 primitive 0 has 1 positions for 4 vertices");
    Bytes changed = encoded;
    changed[6] = 1;
    EXPECT_EQ(errorOfPrimitive(json, changed), "unsupported: mesh 0 primitive 0: Draco's version 2.1 is not 2.2");
    changed[0] = 'd';
    EXPECT_EQ(errorOfPrimitive(json, changed), "mesh 0 primitive 0: what it is compressed to is not Draco's");
    for (size_t length = 11; length < encoded.size(); ++length)
        EXPECT_NE(errorOfPrimitive(dracoJson(length),
                                   Bytes(encoded.begin(), encoded.begin() + static_cast<ptrdiff_t>(length))),
                  "none");
    // Numbers of vertices and faces that the bytes cannot be worth, where the connectivity begins.
    for (const size_t place : {12u, 13u}) {
        changed = encoded;
        changed.erase(changed.begin() + static_cast<ptrdiff_t>(place));
        const uint8_t many[] = {0xff, 0xff, 0xff, 0xff, 0x04};
        changed.insert(changed.begin() + static_cast<ptrdiff_t>(place), std::begin(many), std::end(many));
        EXPECT_EQ(errorOfPrimitive(dracoJson(changed.size()), changed),
                  "mesh 0 primitive 0: what it is compressed to by Draco cannot be decoded");
    }
}

TEST(GltfCompressed, Meshopt)
{
    Bytes vertices;
    for (size_t i = 0; i < kPositions.size(); ++i) {
        append<float>(vertices, {kPositions[i][0], kPositions[i][1], kPositions[i][2], kUvs[i][0], kUvs[i][1]});
    }
    for (const char *spelling : {"EXT_meshopt_compression", "KHR_meshopt_compression"}) {
        for (const bool triangles : {false, true}) {
            Bytes binary = meshoptAttributes(vertices, 20);
            const size_t first = binary.size();
            const std::vector<uint32_t> indices = {0, 1, 2, 3, 4, 5};
            append(binary, triangles ? meshoptTriangles(indices) : meshoptIndices(indices));
            const auto view = [&](size_t offset, size_t end, int stride, const char *mode, const char *more) {
                return "{\"buffer\": 1, \"byteLength\": " + std::to_string(6 * stride) + ", " + more +
                       "\"extensions\": {\"" + spelling +
                       "\": {\"buffer\": 0, \"byteOffset\": " + std::to_string(offset) +
                       ", \"byteLength\": " + std::to_string(end - offset) +
                       ", \"byteStride\": " + std::to_string(stride) + ", \"count\": 6, \"mode\": \"" + mode + "\"}}}";
            };
            const std::string json =
                glbOf(R"({"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0})",
                      R"({"bufferView": 0, "componentType": 5126, "count": 6, "type": "VEC3"},
                         {"bufferView": 0, "byteOffset": 12, "componentType": 5126, "count": 6, "type": "VEC2"},
                         {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"})",
                      view(0, first, 20, "ATTRIBUTES", "\"byteStride\": 20, ") + ", " +
                          view(first, binary.size(), 2, triangles ? "TRIANGLES" : "INDICES", ""),
                      binary.size(), 200);
            EXPECT_EQ(trianglesOf(readFirst(json, binary)), trianglesOf(uncompressed()));
            const auto changed = [&](const std::string &from, const std::string &to) {
                std::string other = json;
                other.replace(other.find(from), from.size(), to);
                return errorOfPrimitive(other, binary);
            };
            EXPECT_EQ(changed("\"count\": 6, \"mode\": \"A", "\"count\": 2000000000, \"mode\": \"A"),
                      "mesh 0 primitive 0 POSITION: buffer view 0 is decompressed to 40000000000 bytes and has 120");
            EXPECT_EQ(changed("ATTRIBUTES", "BUTES"),
                      "unsupported: mesh 0 primitive 0 POSITION: buffer view 0 has a compression with the unknown mode "
                      "\"BUTES\"");
            EXPECT_EQ(changed("\"byteOffset\": 0, \"byteLength\": ", "\"byteOffset\": 9, \"byteLength\": "),
                      "mesh 0 primitive 0 POSITION: buffer view 0 cannot be decompressed");
            EXPECT_EQ(
                changed("\"buffer\": 0, \"byteOffset\": 0", "\"buffer\": 0, \"byteOffset\": 99999"),
                "mesh 0 primitive 0 POSITION: buffer view 0 has a compression that reaches outside of its buffer");
            EXPECT_NE(changed("\"buffer\": 0, \"byteOffset\": 0", "\"buffer\": 7, \"byteOffset\": 0"), "none");
            Bytes newer = binary;
            newer[0] |= 15;
            EXPECT_EQ(errorOfPrimitive(json, newer),
                      "unsupported: mesh 0 primitive 0 POSITION: buffer view 0 is compressed by "
                      "version 15 of the codec" +
                          whichNeeds("a newer one"));
        }
    }
}

// What `gltfpack -cz` writes is decoded by libraries that can. Others name what is missing.
TEST(GltfCompressed, NewerMeshopt)
{
    const std::string primitive = R"({"attributes": {"POSITION": 0, "COLOR_0": 1}})";
    const std::string accessors = R"({"componentType": 5126, "count": 6, "type": "VEC3"},
        {"bufferView": 0, "componentType": 5121, "normalized": true, "count": 6, "type": "VEC4"})";
    const auto view = [](const Bytes &encoded, const char *more) {
        return R"({"buffer": 1, "byteLength": 24, "byteStride": 4, "extensions": {"KHR_meshopt_compression":
            {"buffer": 0, "byteStride": 4, "count": 6, "mode": "ATTRIBUTES", "byteLength": )" +
               std::to_string(encoded.size()) + more + "}}}";
    };
    const std::string name = "unsupported: mesh 0 primitive 0 COLOR_0: buffer view 0 ";
    Bytes colors;
    std::vector<float> sameColors;
    for (uint8_t i = 0; i < 6; ++i) {
        append<uint8_t>(colors, {7, 8, 9, static_cast<uint8_t>(40 * i)});
        sameColors.insert(sameColors.end(), {7 / 255.0f, 8 / 255.0f, 9 / 255.0f, static_cast<float>(40 * i) / 255});
    }
    const Bytes encoded = meshoptAttributes(colors, 4, 1);
    const std::string json = glbOf(primitive, accessors, view(encoded, ""), encoded.size(), 24);
    const Bytes filtered = meshoptColors(sameColors);
    const std::string filteredJson =
        glbOf(primitive, accessors, view(filtered, R"(, "filter": "COLOR")"), filtered.size(), 24);
    EXPECT_EQ(encoded.at(0), 0xa1);
    if (kMeshoptVersion < 230)
        EXPECT_EQ(errorOfPrimitive(json, encoded),
                  name + "is compressed by version 1 of the codec" + whichNeeds("meshoptimizer 0.23 or newer"));
    else
        for (size_t i = 0; i < 6; ++i)
            EXPECT_EQ(readFirst(json, encoded).alphas.at(i), static_cast<float>(40 * i) / 255);
    if (kMeshoptVersion < 1000)
        EXPECT_EQ(errorOfPrimitive(filteredJson, filtered),
                  name + "has a compression with the filter COLOR" + whichNeeds("meshoptimizer 1.0 or newer"));
    else
        for (size_t i = 0; i < 6; ++i)
            EXPECT_NEAR(readFirst(filteredJson, filtered).alphas.at(i), static_cast<float>(40 * i) / 255, 1.01 / 255);
}

namespace
{

// The reason for which a masked primitive is left, or none.
std::string leftFor(std::string json, const Bytes &binary)
{
    json.replace(json.find("{\"pbr"), 1, "{\"alphaMode\": \"MASK\", ");
    json.replace(json.find("none.png"), 8, "disc.png");
    const TemporaryFolder folder;
    writeFile(folder / "disc.png", discPng());
    writeFile(folder / "test.glb", packGlb(json, binary));
    const DocumentBake bake = bakeDocument(Document(folder / "test.glb"), {});
    return bake.skipped.empty() ? "none" : bake.skipped[0].reason;
}

// A file whose primitive is compressed by Draco and is there uncompressed, too.
std::string bothJson(size_t dracoBytes, int indices, bool required)
{
    const size_t at = (dracoBytes + 3) / 4 * 4;
    std::string json = glbOf(
        R"({"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0, "extensions":
            {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0, "TEXCOORD_0": 1}}}})",
        R"({"bufferView": 1, "componentType": 5126, "count": 6, "type": "VEC3"},
           {"bufferView": 2, "componentType": 5126, "count": 6, "type": "VEC2"},
           {"bufferView": 3, "componentType": 5125, "count": )" +
            std::to_string(indices) + R"(, "type": "SCALAR"})",
        "{\"buffer\": 0, \"byteLength\": " + std::to_string(dracoBytes) + "}, {\"buffer\": 0, \"byteOffset\": " +
            std::to_string(at) + ", \"byteLength\": 72}, {\"buffer\": 0, \"byteOffset\": " + std::to_string(at + 72) +
            ", \"byteLength\": 48}, {\"buffer\": 0, \"byteOffset\": " + std::to_string(at + 120) +
            ", \"byteLength\": " + std::to_string(4 * indices) + "}",
        at + 120 + 4 * static_cast<size_t>(indices), 1);
    if (required)
        json.replace(1, 0, "\"extensionsRequired\": [\"KHR_draco_mesh_compression\"], ");
    return json;
}

} // namespace

// A renderer that does not know the compression draws the uncompressed data: one micromap must be right for both.
TEST(GltfCompressed, UncompressedDataThatDiffersIsNotBaked)
{
    const std::string other = "its uncompressed data has other triangles than its compressed data";
    const Bytes encoded = dracoTriangles(kPositions, kUvs, true);
    const Primitive decoded = readFirst(dracoJson(encoded.size()), encoded);
    Bytes binary = encoded;
    binary.resize((binary.size() + 3) / 4 * 4);
    std::vector<float> positions;
    std::vector<float> uvs;
    for (const uint32_t i : decoded.indices) { // a vertex of its own for each corner
        positions.insert(positions.end(), decoded.positions[i].begin(), decoded.positions[i].end());
        uvs.insert(uvs.end(), {decoded.uvs[i].u, decoded.uvs[i].v});
    }
    ASSERT_EQ(uvs.size(), 12u);
    append(binary, positions);
    append(binary, uvs);
    Bytes turned = binary;
    std::vector<uint32_t> indices = {0, 1, 2, 3, 4, 5};
    append(binary, indices);
    std::rotate(indices.begin(), indices.begin() + 1, indices.begin() + 3);
    append(turned, indices);
    EXPECT_EQ(leftFor(bothJson(encoded.size(), 6, false), binary), "none");
    EXPECT_EQ(leftFor(bothJson(encoded.size(), 6, false), turned), other);
    EXPECT_EQ(leftFor(bothJson(encoded.size(), 6, true), turned), "none");
    // A micromap has as many triangles as the file states.
    EXPECT_EQ(leftFor(bothJson(encoded.size(), 3, true), binary),
              "it has 1 triangles by its indices, and 2 by KHR_draco_mesh_compression");
    EXPECT_EQ(leftFor(bothJson(encoded.size(), 3, false), binary), other);
}

// The alphas of vertices that Draco did not compress are those of either's indices.
TEST(GltfCompressed, UncompressedDataWithOtherAlphasIsNotBaked)
{
    std::vector<std::array<float, 3>> positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {5, 0, 0}, {6, 0, 0}, {5, 1, 0}};
    const Bytes encoded = dracoTriangles(positions, std::vector<std::array<float, 2>>(6, {0.5f, 0.5f}), true);
    const Primitive decoded = readFirst(dracoJson(encoded.size()), encoded);
    ASSERT_EQ(decoded.positions.size(), 6u);
    std::vector<float> colors(24, 1.0f); // transparent in the second triangle
    for (size_t corner = 3; corner < 6; ++corner)
        colors[size_t{4} * decoded.indices[corner] + 3] = 0;
    std::vector<uint32_t> turned = decoded.indices;
    std::rotate(turned.begin(), turned.begin() + 3, turned.end());
    const std::string other = "its uncompressed data has other triangles than its compressed data";
    for (const bool textured : {true, false})
        for (const bool same : {true, false}) {
            Bytes binary = encoded;
            binary.resize((binary.size() + 3) / 4 * 4);
            append(binary, std::vector<float>(18, 0.0f));
            append(binary, std::vector<float>(12, 0.5f));
            append(binary, same ? decoded.indices : turned);
            const size_t at = binary.size();
            append(binary, colors);
            std::string json = bothJson(encoded.size(), 6, false);
            const auto replace = [&](const std::string &from, const std::string &to) {
                json.replace(json.find(from), from.size(), to);
            };
            replace(textured ? R"("TEXCOORD_0": 1}, "indices")" : R"("POSITION": 0, "TEXCOORD_0": 1}, "indices")",
                    textured ? R"("TEXCOORD_0": 1, "COLOR_0": 3}, "indices")"
                             : R"("POSITION": 0, "COLOR_0": 3}, "indices")");
            if (!textured)
                replace(R"("baseColorTexture": {"index": 0})", R"("metallicFactor": 0)");
            replace(R"("type": "SCALAR"})",
                    R"("type": "SCALAR"}, {"bufferView": 4, "componentType": 5126, "count": 6, "type": "VEC4"})");
            replace("], \"buffers\"",
                    ", {\"buffer\": 0, \"byteOffset\": " + std::to_string(at) + ", \"byteLength\": 96}], \"buffers\"");
            replace("\"byteLength\": " + std::to_string(at) + "}",
                    "\"byteLength\": " + std::to_string(binary.size()) + "}");
            EXPECT_EQ(leftFor(json, binary), same ? "none" : other) << textured;
        }
}

TEST(GltfCompressed, UncompressedDataThatDiffersFromMeshoptIsNotBaked)
{
    const std::vector<uint32_t> indices = {0, 1, 2, 3, 4, 5};
    Bytes binary = meshoptIndices(indices);
    const size_t encoded = binary.size();
    binary.resize((binary.size() + 3) / 4 * 4);
    const size_t at = binary.size();
    for (size_t i = 0; i < 6; ++i)
        append<float>(binary, {kPositions[i][0], kPositions[i][1], kPositions[i][2], kUvs[i][0], kUvs[i][1]});
    Bytes turned = binary;
    append<uint16_t>(binary, {0, 1, 2, 3, 4, 5});
    append<uint16_t>(turned, {1, 2, 0, 3, 4, 5});
    std::string json = glbOf(
        R"({"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0})",
        R"({"bufferView": 0, "componentType": 5126, "count": 6, "type": "VEC3"},
                 {"bufferView": 0, "byteOffset": 12, "componentType": 5126, "count": 6, "type": "VEC2"},
                 {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"})",
        "{\"buffer\": 0, \"byteOffset\": " + std::to_string(at) +
            R"(, "byteLength": 120, "byteStride": 20}, {"buffer": 0, "byteOffset": )" + std::to_string(at + 120) +
            R"(, "byteLength": 12, "extensions": {"EXT_meshopt_compression": {"buffer": 0, "byteOffset": 0, )" +
            "\"byteLength\": " + std::to_string(encoded) + R"(, "byteStride": 2, "count": 6, "mode": "INDICES"}}})",
        binary.size(), 1);
    EXPECT_EQ(leftFor(json, binary), "none");
    EXPECT_EQ(leftFor(json, turned), "its uncompressed data has other triangles than its compressed data");
    json.replace(1, 0, "\"extensionsRequired\": [\"EXT_meshopt_compression\"], ");
    EXPECT_EQ(leftFor(json, turned), "none");
}
