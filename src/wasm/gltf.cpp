// SPDX-License-Identifier: Apache-2.0
// glTF files for JavaScript: bake, sweep, read, inspect, verify. A file is bytes in memory, called by a name.
#include "vellum/gltf.h"

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "core/utf8_path.h"
#include "gltf/file/system/memory_files.h"
#include "gltf/micromaps/document_writer.h"
#include "gltf/micromaps/stored_micromaps.h"
#include "gltf/micromaps/sweep.h"
#include "gltflibrary/options.h"
#include "library/call.h"
#include "verify/file.h"
#include "wasm/call.h"
#include "wasm/file.h"

using namespace vellum;
using namespace vellum::wasm;

namespace
{

using Words = Result::Words;

// The strings that follow each other, each ended by a zero.
std::vector<const char *> stringsOf(const char *first, size_t count)
{
    std::vector<const char *> strings;
    for (; strings.size() < count; first += std::char_traits<char>::length(first) + 1)
        strings.push_back(first);
    return strings;
}

// `excluded`, which must stay: the patterns of materials, then those of meshes.
VellumGltfBakeOptions gltfOptionsOf(uint32_t flags, float blendCutoff, double targetKnown,
                                    const std::vector<const char *> &excluded, size_t materialCount)
{
    VellumGltfBakeOptions options;
    vellumInitGltfBakeOptions(&options, sizeof options);
    options.flags = flags;
    options.blendCutoff = blendCutoff;
    options.targetKnown = targetKnown;
    options.excludedMaterials = excluded.data();
    options.excludedMaterialCount = materialCount;
    options.excludedMeshes = excluded.data() + materialCount;
    options.excludedMeshCount = excluded.size() - materialCount;
    return options;
}

void writePlace(JsonWriter &json, PrimitivePlace place, const std::string &name)
{
    json.member("mesh", place.mesh).member("primitive", place.primitive).member("name", name);
}

void writeFindings(JsonWriter &json, const std::vector<MicromapFinding> &findings)
{
    json.list("findings", findings, [&](const MicromapFinding &finding) {
        json.beginObject().member("place", finding.place).member("message", finding.message).end();
    });
}

void inspect(const Document &document, Result &result)
{
    const CheckedMicromaps checked = checkMicromaps(document);
    JsonWriter json(JsonStyle::Compact);
    json.beginObject().member("extension", checked.stored.extension);
    writeFindings(json, checked.findings);
    const bool valid = checked.findings.empty();
    const std::vector<StoredMicromap> micromaps = valid ? checked.stored.micromaps : std::vector<StoredMicromap>();
    std::vector<StateCounter> counters;
    json.list("micromaps", micromaps, [&](const StoredMicromap &micromap) {
        counters.emplace_back(micromap.data);
        json.beginObject().member("triangles", micromap.triangles.size()).member("bytes", micromap.bytes());
        writeUsages(json, std::span(micromap.usage));
        json.end();
    });
    json.key("primitives").beginArray();
    for (const auto &[place, primitive] : checked.stored.primitives) {
        if (!valid)
            break;
        std::array<uint64_t, 4> states{};
        std::array<uint64_t, 4> special{};
        for (const int32_t index : primitive.indices) {
            if (index < 0) {
                ++special[static_cast<size_t>(-1 - index)];
                continue;
            }
            const auto record = static_cast<size_t>(index) + primitive.baseTriangle;
            const StateCounts counts =
                counters[primitive.micromap].count(micromaps[primitive.micromap].triangles[record]);
            for (size_t s = 0; s < states.size(); ++s)
                states[s] += counts[s];
        }
        json.beginObject();
        writePlace(json, place, document.nameOf(place));
        json.member("micromap", primitive.micromap).member("triangles", primitive.indices.size());
        json.values("states", states).values("special", special).end();
    }
    result.text = json.end().end().text();
}

void sweep(const Document &document, const DocumentBakeOptions &options, Result &result)
{
    const DocumentOutlines outlines = sweepDocument(document, options);
    const std::vector<SweepRow> rows = rowsOf({&outlines});
    JsonWriter json(JsonStyle::Compact);
    json.beginObject().member("hadMicromaps", hasMicromaps(document)).member("measured", outlines.measured);
    json.member("withoutMicromap", outlines.withoutMicromap);
    json.list("primitives", outlines.primitives, [&](const OutlinedPrimitive &primitive) {
        json.beginObject();
        writePlace(json, primitive.place, primitive.name);
        json.member("material", primitive.material).member("triangles", primitive.triangles).end();
    });
    json.list("skipped", outlines.skipped, [&](const SkippedPrimitive &skipped) {
        json.beginObject().member("name", skipped.name).member("material", skipped.material);
        json.member("code", nameOf(skipped.code)).member("reason", skipped.reason).end();
    });
    json.list("rows", rows, [&](const SweepRow &row) { write(row, json); });
    json.key("recommendation");
    if (const auto recommendation = recommend(rows, ""))
        json.beginObject().member("row", recommendation->row).member("reason", recommendation->reason).end();
    else
        json.null();
    result.text = json.end().text();
}

constexpr std::array kKindNames = {"wrong", "outsideMargins", "needlesslyUnknown"};

void write(JsonWriter &json, const verify::Counts &counts)
{
    json.key("counts").beginObject().member("microTriangles", counts.microTriangles());
    json.member("transparent", counts.transparent).member("opaque", counts.opaque).member("unknown", counts.unknown);
    for (size_t kind = 0; kind < verify::kKinds; ++kind)
        json.member(kKindNames[kind], counts.findings[kind]);
    json.member("open", counts.open).key("twoState").beginObject();
    json.member("true", counts.twoStateTrue).member("mixed", counts.twoStateMixed);
    json.member("reversed", counts.twoStateReversed).end().end();
}

void verifyFile(const Document &document, bool exact, Result &result)
{
    verify::FileOptions options;
    options.threads = 1;
    if (exact)
        options.tolerances = verify::Tolerances{0, 0, 0, 0};
    options.progress = [](size_t done, size_t total) {
        if (vellumProgressOfCall(static_cast<double>(done), static_cast<double>(total)) != 0 ||
            vellumCancelledOfCall() != 0)
            throw BakeCancelled();
    };
    const verify::FileReport report = verify::verifyDocument(document, options);
    JsonWriter json(JsonStyle::Compact);
    json.beginObject().member("extension", report.stored.extension);
    writeFindings(json, report.findings);
    write(json, report.counts());
    json.list("primitives", report.primitives, [&](const verify::PrimitiveReport &primitive) {
        json.beginObject();
        writePlace(json, primitive.place, primitive.name);
        json.member("material", primitive.material).member("triangles", primitive.triangles);
        json.member("caution", primitive.caution);
        write(json, primitive.result.counts);
        json.list("findings", primitive.result.findings, [&](const verify::Finding &finding) {
            json.beginObject().member("kind", kKindNames[static_cast<size_t>(finding.kind)]);
            json.member("triangle", finding.triangle).member("microTriangle", finding.microTriangle);
            json.member("level", finding.level).member("special", finding.special);
            json.member("state", static_cast<uint32_t>(finding.state)).values("uv", std::array{finding.u, finding.v});
            json.member("value", finding.value).end();
        });
        json.end();
    });
    json.list("unverified", report.unverified, [&](const verify::Unverified &primitive) {
        json.beginObject();
        writePlace(json, primitive.place, primitive.name);
        json.member("reason", primitive.reason).end();
    });
    result.text = json.end().text();
}

// The micromaps of a file by vellum/gltf.h; bytes are parts of the result.
void describe(const VellumGltf *gltf, Result &result)
{
    VellumGltfInfo info{};
    info.structSize = sizeof info;
    vellumGetGltfInfo(gltf, &info);
    JsonWriter json(JsonStyle::Compact);
    json.beginObject().member("extension", info.extension).key("micromaps").beginArray();
    for (size_t i = 0; i < info.micromapCount; ++i) {
        VellumGltfMicromapInfo micromap{};
        micromap.structSize = sizeof micromap;
        vellumGetGltfMicromapInfo(gltf, i, &micromap);
        json.beginObject().member("data", result.add(micromap.data, micromap.dataSize));
        json.member("triangles", result.add(micromap.triangles, micromap.triangleCount * sizeof *micromap.triangles));
        writeUsages(json, std::span(micromap.usages, micromap.usageCount));
        json.end();
    }
    json.end().key("primitives").beginArray();
    for (size_t i = 0; i < info.primitiveCount; ++i) {
        VellumGltfPrimitiveInfo primitive{};
        primitive.structSize = sizeof primitive;
        vellumGetGltfPrimitiveInfo(gltf, i, &primitive);
        json.beginObject();
        writePlace(json, {primitive.mesh, primitive.primitive}, primitive.name);
        json.member("micromap", primitive.micromap).member("baseTriangle", primitive.baseTriangle);
        json.member("indices", result.add(primitive.indices, primitive.indexCount * sizeof *primitive.indices));
        writeUsages(json, std::span(primitive.usages, primitive.usageCount));
        json.end();
    }
    result.text = json.end().end().text();
}

// What a bake of a file leaves: the owner of its result.
struct Baked {
    std::vector<uint8_t> output;
    std::vector<std::pair<std::string, std::string>> skipped;
    bool outOfMemory = false;

