// SPDX-License-Identifier: Apache-2.0
// The functions of vellum/gltf.h.
#include "vellum/gltf.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <new>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/utf8_path.h"
#include "gltf/micromaps/file_bake.h"
#include "gltflibrary/options.h"
#include "library/call.h"
#include "library/inputs.h"

namespace vellum::library
{
VELLUM_STRUCTURE(VellumGltfInfo, primitiveCount);
VELLUM_STRUCTURE(VellumGltfMicromapInfo, usageCount);
VELLUM_STRUCTURE(VellumGltfPrimitiveInfo, reserved);
VELLUM_STRUCTURE(VellumGltfBakeOptions, cachePut);
VELLUM_STRUCTURE(VellumGltfBakeInfo, cacheMisses);

VellumGltfBakeOptions Structure<VellumGltfBakeOptions>::defaults()
{
    VellumGltfBakeOptions options{};
    options.structSize = sizeof options;
    options.blendCutoff = 0.5f;
    options.targetKnown = 1;
    return options;
}
} // namespace vellum::library

using namespace vellum;
using namespace vellum::library;

struct VellumGltf {
    struct Primitive {
        PrimitivePlace place;
        std::string name;
        std::vector<VellumMicromapUsage> usages;
        const PrimitiveMicromap *micromap; // of `stored`
    };

    StoredMicromaps stored;
    std::vector<std::vector<VellumMicromapUsage>> usages; // of each micromap
    std::vector<Primitive> primitives;                    // by place
};

namespace
{

std::filesystem::path pathOf(const char *argument, const char *given)
{
    if (given == nullptr || *given == '\0')
        throw invalid(std::string(argument) + " is " + (given == nullptr ? "null" : "empty"));
    return utf8Path(given);
}

// Calls what reads or writes a file.
template <typename Function>
auto ofFile(Function &&function)
{
    try {
        return function();
    } catch (const GltfError &error) {
        throw Failure(VELLUM_ERROR_FILE, error.what());
    }
}

// The file of a path, or of bytes in memory.
struct Source {
    Source(const char *argument, const char *given) : path(pathOf(argument, given)) {}
    Source(const void *given, size_t size, const char *name) : Source("name", name)
    {
        if (given == nullptr && size != 0)
            throw invalid("bytes is null, but size is " + std::to_string(size));
        const auto *first = static_cast<const uint8_t *>(given);
        bytes.emplace(first, first + size);
    }
    // Once.
    Document document() { return bytes ? Document(path, std::move(*bytes)) : Document(path); }

    std::filesystem::path path;
    std::optional<std::vector<uint8_t>> bytes;
};

std::unique_ptr<VellumGltf> readFile(Source source)
{
    return ofFile([&] {
        const Document document = source.document();
        auto read = std::make_unique<VellumGltf>();
        read->stored = readMicromaps(document);
        const std::vector<StoredMicromap> &micromaps = read->stored.micromaps;
        for (const StoredMicromap &micromap : micromaps)
            read->usages.push_back(libraryUsages(usageOf(micromap.triangles)));
        for (const auto &[place, micromap] : read->stored.primitives)
            read->primitives.push_back({place, document.nameOf(place),
                                        libraryUsages(usageOf(micromaps[micromap.micromap].triangles, micromap.indices,
                                                              micromap.baseTriangle)),
                                        &micromap});
        return read;
    });
}

const VellumGltf &existing(const VellumGltf *gltf)
{
    if (gltf == nullptr)
        throw invalid("there is no VellumGltf");
    return *gltf;
}

std::vector<std::string> patterns(const char *member, const char *const *given, size_t count)
{
    if (given == nullptr && count != 0)
        throw invalid(std::string(member) + " is null, but " + std::to_string(count) + " patterns");
    std::vector<std::string> all;
    for (size_t i = 0; i < count; ++i) {
        if (given[i] == nullptr)
            throw invalid(std::string(member) + "[" + std::to_string(i) + "] is null");
        all.emplace_back(given[i]);
    }
    return all;
}

} // namespace

