// SPDX-License-Identifier: Apache-2.0
// The changes that baking makes to a file, and the parts that it keeps.
#include "gltf/micromaps/document_writer.h"

#include <cstring>
#include <gtest/gtest.h>

#include "glb_file.h"
#include "gltf/file/gltf_error.h"
#include "gltf/file/json_tree.h"
#include "gltf/file/uri.h"
#include "gltf/micromaps/file_bake.h"
#include "gltf/micromaps/stored_micromaps.h"
#include "gltf/primitive.h"

using namespace vellum;
using namespace vellum::test;

namespace
{

uint32_t wordAt(const Bytes &bytes, size_t offset)
{
    uint32_t word = 0;
    std::memcpy(&word, bytes.data() + offset, sizeof word);
    return word;
}

struct Chunk {
    uint32_t type;
    Bytes bytes;
};

std::vector<Chunk> chunksOf(const Bytes &glb)
{
    EXPECT_EQ(wordAt(glb, 8), glb.size());
    std::vector<Chunk> chunks;
    for (size_t at = 12; at < glb.size();) {
        const size_t length = wordAt(glb, at);
        EXPECT_EQ(length % 4, 0u);
        const auto begin = glb.begin() + static_cast<ptrdiff_t>(at) + 8;
        chunks.push_back({wordAt(glb, at + 4), {begin, begin + static_cast<ptrdiff_t>(length)}});
        at += 8 + length;
    }
    return chunks;
}

std::string textOf(const Bytes &bytes)
{
    std::string text(bytes.begin(), bytes.end());
    return text.substr(0, text.find_last_not_of(std::string(" \0", 2)) + 1);
}

void replaceOnce(std::string &text, const std::string &from, const std::string &to)
{
    const size_t place = text.find(from);
    ASSERT_NE(place, std::string::npos) << from;
    ASSERT_EQ(text.find(from, place + 1), std::string::npos) << from;
    text.replace(place, from.size(), to);
}

// The URI of the last buffer.
std::string bufferOf(const Bytes &gltf)
{
    const std::string text(gltf.begin(), gltf.end());
    return JsonTree(text).root()["buffers"].children().back()["uri"].string().value_or("");
}

// Bakes files in a folder of their own.
struct Bench {
    TemporaryFolder folder;
    FileBakeOptions options;

    Bench() { options.bake.level = 3; }
    Bytes bake(const Bytes &file, const std::string &input = "in.glb", const std::string &output = "out.glb")
    {
        writeFile(folder / input, file);
        bakeFile(folder / input, folder / output, options);
        EXPECT_EQ(readFile(folder / input), file);
        return readFile(folder / output);
    }
    static Bytes text(const std::string &json) { return {json.begin(), json.end()}; }
    [[nodiscard]] StoredMicromaps micromaps(const std::string &name) const
    {
        return readMicromaps(Document(folder / name));
    }
};

const std::string kIndicesAndMaterial = R"("indices": 2, "material": 0)";

// The card with its buffer in a file of its own.
struct Split {
    std::string json;
    Bytes binary;
};

Split splitCard(const Replacements &replacements = {})
{
    const std::vector<Chunk> chunks = chunksOf(cardGlb(replacements));
    Split split{textOf(chunks[0].bytes), chunks[1].bytes};
    const JsonTree tree(split.json);
    split.binary.resize(static_cast<size_t>(*tree.root()["buffers"].children().at(0)["byteLength"].integer()));
    replaceOnce(split.json, R"("buffers": [{)", R"("buffers": [{"uri": "card%20data.bin", )");
    return split;
}

} // namespace

