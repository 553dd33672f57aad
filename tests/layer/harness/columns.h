// SPDX-License-Identifier: Apache-2.0
// A scene for shader tests: columns of triangles behind each other, each triangle one state all over, every instance
// with custom index 4242; one ray down each column.
#pragma once

#include <cstdint>
#include <random>

#include "check/oracle/outcome.h"
#include "harness/harness.h"

namespace vt
{

class Columns
{
public:
    static constexpr uint32_t kColumns = 96;
    static constexpr uint32_t kLayers = 7;

    // States are drawn from 0..states-1 in the order transparent, unknown transparent, unknown opaque, opaque.
    Columns(Gpu &gpu, uint32_t states, uint32_t rule, uint32_t flags = 0)
    {
        std::mt19937 random(states * 7 + flags);
        constexpr std::array<uint8_t, 4> order{0, 2, 3, 1};
        MicromapInput input;
        for (uint8_t s = 0; s < 4; ++s)
            input.add(2, kFourState, std::vector<uint8_t>(16, s));
        micromap_ = std::make_unique<Micromap>(gpu, std::move(input));
        micromap_->build();
        Geometry geometry;
        Attachment attachment;
        attachment.micromap = micromap_.get();
        attachment.indexType = VK_INDEX_TYPE_UINT16;
        for (uint32_t c = 0; c < kColumns; ++c) {
            const float x = 1.5f * static_cast<float>(c);
            for (uint32_t l = 0; l < kLayers; ++l) {
                const uint8_t state = order[random() % states];
                states_[c][l] = state;
                appendTriangle(geometry.vertices, {x, 0, -static_cast<float>(l)});
                attachment.indices.push_back(random() % 4 == 0 ? -1 - int32_t{state} : int32_t{state});
            }
            Ray ray;
            ray.origin = {x + 0.3f, 0.3f, 1};
            ray.rule = rule;
            ray.flags = flags;
            rays_.push_back(ray);
        }
        geometry.micromap = std::move(attachment);
        blas_ = std::make_unique<Blas>(gpu, std::vector{geometry});
        tlas_ = std::make_unique<Tlas>(gpu, std::vector{instance(*blas_, {}, 4242)});
    }

    [[nodiscard]] const Tlas &scene() const { return *tlas_; }
    [[nodiscard]] const std::vector<Ray> &rays() const { return rays_; }
    // The number of the column's triangles that a shader receives as candidates if nothing is committed.
    [[nodiscard]] uint32_t nonOpaque(uint32_t column, uint32_t rayFlags = 0) const
    {
        uint32_t n = 0;
        for (const uint8_t state : states_[column % kColumns])
            n += outcomeOf(state, false, 0, rayFlags) == Outcome::NonOpaque ? 1u : 0u;
        return n;
    }
    // The first layer that may be committed, if the shader confirms everything (or nothing); kLayers: none.
    [[nodiscard]] uint32_t nearest(uint32_t column, bool confirming, uint32_t rayFlags = 0) const
    {
        for (uint32_t l = 0; l < kLayers; ++l) {
            const Outcome outcome = outcomeOf(states_[column % kColumns][l], false, 0, rayFlags);
            if (outcome == Outcome::Opaque || (confirming && outcome == Outcome::NonOpaque))
                return l;
        }
        return kLayers;
    }
    static void expectCommitted(const RawResult &result, uint32_t layer)
    {
        EXPECT_EQ(result.committed, layer == kLayers ? kNone : kTriangle);
        if (layer == kLayers || result.committed != kTriangle)
            return;
        EXPECT_FLOAT_EQ(result.t, 1 + static_cast<float>(layer));
        EXPECT_EQ(result.customIndex, 4242u);
    }

private:
    std::array<std::array<uint8_t, kLayers>, kColumns> states_{};
    std::unique_ptr<Micromap> micromap_;
    std::unique_ptr<Blas> blas_;
    std::unique_ptr<Tlas> tlas_;
    std::vector<Ray> rays_;
};

} // namespace vt
