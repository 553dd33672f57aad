// SPDX-License-Identifier: Apache-2.0
// Vertices and triangles of a primitive in every form in which a file can store them.
#include "gltf/primitive.h"

#include <gtest/gtest.h>

#include "glb_file.h"

using namespace vellum;
using namespace vellum::test;

namespace
{

// A file with one primitive, whose parts are given as they stand in the JSON. Every buffer view is its own buffer's.
struct PrimitiveFile {
    std::string root; // members
    std::string primitive = R"({"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0})";
    std::vector<std::string> accessors;
    std::vector<Bytes> views;
    std::vector<std::string> viewMembers; // `, "byteStride": 8`
    std::string baseColorTexture = R"({"index": 0})";

    // Adds a view, and an accessor for all of it.
    template <typename T>
    void add(const std::vector<T> &values, const std::string &accessor)
    {
        views.emplace_back();
        append(views.back(), values);
        accessors.push_back("{\"bufferView\": " + std::to_string(views.size() - 1) + ", " + accessor + "}");
    }

    [[nodiscard]] Bytes pack() const
    {
        Bytes binary;
        std::string viewText;
        for (size_t i = 0; i < views.size(); ++i) {
            viewText += (i == 0 ? "" : ", ") + std::string("{\"buffer\": 0, \"byteOffset\": ") +
                        std::to_string(binary.size()) + ", \"byteLength\": " + std::to_string(views[i].size()) +
                        (i < viewMembers.size() ? viewMembers[i] : "") + "}";
            append(binary, views[i]);
        }
        std::string accessorText;
        for (size_t i = 0; i < accessors.size(); ++i)
            accessorText += (i == 0 ? "" : ", ") + accessors[i];
        return packGlb(R"({"asset": {"version": "2.0"}, )" + root + R"("meshes": [{"name": "leaf", "primitives": [)" +
                           primitive + R"(]}], "materials": [{"pbrMetallicRoughness": {"baseColorTexture": )" +
                           baseColorTexture +
                           R"(}}], "textures": [{"source": 0}], "images": [{"uri": "none.png"}], "accessors": [)" +
                           accessorText + "], \"bufferViews\": [" + viewText +
                           "], \"buffers\": [{\"byteLength\": " + std::to_string(binary.size()) + "}]}",
                       binary);
    }

    [[nodiscard]] Primitive read(Positions positions = Positions::Read) const
    {
        const TemporaryFolder folder;
        writeFile(folder / "test.glb", pack());
        return readPrimitive(Document(folder / "test.glb"), {0, 0}, positions);
    }

    [[nodiscard]] std::string error(Positions positions = Positions::Read) const
    {
        try {
            static_cast<void>(read(positions));
        } catch (const GltfError &error) {
            const std::string text = error.what();
            const std::string where = "test.glb: mesh 0 \"leaf\" primitive 0";
            const size_t begin = text.find(where);
            return begin == std::string::npos ? text : text.substr(begin + where.size());
        }
        return "none";
    }
};

PrimitiveFile triangleFile()
{
    PrimitiveFile file;
    file.add<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}, R"("componentType": 5126, "count": 3, "type": "VEC3")");
    file.add<float>({0, 0, 1, 0, 0, 1}, R"("componentType": 5126, "count": 3, "type": "VEC2")");
    return file;
}

} // namespace

