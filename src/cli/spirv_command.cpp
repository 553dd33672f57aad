// SPDX-License-Identifier: Apache-2.0
// `vellum spirv`
#include <algorithm>
#include <cstdio>
#include <fmt/format.h>
#include <memory>
#include <optional>

#include "base/error.h"
#include "base/text.h"
#include "cli/base/exit_code.h"
#include "cli/base/files.h"
#include "cli/options/cli11.h"
#include "cli/options/commands.h"
#include "cli/options/options.h"
#include "cli/spirv/modules.h"
#include "core/utf8_path.h"
#include "spirv/rewrite.h"

namespace vellum::cli
{
namespace
{

constexpr const char *kSpirvDetails = R"(
With VK_KHR_opacity_micromap alone, ray queries use micromaps only in entry points with the execution mode
OpacityMicromapIdKHR, which some compilers cannot express. This adds it to compiled modules, removes it, or lists what a
module declares. A module that needs no change is written as it is. - is stdin or stdout. With -o, an existing SPIR-V module is
replaced, as compilers do. The input itself, any other file, and OUT without -o, only with --force.

--lint exits with 1 for ray queries without the mode, a mode that has no effect or is invalid, and code that the layer
cannot emulate micromaps for.

The output of --rewrite needs the layer: it reads tables of the layer at addresses that are placeholders here. It is for
bug reports and for work on the layer.

Examples:
  vellum spirv --enable-micromaps shader.spv shader.omm.spv
      in all entry points with ray queries
  vellum spirv --enable-micromaps=7 --default true shader.spv -o shader.omm.spv
      unless specialization constant 7 is false
  slangc shadow.slang -target spirv -o - | vellum spirv --enable-micromaps - -o shadow.spv
      as a build step
  vellum spirv --lint *.spv
      what has no effect or cannot work
)";

constexpr const char *kAlways = "always";

struct SpirvOptions {
    std::vector<std::filesystem::path> inputs;
    std::optional<std::filesystem::path> output;
    bool operandOutput = false; // `output` was given without -o
    std::string enable;         // the option's word: "always" or a constant id
    bool disable = false;
    bool rewrite = false;
    bool lint = false;
    std::vector<std::string> entryPoints;
    std::optional<std::string> initial; // --default
    std::optional<std::string> stage;
    std::string api = "ext";
    bool force = false;
    bool json = false;
    bool quiet = false;
};

void declareSpirv(CLI::App &command, SpirvOptions &options)
{
    command.footer(kSpirvDetails);
    command.option_defaults()->group(kInput);
    command.add_option("IN", options.inputs, "A SPIR-V module, and OUT, a new file; with --lint several modules")
        ->type_name("IN... [OUT]")
        ->required();
    command.option_defaults()->group("Action");
    command.add_flag("--enable-micromaps{always}", options.enable,
                     "Add the execution mode: always, or by the specialization constant of this number "
                     "(=always|CONSTANT_ID)");
    command.add_flag("--disable", options.disable, "Remove the execution mode");
    command.add_flag("--rewrite", options.rewrite, "Rewrite as the layer does to emulate micromaps");
    command.add_flag("--lint", options.lint, "List entry points, and what has no effect or cannot work");
    command.option_defaults()->group(kSelection);
    command
        .add_option("--entry", options.entryPoints,
                    "Only this entry point; repeatable [all; --enable-micromaps: all that have ray queries]")
        ->allow_extra_args(false)
        ->type_name("NAME");
    CLI::Option &initial = *command.add_option("--default", options.initial,
                                               "Value of the specialization constant where nothing sets it [false]");
    takesWords(initial, {"true", "false"});
    std::vector<std::string> stages;
    for (const PipelineRole &role : pipelineRoles())
        stages.emplace_back(role.name);
    CLI::Option &stage = *command.add_option("--stage", options.stage,
                                             "With --rewrite: as this stage of a ray tracing pipeline that uses "
                                             "micromaps; --entry is the entry point [main]");
    takesWords(stage, stages);
    CLI::Option &api =
        *command.add_option("--api", options.api,
                            "With --rewrite: all ray queries use micromaps (ext), or those with the mode (khr) [ext]");
    takesWords(api, {"ext", "khr"});
    command.option_defaults()->group(kOutput);
    command.add_option("-o,--output", options.output, "The module to write")->type_name("OUT");
    command.add_flag("--force", options.force,
                     "Replace the input, OUT without -o, or a file that is not a SPIR-V module");
    command.add_flag("--json", options.json, "Print JSON instead of text");
    command.add_flag("-q,--quiet", options.quiet, "Print errors only")->group(kGeneral);
}

void checkSpirv(SpirvOptions &options)
{
    if (!options.lint && !options.output && options.inputs.size() == 2) {
        options.output = options.inputs.back();
        options.inputs.pop_back();
        options.operandOutput = true;
    }
    const bool enables = !options.enable.empty();
    if (int{enables} + int{options.disable} + int{options.rewrite} + int{options.lint} != 1)
        throw UsageError("one of --enable-micromaps, --disable, --rewrite and --lint is needed");
    if (options.lint && (options.output || !options.entryPoints.empty()))
        throw UsageError("--lint excludes --output and --entry");
    if (!options.lint && (options.inputs.size() != 1 || !options.output))
        throw UsageError("one module and an output are needed: IN OUT, or IN -o OUT");
    if (options.output)
        checkSuffix(*options.output, {".spv", ".spirv", suffixOf(options.inputs.front())});
    if (options.initial && (!enables || options.enable == kAlways))
        throw UsageError("--default is for --enable-micromaps=CONSTANT_ID");
    if (!options.rewrite && options.stage)
        throw UsageError("--stage is for --rewrite");
    if (options.rewrite && options.entryPoints.size() > (options.stage ? 1u : 0u))
        throw UsageError("--rewrite takes --entry once, and only with --stage");
}

spirv::ModeEdit editOf(const SpirvOptions &options)
{
    spirv::ModeEdit edit;
    edit.entryPoints = options.entryPoints;
    if (options.disable) {
        edit.to = spirv::ModeEdit::To::Absent;
    } else if (options.enable != kAlways) {
        edit.to = spirv::ModeEdit::To::Specialized;
        edit.initial = options.initial == "true";
        const auto id = parseNumber<uint32_t>(options.enable);
        if (!id)
            throw UsageError("--enable-micromaps must be always or a constant id, got " + options.enable);
        edit.constantId = *id;
    }
    return edit;
}

// The new words; empty if nothing changes. Throws Error.
std::vector<uint32_t> edited(std::span<const uint32_t> words, const SpirvOptions &options)
{
    if (!options.rewrite) {
        spirv::ModeResult result = spirv::editMicromapMode(words, editOf(options));
        if (!result.error.empty())
            throw Error(result.error);
        return std::move(result.words);
    }
    // Addresses of no memory.
    spirv::RewriteOptions rewrite{.rootAddress = 0x1000, .firstSlots = 0x2000};
    if (options.api == "khr")
        rewrite.queriesConsume = spirv::QueriesConsume::WhereDeclared;
    const std::string entryPoint = options.entryPoints.empty() ? "main" : options.entryPoints.front();
    for (const PipelineRole &role : pipelineRoles())
        if (options.stage == role.name)
            rewrite.pipelineStage = {entryPoint, role.model, role.prologue, {}};
    spirv::RewriteResult result = spirv::rewrite(words, rewrite);
    if (result.status == spirv::RewriteResult::Status::Failed)
        throw Error("it cannot be rewritten: " + result.error);
    return std::move(result.words);
}

void describeModule(std::span<const uint32_t> words, SpirvFile &file)
{
    std::string error;
    const auto entryPoints = spirv::readEntryPoints(words, error);
    if (!entryPoints)
        throw Error(error);
    file.entryPoints = *entryPoints;
    file.version = words[1];
}

SpirvFile lintFile(const std::filesystem::path &path)
{
    SpirvFile file{.path = utf8Text(path)};
    try {
        const std::vector<uint32_t> words = readModule(path);
        file.bytes = words.size() * 4;
        describeModule(words, file);
        file.findings = lint(words, file.entryPoints);
    } catch (const Error &error) {
        file.error = error.what();
    }
    return file;
}

int lintCommand(const SpirvOptions &options)
{
    std::vector<SpirvFile> files;
    auto code = ExitCode::Success;
    for (const std::filesystem::path &path : options.inputs) {
        const SpirvFile &file = files.emplace_back(lintFile(path));
        if (!file.error.empty())
            std::fprintf(stderr, "vellum: %s\n", file.error.c_str());
        if (!file.error.empty() || !file.findings->empty())
            code = ExitCode::Failed;
        if (!options.json)
            printSpirv(file);
    }
    if (options.json)
        fmt::print("{}\n", spirvJson("lint", files));
    return static_cast<int>(code);
}

// Reads, changes, checks and writes one module.
SpirvFile changeFile(const SpirvOptions &options, std::optional<DataOutput> &stream)
{
    const std::filesystem::path &input = options.inputs.front();
    const std::vector<uint32_t> words = readModule(input);
    SpirvFile file{.path = utf8Text(input), .bytes = words.size() * 4};
    std::vector<uint32_t> changed;
    try {
        changed = edited(words, options);
        const std::span<const uint32_t> result = changed.empty() ? words : changed;
        if (const std::string error = structureError(result); !error.empty())
            throw Error("the result is malformed: " + error);
        describeModule(result, file);
    } catch (const UsageError &) {
        throw;
    } catch (const Error &error) {
        throw Error(utf8Text(input) + ": " + error.what());
    }
    const std::span<const uint32_t> result = changed.empty() ? words : changed;
    file.output = {utf8Text(*options.output), result.size_bytes(), !changed.empty()};
    if (stream)
        stream->write(bytesOf(result));
    else
        writeWhole(*options.output, bytesOf(result));
    return file;
}

const char *actionOf(const SpirvOptions &options)
{
    return options.rewrite ? "rewrite" : options.disable ? "disable" : "enable";
}

// Returns whether the output may be replaced without --force: a module, which cannot record who wrote it, but not the
// input. Throws Error for an operand that would be: *.spv in a folder of two modules is IN OUT.
bool replacesModule(const SpirvOptions &options)
{
    std::error_code error;
    if (isStandardStream(*options.output) || !std::filesystem::is_regular_file(*options.output, error) ||
        std::filesystem::equivalent(options.inputs.front(), *options.output, error))
        return false;
    try {
        if (readModule(*options.output).empty())
            return false;
    } catch (const Error &) {
        return false;
    }
    if (options.operandOutput)
        throw Error(utf8Text(*options.output) + " exists, and the second of two operands replaces nothing: -o " +
                    utf8Text(*options.output) + " or --force does");
    return true;
}

int changeCommand(const SpirvOptions &options)
{
    checkWritable(*options.output, options.force || replacesModule(options));
    std::optional<DataOutput> stream;
    if (isStandardStream(*options.output))
        stream.emplace(options.quiet && !options.json ? DataOutput::Reports::Discarded : DataOutput::Reports::ToStderr);
    const SpirvFile file = changeFile(options, stream);
    if (stream)
        stream->finish();
    if (options.json)
        fmt::print("{}\n", spirvJson(actionOf(options), {&file, 1}));
    else
        printSpirv(file);
    if (options.rewrite && !options.json)
        fmt::print("  the output needs the layer: the addresses of its tables are placeholders\n");
    return static_cast<int>(ExitCode::Success);
}

int spirvCommand(SpirvOptions &options)
{
    checkSpirv(options);
    const bool toStdout = options.output && isStandardStream(*options.output);
    if (options.quiet && !options.json && !toStdout)
        discardReports();
    return options.lint ? lintCommand(options) : changeCommand(options);
}

} // namespace

std::function<int()> declareSpirvCommand(CLI::App &app)
{
    const auto options = std::make_shared<SpirvOptions>();
    declareSpirv(
        *app.add_subcommand("spirv", "Adds the execution mode of micromaps to SPIR-V modules, and checks them"),
        *options);
    return [options] { return spirvCommand(*options); };
}

} // namespace vellum::cli
