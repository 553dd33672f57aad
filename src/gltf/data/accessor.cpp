// SPDX-License-Identifier: Apache-2.0
#include "gltf/data/accessor.h"

#include <algorithm>
#include <cstring>
#include <limits>

#include "gltf/file/gltf_error.h"

namespace vellum
{
namespace
{

// An accessor without a buffer view is all zeros, except its sparse elements. The limit keeps small files from
// requesting a lot of memory.
constexpr size_t kMostZeros = size_t{1} << 22;

template <typename T>
T load(const uint8_t *bytes)
{
    T value;
    std::memcpy(&value, bytes, sizeof value);
    return value;
}

const gltf_json::Accessor &accessorAt(const gltf_json::Model &model, int index, const std::string &what)
{
    if (index < 0 || static_cast<size_t>(index) >= model.accessors.size())
        throw GltfError(what + ": accessor " + std::to_string(index) + " does not exist");
    return model.accessors[static_cast<size_t>(index)];
}

// glTF 2.0, 3.6.2.2 ("Accessor Data Types").
size_t componentBytes(int type, const std::string &what)
{
    if (type == gltf_json::kInt || gltf_json::bytesOf(type) == 0)
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
    // Requires `components` components; 0: any number.
    AccessorReader(const BufferViews &views, int index, uint32_t components, const std::string &what);

    [[nodiscard]] size_t count() const { return elements_.count; }
    [[nodiscard]] bool isInteger() const { return source_.componentType != gltf_json::kFloat; }
    [[nodiscard]] bool normalized() const { return source_.normalized; }

    // Component `c` of every element, or all of them where it is `kAll`.
    static constexpr uint32_t kAll = 0xffffffff;
    [[nodiscard]] std::vector<float> floats(uint32_t c) const;
    [[nodiscard]] std::vector<uint32_t> indices() const;

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

AccessorReader::AccessorReader(const BufferViews &views, int index, uint32_t wanted, const std::string &what)
    : model_(views.model()), source_(accessorAt(model_, index, what)), what_(what),
      name_(what + ": accessor " + std::to_string(index))
{
    components_ = source_.components;
    if (wanted != 0 && components_ != wanted)
        throw GltfError(name_ + " has the wrong type");
    const size_t packed = componentBytes(source_.componentType, name_) * components_;
    const auto countRead = [&] { views.countRead(uint64_t{source_.count} * components_, name_); };
    if (source_.bufferView >= 0) {
        const auto bytes = views.bytes(source_.bufferView, what_); // first: then there is such a view
        elements_ =
            elementsIn(bytes, source_.byteOffset, source_.count, strideOf(source_.bufferView, packed), packed, name_);
        countRead();
    } else {
        if (source_.count > kMostZeros)
            throw GltfError(name_ + " has " + std::to_string(source_.count) + " elements and no buffer view");
        countRead();
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

size_t countElements(const BufferViews &views, int accessor, const std::string &what)
{
    return AccessorReader(views, accessor, 0, what).count();
}

size_t accessorCount(const gltf_json::Model &model, int accessor, const std::string &what)
{
    return accessorAt(model, accessor, what).count;
}

} // namespace vellum