TEST(GltfPrimitive, EveryTypeOfTextureCoordinates)
{
    const auto read = [](PrimitiveFile file) { return file.read().uvs; };
    const std::string two = R"("count": 3, "type": "VEC2")";
    const std::string normalized = two + R"(, "normalized": true)";
    PrimitiveFile file = triangleFile();
    file.accessors.pop_back();
    file.views.pop_back();
    const auto with = [&](auto values, const std::string &accessor) {
        PrimitiveFile changed = file;
        changed.add(values, accessor);
        return read(changed);
    };
    using Uvs = std::vector<TexCoord>;
    EXPECT_EQ(with(std::vector<uint8_t>{0, 255, 51, 102, 1, 2}, "\"componentType\": 5121, " + normalized),
              (Uvs{{0, 1}, {0.2f, 0.4f}, {1 / 255.0f, 2 / 255.0f}}));
    EXPECT_EQ(with(std::vector<uint8_t>{0, 255, 51, 102, 1, 2}, "\"componentType\": 5121, " + two),
              (Uvs{{0, 255}, {51, 102}, {1, 2}}));
    EXPECT_EQ(with(std::vector<int8_t>{-128, -127, 127, 0, 1, -1}, "\"componentType\": 5120, " + normalized),
              (Uvs{{-1, -1}, {1, 0}, {1 / 127.0f, -1 / 127.0f}}));
    EXPECT_EQ(with(std::vector<int8_t>{-128, -127, 127, 0, 1, -1}, "\"componentType\": 5120, " + two),
              (Uvs{{-128, -127}, {127, 0}, {1, -1}}));
    EXPECT_EQ(with(std::vector<uint16_t>{0, 65535, 13107, 1, 2, 3}, "\"componentType\": 5123, " + normalized),
              (Uvs{{0, 1}, {0.2f, 1 / 65535.0f}, {2 / 65535.0f, 3 / 65535.0f}}));
    EXPECT_EQ(with(std::vector<int16_t>{-32768, 32767, 0, 1, 2, 3}, "\"componentType\": 5122, " + normalized),
              (Uvs{{-1, 1}, {0, 1 / 32767.0f}, {2 / 32767.0f, 3 / 32767.0f}}));
    EXPECT_EQ(with(std::vector<int16_t>{-32768, 32767, 0, 1, 2, 3}, "\"componentType\": 5122, " + two),
              (Uvs{{-32768, 32767}, {0, 1}, {2, 3}}));
    PrimitiveFile wrong = file;
    wrong.add<uint32_t>({0, 1, 2, 3, 4, 5}, "\"componentType\": 5125, " + two);
    EXPECT_EQ(wrong.error(), " TEXCOORD_0: accessor 1: 32-bit integers are for indices only");
    wrong = file;
    wrong.add<int32_t>({0, 1, 2, 3, 4, 5}, "\"componentType\": 5124, " + two); // of micromapIndices only
    EXPECT_EQ(wrong.error(), " TEXCOORD_0: accessor 1: component type 5124 does not exist in glTF");
    wrong = file;
    wrong.add<double>({0, 1, 2, 3, 4, 5}, "\"componentType\": 5130, " + two);
    EXPECT_EQ(wrong.error(), " TEXCOORD_0: accessor 1: component type 5130 does not exist in glTF");
}

// KHR_mesh_quantization: padded to four bytes, and positions may be integers of any kind.
TEST(GltfPrimitive, QuantizedPositions)
{
    PrimitiveFile file = triangleFile();
    file.views[0].clear();
    append<int8_t>(file.views[0], {9, 9, 9, 9, -127, 0, 127, 9, 1, 2, 3, 9, 4, 5, 6, 9});
    file.viewMembers = {", \"byteStride\": 4"};
    const std::string rest = R"("bufferView": 0, "byteOffset": 4, "componentType": 5120, "count": 3, "type": "VEC3")";
    file.accessors[0] = "{" + rest + "}";
    EXPECT_EQ(file.read().positions, (std::vector<Vec3>{{-127, 0, 127}, {1, 2, 3}, {4, 5, 6}}));
    file.accessors[0] = "{" + rest + ", \"normalized\": true}";
    EXPECT_EQ(file.read().positions[0], (Vec3{-1, 0, 1}));
}

