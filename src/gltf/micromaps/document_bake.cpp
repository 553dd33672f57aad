// SPDX-License-Identifier: Apache-2.0
#include "gltf/micromaps/document_bake.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <numeric>
#include <tuple>
#include <utility>

#include "base/text.h"
#include "gltf/data/accessor.h"
#include "gltf/micromaps/changing_alpha.h"
#include "gltf/primitive.h"

namespace vellum
{
namespace
{

// The parameters that determine the alpha at a texture coordinate, and which of it is opaque.
using SourceKey = std::tuple<TextureKey, std::optional<float>>;

// A triangle of a primitive that is baked.
struct TrianglePlace {
    uint32_t primitive; // into DocumentBake::primitives
    uint32_t triangle;
};

// Triangles whose vertices all have one alpha, of primitives with one Primitive::uvTerms.
struct LayerKey {
    float alpha;
    float uvTerms;
    auto operator<=>(const LayerKey &) const = default;
};
struct Layer {
    std::vector<TriangleUvs> uvs;
    std::vector<TrianglePlace> places;
    std::vector<double> weights; // where levels are chosen by it: their surface
};

struct Source {
    Material material;
    std::optional<float> cutoff; // none: alphaMode BLEND's own rule
    std::map<LayerKey, Layer> layers;
    std::vector<uint32_t> primitives;            // into DocumentBake::primitives
    std::shared_ptr<const AlphaTexture> texture; // while it is baked
    bool unreadable = false;                     // the image cannot be decoded here
    std::optional<StoredMicromap> baked;
};

// Triangles without a surface count that much, all together, where a budget chooses: it is spent on them last.
constexpr double kLeastShare = 1e-6;

// The number of cell maps of a texture that can be computed in the time of decoding it.
constexpr size_t kMapsForImage = 16;
// The limit for all primitives together, in addition to one triangle for each byte of the file's buffers. Primitives
// can share their indices.
constexpr size_t kMostTriangles = size_t{1} << 24;

// The size of a micromap without data of its own: a triangle of level 0 that nothing refers to.
constexpr uint64_t kEmptyBytes = sizeof(MicromapTriangle) + 1;

bool matches(const std::string &name, const std::vector<std::string> &patterns)
{
    return std::any_of(patterns.begin(), patterns.end(),
                       [&](const std::string &pattern) { return matchesPattern(name, pattern); });
}

// Why an alpha test has one outcome, whatever its texture; empty if it has not. Not for what is invisible by its
// factor.
std::string cutoffCaution(const Material &material, const PrimitiveMicromap &micromap)
{
    const auto only = onlyOutcome(material, static_cast<double>(material.alphaCutoff));
    if (!only || material.baseColor[3] == 0 ||
        std::any_of(micromap.indices.begin(), micromap.indices.end(),
                    [&](int32_t index) { return index != specialIndex(*only); }))
        return "";
    std::array<char, 32> cutoff{};
    std::snprintf(cutoff.data(), cutoff.size(), "%.9g", static_cast<double>(material.alphaCutoff));
    return *only == State::Transparent
               ? std::string("no alpha of it reaches its alphaCutoff, ") + cutoff.data() + ": all of it is transparent"
               : std::string("every alpha of it reaches its alphaCutoff, ") + cutoff.data() + ": all of it is opaque";
}

class DocumentBaker
{
public:
    // `areas` may be null.
    DocumentBaker(const Document &document, const DocumentBakeOptions &options, const SurfaceAreas *areas)
        : document_(document), options_(options), areas_(areas), changing_(document),
          textures_(document, options.images)
    {
        for (const gltf_json::Buffer &buffer : document.model().buffers)
            mostTriangles_ += buffer.data.size();
    }

