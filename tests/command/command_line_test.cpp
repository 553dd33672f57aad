// SPDX-License-Identifier: Apache-2.0
// The command line itself: help, suggestions, errors and exit codes.
#include <cstdlib>
#include <gtest/gtest.h>
#include <map>
#include <regex>
#include <sstream>
#include <sys/stat.h>

#include "command.h"
#include "glb_file.h"
#include "gltf/data/decompress.h"
#include "gltf/data/image.h"

using namespace vellum::test;

namespace
{

const std::vector<std::string> kSubcommands = {"bake", "help", "info", "inspect", "render", "run", "verify"};

} // namespace

TEST(CommandLine, HelpOptionsAndCommand)
{
    const Outcome help = runVellum({"--help"});
    EXPECT_EQ(help.exitCode, 0);
    EXPECT_EQ(runVellum({"help"}).output, help.output);
    EXPECT_EQ(runVellum({"-h"}).output, help.output);
    const Outcome bare = runVellum({});
    EXPECT_EQ(bare.exitCode, 2);
    EXPECT_EQ(bare.output, "");
    EXPECT_EQ(bare.errors, help.output);
    for (const std::string &subcommand : kSubcommands) {
        EXPECT_TRUE(has(help.output, "\n  " + subcommand + " ")) << help.output;
        const Outcome one = runVellum({"help", subcommand});
        EXPECT_EQ(one.exitCode, 0);
        EXPECT_EQ(one.output, runVellum({subcommand, "--help"}).output);
        EXPECT_TRUE(has(one.output, "Usage: vellum " + subcommand + " ")) << one.output;
    }
    EXPECT_TRUE(has(help.output, "draft")) << help.output;
}

TEST(CommandLine, VersionAndWhatTheBuildCannotRead)
{
    const std::string version = runVellum({"--version"}).output;
    EXPECT_EQ(runVellum({"-V"}).output, version);
    std::string expected = R"(vellum \d+\.\d+\.\d+( \([0-9a-f]{12}\))?\n)";
    if (!vellum::kDecodesWebpAndAvif)
        expected += "this build cannot read WebP and AVIF images\n";
    if (!vellum::kDecompressesMeshes)
        expected += "this build cannot read geometry compressed by Draco or meshoptimizer\n";
    if (!vellum::undecodableByMeshoptimizer().empty())
        expected += R"(this build cannot read geometry by EXT_meshopt_compression and KHR_meshopt_compression with .+ )"
                    R"(\(meshoptimizer \d+\.\d+\)\n)";
    EXPECT_TRUE(std::regex_match(version, std::regex(expected))) << version;
}

TEST(CommandLine, HelpIsAsWideAsTheTerminal)
{
    for (const char *columns : {"60", "80", "100"})
        for (const std::string &subcommand : kSubcommands) {
            const Outcome help = runVellum({"help", subcommand}, {{"COLUMNS", columns}});
            std::istringstream lines(help.output);
            for (std::string line; std::getline(lines, line);)
                EXPECT_LT(line.size(), std::strtoul(columns, nullptr, 10)) << line;
            for (const char *leak : {"TEXT", "Excludes", "Needs", "UINT", "INT ", "FLOAT", "REQUIRED", "Options:"})
                EXPECT_FALSE(has(help.output, leak)) << help.output;
        }
}

TEST(CommandLine, MisspeltVariablesOfOptionsAreReported)
{
    const TemporaryFolder folder;
    const Outcome outcome = runVellum({"bake", (folder / "none.glb").string(), (folder / "out.glb").string()},
                                      {{"VELLUM_CAHCE", "x"}, {"VELLUM_OTHER", "x"}});
    EXPECT_TRUE(outcome.errors.starts_with("vellum: warning: nothing reads VELLUM_CAHCE; did you mean VELLUM_CACHE?\n"))
        << outcome.errors;
    EXPECT_EQ(outcome.errorLines(), 2) << outcome.errors;
}