TEST(GltfPrimitive, SparseAccessors)
{
    PrimitiveFile file = triangleFile();
    file.views.push_back({0, 2});
    file.views.emplace_back();
    append<float>(file.views.back(), {7, 8, 9, 10});
    const auto accessor = [](const std::string &base, const std::string &indices, int count) {
        return "{" + base + R"("componentType": 5126, "count": 3, "type": "VEC2", "sparse": {"count": )" +
               std::to_string(count) + R"(, "indices": {"bufferView": 2, "componentType": )" + indices +
               R"(}, "values": {"bufferView": 3}}})";
    };
    using Uvs = std::vector<TexCoord>;
    file.accessors[1] = accessor("\"bufferView\": 1, ", "5121", 2);
    EXPECT_EQ(file.read().uvs, (Uvs{{7, 8}, {1, 0}, {9, 10}}));
    file.accessors[1] = accessor("", "5121", 2);
    EXPECT_EQ(file.read().uvs, (Uvs{{7, 8}, {0, 0}, {9, 10}}));
    file.accessors[1] = accessor("\"bufferView\": 1, ", "5121, \"byteOffset\": 1", 1);
    EXPECT_EQ(file.read().uvs, (Uvs{{0, 0}, {1, 0}, {7, 8}}));

    const auto error = [&](const std::string &text) {
        file.accessors[1] = text;
        return file.error();
    };
    EXPECT_EQ(error(accessor("\"bufferView\": 1, ", "5121", 3)),
              " TEXCOORD_0: accessor 1 (sparse) reaches outside of its buffer view");
    EXPECT_EQ(error(accessor("\"bufferView\": 1, ", "5121", 4)),
              " TEXCOORD_0: accessor 1 (sparse) replaces 4 of 3 elements");
    EXPECT_EQ(error(accessor("\"bufferView\": 1, ", "5120", 2)),
              " TEXCOORD_0: accessor 1 (sparse): indices are not unsigned integers");
    EXPECT_EQ(error(accessor("\"bufferView\": 1, ", "5123", 2)),
              " TEXCOORD_0: accessor 1 (sparse) reaches outside of its buffer view");
    file.views[2] = {2, 0};
    EXPECT_EQ(error(accessor("\"bufferView\": 1, ", "5121", 2)),
              " TEXCOORD_0: accessor 1 (sparse): indices do not increase");
    file.views[2] = {0, 3};
    EXPECT_EQ(error(accessor("\"bufferView\": 1, ", "5121", 2)),
              " TEXCOORD_0: accessor 1 (sparse) replaces element 3 of 3");
}

TEST(GltfPrimitive, MissingBufferViewIsZeros)
{
    PrimitiveFile file = triangleFile();
    file.accessors[1] = R"({"componentType": 5126, "count": 3, "type": "VEC2"})";
    EXPECT_EQ(file.read().uvs, (std::vector<TexCoord>{{0, 0}, {0, 0}, {0, 0}}));
    file.accessors[1] = R"({"componentType": 5126, "count": 100000000000, "type": "VEC2"})";
    EXPECT_EQ(file.error(), " TEXCOORD_0: accessor 1 has 100000000000 elements and no buffer view");
}

TEST(GltfPrimitive, Strides)
{
    PrimitiveFile file = triangleFile();
    // Both attributes are in one view with 20 bytes for each vertex.
    file.views = {{}};
    append<float>(file.views[0], {0, 0, 0, 10, 11, 1, 0, 0, 20, 21, 0, 1, 0, 30, 31});
    file.viewMembers = {", \"byteStride\": 20"};
    file.accessors = {R"({"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"})",
                      R"({"bufferView": 0, "byteOffset": 12, "componentType": 5126, "count": 3, "type": "VEC2"})"};
    const Primitive primitive = file.read();
    EXPECT_EQ(primitive.positions[2], (Vec3{0, 1, 0}));
    EXPECT_EQ(primitive.uvs, (std::vector<TexCoord>{{10, 11}, {20, 21}, {30, 31}}));
    file.accessors[1] = R"({"bufferView": 0, "byteOffset": 16, "componentType": 5126, "count": 3, "type": "VEC2"})";
    EXPECT_EQ(file.error(), " TEXCOORD_0: accessor 1 reaches outside of its buffer view");
    file.viewMembers = {", \"byteStride\": 8"};
    EXPECT_EQ(file.error(), " POSITION: accessor 0 reaches outside of its buffer view");
}

// glTF 2.0, 3.7.2.1: p_i = {v_i, v_(i + 1 + i % 2), v_(i + 2 - i % 2)} for strips, {v_(i + 1), v_(i + 2), v_0} for
// fans.
TEST(GltfPrimitive, StripsAndFans)
{
    const auto trianglesOf = [](int mode, const std::vector<uint16_t> &corners) {
        PrimitiveFile file = triangleFile();
        file.primitive =
            R"({"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "mode": )" + std::to_string(mode) + "}";
        file.add<uint16_t>(corners,
                           R"("componentType": 5123, "type": "SCALAR", "count": )" + std::to_string(corners.size()));
        return file.read().indices;
    };
    using Indices = std::vector<uint32_t>;
    EXPECT_EQ(trianglesOf(5, {0, 1, 2, 1, 0}), (Indices{0, 1, 2, 1, 1, 2, 2, 1, 0}));
    EXPECT_EQ(trianglesOf(6, {0, 1, 2, 1, 0}), (Indices{1, 2, 0, 2, 1, 0, 1, 0, 0}));
    EXPECT_EQ(trianglesOf(5, {0, 1}), Indices{});
    EXPECT_EQ(trianglesOf(6, {0, 1}), Indices{});
    EXPECT_EQ(trianglesOf(4, {2, 1, 0}), (Indices{2, 1, 0}));
}

