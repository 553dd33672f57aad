// SPDX-License-Identifier: Apache-2.0
// Files with one error each. Every error is reported in one line that names the file and the location in it, and no
// file makes the reader take much memory.
#include <array>
#include <csignal>
#include <cstring>
#include <functional>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "compressed.h"
#include "gltf/data/image.h"
#include "gltf/document.h"
#include "read_everything.h"

using namespace vellum;
using namespace vellum::test;

namespace
{

#if defined(__SANITIZE_ADDRESS__) // it keeps what is freed for a while
constexpr rlim_t kMostMemory = rlim_t{4} << 30;
constexpr rlim_t kMostSeconds = 60;
#else
constexpr rlim_t kMostMemory = rlim_t{1} << 30;
constexpr rlim_t kMostSeconds = 30;
#endif

// The first error of reading everything in `path`, by a process that has these limits.
std::string errorWithinLimits(const std::filesystem::path &path)
{
    std::array<int, 2> ends{};
    if (pipe(ends.data()) != 0)
        throw std::runtime_error("no pipe");
    const pid_t child = fork();
    if (child == 0) {
        const rlimit time{kMostSeconds, kMostSeconds};
#if !defined(__SANITIZE_ADDRESS__) // it reserves terabytes
        const rlimit memory{kMostMemory, kMostMemory};
        setrlimit(RLIMIT_AS, &memory);
#endif
        setrlimit(RLIMIT_CPU, &time);
        std::string text;
        try {
            const Reading reading = readEverything(path);
            const bool unsupported = reading.error.empty() || reading.error.ends_with("there are no triangles in it");
            text = unsupported && !reading.unsupported.empty() ? reading.unsupported : reading.error;
        } catch (const std::exception &error) {
            text = std::string("exception: ") + error.what();
        }
        if (text.empty())
            text = "none";
        static_cast<void>(!write(ends[1], text.data(), text.size()));
        _exit(0);
    }
    close(ends[1]);
    std::string text;
    std::array<char, 4096> part{};
    for (ssize_t size = 0; (size = read(ends[0], part.data(), part.size())) > 0;)
        text.append(part.data(), static_cast<size_t>(size));
    close(ends[0]);
    int status = 0;
    rusage used{};
    wait4(child, &status, 0, &used);
    if (static_cast<rlim_t>(used.ru_maxrss) * 1024 > kMostMemory)
        return "used " + std::to_string(used.ru_maxrss) + " KiB";
    return WIFEXITED(status) ? text : "killed by signal " + std::to_string(WTERMSIG(status));
}

// The error of reading a file of these bytes, without the path that its line begins with; "none" if there is none.
std::string errorOf(const Bytes &bytes, const std::string &name = "test.glb")
{
    const TemporaryFolder folder;
    writeFile(folder / name, bytes);
    const std::string error = errorWithinLimits(folder / name);
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
    const std::string prefix = (folder / name).string() + ": ";
    return error.starts_with(prefix) ? error.substr(prefix.size()) : "without the path: " + error;
}

std::string errorOf(const Replacements &replacements)
{
    return errorOf(cardGlb(replacements));
}

struct Wrong {
    Replacements replacements;
    std::string error; // the beginning of the line
};

void expectErrors(const std::vector<Wrong> &files)
{
    EXPECT_GE(files.size(), 10u);
    for (const Wrong &wrong : files)
        EXPECT_EQ(errorOf(wrong.replacements).substr(0, wrong.error.size()), wrong.error);
}

void expectErrorsOfJson(const std::vector<std::pair<std::string, std::string>> &texts)
{
    EXPECT_GE(texts.size(), 10u);
    for (const auto &[text, error] : texts)
        EXPECT_EQ(errorOf(Bytes(text.begin(), text.end()), "test.gltf").substr(0, error.size()), error) << text;
}

std::string repeated(const std::string &text, size_t count)
{
    std::string result;
    result.reserve(text.size() * count);
    for (size_t i = 0; i < count; ++i)
        result += text;
    return result;
}

// A .gltf with this in it.
std::string gltf(const std::string &members)
{
    return R"({"asset": {"version": "2.0"}, )" + members + "}";
}

std::string bufferUri(const std::string &uri)
{
    return gltf(R"("buffers": [{"byteLength": 4, "uri": ")" + uri + "\"}]");
}

std::string imageUri(const std::string &uri)
{
    return gltf(R"("images": [{"uri": ")" + uri + "\"}]");
}