void vellum::library::readDocumentOptions(const VellumBakeOptions &bake, const VellumGltfBakeOptions &given,
                                          DocumentBakeOptions &options)
{
    options.bake = readOptions(bake);
    if (bake.compareOp != VELLUM_COMPARE_OP_GREATER_OR_EQUAL)
        throw invalid("compareOp is " + std::to_string(bake.compareOp) +
                      ", not VELLUM_COMPARE_OP_GREATER_OR_EQUAL, which is glTF's");
    if (bake.flags != 0)
        throw invalid("flags of VellumBakeOptions is " + std::to_string(bake.flags) + ", not 0");
    constexpr uint32_t kFlags =
        uint32_t{VELLUM_GLTF_BAKE_BLEND_BIT} | uint32_t{VELLUM_GLTF_BAKE_EMBED_BIT} |
        uint32_t{VELLUM_GLTF_BAKE_BLEND_CUTOFF_BIT} | uint32_t{VELLUM_GLTF_BAKE_FALLBACK_IMAGES_BIT} |
        uint32_t{VELLUM_GLTF_BAKE_TARGET_KNOWN_BIT} | uint32_t{VELLUM_GLTF_BAKE_REPLACE_COPIES_BIT};
    if ((given.flags & ~kFlags) != 0)
        throw invalid("flags is " + std::to_string(given.flags) + ", not made of VellumGltfBakeFlagBits");
    options.blend = (given.flags & VELLUM_GLTF_BAKE_BLEND_BIT) != 0;
    if (!std::isfinite(given.blendCutoff))
        throw invalid("blendCutoff is not finite");
    if ((given.flags & VELLUM_GLTF_BAKE_BLEND_CUTOFF_BIT) != 0)
        options.blendCutoff = given.blendCutoff;
    options.fallbackImages = (given.flags & VELLUM_GLTF_BAKE_FALLBACK_IMAGES_BIT) != 0;
    if (!(given.targetKnown >= 0 && given.targetKnown <= 1))
        throw invalid("targetKnown is " + std::to_string(given.targetKnown) + ", not 0 to 1");
    if ((given.flags & VELLUM_GLTF_BAKE_TARGET_KNOWN_BIT) != 0) {
        if (options.bake.budget)
            throw invalid("budget and VELLUM_GLTF_BAKE_TARGET_KNOWN_BIT exclude each other");
        if (options.bake.format == Format::TwoState)
            throw invalid("VELLUM_GLTF_BAKE_TARGET_KNOWN_BIT is for 4 states: with 2 nothing is unknown");
        options.targetKnown = given.targetKnown;
    }
    options.excludedMaterials = patterns("excludedMaterials", given.excludedMaterials, given.excludedMaterialCount);
    options.excludedMeshes = patterns("excludedMeshes", given.excludedMeshes, given.excludedMeshCount);
}