// Removes every inserted text again: the rest is the input.
TEST(DocumentWriter, EverythingElseIsByteForByteTheSame)
{
    const Replacements oddities = {
        {R"("asset": {"version": "2.0"},)",
         "\"asset\" : {\"version\": \"2.0\", \"extras\": [1.0e0, null, \"\\u00e4\"]},\n"
         "\t\"extensionsUsed\": [ \"ACME_other\" ],\r\n  \"ACME\":{}, "},
        {R"("nodes": [0]}],)", R"("nodes": [0]}], "extensions": { "ACME_other" : {"x": [ ]} },)"},
    };
    Bench bench;
    const Bytes input = cardGlb(oddities);
    const std::vector<Chunk> before = chunksOf(input);
    const std::vector<Chunk> after = chunksOf(bench.bake(input));
    ASSERT_EQ(after.size(), 2u);
    std::string text = textOf(after[0].bytes);
    replaceOnce(text,
                R"(,"EXT_mesh_opacity_micromap":{"micromaps":[{"data":4,"triangles":5,"usageCounts":[2],)"
                R"("usageLevels":[3],"usageFormats":[2]}],"extras":{"generator":"vellum"}})",
                "");
    replaceOnce(text, R"(,"EXT_mesh_opacity_micromap")", "");
    replaceOnce(text, R"(,"extensions":{"EXT_mesh_opacity_micromap":{"micromap":0,"micromapIndices":4}})", "");
    replaceOnce(text, R"(,{"bufferView":6,"componentType":5121,"count":2,"type":"SCALAR"})", "");
    // The chunk is aligned to 256 bytes for each of data and records.
    const size_t begin = (before[1].bytes.size() + 255) / 256 * 256;
    const std::string views = R"(,{"buffer":0,"byteOffset":)" + std::to_string(begin) +
                              R"(,"byteLength":32},{"buffer":0,"byteOffset":)" + std::to_string(begin + 256) +
                              R"(,"byteLength":16},{"buffer":0,"byteOffset":)" + std::to_string(begin + 272) +
                              R"(,"byteLength":2})";
    replaceOnce(text, views, "");
    const JsonTree tree(text);
    const JsonValue length = tree.root()["buffers"].children().at(0)["byteLength"];
    EXPECT_EQ(length.integer(), static_cast<int64_t>(begin + 274));
    std::string original = textOf(before[0].bytes);
    const JsonTree originalTree(original);
    const JsonValue originalLength = originalTree.root()["buffers"].children().at(0)["byteLength"];
    EXPECT_EQ(text.substr(0, length.begin()), original.substr(0, originalLength.begin()));
    EXPECT_EQ(text.substr(length.end()), original.substr(originalLength.end()));
    // The binary chunk begins with the old one.
    ASSERT_EQ(after[1].bytes.size(), begin + 276);
    EXPECT_TRUE(std::equal(before[1].bytes.begin(), before[1].bytes.end(), after[1].bytes.begin()));
    EXPECT_EQ(bench.micromaps("out.glb").primitives.size(), 1u);
}

TEST(DocumentWriter, NothingToBakeLeavesTheFileUnchanged)
{
    Bench bench;
    const Bytes input = cardGlb({{R"("alphaMode": "MASK", )", ""}});
    EXPECT_EQ(bench.bake(input), input);
}

TEST(DocumentWriter, OtherChunksStay)
{
    Bench bench;
    Bytes input = cardGlb();
    const Bytes extra = {8, 0, 0, 0, 'A', 'C', 'M', 'E', 1, 2, 3, 4, 5, 6, 7, 8};
    input.insert(input.end(), extra.begin(), extra.end());
    const auto size = static_cast<uint32_t>(input.size());
    std::memcpy(input.data() + 8, &size, 4);
    const std::vector<Chunk> chunks = chunksOf(bench.bake(input));
    ASSERT_EQ(chunks.size(), 3u);
    EXPECT_EQ(chunks[2].type, 0x454d4341u);
    EXPECT_EQ(chunks[2].bytes, (Bytes{1, 2, 3, 4, 5, 6, 7, 8}));
    EXPECT_EQ(bench.micromaps("out.glb").primitives.size(), 1u);
}

TEST(DocumentWriter, GltfGetsASeparateFile)
{
    Bench bench;
    const Split split = splitCard();
    writeFile(bench.folder / "card data.bin", split.binary);
    const Bytes output = bench.bake(Bench::text(split.json + "\n \n"), "in.gltf", "the tree.gltf");
    const std::string text(output.begin(), output.end());
    const std::string name = bufferOf(output);
    EXPECT_EQ(name.size(), std::string("the%20tree.omm-0123456789abcdef.bin").size());
    EXPECT_TRUE(name.starts_with("the%20tree.omm-"));
    EXPECT_TRUE(text.ends_with("\n \n"));
    EXPECT_TRUE(std::filesystem::exists(bench.folder / percentDecoded(name)));
    EXPECT_EQ(bench.micromaps("the tree.gltf").primitives.size(), 1u);
    // The name depends on the content of the micromaps.
    const Bytes old = readFile(bench.folder / percentDecoded(name));
    bench.options.bake.level = 2;
    const Bytes other = bench.bake(Bench::text(split.json), "in.gltf", "the tree.omm.gltf");
    EXPECT_TRUE(bufferOf(other).starts_with("the%20tree.omm-"));
    EXPECT_NE(bufferOf(other), name);
    EXPECT_EQ(readFile(bench.folder / percentDecoded(name)), old);
    bench.options.bake.level = 3;
    const Bytes before = bench.bake(Bench::text(split.json), "in.gltf", "the tree.gltf");
    EXPECT_EQ(bufferOf(before), name);
    // Nobody else's file is written over.
    writeFile(bench.folder / percentDecoded(name), {'x'});
    EXPECT_THROW(bench.bake(Bench::text(split.json), "in.gltf", "the tree.gltf"), GltfError);
    EXPECT_EQ(readFile(bench.folder / percentDecoded(name)), Bytes{'x'});
    EXPECT_EQ(readFile(bench.folder / "the tree.gltf"), before);
}