    DocumentBake bake();
    DocumentOutlines outline(std::span<const std::optional<uint32_t>> levels, std::span<const uint64_t> budgets);

private:
    void collect();
    void addPrimitive(PrimitivePlace place);
    void skip(PrimitivePlace place, const std::string &material, SkipReason code, const std::string &reason);
    [[nodiscard]] std::optional<float> cutoffOf(const Material &material) const;
    Source &sourceOf(const Material &material);
    void addTriangles(Source &source, const Primitive &primitive);
    void dropRareLayers();
    void readTexture(Source &source);
    void measure();
    [[nodiscard]] double areaOf(const TrianglePlace &place) const;
    void weigh(double leastShare);
    [[nodiscard]] double knownBeforehand() const;
    [[nodiscard]] double surfaceOfSources() const;
    [[nodiscard]] double leastKnown() const;
    [[noreturn]] void rejectTarget(double known) const;
    static std::vector<BakeInput> inputsOf(std::span<const Source> sources);
    [[nodiscard]] BakeOptions optionsFor(std::span<const Source> sources) const;
    std::optional<Digest> keyOf(std::span<const Source> sources);
    [[nodiscard]] std::optional<Micromap> cached(std::span<const Source> sources, const Digest &key) const;
    void report(size_t done);
    Micromap bakeRead(std::span<Source> sources);
    void bakeSources(std::span<Source> sources);
    // Returns the indices that are left for the next source.
    std::span<const int32_t> takeResult(Source &source, const Micromap &micromap, std::span<const int32_t> indices);
    void bakeAll();
    [[nodiscard]] std::vector<SkippedPrimitive> takeSkipped();
    [[nodiscard]] std::vector<OutlinedPrimitive> readablePrimitives() const;
    void numberMicromaps();

