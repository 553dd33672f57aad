// SPDX-License-Identifier: Apache-2.0
#include "gltf/micromaps/changing_alpha.h"

#include <charconv>

namespace vellum
{
namespace
{

// The material that a pointer of KHR_animation_pointer leads to, if it changes alpha or where it is read.
std::optional<int> changedMaterial(const std::string &pointer)
{
    constexpr std::string_view kMaterials = "/materials/";
    if (!pointer.starts_with(kMaterials))
        return std::nullopt;
    int material = -1;
    const char *end = pointer.data() + pointer.size();
    const auto read = std::from_chars(pointer.data() + kMaterials.size(), end, material);
    if (read.ec != std::errc())
        return std::nullopt;
    const std::string_view rest(read.ptr, static_cast<size_t>(end - read.ptr));
    if (rest.find("alphaCutoff") == std::string_view::npos && rest.find("baseColor") == std::string_view::npos)
        return std::nullopt;
    return material;
}

} // namespace

ChangingAlpha::ChangingAlpha(const Document &document) : document_(document)
{
    const auto &materials = document.model().materials;
    for (size_t i = 0; i < materials.size(); ++i) {
        const JsonValue &extensions = materials[i].extensions;
        if (extensions["KHR_materials_pbrSpecularGlossiness"].exists())
            materials_[static_cast<int>(i)] = "its alpha comes from KHR_materials_pbrSpecularGlossiness";
        else if (extensions["MSFT_lod"].exists())
            materials_[static_cast<int>(i)] = "its material can be changed (MSFT_lod)";
    }
    for (const JsonValue &animation : document.root()["animations"].children())
        for (const JsonValue &channel : animation["channels"].children()) {
            const auto pointer = channel["target"]["extensions"]["KHR_animation_pointer"]["pointer"].string();
            if (const auto material = changedMaterial(pointer.value_or("")))
                materials_[*material] = "its material's alpha is animated (KHR_animation_pointer)";
        }
}

std::optional<std::string> ChangingAlpha::reason(PrimitivePlace place) const
{
    const gltf_json::Primitive &primitive = document_.model().meshes.at(place.mesh).primitives.at(place.primitive);
    if (const auto found = materials_.find(primitive.material); found != materials_.end())
        return found->second;
    for (const JsonValue &mapping : primitive.extensions["KHR_materials_variants"]["mappings"].children())
        if (mapping.isObject() && mapping["material"].integer() != primitive.material)
            return "its material can be changed (KHR_materials_variants)";
    return std::nullopt;
}

} // namespace vellum
