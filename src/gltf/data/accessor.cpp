// SPDX-License-Identifier: Apache-2.0
#include "gltf/data/accessor.h"

#include <algorithm>
#include <cstring>
#include <limits>

#include "gltf/data/decompress.h"
#include "gltf/file/gltf_error.h"

namespace vellum
{
namespace
{

// A few bytes could decompress to gigabytes, so the decompressed size is limited by the size of the file. Meshopt's
// streams of version 0 take at least a 64th of their data.
constexpr uint64_t kMostExpansion = 64;
constexpr uint64_t kBytesAlwaysAllowed = uint64_t{64} << 20;

// Some seconds, and how often each byte of a file may be read.
constexpr uint64_t kAlwaysRead = uint64_t{1} << 29;
constexpr uint64_t kMostReads = 1024;
// As how many numbers one without a buffer view counts: no byte of the file pays for what is made of it.
constexpr uint64_t kZeroWeight = 64;

} // namespace

std::span<const uint8_t> BufferViews::stored(int buffer, size_t offset, size_t length, const std::string &name) const
{
    if (buffer < 0 || static_cast<size_t>(buffer) >= model_.buffers.size())
        throw GltfError(name + ": buffer " + std::to_string(buffer) + " does not exist");
    const std::span<const uint8_t> data = model_.buffers[static_cast<size_t>(buffer)].data;
    if (offset > data.size() || length > data.size() - offset)
        throw GltfError(name + " reaches outside of its buffer");
    return data.subspan(offset, length);
}

void BufferViews::account(size_t bytes) const
{
    if (!allowance_)
        allowance_ = kBytesAlwaysAllowed + kMostExpansion * bufferBytes_;
    if (bytes > *allowance_)
        throw GltfError("is decompressed to many times the bytes of the file");
    *allowance_ -= bytes;
}

void BufferViews::countRead(uint64_t numbers, const std::string &what) const
{
    const uint64_t read = read_ += numbers;
    if (read > kAlwaysRead && read - kAlwaysRead > kMostReads * bufferBytes_)
        throw GltfError(what + ": the accessors of the file are read too often");
}

std::span<const uint8_t> BufferViews::decompressed(int index, const std::string &name) const
{
    const std::lock_guard lock(mutex_);
    if (const auto known = decompressed_.find(index); known != decompressed_.end())
        return known->second;
    const gltf_json::BufferView &parent = model_.bufferViews[static_cast<size_t>(index)];
    try {
        const CompressedView view = readCompressedView(parent);
        const auto encoded = stored(view.buffer, view.byteOffset, view.byteLength, "has a compression that");
        account(view.bytes());
        return decompressed_.emplace(index, decompressView(view, encoded)).first->second;
    } catch (const GltfUnsupported &error) {
        // The file may have uncompressed data as a fallback.
        if (parent.buffer >= 0 && static_cast<size_t>(parent.buffer) < model_.buffers.size() &&
            !model_.buffers[static_cast<size_t>(parent.buffer)].data.empty())
            return stored(parent.buffer, parent.byteOffset, parent.byteLength, name);
        throw GltfUnsupported(name + " " + error.what());
    } catch (const GltfError &error) {
        throw GltfError(name + " " + error.what());
    }
}

bool BufferViews::differsFromFallback(int view, const std::string &what) const
{
    if (view < 0 || static_cast<size_t>(view) >= model_.bufferViews.size())
        return false;
    const gltf_json::BufferView &parent = model_.bufferViews[static_cast<size_t>(view)];
    if (!isCompressed(parent) || parent.buffer < 0 || static_cast<size_t>(parent.buffer) >= model_.buffers.size() ||
        model_.buffers[static_cast<size_t>(parent.buffer)].data.empty())
        return false;
    for (const char *name : {"EXT_meshopt_compression", "KHR_meshopt_compression"})
        if (parent.extensions[name].exists() && model_.isRequired(name))
            return false;
    const auto fallback = stored(parent.buffer, parent.byteOffset, parent.byteLength, what);
    const auto here = bytes(view, what);
    return !std::equal(here.begin(), here.end(), fallback.begin(), fallback.end());
}

std::span<const uint8_t> BufferViews::bytes(int view, const std::string &what) const
{
    const std::string name = what + ": buffer view " + std::to_string(view);
    if (view < 0 || static_cast<size_t>(view) >= model_.bufferViews.size())
        throw GltfError(name + " does not exist");
    const gltf_json::BufferView &range = model_.bufferViews[static_cast<size_t>(view)];
    if (isCompressed(range))
        return decompressed(view, name);
    return stored(range.buffer, range.byteOffset, range.byteLength, name);
}

namespace
{

// An accessor without a buffer view is all zeros, except its sparse elements. The limit keeps small files from
// requesting a lot of memory.
constexpr size_t kMostZeros = size_t{1} << 22;

const gltf_json::Accessor &accessorAt(const gltf_json::Model &model, int index, const std::string &what)
{
    if (index < 0 || static_cast<size_t>(index) >= model.accessors.size())
        throw GltfError(what + ": accessor " + std::to_string(index) + " does not exist");
    return model.accessors[static_cast<size_t>(index)];
}

// glTF 2.0, 3.6.2.2 ("Accessor Data Types"). isExtended: signed integers of 32 bits, which only
// EXT_mesh_opacity_micromap has, are a type as well.
size_t componentBytes(int type, const std::string &what, bool isExtended = false)
{
    if (gltf_json::bytesOf(type) == 0 || (type == gltf_json::kInt && !isExtended))
        throw GltfError(what + ": component type " + std::to_string(type) + " does not exist in glTF");
    return gltf_json::bytesOf(type);
}

// Elements one after another, `stride` bytes apart.
struct Elements {
    const uint8_t *first = nullptr;
    size_t count = 0;
    size_t stride = 0;
    const uint8_t *operator[](size_t i) const { return first + i * stride; }
};

// Elements of `packed` bytes in a buffer view. `name` is the accessor's, for messages.
Elements elementsIn(std::span<const uint8_t> bytes, size_t offset, size_t count, size_t stride, size_t packed,
                    const std::string &name)
{
    if (count == 0)
        return {nullptr, 0, packed};
    // In this order no sum can overflow.
    const bool fits = stride >= packed && offset <= bytes.size() && packed <= bytes.size() - offset &&
                      count - 1 <= (bytes.size() - offset - packed) / stride;
    if (!fits)
        throw GltfError(name + " reaches outside of its buffer view");
    return {bytes.data() + offset, count, stride};
}

class AccessorReader
{
public:
    // Requires `components` components; 0: any number. isExtended: as of componentBytes.
    AccessorReader(const BufferViews &views, int index, uint32_t components, const std::string &what,
                   bool isExtended = false);

