#include "cli/inspect/page_data.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <map>
#include <tuple>
#include <unordered_map>

#include "core/hash.h"

namespace vellum::cli
{
namespace
{

std::uint32_t pageBytes(std::uint32_t level)
{
    return packedBytes(level, Format::FourState);
}

// The states of one micromap triangle for the page.
class StatesOfRecord
{
public:
    StatesOfRecord(const StoredMicromap &micromap, const StateCounter &counter, const MicromapTriangle &triangle)
        : m_micromap(micromap), m_counter(counter), m_triangle(triangle)
    {
    }

    void write(std::uint32_t pageLevel, std::uint8_t *to) const
    {
        const std::uint32_t level = m_triangle.subdivisionLevel;
        const std::uint8_t *from = m_micromap.data.data() + m_triangle.dataOffset;
        if (pageLevel == level && m_triangle.format == Format::FourState) {
            std::memcpy(to, from, pageBytes(level));
            return;
        }
        for (std::uint32_t i = 0; i < microTriangleCount(pageLevel); ++i) {
            const State state = pageLevel == level ? readState(from, i, m_triangle.format)
                                                   : most(i, microTriangleCount(level - pageLevel));
            writeState(to, i, Format::FourState, state);
        }
    }

private:
    // Parts of a triangle are contiguous on the curve.
    [[nodiscard]] State most(std::uint32_t part, std::uint32_t count) const
    {
        const StateCounts counts = m_counter.count(m_triangle, std::uint64_t{part} * count, count);
        return static_cast<State>(std::max_element(counts.begin(), counts.end()) - counts.begin());
    }

    const StoredMicromap &m_micromap;
    const StateCounter &m_counter;
    const MicromapTriangle &m_triangle;
};

// Micromap triangles with the same data are one record of the page.
using RecordKey = std::tuple<std::uint32_t, std::uint32_t, std::uint16_t, Format>;

struct ShapeKey {
    std::uint32_t material = 0;
    std::array<std::uint32_t, 6> uvs{};
    std::int32_t record = 0;
    bool operator==(const ShapeKey &) const = default;
};

struct ShapeHash {
    std::size_t operator()(const ShapeKey &key) const
    {
        static_assert(sizeof key == 8 * sizeof(std::uint32_t)); // no padding
        return static_cast<std::size_t>(hashBytes(&key, sizeof key));
    }
};

class PageMaker
{
public:
    PageMaker(const InspectedFile &file, const PageLimits &limits)
        : m_file(file), m_limits(limits), m_pageRecord(file.records.size(), -1)
    {
    }

    PageData make()
    {
        findTriangles();
        sortShapes();
        copyStates();
        return std::move(m_data);
    }

private:
    void findTriangles();
    std::int32_t useRecord(std::int32_t record);
    void sortShapes();
    void copyStates();

