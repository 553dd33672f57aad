// SPDX-License-Identifier: Apache-2.0
// Fuzz target of the baker, through the C functions of libvellum: whatever textures, coordinates and options are, a
// bake reads nothing outside them, ends soon, and takes no more memory than it says; what it makes is valid, the same
// for any number of threads, and claims nothing that the texture says otherwise of.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstring>
#include <iterator>
#include <memory>
#include <span>
#include <vector>

#include "bake/inputs.h"
#include "check.h"
#include "reader.h"
#include "vellum/vellum.h"

using namespace vellum;
using vellum::fuzz::Reader;

namespace
{

using Clock = std::chrono::steady_clock;

// Memory of exactly that many bytes, so that AddressSanitizer sees the end.
class Bytes
{
public:
    explicit Bytes(size_t size) : bytes_(std::make_unique<uint8_t[]>(size)), size_(size) {}
    [[nodiscard]] uint8_t *data() const { return bytes_.get(); }
    [[nodiscard]] size_t size() const { return size_; }
    [[nodiscard]] std::span<uint8_t> span() const { return {bytes_.get(), size_}; }

private:
    std::unique_ptr<uint8_t[]> bytes_;
    size_t size_;
};

size_t sizeOf(uint32_t format)
{
    switch (format) {
    case VELLUM_FORMAT_R8_UNORM: return 1;
    case VELLUM_FORMAT_R16_UNORM:
    case VELLUM_FORMAT_R16_SFLOAT: return 2;
    case VELLUM_FORMAT_R32G32_SFLOAT: return 8;
    default: return 4;
    }
}

// One of these values, or seldom an arbitrary one.
template <size_t N>
uint32_t oneOf(Reader &input, const uint32_t (&values)[N])
{
    return input.oneIn(64) ? input.take<uint32_t>() : values[input.below(N)];
}

size_t anyStride(Reader &input, size_t least)
{
    switch (input.below(16)) {
    case 0: return input.take<size_t>();
    case 1:
    case 2: return least + input.byte();
    default: return 0;
    }
}

// The input of a bake, and the memory that it points to.
struct Bake {
    std::vector<Bytes> memory;
    std::vector<std::vector<VellumTexture>> textures;
    std::vector<VellumBakeInput> inputs;
    VellumBakeOptions options{};
    Clock::time_point end;
    std::atomic<bool> late = false;
    int messages = 0;

