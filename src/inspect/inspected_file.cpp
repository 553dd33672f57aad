// SPDX-License-Identifier: Apache-2.0
#include "inspect/inspected_file.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <unordered_set>

#include "base/error.h"
#include "core/utf8_path.h"
#include "gltf/alpha_textures.h"
#include "gltf/file/open_file.h"
#include "gltf/file/uri.h"
#include "inspect/report_parts.h"

namespace vellum::inspect
{
namespace
{

// Removes the number at the beginning of `text` and returns it. Throws if there is none.
uint32_t takeNumber(std::string_view &text)
{
    uint32_t number = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (error != std::errc())
        throw Error("");
    text.remove_prefix(static_cast<size_t>(end - text.data()));
    return number;
}

} // namespace

std::vector<NumberRange> parseRanges(const std::string &text, const std::string &option)
{
    try {
        std::vector<NumberRange> ranges;
        std::string_view rest = text;
        while (true) {
            NumberRange range;
            range.first = range.last = takeNumber(rest);
            if (rest.starts_with('-')) {
                rest.remove_prefix(1);
                range.last = takeNumber(rest);
            }
            if (range.last < range.first)
                throw Error("");
            ranges.push_back(range);
            if (rest.empty())
                return ranges;
            if (!rest.starts_with(','))
                throw Error("");
            rest.remove_prefix(1);
        }
    } catch (const Error &) {
        throw UsageError(option + " must be a number, a range like 3-9, or several with commas, got " + text);
    }
}

bool contains(const std::vector<NumberRange> &ranges, uint32_t number)
{
    return ranges.empty() || std::any_of(ranges.begin(), ranges.end(), [&](const NumberRange &range) {
               return range.first <= number && number <= range.last;
           });
}

bool Selection::hasMaterial(int index, std::string_view name) const
{
    return materials.empty() || std::any_of(materials.begin(), materials.end(), [&](const std::string &wanted) {
               return wanted == name || wanted == std::to_string(index);
           });
}

bool Selection::everything() const
{
    return meshes.empty() && primitives.empty() && triangles.empty() && materials.empty();
}

namespace
{

// The size of the accessor with a primitive's micromap indices. readMicromaps has checked it. Without a file, of what
// the writer of micromaps would make.
uint64_t bytesOfIndices(const Document &document, PrimitivePlace place, const StoredMicromaps &stored)
{
    const gltf_json::Model &model = document.model();
    const PrimitiveMicromap &primitive = stored.primitives.at(place);
    const size_t count = primitive.indices.size();
    if (stored.extension.empty())
        return count * micromapIndexBytes(stored.micromaps.at(primitive.micromap).triangles.size());
    const JsonValue extension = model.meshes.at(place.mesh).primitives.at(place.primitive).extensions[stored.extension];
    const auto accessor = extension["micromapIndices"].integer();
    return accessor ? count * gltf_json::bytesOf(model.accessors.at(static_cast<size_t>(*accessor)).componentType) : 0;
}

class Inspector
{
public:
    Inspector(const Document &document, const Selection &selection)
        : document_(document), selection_(selection), decoder_(document)
    {
    }

    InspectedFile inspect(const DocumentBakeOptions *bake);

private:
    void checkSelection() const;
    void bakeAll(const DocumentBakeOptions &options);
    [[nodiscard]] std::string nothingMade() const;
    [[nodiscard]] uint64_t bytesBeside() const;
    void measure();
    void addRecords();
    void addPrimitive(PrimitivePlace place, const PrimitiveMicromap &micromap);
    uint32_t useMaterial(int index);
    std::shared_ptr<const Image> useImage(int index);

