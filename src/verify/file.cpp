#include "verify/file.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>

#include "core/hash.h"
#include "gltf/micromaps/changing_alpha.h"
#include "gltf/primitive.h"

namespace vellum::verify
{
namespace
{

std::vector<TriangleCorners> cornersOf(const Primitive &primitive, bool tested)
{
    std::vector<TriangleCorners> triangles(primitive.triangleCount());
    for (std::size_t t = 0; t < triangles.size(); ++t) {
        for (std::size_t corner = 0; corner < 3; ++corner) {
            const std::uint32_t vertex = primitive.indices[3 * t + corner];
            if (!primitive.uvs.empty()) {
                triangles[t].u[corner] = primitive.uvs[vertex].u;
                triangles[t].v[corner] = primitive.uvs[vertex].v;
                triangles[t].terms = primitive.uvTerms;
            }
            if (tested && !primitive.alphas.empty())
                triangles[t].alpha[corner] = primitive.alphas[vertex];
        }
    }
    return triangles;
}

class FileVerifier
{
public:
    FileVerifier(const Document &document, const FileOptions &options)
        : m_document(document), m_options(options), m_changing(document)
    {
    }
    FileReport operator()();

private:
    void describe();
    void verifyMaterial(int number, const std::vector<PrimitivePlace> &places);
    void verifyPrimitive(PrimitivePlace place, const Material &material, const Texels &texels);
    void leave(PrimitivePlace place, const std::string &reason);
    [[nodiscard]] std::string cautionFor(PrimitivePlace place, const Primitive &primitive,
                                         const Material &material) const;
    // One that has the same triangles and says the same of them; nothing where there is none.
    [[nodiscard]] const PrimitiveReport *twinOf(PrimitivePlace place, const std::vector<TriangleCorners> &triangles,
                                                const Material &material);

