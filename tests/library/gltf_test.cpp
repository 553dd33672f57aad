// SPDX-License-Identifier: Apache-2.0
// libvellum's part for glTF files as its users see it; the reader and the writer behind it are tested in tests/gltf.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <functional>
#include <limits>
#include <map>
#include <thread>

#include "allocations.h"
#include "glb_file.h"
#include "gltf/micromaps/file_bake.h"
#include "vellum/gltf.h"

using namespace vellum;
using namespace vellum::test;

namespace
{

// The card of glb_file.h in a folder, options to bake it, and what the library says.
struct Card {
    explicit Card(const Replacements &replacements = {})
    {
        writeFile(folder / "card.glb", cardGlb(replacements));
        vellumInitBakeOptions(&options, sizeof options);
        options.level = 4;
        options.threads = 1;
        options.message = onMessage;
        options.userData = this;
        vellumInitGltfBakeOptions(&more, sizeof more);
        more.skipped = note;
        info.structSize = sizeof info;
    }
    Card(const Card &) = delete;
    Card &operator=(const Card &) = delete;
    ~Card() { vellumDestroyGltf(gltf); }

    static void onMessage(void *self, VellumResult result, const char *text)
    {
        auto &card = *static_cast<Card *>(self);
        ++card.messages;
        card.reported = result;
        card.message = text;
    }
    static void note(void *self, const char *place, const char *text)
    {
        static_cast<Card *>(self)->notes.push_back(std::string(place) + ": " + text);
    }

    [[nodiscard]] std::string path(const std::string &name) const { return (folder / name).string(); }
    VellumResult bake(const std::string &input = "card.glb", const std::string &output = "card.omm.glb")
    {
        message.clear();
        messages = 0;
        notes.clear();
        return vellumBakeGltf(path(input).c_str(), path(output).c_str(), &options, &more, &info);
    }
    VellumResult read(const std::string &name)
    {
        message.clear();
        messages = 0;
        vellumDestroyGltf(gltf);
        return vellumReadGltf(path(name).c_str(), onMessage, this, &gltf);
    }
    VellumResult check(const std::string &name, size_t most = 100)
    {
        message.clear();
        notes.clear();
        return vellumCheckGltf(path(name).c_str(), most, note, onMessage, this);
    }
    [[nodiscard]] VellumGltfPrimitiveInfo primitive(size_t number) const
    {
        VellumGltfPrimitiveInfo found{};
        found.structSize = sizeof found;
        EXPECT_EQ(vellumGetGltfPrimitiveInfo(gltf, number, &found), VELLUM_SUCCESS);
        return found;
    }
    [[nodiscard]] VellumGltfMicromapInfo micromap(size_t number) const
    {
        VellumGltfMicromapInfo found{};
        found.structSize = sizeof found;
        EXPECT_EQ(vellumGetGltfMicromapInfo(gltf, number, &found), VELLUM_SUCCESS);
        return found;
    }
    // Bakes the card with every `from` in the output replaced by `to`, which is as long.
    void bakeDamaged(const std::string &from, const std::string &to)
    {
        ASSERT_EQ(from.size(), to.size());
        ASSERT_EQ(bake(), VELLUM_SUCCESS);
        Bytes bytes = readFile(folder / "card.omm.glb");
        auto found = std::search(bytes.begin(), bytes.end(), from.begin(), from.end());
        ASSERT_NE(found, bytes.end());
        for (; found != bytes.end(); found = std::search(found, bytes.end(), from.begin(), from.end()))
            std::copy(to.begin(), to.end(), found);
        writeFile(folder / "damaged.glb", bytes);
    }
    // The number of files. A failure must leave only the input.
    [[nodiscard]] size_t files() const
    {
        const std::filesystem::directory_iterator entries(folder.path());
        return static_cast<size_t>(std::distance(begin(entries), end(entries)));
    }

