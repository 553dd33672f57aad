// SPDX-License-Identifier: Apache-2.0
#include "gltf/micromaps/stored_micromaps.h"

#include <algorithm>

#include "gltf/micromaps/extension_reader.h"

namespace vellum
{

std::optional<std::string> lossOfMicromaps(const Document &document)
{
    return document.named([&] { return ExtensionReader(document, 1).loss(); });
}

CheckedMicromaps checkMicromaps(const Document &document, size_t most)
{
    return document.named([&] {
        ExtensionReader reader(document, most);
        StoredMicromaps stored = reader.read();
        return CheckedMicromaps{std::move(stored), reader.takeFindings()};
    });
}

StoredMicromaps readMicromaps(const Document &document)
{
    return document.named([&] {
        CheckedMicromaps checked = checkMicromaps(document, 1);
        for (const MicromapFinding &finding : checked.findings)
            throw GltfError(finding.place + ": " + finding.message);
        return std::move(checked.stored);
    });
}

bool hasMicromapExtension(const JsonValue &extensions)
{
    return std::any_of(kMicromapExtensions.begin(), kMicromapExtensions.end(),
                       [&](const char *name) { return extensions[name].exists(); });
}

bool StoredMicromap::isApproximate() const
{
    return std::all_of(triangles.begin(), triangles.end(),
                       [](const MicromapTriangle &triangle) { return triangle.format == Format::TwoState; });
}

std::optional<Micromap> StoredMicromaps::of(PrimitivePlace place) const
{
    const auto found = primitives.find(place);
    if (found == primitives.end())
        return std::nullopt;
    const PrimitiveMicromap &primitive = found->second;
    const StoredMicromap &source = micromaps[primitive.micromap];
    // The triangles of the source that are used, in their order there.
    std::vector<uint32_t> used;
    for (const int32_t index : primitive.indices)
        if (index >= 0)
            used.push_back(static_cast<uint32_t>(index) + primitive.baseTriangle);
    std::sort(used.begin(), used.end());
    used.erase(std::unique(used.begin(), used.end()), used.end());
    Micromap micromap;
    for (const uint32_t triangle : used) {
        MicromapTriangle copy = source.triangles[triangle];
        const auto begin = source.data.begin() + static_cast<ptrdiff_t>(copy.dataOffset);
        const auto end = begin + static_cast<ptrdiff_t>(packedBytes(copy.subdivisionLevel, copy.format));
        copy.dataOffset = static_cast<uint32_t>(micromap.data.size());
        micromap.data.insert(micromap.data.end(), begin, end);
        micromap.triangles.push_back(copy);
    }
    for (const int32_t index : primitive.indices) {
        const auto triangle = static_cast<uint32_t>(index) + primitive.baseTriangle;
        micromap.indices.push_back(
            index < 0 ? index
                      : static_cast<int32_t>(std::lower_bound(used.begin(), used.end(), triangle) - used.begin()));
    }
    return micromap;
}

} // namespace vellum
