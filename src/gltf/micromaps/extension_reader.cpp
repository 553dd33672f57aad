// SPDX-License-Identifier: Apache-2.0
// Reads the extension and collects whatever breaks a rule on the way.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "core/curve.h"
#include "gltf/data/accessor.h"
#include "gltf/document.h"
#include "gltf/file/json_tree.h"
#include "gltf/micromaps/stored_micromaps.h"

namespace vellum
{
namespace
{

class ExtensionReader
{
public:
    // Stops at `most` findings.
    ExtensionReader(const Document &document, size_t most);

    // Implements lossOfMicromaps().
    [[nodiscard]] std::optional<std::string> loss() const;
    // Reads the micromaps that are whole, and leaves the others empty.
    StoredMicromaps read();
    [[nodiscard]] std::vector<MicromapFinding> takeFindings() { return std::move(findings_); }

private:
    // Thrown at the first finding of an element or a primitive after which the rest of it has no meaning.
    struct Broken {
    };

    void note(const std::string &message);
    [[noreturn]] void fail(const std::string &message);
    [[nodiscard]] bool full() const { return findings_.size() >= most_; }
    template <typename Read>
    void at(std::string place, Read &&read);

    void findExtension();
    void readMicromap(const JsonValue &element, StoredMicromap &micromap);
    void readUsage(const JsonValue &element, StoredMicromap &micromap);
    void readRecords(const JsonValue &element, StoredMicromap &micromap);
    void checkRecords(const StoredMicromap &micromap);
    void checkOverlap(const StoredMicromap &micromap);
    void checkUsage(const StoredMicromap &micromap);
    void readMesh(uint32_t mesh, const JsonValue &value);
    void readPrimitive(PrimitivePlace place, const JsonValue &extension);
    uint64_t triangleCount(PrimitivePlace place);
    std::vector<int32_t> readIndices(int64_t accessor, uint64_t triangles);
    void checkIndices(const PrimitiveMicromap &primitive, size_t records);

    int64_t required(const JsonValue &object, const char *name);
    std::vector<int64_t> requiredList(const JsonValue &object, const char *name);
    std::span<const uint8_t> view(int64_t index, const char *name);
    // Many elements may name one buffer view: what is copied out of the file is bounded.
    void account(size_t bytes);

