#include "gltf/micromaps/document_bake.h"

#include <algorithm>
#include <cmath>
#include <fnmatch.h>
#include <map>
#include <tuple>

#include "gltf/micromaps/changing_alpha.h"
#include "gltf/primitive.h"

namespace vellum
{
namespace
{

// What decides the alpha at a texture coordinate, and which of it is opaque.
using SourceKey = std::tuple<int, Wrap, Wrap, Filter, float, std::optional<float>, float>;

// A triangle of a primitive that is baked.
struct TrianglePlace {
    std::uint32_t primitive; // into DocumentBake::primitives
    std::uint32_t triangle;
};

// Triangles whose vertices all have one alpha.
struct Layer {
    std::vector<TriangleUvs> uvs;
    std::vector<TrianglePlace> places;
};

struct Source {
    Material material;
    std::optional<float> cutoff; // none: alphaMode BLEND's own rule
    float uvTerms = 0;
    std::map<float, Layer> layers;         // by the vertices' alpha
    std::vector<std::uint32_t> primitives; // into DocumentBake::primitives
    bool unreadable = false;
};

// Each needs a map of the texture's cells of its own.
constexpr std::size_t kMostLayers = 16;

bool matches(const std::string &name, const std::vector<std::string> &patterns)
{
    return std::any_of(patterns.begin(), patterns.end(),
                       [&](const std::string &pattern) { return fnmatch(pattern.c_str(), name.c_str(), 0) == 0; });
}

class DocumentBaker
{
public:
    DocumentBaker(const Document &document, const DocumentBakeOptions &options)
        : m_document(document), m_options(options), m_changing(document)
    {
    }

    DocumentBake bake();

private:
    void addPrimitive(PrimitivePlace place);
    void leave(PrimitivePlace place, const std::string &material, const std::string &reason, bool unreadable = false);
    [[nodiscard]] std::optional<float> cutoffOf(const Material &material) const;
    Source &sourceOf(const Material &material, float uvTerms);
    void addTriangles(Source &source, const Primitive &primitive);
    void dropRareLayers();
    AlphaTexture textureOf(Source &source);
    void bakeSources(std::span<Source> sources);
    // Returns the indices that are left for the next source.
    std::span<const std::int32_t> takeResult(const Source &source, const Micromap &micromap,
                                             std::span<const std::int32_t> indices);

