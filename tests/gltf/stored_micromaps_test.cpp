// SPDX-License-Identifier: Apache-2.0
// Files that break one rule of EXT_mesh_opacity_micromap each, and those that only look as if they did.
#include "gltf/micromaps/stored_micromaps.h"

#include <gtest/gtest.h>

#include "glb_file.h"

using namespace vellum;
using namespace vellum::test;

namespace
{

// A file with one micromap, and the parts of it that tests change. Its buffer has the records, then the data, the
// indices of 2 triangles, and the positions of 6 vertices.
struct MicromapFile {
    std::vector<MicromapTriangle> records = {{0, 2, Format::FourState}, {4, 1, Format::TwoState}};
    Bytes data = {0x1b, 0x2c, 0x3d, 0x4e, 0x05};
    Bytes indices = {0, 0, 1, 0}; // 16-bit
    std::string componentType = "5123";
    std::string count = "2";
    std::string accessor;  // more members of the accessor of indices
    std::string triangles; // more members of the records' buffer view
    std::string usage = R"("usageCounts": [1, 1], "usageLevels": [1, 2], "usageFormats": [1, 2])";
    std::string micromap = R"("data": 1, "triangles": 0)";
    std::string primitive = R"("micromap": 0, "micromapIndices": 1)";
    std::string mode = "4";
    std::string extension = "EXT_mesh_opacity_micromap";
    std::string root; // instead of the whole extension of the root
    std::string used; // instead of the extension's name
    size_t recordStride = 8;

