// SPDX-License-Identifier: Apache-2.0
// `vellum run`: the environment of the program, exit codes, and the counting of messages.
#include <fstream>
#include <gtest/gtest.h>
#include <regex>
#include <set>
#include <sstream>

#include "command.h"
#include "glb_file.h"

using namespace vellum::test;

namespace
{

constexpr int kMessagesFailed = 122;
constexpr int kNotRun = 125;
#ifdef _WIN32
constexpr int kCrashed = static_cast<int>(0xC0000005);
constexpr const char *kListSeparator = ";";
#else
constexpr int kCrashed = 128 + 11; // SIGSEGV
constexpr const char *kListSeparator = ":";
#endif

// Runs a program of the tests with these options of `vellum run`; `uses` are the program's arguments.
Outcome runProgram(std::vector<std::string> options, const std::vector<std::string> &uses,
                   const std::vector<std::pair<std::string, std::string>> &environment = {})
{
    options.insert(options.begin(), "run");
    options.insert(options.end(), {"--", VELLUM_MICROMAP_PROGRAM});
    options.insert(options.end(), uses.begin(), uses.end());
    return runVellum(options, environment);
}

// A script of the shell, which stands for a program and for the layer in it.
Outcome runScript(std::vector<std::string> options, const std::string &script,
                  const std::vector<std::pair<std::string, std::string>> &environment = {})
{
    options.insert(options.begin(), "run");
    options.insert(options.end(), {"--", "sh", "-c", script});
    return runVellum(options, environment);
}

constexpr const char *kError = "echo error VELLUM-a: what >> $VELLUM_REPORT_FILE;";
constexpr const char *kWarning = "echo warning VELLUM-b: where >> $VELLUM_REPORT_FILE;";

constexpr const char *kNothingBuilt =
    "vellum run: nothing was checked: no micromap or acceleration structure was built on a device with validation\n";

void expectLine(const Outcome &outcome, const std::string &line)
{
    EXPECT_NE(("\n" + outcome.errors).find("\n" + line), std::string::npos) << line << "\nnot in\n" << outcome.errors;
}

} // namespace

TEST(Run, RightUse)
{
    const Outcome outcome = runProgram({"--fail-on", "warning", "--validate"}, {"build"});
    EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
    EXPECT_EQ(outcome.errors, "vellum run: no errors, no warnings, 1 device checked\n");
    EXPECT_EQ(runProgram({"--validate"}, {"build", "right", "build"}).errors,
              "vellum run: no errors, no warnings, 2 devices checked\n");
}

// Without validation the layer reports only what it has to reject or tolerate.
TEST(Run, NothingIsCheckedWithoutValidationOrBuilds)
{
    const std::string counts = "vellum run: no errors, no warnings, no devices checked\n";
    EXPECT_EQ(runProgram({"--validate"}, {"right"}).errors, kNothingBuilt + counts);
    for (const Outcome &outcome : {runProgram({}, {"build"}), runProgram({"--validate=none"}, {"build"})})
        EXPECT_EQ(outcome.errors, "vellum run: not validated: add --validate\n" + counts);
}

TEST(Run, AnErrorFails)
{
    const Outcome outcome = runProgram({"--validate"}, {"error", "build", "error"});
    EXPECT_EQ(outcome.exitCode, kMessagesFailed);
    expectLine(outcome, "vellum run: 2 errors, no warnings, 1 device checked\n");
    expectLine(outcome, "  error   VELLUM-VUID-VkMicromapBuildInfoEXT-type-parameter (2 times): ");
    EXPECT_EQ(runProgram({"--fail-on=never"}, {"error"}).exitCode, 0);
}

TEST(Run, AWarningFailsOnRequest)
{
    const Outcome outcome = runProgram({}, {"warning"});
    EXPECT_EQ(outcome.exitCode, 0);
    expectLine(outcome, "vellum run: no errors, 1 warning, no devices checked\n");
    expectLine(outcome, "  warning VELLUM-unknown-structure: ");
    EXPECT_EQ(runProgram({"--fail-on=warning"}, {"warning"}).exitCode, kMessagesFailed);
    EXPECT_EQ(runProgram({}, {"warning"}, {{"VELLUM_FAIL_ON", "warning"}}).exitCode, kMessagesFailed);
}

TEST(Run, ProcessesOfTheProgram)
{
    const Outcome outcome = runProgram({}, {"both"});
    EXPECT_EQ(outcome.exitCode, kMessagesFailed);
    expectLine(outcome, "vellum run: 1 error, 1 warning, no devices checked\n");
}