TEST(DocumentWriter, TheInputsOwnFilesAreNotWritten)
{
    Bench bench;
    Split split = splitCard();
    replaceOnce(split.json, "card%20data.bin", "./tree.omm.bin");
    writeFile(bench.folder / "tree.omm.bin", split.binary);
    bench.bake(Bench::text(split.json), "in.gltf", "tree.gltf");
    EXPECT_EQ(readFile(bench.folder / "tree.omm.bin"), split.binary);
    EXPECT_EQ(bench.micromaps("tree.gltf").primitives.size(), 1u);
    // Data of the input is not overwritten by the output.
    replaceOnce(split.json, "./tree.omm.bin", "data.gltf");
    writeFile(bench.folder / "data.gltf", split.binary);
    std::filesystem::create_symlink("data.gltf", bench.folder / "alias.gltf");
    for (const char *output : {"data.gltf", "alias.gltf"})
        EXPECT_THROW(bench.bake(Bench::text(split.json), "in.gltf", output), GltfError);
    EXPECT_EQ(readFile(bench.folder / "data.gltf"), split.binary);
}

TEST(DocumentWriter, ANameThatIsNotUtf8IsEscaped)
{
    Bench bench;
    const Split split = splitCard();
    writeFile(bench.folder / "card data.bin", split.binary);
    const std::string name = "caf\xe9 \xc3\xa9.gltf";
    const std::string buffer = bufferOf(bench.bake(Bench::text(split.json), "in.gltf", name));
    EXPECT_TRUE(buffer.starts_with("caf%E9%20\xc3\xa9.omm-")) << buffer;
    EXPECT_EQ(bench.micromaps(name).primitives.size(), 1u);
}

TEST(DocumentWriter, RejectsExtensionsThatAreNotLists)
{
    for (const char *list : {"extensionsUsed", "extensionsRequired"})
        for (const char *value : {"{}", "{\"a\": 1}", "\"ab\"", "5", "null"}) {
            Bench bench;
            const std::string member = std::string("\"") + list + "\": " + value + ",\n\"scene\": 0";
            EXPECT_THROW(bench.bake(cardGlb({{"\"scene\": 0", member}})), GltfError) << member;
            EXPECT_FALSE(std::filesystem::exists(bench.folder / "out.glb")) << member;
        }
}

TEST(DocumentWriter, EmbedsOnRequest)
{
    Bench bench;
    bench.options.embed = true;
    const Split split = splitCard();
    writeFile(bench.folder / "card data.bin", split.binary);
    bench.bake(Bench::text(split.json), "in.gltf", "out.gltf");
    for (const auto &entry : std::filesystem::directory_iterator(bench.folder.path()))
        EXPECT_EQ(entry.path().string().find(".omm"), std::string::npos);
    bench.options.embed = false;
    bench.bake(Bench::text(split.json), "in.gltf", "other.gltf");
    const StoredMicromaps embedded = bench.micromaps("out.gltf");
    const StoredMicromaps beside = bench.micromaps("other.gltf");
    EXPECT_EQ(embedded.micromaps.at(0).data, beside.micromaps.at(0).data);
    EXPECT_EQ(embedded.primitives.at({0, 0}).indices, beside.primitives.at({0, 0}).indices);
}

