// SPDX-License-Identifier: Apache-2.0
#include "card_file.h"

#include <cstring>

#include "gltf/primitive.h"

namespace vellum::test
{
namespace
{

template <typename T>
Bytes bytesOf(const std::vector<T> &values)
{
    Bytes bytes(values.size() * sizeof(T));
    std::memcpy(bytes.data(), values.data(), bytes.size());
    return bytes;
}

// Parts of a buffer, and their views.
class Buffer
{
public:
    // Gives the number of the view.
    std::string add(const Bytes &part)
    {
        bytes.resize((bytes.size() + 3) / 4 * 4);
        views += std::string(views.empty() ? "" : ", ") + R"({"buffer": 0, "byteOffset": )" +
                 std::to_string(bytes.size()) + R"(, "byteLength": )" + std::to_string(part.size()) + "}";
        bytes.insert(bytes.end(), part.begin(), part.end());
        return std::to_string(count_++);
    }

    Bytes bytes;
    std::string views;

private:
    unsigned count_ = 0;
};

std::string listOf(const std::vector<MicromapUsage> &usages, uint32_t (*number)(const MicromapUsage &))
{
    std::string text;
    for (const MicromapUsage &usage : usages)
        text += (text.empty() ? "" : ", ") + std::to_string(number(usage));
    return "[" + text + "]";
}

} // namespace

Bytes CardFile::bytes() const
{
    Buffer buffer;
    std::string accessors;
    unsigned accessorCount = 0;
    const auto accessor = [&](const Bytes &part, int component, size_t count, const std::string &type) {
        accessors += std::string(accessors.empty() ? "" : ", ") + R"({"bufferView": )" + buffer.add(part) +
                     R"(, "componentType": )" + std::to_string(component) + R"(, "count": )" + std::to_string(count) +
                     R"(, "type": ")" + type + "\"}";
        return std::to_string(accessorCount++);
    };
    std::string attributes =
        R"("POSITION": )" + accessor(bytesOf<float>({-1, 0, 0, 1, 0, 0, 1, 2, 0, -1, 2, 0}), 5126, 4, "VEC3");
    if (textured)
        attributes += R"(, "TEXCOORD_0": )" + accessor(bytesOf<float>({0, 1, 1, 1, 1, 0, 0, 0}), 5126, 4, "VEC2");
    std::vector<std::string> colors;
    for (size_t first = 0; first < alphas.size(); first += 4) {
        std::vector<float> values;
        for (size_t corner = 0; corner < 4; ++corner)
            values.insert(values.end(), {1, 1, 1, alphas[first + corner]});
        colors.push_back(R"(, "COLOR_0": )" + accessor(bytesOf(values), 5126, 4, "VEC4"));
    }
    const std::string indices = accessor(bytesOf<uint16_t>({0, 1, 2, 0, 2, 3}), 5123, 6, "SCALAR");
    std::string root;
    std::string extensions;
    if (extension) {
        const std::vector<MicromapUsage> usages = usageOf(micromap.triangles);
        root = R"("extensionsUsed": ["EXT_mesh_opacity_micromap"], "extensions": {"EXT_mesh_opacity_micromap":
{"micromaps": [{"data": )" +
               buffer.add(micromap.data) + R"(, "triangles": )" + buffer.add(bytesOf(micromap.triangles)) +
               R"(, "usageCounts": )" +
               (usageCounts.empty() ? listOf(usages, [](const MicromapUsage &u) { return u.count; }) : usageCounts) +
               R"(, "usageLevels": )" + listOf(usages, [](const MicromapUsage &u) { return u.subdivisionLevel; }) +
               R"(, "usageFormats": )" +
               listOf(usages, [](const MicromapUsage &u) { return static_cast<uint32_t>(u.format); }) + "}]}}, ";
        extensions = R"(, "extensions": {"EXT_mesh_opacity_micromap": {"micromap": 0, "micromapIndices": )" +
                     accessor(bytesOf(micromap.indices), 5125, micromap.indices.size(), "SCALAR") + "}}";
    }
    std::string primitives;
    for (unsigned i = 0; i < cards; ++i)
        primitives += (i == 0 ? "" : ", ") + (R"({"attributes": {)" + attributes) +
                      (colors.empty() ? "" : colors[i % colors.size()]) + R"(}, "indices": )" + indices +
                      R"(, "material": 0)" + extensions + "}";
    const std::string image = buffer.add(discPng());
    return packGlb(R"({"asset": {"version": "2.0"}, )" + root + R"("meshes": [{"name": "leaves", "primitives": [)" +
                       primitives + R"(]}], "materials": [{"name": "leaf", )" + material +
                       R"(, "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
"textures": [{"source": 0}], "images": [{"mimeType": "image/png", "bufferView": )" +
                       image + R"(}], "accessors": [)" + accessors + R"(], "bufferViews": [)" + buffer.views +
                       R"(], "buffers": [{"byteLength": )" + std::to_string(buffer.bytes.size()) + "}]}",
                   buffer.bytes);
}

void CardFile::bake(const BakeOptions &options)
{
    const TemporaryFolder folder;
    CardFile plain = *this;
    plain.extension = false;
    writeFile(folder / "plain.glb", plain.bytes());
    const Document document(folder / "plain.glb");
    const Material leaf = readMaterial(document, 0);
    const std::vector<TriangleUvs> uvs = triangleUvs(readPrimitive(document, {0, 0}, Positions::Skip));
    const Image image = readImage(document, 0);
    micromap = vellum::bake(alphaTexture(leaf, image), uvs, options).micromap;
    if (micromap.triangles.empty()) { // the extension wants one
        micromap.triangles = {{0, 0, Format::FourState}};
        micromap.data = {0};
    }
}

} // namespace vellum::test
