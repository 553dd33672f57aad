// SPDX-License-Identifier: Apache-2.0
// The GPU baker's shaders require no more of a device than Vulkan 1.2 with buffer device addresses guarantees.
#include <array>
#include <span>

#include <gtest/gtest.h>

#include "shaders/bake_begin.h"
#include "shaders/bake_blocks.h"
#include "shaders/bake_cells.h"
#include "shaders/bake_count.h"
#include "shaders/bake_measure.h"
#include "shaders/bake_params.h"
#include "shaders/bake_place.h"
#include "shaders/bake_plan.h"
#include "shaders/bake_probe.h"
#include "shaders/bake_records.h"
#include "shaders/bake_scan.h"
#include "shaders/bake_write.h"

namespace
{

constexpr uint32_t kOpExecutionMode = 16;
constexpr uint32_t kOpCapability = 17;
constexpr uint32_t kLocalSize = 17;
constexpr uint32_t kCapabilityShader = 1;
constexpr uint32_t kCapabilityPhysicalStorageBufferAddresses = 5347;

constexpr std::array<std::span<const uint32_t>, 12> kShaders = {bake_begin,   bake_blocks,  bake_cells, bake_count,
                                                                bake_measure, bake_params,  bake_place, bake_plan,
                                                                bake_probe,   bake_records, bake_scan,  bake_write};

} // namespace

TEST(GpuBakeShaders, NeedNothingOptional)
{
    for (size_t s = 0; s < kShaders.size(); ++s) {
        SCOPED_TRACE(s);
        const std::span<const uint32_t> words = kShaders[s];
        bool sized = false;
        for (size_t i = 5; i < words.size(); i += words[i] >> 16) {
            ASSERT_GT(words[i] >> 16, 0u);
            const uint32_t op = words[i] & 0xffffu;
            if (op == kOpCapability) {
                EXPECT_TRUE(words[i + 1] == kCapabilityShader ||
                            words[i + 1] == kCapabilityPhysicalStorageBufferAddresses)
                    << "capability " << words[i + 1];
            }
            if (op == kOpExecutionMode && words[i + 2] == kLocalSize) {
                sized = true;
                EXPECT_LE(words[i + 3] * words[i + 4] * words[i + 5], 128u) << "maxComputeWorkGroupInvocations";
            }
        }
        EXPECT_TRUE(sized);
    }
}