    const Document &document_;
    JsonValue root_;
    size_t most_;
    std::string place_;
    std::vector<MicromapFinding> findings_;
    uint64_t allowance_;
    StoredMicromaps stored_;
    std::vector<bool> whole_; // by micromap
};

constexpr size_t kRecordBytes = 8;

std::string number(uint64_t value)
{
    return std::to_string(value);
}

uint64_t bufferBytes(const gltf_json::Model &model)
{
    uint64_t bytes = 0;
    for (const gltf_json::Buffer &buffer : model.buffers)
        bytes += buffer.data.size();
    return bytes;
}

// Buffer views that accessors, images and compressed meshes have.
std::set<int64_t> viewsOfOthers(const JsonValue &root)
{
    std::set<int64_t> views;
    const auto add = [&](const JsonValue &of) {
        if (const auto view = of["bufferView"].integer())
            views.insert(*view);
    };
    for (const JsonValue &accessor : root["accessors"].children()) {
        add(accessor);
        add(accessor["sparse"]["indices"]);
        add(accessor["sparse"]["values"]);
    }
    for (const JsonValue &image : root["images"].children())
        add(image);
    for (const JsonValue &mesh : root["meshes"].children())
        for (const JsonValue &primitive : mesh["primitives"].children())
            add(primitive["extensions"]["KHR_draco_mesh_compression"]);
    return views;
}

} // namespace

ExtensionReader::ExtensionReader(const Document &document, size_t most)
    : document_(document), root_(document.root()), most_(most),
      allowance_(2 * bufferBytes(document.model()) + (uint64_t{64} << 20))
{
}

void ExtensionReader::note(const std::string &message)
{
    if (!full())
        findings_.push_back({place_, message});
    if (full())
        throw Broken{};
}

void ExtensionReader::fail(const std::string &message)
{
    note(message);
    throw Broken{};
}

template <typename Read>
void ExtensionReader::at(std::string place, Read &&read)
{
    if (full())
        return;
    place_ = std::move(place);
    try {
        read();
    } catch (const Broken &) {
        // It is on the list.
    } catch (const GltfError &error) {
        if (!full())
            findings_.push_back({place_, error.what()});
    }
}

int64_t ExtensionReader::required(const JsonValue &object, const char *name)
{
    const JsonValue value = object[name];
    if (!value.exists())
        fail(std::string("\"") + name + "\" is missing");
    const auto integer = value.integer();
    if (!integer || *integer < 0)
        fail(std::string("\"") + name + "\" is not an integer of at least 0");
    return *integer;
}

std::vector<int64_t> ExtensionReader::requiredList(const JsonValue &object, const char *name)
{
    const JsonValue value = object[name];
    if (!value.exists())
        fail(std::string("\"") + name + "\" is missing");
    std::vector<int64_t> list;
    for (const JsonValue &element : value.children()) {
        const auto integer = element.integer();
        if (!value.isArray() || !integer)
            fail(std::string("\"") + name + "\" has an element that is not an integer");
        list.push_back(*integer);
    }
    if (!value.isArray() || list.empty())
        fail(std::string("\"") + name + "\" is not an array with elements");
    return list;
}

std::span<const uint8_t> ExtensionReader::view(int64_t index, const char *name)
{
    const gltf_json::Model &model = document_.model();
    if (index >= static_cast<int64_t>(model.bufferViews.size()))
        fail(std::string("\"") + name + "\": buffer view " + std::to_string(index) + " does not exist");
    return document_.bufferViews().bytes(static_cast<int>(index), std::string("\"") + name + "\"");
}

void ExtensionReader::account(size_t bytes)
{
    if (bytes > allowance_)
        fail("the micromaps take several times the bytes of the file's buffers");
    allowance_ -= bytes;
}

std::optional<std::string> ExtensionReader::loss() const
{
    const size_t views = root_["bufferViews"].children().size();
    const std::set<int64_t> others = viewsOfOthers(root_);
    std::string first;
    for (const char *spelling : kMicromapExtensions) {
        const std::vector<JsonValue> micromaps = root_["extensions"][spelling]["micromaps"].children();
        for (size_t i = 0; i < micromaps.size(); ++i)
            for (const char *name : {"data", "triangles"}) {
                const auto view = micromaps[i][name].integer();
                if (!view || *view < 0)
                    return std::nullopt;
                const bool missing = static_cast<uint64_t>(*view) >= views;
                if (!missing && !others.contains(*view))
                    return std::nullopt;
                if (first.empty())
                    first = std::string("\"")
                                .append(name)
                                .append("\" of micromaps[")
                                .append(number(i))
                                .append("] is buffer view ")
                                .append(number(static_cast<uint64_t>(*view)))
                                .append(missing ? ", which does not exist" : ", which is something else");
            }
    }
    if (first.empty())
        return std::nullopt;
    return "the micromaps lost their data (" + first +
           ") in a program that does not know them, such as gltf-pipeline; another bake repairs the file";
}

StoredMicromaps ExtensionReader::read()
{
    if (const auto lost = loss()) {
        findings_.push_back({"extensions", *lost});
        return {};
    }
    at("extensions", [&] { findExtension(); });
    if (!stored_.extension.empty()) {
        const std::vector<JsonValue> elements = root_["extensions"][stored_.extension]["micromaps"].children();
        stored_.micromaps.resize(elements.size());
        whole_.resize(elements.size());
        for (size_t i = 0; i < elements.size() && !full(); ++i) {
            const size_t before = findings_.size();
            at("micromaps[" + number(i) + "]", [&] { readMicromap(elements[i], stored_.micromaps[i]); });
            whole_[i] = findings_.size() == before;
        }
    }
    const std::vector<JsonValue> meshes = root_["meshes"].children();
    for (uint32_t m = 0; m < meshes.size() && !full(); ++m)
        at("mesh " + number(m), [&] { readMesh(m, meshes[m]); });
    return std::move(stored_);
}

void ExtensionReader::findExtension()
{
    for (const char *spelling : kMicromapExtensions) {
        const JsonValue extension = root_["extensions"][spelling];
        if (!extension.exists() || !stored_.extension.empty())
            continue;
        stored_.extension = spelling;
        stored_.blendCutoff = blendCutoffOf(root_);
        const JsonValue list = extension["micromaps"];
        if (!list.isArray() || list.children().empty())
            note(stored_.extension + ": \"micromaps\" is not an array with elements");
        const std::vector<JsonValue> used = root_["extensionsUsed"].children();
        if (std::none_of(used.begin(), used.end(), [&](const JsonValue &name) { return name.string() == spelling; }))
            note("\"extensionsUsed\" does not name " + stored_.extension);
    }
}

void ExtensionReader::readMicromap(const JsonValue &element, StoredMicromap &micromap)
{
    if (!element.isObject())
        fail("it is not an object");
    readUsage(element, micromap);
    const auto data = view(required(element, "data"), "data");
    account(data.size());
    micromap.data.assign(data.begin(), data.end());
    readRecords(element, micromap);
    checkRecords(micromap);
    checkOverlap(micromap);
    checkUsage(micromap);
}

void ExtensionReader::readUsage(const JsonValue &element, StoredMicromap &micromap)
{
    const auto counts = requiredList(element, "usageCounts");
    const auto levels = requiredList(element, "usageLevels");
    const auto formats = requiredList(element, "usageFormats");
    if (counts.size() != levels.size() || counts.size() != formats.size())
        fail("usageCounts has " + number(counts.size()) + " elements, usageLevels " + number(levels.size()) +
             ", usageFormats " + number(formats.size()));
    for (size_t i = 0; i < counts.size(); ++i) {
        const std::string which = std::string("[").append(number(i)).append("] is ");
        if (counts[i] < 1 || counts[i] > std::numeric_limits<uint32_t>::max())
            fail("usageCounts" + which + std::to_string(counts[i]) + ", not 1 or more");
        if (levels[i] < 0 || levels[i] > static_cast<int64_t>(shared::kMaxSubdivisionLevel))
            fail("usageLevels" + which + std::to_string(levels[i]) + ", not 0 to 12");
        if (formats[i] != 1 && formats[i] != 2)
            fail("usageFormats" + which + std::to_string(formats[i]) + ", neither 1 (2-state) nor 2 (4-state)");
        micromap.usage.push_back(
            {static_cast<uint32_t>(counts[i]), static_cast<uint32_t>(levels[i]), static_cast<Format>(formats[i])});
    }
}

void ExtensionReader::readRecords(const JsonValue &element, StoredMicromap &micromap)
{
    const int64_t index = required(element, "triangles");
    const auto bytes = view(index, "triangles");
    const size_t declared = document_.model().bufferViews[static_cast<size_t>(index)].byteStride;
    const size_t stride = declared == 0 ? kRecordBytes : declared;
    if (stride < kRecordBytes || stride % 4 != 0)
        fail("\"triangles\": a byteStride of " + number(stride) + " is not a multiple of 4 that is at least 8");
    if (bytes.size() % stride != 0 && bytes.size() % stride != kRecordBytes)
        fail("\"triangles\": " + number(bytes.size()) + " bytes are no whole number of records of " + number(stride) +
             " bytes");
    account(bytes.size() / stride * kRecordBytes);
    for (size_t at = 0; at + kRecordBytes <= bytes.size(); at += stride)
        micromap.triangles.push_back({load<uint32_t>(&bytes[at]), load<uint16_t>(&bytes[at + 4]),
                                      static_cast<Format>(load<uint16_t>(&bytes[at + 6]))});
}

void ExtensionReader::checkRecords(const StoredMicromap &micromap)
{
    bool whole = true;
    for (size_t i = 0; i < micromap.triangles.size(); ++i) {
        const MicromapTriangle &t = micromap.triangles[i];
        const std::string which = "triangle " + number(i) + ": ";
        const size_t before = findings_.size();
        if (t.format != Format::TwoState && t.format != Format::FourState)
            note(which + "format " + number(static_cast<unsigned>(t.format)) +
                 " is neither 1 (2-state) nor 2 (4-state)");
        else if (t.subdivisionLevel > shared::kMaxSubdivisionLevel)
            note(which + "subdivision level " + number(t.subdivisionLevel) + " is above 12");
        else if (const auto end = uint64_t{t.dataOffset} + packedBytes(t.subdivisionLevel, t.format);
                 end > micromap.data.size())
            note(which + "its data ends at byte " + number(end) + " of " + number(micromap.data.size()));
        whole = whole && findings_.size() == before;
    }
    if (!whole)
        throw Broken{}; // regions mean nothing now
}

void ExtensionReader::checkOverlap(const StoredMicromap &micromap)
{
    const std::vector<MicromapTriangle> &triangles = micromap.triangles;
    std::vector<uint32_t> order(triangles.size());
    std::iota(order.begin(), order.end(), 0u);
    const auto before = [&](uint32_t a, uint32_t b) { return triangles[a].dataOffset < triangles[b].dataOffset; };
    if (!std::is_sorted(order.begin(), order.end(), before))
        std::stable_sort(order.begin(), order.end(), before);
    uint64_t end = 0;
    uint32_t last = 0; // the triangle whose data ends there
    for (const uint32_t i : order) {
        const MicromapTriangle &t = triangles[i];
        if (t.dataOffset < end)
            note("triangle " + number(i) + ": its data overlaps that of triangle " + number(last));
        const uint64_t itsEnd = uint64_t{t.dataOffset} + packedBytes(t.subdivisionLevel, t.format);
        if (itsEnd > end) {
            end = itsEnd;
            last = i;
        }
    }
}

void ExtensionReader::checkUsage(const StoredMicromap &micromap)
{
    std::map<std::pair<Format, uint32_t>, std::pair<uint64_t, uint64_t>> counts; // said, found
    uint64_t sum = 0;
    for (const MicromapUsage &usage : micromap.usage) {
        counts[{usage.format, usage.subdivisionLevel}].first += usage.count;
        sum += usage.count;
    }
    for (const MicromapTriangle &t : micromap.triangles)
        ++counts[{t.format, t.subdivisionLevel}].second;
    if (sum != micromap.triangles.size())
        note("usageCounts add up to " + number(sum) + " triangles, there are " + number(micromap.triangles.size()));
    for (const auto &[kind, count] : counts)
        if (count.first != count.second)
            note("usageCounts has " + number(count.first) + " triangles of level " + number(kind.second) + ", format " +
                 number(static_cast<unsigned>(kind.first)) + ", there are " + number(count.second));
}

void ExtensionReader::readMesh(uint32_t mesh, const JsonValue &value)
{
    const std::vector<JsonValue> primitives = value["primitives"].children();
    for (uint32_t p = 0; p < primitives.size() && !full(); ++p) {
        const JsonValue extensions = primitives[p]["extensions"];
        for (const char *spelling : kMicromapExtensions) {
            const JsonValue extension = extensions[spelling];
            if (!extension.exists() || (!stored_.extension.empty() && stored_.extension != spelling))
                continue;
            const PrimitivePlace place{mesh, p};
            at(document_.nameOf(place), [&] {
                if (stored_.extension.empty())
                    fail(std::string("it has ") + spelling + ", the file's root has not");
                readPrimitive(place, extension);
            });
        }
    }
}

void ExtensionReader::readPrimitive(PrimitivePlace place, const JsonValue &extension)
{
    if (!extension.isObject())
        fail(stored_.extension + " is not an object");
    const int64_t named = required(extension, "micromap");
    if (named >= static_cast<int64_t>(stored_.micromaps.size()))
        fail("micromap " + std::to_string(named) + " does not exist");
    const auto micromap = static_cast<size_t>(named);
    int64_t base = 0;
    if (extension["micromapBaseTriangle"].exists())
        base = required(extension, "micromapBaseTriangle");
    if (base > std::numeric_limits<uint32_t>::max())
        fail("micromapBaseTriangle " + std::to_string(base) + " is too large");
    const int mode = document_.model().meshes[place.mesh].primitives[place.primitive].mode;
    if (mode != gltf_json::kTriangles)
        fail("its mode is " + std::to_string(mode) + ", not 4 (TRIANGLES)");
    if (!whole_[micromap])
        return; // said there
    PrimitiveMicromap primitive{static_cast<uint32_t>(micromap), {}, static_cast<uint32_t>(base)};
    const uint64_t triangles = triangleCount(place);
    const size_t records = stored_.micromaps[micromap].triangles.size();
    if (extension["micromapIndices"].exists()) {
        primitive.indices = readIndices(required(extension, "micromapIndices"), triangles);
    } else {
        if (triangles + primitive.baseTriangle > records)
            fail("its " + number(triangles) + " triangles from base triangle " + number(primitive.baseTriangle) +
                 " on are outside of the micromap's " + number(records) + " triangles");
        account(static_cast<size_t>(triangles) * sizeof(int32_t));
        primitive.indices.resize(static_cast<size_t>(triangles));
        std::iota(primitive.indices.begin(), primitive.indices.end(), 0);
    }
    const size_t before = findings_.size();
    checkIndices(primitive, records);
    if (findings_.size() == before)
        stored_.primitives[place] = std::move(primitive);
}

uint64_t ExtensionReader::triangleCount(PrimitivePlace place)
{
    const gltf_json::Model &model = document_.model();
    const std::optional<size_t> declared =
        declaredTriangles(model, model.meshes[place.mesh].primitives[place.primitive]);
    if (!declared)
        fail("it has no positions");
    return *declared;
}

std::vector<int32_t> ExtensionReader::readIndices(int64_t index, uint64_t triangles)
{
    const gltf_json::Model &model = document_.model();
    const std::string what = "micromapIndices: accessor " + std::to_string(index);
    if (index >= static_cast<int64_t>(model.accessors.size()))
        fail(what + " does not exist");
    account(model.accessors[static_cast<size_t>(index)].count * sizeof(int32_t));
    const std::vector<int64_t> values =
        readMicromapIndices(document_.bufferViews(), static_cast<int>(index), "micromapIndices");
    if (values.size() != triangles)
        fail(what + " has " + number(values.size()) + " elements for " + number(triangles) + " triangles");
    std::vector<int32_t> indices;
    indices.reserve(values.size());
    for (const int64_t value : values) {
        if (value < -4 || value > std::numeric_limits<int32_t>::max())
            fail(what + ": element " + number(indices.size()) + " is " + std::to_string(value) +
                 ", neither an index nor a special index");
        indices.push_back(static_cast<int32_t>(value));
    }
    return indices;
}

void ExtensionReader::checkIndices(const PrimitiveMicromap &primitive, size_t records)
{
    for (size_t t = 0; t < primitive.indices.size(); ++t) {
        const int32_t index = primitive.indices[t];
        if (index >= 0 && uint64_t{primitive.baseTriangle} + static_cast<uint32_t>(index) >= records)
            note("triangle " + number(t) + ": index " + std::to_string(index) + " + base triangle " +
                 number(primitive.baseTriangle) + " is outside of the micromap's " + number(records) + " triangles");
    }
}

std::optional<float> blendCutoffOf(const JsonValue &root)
{
    for (const char *spelling : kMicromapExtensions) {
        const JsonValue extension = root["extensions"][spelling];
        if (!extension.exists())
            continue;
        const double cutoff = extension["extras"]["blendCutoff"].number().value_or(NAN);
        if (std::abs(cutoff) <= std::numeric_limits<float>::max())
            return static_cast<float>(cutoff);
        return std::nullopt;
    }
    return std::nullopt;
}

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

} // namespace vellum
