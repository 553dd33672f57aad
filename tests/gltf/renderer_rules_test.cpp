// SPDX-License-Identifier: Apache-2.0
// Baked files as another reader sees them: what NVIDIA's vk_gltf_renderer checks before it hands a file's micromaps to
// Vulkan (its rules, from its source), with a JSON parser alone, and what Vulkan then demands of a micromap build.
// Where that reader skips a micromap or a primitive with a warning, this one fails.
#include <cstring>
#include <gtest/gtest.h>
#include <map>
#include <rapidjson/document.h>
#include <span>

#include "core/curve.h"
#include "glb_file.h"
#include "gltf/micromaps/file_bake.h"
#include "gltf/micromaps/stored_micromaps.h"

using namespace vellum;
using namespace vellum::test;

namespace
{

constexpr const char *kExtension = "EXT_mesh_opacity_micromap";

struct Usage {
    uint32_t count, level, format;
};

struct Input { // of a micromap build
    std::span<const uint8_t> data;
    std::span<const uint8_t> triangles;
    size_t stride = 0;
    std::vector<Usage> usages;
};

struct Link { // of a primitive
    size_t micromap = 0;
    uint32_t baseTriangle = 0;
    uint32_t indexBytes = 0;
    std::vector<uint8_t> indices;
};

class Renderer
{
public:
    explicit Renderer(const std::filesystem::path &path) : file_(readFile(path))
    {
        uint32_t length = 0;
        std::memcpy(&length, &file_[12], sizeof length);
        json_.Parse(reinterpret_cast<const char *>(file_.data()) + 20, length);
        EXPECT_FALSE(json_.HasParseError());
        binary_ = std::span(file_).subspan(28 + length);
        readMicromaps();
        readPrimitives();
    }

    std::vector<Input> micromaps;
    std::vector<Link> links;

private:
    using Json = rapidjson::Value;

    [[nodiscard]] static size_t number(const Json &object, const char *name, size_t otherwise)
    {
        return object.HasMember(name) ? object[name].GetUint64() : otherwise;
    }
    // An element of an array of the root, by its index; null if it does not exist.
    [[nodiscard]] const Json *element(const char *array, const Json &index) const
    {
        if (!index.IsUint() || !json_.HasMember(array) || index.GetUint() >= json_[array].Size())
            return nullptr;
        return &json_[array][index.GetUint()];
    }
    // All of these files have one buffer, the binary chunk.
    [[nodiscard]] std::span<const uint8_t> bytes(const Json &view) const
    {
        EXPECT_EQ(view["buffer"].GetUint(), 0u);
        const size_t offset = number(view, "byteOffset", 0);
        const size_t length = view["byteLength"].GetUint64();
        EXPECT_LE(offset + length, json_["buffers"][0]["byteLength"].GetUint64());
        return binary_.subspan(offset, length);
    }

    void readMicromaps()
    {
        ASSERT_TRUE(json_.HasMember("extensions") && json_["extensions"].HasMember(kExtension));
        ASSERT_TRUE(json_["extensions"][kExtension].HasMember("micromaps"));
        for (const Json &micromap : json_["extensions"][kExtension]["micromaps"].GetArray()) {
            for (const char *name : {"data", "triangles", "usageCounts", "usageLevels", "usageFormats"})
                ASSERT_TRUE(micromap.HasMember(name)) << name;
            const Json *data = element("bufferViews", micromap["data"]);
            const Json *triangles = element("bufferViews", micromap["triangles"]);
            ASSERT_TRUE(data != nullptr && triangles != nullptr);
            const Json &counts = micromap["usageCounts"];
            const Json &levels = micromap["usageLevels"];
            const Json &formats = micromap["usageFormats"];
            ASSERT_TRUE(counts.IsArray() && levels.IsArray() && formats.IsArray());
            ASSERT_EQ(counts.Size(), levels.Size());
            ASSERT_EQ(counts.Size(), formats.Size());
            Input input{bytes(*data), bytes(*triangles), number(*triangles, "byteStride", 8), {}};
            for (rapidjson::SizeType u = 0; u < counts.Size(); ++u)
                input.usages.push_back({counts[u].GetUint(), levels[u].GetUint(), formats[u].GetUint()});
            // Loaded into memory as they are, both addresses are multiples of 256.
            EXPECT_EQ(number(*data, "byteOffset", 0) % 256, 0u);
            EXPECT_EQ(number(*triangles, "byteOffset", 0) % 256, 0u);
            micromaps.push_back(std::move(input));
        }
    }