TEST(CommandLine, AllExitCodesAreInTheHelp)
{
    const std::string overview = runVellum({"help"}).output;
    const std::string verify = runVellum({"help", "verify"}).output;
    for (const char code : {'0', '1', '2', '3', '4', '5', '6', '7'}) {
        EXPECT_TRUE(has(overview, std::string("\n  ") + code + "  ")) << overview;
        EXPECT_TRUE(has(verify, std::string("\n  ") + code + "  ")) << verify;
    }
}

TEST(CommandLine, EveryHelpHasTheExitCodesOfItsSubcommand)
{
    const std::map<std::string, std::vector<std::string>> codes = {
        {"bake", {"0", "1", "2", "7", "130"}},
        {"bench", {"0", "1", "2", "130"}},
        {"check", {"0", "1", "2", "125", "130"}},
        {"help", {"0", "1", "2"}},
        {"info", {"0", "1", "2", "3"}},
        {"inspect", {"0", "1", "2"}},
        {"render", {"0", "1", "2"}},
        {"run", {"1", "2", "122", "124", "125", "126", "127"}},
        {"spirv", {"0", "1", "2"}},
        {"sweep", {"0", "1", "2"}},
        {"verify", {"0", "1", "2", "3", "4", "5", "6", "7"}},
    };
    std::istringstream lines(runVellum({"help"}).output);
    std::string line;
    size_t seen = 0;
    while (std::getline(lines, line) && line != "Subcommands:") {
    }
    while (std::getline(lines, line) && line.starts_with("  ")) {
        if (line.starts_with("   "))
            continue;
        const std::string subcommand = line.substr(2, line.find(' ', 2) - 2);
        const std::string help = runVellum({"help", subcommand}).output;
        std::istringstream section(help.substr(std::min(help.find("\nExit status:\n"), help.size())));
        std::vector<std::string> found;
        static const std::regex kCode(R"(  (\d+)  .*)");
        std::smatch match;
        while (std::getline(section, line))
            if (std::regex_match(line, match, kCode))
                found.push_back(match[1]);
        ASSERT_TRUE(codes.contains(subcommand)) << subcommand;
        EXPECT_EQ(found, codes.at(subcommand)) << help;
        ++seen;
    }
    EXPECT_EQ(seen, codes.size());
    EXPECT_TRUE(has(runVellum({"help", "bake"}).output, "\n  7    --require-micromaps: no micromaps\n"));
}

