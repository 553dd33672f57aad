#include "gltf/data/accessor.h"

#include <cstring>

#include "gltf/file/gltf_error.h"
#include "gltf/file/tinygltf.h"

namespace vellum
{
namespace
{

struct Elements {
    const std::uint8_t *first;
    std::size_t count;
    std::size_t stride;
    int componentType;
    bool normalized;
};

const tinygltf::Accessor &accessorAt(const tinygltf::Model &model, int index, const std::string &what)
{
    if (index < 0 || static_cast<std::size_t>(index) >= model.accessors.size())
        throw GltfError(what + ": accessor " + std::to_string(index) + " does not exist");
    return model.accessors[static_cast<std::size_t>(index)];
}

Elements findElements(const tinygltf::Model &model, int index, std::uint32_t components, const std::string &what)
{
    const tinygltf::Accessor &accessor = accessorAt(model, index, what);
    if (accessor.sparse.isSparse)
        throw GltfError(what + ": sparse accessors are not supported");
    const int found = tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(accessor.type));
    const int componentBytes = tinygltf::GetComponentSizeInBytes(static_cast<std::uint32_t>(accessor.componentType));
    if (componentBytes <= 0 || found != static_cast<int>(components))
        throw GltfError(what + ": accessor " + std::to_string(index) + " has the wrong type");
    const auto bytes = readBufferView(model, accessor.bufferView, what);
    const std::size_t packed = static_cast<std::size_t>(componentBytes) * components;
    const std::size_t declared = model.bufferViews[static_cast<std::size_t>(accessor.bufferView)].byteStride;
    const std::size_t stride = declared != 0 ? declared : packed;
    // In this order no sum can wrap around.
    const bool fits =
        accessor.count == 0 ||
        (stride >= packed && accessor.byteOffset <= bytes.size() && packed <= bytes.size() - accessor.byteOffset &&
         (accessor.count - 1) <= (bytes.size() - accessor.byteOffset - packed) / stride);
    if (!fits)
        throw GltfError(what + ": accessor " + std::to_string(index) + " reaches outside of its buffer view");
    return {bytes.data() + (accessor.count == 0 ? 0 : accessor.byteOffset), accessor.count, stride,
            accessor.componentType, accessor.normalized};
}

template <typename T>
T load(const std::uint8_t *bytes)
{
    T value;
    std::memcpy(&value, bytes, sizeof value);
    return value;
}

float toFloat(const Elements &elements, const std::uint8_t *element, std::uint32_t component, const std::string &what)
{
    if (elements.componentType == TINYGLTF_COMPONENT_TYPE_FLOAT)
        return load<float>(element + 4 * component);
    if (elements.normalized && elements.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE)
        return static_cast<float>(element[component]) / 255.0f;
    if (elements.normalized && elements.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT)
        return static_cast<float>(load<std::uint16_t>(element + 2 * component)) / 65535.0f;
    if (elements.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE)
        return static_cast<float>(element[component]);
    if (elements.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT)
        return static_cast<float>(load<std::uint16_t>(element + 2 * component));
    throw GltfError(what + ": component type " + std::to_string(elements.componentType) + " is not supported");
}

} // namespace

std::span<const std::uint8_t> readBufferView(const tinygltf::Model &model, int view, const std::string &what)
{
    if (view < 0 || static_cast<std::size_t>(view) >= model.bufferViews.size())
        throw GltfError(what + ": buffer view " + std::to_string(view) + " does not exist");
    const tinygltf::BufferView &range = model.bufferViews[static_cast<std::size_t>(view)];
    if (range.buffer < 0 || static_cast<std::size_t>(range.buffer) >= model.buffers.size())
        throw GltfError(what + ": buffer " + std::to_string(range.buffer) + " does not exist");
    const std::vector<unsigned char> &data = model.buffers[static_cast<std::size_t>(range.buffer)].data;
    if (range.byteOffset > data.size() || range.byteLength > data.size() - range.byteOffset)
        throw GltfError(what + ": buffer view " + std::to_string(view) + " reaches outside of its buffer");
    return {data.data() + range.byteOffset, range.byteLength};
}

std::size_t accessorCount(const tinygltf::Model &model, int accessor, const std::string &what)
{
    return accessorAt(model, accessor, what).count;
}

std::vector<float> readAlphas(const tinygltf::Model &model, int accessor, const std::string &what)
{
    if (accessorAt(model, accessor, what).type == TINYGLTF_TYPE_VEC3)
        return {};
    const std::vector<float> colors = readFloats(model, accessor, 4, what);
    std::vector<float> alphas;
    for (std::size_t i = 3; i < colors.size(); i += 4)
        alphas.push_back(colors[i]);
    return alphas;
}

std::vector<float> readFloats(const tinygltf::Model &model, int accessor, std::uint32_t components,
                              const std::string &what)
{
    const Elements elements = findElements(model, accessor, components, what);
    std::vector<float> values;
    values.reserve(elements.count * components);
    for (std::size_t i = 0; i < elements.count; ++i)
        for (std::uint32_t c = 0; c < components; ++c)
            values.push_back(toFloat(elements, elements.first + i * elements.stride, c, what));
    return values;
}

std::vector<std::uint32_t> readIndices(const tinygltf::Model &model, int accessor, const std::string &what)
{
    const Elements elements = findElements(model, accessor, 1, what);
    std::vector<std::uint32_t> values;
    values.reserve(elements.count);
    for (std::size_t i = 0; i < elements.count; ++i) {
        const std::uint8_t *element = elements.first + i * elements.stride;
        switch (elements.componentType) {
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE: values.push_back(*element); break;
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT: values.push_back(load<std::uint16_t>(element)); break;
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT: values.push_back(load<std::uint32_t>(element)); break;
        default: throw GltfError(what + ": indices are not unsigned integers");
        }
    }
    return values;
}

} // namespace vellum
