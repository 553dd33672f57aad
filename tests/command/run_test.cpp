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
constexpr int kTimedOut = 124;
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
constexpr const char *kNotValidated = "vellum run: not validated: add --validate\n";
constexpr const char *kNoInstance =
    "no Vulkan instance was created with the layer: the program did not use Vulkan, found no driver (vellum info), or "
    "the variables of vellum run did not reach it or the loader (VK_LOADER_LAYERS_DISABLE)";

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
        EXPECT_EQ(outcome.errors, kNotValidated + counts);
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
    expectLine(outcome, "vellum run: nothing was checked: " + std::string(kNoInstance) + "\n");
    expectLine(runProgram({"--validate"}, {"instance"}),
               "vellum run: nothing was checked: no Vulkan device was created\n");
    expectLine(runProgram({"--validate"}, {"plain"}),
               "vellum run: nothing was checked: no device enables an extension of opacity micromaps\n");
    expectLine(runScript({"--validate"},
                         "echo info VELLUM-instance: core >> $VELLUM_REPORT_FILE; echo info "
                         "VELLUM-device-unchanged: the driver\\'s opacity micromaps >> $VELLUM_REPORT_FILE"),
               "vellum run: nothing was checked: micromaps are the driver's own, and validation is off\n");
}

// Validation may be on in part, also by a variable or a file.
TEST(Run, NamesThePartsThatWereChecked)
{
    EXPECT_EQ(runProgram({"--validate=core"}, {"build"}).errors,
              "vellum run: no errors, no warnings, 1 device checked (core only)\n");
    EXPECT_EQ(runProgram({}, {"build"}, {{"VELLUM_VALIDATE", "sync,core"}}).errors,
              "vellum run: no errors, no warnings, 1 device checked (core, sync only)\n");
    constexpr const char *kTwo =
        "for parts in 'core' 'core, gpu, sync' core; do echo \"info VELLUM-checked: builds on this device are checked: "
        "$parts [x 1]\" >> $VELLUM_REPORT_FILE; done";
    EXPECT_EQ(runScript({}, kTwo).errors,
              "vellum run: no errors, no warnings, 3 devices checked (core only; core, gpu, sync)\n");
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
        expectLine(unbuilt, options.size() == 1 ? kNotValidated : kNothingBuilt);
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
    const std::string unchecked = "checks\"><system-out>" + std::string(kNoInstance) + "</system-out></testcase>\n";
    EXPECT_EQ(casesOf({}, "true", 0), "tests=\"2\" failures=\"0\"\nprogram\"/>\n" + unchecked);
    EXPECT_EQ(casesOf({}, "exit 3", 3),
              "tests=\"2\" failures=\"1\"\nprogram\"><failure message=\"exited with 3\"/></testcase>\n" + unchecked);
    EXPECT_EQ(casesOf({"--require-checks"}, "true", kMessagesFailed),
              "tests=\"2\" failures=\"1\"\nprogram\"/>\nchecks\"><failure message=\"" + std::string(kNoInstance) +
                  "\"/></testcase>\n");
    EXPECT_EQ(casesOf({}, "echo info VELLUM-checked: builds are checked: core >> $VELLUM_REPORT_FILE", 0),
              "tests=\"2\" failures=\"0\"\nprogram\"/>\nchecks\"><system-out>1 device checked (core "
              "only)</system-out></testcase>\n");
    EXPECT_EQ(casesOf({"--ignore", "VELLUM-a"}, std::string(kError), 0),
              "tests=\"3\" failures=\"0\"\nprogram\"/>\n" + unchecked +
                  "VELLUM-a\"><system-out>ignored: what</system-out></testcase>\n");
    EXPECT_EQ(casesOf({"--timeout", "0.3"}, "sleep 60", kTimedOut),
              "tests=\"2\" failures=\"1\"\nprogram\"><failure message=\"did not end within 0.3 s\"/></testcase>\n" +
                  unchecked);
    EXPECT_EQ(casesOf({}, std::string(kError) + kWarning + kWarning, kMessagesFailed),
              "tests=\"4\" failures=\"1\"\nprogram\"/>\n" + unchecked +
                  "VELLUM-a\"><failure message=\"what\"/></testcase>\n"
                  "VELLUM-b\"><system-out>where (2 times)</system-out></testcase>\n");
    const Outcome noFolder = runScript({"--junit", (path / "run.xml").string()}, "true");
    EXPECT_EQ(noFolder.exitCode, 1) << noFolder.errors;
    expectLine(noFolder, "vellum: ");
    EXPECT_EQ(runScript({"--junit", (folder / "run.json").string()}, "true").exitCode, 2);
    EXPECT_EQ(runScript({"--junit", (folder / "run").string(), "--json", (folder / "./run").string()}, "true").exitCode,
              2);
}