TEST(CommandLine, ErrorsNameTheOptionAndItsRange)
{
    const std::vector<std::pair<std::vector<std::string>, std::string>> cases = {
        {{"bak"}, "bak is not a vellum subcommand; did you mean bake?"},
        {{"help", "rendr"}, "rendr is not a vellum subcommand; did you mean render?"},
        {{"version"}, "version is not a vellum subcommand; did you mean --version?"},
        {{"xyzzy"}, "xyzzy is not a vellum subcommand"},
        {{"--verison"}, "--verison is not an option of vellum; did you mean --version? (see vellum --help)"},
        {{"bake", "a.glb", "--levle", "3"}, "--levle is not an option of vellum bake; did you mean --level?"},
        {{"bake", "a.glb", "--max-lev=3"}, "--max-lev is not an option of vellum bake; did you mean --max-level?"},
        {{"bake"}, "IN is required"},
        {{"bake", "a.glb", "--min-known", "2"}, "--min-known must be between 0 and 1, got 2"},
        {{"bake", "a.glb", "--min-known", "most"}, "--min-known must be between 0 and 1, got most"},
        {{"bake", "a.glb", "--max-level", "13"}, "--max-level must be a whole number between 0 and 12, got 13"},
        {{"bake", "a.glb", "--level", "13"}, "--level must be auto or a whole number between 0 and 12, got 13"},
        {{"bake", "a.glb", "--budget", "2T"}, "--budget must be a number of bytes like 1500, 64K, 2M or 1G, got 2T"},
        {{"bake", "a.glb", "--value-tolerance", "-1"}, "--value-tolerance must be between 0 and 1, got -1"},
        {{"bake", "a.glb", "--value-tolerance", "5"}, "--value-tolerance must be between 0 and 1, got 5"},
        {{"run", "--validate", "core", "--", "true"},
         "unexpected argument true; a value of --validate follows it by =: --validate=core (see vellum run --help)"},
        {{"bake", "a.glb", "--states", "3"}, "--states must be one of 2|4, got 3"},
        {{"bake", "a.glb", "--two-state-rule", "opaqe"},
         "--two-state-rule must be one of nearest|opaque|transparent, got opaqe; did you mean opaque?"},
        {{"bake", "a.glb", "--budget"}, "--budget takes one value"},
        {{"bake", "a.glb", "--budget", ""}, "--budget must be a number of bytes like 1500, 64K, 2M or 1G, got "},
        {{"bake", "a.glb", "--cache-size", ""}, "--cache-size must be a number of bytes like 1500, 64K, 2M or 1G, got"},
        {{"bake", "a.glb", "--shard", ""}, "--shard must be K/N with K from 1 to N, and N at most 1000000, got "},
        {{"inspect", "a.glb", "--mesh", ""}, "--mesh must be a number, a range like 3-9, or several with commas, got "},
        {{"inspect", "a.glb", "--primitive", ""}, "--primitive must be a number, a range like 3-9"},
        {{"inspect", "a.glb", "--triangle", ""}, "--triangle must be a number, a range like 3-9"},
        {{"render", "--size", ""}, "--size must be a size like 1280x720, of 1 to 16384 pixels each way, got "},
        {{"inspect", "a.glb", "--level", "3"}, "--level requires --bake"},
        {{"inspect", "a.glb", "b.html", "-o", "c.html"}, "OUT and --output exclude each other"},
        {{"inspect", "-", "--bake"}, "reading from stdin needs an output: -o FILE"},
        {{"inspect", "a.glb", "-", "--json"}, "stdout takes only one of the page, the picture and --json"},
        {{"inspect", "a.glb", "--html", "-", "--picture", "-"}, "stdout takes only one of the page, the picture and"},
        {{"inspect", "a.glb", "--html", "out", "--picture", "./out"}, "--html and --picture name the same file"},
        {{"inspect", "a.glb", "out.d/../out", "--picture", "out"}, "--html and --picture name the same file"},
        {{"check", "--results", "out", "--junit", "./out"}, "--results and --junit name the same file"},
        {{"render", "--mode", "compare", "-o", "-"}, "--mode compare writes several pictures, so not to stdout"},
        {{"render", "--samples", "0"}, "--samples must be a whole number between 1 and 256, got 0"},
        {{"render", "--zoom", "nan"}, "--zoom must be between 0.05 and 20, got nan"},
        {{"bake", "a.glb", "notes.txt"},
         "notes.txt is the name of another kind of file: the output's must end in .glb"},
        {{"bake", "a.gltf", "-o", "a.jpg"}, "a.jpg is the name of another kind of file: the output's must end in .glb"},
        {{"inspect", "a.glb", "p.jpg"}, "p.jpg is the name of another kind of file: the output's must end in .html or"},
        {{"inspect", "a.glb", "--html", "p.png"}, "p.png is the name of another kind of file"},
        {{"inspect", "a.glb", "--picture", "p.html"}, "p.html is the name of another kind of file"},
        {{"render", "a.glb", "out.jpg"}, "out.jpg is the name of another kind of file: the output's must end in .png"},
        {{"spirv", "--disable", "a.spv", "-o", "a.txt"}, "a.txt is the name of another kind of file"},
        {{"bench", "-o", "a.json"}, "a.json is the name of another kind of file: the output's must end in .html"},
        {{"bench", "-o", "-"}, "--output is a web page or a folder for it, not stdout"},
        {{"check", "--results", "a.json"}, "a.json is the name of another kind of file: the output's must end in .csv"},
        {{"check", "--junit", "a.json"}, "a.json is the name of another kind of file: the output's must end in .xml"},
        {{"render", "--json"}, "--json is for --mode compare"},
        {{"verify", "a.glb", "--barycentric-tolerance", "2000"},
         "--barycentric-tolerance must be between 0 and 1024, got 2000"},
    };
    for (const auto &[arguments, message] : cases) {
        const Outcome outcome = runVellum(arguments);
        EXPECT_EQ(outcome.exitCode, 2) << outcome.errors;
        EXPECT_EQ(outcome.errorLines(), 1) << outcome.errors;
        EXPECT_TRUE(outcome.errors.starts_with("vellum: " + message)) << outcome.errors;
        EXPECT_EQ(outcome.output, "");
    }
}