    const Document &document_;
    const DocumentBakeOptions &options_;
    const SurfaceAreas *areas_;
    SurfaceAreas measured_;
    SurfaceAreas counted_; // in place of areas, where there are none
    double surface_ = 0;   // all of it
    double weighed_ = 1;   // the surface of what is baked, the unit of the weights
    ChangingAlpha changing_;
    AlphaTextures textures_;
    DocumentBake result_;
    std::vector<Source> sources_;
    std::map<SourceKey, size_t> sourceOf_;
    std::map<int, Material> materials_;
    std::map<int, Digest> imageKeys_;
    size_t mostTriangles_ = kMostTriangles;
    size_t total_ = 0;    // triangles; from then on those to bake
    size_t reported_ = 0; // the last part of kProgressParts that was
    size_t done_ = 0;
};

void DocumentBaker::skip(PrimitivePlace place, const std::string &material, SkipReason code, const std::string &reason)
{
    const auto &extensions = document_.model().meshes[place.mesh].primitives[place.primitive].extensions;
    result_.skipped.push_back(
        {place, document_.nameOf(place), material, code, reason, hasMicromapExtension(extensions), false});
}

std::optional<float> DocumentBaker::cutoffOf(const Material &material) const
{
    return material.alphaMode == AlphaMode::Blend ? options_.blendCutoff : std::optional(material.alphaCutoff);
}

Source &DocumentBaker::sourceOf(const Material &material)
{
    const std::optional<float> cutoff = cutoffOf(material);
    const SourceKey key{textureKeyOf(material), cutoff};
    const auto [found, isNew] = sourceOf_.try_emplace(key, sources_.size());
    if (isNew)
        sources_.push_back({material, cutoff, {}, {}, {}, false, {}});
    return sources_[found->second];
}

void DocumentBaker::addTriangles(Source &source, const Primitive &primitive)
{
    const auto ordinal = static_cast<uint32_t>(result_.primitives.size());
    BakedPrimitive &baked = result_.primitives.emplace_back();
    baked.micromap.indices.assign(primitive.triangleCount(), specialIndex(State::UnknownOpaque));
    source.primitives.push_back(ordinal);
    const std::vector<TriangleUvs> uvs = triangleUvs(primitive);
    const auto only = source.cutoff ? onlyOutcome(source.material, static_cast<double>(*source.cutoff)) : std::nullopt;
    for (uint32_t t = 0; t < uvs.size(); ++t) {
        float alpha = 1;
        bool same = true;
        bool inRange = true;
        for (size_t corner = 0; corner < 3 && !primitive.alphas.empty(); ++corner) {
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
            Layer &layer = source.layers[{alpha, primitive.uvTerms}];
            layer.uvs.push_back(uvs[t]);
            layer.places.push_back({ordinal, t});
        }
    }
}

void DocumentBaker::addPrimitive(PrimitivePlace place)
{
    const gltf_json::Model &model = document_.model();
    const gltf_json::Mesh &mesh = model.meshes[place.mesh];
    const gltf_json::Primitive &source = mesh.primitives[place.primitive];
    if (source.material < 0)
        return; // opaque
    // No other property of a material that is not baked matters here, whether it can be read or not.
    if (const auto index = static_cast<size_t>(source.material); index < model.materials.size()) {
        const std::string &mode = model.materials[index].alphaMode;
        if (mode != "MASK" && mode != "BLEND")
            return;
        const std::string name = materialName(model, index);
        if (mode == "BLEND" && !options_.blend)
            return skip(place, shownName(name), SkipReason::AlphaModeBlend, "its alphaMode is BLEND");
        if (matches(mesh.name, options_.excludedMeshes) || matches(name, options_.excludedMaterials))
            return skip(place, shownName(name), SkipReason::Excluded, "it is excluded");
    }
    if (!materials_.contains(source.material))
        materials_[source.material] = readMaterial(document_, source.material);
    const Material &material = materials_[source.material];
    if (const auto reason = changing_.reason(place))
        return skip(place, material.name, SkipReason::AlphaChanges, *reason);
    const bool list = source.mode == gltf_json::kTriangles;
    const bool draco = source.extensions["KHR_draco_mesh_compression"].exists();
    if (!list && draco)
        return skip(place, material.name, SkipReason::CompressedStrip, "it is a strip with KHR_draco_mesh_compression");
    // The extension counts triangles by the indices, or else the positions.
    if (source.indices < 0 && !source.attributes.contains("POSITION"))
        return skip(place, material.name, SkipReason::NoTriangles, "it has neither indices nor positions");
    if (!material.unreadImage.empty() && !options_.fallbackImages) {
        skip(place, material.name, SkipReason::UnsupportedImage,
             "its texture also has an image that is not supported (" + material.unreadImage +
                 "), which renderers may take");
        result_.skipped.back().hasFallback = true;
        return;
    }
    Primitive primitive = readPrimitive(document_, place, Positions::Skip);
    if (material.image >= 0 && primitive.uvs.empty())
        return skip(place, material.name, SkipReason::NoTextureCoordinates,
                    "it has no texture coordinates (TEXCOORD_" + std::to_string(material.uvSet) + ")");
    if (primitive.morphed)
        return skip(place, material.name, SkipReason::AlphaChanges,
                    "morph targets change its texture coordinates or alphas");
    if (primitive.indices.empty())
        return skip(place, material.name, SkipReason::NoTriangles, "it has no triangles");
    if (primitive.twofold)
        return skip(place, material.name, SkipReason::AmbiguousTriangles,
                    "its uncompressed data has other triangles than its compressed data");
    total_ += primitive.triangleCount();
    if (total_ > mostTriangles_)
        throw GltfError("it has more than " + std::to_string(mostTriangles_) + " alpha-tested triangles");
    // Readers of the extension count these.
    const std::optional<size_t> declared = declaredTriangles(model, source);
    if (!declared)
        return skip(place, material.name, SkipReason::NoTriangles, "it has neither indices nor positions");
    if (draco && *declared != primitive.triangleCount())
        return skip(place, material.name, SkipReason::AmbiguousTriangles,
                    "it has " + std::to_string(*declared) + " triangles by its indices, and " +
                        std::to_string(primitive.triangleCount()) + " by KHR_draco_mesh_compression");
    addTriangles(sourceOf(material), primitive);
    BakedPrimitive &baked = result_.primitives.back();
    baked.place = place;
    baked.name = document_.nameOf(place);
    baked.material = material.name;
    if (material.alphaMode == AlphaMode::Blend && options_.blendCutoff)
        baked.caution = blendCaution(*(result_.blendCutoff = options_.blendCutoff), "baked");
    else if (material.alphaMode == AlphaMode::Mask)
        baked.caution = cutoffCaution(material, baked.micromap);
    if (!list)
        baked.corners = std::move(primitive.indices);
}

// Keeps the alphas that most triangles have; the triangles of the others stay unknown.
void DocumentBaker::dropRareLayers()
{
    for (Source &source : sources_) {
        std::map<float, size_t> sizes;
        for (const auto &[key, layer] : source.layers)
            sizes[key.alpha] += layer.uvs.size();
        std::vector<std::pair<size_t, float>> alphas;
        for (const auto &[alpha, size] : sizes)
            alphas.emplace_back(size, alpha);
        std::sort(alphas.rbegin(), alphas.rend());
        for (size_t i = 0; i < std::min(kMostVertexAlphas, alphas.size()); ++i)
            sizes.erase(alphas[i].second);
        std::erase_if(source.layers, [&](const auto &layer) {
            const bool rare = sizes.contains(layer.first.alpha);
            for (const TrianglePlace &place : layer.second.places)
                result_.primitives[place.primitive].varying += rare ? 1u : 0u;
            return rare;
        });
    }
}

std::span<const int32_t> DocumentBaker::takeResult(Source &source, const Micromap &micromap,
                                                   std::span<const int32_t> indices)
{
    size_t count = 0;
    for (const auto &[key, layer] : source.layers)
        count += layer.places.size();
    // Only the triangles that this source uses, in their order.
    std::vector<int32_t> used(indices.begin(), indices.begin() + static_cast<ptrdiff_t>(count));
    std::sort(used.begin(), used.end());
    used.erase(std::unique(used.begin(), used.end()), used.end());
    used.erase(used.begin(), std::lower_bound(used.begin(), used.end(), 0));
    StoredMicromap stored;
    for (const int32_t index : used) {
        MicromapTriangle triangle = micromap.triangles[static_cast<size_t>(index)];
        const auto begin = micromap.data.begin() + static_cast<ptrdiff_t>(triangle.dataOffset);
        triangle.dataOffset = static_cast<uint32_t>(stored.data.size());
        const auto bytes = static_cast<ptrdiff_t>(packedBytes(triangle.subdivisionLevel, triangle.format));
        stored.data.insert(stored.data.end(), begin, begin + bytes);
        stored.triangles.push_back(triangle);
    }
    if (stored.triangles.empty()) {
        const bool two = options_.bake.format == Format::TwoState; // isApproximate() goes by it
        stored.triangles = {{0, 0, options_.bake.format}};
        stored.data = {static_cast<uint8_t>(two ? State::Opaque : State::UnknownOpaque)};
    }
    stored.usage = usageOf(stored.triangles);
    const auto numberOf = [&used](int32_t index) {
        return static_cast<int32_t>(std::lower_bound(used.begin(), used.end(), index) - used.begin());
    };
    size_t next = 0;
    for (const auto &[key, layer] : source.layers)
        for (const TrianglePlace &place : layer.places) {
            const int32_t index = indices[next++];
            result_.primitives[place.primitive].micromap.indices[place.triangle] = index < 0 ? index : numberOf(index);
        }
    source.baked = std::move(stored);
    return indices.subspan(count);
}

void DocumentBaker::readTexture(Source &source)
{
    try {
        source.texture = textures_.of(source.material);
        textures_.images().account(source.layers.size() * source.texture->texelCount() / kMapsForImage);
    } catch (const GltfUnsupported &error) {
        source.unreadable = true;
        for (const uint32_t primitive : source.primitives) {
            const BakedPrimitive &baked = result_.primitives[primitive];
            skip(baked.place, baked.material, SkipReason::UnsupportedImage, document_.reasonOf(baked.place, error));
        }
    }
}

// The surface of all alpha-tested triangles. Without a scene to measure, those that are baked count 1.
void DocumentBaker::measure()
{
    if (areas_ == nullptr) {
        measured_ = surfaceAreas(document_);
        areas_ = &measured_;
    }
    if (areas_->empty()) {
        for (const BakedPrimitive &primitive : result_.primitives)
            counted_[primitive.place].assign(primitive.micromap.indices.size(), 1);
        areas_ = &counted_;
    }
    for (const auto &[place, its] : *areas_)
        surface_ = std::accumulate(its.begin(), its.end(), surface_);
}

double DocumentBaker::areaOf(const TrianglePlace &place) const
{
    const auto its = areas_->find(result_.primitives[place.primitive].place);
    return its != areas_->end() && place.triangle < its->second.size() ? its->second[place.triangle] : 0;
}

// `leastShare`: how much of the surface triangles without one count, all together. Weights are shares of what is baked.
void DocumentBaker::weigh(double leastShare)
{
    double all = 0;
    for (const Source &source : sources_)
        for (const auto &[key, layer] : source.layers)
            for (const TrianglePlace &place : layer.places)
                all += areaOf(place);
    if (!(all > 0))
        return; // all count alike
    weighed_ = all;
    const double least = leastShare / static_cast<double>(std::max<size_t>(total_, 1));
    for (Source &source : sources_)
        for (auto &[key, layer] : source.layers)
            for (const TrianglePlace &place : layer.places)
                layer.weights.push_back(std::max(least, areaOf(place) / all));
}

// The surface whose outcome is known without looking at a texture.
double DocumentBaker::knownBeforehand() const
{
    double known = 0;
    for (const Source &source : sources_) {
        if (source.unreadable)
            continue;
        for (const uint32_t primitive : source.primitives) {
            const std::vector<int32_t> &indices = result_.primitives[primitive].micromap.indices;
            for (uint32_t t = 0; t < indices.size(); ++t)
                if (indices[t] == specialIndex(State::Opaque) || indices[t] == specialIndex(State::Transparent))
                    known += areaOf({primitive, t});
        }
    }
    return known;
}

// The surface that gets micromaps.
double DocumentBaker::surfaceOfSources() const
{
    double surface = 0;
    for (const Source &source : sources_)
        for (const uint32_t primitive : source.primitives)
            for (uint32_t t = 0; !source.unreadable && t < result_.primitives[primitive].micromap.indices.size(); ++t)
                surface += areaOf({primitive, t});
    return surface;
}

bool anyReadable(std::span<const Source> sources)
{
    return std::any_of(sources.begin(), sources.end(), [](const Source &source) { return !source.unreadable; });
}

// What has to be known of the triangles that are baked, in the unit of their weights.
double DocumentBaker::leastKnown() const
{
    const double wanted = std::max(0.0, *options_.targetKnown * surface_ - knownBeforehand());
    const bool weighed = std::any_of(sources_.begin(), sources_.end(), [](const Source &source) {
        return std::any_of(source.layers.begin(), source.layers.end(),
                           [](const auto &layer) { return !layer.second.weights.empty(); });
    });
    if (wanted > 0 && !(weighed && anyReadable(sources_)))
        rejectTarget(0);
    return wanted / weighed_;
}

// `known`: of the surface of the triangles that are baked.
void DocumentBaker::rejectTarget(double known) const
{
    // Rounded down, so that the next attempt succeeds.
    const double most = (known + knownBeforehand()) / surface_;
    std::string text = "the wanted share is not reached: at most " +
                       std::to_string(std::floor(most * 1e4) / 1e4).substr(0, 6) +
                       " of the alpha-tested surface is known with the highest level that is allowed";
    if (const double without = 1 - surfaceOfSources() / surface_; without > 1e-9)
        text += "; " + percent(without) + " of it gets no micromap";
    throw TargetNotReached(text);
}

// Those with the same texture one after another, so that it is read once.
std::vector<Source *> byTexture(std::span<Source> sources)
{
    std::vector<Source *> sorted;
    for (Source &source : sources)
        sorted.push_back(&source);
    std::stable_sort(sorted.begin(), sorted.end(), [](const Source *a, const Source *b) {
        return textureKeyOf(a->material) < textureKeyOf(b->material);
    });
    return sorted;
}

size_t triangleCount(std::span<const Source> sources)
{
    size_t count = 0;
    for (const Source &source : sources)
        for (const auto &[key, layer] : source.layers)
            count += layer.uvs.size();
    return count;
}

// One for each layer, with the textures that were read.
std::vector<BakeInput> DocumentBaker::inputsOf(std::span<const Source> sources)
{
    std::vector<BakeInput> inputs;
    for (const Source &source : sources) {
        if (source.unreadable)
            continue;
        for (const auto &[key, layer] : source.layers) {
            BakeInput &input = inputs.emplace_back();
            if (source.texture)
                input.textures = {source.texture.get(), 1};
            input.triangles = layer.uvs;
            input.uvTerms = static_cast<double>(key.uvTerms);
            input.weights = layer.weights;
            input.group = static_cast<uint32_t>(&source - sources.data());
            if (source.cutoff) {
                // The shader compares the product of both alphas with the cutoff.
                input.cutoff =
                    std::clamp(static_cast<double>(*source.cutoff), -1e30, 1e30) / static_cast<double>(key.alpha);
            } else {
                // A vertex' alpha below 1 leaves nothing opaque: from 2 on is never.
                const double never = key.alpha == 1 ? 0 : 0.5;
                input.cutoff = kBlendCutoff + never;
                input.valueTolerance = kBlendBand + never;
            }
        }
    }
    return inputs;
}

// The bytes of micromaps that no triangle of the sources has data in.
uint64_t bytesWithoutTriangles(std::span<const Source> sources)
{
    const auto count = std::count_if(sources.begin(), sources.end(),
                                     [](const Source &source) { return !source.unreadable && source.layers.empty(); });
    return kEmptyBytes * static_cast<uint64_t>(count);
}

BakeOptions DocumentBaker::optionsFor(std::span<const Source> sources) const
{
    BakeOptions options = options_.bake;
    options.emptyGroupBytes = kEmptyBytes;
    if (options.budget)
        *options.budget -= std::min(*options.budget, bytesWithoutTriangles(sources));
    if (options_.targetKnown)
        options.leastKnown = leastKnown();
    return options;
}

// Nothing without a cache, and where an image cannot be read at all.
std::optional<Digest> DocumentBaker::keyOf(std::span<const Source> sources)
{
    if (!options_.cache.exists())
        return std::nullopt;
    std::vector<Digest> textures;
    try {
        for (const Source &source : sources) {
            const int image = source.material.image;
            if (image >= 0 && !imageKeys_.contains(image))
                imageKeys_[image] = imageKey(textures_.encoded(image));
            textures.push_back(
                textureKey(source.material, image >= 0 ? std::optional(imageKeys_[image]) : std::nullopt));
        }
    } catch (const GltfError &) {
        return std::nullopt; // reading the texture reports it
    }
    return bakeKey(inputsOf(sources), textures, optionsFor(sources));
}

std::optional<Micromap> DocumentBaker::cached(std::span<const Source> sources, const Digest &key) const
{
    if (!options_.cache.get)
        return std::nullopt;
    const std::optional<std::vector<uint8_t>> value = options_.cache.get(key);
    return value ? micromapOf(*value, key, triangleCount(sources)) : std::nullopt;
}

// Of all micromaps together, so that many small ones do not report more often than a large one.
void DocumentBaker::report(size_t done)
{
    constexpr size_t kProgressParts = 256;
    const size_t part = done * kProgressParts / std::max<size_t>(total_, 1);
    if (!options_.bake.progress || (part == reported_ && done != total_))
        return;
    reported_ = part;
    options_.bake.progress(done, total_);
}

// Reads the textures and bakes the sources that have one then.
Micromap DocumentBaker::bakeRead(std::span<Source> sources)
{
    for (Source *source : byTexture(sources))
        readTexture(*source);
    const size_t triangles = triangleCount(sources);
    BakeOptions options = optionsFor(sources);
    if (options.progress)
        options.progress = [&](size_t done, size_t total) {
            const double share = total == 0 ? 1 : static_cast<double>(done) / static_cast<double>(total);
            report(done_ + static_cast<size_t>(share * static_cast<double>(triangles)));
        };
    try {
        return vellum::bake(inputsOf(sources), options).micromap;
    } catch (const BakeTooLittleKnown &error) {
        rejectTarget(error.most() * weighed_);
    }
}

void DocumentBaker::bakeSources(std::span<Source> sources)
{
    const std::optional<Digest> key = keyOf(sources);
    std::optional<Micromap> micromap = key ? cached(sources, *key) : std::nullopt;
    if (micromap) {
        ++result_.cacheHits;
        report(done_ + triangleCount(sources));
    } else {
        micromap = bakeRead(sources);
        const bool whole = std::none_of(sources.begin(), sources.end(), [](const Source &s) { return s.unreadable; });
        if (key && whole && options_.cache.put)
            options_.cache.put(*key, cacheValueOf(*micromap, *key));
        if (options_.cache.exists())
            ++result_.cacheMisses;
    }
    done_ += triangleCount(sources);
    std::span<const int32_t> indices = micromap->indices;
    for (Source &source : sources) {
        if (!source.unreadable)
            indices = takeResult(source, *micromap, indices);
        source.texture.reset();
        source.layers.clear();
    }
}

void DocumentBaker::bakeAll()
{
    if (options_.bake.budget || options_.targetKnown) {
        measure();
        weigh(options_.targetKnown ? 0 : kLeastShare);
        bakeSources(sources_); // what is limited is shared over all of them
        return;
    }
    int image = -1;
    for (Source *source : byTexture(sources_)) {
        if (std::exchange(image, source->material.image) != source->material.image)
            textures_.forgetEncoded();
        bakeSources({source, 1});
    }
}

// In the order of the sources. Drops the primitives of sources whose image cannot be decoded in this build.
void DocumentBaker::numberMicromaps()
{
    std::vector<bool> dropped(result_.primitives.size());
    for (Source &source : sources_) {
        for (const uint32_t primitive : source.primitives) {
            dropped[primitive] = !source.baked;
            result_.primitives[primitive].micromap.micromap = static_cast<uint32_t>(result_.micromaps.size());
        }
        if (source.baked)
            result_.micromaps.push_back(std::move(*source.baked));
    }
    std::vector<BakedPrimitive> kept;
    for (size_t i = 0; i < dropped.size(); ++i)
        if (!dropped[i])
            kept.push_back(std::move(result_.primitives[i]));
    result_.primitives = std::move(kept);
}

void DocumentBaker::collect()
{
    for (const PrimitivePlace place : trianglePrimitives(document_)) {
        if (options_.bake.cancelled && options_.bake.cancelled())
            throw BakeCancelled();
        try {
            addPrimitive(place);
        } catch (const GltfUnsupported &error) {
            skip(place, {}, SkipReason::Unsupported, document_.reasonOf(place, error));
        }
    }
    dropRareLayers();
    total_ = 0;
    for (const Source &source : sources_)
        for (const auto &[key, layer] : source.layers)
            total_ += layer.uvs.size();
}

DocumentBake DocumentBaker::bake()
{
    collect();
    bakeAll();
    numberMicromaps();
    result_.skipped = takeSkipped();
    return std::move(result_);
}

// In the file's order.
std::vector<SkippedPrimitive> DocumentBaker::takeSkipped()
{
    std::sort(result_.skipped.begin(), result_.skipped.end(),
              [](const SkippedPrimitive &a, const SkippedPrimitive &b) { return a.place < b.place; });
    return std::move(result_.skipped);
}

std::vector<OutlinedPrimitive> DocumentBaker::readablePrimitives() const
{
    std::vector<OutlinedPrimitive> readable;
    for (const Source &source : sources_)
        for (const uint32_t number : source.primitives)
            if (const BakedPrimitive &primitive = result_.primitives[number]; !source.unreadable)
                readable.push_back(
                    {primitive.place, primitive.name, primitive.material, primitive.micromap.indices.size()});
    std::sort(readable.begin(), readable.end(),
              [](const OutlinedPrimitive &a, const OutlinedPrimitive &b) { return a.place < b.place; });
    return readable;
}

DocumentOutlines DocumentBaker::outline(std::span<const std::optional<uint32_t>> levels,
                                        std::span<const uint64_t> budgets)
{
    collect();
    for (Source *source : byTexture(sources_))
        readTexture(*source);
    DocumentOutlines result;
    result.skipped = takeSkipped();
    result.primitives = readablePrimitives();
    if (!anyReadable(sources_))
        return result;
    measure();
    weigh(kLeastShare);
    result.measured = areas_ != &counted_;
    result.withoutMicromap = 1 - surfaceOfSources() / surface_;
    std::vector<double> areas;
    for (const Source &source : sources_)
        for (const auto &[key, layer] : source.layers)
            for (size_t i = 0; !source.unreadable && i < layer.places.size(); ++i)
                areas.push_back(areaOf(layer.places[i]));
    const double all = std::accumulate(areas.begin(), areas.end(), 0.0);
    const double beforehand = knownBeforehand();
    const uint64_t empty = bytesWithoutTriangles(sources_);
    std::vector<uint64_t> left;
    for (const uint64_t budget : budgets)
        left.push_back(budget - std::min(budget, empty));
    outlineBakes(inputsOf(sources_), optionsFor(sources_), levels, left, [&](const BakeOutline &outline) {
        double known = 0;
        for (size_t i = 0; i < areas.size(); ++i)
            known += areas[i] * double{outline.known[i]};
        DocumentOutline &made = result.outlines.emplace_back();
        made.setting = outline.setting;
        if (outline.setting.budget)
            made.setting.budget = budgets[result.outlines.size() - 1 - 2 * levels.size()];
        made.bytes = outline.bytes + empty;
        made.tooLarge = outline.tooLarge;
        made.levels = outline.levels;
        made.proven = (beforehand + known) / surface_;
        made.known = outline.setting.format == Format::TwoState ? (beforehand + all) / surface_ : made.proven;
    });
    return result;
}

} // namespace

const char *nameOf(SkipReason reason)
{
    switch (reason) {
    case SkipReason::AlphaModeBlend: return "alphaModeBlend";
    case SkipReason::Excluded: return "excluded";
    case SkipReason::AlphaChanges: return "alphaChanges";
    case SkipReason::CompressedStrip: return "compressedStrip";
    case SkipReason::NoTriangles: return "noTriangles";
    case SkipReason::NoTextureCoordinates: return "noTextureCoordinates";
    case SkipReason::AmbiguousTriangles: return "ambiguousTriangles";
    case SkipReason::UnsupportedImage: return "unsupportedImage";
    case SkipReason::Unsupported: break;
    }
    return "unsupported";
}

StoredMicromaps storedOf(DocumentBake bake)
{
    StoredMicromaps stored;
    stored.micromaps = std::move(bake.micromaps);
    stored.blendCutoff = bake.blendCutoff;
    for (BakedPrimitive &primitive : bake.primitives)
        stored.primitives[primitive.place] = std::move(primitive.micromap);
    return stored;
}

DocumentBake bakeDocument(const Document &document, const DocumentBakeOptions &options, const SurfaceAreas *areas)
{
    return document.named([&] { return DocumentBaker(document, options, areas).bake(); });
}

DocumentOutlines outlineDocument(const Document &document, const DocumentBakeOptions &options,
                                 std::span<const std::optional<uint32_t>> levels, std::span<const uint64_t> budgets)
{
    return document.named([&] { return DocumentBaker(document, options, nullptr).outline(levels, budgets); });
}

} // namespace vellum