// Not that of an earlier run.
TEST(Run, ResultsOfProgramsThatWereNotRun)
{
    const TemporaryFolder folder;
    const std::filesystem::path junit = folder / "run.xml";
    const std::filesystem::path json = folder / "run.json";
    const auto textOf = [](const std::filesystem::path &path) {
        const Bytes file = readFile(path);
        return std::string(file.begin(), file.end());
    };
    const auto expectFailure = [&](std::vector<std::string> arguments, int code, const std::string &why,
                                   const std::vector<std::pair<std::string, std::string>> &environment = {}) {
        for (const std::filesystem::path &path : {junit, json})
            std::ofstream(path) << "of an earlier run";
        arguments.insert(arguments.begin(), {"run", "--junit", junit.string(), "--json", json.string()});
        const Outcome outcome = runVellum(arguments, environment);
        EXPECT_EQ(outcome.exitCode, code) << outcome.errors;
        EXPECT_NE(textOf(junit).find("tests=\"1\" failures=\"1\""), std::string::npos) << textOf(junit);
        EXPECT_NE(textOf(junit).find("name=\"program\"><failure message=\"not run: " + why), std::string::npos)
            << textOf(junit);
        EXPECT_NE(textOf(json).find("\"notRun\": \"" + why), std::string::npos) << textOf(json);
        EXPECT_NE(textOf(json).find("\"exitCode\": " + std::to_string(code)), std::string::npos) << textOf(json);
    };
    expectFailure({"--", "there-is-no-such-program"}, 127, "there-is-no-such-program: ");
    std::ofstream(folder / "text") << "no program";
    expectFailure({"--", (folder / "text").string()}, 126, "");
    expectFailure({"--layer-path", folder.path().string(), "--", "true"}, kNotRun, "the layer is not found",
                  {{"HOME", folder.path().string()}, {"XDG_DATA_DIRS", folder.path().string()}});
    expectFailure({"--", "true"}, 2, "there is no setting VELLUM_VALIDATTE", {{"VELLUM_VALIDATTE", "1"}});
    expectFailure({"--", "true"}, 2, "VELLUM_REQUIRE_CHECKS is ", {{"VELLUM_REQUIRE_CHECKS", "maybe"}});
}

// A run that is killed leaves a failure.
#ifndef _WIN32
TEST(Run, ResultsOfARunThatDidNotEnd)
{
    const TemporaryFolder folder;
    const std::filesystem::path junit = folder / "run.xml";
    runScript({"--junit", junit.string()}, "kill -KILL $PPID");
    const Bytes file = readFile(junit);
    const std::string text(file.begin(), file.end());
    EXPECT_NE(text.find("<failure message=\"the run has not ended\"/>"), std::string::npos) << text;
}
#endif

TEST(Run, IgnoredMessages)
{
    const std::string script = std::string(kError) + kError + kWarning;
    const Outcome outcome = runScript({"--fail-on", "warning", "--ignore", "VELLUM-a", "--ignore=VELLUM-b"}, script);
    EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
    expectLine(outcome, "vellum run: no errors, no warnings, 3 messages ignored, no devices checked\n");
    expectLine(outcome, "  error   VELLUM-a (2 times, ignored): what\n");
    expectLine(outcome, "  warning VELLUM-b (ignored): where\n");
    const Outcome stale = runScript({"--ignore", "VELLUM-b", "--ignore", "VELLUM"}, kError);
    EXPECT_EQ(stale.exitCode, kMessagesFailed) << "an id is a whole one";
    expectLine(stale, "vellum run: --ignore VELLUM-b: no such message\n");
    expectLine(stale, "vellum run: --ignore VELLUM: no such message\n");
    // As the specification and other layers name a rule.
    const Outcome unprefixed =
        runScript({"--ignore", "VUID-a-00001"}, "echo error VELLUM-VUID-a-00001: what >> $VELLUM_REPORT_FILE;");
    EXPECT_EQ(unprefixed.exitCode, kMessagesFailed);
    expectLine(unprefixed, "vellum run: --ignore VUID-a-00001: no such message; did you mean VELLUM-VUID-a-00001?\n");
    EXPECT_EQ(stale.errors.find("ignored"), std::string::npos) << stale.errors;
}