    // A callback must not throw. A vector of 2 GiB is a std::length_error.
    template <typename Keep>
    void keep(Keep &&function) noexcept
    {
        try {
            function();
        } catch (const std::exception &) {
            outOfMemory = true;
        }
    }
};

Baked &bakedOf(void *userData)
{
    return *static_cast<Baked *>(static_cast<Result *>(userData)->owner.get());
}

void describe(const VellumGltfBakeInfo &info, Result &result)
{
    const Baked &baked = bakedOf(&result);
    JsonWriter json(JsonStyle::Compact);
    json.beginObject().member("output", result.add(baked.output.data(), baked.output.size()));
    json.member("micromapCount", info.micromapCount).member("primitiveCount", info.primitiveCount);
    json.member("micromapSize", info.micromapSize).member("inputSize", info.inputSize);
    json.member("outputSize", info.outputSize).member("replaced", info.replaced != 0);
    json.list("skipped", baked.skipped, [&](const auto &skipped) {
        json.beginObject().member("name", skipped.first).member("reason", skipped.second).end();
    });
    result.text = json.end().text();
}

} // namespace

// The files that calls may read until they are destroyed; the latest set is used.
VELLUM_EXPORT("createFiles") MemoryFiles *vellumCreateFilesOfCall()
{
    return guardedExport([] { return std::make_unique<MemoryFiles>().release(); });
}