    const Document &document_;
    const Selection &selection_;
    InspectedFile file_;
    std::vector<uint32_t> firstRecord_; // of each micromap
    std::map<int, uint32_t> materials_;
    ImageDecoder decoder_;
    std::map<int, std::shared_ptr<const Image>> images_;
};

// Every name or number that was chosen must exist.
void Inspector::checkSelection() const
{
    const gltf_json::Model &model = document_.model();
    const std::string prefix = utf8Text(document_.path()) + ": there is no ";
    for (const NumberRange &range : selection_.meshes)
        if (range.first >= model.meshes.size())
            throw Error(prefix + "mesh " + std::to_string(range.first));
    for (const std::string &material : selection_.materials) {
        const Selection one{.meshes = {}, .primitives = {}, .triangles = {}, .materials = {material}};
        bool there = false;
        for (size_t i = 0; i < model.materials.size(); ++i)
            there = there || one.hasMaterial(static_cast<int>(i), model.materials[i].name);
        if (!there)
            throw Error(prefix + "material " + material);
    }
}

void Inspector::bakeAll(const DocumentBakeOptions &options)
{
    file_.baked = true;
    DocumentBake bake = bakeDocument(document_, options);
    file_.skipped = std::move(bake.skipped);
    file_.stored = storedOf(std::move(bake));
}

std::string Inspector::nothingMade() const
{
    if (file_.skipped.empty())
        return "no alpha-masked primitive with texture coordinates is in it";
    return "no primitive gets a micromap: " + describe(file_.skipped.front());
}

// Of the files that it names, as far as they exist.
uint64_t Inspector::bytesBeside() const
{
    std::set<std::filesystem::path> files;
    for (const std::filesystem::path &name : namedFiles(document_.root()))
        if (const std::filesystem::path normal = name.lexically_normal(); !leadsOut(normal))
            files.insert(document_.path().parent_path() / normal);
    uint64_t bytes = 0;
    for (const std::filesystem::path &path : files)
        try {
            const InputFile file(path);
            file.requireBeside(document_.path());
            bytes += file.size();
        } catch (const GltfError &) { // what needs it reports it
        }
    return bytes;
}

void Inspector::measure()
{
    SurfaceAreas areas = surfaceAreas(document_);
    const StoredShares stored(file_.stored);
    file_.surface = stored.of(areas);
    for (const auto &[place, micromap] : file_.stored.primitives)
        areas[place].resize(micromap.indices.size());
    for (const auto &[place, its] : areas) {
        const gltf_json::Mesh &mesh = document_.model().meshes.at(place.mesh);
        InspectedSurface &surface = file_.surfaces.emplace_back();
        surface.place = place;
        surface.mesh = mesh.name;
        surface.materialIndex = mesh.primitives.at(place.primitive).material;
        if (surface.materialIndex >= 0)
            surface.material = readMaterial(document_, surface.materialIndex).name;
        for (const double area : its)
            surface.area += area;
        if (const auto shares = stored.of({{place, its}}))
            surface.known = surface.area * shares->known();
    }
}

void Inspector::addRecords()
{
    for (uint32_t m = 0; m < file_.stored.micromaps.size(); ++m) {
        const StoredMicromap &micromap = file_.stored.micromaps[m];
        firstRecord_.push_back(static_cast<uint32_t>(file_.records.size()));
        if (file_.records.size() + micromap.triangles.size() > std::numeric_limits<int32_t>::max())
            throw Error(utf8Text(document_.path()) + ": too many micromap triangles to inspect");
        const StateCounter counter(micromap.data);
        for (const MicromapTriangle &triangle : micromap.triangles)
            file_.records.push_back({m, triangle, counter.count(triangle)});
    }
}

std::shared_ptr<const Image> Inspector::useImage(int index)
{
    std::shared_ptr<const Image> &image = images_[index];
    if (!image)
        image = std::make_shared<Image>(decoder_.decode(index));
    return image;
}

uint32_t Inspector::useMaterial(int index)
{
    const auto [known, added] = materials_.emplace(index, static_cast<uint32_t>(file_.materials.size()));
    if (!added)
        return known->second;
    InspectedMaterial material{
        .index = index, .material = readMaterial(document_, index), .cutoff = {}, .image = {}, .problem = {}};
    if (material.material.alphaMode == AlphaMode::Mask)
        material.cutoff = material.material.alphaCutoff;
    else if (material.material.alphaMode == AlphaMode::Blend)
        material.cutoff = file_.stored.blendCutoff;
    try {
        if (material.material.image >= 0)
            material.image = useImage(material.material.image);
    } catch (const GltfUnsupported &error) { // the micromaps can be looked at without
        material.problem = error.what();
    }
    file_.materials.push_back(std::move(material));
    return known->second;
}

void Inspector::addPrimitive(PrimitivePlace place, const PrimitiveMicromap &micromap)
{
    if (!contains(selection_.meshes, place.mesh) || !contains(selection_.primitives, place.primitive))
        return;
    const Primitive source = readPrimitive(document_, place, Positions::Skip);
    const auto &materials = document_.model().materials;
    const auto material = static_cast<size_t>(source.material);
    const bool named = source.material >= 0 && material < materials.size();
    if (!selection_.hasMaterial(source.material, named ? std::string_view(materials[material].name) : ""))
        return;
    if (micromap.indices.size() != source.triangleCount())
        throw Error(utf8Text(document_.path()) + ": " + document_.nameOf(place) + " has " +
                    std::to_string(micromap.indices.size()) + " micromap indices for " +
                    std::to_string(source.triangleCount()) + " triangles");
    InspectedPrimitive primitive{.place = place,
                                 .mesh = document_.model().meshes.at(place.mesh).name,
                                 .material = useMaterial(source.material),
                                 .triangles = source.triangleCount(),
                                 .indexBytes = bytesOfIndices(document_, place, file_.stored)};
    const std::vector<TriangleUvs> uvs = triangleUvs(source);
    for (uint32_t t = 0; t < uvs.size(); ++t) {
        if (!contains(selection_.triangles, t))
            continue;
        const int32_t index = micromap.indices[t];
        primitive.numbers.push_back(t);
        primitive.uvs.push_back(uvs[t]);
        primitive.records.push_back(index < 0
                                        ? index
                                        : static_cast<int32_t>(firstRecord_.at(micromap.micromap) +
                                                               micromap.baseTriangle + static_cast<uint32_t>(index)));
    }
    if (!primitive.numbers.empty())
        file_.primitives.push_back(std::move(primitive));
}

InspectedFile Inspector::inspect(const DocumentBakeOptions *bake)
{
    const std::filesystem::path &path = document_.path();
    file_.name = utf8Text(path.filename());
    file_.bytes = document_.fileBytes() + bytesBeside();
    checkSelection();
    file_.meshCount = document_.model().meshes.size();
    file_.primitiveCount = trianglePrimitives(document_).size();
    if (bake != nullptr)
        bakeAll(*bake);
    else
        file_.stored = readMicromaps(document_);
    if (file_.stored.primitives.empty())
        throw Error(utf8Text(path) + ": " +
                    (bake != nullptr ? nothingMade()
                                     : "no primitive has a micromap; vellum bake makes them, and --bake shows what it "
                                       "would make"));
    measure();
    addRecords();
    for (const auto &[place, micromap] : file_.stored.primitives)
        addPrimitive(place, micromap);
    if (file_.primitives.empty())
        throw Error(utf8Text(path) + ": no triangle with a micromap is among those chosen");
    return std::move(file_);
}

} // namespace

InspectedFile inspectFile(const Document &document, const Selection &selection, const DocumentBakeOptions *bake)
{
    return document.named([&] { return Inspector(document, selection).inspect(bake); });
}

namespace
{

class Tallier
{
public:
    explicit Tallier(const InspectedFile &file) : file_(file) {}

