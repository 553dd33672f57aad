// SPDX-License-Identifier: Apache-2.0
#include "library/inputs.h"

#include <cmath>

#include "bake/inputs.h"
#include "core/curve.h"
#include "library/call.h"

namespace vellum::library
{
namespace
{

constexpr uint32_t kMostTexels = 1u << 24; // along a side
constexpr size_t kMostTriangles = size_t{1} << 28;

[[noreturn]] void reject(const char *member, const std::string &value, const char *range)
{
    throw invalid(std::string(member) + " is " + value + ", not " + range);
}

AlphaFormat alphaFormat(uint32_t format)
{
    switch (format) {
    case VELLUM_FORMAT_R8_UNORM: return AlphaFormat::Unorm8;
    case VELLUM_FORMAT_R16_UNORM: return AlphaFormat::Unorm16;
    case VELLUM_FORMAT_R16_SFLOAT: return AlphaFormat::Float16;
    case VELLUM_FORMAT_R32_SFLOAT: return AlphaFormat::Float32;
    default: reject("format", std::to_string(format), "a VellumFormat of one channel");
    }
}

size_t sizeOf(AlphaFormat format)
{
    return format == AlphaFormat::Unorm8 ? 1 : format == AlphaFormat::Float32 ? 4 : 2;
}

UvFormat uvFormat(uint32_t format)
{
    switch (format) {
    case VELLUM_FORMAT_R32G32_SFLOAT: return UvFormat::Float32;
    case VELLUM_FORMAT_R16G16_SFLOAT: return UvFormat::Float16;
    case VELLUM_FORMAT_R16G16_UNORM: return UvFormat::Unorm16;
    default: reject("uvFormat", std::to_string(format), "a VellumFormat of two channels");
    }
}

// The format, and the bytes of an index.
std::pair<IndexFormat, size_t> indexFormat(uint32_t type)
{
    switch (type) {
    case VELLUM_INDEX_TYPE_NONE: return {IndexFormat::None, 0};
    case VELLUM_INDEX_TYPE_UINT8: return {IndexFormat::Uint8, 1};
    case VELLUM_INDEX_TYPE_UINT16: return {IndexFormat::Uint16, 2};
    case VELLUM_INDEX_TYPE_UINT32: return {IndexFormat::Uint32, 4};
    default: reject("indexType", std::to_string(type), "a VellumIndexType");
    }
}

Wrap wrap(const char *member, uint32_t mode)
{
    switch (mode) {
    case VELLUM_ADDRESS_MODE_REPEAT: return Wrap::Repeat;
    case VELLUM_ADDRESS_MODE_MIRRORED_REPEAT: return Wrap::Mirror;
    case VELLUM_ADDRESS_MODE_CLAMP_TO_EDGE: return Wrap::Clamp;
    case VELLUM_ADDRESS_MODE_CLAMP_TO_BORDER: return Wrap::Border;
    case VELLUM_ADDRESS_MODE_MIRROR_CLAMP_TO_EDGE: return Wrap::MirrorOnce;
    default: reject(member, std::to_string(mode), "a VellumAddressMode");
    }
}

Format micromapFormat(const char *member, uint32_t format)
{
    switch (format) {
    case VELLUM_MICROMAP_FORMAT_2_STATE: return Format::TwoState;
    case VELLUM_MICROMAP_FORMAT_4_STATE: return Format::FourState;
    default: reject(member, std::to_string(format), "a VellumMicromapFormat");
    }
}

std::span<const std::byte> bytesOf(const char *member, const void *first, size_t size)
{
    if (first == nullptr && size != 0)
        throw invalid(std::string(member) + " is null, but " + std::to_string(size) + " bytes");
    return {static_cast<const std::byte *>(first), size};
}

AlphaTexture readTexture(const VellumTexture &given)
{
    if (given.width < 1 || given.width > kMostTexels)
        reject("width", std::to_string(given.width), "1 to 2^24");
    if (given.height < 1 || given.height > kMostTexels)
        reject("height", std::to_string(given.height), "1 to 2^24");
    AlphaPixels pixels;
    pixels.width = given.width;
    pixels.height = given.height;
    pixels.format = alphaFormat(given.format);
    pixels.bytes = bytesOf("texels", given.texels, given.texelsSize);
    pixels.offset = given.offset;
    // Strides of no less than what they step over keep what is read, and so what is allocated, in proportion to what
    // is given.
    const size_t size = sizeOf(pixels.format);
    pixels.pixelStride = given.pixelStride != 0 ? given.pixelStride : size;
    if (pixels.pixelStride < size)
        reject("pixelStride", std::to_string(given.pixelStride), "the size of a value or more");
    if (pixels.pixelStride > given.texelsSize && given.width > 1)
        reject("pixelStride", std::to_string(given.pixelStride), "within texelsSize");
    pixels.rowStride = given.rowStride;
    if (given.rowStride != 0 && given.rowStride / pixels.pixelStride < given.width)
        reject("rowStride", std::to_string(given.rowStride), "width * pixelStride or more");
    pixels.scale = given.scale;

    if (given.filter != VELLUM_FILTER_NEAREST && given.filter != VELLUM_FILTER_LINEAR)
        reject("filter", std::to_string(given.filter), "a VellumFilter");
    const Wrap wrapU = wrap("addressModeU", given.addressModeU);
    const Wrap wrapV = wrap("addressModeV", given.addressModeV);
    AlphaTexture texture = readAlpha(pixels);
    texture.wrapU = wrapU;
    texture.wrapV = wrapV;
    texture.filter = given.filter == VELLUM_FILTER_NEAREST ? Filter::Nearest : Filter::Bilinear;
    texture.border = given.border * given.scale;
    return texture;
}

std::vector<TriangleUvs> readTriangles(const VellumBakeInput &given, double &uvTerms)
{
    UvVertices vertices;
    vertices.format = uvFormat(given.uvFormat);
    const size_t size = vertices.format == UvFormat::Float32 ? 8 : 4;
    vertices.bytes = bytesOf("uvs", given.uvs, given.uvsSize);
    vertices.stride = given.uvStride != 0 ? given.uvStride : size;
    if (vertices.stride < size)
        reject("uvStride", std::to_string(given.uvStride), "the size of a u and a v or more");
    const auto [format, indexSize] = indexFormat(given.indexType);
    vertices.indexFormat = format;
    const size_t corners = 3 * given.triangleCount;
    if (format == IndexFormat::None) {
        const size_t there = given.uvsSize < size ? 0 : (given.uvsSize - size) / vertices.stride + 1;
        if (there < corners)
            throw invalid(std::to_string(given.triangleCount) + " triangles have " + std::to_string(corners) +
                          " vertices, but uvs has " + std::to_string(there));
        // More vertices than this would need more triangles.
        vertices.bytes =
            corners == 0 ? std::span<const std::byte>{} : vertices.bytes.first((corners - 1) * vertices.stride + size);
    } else {
        const std::span<const std::byte> indices = bytesOf("indices", given.indices, given.indicesSize);
        if (indices.size() / indexSize < corners)
            throw invalid(std::to_string(given.triangleCount) + " triangles have " + std::to_string(corners) +
                          " indices, but there are " + std::to_string(indices.size() / indexSize));
        vertices.indices = indices.first(corners * indexSize);
    }
    std::copy_n(given.uvTransform, vertices.transform.size(), vertices.transform.begin());
    return readUvs(vertices, &uvTerms);
}

// Puts in front of a failure what it is about.
template <typename Function>
auto about(const std::string &what, Function &&function)
{
    try {
        return function();
    } catch (const Failure &failure) {
        throw Failure(failure.result(), what + ": " + failure.what());
    } catch (const BakeError &error) {
        throw invalid(what + ": " + error.what());
    }
}

} // namespace

BakeOptions readOptions(const VellumBakeOptions &given)
{
    BakeOptions options;
    options.format = micromapFormat("format", given.format);
    switch (given.twoStateRule) {
    case VELLUM_TWO_STATE_NEAREST: options.twoStateRule = TwoStateRule::Nearest; break;
    case VELLUM_TWO_STATE_UNKNOWN_IS_OPAQUE: options.twoStateRule = TwoStateRule::UnknownIsOpaque; break;
    case VELLUM_TWO_STATE_UNKNOWN_IS_TRANSPARENT: options.twoStateRule = TwoStateRule::UnknownIsTransparent; break;
    default: reject("twoStateRule", std::to_string(given.twoStateRule), "a VellumTwoStateRule");
    }
    if (given.level < VELLUM_LEVEL_AUTOMATIC || given.level > static_cast<int32_t>(shared::kMaxSubdivisionLevel))
        reject("level", std::to_string(given.level), "0 to 12 or VELLUM_LEVEL_AUTOMATIC");
    if (given.level != VELLUM_LEVEL_AUTOMATIC)
        options.level = static_cast<uint32_t>(given.level);
    if (given.maxLevel > shared::kMaxSubdivisionLevel)
        reject("maxLevel", std::to_string(given.maxLevel), "0 to 12");
    options.maxLevel = given.maxLevel;
    switch (given.compareOp) {
    case VELLUM_COMPARE_OP_LESS: options.test = AlphaTest::Less; break;
    case VELLUM_COMPARE_OP_LESS_OR_EQUAL: options.test = AlphaTest::LessOrEqual; break;
    case VELLUM_COMPARE_OP_GREATER: options.test = AlphaTest::Greater; break;
    case VELLUM_COMPARE_OP_GREATER_OR_EQUAL: options.test = AlphaTest::GreaterOrEqual; break;
    default: reject("compareOp", std::to_string(given.compareOp), "a VellumCompareOp");
    }
    if ((given.flags & ~static_cast<uint32_t>(VELLUM_BAKE_DISALLOW_MIXED_SPECIAL_INDICES_BIT)) != 0)
        reject("flags", std::to_string(given.flags), "made of VellumBakeFlagBits");
    options.disallowMixedSpecialIndices = (given.flags & VELLUM_BAKE_DISALLOW_MIXED_SPECIAL_INDICES_BIT) != 0;
    if (given.budget != VELLUM_NO_BUDGET)
        options.budget = given.budget;
    for (size_t i = 0; i < kBakeNumbers.size(); ++i) {
        const double value = given.*kNumbers[i];
        if (!kBakeNumbers[i].accepts(value))
            reject(kBakeNumbers[i].name, std::to_string(value), kBakeNumbers[i].range);
        options.*kBakeNumbers[i].member = value;
    }
    if (given.maxDataSize > UINT32_MAX)
        reject("maxDataSize", std::to_string(given.maxDataSize), "2^32 - 1 or less");
    options.maxDataBytes = given.maxDataSize;
    if (given.threads > kMostBakeThreads)
        reject("threads", std::to_string(given.threads), "1024 or less");
    options.threads = given.threads;
    if (given.reserved != 0)
        reject("reserved", std::to_string(given.reserved), "0");
    return options;
}

Inputs::Inputs(const VellumBakeInput *inputs, size_t count)
{
    if (inputs == nullptr && count != 0)
        throw invalid("inputs is null, but inputCount is " + std::to_string(count));
    size_t stride = 0;
    const auto *next = reinterpret_cast<const char *>(inputs);
    for (size_t i = 0; i < count; ++i, next += stride)
        about("input " + std::to_string(i), [&] {
            const auto *given = reinterpret_cast<const VellumBakeInput *>(next);
            const VellumBakeInput input = knownPart(given);
            checkUnknownPart(given);
            if (i != 0 && given->structSize != stride)
                throw invalid("structSize is not that of input 0");
            stride = given->structSize;
            add(input);
        });
    for (size_t i = 0; i < inputs_.size(); ++i)
        inputs_[i].triangles = triangles_[i];
}

void Inputs::add(const VellumBakeInput &given)
{
    if (std::isnan(given.cutoff))
        throw invalid("cutoff is not a number");
    if (given.triangleCount > kMostTriangles - triangleCount_)
        throw invalid("there are more than 2^28 triangles");
    triangleCount_ += given.triangleCount;
    BakeInput input;
    input.cutoff = given.cutoff;
    triangles_.push_back(readTriangles(given, input.uvTerms));
    if (given.levels != nullptr) {
        input.levels = {given.levels, given.triangleCount};
        for (size_t t = 0; t < given.triangleCount; ++t)
            if (given.levels[t] > shared::kMaxSubdivisionLevel)
                throw invalid("the level of triangle " + std::to_string(t) + " is " + std::to_string(given.levels[t]) +
                              ", not 0 to 12");
    }
    if (given.formats != nullptr) {
        std::vector<Format> formats(given.triangleCount);
        for (size_t t = 0; t < given.triangleCount; ++t)
            formats[t] =
                about("triangle " + std::to_string(t), [&] { return micromapFormat("format", given.formats[t]); });
        formats_.push_back(std::move(formats));
        input.formats = formats_.back();
    }
    input.textures = texturesOf(given);
    inputs_.push_back(input);
}

std::span<const AlphaTexture> Inputs::texturesOf(const VellumBakeInput &given)
{
    if (given.textures == nullptr || given.textureCount == 0)
        throw invalid("there is no texture");
    // All mip levels of the largest texture, and then some: what is beyond has been left uninitialized.
    constexpr size_t kMostTextures = 256;
    if (given.textureCount > kMostTextures)
        reject("textureCount", std::to_string(given.textureCount), "256 or less");
    std::vector<VellumTexture> textures;
    const auto *next = reinterpret_cast<const char *>(given.textures);
    for (size_t i = 0; i < given.textureCount; ++i, next += given.textures->structSize)
        about("texture " + std::to_string(i), [&] {
            const auto *texture = reinterpret_cast<const VellumTexture *>(next);
            textures.push_back(knownPart(texture));
            checkUnknownPart(texture);
            if (texture->structSize != given.textures->structSize)
                throw invalid("structSize is not that of texture 0");
        });
    static_assert(sizeof(VellumTexture) == offsetof(VellumTexture, border) + sizeof(float)); // no padding at the end
    std::string key(reinterpret_cast<const char *>(textures.data()), textures.size() * sizeof(VellumTexture));
    const auto entry = textures_.try_emplace(std::move(key));
    std::vector<AlphaTexture> &read = entry.first->second;
    if (entry.second)
        for (size_t i = 0; i < textures.size(); ++i)
            about("texture " + std::to_string(i), [&] { read.push_back(readTexture(textures[i])); });
    return read;
}

} // namespace vellum::library
