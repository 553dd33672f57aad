// SPDX-License-Identifier: Apache-2.0
// Chains of rays through closest-hit, miss and callable shaders (shaders/pipeline_relay.glsl).
#pragma once

#include <cstdint>

#include "gpu/pipeline_builder.h"
#include "harness/columns.h"
#include "harness/harness.h"

namespace vt
{

struct RelayStep {
    uint32_t stage, customIndex, customIndexAfter, flags, flagsAfter, candidates, bad, callable;
    float t;
    uint32_t below;
    uint32_t queryCandidates, queryCommitted, queryCustomIndex;
    float queryT;
    uint32_t queryFlags, primitive;
    uint32_t anyHitQueries, anyHitCommitted;
    float anyHitT;
    uint32_t anyHitCustomIndex;
};
static_assert(sizeof(RelayStep) == 80);

// Triangles behind each other like those of Columns, without micromaps.
class PlainColumns
{
public:
    static constexpr uint32_t kCustomIndex = 0x765432;

    explicit PlainColumns(Gpu &gpu)
    {
        Geometry geometry;
        for (uint32_t c = 0; c < Columns::kColumns; ++c) {
            for (uint32_t l = 0; l < 2; ++l)
                appendTriangle(geometry.vertices, {1.5f * static_cast<float>(c), 0, -static_cast<float>(l)});
        }
        blas_ = std::make_unique<Blas>(gpu, std::vector{geometry});
        tlas_ = std::make_unique<Tlas>(gpu, std::vector{instance(*blas_, {}, kCustomIndex)});
    }
    [[nodiscard]] const Tlas &scene() const { return *tlas_; }

private:
    std::unique_ptr<Blas> blas_;
    std::unique_ptr<Tlas> tlas_;
};

} // namespace vt