    const Document &m_document;
    const FileOptions &m_options;
    ChangingAlpha m_changing;
    StoredMicromaps m_stored;
    FileReport m_report;
    // Of the primitives with one material, by a hash of what decides their results: into m_report.primitives.
    std::map<std::uint64_t, std::size_t> m_verified;
    std::uint64_t m_work = 0; // that is left
    std::size_t m_done = 0;   // triangles
    std::size_t m_total = 0;
};

// What a device must be able to do.
void FileVerifier::describe()
{
    m_report.extension = m_stored.extension;
    m_report.micromaps = m_stored.micromaps.size();
    m_work = m_options.fileWork;
    for (const StoredMicromap &micromap : m_stored.micromaps) {
        m_work += m_options.workForByte * micromap.data.size();
        for (const MicromapTriangle &t : micromap.triangles) {
            int &level = t.format == Format::TwoState ? m_report.level2State : m_report.level4State;
            level = std::max<int>(level, t.subdivisionLevel);
        }
    }
    for (const auto &[place, primitive] : m_stored.primitives) {
        m_total += primitive.indices.size();
        const auto special = std::count_if(primitive.indices.begin(), primitive.indices.end(),
                                           [](std::int32_t index) { return index < 0; });
        m_report.mixedSpecialIndices = m_report.mixedSpecialIndices ||
                                       (special != 0 && static_cast<std::size_t>(special) != primitive.indices.size());
    }
}

void FileVerifier::leave(PrimitivePlace place, const std::string &reason)
{
    m_report.unverified.push_back({place, m_document.nameOf(place), reason});
}

std::string FileVerifier::cautionFor(PrimitivePlace place, const Primitive &primitive, const Material &material) const
{
    std::string caution;
    const auto add = [&](const std::string &reason) { caution += (caution.empty() ? "" : "; ") + reason; };
    if (primitive.morphed)
        add("a morph target changes its texture coordinates or alpha");
    if (const auto reason = m_changing.reason(place))
        add(*reason);
    if (material.alphaMode == AlphaMode::Blend && m_options.blendCutoff)
        add(blendCaution(*m_options.blendCutoff, "verified"));
    if (primitive.twofold)
        add("its uncompressed data has other triangles than its compressed data");
    if (material.masked() && !material.unreadImage.empty())
        add("its texture has an image that is not read here (" + material.unreadImage + ")");
    if (material.masked() && !material.otherImage.empty())
        add("its texture has another image for those who do not know " + material.otherImage);
    return caution;
}

const PrimitiveReport *FileVerifier::twinOf(PrimitivePlace place, const std::vector<TriangleCorners> &triangles,
                                            const Material &material)
{
    const PrimitiveMicromap &stored = m_stored.primitives.at(place);
    const auto hash = [](const auto &values, std::uint64_t seed) {
        return hashBytes(values.data(), values.size() * sizeof(values.front()), seed);
    };
    const std::uint64_t key = hash(stored.indices, hash(triangles, stored.micromap));
    const auto [found, isNew] = m_verified.try_emplace(key, m_report.primitives.size());
    if (isNew)
        return nullptr;
    const PrimitiveReport &other = m_report.primitives[found->second];
    const PrimitiveMicromap &its = m_stored.primitives.at(other.place);
    const bool same =
        its.micromap == stored.micromap && its.baseTriangle == stored.baseTriangle && its.indices == stored.indices &&
        cornersOf(readPrimitive(m_document, other.place, Positions::Leave), material.masked()) == triangles;
    return same ? &other : nullptr;
}

void FileVerifier::verifyPrimitive(PrimitivePlace place, const Material &material, const Texels &texels)
{
    const Primitive primitive = readPrimitive(m_document, place, Positions::Leave);
    const PrimitiveMicromap &stored = m_stored.primitives.at(place);
    if (stored.indices.size() != primitive.triangleCount())
        throw GltfError("it has " + std::to_string(primitive.triangleCount()) + " triangles and " +
                        std::to_string(stored.indices.size()) + " micromap indices");
    if (material.masked() && material.image >= 0 && primitive.uvs.empty())
        return leave(place, "it has no texture coordinates (TEXCOORD_" + std::to_string(material.uvSet) + ")");
    const std::vector<TriangleCorners> triangles = cornersOf(primitive, material.masked());
    if (m_work == 0)
        return leave(place, "the file takes too long to verify");
    const PrimitiveReport *twin = twinOf(place, triangles, material);
    Options options = m_options;
    // Without an alpha test everything is opaque.
    const std::optional<double> cutoff = material.alphaMode == AlphaMode::Mask    ? double{material.alphaCutoff}
                                         : material.alphaMode == AlphaMode::Blend ? m_options.blendCutoff
                                                                                  : 0.5;
    options.cutoff = cutoff.value_or(kBlendCutoff);
    options.band = cutoff ? 0 : kBlendBand;
    // A filter makes no value that is above the largest texel or below the smallest, however it rounds.
    const bool inRange = std::all_of(primitive.alphas.begin(), primitive.alphas.end(),
                                     [](float alpha) { return alpha >= 0 && alpha <= 1; });
    if (material.masked() && (!cutoff || (inRange && onlyOutcome(material, *cutoff))))
        options.tolerances.value = 0;
    if (m_options.progress)
        options.progress = [&](std::size_t done, std::size_t total) {
            m_options.progress(m_done + stored.indices.size() * done / std::max<std::size_t>(total, 1), m_total);
        };
    PrimitiveReport report;
    report.place = place;
    report.name = m_document.nameOf(place);
    report.material = material.name;
    report.cutoff = cutoff;
    report.triangles = stored.indices.size();
    report.caution = cautionFor(place, primitive, material);
    report.special = static_cast<std::size_t>(
        std::count_if(stored.indices.begin(), stored.indices.end(), [](std::int32_t index) { return index < 0; }));
    if (twin != nullptr) {
        report.result = twin->result;
        if (m_options.progress)
            m_options.progress(m_done + stored.indices.size(), m_total);
    } else {
        options.work = m_work;
        report.result = verify(texels, triangles, *m_stored.of(place), options);
        m_report.work += report.result.work;
        m_work -= std::min(m_work, report.result.work);
    }
    m_report.primitives.push_back(std::move(report));
}

// The texture is read once for all primitives that have it, and only one at a time.
void FileVerifier::verifyMaterial(int number, const std::vector<PrimitivePlace> &places)
{
    Material material;
    AlphaTexture texture;
    std::optional<Texels> texels;
    std::optional<GltfError> unreadable;
    try {
        material = readMaterial(m_document, number);
        if (material.masked()) {
            texture = alphaTexture(material, material.image < 0 ? Image{} : readImage(m_document, material.image));
        } else {
            texture.width = texture.height = 1;
            texture.alpha = {1};
        }
        texels.emplace(texture);
    } catch (const GltfError &error) {
        unreadable = error;
    }
    m_verified.clear();
    for (const PrimitivePlace place : places) {
        try {
            if (texels)
                verifyPrimitive(place, material, *texels);
            else
                leave(place, m_document.reasonOf(place, *unreadable));
        } catch (const GltfError &error) {
            leave(place, m_document.reasonOf(place, error));
        }
        m_done += m_stored.primitives.at(place).indices.size();
    }
}

FileReport FileVerifier::operator()()
{
    m_report.offences = findMicromapOffences(m_document, m_options.maxOffences);
    if (!m_report.offences.empty())
        return std::move(m_report);
    m_stored = readMicromaps(m_document);
    describe();
    std::map<int, std::vector<PrimitivePlace>> byMaterial;
    const auto &meshes = m_document.model().meshes;
    for (const auto &[place, primitive] : m_stored.primitives)
        byMaterial[meshes.at(place.mesh).primitives.at(place.primitive).material].push_back(place);
    for (const auto &[material, places] : byMaterial)
        verifyMaterial(material, places);
    const auto byPlace = [](const auto &a, const auto &b) { return a.place < b.place; };
    std::sort(m_report.primitives.begin(), m_report.primitives.end(), byPlace);
    std::sort(m_report.unverified.begin(), m_report.unverified.end(), byPlace);
    return std::move(m_report);
}

} // namespace

Counts FileReport::counts() const
{
    Counts sum;
    for (const PrimitiveReport &primitive : primitives)
        sum += primitive.result.counts;
    return sum;
}

FileReport verifyDocument(const Document &document, const FileOptions &options)
{
    return FileVerifier(document, options)();
}

} // namespace vellum::verify