    TemporaryFolder folder;
    VellumBakeOptions options{};
    VellumGltfBakeOptions more{};
    VellumGltfBakeInfo info{};
    VellumGltf *gltf = nullptr;
    int messages = 0;
    VellumResult reported = VELLUM_SUCCESS;
    std::string message;
    std::vector<std::string> notes;
};

// A cache of a caller's, for a Card whose userData it takes the place of.
struct Cache {
    explicit Cache(Card &card)
    {
        card.options.message = nullptr;
        card.options.userData = this;
        card.more.skipped = nullptr;
        card.more.cacheGet = get;
        card.more.cachePut = put;
    }
    static void get(void *self, const uint8_t *key, VellumGltfCacheValueCallback found, void *receiver)
    {
        const auto &cache = *static_cast<Cache *>(self);
        EXPECT_EQ(std::this_thread::get_id(), cache.thread);
        const auto value = cache.values.find({key, key + VELLUM_GLTF_CACHE_KEY_SIZE});
        if (value != cache.values.end()) {
            const Bytes copy = value->second; // valid during the call only
            found(receiver, copy.data(), copy.size());
        }
    }
    static void put(void *self, const uint8_t *key, const void *value, size_t size)
    {
        auto &cache = *static_cast<Cache *>(self);
        EXPECT_EQ(std::this_thread::get_id(), cache.thread);
        const auto *first = static_cast<const uint8_t *>(value);
        cache.values[{key, key + VELLUM_GLTF_CACHE_KEY_SIZE}] = {first, first + size};
    }

    std::map<Bytes, Bytes> values;
    std::thread::id thread = std::this_thread::get_id();
};

bool equal(const VellumMicromapUsage *usages, size_t count, const std::vector<MicromapUsage> &expected)
{
    return std::equal(usages, usages + count, expected.begin(), expected.end(),
                      [](const VellumMicromapUsage &a, const MicromapUsage &b) {
                          return a.count == b.count && a.subdivisionLevel == b.subdivisionLevel &&
                                 a.format == static_cast<uint32_t>(b.format);
                      });
}

const Replacements kNamed = {{R"({"primitives": [)", R"({"name": "leaves", "primitives": [)"}};
const Replacements kBlend = {{R"("alphaMode": "MASK", "alphaCutoff": 0.25)", R"("alphaMode": "BLEND")"}};

} // namespace

TEST(LibraryGltf, UsesACacheOfTheCaller)
{
    Card card;
    ASSERT_EQ(card.bake("card.glb", "plain.glb"), VELLUM_SUCCESS);
    EXPECT_EQ(card.info.cacheHits + card.info.cacheMisses, 0u);
    const Bytes plain = readFile(card.folder / "plain.glb");
    Cache cache(card);
    const auto expect = [&](size_t hits, size_t misses) {
        ASSERT_EQ(card.bake(), VELLUM_SUCCESS);
        EXPECT_EQ(card.info.cacheHits, hits);
        EXPECT_EQ(card.info.cacheMisses, misses);
        EXPECT_EQ(readFile(card.folder / "card.omm.glb"), plain);
    };
    card.options.threads = 3;
    expect(0, 1);
    expect(1, 0);
    ASSERT_EQ(cache.values.size(), 1u);
    Bytes &value = cache.values.begin()->second;
    const Bytes whole = value;
    value[value.size() / 2] ^= 1;
    expect(0, 1);
    EXPECT_EQ(value, whole);
    value.clear();
    expect(0, 1);
    // Either alone.
    card.more.cachePut = nullptr;
    expect(1, 0);
    card.more.cacheGet = nullptr;
    card.more.cachePut = Cache::put;
    cache.values.clear();
    expect(0, 1);
    EXPECT_EQ(cache.values.begin()->second, whole);
}

