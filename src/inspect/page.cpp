// SPDX-License-Identifier: Apache-2.0
#include "inspect/page.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <map>
#include <optional>
#include <set>
#include <tuple>
#include <unordered_map>

#include "base/json_writer.h"
#include "base/picture.h"
#include "base/text.h"
#include "core/bit_cast.h"
#include "core/hash.h"
#include "gltf/file/uri.h"
#include "inspect/page_files.h"

namespace vellum::inspect
{

namespace
{

uint32_t pageBytes(uint32_t level)
{
    return packedBytes(level, Format::FourState);
}

// The states of one micromap triangle for the page.
class StatesOfRecord
{
public:
    StatesOfRecord(const StoredMicromap &micromap, const StateCounter &counter, const MicromapTriangle &triangle)
        : micromap_(micromap), counter_(counter), triangle_(triangle)
    {
    }

    void write(uint32_t pageLevel, uint8_t *to) const
    {
        const uint32_t level = triangle_.subdivisionLevel;
        const uint8_t *from = micromap_.data.data() + triangle_.dataOffset;
        if (pageLevel == level && triangle_.format == Format::FourState) {
            std::memcpy(to, from, pageBytes(level));
            return;
        }
        for (uint32_t i = 0; i < microTriangleCount(pageLevel); ++i) {
            const State state = pageLevel == level ? readState(from, i, triangle_.format)
                                                   : most(i, microTriangleCount(level - pageLevel));
            writeState(to, i, Format::FourState, state);
        }
    }

private:
    // Parts of a triangle are contiguous on the curve.
    [[nodiscard]] State most(uint32_t part, uint32_t count) const
    {
        const StateCounts counts = counter_.count(triangle_, uint64_t{part} * count, count);
        return static_cast<State>(std::max_element(counts.begin(), counts.end()) - counts.begin());
    }

    const StoredMicromap &micromap_;
    const StateCounter &counter_;
    const MicromapTriangle &triangle_;
};

// Micromap triangles with the same data are one record of the page.
using RecordKey = std::tuple<uint32_t, uint32_t, uint16_t, Format>;

struct ShapeKey {
    uint32_t material = 0;
    std::array<uint32_t, 6> uvs{};
    int32_t record = 0;
    bool operator==(const ShapeKey &) const = default;
};

struct ShapeHash {
    size_t operator()(const ShapeKey &key) const
    {
        static_assert(sizeof key == 8 * sizeof(uint32_t)); // no padding
        return static_cast<size_t>(hashBytes(&key, sizeof key));
    }
};

class PageMaker
{
public:
    PageMaker(const InspectedFile &file, const PageLimits &limits)
        : file_(file), limits_(limits), pageRecord_(file.records.size(), -1)
    {
    }

    PageData make()
    {
        findTriangles();
        sortShapes();
        copyStates();
        return std::move(data_);
    }

private:
    void findTriangles();
    int32_t useRecord(int32_t record);
    void sortShapes();
    void copyStates();