TEST(Run, ACrashKeepsItsCodeAndTheMessages)
{
    const Outcome outcome = runProgram({}, {"error", "crash"});
    EXPECT_EQ(outcome.exitCode, kCrashed);
    expectLine(outcome, "vellum run: 1 error, ");
}

TEST(Run, SeverityThatFails)
{
    EXPECT_EQ(runScript({}, kError).exitCode, kMessagesFailed);
    EXPECT_EQ(runScript({}, kWarning).exitCode, 0);
    EXPECT_EQ(runScript({"--fail-on", "warning"}, kWarning).exitCode, kMessagesFailed);
    EXPECT_EQ(runScript({"--fail-on", "never"}, kError).exitCode, 0);
    EXPECT_EQ(runScript({"--fail-on", "error"}, kWarning, {{"VELLUM_FAIL_ON", "warning"}}).exitCode, 0);
    const Outcome outcome =
        runScript({}, std::string(kError) + kWarning + kWarning + "echo broken >> $VELLUM_REPORT_FILE");
    expectLine(outcome, "vellum run: 1 error, 2 warnings, no devices checked\n");
    expectLine(outcome, "  warning VELLUM-b (2 times): where\n");
}

TEST(Run, SaysWhenNothingWasChecked)
{
    const Outcome outcome = runScript({}, "true");
    EXPECT_EQ(outcome.exitCode, 0);
    expectLine(outcome, "vellum run: nothing was checked: no device used micromaps through the layer\n");
}

TEST(Run, ChecksThatAreRequired)
{
    const std::vector<std::string> required = {"--require-checks"};
    const Outcome outcome = runScript(required, "true");
    EXPECT_EQ(outcome.exitCode, kMessagesFailed);
    expectLine(outcome, "vellum run: failed, because nothing was checked (--require-checks)\n");
    EXPECT_EQ(runScript({"--require-checks", "--fail-on", "never"}, "true").exitCode, kMessagesFailed);
    EXPECT_EQ(runScript({}, "true", {{"VELLUM_REQUIRE_CHECKS", "1"}}).exitCode, kMessagesFailed);
    EXPECT_EQ(runScript(required, "exit 3").exitCode, 3);
    for (const std::vector<std::string> &options :
         {std::vector<std::string>{"--require-checks"}, {"--require-checks", "--validate"}}) {
        const Outcome unbuilt = runProgram(options, {options.size() == 1 ? "build" : "right"});
        EXPECT_EQ(unbuilt.exitCode, kMessagesFailed);
        expectLine(unbuilt, options.size() == 1 ? "vellum run: not validated: add --validate\n" : kNothingBuilt);
    }
    EXPECT_EQ(runProgram({"--require-checks", "--validate"}, {"build"}).exitCode, 0);
    EXPECT_EQ(runProgram({"--validate"}, {"build"}, {{"VELLUM_REQUIRE_CHECKS", "1"}}).errors,
              "vellum run: no errors, no warnings, 1 device checked\n");
}

TEST(Run, ResultsForJunit)
{
    const TemporaryFolder folder;
    const std::filesystem::path path = folder / "run.xml";
    const auto casesOf = [&](std::vector<std::string> options, const std::string &script, int code) {
        options.insert(options.end(), {"--junit", path.string()});
        EXPECT_EQ(runScript(options, script).exitCode, code);
        const Bytes file = readFile(path);
        const std::string text(file.begin(), file.end());
        EXPECT_EQ(text.find("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites name=\"vellum run\">\n"), 0U)
            << text;
        constexpr std::string_view kCase = "classname=\"vellum.run\" name=\"";
        std::string cases;
        for (size_t at = text.find(kCase); at != std::string::npos; at = text.find(kCase, at + 1))
            cases += text.substr(at + kCase.size(), text.find('\n', at) - at - kCase.size()) + "\n";
        return text.substr(text.find("tests="), text.find(" time=") - text.find("tests=")) + "\n" + cases;
    };
    const std::string unchecked =
        "checks\"><system-out>no device used micromaps through the layer</system-out></testcase>\n";
    EXPECT_EQ(casesOf({}, "true", 0), "tests=\"2\" failures=\"0\"\nprogram\"/>\n" + unchecked);
    EXPECT_EQ(casesOf({}, "exit 3", 3),
              "tests=\"2\" failures=\"1\"\nprogram\"><failure message=\"exit code 3\"/></testcase>\n" + unchecked);
    EXPECT_EQ(
        casesOf({"--require-checks"}, "true", kMessagesFailed),
        "tests=\"2\" failures=\"1\"\nprogram\"/>\nchecks\"><failure message=\"no device used micromaps through the "
        "layer\"/></testcase>\n");
    EXPECT_EQ(casesOf({}, std::string(kError) + kWarning + kWarning, kMessagesFailed),
              "tests=\"4\" failures=\"1\"\nprogram\"/>\n" + unchecked +
                  "VELLUM-a\"><failure message=\"what\"/></testcase>\n"
                  "VELLUM-b\"><system-out>where (2 times)</system-out></testcase>\n");
    const Outcome noFolder = runScript({"--junit", (path / "run.xml").string()}, "true");
    EXPECT_EQ(noFolder.exitCode, 1) << noFolder.errors;
    expectLine(noFolder, "vellum: ");
    EXPECT_EQ(runScript({"--junit", (folder / "run.json").string()}, "true").exitCode, 2);
}