// KHR_mesh_primitive_restart: after the highest index of its type, another strip or fan begins.
TEST(GltfPrimitive, StripsAndFansThatBeginAgain)
{
    const auto read = [](const std::string &mode, const std::string &type, auto corners) {
        PrimitiveFile file = triangleFile();
        file.root = R"("extensionsUsed": ["KHR_mesh_primitive_restart"], )";
        file.primitive = R"({"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "mode": )" + mode + "}";
        file.add(corners,
                 R"("componentType": )" + type + R"(, "type": "SCALAR", "count": )" + std::to_string(corners.size()));
        return file;
    };
    using Indices = std::vector<uint32_t>;
    const Indices two = {0, 1, 2, 2, 1, 0, 1, 1, 0};
    EXPECT_EQ(read("5", "5121", std::vector<uint8_t>{0, 1, 2, 0xff, 2, 1, 0, 1}).read().indices, two);
    EXPECT_EQ(read("5", "5123", std::vector<uint16_t>{0, 1, 2, 0xffff, 2, 1, 0, 1}).read().indices, two);
    EXPECT_EQ(read("5", "5125", std::vector<uint32_t>{0, 1, 2, ~0u, 2, 1, 0, 1}).read().indices, two);
    EXPECT_EQ(read("6", "5121", std::vector<uint8_t>{0, 1, 2, 0xff, 2, 1, 0}).read().indices,
              (Indices{1, 2, 0, 1, 0, 2}));
    EXPECT_EQ(read("5", "5121", std::vector<uint8_t>{0xff, 0, 1, 0xff, 0xff, 2, 1, 0, 0xff}).read().indices,
              (Indices{2, 1, 0}));
    EXPECT_EQ(read("4", "5121", std::vector<uint8_t>{0, 1, 0xff}).error(), ": index 255 of 3 vertices");
    PrimitiveFile without = read("5", "5121", std::vector<uint8_t>{0, 1, 2, 0xff});
    without.root.clear();
    EXPECT_EQ(without.error(), ": index 255 of 3 vertices");
}

TEST(GltfPrimitive, CountsVerticesByOtherAttributesWithoutPositions)
{
    PrimitiveFile file = triangleFile();
    file.primitive = R"({"attributes": {"TEXCOORD_0": 1}, "material": 0})";
    const Primitive primitive = file.read(Positions::Skip);
    EXPECT_EQ(primitive.uvs.size(), 3u);
    EXPECT_EQ(primitive.indices, (std::vector<uint32_t>{0, 1, 2}));
    EXPECT_EQ(file.error(), " has no positions");
    EXPECT_THROW(static_cast<void>(file.read()), GltfUnsupported);
    file.primitive = R"({"attributes": {}, "material": 0})";
    EXPECT_EQ(file.error(Positions::Skip), " has no attributes");
    // Huge counts allocate nothing.
    file.primitive = R"({"attributes": {"POSITION": 0}, "material": 0})";
    file.accessors[0] = R"({"bufferView": 0, "componentType": 5126, "count": 3000000000, "type": "VEC3"})";
    EXPECT_EQ(file.error(Positions::Skip), " POSITION: accessor 0 reaches outside of its buffer view");
}