    const InspectedFile &file_;
    const PageLimits &limits_;
    PageData data_;
    std::vector<int32_t> pageRecord_; // by record of the file; -1: not used yet
    std::map<RecordKey, int32_t> known_;
    std::vector<int32_t> recordOf_; // of the file, by record of the page
    std::unordered_map<ShapeKey, uint32_t, ShapeHash> shapes_;
    std::vector<uint32_t> materials_; // of each shape
};

int32_t PageMaker::useRecord(int32_t record)
{
    if (isSpecial(record))
        return record;
    int32_t &number = pageRecord_[static_cast<size_t>(record)];
    if (number >= 0)
        return number;
    const InspectedRecord &from = file_.records[static_cast<size_t>(record)];
    const auto [known, added] = known_.emplace(
        RecordKey{from.micromap, from.triangle.dataOffset, from.triangle.subdivisionLevel, from.triangle.format},
        static_cast<int32_t>(data_.records.size()));
    if (added) {
        const auto level = static_cast<uint8_t>(from.triangle.subdivisionLevel);
        data_.records.push_back({level, level, from.triangle.format, from.states, 0});
        recordOf_.push_back(record);
    }
    return number = known->second;
}

void PageMaker::findTriangles()
{
    for (const InspectedPrimitive &primitive : file_.primitives) {
        data_.firstTriangle.push_back(static_cast<uint32_t>(data_.shapeOf.size()));
        for (size_t t = 0; t < primitive.records.size(); ++t) {
            if (data_.shapeOf.size() == limits_.triangles) {
                data_.leftOut += primitive.records.size() - t;
                break;
            }
            ShapeKey key{.material = primitive.material, .record = useRecord(primitive.records[t])};
            for (size_t corner = 0; corner < 3; ++corner) {
                key.uvs[2 * corner] = bitCast<uint32_t>(primitive.uvs[t][corner].u);
                key.uvs[2 * corner + 1] = bitCast<uint32_t>(primitive.uvs[t][corner].v);
            }
            const auto [shape, added] = shapes_.emplace(key, static_cast<uint32_t>(data_.shapes.size()));
            if (added) {
                data_.shapes.push_back({primitive.uvs[t], key.record});
                materials_.push_back(primitive.material);
            }
            data_.shapeOf.push_back(shape->second);
            data_.numbers.push_back(primitive.numbers[t]);
        }
    }
    data_.firstTriangle.push_back(static_cast<uint32_t>(data_.shapeOf.size()));
}

// By material, and in the order in which they were found.
void PageMaker::sortShapes()
{
    data_.firstShape.assign(file_.materials.size() + 1, 0);
    for (const uint32_t material : materials_)
        ++data_.firstShape[material + 1];
    for (size_t m = 1; m < data_.firstShape.size(); ++m)
        data_.firstShape[m] += data_.firstShape[m - 1];
    std::vector<uint32_t> next(data_.firstShape.begin(), data_.firstShape.end());
    std::vector<uint32_t> place(materials_.size());
    std::vector<PageShape> sorted(materials_.size());
    for (size_t s = 0; s < place.size(); ++s) {
        place[s] = next[materials_[s]]++;
        sorted[place[s]] = data_.shapes[s];
    }
    data_.shapes = std::move(sorted);
    for (uint32_t &shape : data_.shapeOf)
        shape = place[shape];
}

void PageMaker::copyStates()
{
    const auto bytesUpTo = [&](uint32_t most) {
        size_t bytes = 0;
        for (const PageRecord &record : data_.records)
            bytes += pageBytes(std::min<uint32_t>(record.level, most));
        return bytes;
    };
    uint32_t most = 12;
    while (most > 0 && bytesUpTo(most) > limits_.stateBytes)
        --most;
    data_.states.resize(bytesUpTo(most));
    std::vector<StateCounter> counters;
    for (const StoredMicromap &micromap : file_.stored.micromaps)
        counters.emplace_back(micromap.data);
    uint32_t at = 0;
    for (size_t r = 0; r < data_.records.size(); ++r) {
        PageRecord &record = data_.records[r];
        record.pageLevel = static_cast<uint8_t>(std::min<uint32_t>(record.level, most));
        record.firstByte = at;
        const InspectedRecord &from = file_.records[static_cast<size_t>(recordOf_[r])];
        StatesOfRecord(file_.stored.micromaps[from.micromap], counters[from.micromap], from.triangle)
            .write(record.pageLevel, data_.states.data() + at);
        at += pageBytes(record.pageLevel);
    }
}

// Little-endian numbers, one after another.
class ByteWriter
{
public:
    void byte(uint8_t value) { bytes_.push_back(value); }
    void word(uint32_t value)
    {
        for (unsigned shift = 0; shift < 32; shift += 8)
            bytes_.push_back(static_cast<uint8_t>(value >> shift));
    }
    void words(const std::vector<uint32_t> &values)
    {
        for (const uint32_t value : values)
            word(value);
    }
    std::vector<uint8_t> finish(const std::vector<uint8_t> &tail)
    {
        bytes_.insert(bytes_.end(), tail.begin(), tail.end());
        return std::move(bytes_);
    }

private:
    std::vector<uint8_t> bytes_;
};

} // namespace

std::vector<uint8_t> PageData::bytes() const
{
    ByteWriter to;
    for (const PageRecord &record : records) {
        to.byte(record.level);
        to.byte(record.pageLevel);
        to.byte(static_cast<uint8_t>(record.format));
        to.byte(0);
        to.word(record.firstByte);
        for (const uint64_t count : record.states)
            to.word(static_cast<uint32_t>(count));
    }
    for (const PageShape &shape : shapes) {
        for (const TexCoord &uv : shape.uvs) {
            to.word(bitCast<uint32_t>(uv.u));
            to.word(bitCast<uint32_t>(uv.v));
        }
        to.word(static_cast<uint32_t>(shape.record));
    }
    to.words(shapeOf);
    to.words(numbers);
    return to.finish(states);
}

PageData makePageData(const InspectedFile &file, const PageLimits &limits)
{
    return PageMaker(file, limits).make();
}

namespace
{

constexpr uint32_t kSamples = 2; // in each direction of a pixel
constexpr uint64_t kMostPixelsOfAll = 400'000'000;
constexpr double kVeil = 0.18; // how much of what is behind it a transparent layer hides
constexpr uint32_t kSolidColor = 0x9a9a9a;

using Point = std::array<double, 3>; // right, down and away from the viewer

// Turns a point as the camera sees it: 25 degrees around, 12 from above.
Point seen(const Vec3 &p)
{
    constexpr double kYaw = 25 * 3.14159265358979 / 180;
    constexpr double kPitch = 12 * 3.14159265358979 / 180;
    const double x = std::cos(kYaw) * p[0] - std::sin(kYaw) * p[2];
    const double z = std::sin(kYaw) * p[0] + std::cos(kYaw) * p[2];
    const double y = std::cos(kPitch) * p[1] - std::sin(kPitch) * z;
    return {x, -y, -(std::sin(kPitch) * p[1] + std::cos(kPitch) * z)};
}

bool finite(const Point &p)
{
    return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
}

struct Sample {
    float depth = INFINITY;
    uint32_t color = 0;
    float shade = 0;
    float behind = 1; // the share of light that earlier veils leave
};

struct Part {
    std::vector<Point> points;
    std::vector<uint32_t> indices;
    const InspectedPrimitive *primitive = nullptr; // null without a micromap
};

class MeshDrawing
{
public:
    MeshDrawing(const InspectedFile &file, uint32_t edge)
        : file_(file), edge_(edge), size_(edge * kSamples), samples_(size_t{size_} * size_)
    {
    }