TEST(Run, PartsOfValidationAreChecked)
{
    for (const char *wrong : {"--validate=cpre", "--validate=core,", "--validate=core gpu", "--validate=core,gpuu"}) {
        const Outcome outcome = runScript({wrong}, "echo run");
        EXPECT_EQ(outcome.exitCode, 2) << outcome.errors;
        EXPECT_EQ(outcome.output, "");
        EXPECT_NE(outcome.errors.find("must be core, gpu, sync, several of them with commas, all or none, got "),
                  std::string::npos)
            << outcome.errors;
    }
    for (const char *right : {"--validate", "--validate=core,gpu,sync", "--validate=none"})
        EXPECT_EQ(runScript({right}, "true").exitCode, 0) << right;
}

TEST(Run, SettingsThatAreIgnoredFail)
{
    const std::pair<std::string, std::string> wrong[] = {{"VELLUM_VALIDATE", "al"}, {"VK_VELLUM_STRICT", "maybe"}};
    for (const auto &variable : wrong) {
        const Outcome outcome = runProgram({}, {"right"}, {variable});
        EXPECT_EQ(outcome.exitCode, kMessagesFailed) << outcome.errors;
        expectLine(outcome, "  error   VELLUM-setting: ");
    }
}

// Also for a program that never loads the layer.
TEST(Run, MisspeltVariablesAreErrors)
{
    for (const auto &[name, meant] : {std::pair<std::string, std::string>{"VELLUM_VALIDATTE", "VELLUM_VALIDATE"},
                                      {"VK_VELLUM_STRICKT", "VK_VELLUM_STRICT"},
                                      {"VELLUM_REQUIRE_CHECK", "VELLUM_REQUIRE_CHECKS"}}) {
        const Outcome outcome = runScript({}, "echo run", {{name, "1"}});
        EXPECT_EQ(outcome.exitCode, 2);
        EXPECT_EQ(outcome.output, "");
        EXPECT_EQ(outcome.errors, "vellum: there is no setting " + name + "; did you mean " + meant + "?\n");
    }
    // Settings, and variables of other programs.
    for (const char *name : {"VELLUM_CACHE", "VELLUM_VERSION", "VELLUM_ROOT", "VK_VELLUM_REQUIRE_CHECK"})
        EXPECT_EQ(runScript({}, "echo run", {{name, "1"}}).output, "run\n") << name;
}

// Where several processes write, each message ends with its own.
TEST(Run, MessagesNameTheProcess)
{
    const std::string errors = runProgram({}, {"both"}).errors;
    static const std::regex kMessage(R"(  (error|warning) .* \[(vellum_micromap_program\S*) (\d+)\])");
    std::set<std::string> processes;
    std::istringstream lines(errors);
    std::smatch match;
    for (std::string line; std::getline(lines, line);)
        if (std::regex_match(line, match, kMessage))
            processes.insert(match[3]);
    EXPECT_EQ(processes.size(), 2U) << errors;
}

TEST(Run, ExitCodesOfTheProgram)
{
    EXPECT_EQ(runScript({}, "exit 3").exitCode, 3);
    EXPECT_EQ(runScript({}, std::string(kError) + "exit 3").exitCode, 3);
    EXPECT_EQ(runScript({}, "kill -KILL $$").exitCode, 128 + 9);
}