TEST(DocumentWriter, AGlbWhoseFirstBufferIsElsewhereGetsADataUri)
{
    Bench bench;
    const Split split = splitCard();
    writeFile(bench.folder / "card data.bin", split.binary);
    Bytes input = packGlb(split.json, {});
    input.resize(input.size() - 8); // no binary chunk
    const auto size = static_cast<uint32_t>(input.size());
    std::memcpy(input.data() + 8, &size, 4);
    const std::vector<Chunk> chunks = chunksOf(bench.bake(input));
    ASSERT_EQ(chunks.size(), 1u);
    EXPECT_NE(textOf(chunks[0].bytes).find(R"({"uri":"data:application/octet-stream;base64,)"), std::string::npos);
    EXPECT_EQ(bench.micromaps("out.glb").primitives.size(), 1u);
}

TEST(DocumentWriter, StripsAndFansBecomeLists)
{
    for (const char *mode : {"5", "6"}) {
        Bench bench;
        const Bytes input = cardGlb({{kIndicesAndMaterial, R"("mode": )" + std::string(mode) + R"(, "material": 0)"}});
        bench.bake(input);
        const Document before(bench.folder / "in.glb");
        const Document after(bench.folder / "out.glb");
        EXPECT_EQ(readPrimitive(after, {0, 0}, Positions::Read).indices,
                  readPrimitive(before, {0, 0}, Positions::Read).indices);
        EXPECT_EQ(after.root()["meshes"].children()[0]["primitives"].children()[0]["mode"].integer(), 4);
        EXPECT_EQ(readMicromaps(after).primitives.at({0, 0}).indices.size(), 2u);
    }
}

TEST(DocumentWriter, MicromapsAreReplaced)
{
    Bench bench;
    const Bytes once = bench.bake(cardGlb());
    bench.options.bake.level = 2;
    bench.bake(once, "once.glb", "twice.glb");
    const StoredMicromaps twice = bench.micromaps("twice.glb");
    ASSERT_EQ(twice.micromaps.size(), 1u);
    EXPECT_EQ(twice.micromaps[0].usage, (std::vector<MicromapUsage>{{2, 2, Format::FourState}}));
    // Micromaps are removed if nothing is baked.
    bench.options.excludedMaterials = {"l*f"};
    const std::string text = textOf(chunksOf(bench.bake(once, "once.glb", "none.glb"))[0].bytes);
    EXPECT_EQ(text.find("opacity_micromap"), std::string::npos);
    EXPECT_EQ(text.find("\"extensions"), std::string::npos); // none is empty
}

TEST(DocumentWriter, TheEarlierSpellingIsReplaced)
{
    Bench bench;
    Bytes once = bench.bake(cardGlb());
    for (size_t i = 0; i + 3 < once.size(); ++i)
        if (std::memcmp(&once[i], "EXT_mesh", 8) == 0)
            std::memcpy(&once[i], "KHR", 3);
    writeFile(bench.folder / "khr.glb", once);
    EXPECT_EQ(bench.micromaps("khr.glb").extension, "KHR_mesh_opacity_micromap");
    const std::string text = textOf(chunksOf(bench.bake(once, "khr.glb", "ext.glb"))[0].bytes);
    EXPECT_EQ(text.find("KHR_mesh"), std::string::npos);
    EXPECT_EQ(bench.micromaps("ext.glb").extension, "EXT_mesh_opacity_micromap");
    EXPECT_EQ(bench.micromaps("ext.glb").primitives.size(), 1u);
}

TEST(DocumentWriter, TheOutputIsTheSameForAnyNumberOfThreads)
{
    Bench bench;
    bench.options.bake.level = 6;
    bench.options.bake.threads = 1;
    const Bytes one = bench.bake(cardGlb());
    bench.options.bake.threads = 5;
    EXPECT_EQ(bench.bake(cardGlb()), one);
}

// The four highest values of each type are special indices.
TEST(DocumentWriter, MicromapIndicesHaveTheSmallestType)
{
    for (const auto &[triangles, type] : {std::pair{252u, 5121}, {253u, 5123}, {0xfffcu, 5123}, {0xfffdu, 5125}}) {
        Bench bench;
        writeFile(bench.folder / "in.glb", cardGlb());
        const Document document(bench.folder / "in.glb");
        StoredMicromap micromap;
        for (uint32_t i = 0; i < triangles; ++i)
            micromap.triangles.push_back({i, 0, Format::FourState});
        micromap.data.resize(triangles, static_cast<uint8_t>(State::UnknownOpaque));
        micromap.usage = {{triangles, 0, Format::FourState}};
        const auto last = static_cast<int32_t>(triangles - 1);
        for (const std::vector<int32_t> &indices : {std::vector{last, -4}, {-1, -2}, {0, -3}}) {
            DocumentBake bake;
            bake.micromaps = {micromap};
            bake.primitives.push_back({{0, 0}, "", "leaf", {0, indices}, {}, 0, ""});
            Bytes file;
            const RewrittenFile rewritten = withMicromaps(document, bake, "");
            for (const auto &piece : rewritten.file.pieces())
                file.insert(file.end(), piece.begin(), piece.end());
            writeFile(bench.folder / "out.glb", file);
            const Document written(bench.folder / "out.glb");
            EXPECT_EQ(written.model().accessors.back().componentType, type);
            EXPECT_EQ(readMicromaps(written).primitives.at({0, 0}).indices, indices) << triangles;
            EXPECT_TRUE(isOwnFile(written.root()));
        }
    }
}

TEST(DocumentWriter, RejectsAmbiguousJson)
{
    Bench bench;
    EXPECT_THROW(
        bench.bake(cardGlb({{kIndicesAndMaterial, kIndicesAndMaterial + R"(, "extensions": {}, "extensions": {})"}})),
        GltfError);
    EXPECT_THROW(bench.bake(cardGlb({{kIndicesAndMaterial, kIndicesAndMaterial + R"(, "extensions": 3)"}})), GltfError);
    EXPECT_FALSE(std::filesystem::exists(bench.folder / "out.glb"));
}