    void add(Part part) { parts_.push_back(std::move(part)); }
    Picture draw();

private:
    enum class Pass : uint8_t { Solid, Veils };
    void fit();
    void drawPart(const Part &part, Pass pass);
    void drawTriangle(const std::array<Point, 3> &corners, const std::optional<StatesOf> &states, Pass pass);
    [[nodiscard]] Picture resolve() const;

    const InspectedFile &file_;
    uint32_t edge_;
    uint32_t size_;
    std::vector<Sample> samples_;
    std::vector<Part> parts_;
    uint64_t pixels_ = 0;
};

// Scales all points to the picture.
void MeshDrawing::fit()
{
    Point low{INFINITY, INFINITY, INFINITY};
    Point high{-INFINITY, -INFINITY, -INFINITY};
    for (const Part &part : parts_)
        for (const uint32_t index : part.indices)
            for (size_t axis = 0; finite(part.points[index]) && axis < 3; ++axis) {
                low[axis] = std::min(low[axis], part.points[index][axis]);
                high[axis] = std::max(high[axis], part.points[index][axis]);
            }
    const double extent = std::max({high[0] - low[0], high[1] - low[1], 1e-30});
    const double scale = 0.94 * size_ / extent;
    for (Part &part : parts_)
        for (Point &p : part.points) {
            p[0] = (p[0] - (low[0] + high[0]) / 2) * scale + size_ / 2.0;
            p[1] = (p[1] - (low[1] + high[1]) / 2) * scale + size_ / 2.0;
            p[2] = (p[2] - low[2]) * scale;
        }
}

void MeshDrawing::drawTriangle(const std::array<Point, 3> &p, const std::optional<StatesOf> &states, Pass pass)
{
    const double ux = p[1][0] - p[0][0], uy = p[1][1] - p[0][1], uz = p[1][2] - p[0][2];
    const double vx = p[2][0] - p[0][0], vy = p[2][1] - p[0][1], vz = p[2][2] - p[0][2];
    const double area = ux * vy - uy * vx;
    if (!(std::abs(area) > 1e-12))
        return;
    // The light is at the viewer, and triangles have two sides.
    const double nx = uy * vz - uz * vy, ny = uz * vx - ux * vz;
    const double facing = std::abs(area) / std::sqrt(nx * nx + ny * ny + area * area);
    const auto shade = static_cast<float>(0.62 + 0.38 * facing);
    const auto bound = [&](size_t axis, bool upper) {
        const auto [least, most] = std::minmax({p[0][axis], p[1][axis], p[2][axis]});
        return static_cast<int64_t>(std::clamp(upper ? std::ceil(most) : std::floor(least), 0.0, double(size_)));
    };
    for (int64_t y = bound(1, false); y < bound(1, true); ++y) {
        for (int64_t x = bound(0, false), end = bound(0, true); x < end; ++x) {
            ++pixels_;
            const double dx = static_cast<double>(x) + 0.5 - p[0][0], dy = static_cast<double>(y) + 0.5 - p[0][1];
            const double u = (dx * vy - dy * vx) / area;
            const double v = (dy * ux - dx * uy) / area;
            if (u < 0 || v < 0 || u + v > 1)
                continue;
            Sample &sample = samples_[static_cast<size_t>(y) * size_ + static_cast<size_t>(x)];
            const auto depth = static_cast<float>(p[0][2] + u * uz + v * vz);
            if (!(depth < sample.depth))
                continue;
            const auto state = states ? std::optional(states->at(u, v)) : std::nullopt;
            const bool veil = state == State::Transparent;
            if (veil && pass == Pass::Veils)
                sample.behind *= static_cast<float>(1 - kVeil);
            else if (!veil && pass == Pass::Solid)
                sample = {depth, state ? kStateColors[static_cast<size_t>(*state)] : kSolidColor, shade, 1};
        }
    }
}

void MeshDrawing::drawPart(const Part &part, Pass pass)
{
    size_t chosen = 0; // position among the primitive's chosen triangles
    for (uint32_t t = 0; t < part.indices.size() / 3 && pixels_ < kMostPixelsOfAll; ++t) {
        std::optional<StatesOf> states;
        if (part.primitive != nullptr && chosen < part.primitive->numbers.size() &&
            part.primitive->numbers[chosen] == t)
            states.emplace(file_, part.primitive->records[chosen++]);
        const std::array<Point, 3> corners = {part.points[part.indices[3 * t]], part.points[part.indices[3 * t + 1]],
                                              part.points[part.indices[3 * t + 2]]};
        if (finite(corners[0]) && finite(corners[1]) && finite(corners[2]))
            drawTriangle(corners, states, pass);
    }
}

Picture MeshDrawing::resolve() const
{
    Picture picture{edge_, edge_, std::vector<uint32_t>(size_t{edge_} * edge_)};
    const uint32_t veil = kStateColors[static_cast<size_t>(State::Transparent)];
    for (size_t y = 0; y < edge_; ++y)
        for (size_t x = 0; x < edge_; ++x) {
            std::array<double, 4> sum{}; // premultiplied
            for (size_t i = 0; i < kSamples * kSamples; ++i) {
                const Sample &s = samples_[(y * kSamples + i / kSamples) * size_ + x * kSamples + i % kSamples];
                const double solid = std::isfinite(s.depth) ? s.behind : 0;
                for (unsigned channel = 0; channel < 3; ++channel) {
                    const unsigned shift = 16 - 8 * channel; // colours are 0xrrggbb
                    sum[channel] +=
                        solid * s.shade * ((s.color >> shift) & 255) + (1 - double{s.behind}) * ((veil >> shift) & 255);
                }
                sum[3] += solid + 1 - double{s.behind};
            }
            uint32_t pixel = static_cast<uint32_t>(std::lround(255 * sum[3] / (kSamples * kSamples))) << 24;
            for (unsigned channel = 0; channel < 3 && sum[3] > 0; ++channel)
                pixel |= static_cast<uint32_t>(std::lround(std::min(sum[channel] / sum[3], 255.0))) << (8 * channel);
            picture.pixels[y * edge_ + x] = pixel;
        }
    return picture;
}

Picture MeshDrawing::draw()
{
    fit();
    for (const Part &part : parts_)
        drawPart(part, Pass::Solid);
    for (const Part &part : parts_)
        if (part.primitive != nullptr)
            drawPart(part, Pass::Veils);
    return resolve();
}

// `file`'s mesh from the front and a little from above, without perspective, `edge` pixels wide and high, on nothing
// (alpha 0). Triangles without a micromap are grey; what is transparent is a veil.
// Not all of it where more than about 400 million pixels would have to be drawn.
Picture drawMesh(const Document &document, const InspectedFile &file, uint32_t mesh, uint32_t edge)
{
    MeshDrawing drawing(file, edge);
    for (const PrimitivePlace place : trianglePrimitives(document)) {
        if (place.mesh != mesh)
            continue;
        Primitive source;
        try {
            source = readPrimitive(document, place, Positions::Read);
        } catch (const GltfUnsupported &) { // it may have micromaps, and nothing to draw
            continue;
        }
        Part part;
        part.indices = std::move(source.indices);
        std::transform(source.positions.begin(), source.positions.end(), std::back_inserter(part.points), seen);
        const auto known =
            std::lower_bound(file.primitives.begin(), file.primitives.end(), place,
                             [](const InspectedPrimitive &p, PrimitivePlace at) { return p.place < at; });
        part.primitive = known != file.primitives.end() && known->place == place ? &*known : nullptr;
        drawing.add(std::move(part));
    }
    return drawing.draw();
}

constexpr uint32_t kThumbnailEdge = 360;
constexpr std::string_view kMark = "<!--@"; // where a part of a page belongs

void writeTally(const Tally &tally, JsonWriter &json)
{
    json.key("tally").beginObject().member("triangles", tally.triangles);
    json.list("levels", tally.levels,
              [&](const auto &level) { json.beginArray().value(level[0]).value(level[1]).end(); });
    json.values("special", tally.special).values("states", tally.states).values("uvArea", tally.uvArea);
    json.member("records", tally.recordsUsed).member("dataBytes", tally.dataBytes);
    json.member("indexBytes", tally.indexBytes).end();
}

// The image with its longer edge at most `edge`; each texel is the mean of a square of texels.
Image scaledDown(const Image &image, uint32_t edge)
{
    const uint32_t factor = (std::max(image.width, image.height) + edge - 1) / edge;
    if (factor <= 1)
        return image;
    Image small{(image.width + factor - 1) / factor, (image.height + factor - 1) / factor, {}};
    small.rgba.reserve(size_t{4} * small.width * small.height);
    for (uint32_t y = 0; y < small.height; ++y)
        for (uint32_t x = 0; x < small.width; ++x)
            for (size_t channel = 0; channel < 4; ++channel) {
                uint32_t sum = 0;
                uint32_t count = 0;
                for (size_t v = y * factor; v < std::min((y + 1) * factor, image.height); ++v)
                    for (size_t u = x * factor; u < std::min((x + 1) * factor, image.width); ++u, ++count)
                        sum += image.rgba[4 * (v * image.width + u) + channel];
                small.rgba.push_back(static_cast<uint8_t>((sum + count / 2) / count));
            }
    return small;
}

Picture pictureOf(const Image &image)
{
    Picture picture{image.width, image.height, std::vector<uint32_t>(image.rgba.size() / 4)};
    std::memcpy(picture.pixels.data(), image.rgba.data(), image.rgba.size());
    return picture;
}

const char *nameOf(Wrap wrap)
{
    switch (wrap) {
    case Wrap::Mirror: return "mirror";
    case Wrap::Clamp: return "clamp";
    default: return "repeat";
    }
}

// `textures`: the first material of each image so far, with which the page has it.
void writeMaterial(const InspectedMaterial &material, uint32_t number, const Tally &tally, const PageData &data,
                   std::map<const Image *, uint32_t> &textures, const PageLimits &limits, JsonWriter &json)
{
    const Material &m = material.material;
    json.beginObject().member("index", material.index).member("name", m.name);
    json.member("mode", m.alphaMode == AlphaMode::Mask ? "MASK" : m.alphaMode == AlphaMode::Blend ? "BLEND" : "OPAQUE");
    json.key("cutoff");
    material.cutoff ? json.value(*material.cutoff) : json.null();
    json.member("alphaFactor", std::isfinite(m.baseColor[3]) ? m.baseColor[3] : 1);
    json.values("wrap", std::array{nameOf(m.wrapU), nameOf(m.wrapV)});
    json.member("filter", m.filter == Filter::Nearest ? "nearest" : "bilinear");
    json.member("firstShape", data.firstShape[number]).member("endShape", data.firstShape[number + 1]);
    writeTally(tally, json);
    json.member("problem", material.problem);
    if (material.image) {
        json.member("width", material.image->width).member("height", material.image->height);
        const auto [texture, isNew] = textures.try_emplace(material.image.get(), number);
        if (isNew)
            json.member("texture", pngUri(pictureOf(scaledDown(*material.image, limits.textureEdge)), Alpha::Kept));
        else
            json.member("textureOf", texture->second);
    }
    json.end();
}

void writePrimitive(const InspectedFile &file, const InspectedPrimitive &primitive, uint32_t first, uint32_t end,
                    JsonWriter &json)
{
    json.beginObject().member("mesh", primitive.place.mesh).member("name", primitive.mesh);
    json.member("primitive", primitive.place.primitive).member("material", primitive.material);
    json.member("triangles", primitive.triangles).member("first", first).member("end", end);
    writeTally(tallyOf(file, primitive), json);
    json.end();
}

void writeMeshes(const Document &document, const InspectedFile &file, const PageLimits &limits, JsonWriter &json)
{
    std::set<uint32_t> drawn;
    json.list("meshes", file.primitives, [&](const InspectedPrimitive &primitive) {
        if (drawn.size() == limits.thumbnails || !drawn.insert(primitive.place.mesh).second)
            return;
        json.beginObject().member("mesh", primitive.place.mesh).member("name", primitive.mesh);
        json.member("picture", pngUri(drawMesh(document, file, primitive.place.mesh, kThumbnailEdge), Alpha::Kept))
            .end();
    });
}

void writeFile(const InspectedFile &file, JsonWriter &json)
{
    std::set<uint32_t> meshes;
    uint64_t dataBytes = 0;
    uint64_t records = 0;
    for (const StoredMicromap &micromap : file.stored.micromaps) {
        dataBytes += micromap.data.size();
        records += micromap.triangles.size();
    }
    for (const InspectedPrimitive &primitive : file.primitives)
        meshes.insert(primitive.place.mesh);
    json.key("file").beginObject().member("name", file.name).member("bytes", file.bytes).member("baked", file.baked);
    json.member("extension", file.stored.extension).member("micromaps", file.stored.micromaps.size());
    json.member("records", records).member("dataBytes", dataBytes).member("meshes", file.meshCount);
    json.member("inspectedMeshes", meshes.size()).member("primitives", file.primitiveCount);
    json.member("micromapPrimitives", file.stored.primitives.size());
    if (file.surface)
        json.member("surfaceKnown", file.surface->known())
            .member("surfaceWithout", file.surface->withoutMicromap)
            .member("surfaceTwoStates", file.surface->twoStates);
    json.end();
}

// The part of the page's data that is JSON.
std::string pageFacts(const Document &document, const InspectedFile &file, const PageData &data,
                      const PageLimits &limits)
{
    JsonWriter json(JsonStyle::Html);
    json.beginObject();
    writeFile(file, json);
    writeTally(tallyOf(file), json);
    json.list("stateColors", kStateColors, [&](uint32_t color) {
        char text[8];
        std::snprintf(text, sizeof text, "#%06x", color);
        json.value(text);
    });
    json.key("materials").beginArray();
    const std::vector<Tally> tallies = talliesOfMaterials(file);
    std::map<const Image *, uint32_t> textures;
    for (uint32_t m = 0; m < file.materials.size(); ++m)
        writeMaterial(file.materials[m], m, tallies[m], data, textures, limits, json);
    json.end().key("primitives").beginArray();
    for (size_t p = 0; p < file.primitives.size(); ++p)
        writePrimitive(file, file.primitives[p], data.firstTriangle[p], data.firstTriangle[p + 1], json);
    json.end();
    writeMeshes(document, file, limits, json);
    json.member("leftOut", data.leftOut).member("records", data.records.size());
    json.member("shapes", data.shapes.size()).member("triangles", data.shapeOf.size());
    return json.member("stateBytes", data.states.size()).end().text();
}

} // namespace

std::string filledPage(std::string_view page, const std::map<std::string_view, std::string> &parts)
{
    std::string filled;
    for (;;) {
        const size_t begin = page.find(kMark);
        if (begin == std::string_view::npos)
            return filled.append(page);
        const size_t end = page.find("-->", begin);
        filled.append(page.substr(0, begin)).append(parts.at(page.substr(begin, end - begin).substr(kMark.size())));
        page.remove_prefix(end + 3);
    }
}

std::string makePage(const Document &document, const InspectedFile &file, const PageLimits &limits)
{
    const PageData data = makePageData(file, limits);
    std::string script;
    for (const std::string_view part : {kPage_elements_js, kPage_data_js, kPage_index_js, kPage_raster_js,
                                        kPage_viewer_js, kPage_charts_js, kPage_details_js, kPage_main_js})
        script.append(part);
    return filledPage(kPage_page_html, {{"title", markupText(file.name)},
                                        {"style", styleElement(kPage_style_css)},
                                        {"facts", "<script type=\"application/json\" id=\"facts\">" +
                                                      pageFacts(document, file, data, limits) + "</script>"},
                                        {"numbers", "<script type=\"text/plain\" id=\"numbers\">" +
                                                        base64Encoded(deflated(data.bytes())) + "</script>"},
                                        {"script", scriptElement(script)}});
}

std::string styleElement(std::string_view css)
{
    return "<style>\n" + std::string(css) + "</style>";
}

std::string scriptElement(std::string_view script)
{
    return "<script>\n\"use strict\";\n(() => {\n" + std::string(script) + "})();\n</script>";
}

std::string plainPage(const std::string &title, const std::string &body)
{
    return filledPage(kPage_plain_html, {{"title", markupText(title)}, {"body", body}});
}

} // namespace vellum::inspect