TEST(Run, ProgramsThatCannotBeRun)
{
    const Outcome missing = runVellum({"run", "--", "there-is-no-such-program"});
    EXPECT_EQ(missing.exitCode, 127);
    EXPECT_EQ(missing.errors.find("vellum: there-is-no-such-program: "), 0u) << missing.errors;
    EXPECT_EQ(missing.errorLines(), 1);
    const TemporaryFolder folder;
    std::ofstream(folder / "text") << "no program";
    EXPECT_EQ(runVellum({"run", "--", (folder / "text").string()}).exitCode, 126);
}

TEST(Run, WordsOfTheProgramStayAsTheyAre)
{
    const Outcome outcome = runProgram({"--strict"}, {"words", "[a,b]", "--help", "", "--", "run", "--strict"});
    EXPECT_EQ(outcome.output, "[a,b]|--help||--|run|--strict|");
}

TEST(Run, SettingsOfTheLayer)
{
    const std::vector<std::string> variables = {
        "variables",         "VELLUM_VALIDATE", "VELLUM_STRICT", "VELLUM_IMPLEMENTATION", "VELLUM_ASSUME_MICROMAPS",
        "VK_INSTANCE_LAYERS"};
    const std::string layer = "VK_LAYER_VELLUM_opacity_micromap";
    EXPECT_EQ(runProgram({}, variables).output, "||||" + layer + "|");
    EXPECT_EQ(runProgram({"--validate", "--strict", "--implementation", "emulated", "--assume-micromaps"}, variables,
                         {{"VK_INSTANCE_LAYERS", "VK_LAYER_other"}})
                  .output,
              "all|1|emulated|1|" + layer + kListSeparator + "VK_LAYER_other|");
    EXPECT_EQ(runProgram({"--validate=core,sync"}, variables).output, "core,sync||||" + layer + "|");
    const std::string both = std::string("VK_LAYER_a") + kListSeparator + layer;
    EXPECT_EQ(runProgram({}, variables, {{"VK_INSTANCE_LAYERS", both}}).output, "||||" + both + "|");
}

TEST(Run, TheFileOfMessagesIsRemoved)
{
    const TemporaryFolder folder;
    const Outcome outcome =
        runScript({}, "test -f $VELLUM_REPORT_FILE && echo $VELLUM_REPORT_FILE", {{"TMPDIR", folder.path().string()}});
    EXPECT_EQ(outcome.exitCode, 0);
    EXPECT_EQ(outcome.output.rfind(folder.path().string(), 0), 0u) << outcome.output;
    EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(Run, ASignalToTheCommandAloneReachesTheProgram)
{
    const Outcome outcome =
        runScript({}, "trap 'echo ended; exit 5' TERM; kill -TERM $PPID; while :; do sleep 0.1; done");
    EXPECT_EQ(outcome.output, "ended\n");
    EXPECT_EQ(outcome.exitCode, 5);
}

TEST(Run, NeedsTheLayer)
{
    const TemporaryFolder folder;
    const Outcome outcome = runVellum({"run", "--layer-path", folder.path().string(), "--", "echo", "run"},
                                      {{"HOME", folder.path().string()}, {"XDG_DATA_DIRS", folder.path().string()}});
    EXPECT_EQ(outcome.output, "");
    EXPECT_EQ(outcome.exitCode, kNotRun) << outcome.errors;
}

#ifndef _WIN32 // queries the system for the folder
TEST(Run, NeedsAFileForMessages)
{
    const Outcome outcome = runVellum({"run", "--", "echo", "run"}, {{"TMPDIR", "/nowhere"}});
    EXPECT_EQ(outcome.exitCode, kNotRun);
    EXPECT_EQ(outcome.output, "");
    EXPECT_TRUE(outcome.errors.starts_with("vellum: the folder for temporary files (TMPDIR) cannot be used: "))
        << outcome.errors;
}
#endif

TEST(Run, WrongCommandLines)
{
    for (const std::vector<std::string> &arguments :
         {std::vector<std::string>{"run"}, {"run", "--"}, {"run", "--fail-on", "info", "--", "true"}}) {
        const Outcome outcome = runVellum(arguments);
        EXPECT_NE(outcome.exitCode, 0);
        EXPECT_EQ(outcome.errorLines(), 1) << outcome.errors;
    }
    EXPECT_NE(runScript({}, "true", {{"VELLUM_FAIL_ON", "errors"}}).exitCode, 0);
}
