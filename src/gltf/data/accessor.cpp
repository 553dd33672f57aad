#include "gltf/data/accessor.h"

#include <algorithm>
#include <cstring>
#include <limits>

#include "gltf/file/gltf_error.h"

namespace vellum
{
namespace
{

// An accessor without a buffer view is all zeros (but for its sparse elements), however many it says it has: more than
// this is a small file that asks for a lot of memory.
constexpr std::size_t kMostZeros = std::size_t{1} << 22;

template <typename T>
T load(const std::uint8_t *bytes)
{
    T value;
    std::memcpy(&value, bytes, sizeof value);
    return value;
}

const gltf_json::Accessor &accessorAt(const gltf_json::Model &model, int index, const std::string &what)
{
    if (index < 0 || static_cast<std::size_t>(index) >= model.accessors.size())
        throw GltfError(what + ": accessor " + std::to_string(index) + " does not exist");
    return model.accessors[static_cast<std::size_t>(index)];
}

// glTF 2.0, 3.6.2.2 ("Accessor Data Types").
std::size_t componentBytes(int type, const std::string &what)
{
    if (type == gltf_json::kInt || gltf_json::bytesOf(type) == 0)
        throw GltfError(what + ": component type " + std::to_string(type) + " is none of glTF's");
    return gltf_json::bytesOf(type);
}

// Elements one after another, `stride` bytes apart.
struct Elements {
    const std::uint8_t *first = nullptr;
    std::size_t count = 0;
    std::size_t stride = 0;
    const std::uint8_t *operator[](std::size_t i) const { return first + i * stride; }
};

// Elements of `packed` bytes in a buffer view. `name` is the accessor's, for messages.
Elements elementsIn(std::span<const std::uint8_t> bytes, std::size_t offset, std::size_t count, std::size_t stride,
                    std::size_t packed, const std::string &name)
{
    if (count == 0)
        return {nullptr, 0, packed};
    // In this order no sum can wrap around.
    const bool fits = stride >= packed && offset <= bytes.size() && packed <= bytes.size() - offset &&
                      count - 1 <= (bytes.size() - offset - packed) / stride;
    if (!fits)
        throw GltfError(name + " reaches outside of its buffer view");
    return {bytes.data() + offset, count, stride};
}

class AccessorReader
{
public:
    // With `components` components; with any number where that is 0.
    AccessorReader(const BufferViews &views, int index, std::uint32_t components, const std::string &what);

    [[nodiscard]] std::size_t count() const { return m_elements.count; }
    [[nodiscard]] bool isInteger() const { return m_source.componentType != gltf_json::kFloat; }
    [[nodiscard]] bool normalized() const { return m_source.normalized; }

    // Component `c` of every element, or all of them where it is `kAll`.
    static constexpr std::uint32_t kAll = 0xffffffff;
    [[nodiscard]] std::vector<float> floats(std::uint32_t c) const;
    [[nodiscard]] std::vector<std::uint32_t> indices() const;

private:
    void readSparse(const BufferViews &views, std::size_t packed);
    [[nodiscard]] std::size_t strideOf(int view, std::size_t packed) const;
    template <typename T, typename Value>
    std::vector<float> converted(std::uint32_t c, Value value) const;
    template <typename T>
    std::vector<float> integersConverted(std::uint32_t c) const;