    [[nodiscard]] Bytes file() const;
    [[nodiscard]] std::vector<MicromapFinding> findings(size_t most = 100) const;
    [[nodiscard]] StoredMicromaps read() const;
    // The first finding; readMicromaps must say the same.
    [[nodiscard]] std::string finding() const;
};

void appendInteger(Bytes &bytes, uint64_t value, size_t count)
{
    for (size_t i = 0; i < count; ++i)
        bytes.push_back(static_cast<uint8_t>(value >> (8 * i)));
}

Bytes MicromapFile::file() const
{
    Bytes binary;
    for (const MicromapTriangle &record : records) {
        appendInteger(binary, record.dataOffset, 4);
        appendInteger(binary, record.subdivisionLevel, 2);
        appendInteger(binary, static_cast<uint16_t>(record.format), 2);
        appendInteger(binary, 0, recordStride - 8);
    }
    std::string views;
    const auto view = [&](size_t offset, size_t bytes, const std::string &more) {
        views += std::string(views.empty() ? "" : ",") + R"({"buffer": 0, "byteOffset": )" + std::to_string(offset) +
                 R"(, "byteLength": )" + std::to_string(bytes) + more + "}";
    };
    view(0, binary.size(), triangles);
    const auto part = [&](const Bytes &bytes) {
        binary.resize((binary.size() + 3) / 4 * 4);
        view(binary.size(), bytes.size(), "");
        binary.insert(binary.end(), bytes.begin(), bytes.end());
    };
    part(data);
    part(indices);
    part(Bytes(72));
    const std::string micromaps = root.empty() ? R"({"micromaps": [{)" + micromap + ", " + usage + "}]}" : root;
    return packGlb(R"({"asset": {"version": "2.0"}, "extensionsUsed": [")" + (used.empty() ? extension : used) +
                       R"("], "extensions": {")" + extension + R"(": )" + micromaps + R"(},
"buffers": [{"byteLength": )" +
                       std::to_string(binary.size()) + R"(}], "bufferViews": [)" + views + R"(],
"accessors": [{"bufferView": 3, "componentType": 5126, "count": 6, "type": "VEC3"},
  {"bufferView": 2, "componentType": )" +
                       componentType + R"(, "count": )" + count + R"(, "type": "SCALAR")" + accessor +
                       R"(}],
"meshes": [{"name": "leaves", "primitives": [{"attributes": {"POSITION": 0}, "mode": )" +
                       mode + R"(, "extensions": {")" + extension + R"(": {)" + primitive + R"(}}}]}]})",
                   binary);
}

std::vector<MicromapFinding> MicromapFile::findings(size_t most) const
{
    const TemporaryFolder folder;
    writeFile(folder / "test.glb", file());
    return checkMicromaps(Document(folder / "test.glb"), most).findings;
}

StoredMicromaps MicromapFile::read() const
{
    const TemporaryFolder folder;
    writeFile(folder / "test.glb", file());
    return readMicromaps(Document(folder / "test.glb"));
}

std::string MicromapFile::finding() const
{
    const std::vector<MicromapFinding> found = findings();
    const std::string first = found.empty() ? "none" : found[0].place + ": " + found[0].message;
    std::string thrown = "none";
    try {
        (void)read();
    } catch (const GltfError &error) {
        thrown = error.what();
        thrown = thrown.substr(thrown.find("test.glb: ") + 10);
    }
    EXPECT_EQ(thrown, first);
    return first;
}

} // namespace

TEST(StoredMicromaps, ReadsWhatTheFileHas)
{
    const StoredMicromaps stored = MicromapFile().read();
    EXPECT_EQ(stored.extension, "EXT_mesh_opacity_micromap");
    ASSERT_EQ(stored.micromaps.size(), 1u);
    EXPECT_EQ(stored.micromaps[0].data, MicromapFile().data);
    EXPECT_EQ(stored.micromaps[0].usage,
              (std::vector<MicromapUsage>{{1, 1, Format::TwoState}, {1, 2, Format::FourState}}));
    ASSERT_EQ(stored.micromaps[0].triangles.size(), 2u);
    EXPECT_EQ(stored.micromaps[0].triangles[1].dataOffset, 4u);
    ASSERT_EQ(stored.primitives.size(), 1u);
    const PrimitiveMicromap &primitive = stored.primitives.at({0, 0});
    EXPECT_EQ(primitive.indices, (std::vector<int32_t>{0, 1}));
    EXPECT_EQ(primitive.baseTriangle, 0u);
    EXPECT_FALSE(stored.of({0, 1}));
}

TEST(StoredMicromaps, KnowsTheEarlierSpelling)
{
    MicromapFile sample;
    sample.extension = "KHR_mesh_opacity_micromap";
    EXPECT_EQ(sample.read().extension, sample.extension);
    EXPECT_EQ(sample.read().primitives.size(), 1u);
}

TEST(StoredMicromaps, HasNothingWhereThereIsNothing)
{
    const TemporaryFolder folder;
    writeFile(folder / "test.glb", cardGlb());
    const StoredMicromaps stored = readMicromaps(Document(folder / "test.glb"));
    EXPECT_EQ(stored.extension, "");
    EXPECT_TRUE(stored.micromaps.empty());
    EXPECT_TRUE(stored.primitives.empty());
}

TEST(StoredMicromaps, OneOfAPrimitiveHasOnlyWhatItUses)
{
    MicromapFile sample;
    sample.primitive = R"("micromap": 0, "micromapIndices": 1, "micromapBaseTriangle": 1)";
    sample.indices = {0, 0, 0xfe, 0xff}; // the second is 0xfffe: opaque
    const auto micromap = sample.read().of({0, 0});
    ASSERT_TRUE(micromap);
    EXPECT_EQ(micromap->validate(), std::nullopt);
    EXPECT_EQ(micromap->indices, (std::vector<int32_t>{0, -2}));
    ASSERT_EQ(micromap->triangles.size(), 1u);
    EXPECT_EQ(micromap->triangles[0].dataOffset, 0u);
    EXPECT_EQ(micromap->triangles[0].format, Format::TwoState);
    EXPECT_EQ(micromap->data, Bytes{0x05});
    EXPECT_EQ(micromap->baseTriangle, 0u);
}

TEST(StoredMicromaps, ReadsEveryTypeOfIndexWithItsSpecialIndices)
{
    const std::pair<const char *, Bytes> types[] = {{"5121", {1, 0xfc}},
                                                    {"5122", {1, 0, 0xfc, 0xff}},
                                                    {"5123", {1, 0, 0xfc, 0xff}},
                                                    {"5124", {1, 0, 0, 0, 0xfc, 0xff, 0xff, 0xff}},
                                                    {"5125", {1, 0, 0, 0, 0xfc, 0xff, 0xff, 0xff}}};
    for (const auto &[type, indices] : types) {
        MicromapFile sample;
        sample.componentType = type;
        sample.indices = indices;
        EXPECT_EQ(sample.read().primitives.at({0, 0}).indices, (std::vector<int32_t>{1, -4})) << type;
    }
}

TEST(StoredMicromaps, MissingIndicesMeanTheTriangleNumber)
{
    MicromapFile sample;
    sample.primitive = R"("micromap": 0)";
    EXPECT_EQ(sample.read().primitives.at({0, 0}).indices, (std::vector<int32_t>{0, 1}));
    sample.primitive = R"("micromap": 0, "micromapBaseTriangle": 1)";
    EXPECT_EQ(sample.finding(), "mesh 0 \"leaves\" primitive 0: its 2 triangles from base triangle 1 on are outside "
                                "of the micromap's 2 triangles");
}

TEST(StoredMicromaps, RecordsMayHaveAStride)
{
    MicromapFile sample;
    sample.recordStride = 12;
    sample.triangles = R"(, "byteStride": 12)";
    EXPECT_EQ(sample.read().micromaps[0].triangles[1].dataOffset, 4u);
    sample.triangles = R"(, "byteStride": 4)";
    EXPECT_EQ(sample.finding(),
              "micromaps[0]: \"triangles\": a byteStride of 4 is not a multiple of 4 that is at least 8");
    sample.recordStride = 10;
    sample.triangles = "";
    EXPECT_EQ(sample.finding(), "micromaps[0]: \"triangles\": 20 bytes are no whole number of records of 8 bytes");
}

TEST(StoredMicromaps, UsageMayRepeatAndMustAddUp)
{
    MicromapFile sample;
    sample.records = {{0, 1, Format::FourState}, {1, 1, Format::FourState}, {2, 2, Format::TwoState}};
    sample.indices = {2, 0, 0, 0};
    sample.usage = R"("usageCounts": [1, 1, 1], "usageLevels": [1, 2, 1], "usageFormats": [2, 1, 2])";
    EXPECT_EQ(sample.finding(), "none");
    EXPECT_EQ(sample.read().micromaps[0].usage.size(), 3u);
    sample.usage = R"("usageCounts": [1, 1], "usageLevels": [1, 2], "usageFormats": [2, 1])";
    EXPECT_EQ(sample.finding(), "micromaps[0]: usageCounts add up to 2 triangles, there are 3");
    sample.usage = R"("usageCounts": [1, 2], "usageLevels": [1, 2], "usageFormats": [2, 1])";
    EXPECT_EQ(sample.finding(), "micromaps[0]: usageCounts has 2 triangles of level 2, format 1, there are 1");
}

TEST(StoredMicromaps, UsageIsChecked)
{
    const std::pair<const char *, const char *> cases[] = {
        {R"("usageCounts": [2], "usageLevels": [1, 2], "usageFormats": [1, 2])",
         "usageCounts has 1 elements, usageLevels 2, usageFormats 2"},
        {R"("usageCounts": [0, 2], "usageLevels": [1, 2], "usageFormats": [1, 2])",
         "usageCounts[0] is 0, not 1 or more"},
        {R"("usageCounts": [4294967297, 1], "usageLevels": [1, 2], "usageFormats": [1, 2])",
         "usageCounts[0] is 4294967297, not 1 or more"},
        {R"("usageCounts": [1, 1], "usageLevels": [1, 13], "usageFormats": [1, 2])",
         "usageLevels[1] is 13, not 0 to 12"},
        {R"("usageCounts": [1, 1], "usageLevels": [-1, 2], "usageFormats": [1, 2])",
         "usageLevels[0] is -1, not 0 to 12"},
        {R"("usageCounts": [1, 1], "usageLevels": [1, 2], "usageFormats": [1, 3])",
         "usageFormats[1] is 3, neither 1 (2-state) nor 2 (4-state)"},
        {R"("usageCounts": [1, 1.5], "usageLevels": [1, 2], "usageFormats": [1, 2])",
         "\"usageCounts\" has an element that is not an integer"},
        {R"("usageCounts": 2, "usageLevels": [1, 2], "usageFormats": [1, 2])",
         "\"usageCounts\" is not an array with elements"},
        {R"("usageCounts": [], "usageLevels": [], "usageFormats": [])",
         "\"usageCounts\" is not an array with elements"},
        {R"("usageLevels": [1, 2], "usageFormats": [1, 2])", "\"usageCounts\" is missing"}};
    for (const auto &[usage, message] : cases) {
        MicromapFile sample;
        sample.usage = usage;
        EXPECT_EQ(sample.finding(), std::string("micromaps[0]: ") + message);
    }
}

TEST(StoredMicromaps, RecordsAreChecked)
{
    const std::pair<MicromapTriangle, const char *> cases[] = {
        {{0, 2, static_cast<Format>(3)}, "format 3 is neither 1 (2-state) nor 2 (4-state)"},
        {{0, 2, static_cast<Format>(0)}, "format 0 is neither 1 (2-state) nor 2 (4-state)"},
        {{0, 13, Format::FourState}, "subdivision level 13 is above 12"},
        {{2, 2, Format::FourState}, "its data ends at byte 6 of 5"},
        {{0xfffffffe, 2, Format::FourState}, "its data ends at byte 4294967298 of 5"}};
    for (const auto &[record, message] : cases) {
        MicromapFile sample;
        sample.records[0] = record;
        EXPECT_EQ(sample.finding(), std::string("micromaps[0]: triangle 0: ") + message);
    }
}

TEST(StoredMicromaps, RegionsOfDataMustNotOverlap)
{
    MicromapFile sample;
    sample.records[1].dataOffset = 3;
    EXPECT_EQ(sample.finding(), "micromaps[0]: triangle 1: its data overlaps that of triangle 0");
    sample.records = {{2, 1, Format::TwoState}, {0, 2, Format::FourState}};
    sample.indices = {0, 0, 0, 0};
    EXPECT_EQ(sample.finding(), "micromaps[0]: triangle 0: its data overlaps that of triangle 1");
}

TEST(StoredMicromaps, BufferViewsAreChecked)
{
    MicromapFile sample;
    sample.micromap = R"("data": 9, "triangles": 0)";
    EXPECT_EQ(sample.finding(), "micromaps[0]: \"data\": buffer view 9 does not exist");
    sample.micromap = R"("data": 4294967297, "triangles": 0)";
    EXPECT_EQ(sample.finding(), "micromaps[0]: \"data\": buffer view 4294967297 does not exist");
    sample.micromap = R"("data": -1, "triangles": 0)";
    EXPECT_EQ(sample.finding(), "micromaps[0]: \"data\" is not an integer of at least 0");
    sample.micromap = R"("data": 1)";
    EXPECT_EQ(sample.finding(), "micromaps[0]: \"triangles\" is missing");
    sample.micromap = R"("data": 1, "triangles": "0")";
    EXPECT_EQ(sample.finding(), "micromaps[0]: \"triangles\" is not an integer of at least 0");
}

TEST(StoredMicromaps, TheRootIsChecked)
{
    MicromapFile sample;
    sample.root = R"({"micromaps": []})";
    EXPECT_EQ(sample.finding(), "extensions: EXT_mesh_opacity_micromap: \"micromaps\" is not an array with elements");
    sample.root = "7";
    EXPECT_EQ(sample.finding(), "extensions: EXT_mesh_opacity_micromap: \"micromaps\" is not an array with elements");
    sample.root = R"({"micromaps": [5]})";
    EXPECT_EQ(sample.finding(), "micromaps[0]: it is not an object");
    sample.root = "";
    sample.used = "EXT_texture_webp";
    EXPECT_EQ(sample.finding(), "extensions: \"extensionsUsed\" does not name EXT_mesh_opacity_micromap");
}

TEST(StoredMicromaps, PrimitivesAreChecked)
{
    const std::pair<const char *, const char *> cases[] = {
        {R"("micromap": 1)", "micromap 1 does not exist"},
        {R"("micromapIndices": 1)", "\"micromap\" is missing"},
        {R"("micromap": true)", "\"micromap\" is not an integer of at least 0"},
        {R"("micromap": 0, "micromapIndices": 9)", "micromapIndices: accessor 9 does not exist"},
        {R"("micromap": 0, "micromapIndices": 0)",
         "micromapIndices: accessor 0 is not SCALAR of type 5121, 5122, 5123, 5124 or 5125"},
        {R"("micromap": 0, "micromapIndices": 1, "micromapBaseTriangle": -1)",
         "\"micromapBaseTriangle\" is not an integer of at least 0"},
        {R"("micromap": 0, "micromapIndices": 1, "micromapBaseTriangle": 4294967296)",
         "micromapBaseTriangle 4294967296 is too large"},
        {R"("micromap": 0, "micromapIndices": 1, "micromapBaseTriangle": 4294967295)",
         "triangle 0: index 0 + base triangle 4294967295 is outside of the micromap's 2 triangles"}};
    for (const auto &[primitive, message] : cases) {
        MicromapFile sample;
        sample.primitive = primitive;
        EXPECT_EQ(sample.finding(), std::string("mesh 0 \"leaves\" primitive 0: ") + message);
    }
    MicromapFile strip;
    strip.mode = "5";
    EXPECT_EQ(strip.finding(), "mesh 0 \"leaves\" primitive 0: its mode is 5, not 4 (TRIANGLES)");
}

TEST(StoredMicromaps, IndicesAreChecked)
{
    const std::string where = "mesh 0 \"leaves\" primitive 0: ";
    MicromapFile sample;
    sample.indices = {0, 0, 2, 0};
    EXPECT_EQ(sample.finding(),
              where + "triangle 1: index 2 + base triangle 0 is outside of the micromap's 2 triangles");
    sample = MicromapFile();
    sample.indices = {0, 0, 0, 0, 0, 0};
    sample.count = "3";
    EXPECT_EQ(sample.finding(), where + "micromapIndices: accessor 1 has 3 elements for 2 triangles");
    sample = MicromapFile();
    sample.componentType = "5122";
    sample.indices = {0, 0, 0xfb, 0xff}; // -5
    EXPECT_EQ(sample.finding(),
              where + "micromapIndices: accessor 1: element 1 is -5, neither an index nor a special index");
    sample.componentType = "5126";
    EXPECT_EQ(sample.finding(),
              where + "micromapIndices: accessor 1 is not SCALAR of type 5121, 5122, 5123, 5124 or 5125");
    sample = MicromapFile();
    sample.accessor = R"(, "byteOffset": 2)";
    EXPECT_EQ(sample.finding(), where + "micromapIndices: accessor 1 reaches outside of its buffer view");
    sample.indices = {0, 0, 0, 1, 0};
    sample.accessor = R"(, "byteOffset": 1)";
    EXPECT_EQ(sample.finding(), where + "micromapIndices: accessor 1 is not aligned to its component type");
}

TEST(StoredMicromaps, IndicesCanBeSparse)
{
    MicromapFile sample;
    ASSERT_EQ(sample.read().primitives.begin()->second.indices, (std::vector<int32_t>{0, 1}));
    // Replaces element 1, which the third byte of the indices names, by the first index.
    sample.accessor = R"(, "sparse": {"count": 1, "indices": {"bufferView": 2, "byteOffset": 2, "componentType": 5121},
                         "values": {"bufferView": 2}})";
    EXPECT_EQ(sample.read().primitives.begin()->second.indices, (std::vector<int32_t>{0, 0}));
    sample.accessor = R"(, "sparse": {"count": 3, "indices": {"bufferView": 2, "componentType": 5121},
                         "values": {"bufferView": 2}})";
    EXPECT_EQ(sample.finding(),
              "mesh 0 \"leaves\" primitive 0: micromapIndices: accessor 1 (sparse) replaces 3 of 2 elements");
}

TEST(StoredMicromaps, EveryFindingIsListed)
{
    MicromapFile sample;
    sample.usage = R"("usageCounts": [1, 5], "usageLevels": [1, 2], "usageFormats": [1, 2])";
    sample.mode = "6";
    EXPECT_EQ(sample.findings().size(), 3u);
    EXPECT_EQ(sample.findings(2).size(), 2u);
    EXPECT_EQ(sample.findings(1).size(), 1u);
}

// Many elements may name the same bytes: what is copied of them is bounded.
TEST(StoredMicromaps, AFewBytesDoNotBecomeMany)
{
    MicromapFile sample;
    sample.data.resize(size_t{1} << 20);
    sample.root = R"({"micromaps": [)";
    for (int i = 0; i < 100; ++i)
        sample.root += std::string(i == 0 ? "{" : ",{") + sample.micromap + ", " + sample.usage + "}";
    sample.root += "]}";
    EXPECT_EQ(sample.finding(), "micromaps[65]: the micromaps take several times the bytes of the file's buffers");
}
