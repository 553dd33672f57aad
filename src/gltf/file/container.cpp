#include "gltf/file/container.h"

#include <cstring>
#include <fstream>
#include <tuple>

#include "gltf/file/gltf_error.h"
#include "gltf/file/tinygltf.h"

namespace vellum
{
namespace
{

constexpr std::size_t kHeaderBytes = 12;
constexpr std::size_t kChunkHeaderBytes = 8;
constexpr std::uint32_t kGlbMagic = 0x46546c67;
constexpr std::uint32_t kJsonChunk = 0x4e4f534a;

std::vector<std::uint8_t> readFile(const std::filesystem::path &path)
{
    std::error_code error;
    const auto status = std::filesystem::status(path, error);
    if (!std::filesystem::exists(status))
        throw GltfError("no such file");
    if (!std::filesystem::is_regular_file(status))
        throw GltfError("not a file");
    std::ifstream file(path, std::ios::binary);
    std::vector<std::uint8_t> bytes(std::istreambuf_iterator<char>(file), {});
    if (!file.good() && !file.eof())
        throw GltfError("cannot be read");
    if (bytes.size() > 0x7fffffff)
        throw GltfError("larger than 2 GiB");
    return bytes;
}

std::uint32_t wordAt(const std::vector<std::uint8_t> &bytes, std::size_t offset)
{
    std::uint32_t word = 0;
    std::memcpy(&word, bytes.data() + offset, sizeof word);
    return word;
}

// tinygltf 2.7 lets a binary chunk end 8 bytes after the file and reads them, so the chunks are checked first.
// Returns where the JSON text is.
std::pair<std::size_t, std::size_t> checkGlb(const std::vector<std::uint8_t> &bytes)
{
    if (bytes.size() < kHeaderBytes + kChunkHeaderBytes)
        throw GltfError("truncated: " + std::to_string(bytes.size()) + " bytes are too short for a GLB header");
    if (wordAt(bytes, 4) != 2)
        throw GltfError("GLB version " + std::to_string(wordAt(bytes, 4)) + " is not 2");
    const std::size_t length = wordAt(bytes, 8);
    if (length > bytes.size())
        throw GltfError("truncated: the header announces " + std::to_string(length) + " bytes, there are " +
                        std::to_string(bytes.size()));
    if (wordAt(bytes, 16) != kJsonChunk)
        throw GltfError("the first GLB chunk is not JSON");
    std::size_t offset = kHeaderBytes;
    while (offset < length) {
        if (length - offset < kChunkHeaderBytes)
            throw GltfError("truncated inside a chunk header");
        const std::size_t chunk = wordAt(bytes, offset);
        if (chunk > length - offset - kChunkHeaderBytes)
            throw GltfError("a GLB chunk of " + std::to_string(chunk) + " bytes ends outside of the file");
        offset += kChunkHeaderBytes + chunk;
    }
    return {kHeaderBytes + kChunkHeaderBytes, wordAt(bytes, kHeaderBytes)};
}

// tinygltf walks the JSON tree recursively: thousands of levels would overflow the stack.
void checkNesting(const char *text, std::size_t length)
{
    constexpr int kMaxDepth = 128;
    int depth = 0;
    bool quoted = false;
    for (std::size_t i = 0; i < length; ++i) {
        const char c = text[i];
        if (quoted) {
            if (c == '\\')
                ++i;
            else if (c == '"')
                quoted = false;
            continue;
        }
        if (c == '"')
            quoted = true;
        else if (c == '{' || c == '[')
            ++depth;
        else if (c == '}' || c == ']')
            --depth;
        if (depth > kMaxDepth)
            throw GltfError("the JSON is nested too deeply");
    }
}

// Called for every image. Those in buffer views are decoded later, when their bounds have been checked; tinygltf
// hands them over unchecked.
bool keepEncoded(tinygltf::Image *image, const int, std::string *, std::string *, int, int, const unsigned char *bytes,
                 int size, void *)
{
    if (image->bufferView < 0 && size > 0)
        image->image.assign(bytes, bytes + size);
    image->as_is = true;
    return true;
}

// The first line of tinygltf's messages, which have several and end in one or two line feeds.
std::string firstLine(const std::string &message)
{
    const std::size_t begin = message.find_first_not_of(" \t\r\n");
    if (begin == std::string::npos)
        return "not a valid glTF file";
    return message.substr(begin, message.find_first_of("\r\n", begin) - begin);
}

} // namespace

Container readContainer(const std::filesystem::path &path)
{
    Container container{.bytes = readFile(path)};
    const std::vector<std::uint8_t> &bytes = container.bytes;
    if (bytes.empty())
        throw GltfError("the file is empty");
    const char *text = reinterpret_cast<const char *>(bytes.data());
    container.binary = bytes.size() >= 4 && wordAt(bytes, 0) == kGlbMagic;
    if (container.binary) {
        std::tie(container.jsonOffset, container.jsonSize) = checkGlb(bytes);
    } else {
        const std::size_t start = std::string_view(text, bytes.size()).find_first_not_of(" \t\r\n\xef\xbb\xbf");
        if (start == std::string_view::npos || text[start] != '{')
            throw GltfError("neither a GLB nor a glTF file");
        container.jsonSize = bytes.size();
    }
    checkNesting(text + container.jsonOffset, container.jsonSize);
    return container;
}

void parseModel(const Container &container, const std::filesystem::path &folder, tinygltf::Model &model)
{
    tinygltf::TinyGLTF loader;
    loader.SetImageLoader(keepEncoded, nullptr);
    const auto size = static_cast<unsigned>(container.bytes.size());
    const std::string base = folder.empty() ? "." : folder.string();
    std::string error;
    std::string warning;
    const bool loaded =
        container.binary
            ? loader.LoadBinaryFromMemory(&model, &error, &warning, container.bytes.data(), size, base)
            : loader.LoadASCIIFromString(&model, &error, &warning,
                                         reinterpret_cast<const char *>(container.bytes.data()), size, base);
    if (!loaded)
        throw GltfError(firstLine(error));
}

} // namespace vellum