const std::string kLeafImage = R"("image/png", "bufferView": 3)";

// The card with this as its image.
std::string errorOfImage(const Bytes &image)
{
    Bytes file = cardGlb();
    const std::string text(file.begin(), file.end());
    const Bytes png = discPng();
    const std::string length = "\"byteLength\": " + std::to_string(png.size()) + "}]";
    const size_t jsonBytes = file[12] + 256u * file[13];
    std::string json = text.substr(20, jsonBytes);
    Bytes binary(file.begin() + 28 + static_cast<ptrdiff_t>(jsonBytes),
                 file.begin() + 28 + static_cast<ptrdiff_t>(jsonBytes) + 92);
    binary.insert(binary.end(), image.begin(), image.end());
    json.replace(json.find(length), length.size(), "\"byteLength\": " + std::to_string(image.size()) + "}]");
    const std::string total = "\"byteLength\": " + std::to_string(92 + png.size()) + "}]";
    json.replace(json.find(total), total.size(), "\"byteLength\": " + std::to_string(92 + image.size()) + "}]");
    return errorOf(packGlb(json, binary));
}

uint32_t crc(const Bytes &bytes, size_t begin, size_t end)
{
    uint32_t value = 0xffffffff;
    for (size_t i = begin; i < end; ++i) {
        value ^= bytes[i];
        for (int bit = 0; bit < 8; ++bit)
            value = value >> 1 ^ (value & 1 ? 0xedb88320 : 0);
    }
    return ~value;
}

// The image with another size in its header, and the checksum of that.
Bytes resizedPng(Bytes png, uint32_t width, uint32_t height)
{
    for (size_t i = 0; i < 4; ++i) {
        png[16 + i] = static_cast<uint8_t>(width >> (24 - 8 * i));
        png[20 + i] = static_cast<uint8_t>(height >> (24 - 8 * i));
    }
    const uint32_t sum = crc(png, 12, 29);
    for (size_t i = 0; i < 4; ++i)
        png[29 + i] = static_cast<uint8_t>(sum >> (24 - 8 * i));
    return png;
}

Bytes resizedJpeg(Bytes jpeg, uint32_t width, uint32_t height)
{
    for (size_t i = 0; i + 8 < jpeg.size(); ++i)
        if (jpeg[i] == 0xff && jpeg[i + 1] == 0xc0) {
            jpeg[i + 5] = static_cast<uint8_t>(height >> 8);
            jpeg[i + 6] = static_cast<uint8_t>(height);
            jpeg[i + 7] = static_cast<uint8_t>(width >> 8);
            jpeg[i + 8] = static_cast<uint8_t>(width);
            return jpeg;
        }
    throw std::logic_error("the test's JPEG has no frame");
}

} // namespace

TEST(GltfWrongFile, Truncations)
{
    const Bytes whole = cardGlb();
    const size_t jsonEnd = 20 + whole[12] + 256u * whole[13];
    for (const size_t length : {size_t{0}, size_t{3}, size_t{4}, size_t{11}, size_t{19}, size_t{20}, size_t{500},
                                jsonEnd - 1, jsonEnd, jsonEnd + 4, jsonEnd + 50, whole.size() - 1}) {
        Bytes cut(whole.begin(), whole.begin() + static_cast<ptrdiff_t>(length));
        EXPECT_EQ(errorOf(cut).find("without the path"), std::string::npos) << length;
        EXPECT_NE(errorOf(cut), "none") << length;
        if (length < 12)
            continue;
        // The header states the cut length, so that the code that reads the rest has to notice.
        for (size_t i = 0; i < 4; ++i)
            cut[8 + i] = static_cast<uint8_t>(length >> (8 * i));
        EXPECT_EQ(errorOf(cut).find("without the path"), std::string::npos) << length;
    }
}

// A header whose length ends before the first chunk does, whose own length is wrong too.
TEST(GltfWrongFile, ShortLengthInTheHeader)
{
    Bytes file = cardGlb();
    for (const int length : {0, 12, 19}) {
        file[8] = static_cast<uint8_t>(length);
        file[9] = file[10] = file[11] = 0;
        file[14] = 0x7f;
        EXPECT_EQ(errorOf(file), "truncated: the header announces " + std::to_string(length) + " bytes");
    }
}