    void add(const InspectedPrimitive &primitive)
    {
        for (size_t t = 0; t < primitive.records.size(); ++t)
            add(primitive.records[t], uvArea(primitive.uvs[t]));
        tally_.indexBytes += primitive.indexBytes;
    }

    Tally finish()
    {
        for (double &share : tally_.states)
            share /= tally_.triangles != 0 ? static_cast<double>(tally_.triangles) : 1;
        return tally_;
    }

private:
    void add(int32_t record, double area)
    {
        ++tally_.triangles;
        const std::array<double, 4> shares = stateShares(file_, record);
        for (size_t s = 0; s < 4; ++s) {
            tally_.states[s] += shares[s];
            tally_.uvArea[s] += shares[s] * area;
        }
        if (isSpecial(record)) {
            ++tally_.special[static_cast<size_t>(*specialState(record))];
            return;
        }
        const auto number = static_cast<size_t>(record);
        const MicromapTriangle &triangle = file_.records[number].triangle;
        ++tally_.levels[triangle.subdivisionLevel][triangle.format == Format::TwoState ? 0 : 1];
        if (!used_.insert(number).second)
            return;
        ++tally_.recordsUsed;
        tally_.dataBytes += dataBytes(file_, record);
    }

    const InspectedFile &file_;
    std::unordered_set<size_t> used_; // there may be many more records, and many primitives to tally
    Tally tally_;
};

} // namespace

Tally tallyOf(const InspectedFile &file)
{
    Tallier tallier(file);
    for (const InspectedPrimitive &primitive : file.primitives)
        tallier.add(primitive);
    return tallier.finish();
}

Tally tallyOf(const InspectedFile &file, const InspectedPrimitive &primitive)
{
    Tallier tallier(file);
    tallier.add(primitive);
    return tallier.finish();
}

Tally tallyOf(const InspectedFile &file, std::span<const InspectedPrimitive *const> primitives)
{
    Tallier tallier(file);
    for (const InspectedPrimitive *primitive : primitives)
        tallier.add(*primitive);
    return tallier.finish();
}

std::vector<Tally> talliesOfMaterials(const InspectedFile &file)
{
    std::vector<Tallier> talliers(file.materials.size(), Tallier(file));
    for (const InspectedPrimitive &primitive : file.primitives)
        talliers[primitive.material].add(primitive);
    std::vector<Tally> tallies;
    for (Tallier &tallier : talliers)
        tallies.push_back(tallier.finish());
    return tallies;
}

std::array<double, 4> stateShares(const InspectedFile &file, int32_t record)
{
    std::array<double, 4> shares{};
    if (isSpecial(record)) {
        shares[static_cast<size_t>(*specialState(record))] = 1;
        return shares;
    }
    const InspectedRecord &of = file.records[static_cast<size_t>(record)];
    for (size_t s = 0; s < 4; ++s)
        shares[s] = static_cast<double>(of.states[s]) / microTriangleCount(of.triangle.subdivisionLevel);
    return shares;
}

uint64_t dataBytes(const InspectedFile &file, int32_t record)
{
    if (isSpecial(record))
        return 0;
    const MicromapTriangle &triangle = file.records[static_cast<size_t>(record)].triangle;
    return packedBytes(triangle.subdivisionLevel, triangle.format);
}

double uvArea(const TriangleUvs &uvs)
{
    const double ux = double{uvs[1].u} - uvs[0].u, uy = double{uvs[1].v} - uvs[0].v;
    const double vx = double{uvs[2].u} - uvs[0].u, vy = double{uvs[2].v} - uvs[0].v;
    const double area = std::abs(ux * vy - uy * vx) / 2;
    return std::isfinite(area) ? area : 0;
}

} // namespace vellum::inspect
