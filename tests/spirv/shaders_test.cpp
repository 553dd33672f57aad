// SPDX-License-Identifier: Apache-2.0
// The shaders of the project, as they were built.
#include <algorithm>
#include <array>
#include <string_view>

#include <gtest/gtest.h>

#include "module_file.h"
#include "validate.h"

namespace vellum::test
{
namespace
{

// Shaders with capabilities that the validator of Debian 12 does not know: RayTracingPositionFetchKHR,
// RayQueryPositionFetchKHR and RayTracingOpacityMicromapExecutionModeKHR.
constexpr std::array<std::string_view, 3> kNewer{"pipeline_positions_", "query_positions", "render_comp_micromaps"};
constexpr std::string_view kUnknown = "Invalid capability operand";

TEST(Shaders, AreValid)
{
    size_t validated = 0;
    for (const std::filesystem::path &file : listedModules(VELLUM_SHADERS)) {
        const std::string name = file.stem().string();
        const std::string messages = validate(readModule(file));
        if (messages.starts_with(kUnknown) &&
            std::ranges::any_of(kNewer, [&](std::string_view newer) { return name.starts_with(newer); }))
            continue;
        EXPECT_EQ(messages, "") << file;
        ++validated;
    }
    EXPECT_GT(validated, 100u) << "of those listed in " << VELLUM_SHADERS;
}

} // namespace
} // namespace vellum::test