    const Document &m_document;
    const DocumentBakeOptions &m_options;
    ChangingAlpha m_changing;
    DocumentBake m_result;
    std::vector<Source> m_sources;
    std::map<SourceKey, std::size_t> m_sourceOf;
    std::map<int, Material> m_materials;
    std::size_t m_total = 0; // triangles to bake
    std::size_t m_done = 0;
};

void DocumentBaker::leave(PrimitivePlace place, const std::string &material, const std::string &reason, bool unreadable)
{
    const auto &extensions = m_document.model().meshes[place.mesh].primitives[place.primitive].extensions;
    const bool had =
        extensions["EXT_mesh_opacity_micromap"].exists() || extensions["KHR_mesh_opacity_micromap"].exists();
    m_result.left.push_back({place, material, reason, had, unreadable});
}

std::optional<float> DocumentBaker::cutoffOf(const Material &material) const
{
    return material.alphaMode == AlphaMode::Blend ? m_options.blendCutoff : std::optional(material.alphaCutoff);
}

Source &DocumentBaker::sourceOf(const Material &material, float uvTerms)
{
    const std::optional<float> cutoff = cutoffOf(material);
    const SourceKey key{material.image,        material.wrapU, material.wrapV, material.filter,
                        material.baseColor[3], cutoff,         uvTerms};
    const auto [found, isNew] = m_sourceOf.try_emplace(key, m_sources.size());
    if (isNew)
        m_sources.push_back({material, cutoff, uvTerms, {}, {}, false});
    return m_sources[found->second];
}

void DocumentBaker::addTriangles(Source &source, const Primitive &primitive)
{
    const auto ordinal = static_cast<std::uint32_t>(m_result.primitives.size());
    BakedPrimitive &baked = m_result.primitives.emplace_back();
    baked.micromap.indices.assign(primitive.triangleCount(), specialIndex(State::UnknownOpaque));
    source.primitives.push_back(ordinal);
    const std::vector<TriangleUvs> uvs = triangleUvs(primitive);
    const auto only = source.cutoff ? onlyOutcome(source.material, static_cast<double>(*source.cutoff)) : std::nullopt;
    for (std::uint32_t t = 0; t < uvs.size(); ++t) {
        float alpha = 1;
        bool same = true;
        bool inRange = true;
        for (std::size_t corner = 0; corner < 3 && !primitive.alphas.empty(); ++corner) {
            const float its = primitive.alphas[primitive.indices[3 * t + corner]];
            alpha = corner == 0 ? its : alpha;
            same = same && its == alpha;
            inRange = inRange && its >= 0 && its <= 1;
        }
        if (only && inRange) {
            baked.micromap.indices[t] = specialIndex(*only);
        } else if (!same || !inRange) {
            ++baked.varying;
        } else if (alpha == 0) {
            // The product is 0, whatever the texture says.
            baked.micromap.indices[t] =
                specialIndex(source.cutoff.value_or(1) > 0 ? State::Transparent : State::Opaque);
        } else {
            Layer &layer = source.layers[alpha];
            layer.uvs.push_back(uvs[t]);
            layer.places.push_back({ordinal, t});
        }
    }
}

void DocumentBaker::addPrimitive(PrimitivePlace place)
{
    const gltf_json::Model &model = m_document.model();
    const gltf_json::Mesh &mesh = model.meshes[place.mesh];
    const gltf_json::Primitive &source = mesh.primitives[place.primitive];
    // Nothing else about an opaque material matters here, whether it can be read or not.
    if (source.material >= 0 && static_cast<std::size_t>(source.material) < model.materials.size()) {
        const std::string &mode = model.materials[static_cast<std::size_t>(source.material)].alphaMode;
        if (mode != "MASK" && mode != "BLEND")
            return;
    }
    if (!m_materials.contains(source.material))
        m_materials[source.material] = readMaterial(m_document, source.material);
    const Material &material = m_materials[source.material];
    if (!material.masked())
        return;
    if (material.alphaMode == AlphaMode::Blend && !m_options.blend)
        return leave(place, material.name, "its alphaMode is BLEND");
    if (matches(mesh.name, m_options.leaveMeshes) || matches(material.name, m_options.leaveMaterials))
        return leave(place, material.name, "as asked for");
    if (const auto reason = m_changing.reason(place))
        return leave(place, material.name, *reason);
    const bool list = source.mode == gltf_json::kTriangles;
    const bool draco = source.extensions["KHR_draco_mesh_compression"].exists();
    if (!list && draco)
        return leave(place, material.name, "it is a strip with KHR_draco_mesh_compression");
    // The extension counts triangles by the indices, or else the positions.
    if (source.indices < 0 && !source.attributes.contains("POSITION"))
        return leave(place, material.name, "it has neither indices nor positions");
    if (!material.unreadImage.empty() && !m_options.fallbackImages)
        return leave(place, material.name,
                     "its texture has an image that is not read here (" + material.unreadImage + ")", true);
    Primitive primitive = readPrimitive(m_document, place, Positions::Leave);
    if (material.image >= 0 && primitive.uvs.empty())
        return leave(place, material.name,
                     "it has no texture coordinates (TEXCOORD_" + std::to_string(material.uvSet) + ")");
    if (primitive.morphed)
        return leave(place, material.name, "morph targets change its texture coordinates or alphas");
    if (primitive.indices.empty())
        return leave(place, material.name, "it has no triangles");
    if (primitive.twofold)
        return leave(place, material.name, "its uncompressed data has other triangles than its compressed data");
    const std::size_t declared = source.indices < 0
                                     ? primitive.indices.size()
                                     : model.accessors.at(static_cast<std::size_t>(source.indices)).count;
    if (draco && declared / 3 != primitive.triangleCount())
        return leave(place, material.name,
                     "it has " + std::to_string(declared / 3) + " triangles by its indices, and " +
                         std::to_string(primitive.triangleCount()) + " by KHR_draco_mesh_compression");
    addTriangles(sourceOf(material, primitive.uvTerms), primitive);
    BakedPrimitive &baked = m_result.primitives.back();
    baked.place = place;
    baked.material = material.name;
    if (material.alphaMode == AlphaMode::Blend && m_options.blendCutoff)
        baked.caution = blendCaution(*m_options.blendCutoff, "baked");
    if (!list)
        baked.corners = std::move(primitive.indices);
}

// Keeps the layers that most triangles are in; the triangles of the others stay unknown.
void DocumentBaker::dropRareLayers()
{
    for (Source &source : m_sources) {
        std::vector<std::pair<std::size_t, float>> sizes;
        for (const auto &[alpha, layer] : source.layers)
            sizes.emplace_back(layer.uvs.size(), alpha);
        std::sort(sizes.rbegin(), sizes.rend());
        for (std::size_t i = kMostLayers; i < sizes.size(); ++i) {
            for (const TrianglePlace &place : source.layers[sizes[i].second].places)
                ++m_result.primitives[place.primitive].varying;
            source.layers.erase(sizes[i].second);
        }
    }
}

std::span<const std::int32_t> DocumentBaker::takeResult(const Source &source, const Micromap &micromap,
                                                        std::span<const std::int32_t> indices)
{
    std::size_t count = 0;
    for (const auto &[alpha, layer] : source.layers)
        count += layer.places.size();
    // Only what this source uses, in the order that it has.
    std::vector<std::int32_t> used(indices.begin(), indices.begin() + static_cast<std::ptrdiff_t>(count));
    std::sort(used.begin(), used.end());
    used.erase(std::unique(used.begin(), used.end()), used.end());
    used.erase(used.begin(), std::lower_bound(used.begin(), used.end(), 0));
    StoredMicromap stored;
    std::vector<std::int32_t> numbers(micromap.triangles.size());
    for (const std::int32_t index : used) {
        MicromapTriangle triangle = micromap.triangles[static_cast<std::size_t>(index)];
        const auto begin = micromap.data.begin() + triangle.dataOffset;
        numbers[static_cast<std::size_t>(index)] = static_cast<std::int32_t>(stored.triangles.size());
        triangle.dataOffset = static_cast<std::uint32_t>(stored.data.size());
        stored.data.insert(stored.data.end(), begin, begin + packedBytes(triangle.subdivisionLevel, triangle.format));
        stored.triangles.push_back(triangle);
    }
    if (stored.triangles.empty()) {
        stored.triangles = {{0, 0, Format::FourState}};
        stored.data = {static_cast<std::uint8_t>(State::UnknownOpaque)};
    }
    Micromap counted;
    counted.triangles = stored.triangles;
    stored.usage = counted.buildUsage();
    std::size_t next = 0;
    for (const auto &[alpha, layer] : source.layers)
        for (const TrianglePlace &place : layer.places) {
            const std::int32_t index = indices[next++];
            m_result.primitives[place.primitive].micromap.indices[place.triangle] =
                index < 0 ? index : numbers[static_cast<std::size_t>(index)];
        }
    for (const std::uint32_t primitive : source.primitives)
        m_result.primitives[primitive].micromap.micromap = static_cast<std::uint32_t>(m_result.micromaps.size());
    m_result.micromaps.push_back(std::move(stored));
    return indices.subspan(count);
}

// One that is empty where the image cannot be decoded here.
AlphaTexture DocumentBaker::textureOf(Source &source)
{
    const Material &material = source.material;
    try {
        return alphaTexture(material, material.image < 0 ? Image{} : readImage(m_document, material.image));
    } catch (const GltfUnsupported &error) {
        source.unreadable = true;
        for (const std::uint32_t primitive : source.primitives) {
            const BakedPrimitive &baked = m_result.primitives[primitive];
            leave(baked.place, baked.material, m_document.reasonOf(baked.place, error), true);
        }
        return {};
    }
}

void DocumentBaker::bakeSources(std::span<Source> sources)
{
    std::vector<AlphaTexture> textures;
    textures.reserve(sources.size());
    std::vector<BakeInput> inputs;
    std::size_t triangles = 0;
    for (Source &source : sources) {
        textures.push_back(textureOf(source));
        for (const auto &[alpha, layer] : source.layers) {
            triangles += layer.uvs.size();
            if (source.unreadable)
                continue;
            BakeInput &input = inputs.emplace_back();
            input.textures = {&textures.back(), 1};
            input.triangles = layer.uvs;
            input.uvTerms = static_cast<double>(source.uvTerms);
            if (source.cutoff) {
                // The shader compares the product of both alphas with the cutoff.
                input.cutoff =
                    std::clamp(static_cast<double>(*source.cutoff), -1e30, 1e30) / static_cast<double>(alpha);
            } else {
                // A vertex' alpha below 1 leaves nothing opaque: from 2 on is never.
                const double never = alpha == 1 ? 0 : 0.5;
                input.cutoff = kBlendCutoff + never;
                input.valueTolerance = kBlendBand + never;
            }
        }
    }
    BakeOptions options = m_options.bake;
    if (options.progress)
        options.progress = [&](std::size_t done, std::size_t total) {
            const double share = total == 0 ? 1 : static_cast<double>(done) / static_cast<double>(total);
            m_options.bake.progress(m_done + static_cast<std::size_t>(share * static_cast<double>(triangles)), m_total);
        };
    const BakeResult result = vellum::bake(inputs, options);
    m_done += triangles;
    std::span<const std::int32_t> indices = result.micromap.indices;
    for (Source &source : sources) {
        if (!source.unreadable)
            indices = takeResult(source, result.micromap, indices);
        source.layers.clear();
    }
}

DocumentBake DocumentBaker::bake()
{
    for (const PrimitivePlace place : trianglePrimitives(m_document)) {
        if (m_options.bake.cancelled && m_options.bake.cancelled())
            throw BakeCancelled();
        try {
            addPrimitive(place);
        } catch (const GltfUnsupported &error) {
            leave(place, {}, m_document.reasonOf(place, error), true);
        }
    }
    dropRareLayers();
    for (const Source &source : m_sources)
        for (const auto &[alpha, layer] : source.layers)
            m_total += layer.uvs.size();
    if (m_options.bake.budget) {
        bakeSources(m_sources); // which of them gains most from a byte is decided over all
    } else {
        for (Source &source : m_sources)
            bakeSources({&source, 1});
    }
    std::vector<bool> dropped(m_result.primitives.size());
    for (const Source &source : m_sources)
        for (const std::uint32_t primitive : source.primitives)
            dropped[primitive] = source.unreadable;
    std::vector<BakedPrimitive> kept;
    for (std::size_t i = 0; i < dropped.size(); ++i)
        if (!dropped[i])
            kept.push_back(std::move(m_result.primitives[i]));
    m_result.primitives = std::move(kept);
    std::sort(m_result.left.begin(), m_result.left.end(),
              [](const LeftPrimitive &a, const LeftPrimitive &b) { return a.place < b.place; });
    return std::move(m_result);
}

} // namespace

DocumentBake bakeDocument(const Document &document, const DocumentBakeOptions &options)
{
    return document.named([&] { return DocumentBaker(document, options).bake(); });
}

} // namespace vellum