// Bytes after the length in the header are not a chunk, whatever they look like.
TEST(GltfWrongFile, BytesBehindTheGlb)
{
    const std::string json = R"({"asset": {"version": "2.0"}, "buffers": [{"byteLength": 536870912}], "bufferViews":
        [{"buffer": 0, "byteLength": 536870912}], "accessors": [{"bufferView": 0, "componentType": 5126,
        "count": 40000000, "type": "VEC3"}], "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}]})";
    Bytes file = packGlb(json, {});
    for (size_t i = 0; i < 4; ++i) // without its empty second chunk
        file[8 + i] = static_cast<uint8_t>((file.size() - 8) >> (8 * i));
    const Bytes chunk = {0xff, 0xff, 0xff, 0x7f, 'B', 'I', 'N', 0};
    std::copy(chunk.begin(), chunk.end(), file.end() - 8);
    EXPECT_EQ(errorOf(file), "buffer 0: has 536870912 bytes, the GLB's binary chunk 0");
    Bytes whole = cardGlb();
    whole.insert(whole.end(), chunk.begin(), chunk.end());
    EXPECT_EQ(errorOf(whole), errorOf(cardGlb()));
    const TemporaryFolder folder;
    writeFile(folder / "test.glb", whole);
    EXPECT_EQ(Document(folder / "test.glb").bytes().size(), cardGlb().size());
}

TEST(GltfWrongFile, Sizes)
{
    const std::string position = R"({"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"})";
    const std::string view = R"({"buffer": 0, "byteLength": 48})";
    expectErrors({
        {{{position, R"({"bufferView": 0, "componentType": 5126, "count": 5, "type": "VEC3"})"}},
         "mesh 0 primitive 0 POSITION: accessor 0 reaches outside of its buffer view"},
        {{{position, R"({"bufferView": 0, "componentType": 5126, "count": -4, "type": "VEC3"})"}},
         "accessors[0]: \"count\" is not an integer of at least 0"},
        {{{position, R"({"bufferView": 0, "componentType": 5126, "count": 4.5, "type": "VEC3"})"}},
         "accessors[0]: \"count\" is not an integer of at least 0"},
        {{{position, R"({"bufferView": 0, "componentType": 5126, "count": "4", "type": "VEC3"})"}},
         "accessors[0]: \"count\" is not an integer of at least 0"},
        {{{position, R"({"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC5"})"}}, "Unsupported `type`"},
        {{{position, R"({"bufferView": 0, "componentType": 5129, "count": 4, "type": "VEC3"})"}},
         "mesh 0 primitive 0 POSITION: accessor 0: component type 5129 does not exist in glTF"},
        {{{view, R"({"buffer": 0, "byteLength": 47})"}},
         "mesh 0 primitive 0 POSITION: accessor 0 reaches outside of its buffer view"},
        {{{view, R"({"buffer": 0, "byteLength": 4800000})"}},
         "mesh 0 primitive 0 POSITION: buffer view 0 reaches outside of its buffer"},
        {{{view, R"({"buffer": 0, "byteLength": 48, "byteStride": 8})"}},
         "mesh 0 primitive 0 POSITION: accessor 0 reaches outside of its buffer view"},
        {{{view, R"({"buffer": 0, "byteLength": 48, "byteStride": 256})"}}, "Invalid `byteStride' value"},
        {{{"\"componentType\": 5123, \"count\": 6", "\"componentType\": 5123, \"count\": 5"}},
         "mesh 0 primitive 0 has 5 indices, no multiple of 3"},
        {{{"\"buffers\": [{\"byteLength\": ", "\"buffers\": [{\"byteLength\": 9"}}, "buffer 0: has 9"},
    });
}

