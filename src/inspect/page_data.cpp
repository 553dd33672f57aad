// SPDX-License-Identifier: Apache-2.0
#include "inspect/page_data.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <tuple>
#include <unordered_map>

#include "core/bit_cast.h"
#include "core/hash.h"

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

} // namespace vellum::inspect