TEST(LibraryGltf, ReadsWhatItBaked)
{
    Card card(kNamed);
    ASSERT_EQ(card.bake(), VELLUM_SUCCESS) << card.message;
    EXPECT_EQ(card.messages, 0);
    ASSERT_EQ(card.read("card.omm.glb"), VELLUM_SUCCESS) << card.message;
    VellumGltfInfo info{};
    info.structSize = sizeof info;
    ASSERT_EQ(vellumGetGltfInfo(card.gltf, &info), VELLUM_SUCCESS);
    EXPECT_STREQ(info.extension, "EXT_mesh_opacity_micromap");
    EXPECT_EQ(info.micromapCount, 1u);
    EXPECT_EQ(info.primitiveCount, 1u);

    const StoredMicromaps stored = readMicromaps(Document(card.folder / "card.omm.glb"));
    Micromap whole; // the micromap that a build reads
    whole.triangles = stored.micromaps.at(0).triangles;
    whole.data = stored.micromaps.at(0).data;
    whole.indices = stored.primitives.at({0, 0}).indices;
    ASSERT_EQ(whole.validate(), std::nullopt);
    const VellumGltfMicromapInfo micromap = card.micromap(0);
    EXPECT_EQ(Bytes(micromap.data, micromap.data + micromap.dataSize), whole.data);
    ASSERT_EQ(micromap.triangleCount, whole.triangles.size());
    EXPECT_EQ(std::memcmp(micromap.triangles, whole.triangles.data(), 8 * whole.triangles.size()), 0);
    EXPECT_EQ(micromap.triangles[0].subdivisionLevel, 4);
    EXPECT_TRUE(equal(micromap.usages, micromap.usageCount, usageOf(whole.triangles)));
    const VellumGltfPrimitiveInfo primitive = card.primitive(0);
    EXPECT_STREQ(primitive.name, "mesh 0 \"leaves\" primitive 0");
    EXPECT_EQ(primitive.mesh, 0u);
    EXPECT_EQ(primitive.primitive, 0u);
    EXPECT_EQ(primitive.micromap, 0u);
    EXPECT_EQ(primitive.baseTriangle, 0u);
    EXPECT_EQ(std::vector<int32_t>(primitive.indices, primitive.indices + primitive.indexCount), whole.indices);
    EXPECT_EQ(primitive.indexCount, 2u);
    EXPECT_TRUE(
        equal(primitive.usages, primitive.usageCount, usageOf(whole.triangles, whole.indices, whole.baseTriangle)));
    EXPECT_GT(primitive.usageCount, 0u);
    EXPECT_EQ(vellumFindGltfPrimitive(card.gltf, 0, 0), 0u);
    EXPECT_EQ(vellumFindGltfPrimitive(card.gltf, 0, 1), VELLUM_GLTF_NO_MICROMAP);
    EXPECT_EQ(vellumFindGltfPrimitive(card.gltf, 1, 0), VELLUM_GLTF_NO_MICROMAP);

    EXPECT_EQ(card.info.micromapCount, 1u);
    EXPECT_EQ(card.info.primitiveCount, 1u);
    EXPECT_EQ(card.info.skippedCount, 0u);
    EXPECT_EQ(card.info.micromapSize, whole.data.size() + 8 * whole.triangles.size());
    EXPECT_EQ(card.info.inputSize, readFile(card.folder / "card.glb").size());
    EXPECT_EQ(card.info.outputSize, readFile(card.folder / "card.omm.glb").size());
    EXPECT_EQ(card.info.replaced, 0u);
    EXPECT_EQ(card.check("card.omm.glb"), VELLUM_SUCCESS);
    EXPECT_TRUE(card.notes.empty());
}

TEST(LibraryGltf, OptionsReachTheBaker)
{
    Card card;
    card.options.format = VELLUM_MICROMAP_FORMAT_2_STATE;
    card.options.level = 2;
    ASSERT_EQ(card.bake(), VELLUM_SUCCESS);
    FileBakeOptions options;
    options.bake.format = Format::TwoState;
    options.bake.level = 2;
    bakeFile(card.folder / "card.glb", card.folder / "same.glb", options);
    EXPECT_EQ(readFile(card.folder / "card.omm.glb"), readFile(card.folder / "same.glb"));
    ASSERT_EQ(card.bake("card.omm.glb", "again.glb"), VELLUM_SUCCESS);
    EXPECT_EQ(card.info.replaced, 1u);
    EXPECT_EQ(
        vellumBakeGltf(card.path("card.glb").c_str(), card.path("defaults.glb").c_str(), nullptr, nullptr, nullptr),
        VELLUM_SUCCESS);
    bakeFile(card.folder / "card.glb", card.folder / "same.glb", {});
    EXPECT_EQ(readFile(card.folder / "defaults.glb"), readFile(card.folder / "same.glb"));
}

TEST(LibraryGltf, SkipsBlendByDefault)
{
    Card card(kBlend);
    ASSERT_EQ(card.bake(), VELLUM_SUCCESS) << card.message;
    EXPECT_EQ(card.notes, std::vector<std::string>{"mesh 0 primitive 0: its alphaMode is BLEND"});
    EXPECT_EQ(card.info.skippedCount, 1u);
    ASSERT_EQ(card.read("card.omm.glb"), VELLUM_SUCCESS);
    VellumGltfInfo info{};
    info.structSize = sizeof info;
    ASSERT_EQ(vellumGetGltfInfo(card.gltf, &info), VELLUM_SUCCESS);
    EXPECT_STREQ(info.extension, "");
    EXPECT_EQ(info.micromapCount + info.primitiveCount, 0u);

    card.more.flags = VELLUM_GLTF_BAKE_BLEND_BIT;
    ASSERT_EQ(card.bake(), VELLUM_SUCCESS);
    EXPECT_TRUE(card.notes.empty());
    const Bytes without = readFile(card.folder / "card.omm.glb");
    card.more.blendCutoff = 2; // above every alpha
    ASSERT_EQ(card.bake(), VELLUM_SUCCESS);
    EXPECT_EQ(readFile(card.folder / "card.omm.glb"), without) << "a cutoff that was not requested";
    card.more.flags |= VELLUM_GLTF_BAKE_BLEND_CUTOFF_BIT;
    ASSERT_EQ(card.bake(), VELLUM_SUCCESS);
    EXPECT_NE(readFile(card.folder / "card.omm.glb"), without);
    ASSERT_EQ(card.read("card.omm.glb"), VELLUM_SUCCESS);
    EXPECT_EQ(card.primitive(0).usageCount, 0u);
    EXPECT_EQ(card.primitive(0).indices[0], VELLUM_SPECIAL_INDEX_FULLY_TRANSPARENT);
}

