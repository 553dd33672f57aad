#include "cli/inspect/inspected_file.h"

#include <algorithm>
#include <limits>
#include <map>

#include "cli/base/error.h"
#include "cli/base/progress.h"
#include "gltf/micromaps/file_bake.h"

namespace vellum::cli
{
namespace
{

// Of the accessor that a primitive's micromap indices are in. readMicromaps has checked it. Without a file, of what the
// writer of micromaps would make.
std::uint64_t bytesOfIndices(const Document &document, PrimitivePlace place, const StoredMicromaps &stored)
{
    const gltf_json::Model &model = document.model();
    const PrimitiveMicromap &primitive = stored.primitives.at(place);
    const std::size_t count = primitive.indices.size();
    if (stored.extension.empty())
        return count * (stored.micromaps.at(primitive.micromap).triangles.size() <= 0xfffc ? 2 : 4);
    const JsonValue extension = model.meshes.at(place.mesh).primitives.at(place.primitive).extensions[stored.extension];
    const auto accessor = extension["micromapIndices"].integer();
    return accessor ? count * gltf_json::bytesOf(model.accessors.at(static_cast<std::size_t>(*accessor)).componentType)
                    : 0;
}

class Inspector
{
public:
    Inspector(const Document &document, const Selection &selection) : m_document(document), m_selection(selection) {}

    InspectedFile inspect(const DocumentBakeOptions *bake);

private:
    void bakeAll(DocumentBakeOptions options);
    [[nodiscard]] std::string nothingMade() const;
    void addRecords();
    void addPrimitive(PrimitivePlace place, const PrimitiveMicromap &micromap);
    std::uint32_t useMaterial(int index);

    const Document &m_document;
    const Selection &m_selection;
    InspectedFile m_file;
    std::vector<std::uint32_t> m_firstRecord; // of each micromap
    std::map<int, std::uint32_t> m_materials;
    std::map<int, Image> m_images;
};

void Inspector::bakeAll(DocumentBakeOptions options)
{
    m_file.baked = true;
    Progress progress("baking");
    options.bake.progress = [&](std::size_t done, std::size_t total) { progress.update(done, total); };
    DocumentBake bake = bakeDocument(m_document, options);
    m_file.stored.micromaps = std::move(bake.micromaps);
    for (BakedPrimitive &primitive : bake.primitives)
        m_file.stored.primitives[primitive.place] = std::move(primitive.micromap);
    for (LeftPrimitive &left : bake.left)
        m_file.left.push_back({m_document.nameOf(left.place), std::move(left.material), std::move(left.reason)});
}

std::string Inspector::nothingMade() const
{
    if (m_file.left.empty())
        return "no alpha-masked primitive with texture coordinates is in it";
    return "no primitive gets a micromap: " + m_file.left.front().name + ": " + m_file.left.front().reason;
}

void Inspector::addRecords()
{
    for (std::uint32_t m = 0; m < m_file.stored.micromaps.size(); ++m) {
        const StoredMicromap &micromap = m_file.stored.micromaps[m];
        m_firstRecord.push_back(static_cast<std::uint32_t>(m_file.records.size()));
        if (m_file.records.size() + micromap.triangles.size() > std::numeric_limits<std::int32_t>::max())
            throw Error(m_document.path().string() + ": too many micromap triangles to inspect");
        const StateCounter counter(micromap.data);
        for (const MicromapTriangle &triangle : micromap.triangles)
            m_file.records.push_back({m, triangle, counter.count(triangle)});
    }
}

std::uint32_t Inspector::useMaterial(int index)
{
    const auto [known, added] = m_materials.emplace(index, static_cast<std::uint32_t>(m_file.materials.size()));
    if (!added)
        return known->second;
    InspectedMaterial material{.index = index, .material = readMaterial(m_document, index), .image = {}, .problem = {}};
    try {
        if (material.material.image >= 0)
            material.image = readImage(m_document, material.material.image);
    } catch (const GltfUnsupported &error) { // the micromaps can be looked at without
        material.problem = error.what();
    }
    m_file.materials.push_back(std::move(material));
    return known->second;
}

void Inspector::addPrimitive(PrimitivePlace place, const PrimitiveMicromap &micromap)
{
    if (!contains(m_selection.meshes, place.mesh) || !contains(m_selection.primitives, place.primitive))
        return;
    const Primitive source = readPrimitive(m_document, place, Positions::Leave);
    const std::string name = source.material < 0 ? "" : readMaterial(m_document, source.material).name;
    if (!m_selection.hasMaterial(source.material, name))
        return;
    if (micromap.indices.size() != source.triangleCount())
        throw Error(m_document.path().string() + ": " + m_document.nameOf(place) + " has " +
                    std::to_string(micromap.indices.size()) + " micromap indices for " +
                    std::to_string(source.triangleCount()) + " triangles");
    InspectedPrimitive primitive{.place = place,
                                 .mesh = m_document.model().meshes.at(place.mesh).name,
                                 .material = useMaterial(source.material),
                                 .triangles = source.triangleCount(),
                                 .indexBytes = bytesOfIndices(m_document, place, m_file.stored)};
    const std::vector<TriangleUvs> uvs = triangleUvs(source);
    for (std::uint32_t t = 0; t < uvs.size(); ++t) {
        if (!contains(m_selection.triangles, t))
            continue;
        const std::int32_t index = micromap.indices[t];
        primitive.numbers.push_back(t);
        primitive.uvs.push_back(uvs[t]);
        primitive.records.push_back(index < 0 ? index
                                              : static_cast<std::int32_t>(m_firstRecord.at(micromap.micromap) +
                                                                          micromap.baseTriangle +
                                                                          static_cast<std::uint32_t>(index)));
    }
    if (!primitive.numbers.empty())
        m_file.primitives.push_back(std::move(primitive));
}

InspectedFile Inspector::inspect(const DocumentBakeOptions *bake)
{
    const std::string path = m_document.path().string();
    m_file.name = m_document.path().filename().string();
    m_file.bytes = m_document.bytes().size();
    for (const std::filesystem::path &file : filesBeside(m_document.root(), path, path).read) {
        std::error_code unreadable;
        const std::uintmax_t bytes = std::filesystem::file_size(file, unreadable);
        m_file.bytes += unreadable ? 0 : bytes;
    }
    m_file.meshCount = m_document.model().meshes.size();
    m_file.primitiveCount = trianglePrimitives(m_document).size();
    if (bake != nullptr)
        bakeAll(*bake);
    else
        m_file.stored = readMicromaps(m_document);
    if (m_file.stored.primitives.empty())
        throw Error(path + ": " +
                    (bake != nullptr ? nothingMade()
                                     : "no primitive has a micromap; vellum bake makes them, and --bake shows what it "
                                       "would make"));
    m_file.surface = surfaceShares(m_document, m_file.stored);
    addRecords();
    for (const auto &[place, micromap] : m_file.stored.primitives)
        addPrimitive(place, micromap);
    if (m_file.primitives.empty())
        throw Error(path + ": no triangle with a micromap is among those chosen");
    return std::move(m_file);
}

} // namespace

InspectedFile inspectFile(const Document &document, const Selection &selection, const DocumentBakeOptions *bake)
{
    return document.named([&] { return Inspector(document, selection).inspect(bake); });
}

} // namespace vellum::cli
