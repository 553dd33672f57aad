// SPDX-License-Identifier: Apache-2.0
#include "gltf/micromaps/bake_cache.h"

#include <algorithm>
#include <cstring>
#include <type_traits>
#include <utility>

namespace vellum
{
namespace
{

template <typename T>
std::span<const uint8_t> bytesOf(std::span<const T> values)
{
    static_assert(std::has_unique_object_representations_v<T> || std::is_floating_point_v<T>);
    return {reinterpret_cast<const uint8_t *>(values.data()), values.size_bytes()};
}

// A digest of values. Each is added with its size or a count, so that different values never make the same bytes.
class KeyDigest
{
public:
    template <typename T>
    requires std::is_arithmetic_v<T> || std::is_enum_v<T>
    void add(T value) { sha256_.add({reinterpret_cast<const uint8_t *>(&value), sizeof value}); }
    void add(const Digest &digest) { sha256_.add(digest); }
    template <typename T>
    void add(const std::optional<T> &value)
    {
        add(value.has_value());
        if (value)
            add(*value);
    }
    template <typename T>
    void addAll(std::span<const T> values)
    {
        add(uint64_t{values.size()});
        sha256_.add(bytesOf(values));
    }
    Digest finish() { return sha256_.finish(); }

private:
    Sha256 sha256_;
};

// New members do not compile here until it is stated which results depend on them.
void add(const BakeOptions &options, KeyDigest &key)
{
    const auto &[format, twoStateRule, level, maxLevel, texelsPerEdge, budget, leastKnown, emptyGroupBytes, minKnown,
                 disallowMixedSpecialIndices, cutoff, test, valueTolerance, subtexelTolerance, barycentricTolerance,
                 interpolationTolerance, threads, maxDataBytes, progress, cancelled] = options;
    key.add(format);
    key.add(level);
    if (!level) {
        key.add(maxLevel);
        key.add(texelsPerEdge);
    }
    key.add(budget);
    if (budget)
        key.add(emptyGroupBytes);
    key.add(leastKnown);
    key.add(disallowMixedSpecialIndices);
    key.add(test);
    key.add(subtexelTolerance);
    key.add(barycentricTolerance);
    key.add(interpolationTolerance);
    key.add(maxDataBytes);
}

void add(const BakeInput &input, const BakeOptions &options, KeyDigest &key)
{
    const auto &[textures, triangles, levels, formats, cutoff, valueTolerance, uvTerms, weights, group] = input;
    key.addAll(std::span(reinterpret_cast<const float *>(triangles.data()), 6 * triangles.size()));
    key.addAll(levels);
    key.addAll(formats);
    const auto has = [&options, given = formats](Format format) {
        return given.empty() ? options.format == format : std::find(given.begin(), given.end(), format) != given.end();
    };
    if (has(Format::TwoState))
        key.add(options.twoStateRule);
    if (has(Format::FourState))
        key.add(options.minKnown);
    key.add(cutoff.value_or(options.cutoff));
    key.add(valueTolerance.value_or(options.valueTolerance));
    key.add(uvTerms);
    key.add(group);
    if (options.budget || options.leastKnown)
        key.addAll(weights);
}

Digest checksumOf(std::span<const uint8_t> bytes, const Digest &key)
{
    Sha256 sha256;
    sha256.add(key);
    sha256.add(bytes);
    return sha256.finish();
}

// What a value has after its checksum: the sizes, and the elements in this order.
struct Sizes {
    uint64_t indices;
    uint64_t triangles;
    uint64_t data;
};

template <typename T>
void append(std::span<const T> values, std::vector<uint8_t> &to)
{
    const std::span<const uint8_t> bytes = bytesOf(values);
    to.insert(to.end(), bytes.begin(), bytes.end());
}

// Takes `count` elements from the front. Returns false if there are fewer.
template <typename T>
bool take(std::span<const uint8_t> &from, uint64_t count, T *to)
{
    if (count > from.size() / sizeof(T))
        return false;
    const size_t bytes = static_cast<size_t>(count) * sizeof(T);
    if (count != 0)
        std::memcpy(to, from.data(), bytes);
    from = from.subspan(bytes);
    return true;
}

template <typename T>
bool take(std::span<const uint8_t> &from, uint64_t count, std::vector<T> &to)
{
    if (count > from.size() / sizeof(T))
        return false;
    to.resize(static_cast<size_t>(count));
    return take(from, count, to.data());
}

} // namespace

Digest imageKey(const EncodedImage &image)
{
    Sha256 sha256;
    sha256.add(image.bytes());
    return sha256.finish();
}

Digest textureKey(const Material &material, const std::optional<Digest> &image)
{
    KeyDigest key;
    key.add(image);
    if (image) {
        key.add(material.wrapU);
        key.add(material.wrapV);
        key.add(material.filter);
    }
    key.add(material.baseColor[3]);
    return key.finish();
}

Digest bakeKey(std::span<const BakeInput> inputs, std::span<const Digest> textures, const BakeOptions &options)
{
    KeyDigest key;
    key.add(kBakeVersion);
    key.add(kDecodesWebpAndAvif); // otherwise such a texture is not baked
    add(options, key);
    key.add(uint64_t{textures.size()});
    for (const Digest &texture : textures)
        key.add(texture);
    key.add(uint64_t{inputs.size()});
    for (const BakeInput &input : inputs)
        add(input, options, key);
    return key.finish();
}

std::vector<uint8_t> cacheValueOf(const Micromap &micromap, const Digest &key)
{
    const Sizes sizes{micromap.indices.size(), micromap.triangles.size(), micromap.data.size()};
    std::vector<uint8_t> value(sizeof(Digest));
    append(std::span(&sizes, 1), value);
    append(std::span(std::as_const(micromap.indices)), value);
    append(std::span(std::as_const(micromap.triangles)), value);
    append(std::span(std::as_const(micromap.data)), value);
    const Digest checksum = checksumOf(std::span(value).subspan(sizeof(Digest)), key);
    std::copy(checksum.begin(), checksum.end(), value.begin());
    return value;
}

std::optional<Micromap> micromapOf(std::span<const uint8_t> value, const Digest &key, size_t indexCount)
{
    Digest checksum;
    Sizes sizes{};
    Micromap micromap;
    const bool whole = take(value, checksum.size(), checksum.data()) && checksum == checksumOf(value, key) &&
                       take(value, 1, &sizes) && take(value, sizes.indices, micromap.indices) &&
                       take(value, sizes.triangles, micromap.triangles) && take(value, sizes.data, micromap.data) &&
                       value.empty();
    // Whoever can write there can make a checksum.
    if (!whole || micromap.indices.size() != indexCount || micromap.validate())
        return std::nullopt;
    return micromap;
}

} // namespace vellum
