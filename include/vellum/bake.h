// SPDX-License-Identifier: Apache-2.0
// libvellum for C++20: vellum/vellum.h with spans, exceptions and RAII. Everything is inline; the binary interface is
// C. Members of the same name are documented there, with ranges and defaults, as are lifetimes and threads.
//
//     const vellum::Texture texture{.texels = std::as_bytes(std::span(rgba)), .width = width, .height = height,
//                                   .offset = 3, .pixelStride = 4};
//     const vellum::BakeInput mesh{.textures = {&texture, 1}, .uvs = std::as_bytes(std::span(uvs)),
//                                  .indices = std::as_bytes(std::span(indices)),
//                                  .indexType = vellum::IndexType::Uint32};
//     const vellum::Micromap micromap = vellum::bake(mesh, {.level = 5});
#ifndef VELLUM_BAKE_H_
#define VELLUM_BAKE_H_

#if (defined(_MSVC_LANG) ? _MSVC_LANG : __cplusplus) < 202002L
#error "vellum/bake.h needs C++20; vellum/vellum.h does not"
#endif

#include <array>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "vellum/vellum.h"

namespace vellum
{
inline namespace v0
{

// Thrown where the C function returns an error; what() is its message.
class Error : public std::runtime_error
{
public:
    Error(VellumResult result, const std::string &message) : std::runtime_error(message), result_(result) {}
    [[nodiscard]] VellumResult result() const noexcept { return result_; }

private:
    VellumResult result_;
};

// VELLUM_CANCELLED
class Cancelled : public Error
{
public:
    Cancelled() : Error(VELLUM_CANCELLED, "the bake was cancelled") {}
};

enum class AlphaFormat : std::uint32_t {
    R8Unorm = VELLUM_FORMAT_R8_UNORM,
    R16Unorm = VELLUM_FORMAT_R16_UNORM,
    R16Sfloat = VELLUM_FORMAT_R16_SFLOAT,
    R32Sfloat = VELLUM_FORMAT_R32_SFLOAT,
};

enum class UvFormat : std::uint32_t {
    R16G16Unorm = VELLUM_FORMAT_R16G16_UNORM,
    R16G16Sfloat = VELLUM_FORMAT_R16G16_SFLOAT,
    R32G32Sfloat = VELLUM_FORMAT_R32G32_SFLOAT,
};

enum class IndexType : std::uint32_t {
    None = VELLUM_INDEX_TYPE_NONE,
    Uint8 = VELLUM_INDEX_TYPE_UINT8,
    Uint16 = VELLUM_INDEX_TYPE_UINT16,
    Uint32 = VELLUM_INDEX_TYPE_UINT32,
};

enum class AddressMode : std::uint32_t {
    Repeat = VELLUM_ADDRESS_MODE_REPEAT,
    MirroredRepeat = VELLUM_ADDRESS_MODE_MIRRORED_REPEAT,
    ClampToEdge = VELLUM_ADDRESS_MODE_CLAMP_TO_EDGE,
    ClampToBorder = VELLUM_ADDRESS_MODE_CLAMP_TO_BORDER,
    MirrorClampToEdge = VELLUM_ADDRESS_MODE_MIRROR_CLAMP_TO_EDGE,
};

enum class Filter : std::uint32_t { Nearest = VELLUM_FILTER_NEAREST, Linear = VELLUM_FILTER_LINEAR };

enum class CompareOp : std::uint32_t {
    Less = VELLUM_COMPARE_OP_LESS,
    LessOrEqual = VELLUM_COMPARE_OP_LESS_OR_EQUAL,
    Greater = VELLUM_COMPARE_OP_GREATER,
    GreaterOrEqual = VELLUM_COMPARE_OP_GREATER_OR_EQUAL,
};

enum class TwoStateRule : std::uint32_t {
    Nearest = VELLUM_TWO_STATE_NEAREST,
    UnknownIsOpaque = VELLUM_TWO_STATE_UNKNOWN_IS_OPAQUE,
    UnknownIsTransparent = VELLUM_TWO_STATE_UNKNOWN_IS_TRANSPARENT,
};

enum class MicromapFormat : std::uint8_t {
    TwoState = VELLUM_MICROMAP_FORMAT_2_STATE,
    FourState = VELLUM_MICROMAP_FORMAT_4_STATE,
};

enum class State : std::uint32_t {
    Transparent = VELLUM_STATE_TRANSPARENT,
    Opaque = VELLUM_STATE_OPAQUE,
    UnknownTransparent = VELLUM_STATE_UNKNOWN_TRANSPARENT,
    UnknownOpaque = VELLUM_STATE_UNKNOWN_OPAQUE,
};

using MicromapTriangle = VellumMicromapTriangle;
using MicromapUsage = VellumMicromapUsage;

struct Texture {
    std::span<const std::byte> texels;
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    AlphaFormat format = AlphaFormat::R8Unorm;
    Filter filter = Filter::Linear;
    AddressMode addressModeU = AddressMode::Repeat;
    AddressMode addressModeV = AddressMode::Repeat;
    std::size_t offset = 0;
    std::size_t pixelStride = 0;
    std::size_t rowStride = 0;
    float scale = 1;
    float border = 0;
};

// The number of triangles follows from the size of the indices, or without indices, of the vertices. A remainder is
// ignored.
struct BakeInput {
    std::span<const Texture> textures;
    std::span<const std::byte> uvs;
    std::size_t uvStride = 0;
    UvFormat uvFormat = UvFormat::R32G32Sfloat;
    std::span<const std::byte> indices{};
    IndexType indexType = IndexType::None;
    std::array<float, 6> uvTransform = {1, 0, 0, 0, 1, 0};
    std::span<const std::uint8_t> levels{}; // one for each triangle, or empty
    std::span<const MicromapFormat> formats{};
    double cutoff = 0.5;

    [[nodiscard]] std::size_t triangleCount() const
    {
        const std::size_t vertex = uvFormat == UvFormat::R32G32Sfloat ? 8 : 4;
        switch (indexType) {
        case IndexType::None:
            return uvs.size() < vertex ? 0 : ((uvs.size() - vertex) / (uvStride != 0 ? uvStride : vertex) + 1) / 3;
        case IndexType::Uint8: return indices.size() / 3;
        case IndexType::Uint16: return indices.size() / 6;
        case IndexType::Uint32: break;
        }
        return indices.size() / 12;
    }
};

struct BakeOptions {
    MicromapFormat format = MicromapFormat::FourState;
    TwoStateRule twoStateRule = TwoStateRule::Nearest;
    std::optional<std::uint32_t> level{}; // without a value: automatic
    std::uint32_t maxLevel = 8;
    double texelsPerEdge = 4;
    CompareOp compareOp = CompareOp::GreaterOrEqual;
    bool disallowMixedSpecialIndices = false;
    std::optional<std::uint64_t> budget{};
    double minKnown = 0;
    double valueTolerance = 2.0 / 255;
    double subtexelTolerance = 1.0 / 16;
    double barycentricTolerance = 1e-5;
    double interpolationTolerance = 16.0 / (1 << 24);
    std::uint64_t maxDataSize = std::uint64_t{1} << 30;
    std::uint32_t threads = 0;
    // An exception from a callback ends the bake, and bake() throws it. `cancelled` can be std::stop_token's
    // stop_requested().
    std::function<void(std::uint64_t done, std::uint64_t total)> progress{};
    std::function<bool()> cancelled{};

    // Sets all tolerances to 0: states are those of exact arithmetic.
    BakeOptions &exactly()
    {
        valueTolerance = subtexelTolerance = barycentricTolerance = interpolationTolerance = 0;
        return *this;
    }
};

// The part of a result that a geometry made of one input needs.
struct Geometry {
    std::span<const std::int32_t> indices;
    std::span<const MicromapUsage> usages;
};

// Owns a result. Its spans stay valid when it is moved, until it is destroyed. A Micromap that was moved from is empty.
class Micromap
{
public:
    Micromap() = default;
    // Takes ownership of a result of vellumBake().
    explicit Micromap(VellumMicromap *micromap) : micromap_(micromap)
    {
        info_.structSize = sizeof info_;
        check(vellumGetMicromapInfo(micromap, &info_), "result", 0);
    }
    Micromap(Micromap &&other) noexcept
        : micromap_(std::move(other.micromap_)), info_(std::exchange(other.info_, VellumMicromapInfo{}))
    {
    }
    Micromap &operator=(Micromap &&other) noexcept
    {
        micromap_ = std::move(other.micromap_);
        info_ = std::exchange(other.info_, VellumMicromapInfo{});
        return *this;
    }

    [[nodiscard]] std::span<const std::uint8_t> data() const { return {info_.data, info_.dataSize}; }
    [[nodiscard]] std::span<const MicromapTriangle> triangles() const { return {info_.triangles, info_.triangleCount}; }
    [[nodiscard]] std::span<const MicromapUsage> usages() const { return {info_.usages, info_.usageCount}; }
    [[nodiscard]] std::span<const std::int32_t> indices() const { return {info_.indices, info_.indexCount}; }
    [[nodiscard]] std::uint64_t stateCount(State state) const
    {
        return info_.stateCounts[static_cast<std::size_t>(state)];
    }
    [[nodiscard]] std::uint64_t specialCount(State state) const
    {
        return info_.specialCounts[static_cast<std::size_t>(state)];
    }
    [[nodiscard]] std::uint64_t distinctCount() const { return info_.distinctCount; }

    // `input` is the number of an input of the bake; otherwise throws Error.
    [[nodiscard]] Geometry geometry(std::size_t input) const
    {
        VellumGeometryInfo info{};
        info.structSize = sizeof info;
        check(vellumGetGeometryInfo(micromap_.get(), input, &info), "input", input);
        return {{info.indices, info.indexCount}, {info.usages, info.usageCount}};
    }
    // Looks up a state like vellumGetState(). Throws Error if there is no such triangle.
    [[nodiscard]] State state(std::size_t triangle, float u, float v) const
    {
        std::uint32_t state = 0;
        check(vellumGetState(micromap_.get(), triangle, u, v, &state), "triangle", triangle);
        return static_cast<State>(state);
    }
    // For functions of vellum/vellum.h. The Micromap keeps ownership. Null if it is empty.
    [[nodiscard]] const VellumMicromap *get() const { return micromap_.get(); }

private:
    struct Destroy {
        void operator()(VellumMicromap *micromap) const { vellumDestroyMicromap(micromap); }
    };
    // The C functions have no message. `what`, `number`: the element that the function looks up.
    void check(VellumResult result, const char *what, std::size_t number) const
    {
        if (result == VELLUM_SUCCESS)
            return;
        throw Error(result, micromap_ ? std::string("there is no ") + what + " " + std::to_string(number)
                                      : "there is no micromap");
    }

    std::unique_ptr<VellumMicromap, Destroy> micromap_;
    VellumMicromapInfo info_{};
};

namespace detail
{

// The callbacks of one bake. Keeps exceptions from passing through C.
class Listener
{
public:
    explicit Listener(const BakeOptions &options) : options_(options) {}

    static void message(void *self, VellumResult, const char *text)
    {
        try {
            static_cast<Listener *>(self)->message_ = text;
        } catch (...) {
            // Out of memory: check() uses the name of the result.
        }
    }
    static int progress(void *self, std::uint64_t done, std::uint64_t total)
    {
        return static_cast<Listener *>(self)->caught([&](const BakeOptions &options) {
            options.progress(done, total);
            return false;
        });
    }
    static int cancelled(void *self)
    {
        return static_cast<Listener *>(self)->caught([](const BakeOptions &options) { return options.cancelled(); });
    }

    void check(VellumResult result) const
    {
        if (thrown_)
            std::rethrow_exception(thrown_);
        if (result == VELLUM_CANCELLED)
            throw Cancelled();
        if (result != VELLUM_SUCCESS)
            throw Error(result, message_.empty() ? vellumResultName(result) : message_);
    }

private:
    template <typename Function>
    int caught(Function &&function)
    {
        try {
            return function(options_) ? 1 : 0;
        } catch (...) {
            const std::lock_guard lock(mutex_);
            if (!thrown_)
                thrown_ = std::current_exception();
            return 1;
        }
    }

    const BakeOptions &options_;
    std::string message_;
    std::mutex mutex_;
    std::exception_ptr thrown_;
};

inline VellumTexture toC(const Texture &texture)
{
    VellumTexture c;
    vellumInitTexture(&c, sizeof c);
    c.texels = texture.texels.data();
    c.texelsSize = texture.texels.size();
    c.width = texture.width;
    c.height = texture.height;
    c.format = static_cast<std::uint32_t>(texture.format);
    c.filter = static_cast<std::uint32_t>(texture.filter);
    c.addressModeU = static_cast<std::uint32_t>(texture.addressModeU);
    c.addressModeV = static_cast<std::uint32_t>(texture.addressModeV);
    c.offset = texture.offset;
    c.pixelStride = texture.pixelStride;
    c.rowStride = texture.rowStride;
    c.scale = texture.scale;
    c.border = texture.border;
    return c;
}

inline VellumBakeInput toC(const BakeInput &input, const std::vector<VellumTexture> &textures)
{
    VellumBakeInput c;
    vellumInitBakeInput(&c, sizeof c);
    c.textures = textures.data();
    c.textureCount = textures.size();
    c.uvs = input.uvs.data();
    c.uvsSize = input.uvs.size();
    c.uvStride = input.uvStride;
    c.indices = input.indices.data();
    c.indicesSize = input.indices.size();
    c.triangleCount = input.triangleCount();
    c.uvFormat = static_cast<std::uint32_t>(input.uvFormat);
    c.indexType = static_cast<std::uint32_t>(input.indexType);
    for (std::size_t i = 0; i < input.uvTransform.size(); ++i)
        c.uvTransform[i] = input.uvTransform[i];
    const auto forAll = [&](std::size_t count, const char *what) {
        if (count != 0 && count != c.triangleCount)
            throw Error(VELLUM_ERROR_INVALID_ARGUMENT, std::string("there are ") + std::to_string(count) + " " + what +
                                                           " for " + std::to_string(c.triangleCount) + " triangles");
    };
    forAll(input.levels.size(), "levels");
    forAll(input.formats.size(), "formats");
    c.levels = input.levels.empty() ? nullptr : input.levels.data();
    c.formats = input.formats.empty() ? nullptr : reinterpret_cast<const std::uint8_t *>(input.formats.data());
    c.cutoff = input.cutoff;
    return c;
}

inline VellumBakeOptions toC(const BakeOptions &options, Listener &listener)
{
    VellumBakeOptions c;
    vellumInitBakeOptions(&c, sizeof c);
    c.format = static_cast<std::uint32_t>(options.format);
    c.twoStateRule = static_cast<std::uint32_t>(options.twoStateRule);
    constexpr std::uint32_t kNoLevel = 255; // out of range, so the library rejects it
    if (options.level)
        c.level = static_cast<std::int32_t>(*options.level < kNoLevel ? *options.level : kNoLevel);
    c.maxLevel = options.maxLevel;
    c.texelsPerEdge = options.texelsPerEdge;
    c.compareOp = static_cast<std::uint32_t>(options.compareOp);
    if (options.disallowMixedSpecialIndices)
        c.flags |= static_cast<std::uint32_t>(VELLUM_BAKE_DISALLOW_MIXED_SPECIAL_INDICES_BIT);
    if (options.budget)
        c.budget = *options.budget;
    c.minKnown = options.minKnown;
    c.valueTolerance = options.valueTolerance;
    c.subtexelTolerance = options.subtexelTolerance;
    c.barycentricTolerance = options.barycentricTolerance;
    c.interpolationTolerance = options.interpolationTolerance;
    c.maxDataSize = options.maxDataSize;
    c.threads = options.threads;
    c.message = Listener::message;
    c.progress = options.progress ? Listener::progress : nullptr;
    c.cancelled = options.cancelled ? Listener::cancelled : nullptr;
    c.userData = &listener;
    return c;
}

} // namespace detail

// Bakes like vellumBake(). Throws Error, Cancelled, std::bad_alloc, and exceptions of callbacks.
inline Micromap bake(std::span<const BakeInput> inputs, const BakeOptions &options = {})
{
    std::vector<std::vector<VellumTexture>> textures(inputs.size());
    std::vector<VellumBakeInput> c;
    for (std::size_t i = 0; i < inputs.size(); ++i) {
        for (const Texture &texture : inputs[i].textures)
            textures[i].push_back(detail::toC(texture));
        c.push_back(detail::toC(inputs[i], textures[i]));
    }
    detail::Listener listener(options);
    const VellumBakeOptions cOptions = detail::toC(options, listener);
    VellumMicromap *micromap = nullptr;
    listener.check(vellumBake(c.data(), c.size(), &cOptions, &micromap));
    return Micromap(micromap);
}

inline Micromap bake(const BakeInput &input, const BakeOptions &options = {})
{
    return bake(std::span(&input, 1), options);
}

} // namespace v0
} // namespace vellum

#endif
