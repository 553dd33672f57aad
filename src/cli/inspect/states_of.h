// The state at a place in a triangle.
#pragma once

#include "cli/inspect/inspected_file.h"
#include "core/curve.h"

namespace vellum::cli
{

// Of `record`, of InspectedFile::records or a special index, at barycentrics (u, v).
class StatesOf
{
public:
    StatesOf(const InspectedFile &file, std::int32_t record)
    {
        if (isSpecial(record)) {
            m_special = *specialState(record);
            return;
        }
        const InspectedRecord &of = file.records[static_cast<std::size_t>(record)];
        m_triangle = of.triangle;
        m_data = file.stored.micromaps[of.micromap].data.data() + of.triangle.dataOffset;
    }

    [[nodiscard]] State at(double u, double v) const
    {
        if (m_data == nullptr)
            return m_special;
        const std::uint32_t index =
            shared::curveIndex(static_cast<float>(u), static_cast<float>(v), m_triangle.subdivisionLevel);
        return readState(m_data, index, m_triangle.format);
    }
    [[nodiscard]] std::uint32_t level() const { return m_data == nullptr ? 0 : m_triangle.subdivisionLevel; }

private:
    const std::uint8_t *m_data = nullptr;
    MicromapTriangle m_triangle;
    State m_special = State::Transparent;
};

} // namespace vellum::cli
