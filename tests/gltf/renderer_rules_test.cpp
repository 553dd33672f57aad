// Baked files as another reader sees them: what NVIDIA's vk_gltf_renderer checks before it hands a file's micromaps to
// Vulkan (its rules, from its source), with tinygltf alone, and what Vulkan then demands of a micromap build. Where
// that reader skips a micromap or a primitive with a warning, this one fails.
#include <cstring>
#include <gtest/gtest.h>
#include <map>
#include <span>

#include "core/curve.h"
#include "glb_file.h"
#include "gltf/file/tinygltf.h"
#include "gltf/micromaps/file_bake.h"
#include "gltf/micromaps/stored_micromaps.h"

using namespace vellum;
using namespace vellum::test;

namespace
{

constexpr const char *kExtension = "EXT_mesh_opacity_micromap";

struct Usage {
    std::uint32_t count, level, format;
};

struct Input { // of a micromap build
    std::span<const std::uint8_t> data;
    std::span<const std::uint8_t> triangles;
    std::size_t stride = 0;
    std::vector<Usage> usages;
};

struct Link { // of a primitive
    std::size_t micromap = 0;
    std::uint32_t baseTriangle = 0;
    std::uint32_t indexBytes = 0;
    std::vector<std::uint8_t> indices;
};

class Renderer
{
public:
    explicit Renderer(const std::filesystem::path &path)
    {
        tinygltf::TinyGLTF loader;
        loader.SetImageLoader([](tinygltf::Image *, const int, std::string *, std::string *, int, int,
                                 const unsigned char *, int, void *) { return true; },
                              nullptr);
        std::string error;
        std::string warning;
        const bool loaded = path.extension() == ".glb"
                                ? loader.LoadBinaryFromFile(&m_model, &error, &warning, path.string())
                                : loader.LoadASCIIFromFile(&m_model, &error, &warning, path.string());
        EXPECT_TRUE(loaded) << error;
        readMicromaps();
        readPrimitives();
    }

    std::vector<Input> micromaps;
    std::vector<Link> links;

private:
    [[nodiscard]] bool validView(int view) const
    {
        return view >= 0 && static_cast<std::size_t>(view) < m_model.bufferViews.size() &&
               m_model.bufferViews[static_cast<std::size_t>(view)].buffer >= 0 &&
               static_cast<std::size_t>(m_model.bufferViews[static_cast<std::size_t>(view)].buffer) <
                   m_model.buffers.size();
    }
    [[nodiscard]] const tinygltf::BufferView &view(int index) const
    {
        return m_model.bufferViews[static_cast<std::size_t>(index)];
    }
    [[nodiscard]] std::span<const std::uint8_t> bytes(int index) const
    {
        const auto &buffer = m_model.buffers[static_cast<std::size_t>(view(index).buffer)].data;
        EXPECT_LE(view(index).byteOffset + view(index).byteLength, buffer.size());
        return std::span(buffer).subspan(view(index).byteOffset, view(index).byteLength);
    }

    void readMicromaps()
    {
        const auto root = m_model.extensions.find(kExtension);
        ASSERT_NE(root, m_model.extensions.end());
        ASSERT_TRUE(root->second.Has("micromaps"));
        const tinygltf::Value &list = root->second.Get("micromaps");
        for (int i = 0; i < static_cast<int>(list.ArrayLen()); ++i) {
            const tinygltf::Value &micromap = list.Get(i);
            for (const char *name : {"data", "triangles", "usageCounts", "usageLevels", "usageFormats"})
                ASSERT_TRUE(micromap.Has(name)) << name;
            const int data = micromap.Get("data").GetNumberAsInt();
            const int triangles = micromap.Get("triangles").GetNumberAsInt();
            ASSERT_TRUE(validView(data) && validView(triangles));
            const tinygltf::Value &counts = micromap.Get("usageCounts");
            const tinygltf::Value &levels = micromap.Get("usageLevels");
            const tinygltf::Value &formats = micromap.Get("usageFormats");
            ASSERT_TRUE(counts.IsArray() && levels.IsArray() && formats.IsArray());
            ASSERT_EQ(counts.ArrayLen(), levels.ArrayLen());
            ASSERT_EQ(counts.ArrayLen(), formats.ArrayLen());
            Input input{bytes(data), bytes(triangles), 8, {}};
            if (view(triangles).byteStride != 0)
                input.stride = view(triangles).byteStride;
            for (int u = 0; u < static_cast<int>(counts.ArrayLen()); ++u)
                input.usages.push_back({static_cast<std::uint32_t>(counts.Get(u).GetNumberAsInt()),
                                        static_cast<std::uint32_t>(levels.Get(u).GetNumberAsInt()),
                                        static_cast<std::uint32_t>(formats.Get(u).GetNumberAsInt())});
            // Loaded into memory as they are, both addresses are multiples of 256.
            EXPECT_EQ(view(data).byteOffset % 256, 0u);
            EXPECT_EQ(view(triangles).byteOffset % 256, 0u);
            micromaps.push_back(std::move(input));
        }
    }

    void readPrimitives()
    {
        for (const tinygltf::Mesh &mesh : m_model.meshes)
            for (const tinygltf::Primitive &primitive : mesh.primitives)
                if (const auto found = primitive.extensions.find(kExtension); found != primitive.extensions.end())
                    readPrimitive(primitive, found->second);
    }