TEST(GltfWrongFile, OffsetsAndIndices)
{
    expectErrors({
        {{{"\"byteOffset\": 12, ", "\"byteOffset\": 9223372036854775807, "}},
         "mesh 0 primitive 1 POSITION: accessor 3 reaches outside of its buffer view"},
        {{{"\"byteOffset\": 12, ", "\"byteOffset\": -12, "}}, "accessors[3]: \"byteOffset\" is not an integer"},
        {{{"\"byteOffset\": 12, ", "\"byteOffset\": 18446744073709551615, "}}, "accessors[3]: \"byteOffset\" is not"},
        {{{"\"byteOffset\": 12, ", "\"byteOffset\": 16, "}},
         "mesh 0 primitive 1 POSITION: accessor 3 reaches outside of its buffer view"},
        {{{"\"byteOffset\": 48, ", "\"byteOffset\": 9223372036854775807, "}},
         "mesh 0 primitive 0 TEXCOORD_0: buffer view 1 reaches outside of its buffer"},
        {{{"\"byteOffset\": 92, ", "\"byteOffset\": 93, "}}, "image 0: buffer view 3 reaches outside of its buffer"},
        {{{"\"POSITION\": 0", "\"POSITION\": 99"}}, "mesh 0 primitive 0 POSITION: accessor 99 does not exist"},
        {{{"\"POSITION\": 0", "\"POSITION\": -1"}}, "mesh 0 primitive 0: \"POSITION\" is not an integer"},
        {{{"\"POSITION\": 0", "\"POSITION\": 4294967296"}}, "mesh 0 primitive 0: \"POSITION\" is not an integer"},
        {{{"\"indices\": 2", "\"indices\": 77"}}, "mesh 0 primitive 0 indices: accessor 77 does not exist"},
        {{{"{\"bufferView\": 2,", "{\"bufferView\": 44,"}},
         "mesh 0 primitive 0 indices: buffer view 44 does not exist"},
        {{{"{\"buffer\": 0, \"byteLength\": 48}", "{\"buffer\": 3, \"byteLength\": 48}"}},
         "mesh 0 primitive 0 POSITION: buffer view 0: buffer 3 does not exist"},
        {{{"\"material\": 0", "\"material\": 12"}}, "material 12 does not exist"},
    });
}

TEST(GltfWrongFile, Nodes)
{
    const std::string nodes = "\"nodes\": [{\"mesh\": 0, \"translation\": [0, 2, 0]}]";
    const auto with = [&](const std::string &list) { return Replacements{{nodes, "\"nodes\": " + list}}; };
    std::string chain = "[";
    for (int i = 1; i < 100000; ++i)
        chain += "{\"children\": [" + std::to_string(i) + "]}, ";
    chain += "{\"mesh\": 0}]";
    for (const Replacements &wrong :
         {with(R"([{"mesh": 0, "children": [0]}])"), with(R"([{"children": [1]}, {"children": [0]}])"),
          with(R"([{"children": [1]}, {"children": [2]}, {"children": [1]}])"), with(R"([{"children": [7]}])"),
          with(R"([{"mesh": 5}])"), with(R"([{"mesh": -5}])"), with(R"([{"children": [1, 1]}, {"mesh": 0}])"),
          with(R"([{"children": [1, 2]}, {"children": [2]}, {"mesh": 0}])"), with("[]"), with("[3]"),
          with(R"([{"mesh": 0, "matrix": [1e300,0,0,0, 0,1e300,0,0, 0,0,1e300,0, 1e300,1e300,1e300,1]}])"),
          with(R"([{"mesh": "0x10"}])"), with(chain)}) {
        const std::string error = errorOf(wrong);
        EXPECT_NE(error, "none") << wrong[0].second.substr(0, 100);
        EXPECT_EQ(error.find("without the path"), std::string::npos) << error << wrong[0].second.substr(0, 100);
    }
}

TEST(GltfWrongFile, HugeCounts)
{
    const std::string accessor = R"({"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"})";
    expectErrors({
        {{{accessor, R"({"componentType": 5126, "count": 4000000000, "type": "VEC3"})"}},
         "mesh 0 primitive 0 POSITION: accessor 0 has 4000000000 elements and no buffer view"},
        {{{accessor, R"({"bufferView": 0, "componentType": 5126, "count": 9000000000000000000, "type": "VEC3"})"}},
         "mesh 0 primitive 0 POSITION: accessor 0 reaches outside"},
        {{{accessor, R"({"bufferView": 0, "componentType": 5126, "count": 1e15, "type": "VEC3"})"}},
         "mesh 0 primitive 0 POSITION: accessor 0 reaches outside"},
        {{{accessor, R"({"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "sparse":
                        {"count": 2000000000, "indices": {"bufferView": 2, "componentType": 5123},
                         "values": {"bufferView": 0}}})"}},
         "mesh 0 primitive 0 POSITION: accessor 0 (sparse) replaces 2000000000 of 4 elements"},
        {{{"\"count\": 6", "\"count\": 3000000000"}},
         "mesh 0 primitive 0 indices: accessor 2 reaches outside of its buffer view"},
        {{{"\"scene\": 0", "\"materials\": [" + repeated("{},", 300000) + "{}], \"scene\": 0"}},
         "the JSON has an object with two members \"materials\""},
        {{{"\"samplers\": [", "\"samplers\": [" + repeated("{},", 900000)}}, "there are too many objects in it"},
        {{{"\"textures\": [", "\"textures\": [" + repeated("{},", 900000)}}, "there are too many objects in it"},
        {{{"\"nodes\": [{\"mesh\": 0, \"translation\": [0, 2, 0]}",
           "\"nodes\": [" + repeated("{},", 900000) + "{\"mesh\": 0}"}},
         "there are too many objects in it"},
        {{{"\"name\": \"wood\"", "\"extras\": [" + repeated("[],", 4500000) + "[]]"}}, "there are too many objects"},
        {{{"\"name\": \"wood\"", "\"extras\": [" + repeated("0,", 9000000) + "0]"}}, "there are too many objects"},
        {{{"{\"name\": \"wood\"}", repeated("{},", 200000) + "{}"}}, "there are too many objects in it"},
    });
    // Members that are never read take none of that memory.
    EXPECT_EQ(errorOf({{"\"name\": \"wood\"", "\"extras\": [" + repeated("0,", 5000000) + "0]"}}),
              "without the path: none");
}

