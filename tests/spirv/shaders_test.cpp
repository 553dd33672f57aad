// SPDX-License-Identifier: Apache-2.0
// The shaders of the project, as they were built.
#include <algorithm>
#include <array>
#include <string_view>

#include <gtest/gtest.h>

#include "gpu/execution_mode.h"
#include "module_file.h"
#include "spirv/module/micromap_mode.h"
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

// Every entry point can receive the execution mode OpacityMicromapIdKHR, and lose it again.
TEST(Shaders, TakeTheModeOfMicromaps)
{
    using spirv::ModeEdit;
    size_t edited = 0;
    for (const std::filesystem::path &file : listedModules(VELLUM_SHADERS)) {
        const Module words = readModule(file);
        std::string error;
        const auto entries = spirv::readEntryPoints(words, error);
        ASSERT_TRUE(entries.has_value()) << file << ": " << error;
        if (words[1] < 0x10400 || entries->empty() || !validate(withKnownMode(words)).empty())
            continue;
        for (const ModeEdit::To to : {ModeEdit::To::Always, ModeEdit::To::Specialized}) {
            const ModeEdit edit{.to = to, .constantId = 1000, .entryPoints = {entries->front().name}};
            const spirv::ModeResult with = spirv::editMicromapMode(words, edit);
            ASSERT_EQ(with.error, "") << file;
            const Module &result = with.words.empty() ? words : with.words;
            EXPECT_EQ(validate(withKnownMode(result)), "") << file;
            const spirv::ModeResult without = spirv::editMicromapMode(result, {.to = ModeEdit::To::Absent});
            EXPECT_EQ(validate(without.words), "") << file;
        }
        ++edited;
    }
    EXPECT_GT(edited, 100u) << "of those listed in " << VELLUM_SHADERS;
}

// `vellum check` traces with these modules in forms that compilers of GLSL do not write.
TEST(Shaders, OfTheTracerAreValidInEveryForm)
{
    size_t edited = 0;
    for (const std::filesystem::path &file : listedModules(VELLUM_SHADERS)) {
        const std::string name = file.stem().string();
        if (!name.starts_with("tracer_") && !name.starts_with("pipeline_traces_"))
            continue;
        const Module words = readModule(file);
        const Module withSigned = gpu::withSignedFlags(words);
        EXPECT_NE(withSigned, words) << file;
        EXPECT_EQ(validate(withSigned), "") << file;
        if (name.find("_specialized") != std::string::npos) {
            const Module literal = gpu::withLiteral(words, 0, 3), both = gpu::withSignedFlags(literal);
            EXPECT_EQ(validate(both), "") << file;
            if (name == "tracer_comp_specialized") {
                EXPECT_EQ(both.size(), literal.size() + 4) << "a constant of its own, and no bitcast";
            }
        } else {
            const Module selected = gpu::withSelectedFlags(words, 0x81, 0x400);
            EXPECT_NE(selected, words) << file;
            EXPECT_EQ(validate(selected), "") << file;
            EXPECT_EQ(validate(gpu::withSignedFlags(selected)), "") << file;
        }
        using gpu::OtherEntry;
        for (const OtherEntry other : {OtherEntry::Empty, OtherEntry::SharedBefore, OtherEntry::SharedAfter}) {
            const std::string where = file.string() + ", other entry point " + std::to_string(static_cast<int>(other));
            EXPECT_EQ(validate(gpu::withOtherEntry(words, gpu::Mode::Absent, other)), "") << where;
            for (const gpu::Mode mode :
                 {gpu::Mode::True, gpu::Mode::False, gpu::Mode::Specialized, gpu::Mode::Computed}) {
                const Module with = gpu::withMode(words, mode, 9);
                const gpu::Mode opposite = mode == gpu::Mode::True ? gpu::Mode::False : gpu::Mode::True;
                EXPECT_EQ(validate(withKnownMode(gpu::withOtherEntry(with, opposite, other))), "")
                    << where << ", mode " << static_cast<int>(mode);
            }
        }
        ++edited;
    }
    EXPECT_GT(edited, 70u) << "of those listed in " << VELLUM_SHADERS;
}

} // namespace
} // namespace vellum::test
