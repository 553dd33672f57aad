// SPDX-License-Identifier: Apache-2.0
#include "verify/file.h"

#include <algorithm>
#include <map>
#include <set>

#include "core/hash.h"
#include "gltf/alpha_textures.h"
#include "gltf/micromaps/changing_alpha.h"
#include "gltf/primitive.h"

namespace vellum::verify
{
namespace
{

std::vector<TriangleCorners> cornersOf(const Primitive &primitive, bool tested)
{
    std::vector<TriangleCorners> triangles(primitive.triangleCount());
    for (size_t t = 0; t < triangles.size(); ++t) {
        for (size_t corner = 0; corner < 3; ++corner) {
            const uint32_t vertex = primitive.indices[3 * t + corner];
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
        : document_(document), options_(options), changing_(document), textures_(document)
    {
    }
    FileReport operator()();

private:
    void describe();
    std::optional<GltfError> readTexels(const Material &material);
    void collectAlphas();
    void verifyMaterial(const Material &material, const std::vector<PrimitivePlace> &places);
    void verifyPrimitive(PrimitivePlace place, const Material &material);
    void skip(PrimitivePlace place, const std::string &reason);
    [[nodiscard]] std::string cautionFor(PrimitivePlace place, const Primitive &primitive,
                                         const Material &material) const;
    // An earlier primitive with the same triangles and micromap indices; nothing if there is none.
    [[nodiscard]] const PrimitiveReport *twinOf(PrimitivePlace place, const std::vector<TriangleCorners> &triangles,
                                                const Material &material);

    const Document &document_;
    const FileOptions &options_;
    std::optional<float> blendCutoff_;
    ChangingAlpha changing_;
    AlphaTextures textures_;
    std::shared_ptr<const AlphaTexture> texture_;
    std::optional<Texels> texels_;  // of texture_
    std::optional<TextureKey> key_; // of texture_; none for materials without alpha test
    FileReport report_;
    // The verified primitives of one material, by a hash of the data that determine their results: into
    // report_.primitives.
    std::map<uint64_t, size_t> verified_;
    // By micromap, the alphas of triangles whose vertices have equal alphas; no more than decide Options::manyAlphas.
    std::map<uint32_t, std::set<float>> alphas_;
    uint64_t work_ = 0; // remaining work
    size_t done_ = 0;   // triangles
    size_t total_ = 0;
};

// Finds the features that a device needs.
void FileVerifier::describe()
{
    work_ = options_.fileWork;
    for (const StoredMicromap &micromap : report_.stored.micromaps) {
        work_ += options_.workForByte * micromap.data.size();
        for (const MicromapTriangle &t : micromap.triangles) {
            int &level = t.format == Format::TwoState ? report_.level2State : report_.level4State;
            level = std::max<int>(level, t.subdivisionLevel);
        }
    }
    for (const auto &[place, primitive] : report_.stored.primitives) {
        total_ += primitive.indices.size();
        const auto special =
            std::count_if(primitive.indices.begin(), primitive.indices.end(), [](int32_t index) { return index < 0; });
        report_.mixedSpecialIndices =
            report_.mixedSpecialIndices || (special != 0 && static_cast<size_t>(special) != primitive.indices.size());
    }
}

void FileVerifier::skip(PrimitivePlace place, const std::string &reason)
{
    report_.unverified.push_back({place, document_.nameOf(place), reason});
}

std::string FileVerifier::cautionFor(PrimitivePlace place, const Primitive &primitive, const Material &material) const
{
    std::string caution;
    const auto add = [&](const std::string &reason) { caution += (caution.empty() ? "" : "; ") + reason; };
    if (primitive.morphed)
        add("a morph target changes its texture coordinates or alpha: verified without it");
    if (const auto reason = changing_.reason(place))
        add(*reason + ": verified without it");
    if (material.alphaMode == AlphaMode::Blend && blendCutoff_)
        add(blendCaution(*blendCutoff_, "verified"));
    if (primitive.twofold)
        add("its uncompressed data has other triangles than its compressed data");
    if (material.masked() && !material.unreadImage.empty())
        add("its texture has an image that is not supported (" + material.unreadImage + ")");
    if (material.masked() && !material.otherImage.empty())
        add("its texture has another image for those who do not know " + material.otherImage);
    return caution;
}

const PrimitiveReport *FileVerifier::twinOf(PrimitivePlace place, const std::vector<TriangleCorners> &triangles,
                                            const Material &material)
{
    const PrimitiveMicromap &stored = report_.stored.primitives.at(place);
    const auto hash = [](const auto &values, uint64_t seed) {
        return hashBytes(values.data(), values.size() * sizeof(values.front()), seed);
    };
    const uint64_t key = hash(stored.indices, hash(triangles, stored.micromap));
    const auto [found, isNew] = verified_.try_emplace(key, report_.primitives.size());
    if (isNew)
        return nullptr;
    const PrimitiveReport &other = report_.primitives[found->second];
    const PrimitiveMicromap &its = report_.stored.primitives.at(other.place);
    const bool same = its.micromap == stored.micromap && its.baseTriangle == stored.baseTriangle &&
                      its.indices == stored.indices &&
                      cornersOf(readPrimitive(document_, other.place, Positions::Skip), material.masked()) == triangles;
    return same ? &other : nullptr;
}

void FileVerifier::verifyPrimitive(PrimitivePlace place, const Material &material)
{
    const Primitive primitive = readPrimitive(document_, place, Positions::Skip);
    const PrimitiveMicromap &stored = report_.stored.primitives.at(place);
    if (stored.indices.size() != primitive.triangleCount())
        throw GltfError("it has " + std::to_string(primitive.triangleCount()) + " triangles and " +
                        std::to_string(stored.indices.size()) + " micromap indices");
    if (material.masked() && material.image >= 0 && primitive.uvs.empty())
        return skip(place, "it has no texture coordinates (TEXCOORD_" + std::to_string(material.uvSet) + ")");
    const std::vector<TriangleCorners> triangles = cornersOf(primitive, material.masked());
    if (work_ == 0)
        return skip(place, "the file takes too long to verify");
    const PrimitiveReport *twin = twinOf(place, triangles, material);
    Options options = options_;
    // Without an alpha test everything is opaque.
    const std::optional<float> cutoff = material.alphaMode == AlphaMode::Mask    ? material.alphaCutoff
                                        : material.alphaMode == AlphaMode::Blend ? blendCutoff_
                                                                                 : 0.5f;
    options.cutoff = cutoff ? double{*cutoff} : kBlendCutoff;
    options.band = cutoff ? 0 : kBlendBand;
    // A filter makes no value that is above the largest texel or below the smallest, however it rounds.
    const bool inRange = std::all_of(primitive.alphas.begin(), primitive.alphas.end(),
                                     [](float alpha) { return alpha >= 0 && alpha <= 1; });
    if (material.masked() && (!cutoff || (inRange && onlyOutcome(material, *cutoff))))
        options.tolerances.value = 0;
    options.twoStateSpecials = report_.stored.micromaps[stored.micromap].isApproximate();
    options.manyAlphas = alphas_[stored.micromap].size() > kMostVertexAlphas;
    if (options_.progress)
        options.progress = [&](size_t done, size_t total) {
            // The product has more bits than a size_t of 32.
            const uint64_t reached = uint64_t{stored.indices.size()} * done / std::max<size_t>(total, 1);
            options_.progress(done_ + static_cast<size_t>(reached), total_);
        };
    PrimitiveReport report;
    report.place = place;
    report.name = document_.nameOf(place);
    report.material = material.name;
    report.cutoff = cutoff;
    report.triangles = stored.indices.size();
    report.caution = cautionFor(place, primitive, material);
    report.special = static_cast<size_t>(
        std::count_if(stored.indices.begin(), stored.indices.end(), [](int32_t index) { return index < 0; }));
    if (twin != nullptr) {
        report.result = twin->result;
        if (options_.progress)
            options_.progress(done_ + stored.indices.size(), total_);
    } else {
        options.work = work_;
        report.result = verify(*texels_, triangles, *report_.stored.of(place), options);
        report_.work += report.result.work;
        work_ -= std::min(work_, report.result.work);
    }
    report_.primitives.push_back(std::move(report));
}

// If the image of a material cannot be read, returns the error.
std::optional<GltfError> FileVerifier::readTexels(const Material &material)
{
    const std::optional key = material.masked() ? std::optional(textureKeyOf(material)) : std::nullopt;
    if (texels_ && key == key_)
        return std::nullopt;
    texels_.reset();
    texture_.reset(); // before the next one is read
    key_ = key;
    try {
        if (material.masked()) {
            texture_ = textures_.of(material);
            textures_.images().account(texture_->texelCount());
        } else {
            AlphaTexture opaque;
            opaque.width = opaque.height = 1;
            opaque.alpha = {1};
            texture_ = std::make_shared<AlphaTexture>(std::move(opaque));
        }
        texels_.emplace(*texture_);
        return std::nullopt;
    } catch (const GltfError &error) {
        return error;
    }
}

void FileVerifier::verifyMaterial(const Material &material, const std::vector<PrimitivePlace> &places)
{
    const std::optional<GltfError> unreadable = readTexels(material);
    verified_.clear();
    for (const PrimitivePlace place : places) {
        try {
            if (!unreadable)
                verifyPrimitive(place, material);
            else
                skip(place, document_.reasonOf(place, *unreadable));
        } catch (const GltfError &error) {
            skip(place, document_.reasonOf(place, error));
        }
        done_ += report_.stored.primitives.at(place).indices.size();
    }
}

void FileVerifier::collectAlphas()
{
    const auto &meshes = document_.model().meshes;
    for (const auto &[place, stored] : report_.stored.primitives) {
        std::set<float> &alphas = alphas_[stored.micromap];
        if (!meshes.at(place.mesh).primitives.at(place.primitive).attributes.contains("COLOR_0")) {
            alphas.insert(1);
            continue;
        }
        try {
            for (const TriangleCorners &t : cornersOf(readPrimitive(document_, place, Positions::Skip), true))
                if (alphas.size() <= kMostVertexAlphas && t.alpha[0] == t.alpha[1] && t.alpha[0] == t.alpha[2] &&
                    t.alpha[0] > 0 && t.alpha[0] <= 1)
                    alphas.insert(t.alpha[0]);
        } catch (const GltfError &) {
            // It is reported where the primitive is verified.
        }
    }
}

FileReport FileVerifier::operator()()
{
    CheckedMicromaps checked = checkMicromaps(document_, options_.maxStructureFindings);
    report_.findings = std::move(checked.findings);
    if (!report_.findings.empty())
        return std::move(report_);
    report_.stored = std::move(checked.stored);
    blendCutoff_ = options_.blendCutoff;
    if (!blendCutoff_)
        blendCutoff_ = report_.stored.blendCutoff;
    describe();
    collectAlphas();
    std::map<int, std::vector<PrimitivePlace>> places;
    const auto &meshes = document_.model().meshes;
    for (const auto &[place, primitive] : report_.stored.primitives)
        places[meshes.at(place.mesh).primitives.at(place.primitive).material].push_back(place);
    // Sorted by texture: each is read once, and only one at a time.
    std::multimap<TextureKey, std::pair<Material, int>> materials;
    for (const auto &[number, its] : places) {
        try {
            const Material material = readMaterial(document_, number);
            materials.emplace(textureKeyOf(material), std::pair(material, number));
        } catch (const GltfError &error) {
            for (const PrimitivePlace place : its)
                skip(place, document_.reasonOf(place, error));
        }
    }
    for (const auto &[key, material] : materials)
        verifyMaterial(material.first, places[material.second]);
    const auto byPlace = [](const auto &a, const auto &b) { return a.place < b.place; };
    std::sort(report_.primitives.begin(), report_.primitives.end(), byPlace);
    std::sort(report_.unverified.begin(), report_.unverified.end(), byPlace);
    return std::move(report_);
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