    void readPrimitive(const tinygltf::Primitive &primitive, const tinygltf::Value &extension)
    {
        ASSERT_TRUE(extension.Has("micromap"));
        const int micromap = extension.Get("micromap").GetNumberAsInt();
        ASSERT_TRUE(micromap >= 0 && static_cast<std::size_t>(micromap) < micromaps.size());
        const int base =
            extension.Has("micromapBaseTriangle") ? extension.Get("micromapBaseTriangle").GetNumberAsInt() : 0;
        ASSERT_GE(base, 0);
        ASSERT_TRUE(extension.Has("micromapIndices"));
        const int index = extension.Get("micromapIndices").GetNumberAsInt();
        ASSERT_TRUE(index >= 0 && static_cast<std::size_t>(index) < m_model.accessors.size());
        const tinygltf::Accessor &accessor = m_model.accessors[static_cast<std::size_t>(index)];
        // Of the types that it takes, those that VK_EXT_opacity_micromap does, too.
        ASSERT_TRUE(accessor.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ||
                    accessor.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT);
        const std::uint32_t size = accessor.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ? 2 : 4;
        ASSERT_TRUE(validView(accessor.bufferView));
        const tinygltf::BufferView &source = view(accessor.bufferView);
        const std::size_t stride = source.byteStride != 0 ? source.byteStride : size;
        const auto &buffer = m_model.buffers[static_cast<std::size_t>(source.buffer)].data;
        const std::size_t begin = source.byteOffset + accessor.byteOffset;
        ASSERT_GT(accessor.count, 0u);
        ASSERT_LE(begin + (accessor.count - 1) * stride + size, buffer.size());
        EXPECT_EQ(begin % size, 0u);
        const tinygltf::Accessor &corners = m_model.accessors[static_cast<std::size_t>(
            primitive.indices >= 0 ? primitive.indices : primitive.attributes.at("POSITION"))];
        EXPECT_EQ(accessor.count, corners.count / 3);
        EXPECT_TRUE(primitive.mode == TINYGLTF_MODE_TRIANGLES || primitive.mode == -1);
        Link link{static_cast<std::size_t>(micromap), static_cast<std::uint32_t>(base), size, {}};
        for (std::size_t e = 0; e < accessor.count; ++e)
            link.indices.insert(link.indices.end(), &buffer[begin + e * stride], &buffer[begin + e * stride] + size);
        links.push_back(std::move(link));
    }

    tinygltf::Model m_model;
};

template <typename T>
T load(const std::uint8_t *bytes)
{
    T value;
    std::memcpy(&value, bytes, sizeof value);
    return value;
}

// VkMicromapBuildInfoEXT and VkMicromapTriangleEXT: levels, formats, data inside of its buffer, usage that adds up.
void expectBuildable(const Input &input)
{
    ASSERT_TRUE(input.stride >= 8 && input.stride % 4 == 0);
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint64_t> counts;
    for (const Usage &usage : input.usages)
        counts[{usage.level, usage.format}] += usage.count;
    for (std::size_t at = 0; at + 8 <= input.triangles.size(); at += input.stride) {
        const auto offset = load<std::uint32_t>(&input.triangles[at]);
        const auto level = load<std::uint16_t>(&input.triangles[at + 4]);
        const auto format = load<std::uint16_t>(&input.triangles[at + 6]);
        ASSERT_LE(level, 12u);
        ASSERT_TRUE(format == 1 || format == 2);
        const std::uint64_t bits = (std::uint64_t{1} << (2 * level)) * format;
        EXPECT_LE(offset + (bits + 7) / 8, input.data.size());
        --counts[{level, format}];
    }
    for (const auto &[kind, count] : counts)
        EXPECT_EQ(count, 0u) << "level " << kind.first << ", format " << kind.second;
}

// The state that Vulkan finds for a point of a triangle; the special indices by their unsigned bits.
State stateAt(const Renderer &renderer, const Link &link, std::size_t triangle, float u, float v)
{
    const std::uint8_t *at = &link.indices[triangle * link.indexBytes];
    const std::uint32_t index = link.indexBytes == 2 ? load<std::uint16_t>(at) : load<std::uint32_t>(at);
    const std::uint32_t last = link.indexBytes == 2 ? 0xffffu : 0xffffffffu;
    if (index > last - 4)
        return static_cast<State>(last - index);
    const Input &input = renderer.micromaps[link.micromap];
    const std::uint8_t *record = &input.triangles[(index + link.baseTriangle) * input.stride];
    return readState(&input.data[load<std::uint32_t>(record)],
                     shared::curveIndex(u, v, load<std::uint16_t>(record + 4)),
                     static_cast<Format>(load<std::uint16_t>(record + 6)));
}

// Bakes, reads, and compares with what our own reader makes of the file.
void expectRead(const Bytes &file, const FileBakeOptions &options, std::size_t primitives)
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
    std::size_t link = 0;
    for (const auto &[place, primitive] : stored.primitives) {
        const Micromap micromap = *stored.of(place);
        for (std::uint32_t t = 0; t < micromap.indices.size(); ++t)
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
    for (const std::uint32_t level : {0u, 1u, 2u, 5u, 9u}) {
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