TEST(Run, SaysHowTheProgramEnded)
{
    expectLine(runScript({}, "exit 3"), "vellum run: the program exited with 3\n");
    EXPECT_EQ(runScript({}, "true").errors.find("run: the program"), std::string::npos);
    // Unlike the code of messages.
    expectLine(runScript({}, "exit 122"), "vellum run: the program exited with 122\n");
#ifndef _WIN32
    expectLine(runScript({}, "kill -SEGV $$"), "vellum run: the program ended by signal 11 (SIGSEGV)\n");
    expectLine(runScript({}, "exit 139"), "vellum run: the program exited with 139\n");
#endif
}

TEST(Run, TimeLimit)
{
    EXPECT_EQ(runScript({"--timeout", "60"}, "exit 3").exitCode, 3);
    EXPECT_EQ(runScript({"--timeout", "60"}, std::string(kError) + "true").exitCode, kMessagesFailed);
    const TemporaryFolder folder;
    const std::string left = (folder / "left").string();
    const Outcome outcome = runScript({"--timeout", "0.5"}, std::string(kError) + "(sleep 2; touch " + left +
                                                                ") & trap '' TERM; sleep 60; sleep 60");
    EXPECT_EQ(outcome.exitCode, kTimedOut) << outcome.errors;
    expectLine(outcome, "vellum run: the program did not end within 0.5 s\n");
    expectLine(outcome, "vellum run: 1 error, no warnings, ");
    EXPECT_FALSE(std::filesystem::exists(left)) << "processes of the program are ended with it";
    EXPECT_EQ(runScript({"--timeout", "0"}, "true").exitCode, 2);
#ifndef _WIN32
    EXPECT_EQ(
        runScript({"--timeout", "60"}, "trap 'echo ended; exit 5' TERM; kill -TERM $PPID; while :; do sleep 0.1; done")
            .exitCode,
        5);
#endif
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
    for (const auto &[name, meant] : {std::pair<std::string, std::string>{"VELUM_VALIDATE", "VELLUM_VALIDATE"},
                                      {"VELLLUM_VALIDATE", "VELLUM_VALIDATE"},
                                      {"VK_VELUM_STRICT", "VK_VELLUM_STRICT"},
                                      {"VELULM_REQUIRE_CHECKS", "VELLUM_REQUIRE_CHECKS"},
#ifndef _WIN32 // whose variables have no case
                                      {"vellum_validate", "VELLUM_VALIDATE"},
                                      {"Vellum_Fail_On", "VELLUM_FAIL_ON"},
                                      {"vellum_validatte", "VELLUM_VALIDATE"},
#endif
                                      {"VELLUM-VALIDATE", "VELLUM_VALIDATE"}}) {
        const Outcome outcome = runScript({}, "echo run", {{name, "1"}});
        EXPECT_EQ(outcome.exitCode, 2) << name;
        EXPECT_EQ(outcome.errors, "vellum: nothing reads " + name + "; did you mean " + meant + "?\n");
    }
    // Settings, and variables of other programs.
    for (const char *name : {"HELIUM_CACHE", "VOLUME_REPORT", "vellum_root", "PELLUM_STRICT_MODE", "VELUM_ROOT"})
        EXPECT_EQ(runScript({}, "echo run", {{name, "1"}}).output, "run\n") << name;
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

#ifndef _WIN32
TEST(Run, MessagesThatCannotBePrintedChangeNothing)
{
    const TemporaryFolder folder;
    const std::string junit = (folder / "run.xml").string();
    const auto run = [&](const std::string &streams, const std::string &script) {
        return runVellumInScript("\"$@\"" + streams, {"run", "--junit", junit, "--", "sh", "-c", script}).exitCode;
    };
    for (const char *streams : {" 2>/dev/full", " 2>&-", " <&- >&- 2>&-"}) {
        EXPECT_EQ(run(streams, "exit 3"), 3) << streams;
        EXPECT_EQ(run(streams, kError), kMessagesFailed) << streams;
        const Bytes file = readFile(junit);
        EXPECT_NE(std::string(file.begin(), file.end()).find("VELLUM-a"), std::string::npos) << streams;
    }
}

// Of TMPDIR, which may be relative.
TEST(Run, TheProgramMayChangeItsWorkingDirectory)
{
    const TemporaryFolder folder;
    const Outcome outcome = runVellumInScript("cd " + folder.path().string() + " && TMPDIR=. \"$@\"",
                                              {"run", "--", "sh", "-c", std::string("cd /; ") + kError});
    EXPECT_EQ(outcome.exitCode, kMessagesFailed) << outcome.errors;
}
#endif

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

// As the loader would pass over it.
TEST(Run, NeedsALayerThatLoads)
{
    const TemporaryFolder folder;
    const auto expectProblem = [&](const std::string &library, const std::string &problem) {
        std::ofstream(folder / "layer.json")
            << R"({"file_format_version": "1.2.0", "layer": {"name": "VK_LAYER_VELLUM_opacity_micromap", "type": "GLOBAL",)"
            << R"( "library_path": ")" << library
            << R"(", "api_version": "1.4.359", "implementation_version": "1", "description": ""}})";
        const Outcome outcome = runVellum({"run", "--layer-path", folder.path().string(), "--", "echo", "run"});
        EXPECT_EQ(outcome.exitCode, kNotRun) << outcome.errors;
        EXPECT_EQ(outcome.output, "");
        EXPECT_EQ(outcome.errors, "vellum: the layer's manifest " + (folder / "layer.json").string() +
                                      ": its library " + (folder / "layer.so").string() + problem + "\n");
    };
    expectProblem("./layer.so", " does not exist");
    std::ofstream(folder / "layer.so") << "no library";