namespace
{

// The cache of these callbacks, either of which may be null.
BakeCache cacheOf(const VellumGltfBakeOptions &given, void *userData)
{
    using Value = std::optional<std::vector<uint8_t>>;
    BakeCache cache;
    if (given.cacheGet != nullptr)
        cache.get = [get = given.cacheGet, userData](const Digest &key) {
            Value value;
            // No exception may pass through the caller's code.
            const VellumGltfCacheValueCallback take = [](void *receiver, const void *bytes, size_t size) {
                try {
                    const auto *first = static_cast<const uint8_t *>(bytes);
                    static_cast<Value *>(receiver)->emplace(first, first + size);
                } catch (const std::bad_alloc &) {
                    static_cast<Value *>(receiver)->reset();
                }
            };
            get(userData, key.data(), take, &value);
            return value;
        };
    if (given.cachePut != nullptr)
        cache.put = [put = given.cachePut, userData](const Digest &key, std::span<const uint8_t> value) {
            put(userData, key.data(), value.data(), value.size());
        };
    return cache;
}

VellumGltfBakeInfo infoOf(const FileBake &made)
{
    VellumGltfBakeInfo info{};
    info.micromapCount = made.bake.micromaps.size();
    info.primitiveCount = made.bake.primitives.size();
    info.skippedCount = made.bake.skipped.size();
    for (const StoredMicromap &micromap : made.bake.micromaps)
        info.micromapSize += micromap.bytes();
    info.inputSize = made.inputBytes;
    info.outputSize = made.outputBytes;
    info.replaced = made.replaced ? 1 : 0;
    info.cacheHits = made.bake.cacheHits;
    info.cacheMisses = made.bake.cacheMisses;
    return info;
}

// The functions of files and of memory, for what makes their Source.

template <typename MakeSource>
VellumResult read(MakeSource &&source, VellumMessageCallback message, void *userData, VellumGltf **gltf)
{
    if (gltf != nullptr)
        *gltf = nullptr;
    return guarded(message, userData, [&] {
        if (gltf == nullptr)
            throw invalid("there is no place for the result");
        *gltf = readFile(source()).release();
    });
}

template <typename MakeSource>
VellumResult check(MakeSource &&source, size_t most, VellumGltfNoteCallback finding, VellumMessageCallback message,
                   void *userData)
{
    return guarded(message, userData, [&] {
        if (finding == nullptr)
            throw invalid("there is no callback for findings");
        Source file = source();
        const std::vector<MicromapFinding> found =
            ofFile([&] { return checkMicromaps(file.document(), most).findings; });
        for (size_t i = 0; i < found.size() && i < most; ++i)
            finding(userData, found[i].place.c_str(), found[i].message.c_str());
    });
}

// `target` gets the options and userData; it returns the path of the output, or sets a sink.
template <typename MakeSource, typename Target>
VellumResult bakeInto(MakeSource &&source, Target &&target, const VellumBakeOptions *bake,
                      const VellumGltfBakeOptions *options, VellumGltfBakeInfo *info)
{
    return guardedWith(bake, [&](const VellumBakeOptions &known) {
        VellumGltfBakeOptions gltf = Structure<VellumGltfBakeOptions>::defaults();
        if (options != nullptr) {
            gltf = knownPart(options);
            checkUnknownPart(options);
        }
        if (info != nullptr)
            (void)checkedSize(info); // before anything is written
        Source from = source();
        FileBakeOptions wanted;
        const std::filesystem::path to = target(wanted, known.userData);
        readDocumentOptions(known, gltf, wanted);
        wanted.embed = wanted.embed || (gltf.flags & VELLUM_GLTF_BAKE_EMBED_BIT) != 0;
        wanted.replaceCopies = (gltf.flags & VELLUM_GLTF_BAKE_REPLACE_COPIES_BIT) != 0;
        wanted.cache = cacheOf(gltf, known.userData);
        // Whoever stops the bake at its last triangle is heard before the first byte is written.
        const Callbacks callbacks(known, wanted.bake);
        const FileBake made = ofFile([&] {
            try {
                return bakeFile(from.document(), to, wanted);
            } catch (const BakeTooLarge &error) {
                throw Failure(VELLUM_ERROR_TOO_LARGE, utf8Text(from.path) + ": " + error.what());
            } catch (const TargetNotReached &error) {
                throw Failure(VELLUM_ERROR_FILE, utf8Text(from.path) + ": " + error.what());
            }
        });
        if (info != nullptr)
            fill(info, infoOf(made));
        if (gltf.skipped != nullptr)
            for (const SkippedPrimitive &primitive : made.bake.skipped)
                gltf.skipped(known.userData, primitive.name.c_str(), primitive.reason.c_str());
    });
}

} // namespace

VellumResult vellumReadGltf(const char *path, VellumMessageCallback message, void *userData, VellumGltf **gltf)
{
    return read([&] { return Source("path", path); }, message, userData, gltf);
}

VellumResult vellumReadGltfMemory(const void *bytes, size_t size, const char *name, VellumMessageCallback message,
                                  void *userData, VellumGltf **gltf)
{
    return read([&] { return Source(bytes, size, name); }, message, userData, gltf);
}

void vellumDestroyGltf(VellumGltf *gltf)
{
    delete gltf;
}

VellumResult vellumGetGltfInfo(const VellumGltf *gltf, VellumGltfInfo *info)
{
    return guarded([&] {
        const VellumGltf &read = existing(gltf);
        VellumGltfInfo values{};
        values.extension = read.stored.extension.c_str();
        values.micromapCount = read.stored.micromaps.size();
        values.primitiveCount = read.primitives.size();
        fill(info, values);
    });
}