    const InspectedFile &m_file;
    const PageLimits &m_limits;
    PageData m_data;
    std::vector<std::int32_t> m_pageRecord; // by record of the file; -1: not used yet
    std::map<RecordKey, std::int32_t> m_known;
    std::vector<std::int32_t> m_recordOf; // of the file, by record of the page
    std::unordered_map<ShapeKey, std::uint32_t, ShapeHash> m_shapes;
    std::vector<std::uint32_t> m_materials; // of each shape
};

std::int32_t PageMaker::useRecord(std::int32_t record)
{
    if (isSpecial(record))
        return record;
    std::int32_t &number = m_pageRecord[static_cast<std::size_t>(record)];
    if (number >= 0)
        return number;
    const InspectedRecord &from = m_file.records[static_cast<std::size_t>(record)];
    const auto [known, added] = m_known.emplace(
        RecordKey{from.micromap, from.triangle.dataOffset, from.triangle.subdivisionLevel, from.triangle.format},
        static_cast<std::int32_t>(m_data.records.size()));
    if (added) {
        const auto level = static_cast<std::uint8_t>(from.triangle.subdivisionLevel);
        m_data.records.push_back({level, level, from.triangle.format, from.states, 0});
        m_recordOf.push_back(record);
    }
    return number = known->second;
}

void PageMaker::findTriangles()
{
    for (const InspectedPrimitive &primitive : m_file.primitives) {
        m_data.firstTriangle.push_back(static_cast<std::uint32_t>(m_data.shapeOf.size()));
        for (std::size_t t = 0; t < primitive.records.size(); ++t) {
            if (m_data.shapeOf.size() == m_limits.triangles) {
                m_data.leftOut += primitive.records.size() - t;
                break;
            }
            ShapeKey key{.material = primitive.material, .record = useRecord(primitive.records[t])};
            for (std::size_t corner = 0; corner < 3; ++corner) {
                key.uvs[2 * corner] = std::bit_cast<std::uint32_t>(primitive.uvs[t][corner].u);
                key.uvs[2 * corner + 1] = std::bit_cast<std::uint32_t>(primitive.uvs[t][corner].v);
            }
            const auto [shape, added] = m_shapes.emplace(key, static_cast<std::uint32_t>(m_data.shapes.size()));
            if (added) {
                m_data.shapes.push_back({primitive.uvs[t], key.record});
                m_materials.push_back(primitive.material);
            }
            m_data.shapeOf.push_back(shape->second);
            m_data.numbers.push_back(primitive.numbers[t]);
        }
    }
    m_data.firstTriangle.push_back(static_cast<std::uint32_t>(m_data.shapeOf.size()));
}

// By material, and in the order in which they were found.
void PageMaker::sortShapes()
{
    m_data.firstShape.assign(m_file.materials.size() + 1, 0);
    for (const std::uint32_t material : m_materials)
        ++m_data.firstShape[material + 1];
    for (std::size_t m = 1; m < m_data.firstShape.size(); ++m)
        m_data.firstShape[m] += m_data.firstShape[m - 1];
    std::vector<std::uint32_t> next(m_data.firstShape.begin(), m_data.firstShape.end());
    std::vector<std::uint32_t> place(m_materials.size());
    std::vector<PageShape> sorted(m_materials.size());
    for (std::size_t s = 0; s < place.size(); ++s) {
        place[s] = next[m_materials[s]]++;
        sorted[place[s]] = m_data.shapes[s];
    }
    m_data.shapes = std::move(sorted);
    for (std::uint32_t &shape : m_data.shapeOf)
        shape = place[shape];
}

void PageMaker::copyStates()
{
    const auto bytesUpTo = [&](std::uint32_t most) {
        std::size_t bytes = 0;
        for (const PageRecord &record : m_data.records)
            bytes += pageBytes(std::min<std::uint32_t>(record.level, most));
        return bytes;
    };
    std::uint32_t most = 12;
    while (most > 0 && bytesUpTo(most) > m_limits.stateBytes)
        --most;
    m_data.states.resize(bytesUpTo(most));
    std::vector<StateCounter> counters;
    for (const StoredMicromap &micromap : m_file.stored.micromaps)
        counters.emplace_back(micromap.data);
    std::uint32_t at = 0;
    for (std::size_t r = 0; r < m_data.records.size(); ++r) {
        PageRecord &record = m_data.records[r];
        record.pageLevel = static_cast<std::uint8_t>(std::min<std::uint32_t>(record.level, most));
        record.firstByte = at;
        const InspectedRecord &from = m_file.records[static_cast<std::size_t>(m_recordOf[r])];
        StatesOfRecord(m_file.stored.micromaps[from.micromap], counters[from.micromap], from.triangle)
            .write(record.pageLevel, m_data.states.data() + at);
        at += pageBytes(record.pageLevel);
    }
}

// Little-endian numbers, one after another.
class ByteWriter
{
public:
    void byte(std::uint8_t value) { m_bytes.push_back(value); }
    void word(std::uint32_t value)
    {
        for (unsigned shift = 0; shift < 32; shift += 8)
            m_bytes.push_back(static_cast<std::uint8_t>(value >> shift));
    }
    void words(const std::vector<std::uint32_t> &values)
    {
        for (const std::uint32_t value : values)
            word(value);
    }
    std::vector<std::uint8_t> finish(const std::vector<std::uint8_t> &tail)
    {
        m_bytes.insert(m_bytes.end(), tail.begin(), tail.end());
        return std::move(m_bytes);
    }

private:
    std::vector<std::uint8_t> m_bytes;
};

} // namespace

std::vector<std::uint8_t> PageData::bytes() const
{
    ByteWriter to;
    for (const PageRecord &record : records) {
        to.byte(record.level);
        to.byte(record.pageLevel);
        to.byte(static_cast<std::uint8_t>(record.format));
        to.byte(0);
        to.word(record.firstByte);
        for (const std::uint64_t count : record.states)
            to.word(static_cast<std::uint32_t>(count));
    }
    for (const PageShape &shape : shapes) {
        for (const TexCoord &uv : shape.uvs) {
            to.word(std::bit_cast<std::uint32_t>(uv.u));
            to.word(std::bit_cast<std::uint32_t>(uv.v));
        }
        to.word(static_cast<std::uint32_t>(shape.record));
    }
    to.words(shapeOf);
    to.words(numbers);
    return to.finish(states);
}

PageData makePageData(const InspectedFile &file, const PageLimits &limits)
{
    return PageMaker(file, limits).make();
}

} // namespace vellum::cli
