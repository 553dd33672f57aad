// SPDX-License-Identifier: Apache-2.0
#include "cli/renderer/state_table.h"

#include <cstring>

namespace vellum::cli
{
namespace
{

struct Entry {
    uint32_t first = 0;
    uint32_t second = kStatesNone;
};

Entry entryOf(const Micromap &micromap, size_t triangle, uint32_t firstByte)
{
    const int32_t index = micromap.indices[triangle];
    if (const auto state = specialState(index))
        return {static_cast<uint32_t>(*state), kStatesOne};
    const MicromapTriangle &t = micromap.triangles[static_cast<uint32_t>(index) + micromap.baseTriangle];
    return {firstByte + t.dataOffset,
            kStatesData | t.subdivisionLevel | (t.format == Format::TwoState ? kStatesTwo : 0)};
}

} // namespace

std::vector<uint32_t> makeStateTable(const RenderScene &scene, std::span<const Micromap *const> micromaps)
{
    std::vector<uint32_t> table(kStateColors.begin(), kStateColors.end());
    const size_t triangles = scene.normals.size() / 3;
    table.resize(table.size() + 2 * triangles, 0);
    for (size_t i = 0; i < micromaps.size(); ++i) {
        if (micromaps[i] == nullptr)
            continue;
        const Micromap &micromap = *micromaps[i];
        const size_t firstWord = table.size();
        table.resize(firstWord + (micromap.data.size() + 3) / 4, 0);
        if (!micromap.data.empty())
            std::memcpy(table.data() + firstWord, micromap.data.data(), micromap.data.size());
        for (size_t t = 0; t < micromap.indices.size(); ++t) {
            const Entry entry = entryOf(micromap, t, static_cast<uint32_t>(4 * firstWord));
            const size_t at = kStateColors.size() + 2 * (scene.records[i].firstTriangle + t);
            table[at] = entry.first;
            table[at + 1] = entry.second;
        }
    }
    return table;
}

} // namespace vellum::cli