VellumResult vellumGetGltfMicromapInfo(const VellumGltf *gltf, size_t micromap, VellumGltfMicromapInfo *info)
{
    return guarded([&] {
        const VellumGltf &read = existing(gltf);
        if (micromap >= read.stored.micromaps.size())
            throw invalid("there is no such micromap");
        const StoredMicromap &stored = read.stored.micromaps[micromap];
        VellumGltfMicromapInfo values{};
        values.data = stored.data.data();
        values.dataSize = stored.data.size();
        values.triangles = trianglesOf(stored.triangles);
        values.triangleCount = stored.triangles.size();
        values.usages = read.usages[micromap].data();
        values.usageCount = read.usages[micromap].size();
        fill(info, values);
    });
}

VellumResult vellumGetGltfPrimitiveInfo(const VellumGltf *gltf, size_t number, VellumGltfPrimitiveInfo *info)
{
    return guarded([&] {
        const VellumGltf &read = existing(gltf);
        if (number >= read.primitives.size())
            throw invalid("there is no such primitive");
        const VellumGltf::Primitive &primitive = read.primitives[number];
        VellumGltfPrimitiveInfo values{};
        values.name = primitive.name.c_str();
        values.mesh = primitive.place.mesh;
        values.primitive = primitive.place.primitive;
        values.micromap = primitive.micromap->micromap;
        values.indices = primitive.micromap->indices.data();
        values.indexCount = primitive.micromap->indices.size();
        values.usages = primitive.usages.data();
        values.usageCount = primitive.usages.size();
        values.baseTriangle = primitive.micromap->baseTriangle;
        fill(info, values);
    });
}

size_t vellumFindGltfPrimitive(const VellumGltf *gltf, uint32_t mesh, uint32_t primitive)
{
    if (gltf == nullptr)
        return VELLUM_GLTF_NO_MICROMAP;
    const auto found =
        std::lower_bound(gltf->primitives.begin(), gltf->primitives.end(), PrimitivePlace{mesh, primitive},
                         [](const VellumGltf::Primitive &a, const PrimitivePlace &b) { return a.place < b; });
    if (found == gltf->primitives.end() || found->place != PrimitivePlace{mesh, primitive})
        return VELLUM_GLTF_NO_MICROMAP;
    return static_cast<size_t>(found - gltf->primitives.begin());
}

VellumResult vellumCheckGltf(const char *path, size_t most, VellumGltfNoteCallback finding,
                             VellumMessageCallback message, void *userData)
{
    return check([&] { return Source("path", path); }, most, finding, message, userData);
}

VellumResult vellumCheckGltfMemory(const void *bytes, size_t size, const char *name, size_t most,
                                   VellumGltfNoteCallback finding, VellumMessageCallback message, void *userData)
{
    return check([&] { return Source(bytes, size, name); }, most, finding, message, userData);
}

void vellumInitGltfBakeOptions(VellumGltfBakeOptions *options, size_t structSize)
{
    initialize(options, structSize);
}

VellumResult vellumBakeGltf(const char *input, const char *output, const VellumBakeOptions *bake,
                            const VellumGltfBakeOptions *options, VellumGltfBakeInfo *info)
{
    return bakeInto([&] { return Source("input", input); },
                    [&](FileBakeOptions &, void *) { return pathOf("output", output); }, bake, options, info);
}

VellumResult vellumBakeGltfMemory(const void *bytes, size_t size, const char *name, const VellumBakeOptions *bake,
                                  const VellumGltfBakeOptions *options, VellumGltfOutputCallback output,
                                  VellumGltfBakeInfo *info)
{
    const auto sink = [&](FileBakeOptions &wanted, void *userData) {
        if (output == nullptr)
            throw invalid("there is no callback for the output");
        wanted.embed = true;
        wanted.sink = [=](const FileContent &content) {
            for (const auto &piece : content.pieces())
                output(userData, piece.data(), piece.size());
        };
        return std::filesystem::path();
    };
    return bakeInto([&] { return Source(bytes, size, name); }, sink, bake, options, info);
}
