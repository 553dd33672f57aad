#include "cli/inspect/tally.h"

#include <cmath>
#include <unordered_set>

namespace vellum::cli
{
namespace
{

class Tallier
{
public:
    explicit Tallier(const InspectedFile &file) : m_file(file) {}

    void add(const InspectedPrimitive &primitive)
    {
        for (std::size_t t = 0; t < primitive.records.size(); ++t)
            add(primitive.records[t], uvArea(primitive.uvs[t]));
        m_tally.indexBytes += primitive.indexBytes;
    }

    Tally finish()
    {
        for (double &share : m_tally.states)
            share /= m_tally.triangles != 0 ? static_cast<double>(m_tally.triangles) : 1;
        return m_tally;
    }

private:
    void add(std::int32_t record, double area)
    {
        ++m_tally.triangles;
        const std::array<double, 4> shares = stateShares(m_file, record);
        for (std::size_t s = 0; s < 4; ++s) {
            m_tally.states[s] += shares[s];
            m_tally.uvArea[s] += shares[s] * area;
        }
        if (isSpecial(record)) {
            ++m_tally.special[static_cast<std::size_t>(*specialState(record))];
            return;
        }
        const auto number = static_cast<std::size_t>(record);
        const MicromapTriangle &triangle = m_file.records[number].triangle;
        ++m_tally.levels[triangle.subdivisionLevel][triangle.format == Format::TwoState ? 0 : 1];
        if (!m_used.insert(number).second) {
            ++m_tally.sharing;
            return;
        }
        ++m_tally.recordsUsed;
        m_tally.dataBytes += dataBytes(m_file, record);
    }

    const InspectedFile &m_file;
    std::unordered_set<std::size_t> m_used; // there may be many more records, and many primitives to tally
    Tally m_tally;
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

Tally tallyOfMaterial(const InspectedFile &file, std::uint32_t material)
{
    Tallier tallier(file);
    for (const InspectedPrimitive &primitive : file.primitives)
        if (primitive.material == material)
            tallier.add(primitive);
    return tallier.finish();
}

std::array<double, 4> stateShares(const InspectedFile &file, std::int32_t record)
{
    std::array<double, 4> shares{};
    if (isSpecial(record)) {
        shares[static_cast<std::size_t>(*specialState(record))] = 1;
        return shares;
    }
    const InspectedRecord &of = file.records[static_cast<std::size_t>(record)];
    for (std::size_t s = 0; s < 4; ++s)
        shares[s] = static_cast<double>(of.states[s]) / microTriangleCount(of.triangle.subdivisionLevel);
    return shares;
}

std::uint64_t dataBytes(const InspectedFile &file, std::int32_t record)
{
    if (isSpecial(record))
        return 0;
    const MicromapTriangle &triangle = file.records[static_cast<std::size_t>(record)].triangle;
    return packedBytes(triangle.subdivisionLevel, triangle.format);
}

double uvArea(const TriangleUvs &uvs)
{
    const double ux = double{uvs[1].u} - uvs[0].u, uy = double{uvs[1].v} - uvs[0].v;
    const double vx = double{uvs[2].u} - uvs[0].u, vy = double{uvs[2].v} - uvs[0].v;
    const double area = std::abs(ux * vy - uy * vx) / 2;
    return std::isfinite(area) ? area : 0;
}

} // namespace vellum::cli