#ifndef _WIN32
    expectProblem("./layer.so", " is not a shared library, or cannot be read");
#endif
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
    // No report of an earlier run stays.
    const TemporaryFolder folder;
    const std::string junit = (folder / "run.xml").string();
    EXPECT_EQ(runScript({"--junit", junit}, "true").exitCode, 0);
    EXPECT_EQ(runScript({"--junit", junit}, "true", {{"VELLUM_FAIL_ON", "errors"}}).exitCode, 2);
    const Bytes bytes = readFile(junit);
    const std::string written(bytes.begin(), bytes.end());
    EXPECT_TRUE(has(written, "VELLUM_FAIL_ON is &#34;errors&#34; and must be error, warning or never; did you mean"))
        << written;
    // Its value is not the argument that is too many.
    for (const std::vector<std::string> &arguments :
         {std::vector<std::string>{"run", "--frobnicate", "5", "--", "true"},
          {"bake", "--frobnicate", "5", "a.glb", "b.glb", "c.glb"}}) {
        const Outcome outcome = runVellum(arguments);
        EXPECT_EQ(outcome.exitCode, 2);
        EXPECT_EQ(outcome.errors.find("vellum: --frobnicate is not an option of vellum " + arguments[0]), 0U)
            << outcome.errors;
    }
}

TEST(Run, BooleanVariables)
{
    for (const char *yes : {"1", "true", "ON", "yes"})
        EXPECT_EQ(runScript({}, "true", {{"VELLUM_REQUIRE_CHECKS", yes}}).exitCode, kMessagesFailed) << yes;
    for (const char *no : {"0", "false", "off", "No", ""})
        EXPECT_EQ(runScript({}, "true", {{"VELLUM_REQUIRE_CHECKS", no}}).exitCode, 0) << no;
    const Outcome outcome = runScript({}, "echo run", {{"VELLUM_REQUIRE_CHECKS", "maybe"}});
    EXPECT_EQ(outcome.exitCode, 2);
    EXPECT_EQ(outcome.errors,
              "vellum: VELLUM_REQUIRE_CHECKS is \"maybe\" and must be 1, true, on, yes, 0, false, off or no\n");
    EXPECT_EQ(runProgram({"--fail-on", "warning"}, {"right"}, {{"VELLUM_STRICT", "yes"}}).exitCode, 0);
}

// They are options of `vellum run` alone.
TEST(Run, VariablesThatNothingReadsAreReported)
{
    const auto errorsOf = [](const std::string &report) {
        return runScript({}, "VELLUM_FAIL_ON=warning VELLUM_REPORT_FILE=" + report + " " + VELLUM_MICROMAP_PROGRAM +
                                 " instance instance")
            .errors;
    };
    const std::string alone = errorsOf("");
    const size_t begin = alone.find("vellum: warning: VELLUM_FAIL_ON is set, which only vellum run reads");
    EXPECT_NE(begin, std::string::npos) << alone;
    EXPECT_EQ(alone.find("VELLUM_FAIL_ON", begin + 30), std::string::npos) << "once for each process: " << alone;
    EXPECT_EQ(errorsOf("$VELLUM_REPORT_FILE").find("VELLUM_FAIL_ON"), std::string::npos);
}