// The bytes are those of `vellum bake --target-known`, which calls the same function.
TEST(LibraryGltf, TheSmallestThatKnowsAShare)
{
    Card card;
    card.more.flags = VELLUM_GLTF_BAKE_TARGET_KNOWN_BIT;
    uint64_t last = 0;
    for (const double share : {0.0, 0.3, 0.6}) {
        card.more.targetKnown = share;
        ASSERT_EQ(card.bake(), VELLUM_SUCCESS) << card.message;
        EXPECT_GT(card.info.micromapSize, last);
        last = card.info.micromapSize;
        FileBakeOptions options;
        options.bake.level = 4;
        options.bake.threads = 1;
        options.targetKnown = share;
        bakeFile(card.folder / "card.glb", card.folder / "expected.glb", options);
        EXPECT_EQ(readFile(card.folder / "card.omm.glb"), readFile(card.folder / "expected.glb"));
    }
    card.more.targetKnown = 1;
    EXPECT_EQ(card.bake(), VELLUM_ERROR_FILE);
    EXPECT_NE(card.message.find("card.glb: the wanted share is not reached: at most "), std::string::npos)
        << card.message;
    card.more.flags = 0;
    EXPECT_EQ(card.bake(), VELLUM_SUCCESS) << "a share that was not requested";
}

TEST(LibraryGltf, FallbackImagesOnRequest)
{
    Card card({{R"({"source": 0, "sampler": 0})",
                R"({"source": 0, "sampler": 0, "extensions": {"KHR_texture_basisu": {"source": 1}}})"},
               {R"("bufferView": 3}])", R"("bufferView": 3}, {"uri": "none"}])"}});
    ASSERT_EQ(card.bake(), VELLUM_SUCCESS) << card.message;
    EXPECT_EQ(card.notes, std::vector<std::string>{"mesh 0 primitive 0: its texture also has an image that is not "
                                                   "supported (KHR_texture_basisu), which renderers may take"});
    card.notes.clear();
    card.more.flags = VELLUM_GLTF_BAKE_FALLBACK_IMAGES_BIT;
    ASSERT_EQ(card.bake(), VELLUM_SUCCESS) << card.message;
    EXPECT_TRUE(card.notes.empty());
    EXPECT_EQ(card.info.primitiveCount, 1u);
}

TEST(LibraryGltf, LeavesWhatMatches)
{
    const char *const others[] = {"wood", "l?af?"};
    const char *const leaf[] = {"wood", "l[a-e]*"};
    Card card;
    card.more.excludedMaterials = others;
    card.more.excludedMaterialCount = 2;
    ASSERT_EQ(card.bake(), VELLUM_SUCCESS);
    EXPECT_EQ(card.info.primitiveCount, 1u);
    card.more.excludedMaterials = leaf;
    ASSERT_EQ(card.bake(), VELLUM_SUCCESS);
    EXPECT_EQ(card.info.primitiveCount, 0u);
    EXPECT_EQ(card.notes, std::vector<std::string>{"mesh 0 primitive 0: it is excluded"});
    card.more.skipped = nullptr;
    EXPECT_EQ(card.bake(), VELLUM_SUCCESS);
    EXPECT_TRUE(card.notes.empty());
}

