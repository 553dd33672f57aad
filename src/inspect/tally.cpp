// SPDX-License-Identifier: Apache-2.0
#include "inspect/tally.h"

#include <cmath>
#include <unordered_set>

namespace vellum::inspect
{
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
        if (!used_.insert(number).second) {
            ++tally_.sharing;
            return;
        }
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

Tally tallyOfMaterial(const InspectedFile &file, uint32_t material)
{
    Tallier tallier(file);
    for (const InspectedPrimitive &primitive : file.primitives)
        if (primitive.material == material)
            tallier.add(primitive);
    return tallier.finish();
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