TEST(GltfWrongFile, Images)
{
    const Bytes rgba(64 * 64 * 4, 200);
    const Bytes png = pngImage(64, 64, 8, 6, false, rgba);
    const Bytes webp = webpImage(64, 64, rgba);
    const Bytes avif = avifImage(64, 64, {rgba.begin(), rgba.end()}, {.depth = 10});
    const Bytes jpeg = jpegImage(64, 64, rgba);
    const auto cut = [](const Bytes &bytes, size_t length) {
        return Bytes(bytes.begin(), bytes.begin() + static_cast<ptrdiff_t>(length));
    };
    Bytes badSum = png;
    badSum[40] ^= 1;
    Bytes noEnd = webp;
    noEnd[4] = 0xff;
    std::vector<Bytes> wrong = {cut(png, 8),
                                cut(png, 40),
                                cut(png, png.size() / 2),
                                badSum,
                                cut(jpeg, 4),
                                Bytes{0xff, 0xd8, 0xff, 0xd9},
                                Bytes(64, 17),
                                Bytes{'G', 'I', 'F', '8', '9', 'a', 0, 0, 0, 0, 0, 0}};
    if (kDecodesWebpAndAvif)
        wrong.insert(wrong.end(),
                     {cut(webp, 12), cut(webp, 20), noEnd, cut(avif, 20), cut(avif, 200), cut(avif, avif.size() - 1)});
    for (const Bytes &image : wrong)
        EXPECT_EQ(errorOfImage(image).substr(0, 26), "image 0 cannot be decoded:") << image.size();
}

TEST(GltfWrongFile, ImagesThatAnnounceHugeSizes)
{
    const Bytes rgba(16 * 16 * 4, 200);
    const Bytes png = pngImage(16, 16, 8, 6, false, rgba);
    const Bytes jpeg = jpegImage(16, 16, rgba);
    for (const auto &[width, height] : std::vector<std::pair<uint32_t, uint32_t>>{{16384, 16384},
                                                                                  {16384, 1025},
                                                                                  {8192, 8192},
                                                                                  {4096, 4096},
                                                                                  {16384, 16},
                                                                                  {0xffffffff, 0xffffffff},
                                                                                  {0, 16},
                                                                                  {16, 0},
                                                                                  {0x7fffffff, 1},
                                                                                  {100000, 100000},
                                                                                  {20000, 1}})
        EXPECT_EQ(errorOfImage(resizedPng(png, width, height)).substr(0, 7), "image 0") << width << " x " << height;
    for (const auto &[width, height] : std::vector<std::pair<uint32_t, uint32_t>>{
             {16384, 16384}, {65535, 65535}, {16384, 1025}, {8192, 8192}, {65535, 1}, {0, 16}})
        EXPECT_EQ(errorOfImage(resizedJpeg(jpeg, width, height)).substr(0, 7), "image 0") << width << " x " << height;
    if (!kDecodesWebpAndAvif)
        return;
    for (const uint32_t height : {1025u, 4000u})
        EXPECT_EQ(errorOfImage(webpImage(16383, height, Bytes(size_t{16383} * height * 4))).substr(0, 11),
                  "image 0 has");
    const Bytes avif = avifImage(16, 16, {rgba.begin(), rgba.end()});
    for (const auto &[width, height] : std::vector<std::pair<uint32_t, uint32_t>>{
             {16384, 16384}, {16384, 1025}, {0xffffffff, 0xffffffff}, {0, 16}, {0x7fffffff, 1}, {20000, 1}})
        EXPECT_EQ(errorOfImage(resizedAvif(avif, width, height)).substr(0, 7), "image 0") << width << " x " << height;
    // The frame alone has all these texels.
    const Bytes wide = avifImage(16384, 1025, std::vector<uint16_t>(size_t{4} * 16384 * 1025));
    EXPECT_EQ(errorOfImage(wide).substr(0, 11), "image 0 has");
    EXPECT_EQ(errorOfImage(resizedAvif(wide, 64, 64)).substr(0, 26), "image 0 cannot be decoded:");
}

