// SPDX-License-Identifier: Apache-2.0
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
    StatesOf(const InspectedFile &file, int32_t record)
    {
        if (isSpecial(record)) {
            special_ = *specialState(record);
            return;
        }
        const InspectedRecord &of = file.records[static_cast<size_t>(record)];
        triangle_ = of.triangle;
        data_ = file.stored.micromaps[of.micromap].data.data() + of.triangle.dataOffset;
    }

    [[nodiscard]] State at(double u, double v) const
    {
        if (data_ == nullptr)
            return special_;
        const uint32_t index =
            shared::curveIndex(static_cast<float>(u), static_cast<float>(v), triangle_.subdivisionLevel);
        return readState(data_, index, triangle_.format);
    }
    [[nodiscard]] uint32_t level() const { return data_ == nullptr ? 0 : triangle_.subdivisionLevel; }

private:
    const uint8_t *data_ = nullptr;
    MicromapTriangle triangle_;
    State special_ = State::Transparent;
};

} // namespace vellum::cli
