// SPDX-License-Identifier: Apache-2.0
// `vellum spirv`: what it writes, its exit codes, and what it prints.
#include <gtest/gtest.h>

#include "command.h"
#include "glb_file.h"
#include "module_file.h"
#include "spirv/module/micromap_mode.h"

using namespace vellum;
using namespace vellum::test;

namespace
{

using When = spirv::MicromapMode::When;

struct SpirvCommand : testing::Test {
    const std::string queries = std::string(SHADER_DIRECTORY) + "/while_loop.comp.v15.spv";
    const std::string anyHit = std::string(SHADER_DIRECTORY) + "/any_hit.rahit.v15.spv";
    TemporaryFolder folder;
    const std::string out = folder / "out.spv";

    static Outcome run(std::vector<std::string> arguments, const std::filesystem::path &input = "/dev/null")
    {
        arguments.insert(arguments.begin(), "spirv");
        return runVellum(arguments, {}, input);
    }
    static spirv::MicromapMode modeOf(const std::string &path)
    {
        std::string error;
        const auto entries = spirv::readEntryPoints(readModule(path), error);
        EXPECT_TRUE(entries && entries->size() == 1) << error;
        return entries ? entries->front().mode : spirv::MicromapMode{};
    }
    static void expectUsageError(const std::vector<std::string> &arguments, const std::string &part)
    {
        const Outcome outcome = run(arguments);
        EXPECT_EQ(outcome.exitCode, 2);
        EXPECT_EQ(outcome.errorLines(), 1) << outcome.errors;
        EXPECT_TRUE(has(outcome.errors, part)) << outcome.errors;
    }
    static void expectFailure(const Outcome &outcome, const std::string &part)
    {
        EXPECT_EQ(outcome.exitCode, 1);
        EXPECT_EQ(outcome.errorLines(), 1) << outcome.errors;
        EXPECT_TRUE(has(outcome.errors, part)) << outcome.errors;
    }
};

TEST_F(SpirvCommand, EnablesAlways)
{
    const Outcome outcome = run({"--enable-micromaps", queries, "-o", out});
    EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
    EXPECT_TRUE(has(outcome.output, "main (compute): ray queries; execution mode true")) << outcome.output;
    EXPECT_EQ(modeOf(out), spirv::MicromapMode{When::Always});
    EXPECT_EQ(run({"--enable-micromaps=always", queries, "-o", folder / "same.spv"}).exitCode, 0);
    EXPECT_EQ(readModule(folder / "same.spv"), readModule(out));
}

TEST_F(SpirvCommand, EnablesByConstant)
{
    EXPECT_EQ(run({"--enable-micromaps=7", queries, "-o", out}).exitCode, 0);
    EXPECT_EQ(modeOf(out), (spirv::MicromapMode{When::Specialized, 7, false}));
    EXPECT_EQ(run({"--enable-micromaps=8", "--default", "true", queries, "-o", out, "--force"}).exitCode, 0);
    EXPECT_EQ(modeOf(out), (spirv::MicromapMode{When::Specialized, 8, true}));
}

TEST_F(SpirvCommand, Disables)
{
    EXPECT_EQ(run({"--enable-micromaps", queries, "-o", out}).exitCode, 0);
    EXPECT_EQ(run({"--disable", out, "-o", out, "--force"}).exitCode, 0);
    EXPECT_EQ(modeOf(out), spirv::MicromapMode{});
}

// A module without ray queries is written as it is.
TEST_F(SpirvCommand, LeavesOthersAlone)
{
    const Outcome outcome = run({"--enable-micromaps", anyHit, "-o", out});
    EXPECT_EQ(outcome.exitCode, 0);
    EXPECT_TRUE(has(outcome.output, ", unchanged")) << outcome.output;
    EXPECT_EQ(readModule(out), readModule(anyHit));
    EXPECT_EQ(run({"--enable-micromaps", "--entry", "main", anyHit, "-o", out, "--force"}).exitCode, 0);
    EXPECT_EQ(modeOf(out), spirv::MicromapMode{When::Always});
}

TEST_F(SpirvCommand, StandardStreams)
{
    const Outcome outcome = run({"--enable-micromaps", "-", "-o", "-"}, queries);
    EXPECT_EQ(outcome.exitCode, 0);
    EXPECT_TRUE(has(outcome.errors, "execution mode true")) << outcome.errors;
    writeFile(out, {outcome.output.begin(), outcome.output.end()});
    EXPECT_EQ(modeOf(out), spirv::MicromapMode{When::Always});
}

// An existing module is replaced, as compilers do. The input itself and files that are not modules are not replaced.
TEST_F(SpirvCommand, ReplacesModules)
{
    EXPECT_EQ(run({"--enable-micromaps", queries, "-o", out}).exitCode, 0);
    const auto enabled = readModule(out);
    EXPECT_EQ(run({"--enable-micromaps", queries, "-o", out}).exitCode, 0);
    EXPECT_EQ(readModule(out), enabled);
    EXPECT_EQ(run({"--disable", queries, "-o", out}).exitCode, 0);
    EXPECT_EQ(modeOf(out), spirv::MicromapMode{});
    const auto disabled = readModule(out);
    expectFailure(run({"--enable-micromaps", out, "-o", out}), "--force");
    EXPECT_EQ(readModule(out), disabled);
    writeFile(folder / "text.spv", {'t', 'e', 'x', 't'});
    expectFailure(run({"--enable-micromaps", queries, folder / "text.spv"}), "--force");
    EXPECT_EQ(readFile(folder / "text.spv"), (Bytes{'t', 'e', 'x', 't'}));
}

TEST_F(SpirvCommand, TakesOutAsAnOperand)
{
    const Outcome outcome = run({"--enable-micromaps", queries, out});
    EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
    EXPECT_EQ(modeOf(out), spirv::MicromapMode{When::Always});
    expectFailure(run({"--disable", queries, out}), "--force"); // *.spv may name two modules
    expectFailure(run({"--disable", queries, out}), "the second of two operands replaces nothing");
    EXPECT_EQ(modeOf(out), spirv::MicromapMode{When::Always});
    EXPECT_EQ(run({"--disable", queries, out, "--force"}).exitCode, 0);
    EXPECT_EQ(modeOf(out), spirv::MicromapMode{});
    expectUsageError({"--enable-micromaps", queries, anyHit, "-o", out}, "IN OUT");
    expectUsageError({"--enable-micromaps", queries, anyHit, out}, "IN OUT");
}

TEST_F(SpirvCommand, Rewrites)
{
    const Outcome whole = run({"--rewrite", queries, "-o", out});
    EXPECT_EQ(whole.exitCode, 0) << whole.errors;
    EXPECT_TRUE(has(whole.output, "the output needs the layer")) << whole.output;
    EXPECT_GT(readModule(out).size(), readModule(queries).size());
    // Without the execution mode, the layer changes ray queries of KHR only for custom indices.
    EXPECT_EQ(run({"--rewrite", "--api", "khr", queries, "-o", folder / "khr.spv"}).exitCode, 0);
    EXPECT_LT(readModule(folder / "khr.spv").size(), readModule(out).size());
    EXPECT_EQ(run({"--rewrite", "--stage", "any-hit", anyHit, "-o", folder / "stage.spv"}).exitCode, 0);
    EXPECT_GT(readModule(folder / "stage.spv").size(), readModule(anyHit).size());
    expectFailure(run({"--rewrite", "--stage", "miss", anyHit, "-o", folder / "none.spv"}), "cannot be rewritten");
    EXPECT_FALSE(std::filesystem::exists(folder / "none.spv"));
}

TEST_F(SpirvCommand, LintFindsMissingModes)
{
    const Outcome outcome = run({"--lint", queries, anyHit});
    EXPECT_EQ(outcome.exitCode, 1);
    EXPECT_TRUE(has(outcome.output, "finding: main: ray queries without OpacityMicromapIdKHR")) << outcome.output;
    EXPECT_TRUE(has(outcome.output, "no findings")) << outcome.output;
    EXPECT_EQ(run({"--lint", anyHit}).exitCode, 0);
    EXPECT_EQ(run({"--enable-micromaps", queries, "-o", out}).exitCode, 0);
    EXPECT_EQ(run({"--lint", out}).exitCode, 0);
}

TEST_F(SpirvCommand, LintFindsModesWithoutEffect)
{
    EXPECT_EQ(run({"--enable-micromaps", "--entry", "main", anyHit, "-o", out}).exitCode, 0);
    const Outcome outcome = run({"--lint", out});
    EXPECT_EQ(outcome.exitCode, 1);
    EXPECT_TRUE(has(outcome.output, "OpacityMicromapIdKHR has no effect")) << outcome.output;
}

TEST_F(SpirvCommand, LintFindsInvalidModes)
{
    EXPECT_EQ(run({"--enable-micromaps", queries, "-o", out}).exitCode, 0);
    std::vector<uint32_t> words = readModule(out);
    constexpr uint32_t kModeId = 4u << 16 | 331, kMode = 6031;
    for (size_t at = 5; at + 3 < words.size(); ++at)
        if (words[at] == kModeId && words[at + 2] == kMode)
            words[at + 3] = words[at + 1]; // the entry point's id is not a constant
    const auto *bytes = reinterpret_cast<const uint8_t *>(words.data());
    writeFile(folder / "wrong.spv", {bytes, bytes + words.size() * 4});
    const Outcome outcome = run({"--lint", folder / "wrong.spv"});
    EXPECT_EQ(outcome.exitCode, 1);
    EXPECT_TRUE(has(outcome.output, "no constant of type bool")) << outcome.output;
    EXPECT_TRUE(has(outcome.output, "the layer cannot emulate micromaps for it")) << outcome.output;
}

TEST_F(SpirvCommand, BadInput)
{
    writeFile(folder / "text.spv", {'t', 'e', 'x', 't', '\n'});
    expectFailure(run({"--disable", folder / "text.spv", "-o", out}), "not SPIR-V");
    expectFailure(run({"--disable", folder / "missing.spv", "-o", out}), "cannot be read");
    expectFailure(run({"--lint", folder / "missing.spv"}), "cannot be read");
    expectFailure(run({"--enable-micromaps", "--entry", "other", queries, "-o", out}),
                  "there is no entry point other; the module has main");
    EXPECT_FALSE(std::filesystem::exists(out));
}

TEST_F(SpirvCommand, UsageErrors)
{
    expectUsageError({queries, "-o", out}, "one of --enable-micromaps, --disable, --rewrite and --lint");
    expectUsageError({"--disable", "--lint", queries}, "one of --enable-micromaps, --disable, --rewrite and --lint");
    expectUsageError({"--enable-micromaps", queries}, "an output");
    expectUsageError({"--enable-micromaps=seven", queries, "-o", out}, "seven");
    expectUsageError({"--enable-micromaps", "--default", "true", queries, "-o", out}, "--default");
    expectUsageError({"--disable", "--stage", "miss", queries, "-o", out}, "--stage");
    expectUsageError({"--disable", "--api", "khr", queries, "-o", out}, "--api");
    expectUsageError({"--rewrite", "--entry", "main", queries, "-o", out}, "--entry");
    EXPECT_FALSE(std::filesystem::exists(out));
}

} // namespace