// A stream that is decompressed to far more than the image's size: what is too much is not looked at.
TEST(GltfWrongFile, PngThatInflatesHugely)
{
    const Bytes huge = pngImage(4096, 4096, 8, 6, false, Bytes(size_t{4096} * 4096 * 4));
    EXPECT_LT(huge.size(), 100000u);
    for (const uint32_t size : {1u, 16u, 4095u}) {
        const std::string error = errorOfImage(resizedPng(huge, size, size));
        EXPECT_TRUE(error == "without the path: none" || error.starts_with("image 0 cannot be decoded")) << error;
    }
}

TEST(GltfWrongFile, Json)
{
    expectErrorsOfJson({
        {"{", "the JSON is wrong at byte"},
        {"{}", "there is no \"asset\""},
        {"{\"asset\": 2}", "there is no \"asset\""},
        {R"({"asset": {"version": "1.0"}})", "glTF version 1.0 is not 2"},
        {R"({"asset": {"version": "2.0", "minVersion": "2.9"}})", "glTF version 2.9 is needed"},
        {gltf(R"("asset": {"version": "2.0"})"), "the JSON has an object with two members \"asset\""},
        {gltf(R"("nodes": [{"mesh": 0, "mesh": 0}])"), "the JSON has an object with two members \"mesh\""},
        {gltf(R"("nodes": [{"mesh": 0, "\u006desh": 0}])"), "the JSON has an object with two members \"mesh\""},
        {gltf(R"("nodes": [{"translation": [NaN, 0, 0]}])"), "the JSON is wrong at byte"},
        {gltf(R"("nodes": [{"translation": [1e999, 0, 0]}])"), ""},
        {"{\"extras\": " + repeated("[", 1000000), "the JSON is nested too deeply"},
        {"{\"extras\": " + repeated("{\"a\":", 1000000), "the JSON is nested too deeply"},
        {gltf(R"("meshes": [{"primitives": [{}]}])"), "mesh 0 primitive 0 has no \"attributes\""},
        {gltf(R"("meshes": [{"primitives": [7]}])"), "mesh 0 primitive 0 has no \"attributes\""},
        {gltf(R"("meshes": [{}])"), "mesh 0 has no \"primitives\""},
        {gltf(R"("meshes": [{"primitives": [{"attributes": {}}]}])"), "mesh 0 primitive 0 has no attributes"},
        {gltf(R"("images": [{}])"), "image 0 has neither"},
        {gltf(R"("images": [{"uri": 5}])"), "image 0 has neither"},
        {gltf(R"("buffers": [{}])"), "buffer 0: \"byteLength\""},
        {gltf("\"nodes\": [{\"name\": \"\xff\xfe\"}]"), ""},
        {"[1, 2]", "neither a GLB nor a glTF file"},
        {gltf(R"("nodes": [])") + "}", "the JSON is followed by something else"},
        {gltf(R"("extensionsUsed": 0)"), "\"extensionsUsed\" is not an array"},
        {gltf(R"("meshes": {})"), "\"meshes\" is not an array"},
        {gltf(R"("extensions": [])"), "\"extensions\" is not an object"},
    });
}