    const uint8_t *keep(Bytes bytes)
    {
        memory.push_back(std::move(bytes));
        return memory.back().data();
    }
};

VellumTexture anyTexture(Reader &input, Bake &bake)
{
    VellumTexture texture;
    vellumInitTexture(&texture, sizeof texture);
    const bool large = input.oneIn(16);
    texture.width = 1 + input.below(large ? 300 : 24);
    texture.height = 1 + input.below(large ? 300 : 24);
    texture.format = oneOf(input, {VELLUM_FORMAT_R8_UNORM, VELLUM_FORMAT_R8_UNORM, VELLUM_FORMAT_R16_UNORM,
                                   VELLUM_FORMAT_R16_SFLOAT, VELLUM_FORMAT_R32_SFLOAT});
    texture.filter = oneOf(input, {VELLUM_FILTER_LINEAR, VELLUM_FILTER_LINEAR, VELLUM_FILTER_NEAREST});
    texture.addressModeU = oneOf(input, {0, 1, 2, 3, 4});
    texture.addressModeV = oneOf(input, {0, 1, 2, 3, 4});
    const size_t size = sizeOf(texture.format);
    texture.offset = input.oneIn(8) ? input.byte() : 0;
    texture.pixelStride = anyStride(input, size);
    const size_t pixel = texture.pixelStride != 0 ? texture.pixelStride : size;
    texture.rowStride = anyStride(input, texture.width * pixel);
    texture.scale = input.oneIn(8) ? input.take<float>() : 1;
    texture.border = input.oneIn(8) ? input.take<float>() : static_cast<float>(input.byte()) / 255;
    // As many bytes as the texture needs if that is not absurdly many; seldom any number.
    const size_t row = texture.rowStride != 0 ? texture.rowStride : texture.width * pixel;
    size_t needed = texture.offset + row * (texture.height - 1) + pixel * (texture.width - 1) + size;
    if (pixel > 1000 || row > 1'000'000 || input.oneIn(64))
        needed = input.take<uint16_t>();
    if (input.oneIn(64))
        texture.width = input.take<uint32_t>();
    Bytes texels(needed);
    input.part(2u + input.byte()).fill(texels.span());
    texture.texelsSize = texels.size();
    texture.texels = bake.keep(std::move(texels));
    return texture;
}

float anyCoordinate(Reader &input, uint32_t reach)
{
    switch (reach) {
    case 0: return input.take<float>();
    case 1: return static_cast<float>(input.take<int16_t>()) * 0.25f;
    case 2: return static_cast<float>(input.take<int16_t>()) / 256;
    case 3: return static_cast<float>(input.byte()) / 16;
    default: return static_cast<float>(input.take<uint16_t>()) / 32768;
    }
}

VellumBakeInput anyInput(Reader &input, Bake &bake)
{
    VellumBakeInput mesh;
    vellumInitBakeInput(&mesh, sizeof mesh);
    if (!bake.textures.empty() && input.oneIn(3)) {
        bake.textures.push_back(bake.textures.front());
    } else {
        std::vector<VellumTexture> levels;
        const uint32_t count = input.oneIn(8) ? input.below(4) : 1;
        for (uint32_t i = 0; i < count; ++i)
            levels.push_back(anyTexture(input, bake));
        bake.textures.push_back(std::move(levels));
    }
    mesh.textures = bake.textures.back().data();
    mesh.textureCount = bake.textures.back().size();

    mesh.triangleCount = input.below(6);
    mesh.uvFormat = oneOf(input, {VELLUM_FORMAT_R32G32_SFLOAT, VELLUM_FORMAT_R32G32_SFLOAT, VELLUM_FORMAT_R16G16_SFLOAT,
                                  VELLUM_FORMAT_R16G16_UNORM});
    mesh.indexType = oneOf(input, {VELLUM_INDEX_TYPE_NONE, VELLUM_INDEX_TYPE_NONE, VELLUM_INDEX_TYPE_UINT8,
                                   VELLUM_INDEX_TYPE_UINT16, VELLUM_INDEX_TYPE_UINT32});
    const size_t size = sizeOf(mesh.uvFormat);
    mesh.uvStride = anyStride(input, size);
    const size_t stride = mesh.uvStride != 0 ? mesh.uvStride : size;
    const size_t vertices = mesh.indexType == VELLUM_INDEX_TYPE_NONE ? 3 * mesh.triangleCount : 8;
    Bytes uvs(stride > 1000 || input.oneIn(64) ? input.byte() : vertices * stride);
    const uint32_t reach = input.below(16);
    if (mesh.uvFormat == VELLUM_FORMAT_R32G32_SFLOAT)
        for (size_t at = 0; at + 8 <= uvs.size(); at += std::min(stride, uvs.size())) {
            const float uv[2] = {anyCoordinate(input, reach), anyCoordinate(input, reach)};
            std::memcpy(uvs.data() + at, uv, sizeof uv);
        }
    else
        input.part(1u + input.byte()).fill(uvs.span());
    mesh.uvsSize = uvs.size();
    mesh.uvs = bake.keep(std::move(uvs));
    if (mesh.indexType != VELLUM_INDEX_TYPE_NONE) {
        const size_t index = mesh.indexType == VELLUM_INDEX_TYPE_UINT8    ? 1
                             : mesh.indexType == VELLUM_INDEX_TYPE_UINT16 ? 2
                                                                          : 4;
        Bytes indices(input.oneIn(64) ? input.byte() : 3 * mesh.triangleCount * index);
        for (size_t at = 0; at + index <= indices.size(); at += index)
            indices.data()[at] = static_cast<uint8_t>(input.below(input.oneIn(64) ? 9 : 8));
        mesh.indicesSize = indices.size();
        mesh.indices = bake.keep(std::move(indices));
    }
    if (input.oneIn(64))
        mesh.triangleCount = input.take<size_t>();
    if (input.oneIn(8))
        for (float &m : mesh.uvTransform)
            m = input.oneIn(4) ? input.take<float>() : anyCoordinate(input, 3);
    if (input.oneIn(4) && mesh.triangleCount < 100) {
        Bytes levels(mesh.triangleCount);
        for (uint8_t &level : levels.span())
            level = static_cast<uint8_t>(input.below(input.oneIn(64) ? 14 : 6));
        mesh.levels = bake.keep(std::move(levels));
    }
    if (input.oneIn(4) && mesh.triangleCount < 100) {
        Bytes formats(mesh.triangleCount);
        for (uint8_t &format : formats.span())
            format = static_cast<uint8_t>(input.oneIn(64) ? input.byte() : 1 + input.below(2));
        mesh.formats = bake.keep(std::move(formats));
    }
    mesh.cutoff = input.oneIn(8) ? input.take<double>() : input.byte() / 255.0;
    return mesh;
}

void anyOptions(Reader &input, VellumBakeOptions &options)
{
    vellumInitBakeOptions(&options, sizeof options);
    options.format = oneOf(input, {1, 2, 2, 2});
    options.twoStateRule = oneOf(input, {0, 1, 2});
    options.level = static_cast<int32_t>(input.below(input.oneIn(64) ? 15 : 7)) - 1;
    options.maxLevel = input.below(input.oneIn(64) ? 14 : 7);
    if (input.oneIn(4))
        options.texelsPerEdge = input.oneIn(8) ? input.take<double>() : input.byte() / 8.0;
    options.compareOp = oneOf(input, {1, 3, 4, 6, 6, 6});
    options.flags = oneOf(input, {0, 0, 1});
    if (input.oneIn(4))
        options.budget = input.take<uint16_t>();
    if (input.oneIn(4))
        options.minKnown = input.oneIn(8) ? input.take<double>() : input.byte() / 255.0;
    for (double *tolerance : {&options.valueTolerance, &options.subtexelTolerance, &options.barycentricTolerance,
                              &options.interpolationTolerance})
        switch (input.below(8)) {
        case 0: *tolerance = input.take<double>(); break;
        case 1: *tolerance = input.byte() / 1024.0; break;
        case 2:
        case 3: *tolerance = 0; break;
        default: break;
        }
    if (input.oneIn(8))
        options.maxDataSize = input.take<uint16_t>();
    options.threads = 1;
}

VellumResult run(Bake &bake, uint32_t threads, VellumMicromap *&micromap)
{
    bake.messages = 0;
    bake.options.threads = threads;
    micromap = nullptr;
    const VellumResult result = vellumBake(bake.inputs.data(), bake.inputs.size(), &bake.options, &micromap);
    FUZZ_CHECK((micromap != nullptr) == (result == VELLUM_SUCCESS));
    FUZZ_CHECK(bake.messages == (result < 0 ? 1 : 0));
    FUZZ_CHECK(result == VELLUM_SUCCESS || result == VELLUM_CANCELLED || result == VELLUM_ERROR_INVALID_ARGUMENT ||
               result == VELLUM_ERROR_TOO_LARGE);
    FUZZ_CHECK(result != VELLUM_CANCELLED || bake.late);
    return result;
}

size_t dataBytes(const VellumMicromapTriangle &triangle)
{
    FUZZ_CHECK(triangle.subdivisionLevel <= 12 && (triangle.format == 1 || triangle.format == 2));
    return ((size_t{triangle.format} << (2 * triangle.subdivisionLevel)) + 7) / 8;
}

VellumMicromapInfo checkValid(const Bake &bake, const VellumMicromap *micromap)
{
    VellumMicromapInfo info{};
    info.structSize = sizeof info;
    FUZZ_CHECK(vellumGetMicromapInfo(micromap, &info) == VELLUM_SUCCESS);
    size_t triangles = 0;
    uint64_t specials = 0;
    for (size_t i = 0; i < bake.inputs.size(); ++i) {
        VellumGeometryInfo geometry{};
        geometry.structSize = sizeof geometry;
        FUZZ_CHECK(vellumGetGeometryInfo(micromap, i, &geometry) == VELLUM_SUCCESS);
        FUZZ_CHECK(geometry.indices == info.indices + triangles);
        FUZZ_CHECK(geometry.indexCount == bake.inputs[i].triangleCount);
        triangles += geometry.indexCount;
        size_t used = 0;
        for (size_t k = 0; k < geometry.usageCount; ++k)
            used += geometry.usages[k].count;
        bool special = false;
        for (size_t t = 0; t < geometry.indexCount; ++t) {
            const int32_t index = geometry.indices[t];
            FUZZ_CHECK(index >= -4 && (index < 0 || static_cast<size_t>(index) < info.triangleCount));
            special = special || index < 0;
            used -= index >= 0 ? 1 : 0;
        }
        FUZZ_CHECK(used == 0);
        if ((bake.options.flags & VELLUM_BAKE_DISALLOW_MIXED_SPECIAL_INDICES_BIT) != 0 && special)
            FUZZ_CHECK(geometry.usageCount == 0);
    }
    FUZZ_CHECK(triangles == info.indexCount);
    size_t end = 0;
    for (size_t i = 0; i < info.triangleCount; ++i) {
        FUZZ_CHECK(info.triangles[i].dataOffset == end);
        end += dataBytes(info.triangles[i]);
    }
    FUZZ_CHECK(end == info.dataSize && end <= bake.options.maxDataSize);
    if (bake.options.budget != VELLUM_NO_BUDGET && bake.options.flags == 0)
        FUZZ_CHECK(end + 8 * info.triangleCount <= bake.options.budget);
    for (const uint64_t count : info.specialCounts)
        specials += count;
    FUZZ_CHECK(specials <= info.indexCount);
    return info;
}

// The textures of an input as the baker sees them.
std::vector<AlphaTexture> texturesOf(const VellumBakeInput &input)
{
    std::vector<AlphaTexture> textures;
    for (size_t i = 0; i < input.textureCount; ++i) {
        const VellumTexture &given = input.textures[i];
        AlphaPixels pixels{given.width,
                           given.height,
                           AlphaFormat::Unorm8,
                           {static_cast<const std::byte *>(given.texels), given.texelsSize}};
        pixels.format = given.format == VELLUM_FORMAT_R16_UNORM    ? AlphaFormat::Unorm16
                        : given.format == VELLUM_FORMAT_R16_SFLOAT ? AlphaFormat::Float16
                        : given.format == VELLUM_FORMAT_R32_SFLOAT ? AlphaFormat::Float32
                                                                   : AlphaFormat::Unorm8;
        pixels.offset = given.offset;
        pixels.pixelStride = given.pixelStride != 0 ? given.pixelStride : sizeOf(given.format);
        pixels.rowStride = given.rowStride;
        pixels.scale = given.scale;
        AlphaTexture texture = readAlpha(pixels);
        constexpr Wrap kWraps[] = {Wrap::Repeat, Wrap::Mirror, Wrap::Clamp, Wrap::Border, Wrap::MirrorOnce};
        texture.wrapU = kWraps[given.addressModeU];
        texture.wrapV = kWraps[given.addressModeV];
        texture.border = given.border * given.scale;
        textures.push_back(std::move(texture));
    }
    return textures;
}

// Checks that no claim at `point`, in barycentrics, is wrong by more than the rounding errors here. Requires texture
// coordinates of floats, and filters whose values vary slowly.
void checkClaim(const Bake &bake, size_t which, const std::vector<AlphaTexture> &textures, size_t triangle,
                uint32_t state, double u, double v)
{
    if (state != VELLUM_STATE_OPAQUE && state != VELLUM_STATE_TRANSPARENT)
        return;
    const VellumBakeInput &input = bake.inputs[which];
    const size_t stride = input.uvStride != 0 ? input.uvStride : 8;
    float uvs[6];
    for (size_t k = 0; k < 3; ++k)
        std::memcpy(uvs + 2 * k, static_cast<const char *>(input.uvs) + (3 * triangle + k) * stride, 8);
    const double s = uvs[0] * (1 - u - v) + uvs[2] * u + uvs[4] * v;
    const double t = uvs[1] * (1 - u - v) + uvs[3] * u + uvs[5] * v;
    for (const AlphaTexture &texture : textures) {
        double largest = std::abs(texture.border);
        const bool isCodes = texture.codes.first != nullptr;
        for (const float alpha : isCodes ? std::span<const float>(texture.codes.values) : texture.alpha)
            largest = std::max(largest, std::isfinite(alpha) ? std::abs(double{alpha}) : 1e300);
        const double far = std::max(std::abs(s) * texture.width, std::abs(t) * texture.height);
        if (!(largest < 1e30 && far < 0x1p20))
            continue;
        // Half the texels' difference is what the value changes by over half a texel; places are off by far less.
        const double slack = largest * 1e-6;
        const double value = texture.sample(s, t);
        const bool below = bake.options.compareOp == VELLUM_COMPARE_OP_LESS ||
                           bake.options.compareOp == VELLUM_COMPARE_OP_LESS_OR_EQUAL;
        const bool high = (state == VELLUM_STATE_OPAQUE) != below;
        FUZZ_CHECK(high ? value >= input.cutoff - slack : value <= input.cutoff + slack);
    }
}

void checkClaims(Reader &input, const Bake &bake, const VellumMicromap *micromap)
{
    size_t first = 0;
    for (size_t i = 0; i < bake.inputs.size(); first += bake.inputs[i++].triangleCount) {
        const VellumBakeInput &mesh = bake.inputs[i];
        const VellumBakeInput plain = [] {
            VellumBakeInput defaults;
            vellumInitBakeInput(&defaults, sizeof defaults);
            return defaults;
        }();
        const bool readable = mesh.uvFormat == VELLUM_FORMAT_R32G32_SFLOAT &&
                              mesh.indexType == VELLUM_INDEX_TYPE_NONE &&
                              std::equal(std::begin(mesh.uvTransform), std::end(mesh.uvTransform), plain.uvTransform);
        bool linear = true;
        for (size_t k = 0; k < mesh.textureCount; ++k)
            linear = linear && mesh.textures[k].filter == VELLUM_FILTER_LINEAR;
        // 2-state data claims what it does not know.
        const bool honest = bake.options.format == VELLUM_MICROMAP_FORMAT_4_STATE && mesh.formats == nullptr;
        const std::vector<AlphaTexture> textures =
            readable && linear && honest ? texturesOf(mesh) : std::vector<AlphaTexture>{};
        for (size_t t = 0; t < mesh.triangleCount; ++t)
            for (int n = 0; n < 8; ++n) {
                const float u = static_cast<float>(input.byte()) / 256;
                const float v = (1 - u) * static_cast<float>(input.byte()) / 256;
                uint32_t state = 99;
                FUZZ_CHECK(vellumGetState(micromap, first + t, u, v, &state) == VELLUM_SUCCESS);
                FUZZ_CHECK(state < 4);
                if (!textures.empty())
                    checkClaim(bake, i, textures, t, state, u, v);
            }
    }
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    Reader input(std::span(data, size));
    Bake bake;
    anyOptions(input, bake.options);
    const uint32_t count = input.oneIn(8) ? input.below(4) : 1;
    for (uint32_t i = 0; i < count; ++i)
        bake.inputs.push_back(anyInput(input, bake));
    bake.options.userData = &bake;
    bake.options.message = [](void *self, VellumResult result, const char *text) {
        FUZZ_CHECK(result < 0 && text[0] != '\0');
        ++static_cast<Bake *>(self)->messages;
    };
    // Large triangles at high levels take long, as is their right; but not long to stop.
    bake.options.cancelled = [](void *self) {
        auto &b = *static_cast<Bake *>(self);
        if (Clock::now() > b.end)
            b.late = true;
        return b.late ? 1 : 0;
    };
    bake.end = Clock::now() + std::chrono::milliseconds(500);

    VellumMicromap *micromap = nullptr;
    if (run(bake, 1, micromap) != VELLUM_SUCCESS)
        return 0;
    const VellumMicromapInfo info = checkValid(bake, micromap);
    checkClaims(input, bake, micromap);
    if (input.oneIn(4)) {
        VellumMicromap *other = nullptr;
        if (run(bake, 2, other) == VELLUM_SUCCESS) {
            const VellumMicromapInfo again = checkValid(bake, other);
            FUZZ_CHECK(again.dataSize == info.dataSize && again.triangleCount == info.triangleCount);
            FUZZ_CHECK(info.dataSize == 0 || std::memcmp(again.data, info.data, info.dataSize) == 0);
            FUZZ_CHECK(std::equal(info.indices, info.indices + info.indexCount, again.indices));
            vellumDestroyMicromap(other);
        }
    }
    vellumDestroyMicromap(micromap);
    return 0;
}
