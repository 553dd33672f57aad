// SPDX-License-Identifier: Apache-2.0
#include "cli/bake/exclusions.h"

#include <algorithm>
#include <cstdio>

#include "gltf/micromaps/name_pattern.h"

namespace vellum::cli
{

void UnmatchedExclusions::note(const Document &document)
{
    const std::lock_guard lock(noting_);
    const auto eraseMatched = [](std::vector<std::string> &patterns, const auto &named) {
        std::erase_if(patterns, [&](const std::string &pattern) {
            return std::ranges::any_of(named, [&](const auto &one) { return matchesPattern(one.name, pattern); });
        });
    };
    eraseMatched(materials_, document.model().materials);
    eraseMatched(meshes_, document.model().meshes);
}

void UnmatchedExclusions::print() const
{
    for (const std::string &pattern : materials_)
        std::fprintf(stderr, "vellum: --exclude-material %s matches no material\n", pattern.c_str());
    for (const std::string &pattern : meshes_)
        std::fprintf(stderr, "vellum: --exclude-mesh %s matches no mesh\n", pattern.c_str());
}

} // namespace vellum::cli