TEST(GltfWrongFile, Uris)
{
    const TemporaryFolder folder;
    const auto error = [&](const std::string &json) {
        writeFile(folder / "test.gltf", Bytes(json.begin(), json.end()));
        const std::string text = errorWithinLimits(folder / "test.gltf");
        const std::string prefix = (folder / "test.gltf").string() + ": ";
        return text.starts_with(prefix) ? text.substr(prefix.size()) : "without the path: " + text;
    };
    std::filesystem::create_directory(folder / "directory");
    ASSERT_EQ(mkfifo((folder / "pipe").c_str(), 0600), 0);
    std::filesystem::create_symlink("/dev/zero", folder / "zero");
    std::filesystem::create_symlink("loop", folder / "loop");
    writeFile(folder / "short", Bytes(3));
    const std::pair<const char *, const char *> wrong[] = {
        {"directory", "not a file"},
        {"pipe", "not a file"},
        {"zero", "not a file"},
        {"loop", "cannot be read: Too many levels of symbolic links"},
        {"missing.bin", "no such file"},
        {"/dev/zero", "the URI is not a relative path"},
        {"%2Fdev%2Fzero", "the URI is not a relative path"},
        {"file:///dev/zero", "the URI is not a relative path"},
        {"https://localhost/a.bin", "the URI is not a relative path"},
        {"../../etc/passwd", "the URI leads out of the file's folder"},
        {"directory/%2e%2e/%2e%2e/x", "the URI leads out of the file's folder"},
        {"x%00y", "the URI is not a relative path"},
        {"", "the URI is empty"},
    };
    for (const auto &[uri, message] : wrong) {
        EXPECT_EQ(error(bufferUri(uri)), "buffer 0 (" + std::string(uri) + "): " + message);
        if (*uri != 0) {
            EXPECT_EQ(error(imageUri(uri)), "image 0 (" + std::string(uri) + "): " + message);
        }
    }
    EXPECT_EQ(error(bufferUri("short")), "buffer 0 (short): has 4 bytes, there are 3");
    EXPECT_EQ(error(bufferUri("data:;base64,AA==")), "buffer 0: has 4 bytes, there are 1");
    EXPECT_EQ(error(bufferUri("data:;base64,AAAA@AAA")),
              "buffer 0: character 4 of its base64 text is not a base64 digit");
    EXPECT_EQ(error(bufferUri("data:;base64,AAAAA")), "buffer 0: its base64 text is cut off");
    EXPECT_EQ(error(bufferUri("data:AAAA")), "buffer 0: the data URI has no comma");
    EXPECT_EQ(error(imageUri("data:image/png;base64,iVBORw0KGgo=")).substr(0, 25), "image 0 cannot be decoded");
    // The message is one line of limited length.
    const std::string longName = error(bufferUri(repeated("long", 100000)));
    EXPECT_LT(longName.size(), 1000u);
    EXPECT_EQ(error(bufferUri("a\\nb")), "buffer 0 (a?b): no such file");
}

// A file that was found somewhere names files of its own folder. A link in there may lead to any other.
TEST(GltfWrongFile, LinksThatLeadOut)
{
    const TemporaryFolder folder;
    std::filesystem::create_directories(folder / "in/deep");
    std::filesystem::create_directories(folder / "in2");
    for (const char *name : {"outside.bin", "in2/outside.bin", "in/inside.bin", "in/deep/inside.bin"})
        writeFile(folder / name, Bytes(4));
    const auto link = [&](const std::string &to, const char *name) {
        std::filesystem::create_symlink(to, folder / name);
    };
    const auto errorOfUri = [&](const std::string &json, const std::string &model = "in/test.gltf") {
        writeFile(folder / "in/test.gltf", Bytes(json.begin(), json.end()));
        const std::string text = errorWithinLimits(folder / model);
        const std::string prefix = (folder / model).string() + ": ";
        return text.starts_with(prefix) ? text.substr(prefix.size()) : "without the path: " + text;
    };
    link("../outside.bin", "in/file.bin");
    link((folder / "outside.bin").string(), "in/absolute.bin");
    link("file.bin", "in/twice.bin");
    link("../in2", "in/folder");
    link("..", "in/up");
    for (const std::string uri : {"file.bin", "absolute.bin", "twice.bin", "folder/outside.bin", "up/outside.bin",
                                  "deep/../file.bin", "up/in2/outside.bin"}) {
        const std::string message = "a link leads out of the file's folder";
        EXPECT_EQ(errorOfUri(bufferUri(uri)), "buffer 0 (" + uri + "): " + message);
        EXPECT_EQ(errorOfUri(imageUri(uri)), "image 0 (" + uri + "): " + message);
    }
    // Valid links, for comparison: they stay inside the folder, or lead to the folder or to the model.
    link("inside.bin", "in/near.bin");
    link((folder / "in/deep").string(), "in/shallow");
    link("in", "entrance");
    link("in/test.gltf", "test.gltf");
    link("in/inside.bin", "beside.bin");
    for (const std::string uri : {"inside.bin", "near.bin", "shallow/inside.bin", "up/in/inside.bin"}) {
        EXPECT_EQ(errorOfUri(bufferUri(uri)), "there are no triangles in it") << uri;
        EXPECT_EQ(errorOfUri(bufferUri(uri), "entrance/test.gltf"), "there are no triangles in it") << uri;
    }
    // A link to a model is in the folder where it is.
    EXPECT_EQ(errorOfUri(bufferUri("outside.bin"), "test.gltf"), "there are no triangles in it");
    EXPECT_EQ(errorOfUri(bufferUri("beside.bin"), "test.gltf"), "there are no triangles in it");
    EXPECT_EQ(errorOfUri(bufferUri("inside.bin"), "test.gltf"), "buffer 0 (inside.bin): no such file");
    // Build systems make folders of links, to models and to the files that these name.
    std::filesystem::create_directories(folder / "links");
    link("../in/test.gltf", "links/test.gltf");
    link("../in/deep/inside.bin", "links/inside.bin");
    link("../outside.bin", "links/outside.bin");
    EXPECT_EQ(errorOfUri(bufferUri("inside.bin"), "links/test.gltf"), "there are no triangles in it");
    EXPECT_EQ(errorOfUri(bufferUri("outside.bin"), "links/test.gltf"),
              "buffer 0 (outside.bin): a link leads out of the file's folder");
}