TEST(LibraryGltf, MicromapsInASeparateFileOrEmbedded)
{
    Card card;
    writeFile(card.folder / "image.png", discPng());
    std::string json = R"({"asset": {"version": "2.0"}, "meshes": [{"primitives": [
        {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}]}],
        "materials": [{"alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}], "images": [{"uri": "image.png"}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
                      {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 24}],
        "buffers": [{"uri": "triangle.bin", "byteLength": 60}]})";
    writeFile(card.folder / "triangle.gltf", {json.begin(), json.end()});
    const float triangle[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1};
    Bytes bytes(sizeof triangle);
    std::memcpy(bytes.data(), triangle, sizeof triangle);
    writeFile(card.folder / "triangle.bin", bytes);
    const auto buffer = [&card] { // its name depends on its content
        for (const auto &entry : std::filesystem::directory_iterator(card.folder.path()))
            if (entry.path().filename().string().starts_with("baked.omm-"))
                return entry.path();
        return std::filesystem::path();
    };
    for (const bool embed : {true, false}) {
        card.more.flags = embed ? VELLUM_GLTF_BAKE_EMBED_BIT : 0;
        ASSERT_EQ(card.bake("triangle.gltf", "baked.gltf"), VELLUM_SUCCESS) << card.message;
        EXPECT_EQ(buffer().empty(), embed);
        ASSERT_EQ(card.read("baked.gltf"), VELLUM_SUCCESS) << card.message;
        EXPECT_EQ(card.micromap(0).dataSize, 64u);
    }
    // Files that are copied replace others only on request.
    std::filesystem::create_directory(card.folder / "out");
    for (const uint8_t first : Bytes{1, 2}) {
        bytes[0] = first;
        writeFile(card.folder / "triangle.bin", bytes);
        EXPECT_EQ(card.bake("triangle.gltf", "out/baked.gltf"), first == 1 ? VELLUM_SUCCESS : VELLUM_ERROR_FILE);
    }
    EXPECT_NE(card.message.find("is there already and differs"), std::string::npos) << card.message;
    card.more.flags = VELLUM_GLTF_BAKE_REPLACE_COPIES_BIT;
    EXPECT_EQ(card.bake("triangle.gltf", "out/baked.gltf"), VELLUM_SUCCESS) << card.message;
    EXPECT_EQ(readFile(card.folder / "out/triangle.bin"), bytes);

    std::filesystem::resize_file(buffer(), 10);
    EXPECT_EQ(card.read("baked.gltf"), VELLUM_ERROR_FILE);
    EXPECT_NE(card.message.find("baked.gltf: "), std::string::npos) << card.message;
}

TEST(LibraryGltf, MicromapsThatBreakARule)
{
    Card card;
    ASSERT_NO_FATAL_FAILURE(card.bakeDamaged(R"("micromap":0)", R"("micromap":7)"));
    EXPECT_EQ(card.check("damaged.glb"), VELLUM_SUCCESS);
    ASSERT_EQ(card.notes.size(), 1u);
    EXPECT_EQ(card.notes[0].find("mesh 0 primitive 0: "), 0u) << card.notes[0];
    EXPECT_EQ(card.read("damaged.glb"), VELLUM_ERROR_FILE);
    EXPECT_EQ(card.gltf, nullptr);
    EXPECT_EQ(card.messages, 1);
    EXPECT_EQ(card.reported, VELLUM_ERROR_FILE);
    EXPECT_EQ(card.message, card.path("damaged.glb") + ": " + card.notes[0]);
    EXPECT_EQ(card.check("damaged.glb", 0), VELLUM_SUCCESS);
    EXPECT_TRUE(card.notes.empty());
    // Baking replaces them.
    EXPECT_EQ(card.bake("damaged.glb", "whole.glb"), VELLUM_SUCCESS) << card.message;
    EXPECT_EQ(card.read("whole.glb"), VELLUM_SUCCESS) << card.message;
}

TEST(LibraryGltf, FilesThatCannotBeRead)
{
    Card card;
    const Bytes whole = readFile(card.folder / "card.glb");
    std::vector<std::string> names = {"missing.glb", "", "none/card.glb"};
    for (const size_t size : {size_t{0}, size_t{3}, size_t{19}, size_t{200}, whole.size() - 1}) {
        names.push_back("short" + std::to_string(size) + ".glb");
        writeFile(card.folder / names.back(), {whole.begin(), whole.begin() + static_cast<ptrdiff_t>(size)});
    }
    const size_t files = card.files();
    for (const std::string &name : names) {
        SCOPED_TRACE(name);
        EXPECT_EQ(card.read(name), VELLUM_ERROR_FILE);
        EXPECT_EQ(card.gltf, nullptr);
        EXPECT_EQ(card.messages, 1);
        EXPECT_EQ(card.message.find(card.path(name)), 0u) << card.message;
        EXPECT_EQ(card.message.find('\n'), std::string::npos);
        const std::string said = card.message;
        EXPECT_EQ(card.check(name), VELLUM_ERROR_FILE);
        EXPECT_EQ(card.message, said);
        EXPECT_EQ(card.bake(name), VELLUM_ERROR_FILE);
        EXPECT_EQ(card.message, said);
        EXPECT_EQ(card.files(), files);
    }
    EXPECT_EQ(card.bake("card.glb", "card.glb"), VELLUM_ERROR_FILE);
    EXPECT_EQ(card.bake("card.glb", "card.gltf"), VELLUM_ERROR_FILE);
    EXPECT_EQ(card.bake("card.glb", "short3.glb/card.glb"), VELLUM_ERROR_FILE);
    EXPECT_EQ(card.files(), files);
    EXPECT_EQ(readFile(card.folder / "card.glb"), whole);
}