TEST(CommandLine, AFileWithADashInFront)
{
    const TemporaryFolder folder;
    writeFile(folder / "-dash.glb", cardGlb());
    const std::filesystem::path before = std::filesystem::current_path();
    std::filesystem::current_path(folder.path());
    const Outcome outcome = runVellum({"bake", "-dash.glb"});
    std::filesystem::current_path(before);
    EXPECT_EQ(outcome.exitCode, 2);
    EXPECT_EQ(outcome.errors, "vellum: -dash.glb is not an option of vellum bake; the file of this name is ./-dash.glb "
                              "(see vellum bake --help)\n");
}

#ifdef __linux__ // where root may write everywhere, and cannot
TEST(CommandLine, OutputsThatCannotBeMadeAreFoundBeforeTheWork)
{
    for (const std::vector<std::string> &arguments :
         {std::vector<std::string>{"bench", "-o", "/proc/x.html"},
          {"inspect", "none.glb", "-o", "/proc/x.html"}, // not read before
          {"sweep", "none.glb", "-o", "/proc/x.html"},
          {"check", "--filter", "khr.levels.*", "--results", "/proc/x.csv"},
          {"check", "--filter", "khr.levels.*", "--junit", "/proc/x.xml"}}) {
        const Outcome outcome = runVellum(arguments);
        EXPECT_EQ(outcome.exitCode, 1) << arguments.front();
        EXPECT_EQ(outcome.output, "") << arguments.front();
        EXPECT_TRUE(has(outcome.errors, "vellum: /proc/x.") && has(outcome.errors, "cannot be written"))
            << outcome.errors;
        EXPECT_EQ(outcome.errorLines(), 1) << outcome.errors;
    }
}
#endif

#ifndef _WIN32
TEST(CommandLine, BinaryOutputsDoNotGoToATerminal)
{
    for (const std::vector<std::string> &arguments : {std::vector<std::string>{"bake", "a.glb", "-"},
                                                      {"inspect", "a.glb", "-"},
                                                      {"inspect", "a.glb", "--picture", "-"},
                                                      {"render", "a.glb", "-"},
                                                      {"spirv", "--disable", "a.spv", "-o", "-"}}) {
        const Outcome outcome = runVellumInTerminal(arguments);
        EXPECT_EQ(outcome.exitCode, 2) << outcome.errors;
        EXPECT_EQ(outcome.errors,
                  "vellum: stdout is a terminal: redirect it, or give an output file; --force writes to it\n");
        EXPECT_EQ(outcome.output, "");
    }
    const TemporaryFolder folder;
    writeFile(folder / "card.glb", cardGlb());
    const Outcome forced = runVellumInTerminal({"bake", (folder / "card.glb").string(), "-", "--force"});
    EXPECT_EQ(forced.exitCode, 0) << forced.errors;
    EXPECT_TRUE(forced.output.starts_with("glTF")) << forced.output.size();
}
#endif