TEST(GltfPrimitive, UsesTheTextureCoordinatesOfTheMaterial)
{
    PrimitiveFile file = triangleFile();
    file.add<float>({5, 6, 7, 8, 9, 10}, R"("componentType": 5126, "count": 3, "type": "VEC2")");
    file.primitive = R"({"attributes": {"POSITION": 0, "TEXCOORD_0": 1, "TEXCOORD_1": 2}, "material": 0})";
    EXPECT_EQ(file.read().uvs[0], (TexCoord{0, 0}));
    file.baseColorTexture = R"({"index": 0, "texCoord": 1})";
    EXPECT_EQ(file.read().uvs[0], (TexCoord{5, 6}));
    file.baseColorTexture = R"({"index": 0, "texCoord": 0, "extensions": {"KHR_texture_transform": {"texCoord": 1,
                                "offset": [1, 2], "rotation": 1.5707963267948966, "scale": [2, 4]}}})";
    // Scaled, then turned to (v, -u), then moved.
    const Primitive turned = file.read();
    EXPECT_NEAR(turned.uvs[0].u, 1 + 24, 1e-5);
    EXPECT_NEAR(turned.uvs[0].v, 2 - 10, 1e-5);
    file.baseColorTexture = R"({"index": 0, "texCoord": 2})";
    EXPECT_TRUE(file.read().uvs.empty());
}

TEST(GltfPrimitive, Colors)
{
    const std::string three = R"("count": 3, "type": "VEC4")";
    const auto with = [&](auto values, const std::string &accessor) {
        PrimitiveFile file = triangleFile();
        file.add(values, accessor);
        file.primitive = R"({"attributes": {"POSITION": 0, "COLOR_0": 2}})";
        return file;
    };
    const std::vector<uint8_t> bytes = {1, 2, 3, 255, 4, 5, 6, 51, 7, 8, 9, 0};
    EXPECT_EQ(with(bytes, R"("componentType": 5121, "normalized": true, )" + three).read().alphas,
              (std::vector<float>{1, 0.2f, 0}));
    EXPECT_EQ(with(bytes, R"("componentType": 5121, )" + three).error(),
              " COLOR_0: integers that are not normalized are no colours");
    EXPECT_EQ(with(std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1}, R"("componentType": 5126, )" + three)
                  .read()
                  .alphas,
              std::vector<float>{});
    EXPECT_EQ(with(std::vector<float>(9), R"("componentType": 5126, "count": 3, "type": "VEC3")").read().alphas,
              std::vector<float>{});
    EXPECT_EQ(with(std::vector<float>(8), R"("componentType": 5126, "count": 2, "type": "VEC4")").error(),
              " has 2 colours for 3 vertices");
}

TEST(GltfPrimitive, MorphedAttributesAreReported)
{
    PrimitiveFile file = triangleFile();
    const auto morphed = [&](const std::string &targets) {
        file.primitive =
            R"({"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0, "targets": )" + targets + "}";
        return file.read().morphed;
    };
    EXPECT_FALSE(morphed(R"([{"POSITION": 0, "NORMAL": 0, "TEXCOORD_1": 1}])"));
    EXPECT_TRUE(morphed(R"([{"POSITION": 0}, {"TEXCOORD_0": 1}])"));
}

TEST(Gltf, NamesAreShownWithoutControlCharacters)
{
    const TemporaryFolder folder;
    writeFile(folder / "test.glb",
              cardGlb({{"{\"primitives\"", R"({"name": "a\n\u001b[31m\u009bb\u00e9", "primitives")"},
                       {"\"leaf\"", R"("l\tf")"}}));
    const Document document(folder / "test.glb");
    EXPECT_EQ(document.nameOf({0, 0}), "mesh 0 \"a??[31m?b\xc3\xa9\" primitive 0");
    EXPECT_EQ(readMaterial(document, 0).name, "l?f");
}

// Every primitive has the names of its mesh and its material in the results of a bake.
TEST(Gltf, LongNamesAreShownShortened)
{
    std::string name = "a";
    for (int i = 0; i < 1000; ++i)
        name += "\xc3\xa9";
    const TemporaryFolder folder;
    writeFile(folder / "test.glb", cardGlb({{"{\"primitives\"", "{\"name\": \"" + name + "\", \"primitives\""},
                                            {"\"leaf\"", '"' + name + '"'}}));
    const Document document(folder / "test.glb");
    const std::string shown = name.substr(0, 127) + "...";
    EXPECT_EQ(document.nameOf({0, 0}), "mesh 0 \"" + shown + "\" primitive 0");
    EXPECT_EQ(readMaterial(document, 0).name, shown);
    // Patterns are for the whole name.
    EXPECT_EQ(materialName(document.model(), 0), name);
}