TEST(LibraryGltf, BadArgumentsAreNamed)
{
    struct Mistake {
        const char *says;
        void (*make)(Card &);
    };
    static const char *const nulls[] = {nullptr};
    const Mistake mistakes[] = {
        {"level is 13", [](Card &c) { c.options.level = 13; }},
        {"compareOp is 4, not VELLUM_COMPARE_OP_GREATER_OR_EQUAL",
         [](Card &c) { c.options.compareOp = VELLUM_COMPARE_OP_GREATER; }},
        {"flags of VellumBakeOptions is 1",
         [](Card &c) { c.options.flags = VELLUM_BAKE_DISALLOW_MIXED_SPECIAL_INDICES_BIT; }},
        {"flags is 64", [](Card &c) { c.more.flags = 64; }},
        {"targetKnown is 1.5", [](Card &c) { c.more.targetKnown = 1.5; }},
        {"targetKnown is nan", [](Card &c) { c.more.targetKnown = std::numeric_limits<double>::quiet_NaN(); }},
        {"budget and VELLUM_GLTF_BAKE_TARGET_KNOWN_BIT exclude each other",
         [](Card &c) {
             c.more.flags = VELLUM_GLTF_BAKE_TARGET_KNOWN_BIT;
             c.options.budget = 1000;
         }},
        {"VELLUM_GLTF_BAKE_TARGET_KNOWN_BIT is for 4 states",
         [](Card &c) {
             c.more.flags = VELLUM_GLTF_BAKE_TARGET_KNOWN_BIT;
             c.options.format = VELLUM_MICROMAP_FORMAT_2_STATE;
         }},
        {"blendCutoff is not finite", [](Card &c) { c.more.blendCutoff = std::numeric_limits<float>::quiet_NaN(); }},
        {"blendCutoff is not finite", [](Card &c) { c.more.blendCutoff = std::numeric_limits<float>::infinity(); }},
        {"excludedMaterials is null, but 2 patterns", [](Card &c) { c.more.excludedMaterialCount = 2; }},
        {"excludedMeshes[0] is null",
         [](Card &c) {
             c.more.excludedMeshes = nulls;
             c.more.excludedMeshCount = 1;
         }},
        {"structSize of VellumGltfBakeOptions is 0", [](Card &c) { c.more.structSize = 0; }},
        {"structSize of VellumGltfBakeInfo is 12", [](Card &c) { c.info.structSize = 12; }},
    };
    for (const Mistake &mistake : mistakes) {
        SCOPED_TRACE(mistake.says);
        Card card;
        mistake.make(card);
        EXPECT_EQ(card.bake(), VELLUM_ERROR_INVALID_ARGUMENT);
        EXPECT_EQ(card.messages, 1);
        EXPECT_EQ(card.reported, VELLUM_ERROR_INVALID_ARGUMENT);
        EXPECT_NE(card.message.find(mistake.says), std::string::npos) << card.message;
        EXPECT_EQ(card.files(), 1u);
    }
    Card card;
    const std::string path = card.path("card.glb");
    EXPECT_EQ(vellumBakeGltf(nullptr, path.c_str(), &card.options, nullptr, nullptr), VELLUM_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(card.message, "input is null");
    EXPECT_EQ(vellumBakeGltf(path.c_str(), "", &card.options, nullptr, nullptr), VELLUM_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(card.message, "output is empty");
    EXPECT_EQ(vellumReadGltf(nullptr, Card::onMessage, &card, &card.gltf), VELLUM_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(card.message, "path is null");
    EXPECT_EQ(vellumReadGltf(path.c_str(), Card::onMessage, &card, nullptr), VELLUM_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(vellumReadGltf(nullptr, nullptr, nullptr, nullptr), VELLUM_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(vellumCheckGltf(path.c_str(), 1, nullptr, Card::onMessage, &card), VELLUM_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(vellumCheckGltf("", 1, Card::note, Card::onMessage, &card), VELLUM_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(card.messages, 6);
    card.options.structSize = 0; // so the callback cannot be read
    EXPECT_EQ(card.bake(), VELLUM_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(card.messages, 0);
    vellumInitGltfBakeOptions(nullptr, 100);
    vellumDestroyGltf(nullptr);
}

TEST(LibraryGltf, GettersRejectAbsentItems)
{
    Card card;
    ASSERT_EQ(card.bake(), VELLUM_SUCCESS);
    ASSERT_EQ(card.read("card.omm.glb"), VELLUM_SUCCESS);
    VellumGltfInfo info{};
    VellumGltfMicromapInfo micromap{};
    VellumGltfPrimitiveInfo primitive{};
    const auto invalid = VELLUM_ERROR_INVALID_ARGUMENT;
    EXPECT_EQ(vellumGetGltfInfo(card.gltf, &info), invalid); // structSize is 0
    EXPECT_EQ(vellumGetGltfMicromapInfo(card.gltf, 0, &micromap), invalid);
    EXPECT_EQ(vellumGetGltfPrimitiveInfo(card.gltf, 0, &primitive), invalid);
    info.structSize = sizeof info;
    micromap.structSize = sizeof micromap;
    primitive.structSize = sizeof primitive;
    EXPECT_EQ(vellumGetGltfInfo(nullptr, &info), invalid);
    EXPECT_EQ(vellumGetGltfInfo(card.gltf, nullptr), invalid);
    EXPECT_EQ(vellumGetGltfMicromapInfo(nullptr, 0, &micromap), invalid);
    EXPECT_EQ(vellumGetGltfMicromapInfo(card.gltf, 0, nullptr), invalid);
    EXPECT_EQ(vellumGetGltfMicromapInfo(card.gltf, 1, &micromap), invalid);
    EXPECT_EQ(vellumGetGltfPrimitiveInfo(nullptr, 0, &primitive), invalid);
    EXPECT_EQ(vellumGetGltfPrimitiveInfo(card.gltf, 0, nullptr), invalid);
    EXPECT_EQ(vellumGetGltfPrimitiveInfo(card.gltf, 1, &primitive), invalid);
    EXPECT_EQ(vellumFindGltfPrimitive(nullptr, 0, 0), VELLUM_GLTF_NO_MICROMAP);
}

TEST(LibraryGltf, StructuresOfLaterVersions)
{
    struct {
        VellumGltfBakeOptions known;
        uint64_t more;
    } options;
    struct {
        VellumGltfBakeInfo known;
        uint64_t more;
    } info{};
    Card card;
    const std::string input = card.path("card.glb");
    const std::string output = card.path("card.omm.glb");
    vellumInitGltfBakeOptions(&options.known, sizeof options);
    EXPECT_EQ(options.more, 0u);
    EXPECT_EQ(options.known.blendCutoff, 0.5f);
    info.known.structSize = sizeof info;
    info.more = 5;
    ASSERT_EQ(vellumBakeGltf(input.c_str(), output.c_str(), &card.options, &options.known, &info.known),
              VELLUM_SUCCESS);
    EXPECT_EQ(info.known.structSize, sizeof info);
    EXPECT_EQ(info.known.primitiveCount, 1u);
    EXPECT_EQ(info.more, 0u);
    options.more = 1;
    EXPECT_EQ(vellumBakeGltf(input.c_str(), output.c_str(), &card.options, &options.known, nullptr),
              VELLUM_ERROR_UNSUPPORTED);
    EXPECT_EQ(card.messages, 1);
}

TEST(LibraryGltf, CancelledWritesNoFile)
{
    Card card;
    card.options.cancelled = [](void *) { return 1; };
    EXPECT_EQ(card.bake(), VELLUM_CANCELLED);
    card.options.cancelled = nullptr;
    card.options.progress = [](void *, uint64_t done, uint64_t total) {
        return done == total ? 1 : 0; // at the last moment
    };
    EXPECT_EQ(card.bake(), VELLUM_CANCELLED);
    EXPECT_EQ(card.messages, 0);
    EXPECT_EQ(card.files(), 1u);
    card.options.progress = nullptr;
    card.options.maxDataSize = 20;
    EXPECT_EQ(card.bake(), VELLUM_ERROR_TOO_LARGE);
    EXPECT_EQ(card.messages, 1);
    EXPECT_EQ(card.message.find(card.path("card.glb") + ": "), 0u) << card.message;
    EXPECT_EQ(card.files(), 1u);
    card.options.maxDataSize = 1 << 20;
    EXPECT_EQ(card.bake(), VELLUM_SUCCESS);
    EXPECT_EQ(card.files(), 2u);
}

// Whichever allocation fails, the result says so, and nothing is left behind.
TEST(LibraryGltf, OutOfMemory)
{
    Card card;
    card.message.reserve(1000);
    card.more.skipped = nullptr;
    ASSERT_EQ(card.bake("card.glb", "whole.glb"), VELLUM_SUCCESS);
    const Bytes whole = readFile(card.folder / "whole.glb");
    const auto failEach = [&](const std::function<VellumResult()> &call) {
        long failures = 0;
        for (long n = 0;; ++n) {
            ASSERT_LT(n, 20000);
            const long before = allocationsAlive;
            card.messages = 0;
            allocationsLeft = n;
            const VellumResult result = call();
            const bool reached = allocationsLeft < 0;
            allocationsLeft = -1;
            SCOPED_TRACE(n);
            if (result != VELLUM_SUCCESS) {
                ASSERT_EQ(result, VELLUM_ERROR_OUT_OF_MEMORY) << card.message;
                ASSERT_EQ(card.messages, 1);
                ASSERT_EQ(allocationsAlive, before);
                ASSERT_EQ(card.gltf, nullptr);
                ASSERT_EQ(card.files(), 2u);
                ++failures;
            }
            vellumDestroyGltf(card.gltf);
            card.gltf = nullptr;
            ASSERT_EQ(allocationsAlive, before);
            if (exists(card.folder / "card.omm.glb")) {
                ASSERT_EQ(readFile(card.folder / "card.omm.glb"), whole);
                remove(card.folder / "card.omm.glb");
            }
            if (!reached)
                break;
        }
        EXPECT_GT(failures, 20);
    };
    const std::string input = card.path("card.glb");
    const std::string output = card.path("card.omm.glb");
    const std::string baked = card.path("whole.glb");
    failEach([&] { return vellumBakeGltf(input.c_str(), output.c_str(), &card.options, &card.more, nullptr); });
    failEach([&] { return vellumReadGltf(baked.c_str(), Card::onMessage, &card, &card.gltf); });
}

// A file in memory is what it is on a disk.
TEST(LibraryGltf, Memory)
{
    Card card;
    ASSERT_EQ(card.bake(), VELLUM_SUCCESS) << card.message;
    const Bytes input = readFile(card.folder / "card.glb");
    const Bytes expected = readFile(card.folder / "card.omm.glb");
    const VellumGltfBakeInfo onDisk = card.info;
    static Bytes output;
    output.clear();
    const VellumGltfOutputCallback append = [](void *, const void *bytes, size_t size) {
        const auto *first = static_cast<const uint8_t *>(bytes);
        output.insert(output.end(), first, first + size);
    };
    const std::string name = card.path("elsewhere.glb");
    ASSERT_EQ(
        vellumBakeGltfMemory(input.data(), input.size(), name.c_str(), &card.options, &card.more, append, &card.info),
        VELLUM_SUCCESS)
        << card.message;
    EXPECT_EQ(output, expected);
    EXPECT_EQ(std::memcmp(&card.info, &onDisk, sizeof onDisk), 0);

    output.clear();
    card.options.progress = [](void *, uint64_t done, uint64_t total) { return done == total ? 1 : 0; };
    EXPECT_EQ(
        vellumBakeGltfMemory(input.data(), input.size(), name.c_str(), &card.options, &card.more, append, &card.info),
        VELLUM_CANCELLED);
    EXPECT_TRUE(output.empty());
    card.options.progress = nullptr;

    ASSERT_EQ(vellumReadGltfMemory(expected.data(), expected.size(), "card", Card::onMessage, &card, &card.gltf),
              VELLUM_SUCCESS);
    EXPECT_EQ(card.primitive(0).indexCount, 2u);
    card.notes.clear();
    EXPECT_EQ(vellumCheckGltfMemory(expected.data(), expected.size(), "card", 10, Card::note, Card::onMessage, &card),
              VELLUM_SUCCESS);
    EXPECT_TRUE(card.notes.empty());

    vellumDestroyGltf(card.gltf);
    EXPECT_EQ(vellumReadGltfMemory(expected.data(), 100, "card", Card::onMessage, &card, &card.gltf),
              VELLUM_ERROR_FILE);
    EXPECT_EQ(card.message.rfind("card: ", 0), 0u) << card.message;
    EXPECT_EQ(vellumReadGltfMemory(nullptr, 1, "card", Card::onMessage, &card, &card.gltf),
              VELLUM_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(vellumReadGltfMemory(input.data(), 1, "", Card::onMessage, &card, &card.gltf),
              VELLUM_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(vellumBakeGltfMemory(input.data(), input.size(), "card", &card.options, nullptr, nullptr, nullptr),
              VELLUM_ERROR_INVALID_ARGUMENT);
}