    void readPrimitives()
    {
        for (const Json &mesh : json_["meshes"].GetArray())
            for (const Json &primitive : mesh["primitives"].GetArray())
                if (primitive.HasMember("extensions") && primitive["extensions"].HasMember(kExtension))
                    readPrimitive(primitive, primitive["extensions"][kExtension]);
    }

    void readPrimitive(const Json &primitive, const Json &extension)
    {
        ASSERT_TRUE(extension.HasMember("micromap"));
        const size_t micromap = extension["micromap"].GetUint();
        ASSERT_LT(micromap, micromaps.size());
        const size_t base = number(extension, "micromapBaseTriangle", 0);
        ASSERT_TRUE(extension.HasMember("micromapIndices"));
        const Json *accessor = element("accessors", extension["micromapIndices"]);
        ASSERT_NE(accessor, nullptr);
        const unsigned type = (*accessor)["componentType"].GetUint();
        ASSERT_TRUE(type == 5121 || type == 5123 || type == 5125);
        const uint32_t size = type == 5121 ? 1 : type == 5123 ? 2 : 4;
        const Json *source = element("bufferViews", (*accessor)["bufferView"]);
        ASSERT_NE(source, nullptr);
        const size_t stride = number(*source, "byteStride", size);
        const size_t offset = number(*accessor, "byteOffset", 0);
        const size_t count = (*accessor)["count"].GetUint64();
        const std::span<const uint8_t> elements = bytes(*source);
        ASSERT_GT(count, 0u);
        ASSERT_LE(offset + (count - 1) * stride + size, elements.size());
        EXPECT_EQ((number(*source, "byteOffset", 0) + offset) % size, 0u);
        const Json *corners = element(
            "accessors", primitive.HasMember("indices") ? primitive["indices"] : primitive["attributes"]["POSITION"]);
        ASSERT_NE(corners, nullptr);
        EXPECT_EQ(count, (*corners)["count"].GetUint64() / 3);
        EXPECT_EQ(number(primitive, "mode", 4), 4u);
        Link link{micromap, static_cast<uint32_t>(base), size, {}};
        for (size_t e = 0; e < count; ++e)
            link.indices.insert(link.indices.end(), &elements[offset + e * stride],
                                &elements[offset + e * stride] + size);
        links.push_back(std::move(link));
    }

