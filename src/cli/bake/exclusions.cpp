// SPDX-License-Identifier: Apache-2.0
#include "cli/bake/exclusions.h"

#include <cstdio>

#include "gltf/micromaps/name_pattern.h"
#include "gltf/primitive.h"

namespace vellum::cli
{

void UnmatchedExclusions::note(const Document &document)
{
    const std::lock_guard lock(noting_);
    const auto eraseMatched = [](std::vector<std::string> &patterns, const std::string &name) {
        std::erase_if(patterns, [&](const std::string &pattern) { return matchesPattern(name, pattern); });
    };
    const gltf_json::Model &model = document.model();
    for (size_t i = 0; i < model.materials.size(); ++i)
        eraseMatched(materials_, materialName(model, i));
    for (const gltf_json::Mesh &mesh : model.meshes)
        eraseMatched(meshes_, mesh.name);
}

void UnmatchedExclusions::noteUnread()
{
    const std::lock_guard lock(noting_);
    materials_.clear();
    meshes_.clear();
}

void UnmatchedExclusions::print() const
{
    for (const std::string &pattern : materials_)
        std::fprintf(stderr, "vellum: --exclude-material %s matches no material\n", pattern.c_str());
    for (const std::string &pattern : meshes_)
        std::fprintf(stderr, "vellum: --exclude-mesh %s matches no mesh\n", pattern.c_str());
}

} // namespace vellum::cli