// `path` is relative to the folder of `model`, which is the name of the file of the call.
VELLUM_EXPORT("addFile")
bool vellumAddFileOfCall(MemoryFiles *files, const char *model, const char *path, const uint8_t *bytes, size_t size)
{
    return guardedExport([&] {
        files->add(utf8Path(model).parent_path() / utf8Path(path), {bytes, size});
        return true;
    });
}

VELLUM_EXPORT("destroyFiles") void vellumDestroyFilesOfCall(MemoryFiles *files)
{
    delete files;
}

// `patterns`: the excluded materials, then the excluded meshes.
VELLUM_EXPORT("bakeGltf")
const Words *vellumBakeGltfOfCall(const uint8_t *bytes, size_t size, const char *name, const double *numbers,
                                  uint32_t flags, float blendCutoff, double targetKnown, const char *patterns,
                                  size_t materialCount, size_t meshCount)
{
    return guardedExport([&] {
        auto result = std::make_unique<Result>();
        result->owner = std::make_shared<Baked>();
        const VellumBakeOptions bake = optionsOf(numbers, *result);
        const std::vector<const char *> excluded = stringsOf(patterns, materialCount + meshCount);
        VellumGltfBakeOptions options = gltfOptionsOf(flags, blendCutoff, targetKnown, excluded, materialCount);
        options.skipped = [](void *userData, const char *place, const char *note) {
            bakedOf(userData).keep([&] { bakedOf(userData).skipped.emplace_back(place, note); });
        };
        const auto output = [](void *userData, const void *part, size_t partSize) {
            const auto *first = static_cast<const uint8_t *>(part);
            std::vector<uint8_t> &all = bakedOf(userData).output;
            bakedOf(userData).keep([&] { all.insert(all.end(), first, first + partSize); });
        };
        VellumGltfBakeInfo info{};
        info.structSize = sizeof info;
        VellumResult code = vellumBakeGltfMemory(bytes, size, name, &bake, &options, output, &info);
        if (code == VELLUM_SUCCESS && bakedOf(result.get()).outOfMemory) {
            code = VELLUM_ERROR_OUT_OF_MEMORY;
            result->text = "out of memory";
        } else if (code == VELLUM_SUCCESS) {
            describe(info, *result);
        }
        return finish(std::move(result), code);
    });
}

// As bakeGltf. Level, format and budget are ignored.
VELLUM_EXPORT("sweepGltf")
const Words *vellumSweepGltfOfCall(const uint8_t *bytes, size_t size, const char *name, const double *numbers,
                                   uint32_t flags, float blendCutoff, double targetKnown, const char *patterns,
                                   size_t materialCount, size_t meshCount)
{
    return run([&](Result &result) {
        const VellumBakeOptions given = optionsOf(numbers, result);
        const std::vector<const char *> excluded = stringsOf(patterns, materialCount + meshCount);
        DocumentBakeOptions options;
        library::readDocumentOptions(given, gltfOptionsOf(flags, blendCutoff, targetKnown, excluded, materialCount),
                                     options);
        const library::Callbacks callbacks(given, options.bake);
        sweep(File{bytes, size, name}.document(), options, result);
    });
}

VELLUM_EXPORT("readGltf") const Words *vellumReadGltfOfCall(const uint8_t *bytes, size_t size, const char *name)
{
    return guardedExport([&] {
        auto result = std::make_unique<Result>();
        VellumGltf *gltf = nullptr;
        const VellumResult code = vellumReadGltfMemory(bytes, size, name, keepMessage, result.get(), &gltf);
        if (code == VELLUM_SUCCESS) {
            result->owner =
                std::shared_ptr<void>(gltf, [](void *read) { vellumDestroyGltf(static_cast<VellumGltf *>(read)); });
            describe(gltf, *result);
        }
        return finish(std::move(result), code);
    });
}

VELLUM_EXPORT("inspectGltf") const Words *vellumInspectGltfOfCall(const uint8_t *bytes, size_t size, const char *name)
{
    return run([&](Result &result) { inspect(File{bytes, size, name}.document(), result); });
}

VELLUM_EXPORT("verifyGltf")
const Words *vellumVerifyGltfOfCall(const uint8_t *bytes, size_t size, const char *name, int exact)
{
    return run([&](Result &result) { verifyFile(File{bytes, size, name}.document(), exact != 0, result); });
}