    Bytes file_;
    std::span<const uint8_t> binary_;
    rapidjson::Document json_;
};

template <typename T>
T load(const uint8_t *bytes)
{
    T value;
    std::memcpy(&value, bytes, sizeof value);
    return value;
}

// VkMicromapBuildInfoEXT and VkMicromapTriangleEXT: levels, formats, data inside of its buffer, usage that adds up.
void expectBuildable(const Input &input)
{
    ASSERT_TRUE(input.stride >= 8 && input.stride % 4 == 0);
    std::map<std::pair<uint32_t, uint32_t>, uint64_t> counts;
    for (const Usage &usage : input.usages)
        counts[{usage.level, usage.format}] += usage.count;
    for (size_t at = 0; at + 8 <= input.triangles.size(); at += input.stride) {
        const auto offset = load<uint32_t>(&input.triangles[at]);
        const auto level = load<uint16_t>(&input.triangles[at + 4]);
        const auto format = load<uint16_t>(&input.triangles[at + 6]);
        ASSERT_LE(level, 12u);
        ASSERT_TRUE(format == 1 || format == 2);
        const uint64_t bits = (uint64_t{1} << (2 * level)) * format;
        EXPECT_LE(offset + (bits + 7) / 8, input.data.size());
        --counts[{level, format}];
    }
    for (const auto &[kind, count] : counts)
        EXPECT_EQ(count, 0u) << "level " << kind.first << ", format " << kind.second;
}

// The state that Vulkan finds for a point of a triangle; the special indices by their unsigned bits.
State stateAt(const Renderer &renderer, const Link &link, size_t triangle, float u, float v)
{
    const uint8_t *at = &link.indices[triangle * link.indexBytes];
    const uint32_t index = link.indexBytes == 1 ? *at : link.indexBytes == 2 ? load<uint16_t>(at) : load<uint32_t>(at);
    const uint32_t last = 0xffffffffu >> (32 - 8 * link.indexBytes);
    if (index > last - 4)
        return static_cast<State>(last - index);
    const Input &input = renderer.micromaps[link.micromap];
    const uint8_t *record = &input.triangles[(index + link.baseTriangle) * input.stride];
    return readState(&input.data[load<uint32_t>(record)], shared::curveIndex(u, v, load<uint16_t>(record + 4)),
                     static_cast<Format>(load<uint16_t>(record + 6)));
}

// Bakes, reads, and compares with what our own reader makes of the file.
void expectRead(const Bytes &file, const FileBakeOptions &options, size_t primitives)
{
    const TemporaryFolder folder;
    writeFile(folder / "in.glb", file);
    bakeFile(folder / "in.glb", folder / "out.glb", options);
    const Renderer renderer(folder / "out.glb");
    ASSERT_FALSE(testing::Test::HasFailure());
    ASSERT_EQ(renderer.links.size(), primitives);
    for (const Input &input : renderer.micromaps)
        expectBuildable(input);
    const StoredMicromaps stored = readMicromaps(Document(folder / "out.glb"));
    size_t link = 0;
    for (const auto &[place, primitive] : stored.primitives) {
        const Micromap micromap = *stored.of(place);
        for (uint32_t t = 0; t < micromap.indices.size(); ++t)
            for (float u = 0.01f; u < 1; u += 0.07f)
                for (float v = 0.01f; u + v < 1; v += 0.07f)
                    ASSERT_EQ(stateAt(renderer, renderer.links[link], t, u, v), micromap.stateAt(t, u, v));
        ++link;
    }
    EXPECT_EQ(link, primitives);
}

} // namespace

TEST(RendererRules, HoldForABakedFile)
{
    FileBakeOptions options;
    expectRead(cardGlb(), options, 1);
    for (const uint32_t level : {0u, 1u, 2u, 5u, 9u}) {
        options.bake.level = level;
        options.bake.format = level % 2 == 0 ? Format::FourState : Format::TwoState;
        expectRead(cardGlb(), options, 1);
    }
}

TEST(RendererRules, HoldForStripsAndSeveralSources)
{
    FileBakeOptions options;
    options.bake.level = 4;
    expectRead(cardGlb({{R"("indices": 2, "material": 0)", R"("mode": 5, "material": 0)"}}), options, 1);
    expectRead(cardGlb({{R"({"attributes": {"POSITION": 3}, "material": 1})",
                         R"({"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 1})"},
                        {R"({"name": "wood"})", R"({"name": "wood", "alphaMode": "MASK", "pbrMetallicRoughness":
                            {"baseColorTexture": {"index": 0}}})"}}),
               options, 2);
}

TEST(RendererRules, HoldForSpecialIndicesAlone)
{
    FileBakeOptions options;
    expectRead(cardGlb({{R"(, "baseColorTexture": {"index": 0})", ""}}), options, 1);
}
