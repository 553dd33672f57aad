// SPDX-License-Identifier: Apache-2.0
#include "read_everything.h"

#include <cstring>
#include <new>
#include <stdexcept>

#include "gltf/file/json_tree.h"
#include "gltf/micromaps/document_writer.h"
#include "gltf/micromaps/stored_micromaps.h"
#include "gltf/primitive.h"
#include "gltf/scene.h"

namespace vellum::test
{
namespace
{

template <typename Read>
bool attempt(Reading &reading, Read &&read)
{
    try {
        read();
        return true;
    } catch (const GltfUnsupported &error) {
        if (reading.unsupported.empty())
            reading.unsupported = error.what();
    } catch (const GltfError &error) {
        if (reading.error.empty())
            reading.error = error.what();
    }
    return false;
}

// Adds micromaps to the file and, if it has some, removes them. The JSON of a result that can be written can be read.
void rewrite(const Document &document, const DocumentBake &bake)
{
    RewrittenFile written;
    try {
        written = withMicromaps(document, bake, "micromaps");
    } catch (const GltfError &) {
        return; // it would be too large
    }
    std::vector<uint8_t> bytes;
    for (const auto &piece : written.file.pieces())
        bytes.insert(bytes.end(), piece.begin(), piece.end());
    std::string_view json(reinterpret_cast<const char *>(bytes.data()), bytes.size());
    if (document.binary()) {
        uint32_t length = 0;
        std::memcpy(&length, bytes.data() + 12, sizeof length);
        json = json.substr(20, length);
    }
    try {
        const JsonTree tree(json);
        if (tree.root()["extensions"]["EXT_mesh_opacity_micromap"].exists() != !bake.micromaps.empty())
            throw std::logic_error("the micromaps of " + document.path().string() + " were not replaced");
    } catch (const GltfError &error) {
        throw std::logic_error(document.path().string() + " was written wrongly: " + error.what());
    }
}

void rewriteBothWays(const Document &document)
{
    DocumentBake bake;
    rewrite(document, bake);
    bake.micromaps.push_back({{{0, 0, Format::FourState}}, {3}, {{1, 0, Format::FourState}}});
    for (const PrimitivePlace place : trianglePrimitives(document))
        bake.primitives.push_back({place, "", "", {0, {0, -1}, 0}, {0, 1, 2}, 0, ""});
    rewrite(document, bake);
}

void readParts(const Document &document, Reading &reading)
{
    const auto count = [](const auto &list) { return static_cast<int>(list.size()); };
    for (const PrimitivePlace place : trianglePrimitives(document)) {
        reading.primitives += attempt(reading, [&] {
            static_cast<void>(triangleUvs(readPrimitive(document, place, Positions::Skip)));
            static_cast<void>(readPrimitive(document, place, Positions::Read));
        });
    }
    for (int i = 0; i < count(document.model().images); ++i)
        reading.images += attempt(reading, [&] { static_cast<void>(readImage(document, i)); });
    for (int i = -1; i < count(document.model().materials); ++i)
        attempt(reading, [&] { static_cast<void>(readMaterial(document, i)); });
    static_cast<void>(checkMicromaps(document));
    attempt(reading, [&] {
        const StoredMicromaps stored = readMicromaps(document);
        for (const auto &[place, micromap] : stored.primitives)
            static_cast<void>(stored.of(place));
    });
    rewriteBothWays(document);
}

} // namespace

Reading readEverything(const std::filesystem::path &path)
{
    Reading reading;
    if (!attempt(reading, [&] { readParts(Document(path), reading); }))
        return reading;
    // Many uses of an accessor, each of which is read above, may be a scene that is larger than the limits of a test.
    attempt(reading, [&] {
        try {
            static_cast<void>(readGltf(path));
        } catch (const std::bad_alloc &) {
            throw GltfError(path.string() + ": out of memory");
        }
    });
    return reading;
}

} // namespace vellum::test