// Small files that need much work: all are read, or rejected, within the limits of this process.
TEST(GltfWrongFile, ManyAttributes)
{
    std::string attributes = "\"POSITION\": 0";
    for (int i = 0; i < 200000; ++i)
        attributes += ",\"_A" + std::to_string(i) + "\":0";
    EXPECT_EQ(errorOf({{"\"POSITION\": 0", attributes}}), "without the path: none");
    std::string required;
    for (int i = 0; i < 200000; ++i)
        required += std::string(i == 0 ? "" : ",") + "\"\"";
    EXPECT_EQ(errorOf({{"\"scene\": 0", "\"extensionsRequired\": [" + required + "], \"scene\": 0"}}),
              "without the path: none");
}

TEST(GltfWrongFile, ManyUsesOfOneAccessor)
{
    const auto errorOfZeros = [](size_t vertices, size_t primitives) {
        const std::string zeros =
            R"({"componentType": 5126, "count": )" + std::to_string(vertices) + R"(, "type": "VEC3"})";
        const std::string primitive = R"({"attributes": {"POSITION": 0}})";
        const std::string json = R"({"asset": {"version": "2.0"}, "accessors": [)" + zeros +
                                 R"(], "meshes": [{"primitives": [)" + repeated(primitive + ",", primitives - 1) +
                                 primitive + "]}]}";
        return errorOf(Bytes(json.begin(), json.end()), "test.gltf");
    };
    const std::string often = "the accessors of the file are read too often";
    EXPECT_NE(errorOfZeros(4194303, 2001).find(often), std::string::npos);
    EXPECT_NE(errorOfZeros(1500000, 16).find(often), std::string::npos) << "as many vertices take minutes to draw";
    EXPECT_EQ(errorOfZeros(30000, 16).find(often), std::string::npos);
}

// Valid names, for comparison: with spaces, percent signs and characters outside ASCII.
TEST(GltfWrongFile, NamesOfFilesThatAreThere)
{
    const TemporaryFolder folder;
    for (const char *name : {"with space.bin", "100%.bin", "plus+.bin", "\xe2\x99\xbb.bin"})
        writeFile(folder / name, Bytes(4));
    for (const char *uri : {"with%20space.bin", "with space.bin", "100%.bin", "100%25.bin", "plus+.bin",
                            "%E2%99%BB.bin", "\xe2\x99\xbb.bin", "./plus+.bin", "data:,abcd",
                            "data:application/x;base64,AAAAAA", "data:application\\/gltf-buffer;base64,AAAAAA=="}) {
        const std::string json = bufferUri(uri);
        writeFile(folder / "test.gltf", Bytes(json.begin(), json.end()));
        EXPECT_EQ(errorWithinLimits(folder / "test.gltf"),
                  (folder / "test.gltf").string() + ": there are no triangles in it")
            << uri;
    }
}
