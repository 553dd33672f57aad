// SPDX-License-Identifier: Apache-2.0
// Results of the baker that are kept for later bakes of the same input: their keys, and the results as bytes.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "bake/bake.h"
#include "base/sha256.h"
#include "gltf/primitive.h"

namespace vellum
{

// Where results are kept. Either function may be missing. What `get` returns is checked: it may be damaged.
struct BakeCache {
    std::function<std::optional<std::vector<uint8_t>>(const Digest &key)> get;
    std::function<void(const Digest &key, std::span<const uint8_t> value)> put;

    [[nodiscard]] bool exists() const { return get || put; }
};

// The digest of an image as it is stored.
Digest imageKey(const EncodedImage &image);

// The digest of a texture: how a material reads an image with that digest, or none.
Digest textureKey(const Material &material, const std::optional<Digest> &image);

// The digest of everything that the result of bake() depends on. Instead of the textures of the inputs, which need not
// be there, `textures` has the digest of one for each group of inputs.
Digest bakeKey(std::span<const BakeInput> inputs, std::span<const Digest> textures, const BakeOptions &options);

// A result as bytes, with a checksum of them and the key.
std::vector<uint8_t> cacheValueOf(const Micromap &micromap, const Digest &key);
// The result with so many indices; nothing for any other bytes.
std::optional<Micromap> micromapOf(std::span<const uint8_t> value, const Digest &key, size_t indexCount);

} // namespace vellum