    const gltf_json::Model &m_model;
    const gltf_json::Accessor &m_source;
    std::string m_what;
    std::string m_name; // "... accessor 3"
    std::uint32_t m_components;
    Elements m_elements;
    std::vector<std::uint8_t> m_own; // a sparse accessor's elements, put together
};

AccessorReader::AccessorReader(const BufferViews &views, int index, std::uint32_t wanted, const std::string &what)
    : m_model(views.model()), m_source(accessorAt(m_model, index, what)), m_what(what),
      m_name(what + ": accessor " + std::to_string(index))
{
    m_components = m_source.components;
    if (wanted != 0 && m_components != wanted)
        throw GltfError(m_name + " has the wrong type");
    const std::size_t packed = componentBytes(m_source.componentType, m_name) * m_components;
    if (m_source.bufferView >= 0) {
        const auto bytes = views.bytes(m_source.bufferView, m_what); // first: then there is such a view
        m_elements = elementsIn(bytes, m_source.byteOffset, m_source.count, strideOf(m_source.bufferView, packed),
                                packed, m_name);
    } else {
        if (m_source.count > kMostZeros)
            throw GltfError(m_name + " has " + std::to_string(m_source.count) + " elements and no buffer view");
        m_own.resize(m_source.count * packed);
        m_elements = {m_own.data(), m_source.count, packed};
    }
    if (m_source.sparse)
        readSparse(views, packed);
}

std::size_t AccessorReader::strideOf(int view, std::size_t packed) const
{
    const std::size_t declared = m_model.bufferViews[static_cast<std::size_t>(view)].byteStride;
    return declared != 0 ? declared : packed;
}

// glTF 2.0, 3.6.2.3 ("Sparse Accessors").
void AccessorReader::readSparse(const BufferViews &views, std::size_t packed)
{
    const gltf_json::Accessor::Sparse &sparse = *m_source.sparse;
    const std::string name = m_name + " (sparse)";
    if (sparse.count > count())
        throw GltfError(name + " replaces " + std::to_string(sparse.count) + " of " + std::to_string(count()) +
                        " elements");
    const std::size_t indexBytes = componentBytes(sparse.indicesType, name);
    const Elements places = elementsIn(views.bytes(sparse.indices, m_what), sparse.indicesOffset, sparse.count,
                                       indexBytes, indexBytes, name);
    const Elements values =
        elementsIn(views.bytes(sparse.values, m_what), sparse.valuesOffset, sparse.count, packed, packed, name);
    if (m_source.bufferView >= 0) {
        m_own.resize(count() * packed);
        for (std::size_t i = 0; i < count(); ++i)
            std::memcpy(&m_own[i * packed], m_elements[i], packed);
        m_elements = {m_own.data(), count(), packed};
    }
    std::size_t next = 0; // no index may be below this
    for (std::size_t i = 0; i < sparse.count; ++i) {
        std::size_t place = 0;
        switch (sparse.indicesType) {
        case gltf_json::kUnsignedByte: place = *places[i]; break;
        case gltf_json::kUnsignedShort: place = load<std::uint16_t>(places[i]); break;
        case gltf_json::kUnsignedInt: place = load<std::uint32_t>(places[i]); break;
        default: throw GltfError(name + ": indices are not unsigned integers");
        }
        if (place >= count())
            throw GltfError(name + " replaces element " + std::to_string(place) + " of " + std::to_string(count()));
        if (place < next)
            throw GltfError(name + ": indices do not increase");
        next = place + 1;
        std::memcpy(&m_own[place * packed], values[i], packed);
    }
}

template <typename T, typename Value>
std::vector<float> AccessorReader::converted(std::uint32_t c, Value value) const
{
    const std::uint32_t first = c == kAll ? 0 : c;
    const std::uint32_t last = c == kAll ? m_components : c + 1;
    std::vector<float> values;
    values.reserve(count() * (last - first));
    for (std::size_t i = 0; i < count(); ++i)
        for (std::uint32_t k = first; k < last; ++k)
            values.push_back(value(load<T>(m_elements[i] + k * sizeof(T))));
    return values;
}

// glTF 2.0, 3.6.2.2: a normalized integer c is c / 255 or c / 65535, a signed one max(c / 127, -1) or
// max(c / 32767, -1).
template <typename T>
std::vector<float> AccessorReader::integersConverted(std::uint32_t c) const
{
    if (!m_source.normalized)
        return converted<T>(c, [](T value) { return static_cast<float>(value); });
    constexpr float kLargest = static_cast<float>(std::numeric_limits<T>::max());
    return converted<T>(c, [](T value) { return std::max(static_cast<float>(value) / kLargest, -1.0f); });
}

std::vector<float> AccessorReader::floats(std::uint32_t c) const
{
    switch (m_source.componentType) {
    case gltf_json::kByte: return integersConverted<std::int8_t>(c);
    case gltf_json::kUnsignedByte: return integersConverted<std::uint8_t>(c);
    case gltf_json::kShort: return integersConverted<std::int16_t>(c);
    case gltf_json::kUnsignedShort: return integersConverted<std::uint16_t>(c);
    case gltf_json::kFloat: return converted<float>(c, [](float value) { return value; });
    default: throw GltfError(m_name + ": 32-bit integers are for indices only");
    }
}

std::vector<std::uint32_t> AccessorReader::indices() const
{
    std::vector<std::uint32_t> values;
    values.reserve(count());
    for (std::size_t i = 0; i < count(); ++i) {
        const std::uint8_t *element = m_elements[i];
        switch (m_source.componentType) {
        case gltf_json::kUnsignedByte: values.push_back(*element); break;
        case gltf_json::kUnsignedShort: values.push_back(load<std::uint16_t>(element)); break;
        case gltf_json::kUnsignedInt: values.push_back(load<std::uint32_t>(element)); break;
        default: throw GltfError(m_what + ": indices are not unsigned integers");
        }
    }
    return values;
}

} // namespace

std::vector<float> readFloats(const BufferViews &views, int accessor, std::uint32_t components, const std::string &what)
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

std::vector<std::uint32_t> readIndices(const BufferViews &views, int accessor, const std::string &what)
{
    return AccessorReader(views, accessor, 1, what).indices();
}

std::size_t countElements(const BufferViews &views, int accessor, const std::string &what)
{
    return AccessorReader(views, accessor, 0, what).count();
}

std::size_t accessorCount(const gltf_json::Model &model, int accessor, const std::string &what)
{
    return accessorAt(model, accessor, what).count;
}

} // namespace vellum