#ifndef _WIN32
TEST(CommandLine, WhatTurnsTheLayerOnHoldsInEveryFolder)
{
    const TemporaryFolder folder;
    std::filesystem::create_directory(folder / "lib");
    const Outcome info =
        runVellumInScript("cd " + folder.path().string() + " && \"$@\"", {"info", "--layer-path", "lib"});
    const std::string path = (std::filesystem::canonical(folder.path()) / "lib").string();
    EXPECT_TRUE(has(info.output, "LAYER_PATH=" + path + "\n")) << info.output;
}

// Opening a pipe would wait for whoever opens its other end.
TEST(CommandLine, OutputsThatAreNotFilesAreNotOpened)
{
    const TemporaryFolder folder;
    writeFile(folder / "card.glb", cardGlb());
    const std::string card = (folder / "card.glb").string();
    for (const std::vector<std::string> &arguments : {std::vector<std::string>{"inspect", card, "-o", "x.html"},
                                                      {"inspect", card, "--picture", "x.svg"},
                                                      {"render", card, "-o", "x.png"},
                                                      {"sweep", card, "-o", "x.html"},
                                                      {"spirv", "--disable", card, "-o", "x.spv"}}) {
        std::vector<std::string> words = arguments;
        words.back() = (folder / words.back()).string();
        if (!std::filesystem::exists(words.back())) {
            ASSERT_EQ(mkfifo(words.back().c_str(), 0600), 0);
        }
        const Outcome outcome = runVellum(words);
        EXPECT_EQ(outcome.exitCode, 1) << outcome.errors;
        EXPECT_EQ(outcome.errors,
                  "vellum: " + words.back() + " cannot be written: it is there already and is not a file\n");
    }
}
#endif

TEST(CommandLine, DirectoriesAreNotReadAsFiles)
{
    const TemporaryFolder folder;
    std::filesystem::create_directory(folder / "layer.json"); // in place of a manifest
    const std::string name = folder.path().string();
    for (const std::vector<std::string> &arguments : {std::vector<std::string>{"spirv", "--lint", name},
                                                      {"spirv", "--disable", name, "-o", "a.spv"},
                                                      {"inspect", name, "-o", "a.html"},
                                                      {"render", name, "-o", "a.png"},
                                                      {"check", "--replay", name},
                                                      {"check", "--caselist", name},
                                                      {"check", "--skips", name},
                                                      {"check", "--flakes", name},
                                                      {"check", "--baseline", name}}) {
        const Outcome outcome = runVellum(arguments);
        EXPECT_EQ(outcome.exitCode, arguments[0] == "check" ? 2 : 1) << outcome.errors;
        EXPECT_EQ(outcome.errorLines(), 1) << outcome.errors;
        EXPECT_TRUE(has(outcome.errors, name) && !has(outcome.errors, "basic_")) << outcome.errors;
    }
    const Outcome info = runVellum({"info", "--layer-path", name});
    EXPECT_FALSE(has(info.errors, "basic_")) << info.errors;
}

TEST(CommandLine, InputsCanBeFolders)
{
    const TemporaryFolder folder;
    std::filesystem::create_directories(folder / "deep/deeper");
    std::filesystem::create_directory(folder / "empty");
    const std::string deep = (folder / "deep").string();
    writeFile(folder / "deep/b.glb", cardGlb());
    writeFile(folder / "deep/deeper/a.GLB", cardGlb());
    writeFile(folder / "deep/notes.txt", {'x'});
    for (const char *subcommand : {"info", "verify"}) {
        const Outcome outcome = runVellum({subcommand, deep, "--json"});
        EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
        const size_t first = outcome.output.find("b.glb\"");
        const size_t second = outcome.output.find("a.GLB\"");
        EXPECT_TRUE(first < second && second != std::string::npos) << outcome.output;
        EXPECT_FALSE(has(outcome.output, "notes.txt")) << outcome.output;
        const Outcome empty = runVellum({subcommand, (folder / "empty").string()});
        EXPECT_EQ(empty.exitCode, 1);
        EXPECT_TRUE(has(empty.errors, "empty has no .glb or .gltf files")) << empty.errors;
    }
}
