// SPDX-License-Identifier: Apache-2.0
// The bytes of a file's buffer views, compressed ones included, and typed, bounds-checked reading of accessors, sparse
// ones included.
#pragma once

#include <atomic>
#include <cstdint>
#include <cstring>
#include <map>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "gltf/file/model.h"

namespace vellum
{

// A number as files have it: little-endian, like every system here, and at any address.
template <typename T>
T load(const uint8_t *bytes)
{
    T value;
    std::memcpy(&value, bytes, sizeof value);
    return value;
}

// The buffer views of one model, which must outlive this. Any thread may read.
class BufferViews
{
public:
    explicit BufferViews(const gltf_json::Model &model) : model_(model)
    {
        for (const gltf_json::Buffer &buffer : model.buffers)
            bufferBytes_ += buffer.data.size();
    }

    [[nodiscard]] const gltf_json::Model &model() const { return model_; }

    // Decompresses a view with EXT_meshopt_compression or KHR_meshopt_compression at the first call, and keeps the
    // result. Throws GltfError, which begins with `what`, where the view does not exist, reaches outside of its buffer
    // or cannot be decompressed.
    [[nodiscard]] std::span<const uint8_t> bytes(int view, const std::string &what) const;

    // Returns whether a compressed view has uncompressed fallback data, for readers that do not know the compression,
    // that differs from its own.
    [[nodiscard]] bool differsFromFallback(int view, const std::string &what) const;

    // Counts numbers that were read. Throws GltfError, which begins with `what`, where they are many times those of the
    // file: a small file can have many primitives that share large accessors.
    void countRead(uint64_t numbers, const std::string &what) const;

private:
    [[nodiscard]] std::span<const uint8_t> stored(int buffer, size_t offset, size_t length,
                                                  const std::string &name) const;
    [[nodiscard]] std::span<const uint8_t> decompressed(int view, const std::string &name) const;
    void account(size_t bytes) const;

    const gltf_json::Model &model_;
    uint64_t bufferBytes_ = 0; // of all buffers
    mutable std::mutex mutex_;
    mutable std::map<int, std::vector<uint8_t>> decompressed_;
    mutable std::optional<uint64_t> allowance_; // of bytes to decompress to
    mutable std::atomic<uint64_t> read_{0};     // numbers
};

// In all of these, `what` names the accessor in the GltfError that is thrown if it does not exist, is of another type,
// contradicts itself or reaches outside its buffer.

// `count` elements of `components` floats each: from FLOAT, or from 8/16-bit integers, normalized or not
// (KHR_mesh_quantization).
std::vector<float> readFloats(const BufferViews &views, int accessor, uint32_t components, const std::string &what);

// The fourth components of colours; none where they have three.
std::vector<float> readAlphas(const BufferViews &views, int accessor, const std::string &what);

// Vertex indices, from unsigned 8/16/32-bit data.
std::vector<uint32_t> readIndices(const BufferViews &views, int accessor, const std::string &what);

// Indices of micromap triangles, from integers of 8, 16 or 32 bits. The four highest numbers of an unsigned type are
// the special indices -4 to -1 ("MUST be stored as the two's-complement bit pattern of the signed value",
// EXT_mesh_opacity_micromap). Elements must be aligned to their type.
std::vector<int64_t> readMicromapIndices(const BufferViews &views, int accessor, const std::string &what);

// The number of elements, after a check that all of them are there.
size_t countElements(const BufferViews &views, int accessor, const std::string &what);

// The number of elements that the accessor states.
size_t accessorCount(const gltf_json::Model &model, int accessor, const std::string &what);

// The number of triangles of a primitive of mode 4 by what its indices state, or its positions where it has none;
// nothing if it has neither. Compressed data may have others.
std::optional<size_t> declaredTriangles(const gltf_json::Model &model, const gltf_json::Primitive &primitive);

} // namespace vellum