    [[nodiscard]] size_t count() const { return elements_.count; }
    [[nodiscard]] bool isInteger() const { return source_.componentType != gltf_json::kFloat; }
    [[nodiscard]] bool normalized() const { return source_.normalized; }

    // Component `c` of every element, or all of them where it is `kAll`.
    static constexpr uint32_t kAll = 0xffffffff;
    [[nodiscard]] std::vector<float> floats(uint32_t c) const;
    [[nodiscard]] std::vector<uint32_t> indices() const;
    // readMicromapIndices() for components of type T.
    template <typename T>
    [[nodiscard]] std::vector<int64_t> micromapIndices() const;

private:
    void readSparse(const BufferViews &views, size_t packed);
    [[nodiscard]] size_t strideOf(int view, size_t packed) const;
    template <typename T, typename Value>
    std::vector<float> converted(uint32_t c, Value value) const;
    template <typename T>
    std::vector<float> integersConverted(uint32_t c) const;

    const gltf_json::Model &model_;
    const gltf_json::Accessor &source_;
    std::string what_;
    std::string name_; // "... accessor 3"
    uint32_t components_;
    Elements elements_;
    std::vector<uint8_t> own_; // a sparse accessor's elements, put together
};

AccessorReader::AccessorReader(const BufferViews &views, int index, uint32_t wanted, const std::string &what,
                               bool isExtended)
    : model_(views.model()), source_(accessorAt(model_, index, what)), what_(what),
      name_(what + ": accessor " + std::to_string(index))
{
    components_ = source_.components;
    if (wanted != 0 && components_ != wanted)
        throw GltfError(name_ + " has the wrong type");
    const size_t packed = componentBytes(source_.componentType, name_, isExtended) * components_;
    const uint64_t numbers = uint64_t{source_.count} * components_;
    if (source_.bufferView >= 0) {
        const auto bytes = views.bytes(source_.bufferView, what_); // first: then there is such a view
        elements_ =
            elementsIn(bytes, source_.byteOffset, source_.count, strideOf(source_.bufferView, packed), packed, name_);
        views.countRead(numbers, name_);
    } else {
        if (source_.count > kMostZeros)
            throw GltfError(name_ + " has " + std::to_string(source_.count) + " elements and no buffer view");
        views.countRead(kZeroWeight * numbers, name_);
        own_.resize(source_.count * packed);
        elements_ = {own_.data(), source_.count, packed};
    }
    if (source_.sparse)
        readSparse(views, packed);
}

size_t AccessorReader::strideOf(int view, size_t packed) const
{
    const size_t declared = model_.bufferViews[static_cast<size_t>(view)].byteStride;
    return declared != 0 ? declared : packed;
}

// glTF 2.0, 3.6.2.3 ("Sparse Accessors").
void AccessorReader::readSparse(const BufferViews &views, size_t packed)
{
    const gltf_json::Accessor::Sparse &sparse = *source_.sparse;
    const std::string name = name_ + " (sparse)";
    if (sparse.count > count())
        throw GltfError(name + " replaces " + std::to_string(sparse.count) + " of " + std::to_string(count()) +
                        " elements");
    const size_t indexBytes = componentBytes(sparse.indicesType, name);
    const Elements places = elementsIn(views.bytes(sparse.indices, what_), sparse.indicesOffset, sparse.count,
                                       indexBytes, indexBytes, name);
    const Elements values =
        elementsIn(views.bytes(sparse.values, what_), sparse.valuesOffset, sparse.count, packed, packed, name);
    if (source_.bufferView >= 0) {
        own_.resize(count() * packed);
        for (size_t i = 0; i < count(); ++i)
            std::memcpy(&own_[i * packed], elements_[i], packed);
        elements_ = {own_.data(), count(), packed};
    }
    size_t next = 0; // no index may be below this
    for (size_t i = 0; i < sparse.count; ++i) {
        size_t place = 0;
        switch (sparse.indicesType) {
        case gltf_json::kUnsignedByte: place = *places[i]; break;
        case gltf_json::kUnsignedShort: place = load<uint16_t>(places[i]); break;
        case gltf_json::kUnsignedInt: place = load<uint32_t>(places[i]); break;
        default: throw GltfError(name + ": indices are not unsigned integers");
        }
        if (place >= count())
            throw GltfError(name + " replaces element " + std::to_string(place) + " of " + std::to_string(count()));
        if (place < next)
            throw GltfError(name + ": indices do not increase");
        next = place + 1;
        std::memcpy(&own_[place * packed], values[i], packed);
    }
}

template <typename T, typename Value>
std::vector<float> AccessorReader::converted(uint32_t c, Value value) const
{
    const uint32_t first = c == kAll ? 0 : c;
    const uint32_t last = c == kAll ? components_ : c + 1;
    std::vector<float> values;
    values.reserve(count() * (last - first));
    for (size_t i = 0; i < count(); ++i)
        for (uint32_t k = first; k < last; ++k)
            values.push_back(value(load<T>(elements_[i] + k * sizeof(T))));
    return values;
}

// glTF 2.0, 3.6.2.2: a normalized integer c is c / 255 or c / 65535, a signed one max(c / 127, -1) or
// max(c / 32767, -1).
template <typename T>
std::vector<float> AccessorReader::integersConverted(uint32_t c) const
{
    if (!source_.normalized)
        return converted<T>(c, [](T value) { return static_cast<float>(value); });
    constexpr float kLargest = static_cast<float>(std::numeric_limits<T>::max());
    return converted<T>(c, [](T value) { return std::max(static_cast<float>(value) / kLargest, -1.0f); });
}

std::vector<float> AccessorReader::floats(uint32_t c) const
{
    switch (source_.componentType) {
    case gltf_json::kByte: return integersConverted<int8_t>(c);
    case gltf_json::kUnsignedByte: return integersConverted<uint8_t>(c);
    case gltf_json::kShort: return integersConverted<int16_t>(c);
    case gltf_json::kUnsignedShort: return integersConverted<uint16_t>(c);
    case gltf_json::kFloat: return converted<float>(c, [](float value) { return value; });
    default: throw GltfError(name_ + ": 32-bit integers are for indices only");
    }
}

std::vector<uint32_t> AccessorReader::indices() const
{
    std::vector<uint32_t> values;
    values.reserve(count());
    for (size_t i = 0; i < count(); ++i) {
        const uint8_t *element = elements_[i];
        switch (source_.componentType) {
        case gltf_json::kUnsignedByte: values.push_back(*element); break;
        case gltf_json::kUnsignedShort: values.push_back(load<uint16_t>(element)); break;
        case gltf_json::kUnsignedInt: values.push_back(load<uint32_t>(element)); break;
        default: throw GltfError(what_ + ": indices are not unsigned integers");
        }
    }
    return values;
}

template <typename T>
std::vector<int64_t> AccessorReader::micromapIndices() const
{
    if (source_.bufferView >= 0) {
        const size_t begin = model_.bufferViews[static_cast<size_t>(source_.bufferView)].byteOffset;
        if ((begin + source_.byteOffset) % sizeof(T) != 0 || strideOf(source_.bufferView, sizeof(T)) % sizeof(T) != 0)
            throw GltfError(name_ + " is not aligned to its component type");
    }
    std::vector<int64_t> values;
    values.reserve(count());
    for (size_t i = 0; i < count(); ++i) {
        const T value = load<T>(elements_[i]);
        const bool isSpecial = std::is_unsigned_v<T> && value > std::numeric_limits<T>::max() - 4;
        values.push_back(isSpecial ? int64_t{value} - std::numeric_limits<T>::max() - 1 : int64_t{value});
    }
    return values;
}

} // namespace

std::vector<float> readFloats(const BufferViews &views, int accessor, uint32_t components, const std::string &what)
{
    return AccessorReader(views, accessor, components, what).floats(AccessorReader::kAll);
}

std::vector<float> readAlphas(const BufferViews &views, int accessor, const std::string &what)
{
    if (accessorAt(views.model(), accessor, what).components == 3)
        return {};
    const AccessorReader reader(views, accessor, 4, what);
    // glTF 2.0, 3.7.2.1: colours are floats or normalized integers.
    if (reader.isInteger() && !reader.normalized())
        throw GltfError(what + ": integers that are not normalized are no colours");
    return reader.floats(3);
}

std::vector<uint32_t> readIndices(const BufferViews &views, int accessor, const std::string &what)
{
    return AccessorReader(views, accessor, 1, what).indices();
}

std::vector<int64_t> readMicromapIndices(const BufferViews &views, int accessor, const std::string &what)
{
    const gltf_json::Accessor &source = accessorAt(views.model(), accessor, what);
    const auto read = [&]<typename T>(T) {
        return AccessorReader(views, accessor, 1, what, true).micromapIndices<T>();
    };
    const bool isScalar = source.components == 1 && !source.normalized;
    switch (isScalar ? source.componentType : gltf_json::kFloat) {
    case gltf_json::kUnsignedByte: return read(uint8_t{});
    case gltf_json::kUnsignedShort: return read(uint16_t{});
    case gltf_json::kUnsignedInt: return read(uint32_t{});
    case gltf_json::kShort: return read(int16_t{});
    case gltf_json::kInt: return read(int32_t{});
    default:
        throw GltfError(what + ": accessor " + std::to_string(accessor) +
                        " is not SCALAR of type 5121, 5122, 5123, 5124 or 5125");
    }
}

size_t countElements(const BufferViews &views, int accessor, const std::string &what)
{
    return AccessorReader(views, accessor, 0, what).count();
}

size_t accessorCount(const gltf_json::Model &model, int accessor, const std::string &what)
{
    return accessorAt(model, accessor, what).count;
}

std::optional<size_t> declaredTriangles(const gltf_json::Model &model, const gltf_json::Primitive &primitive)
{
    if (primitive.indices >= 0)
        return accessorCount(model, primitive.indices, "indices") / 3;
    const int positions = primitive.attribute("POSITION");
    if (positions < 0)
        return std::nullopt;
    return accessorCount(model, positions, "POSITION") / 3;
}

} // namespace vellum
