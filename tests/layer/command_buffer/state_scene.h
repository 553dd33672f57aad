// SPDX-License-Identifier: Apache-2.0
// A micromap, a BLAS and a TLAS that are built where a test says, and looked at afterwards.
#pragma once

#include <cstdint>

#include "gpu/tracer.h"
#include "harness/harness.h"

namespace vt
{

class StateScene
{
public:
    static constexpr uint32_t kSteps = 3;

    explicit StateScene(Gpu &gpu) : blas_(gpu), tlas_(gpu), tracer_(gpu)
    {
        MicromapInput input;
        for (uint8_t state = 0; state < 4; ++state)
            input.add(5, kFourState, std::vector<uint8_t>(1024, state));
        micromap_ = std::make_unique<Micromap>(gpu, std::move(input));
        Geometry geometry{.vertices = triangleRow(4)};
        geometry.micromap = Attachment{micromap_.get()};
        blas_.prepare({geometry});
        tlas_.prepare(std::vector{instance(blas_, {}, 321)});
    }

    void recordStep(VkCommandBuffer commands, uint32_t step)
    {
        if (step == 0)
            micromap_->record(commands);
        else if (step == 1)
            blas_.record(commands);
        else
            tlas_.record(commands);
    }
    // Everything, with barriers in between.
    void record(VkCommandBuffer commands)
    {
        for (uint32_t step = 0; step < kSteps; ++step) {
            recordStep(commands, step);
            barrier(commands);
        }
    }

    [[nodiscard]] static std::vector<Ray> rays()
    {
        std::vector<Ray> rays(4);
        for (size_t i = 0; i < 4; ++i) {
            rays[i].origin = {1.5f * static_cast<float>(i) + 0.3f, 0.3f, 1};
            rays[i].rule = kNever;
        }
        return rays;
    }
    static void expectRight(const std::vector<Result> &results)
    {
        for (size_t i = 0; i < 4; ++i) {
            EXPECT_EQ(results[i].committed, i == 1 ? kTriangle : kNone) << "triangle " << i;
            EXPECT_EQ(results[i].candidateCount, i >= 2 ? 1u : 0u) << "triangle " << i;
        }
        EXPECT_EQ(results[1].customIndex, 321u);
    }
    void expectRight() { expectRight(tracer_.trace(tlas_, rays())); }

    [[nodiscard]] Micromap &micromap() { return *micromap_; }
    [[nodiscard]] const Tlas &tlas() const { return tlas_; }

private:
    std::unique_ptr<Micromap> micromap_;
    Blas blas_;
    Tlas tlas_;
    Tracer tracer_;
};

} // namespace vt
