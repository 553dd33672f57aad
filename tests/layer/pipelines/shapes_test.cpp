// SPDX-License-Identifier: Apache-2.0
// Ray query code in all forms that applications write.
#include "harness/columns.h"

#include "harness/program/labels.h"
#include "shapes_all.h"

namespace
{

const vt::Labels kShapesLabels{{"All/Shapes.*", "slow"}, {"All/Shapes.RayFlags/*", "constants"}};

using namespace vt;

class Shapes : public GpuTest, public testing::WithParamInterface<int>
{
protected:
    Shapes() : GpuTest({.shared = true}) {}

    std::vector<Result> trace(const Columns &columns)
    {
        return Tracer(gpu(), kShapes[static_cast<size_t>(GetParam())]).trace(columns.scene(), columns.rays(), 1);
    }
};

// Nothing is ever committed, so the number of candidates is defined.
TEST_P(Shapes, Candidates)
{
    const Columns columns(gpu(), 3, kNever);
    const std::vector<Result> results = trace(columns);
    for (uint32_t i = 0; i < Columns::kColumns; ++i) {
        SCOPED_TRACE(testing::Message() << "column " << i);
        uint32_t expected = columns.nonOpaque(i);
        uint32_t layer = Columns::kLayers;
        switch (GetParam()) {
        case 4: expected = 0; break;
        case 10: expected = std::min(expected, 1u); break;
        case 17:
        case 18: expected = std::min(expected, 3u); break;
        case 19: // odd threads trace with the Opaque flag, every other pair does not proceed
            layer = (i & 3) == 1 ? columns.nearest(i, true, kRayOpaque) : Columns::kLayers;
            expected = (i & 3) == 0 ? expected : 0;
            break;
        case 20:
            layer = columns.nearest(i, true, kRayOpaque);
            expected = 0;
            break;
        default: break;
        }
        EXPECT_EQ(results[i].candidates.size(), std::min(results[i].candidateCount, 1u));
        EXPECT_EQ(results[i].candidateCount, expected);
        if (GetParam() == 20) { // the first hit, not the nearest
            EXPECT_EQ(results[i].committed, layer == Columns::kLayers ? kNone : kTriangle);
        } else {
            Columns::expectCommitted(results[i], layer);
        }
        if (GetParam() == 7 || GetParam() == 8 || GetParam() == 9) {
            EXPECT_EQ(results[i].u, static_cast<float>(columns.nonOpaque(i + 1)));
            EXPECT_EQ(results[i].v, 0.0f);
        }
        if (GetParam() == 19) {
            EXPECT_EQ(results[i].flags, i % 2 == 0 ? 0u : kRayOpaque);
        } else if (GetParam() == 20) {
            EXPECT_EQ(results[i].flags, kRayOpaque | kRayTerminateOnFirstHit);
        } else {
            EXPECT_EQ(results[i].flags, 0u);
        }
    }
}

// Everything is confirmed: the hit that stays is certain.
TEST_P(Shapes, CommittedHit)
{
    const Columns columns(gpu(), 4, kAlways);
    const std::vector<Result> results = trace(columns);
    for (uint32_t i = 0; i < Columns::kColumns; ++i) {
        SCOPED_TRACE(testing::Message() << "column " << i);
        switch (GetParam()) {
        case 4: Columns::expectCommitted(results[i], columns.nearest(i, false)); break;
        case 10:
        case 17:
        case 18: break; // stops early, at candidates in any order
        case 19:
            if ((i & 2) == 0)
                Columns::expectCommitted(results[i], columns.nearest(i, true));
            break;
        case 20:
            EXPECT_EQ(results[i].committed,
                      columns.nearest(i, true, kRayOpaque) == Columns::kLayers ? kNone : kTriangle);
            break;
        default: Columns::expectCommitted(results[i], columns.nearest(i, true)); break;
        }
        if (GetParam() == 22) {
            EXPECT_LT(results[i].candidateCount, 1000u);
        }
        if (GetParam() == 7 || GetParam() == 8 || GetParam() == 9) {
            const uint32_t layer = columns.nearest(i + 1, true);
            EXPECT_EQ(results[i].v, layer == Columns::kLayers ? 0.0f : 1 + static_cast<float>(layer));
        }
    }
}

// With the ray flags that the layer must hide from the driver.
TEST_P(Shapes, RayFlags)
{
    if (GetParam() == 10 || (GetParam() >= 17 && GetParam() <= 20))
        return; // stops early, or has flags of its own
    for (const uint32_t flags : {kRayOpaque, kRayNoOpaque, kRayCullOpaque, kRayCullNoOpaque, kRayForceTwoState,
                                 kRayForceTwoState | kRayNoOpaque}) {
        SCOPED_TRACE(testing::Message() << "flags " << std::hex << flags);
        const Columns columns(gpu(), 4, kAlways, flags);
        const std::vector<Result> results = trace(columns);
        for (uint32_t i = 0; i < Columns::kColumns; ++i) {
            SCOPED_TRACE(testing::Message() << "column " << i);
            EXPECT_EQ(results[i].flags, flags);
            Columns::expectCommitted(results[i], columns.nearest(i, GetParam() != 4, flags));
        }
    }
}

INSTANTIATE_TEST_SUITE_P(All, Shapes, testing::Range(0, static_cast<int>(kShapes.size())));

TEST(InlineModule, ComputeStage)
{
    Gpu gpu;
    if (!gpu.has(VK_EXT_GRAPHICS_PIPELINE_LIBRARY_EXTENSION_NAME))
        GTEST_SKIP() << "no way to pass a shader module in the stage";
    {
        const Columns columns(gpu, 4, kAlways);
        const std::vector<Result> results =
            Tracer(gpu, kShapes[0], {.inlineModule = true}).trace(columns.scene(), columns.rays(), 1);
        for (uint32_t i = 0; i < Columns::kColumns; ++i)
            Columns::expectCommitted(results[i], columns.nearest(i, true));
    }
    for (const Message &m : gpu.takeUnexpectedMessages())
        ADD_FAILURE() << m.id << ": " << m.text;
}

} // namespace
