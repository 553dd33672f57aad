#include "read_everything.h"

#include "gltf/file/tinygltf.h"
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

void readParts(const Document &document, Reading &reading)
{
    const auto count = [](const auto &list) { return static_cast<int>(list.size()); };
    for (const PrimitivePlace place : trianglePrimitives(document)) {
        reading.primitives += attempt(reading, [&] {
            static_cast<void>(triangleUvs(readPrimitive(document, place, Positions::Leave)));
            static_cast<void>(readPrimitive(document, place, Positions::Read));
        });
    }
    for (int i = 0; i < count(document.model().images); ++i)
        reading.images += attempt(reading, [&] { static_cast<void>(readImage(document, i)); });
    for (int i = -1; i < count(document.model().materials); ++i)
        attempt(reading, [&] { static_cast<void>(readMaterial(document, i)); });
    static_cast<void>(findMicromapOffences(document));
    attempt(reading, [&] {
        const StoredMicromaps stored = readMicromaps(document);
        for (const auto &[place, micromap] : stored.primitives)
            static_cast<void>(stored.of(place));
    });
}

} // namespace

Reading readEverything(const std::filesystem::path &path)
{
    Reading reading;
    if (!attempt(reading, [&] { readParts(Document(path), reading); }))
        return reading;
    attempt(reading, [&] { static_cast<void>(readGltf(path)); });
    return reading;
}

} // namespace vellum::test
