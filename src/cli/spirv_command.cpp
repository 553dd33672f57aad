// SPDX-License-Identifier: Apache-2.0
// `vellum spirv`
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fmt/format.h>
#include <iterator>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/text.h"
#include "cli/base/exit_code.h"
#include "cli/base/files.h"
#include "cli/options/commands.h"
#include "cli/options/options.h"
#include "core/utf8_path.h"
#include "inspect/report_parts.h"
#include "spirv/module/micromap_mode.h"
#include "spirv/module/module.h"
#include "spirv/module/numbers.h"
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

std::span<const uint8_t> bytesOf(std::span<const uint32_t> words)
{
    return {reinterpret_cast<const uint8_t *>(words.data()), words.size_bytes()};
}

// The way in which a shader is rewritten in a ray tracing pipeline that uses micromaps.
struct PipelineRole {
    const char *name;
    uint32_t model;
    spirv::Prologue prologue;
};
constexpr PipelineRole kPipelineRoles[] = {
    {"raygen", spv::ExecutionModelRayGenerationKHR, spirv::Prologue::None},
    {"any-hit", spv::ExecutionModelAnyHitKHR, spirv::Prologue::TriangleHits},
    {"any-hit-box", spv::ExecutionModelAnyHitKHR, spirv::Prologue::BoxHits},
    {"intersection", spv::ExecutionModelIntersectionKHR, spirv::Prologue::BoxCulling},
    {"closest-hit", spv::ExecutionModelClosestHitKHR, spirv::Prologue::None},
    {"miss", spv::ExecutionModelMissKHR, spirv::Prologue::None},
    {"callable", spv::ExecutionModelCallableKHR, spirv::Prologue::None},
};

struct LintFinding {
    enum class Kind {
        QueriesWithoutMode, // ray queries that use no micromaps with VK_KHR_opacity_micromap alone
        ModeWithoutQueries, // a mode that nothing reads
        InvalidMode,        // a mode whose operand, capability or extension is missing or wrong
        Emulation,          // code that the layer rejects
        RayFlags            // ray flags that are incomplete where micromaps are emulated
    };
    Kind kind;
    std::string entryPoint; // empty: the module
    std::string message;
    bool operator==(const LintFinding &) const = default;
};

struct SpirvOutput {
    std::string path;
    size_t bytes = 0;
    bool changed = false;
};

// A module, as it is after the change.
struct SpirvFile {
    std::string path;
    std::string error; // why it was not read or changed; nothing else is known then
    size_t bytes = 0;
    uint32_t version = 0; // from the header of the module
    std::vector<spirv::EntryPoint> entryPoints;
    std::optional<std::vector<LintFinding>> findings; // of --lint
    std::optional<SpirvOutput> output;
};

// The error in the structure of a module; empty if it is valid.
std::string structureError(std::span<const uint32_t> words)
{
    std::string error;
    return spirv::Module::parse(words, error) ? std::string() : error;
}

// Reads a module, from stdin for "-", and checks its structure. Throws Error.
std::vector<uint32_t> readModule(const std::filesystem::path &path)
{
    std::vector<uint8_t> bytes;
    if (isStandardStream(path)) {
        bytes = readStdin();
    } else {
        const std::string file = readFile(path);
        bytes.assign(file.begin(), file.end());
    }
    std::vector<uint32_t> words(bytes.size() / 4);
    std::memcpy(words.data(), bytes.data(), words.size() * 4);
    if (bytes.size() % 4 != 0)
        throw Error(utf8Text(path) + ": not SPIR-V: its size is no multiple of 4 bytes");
    if (const std::string error = structureError(words); !error.empty())
        throw Error(utf8Text(path) + ": malformed SPIR-V: " + error);
    return words;
}

// "compute", "any-hit"
std::string stageName(uint32_t model)
{
    static constexpr struct {
        uint32_t model;
        const char *name;
    } kNames[] = {
        {spv::ExecutionModelVertex, "vertex"},
        {spv::ExecutionModelTessellationControl, "tessellation control"},
        {spv::ExecutionModelTessellationEvaluation, "tessellation evaluation"},
        {spv::ExecutionModelGeometry, "geometry"},
        {spv::ExecutionModelFragment, "fragment"},
        {spv::ExecutionModelGLCompute, "compute"},
        {spv::ExecutionModelKernel, "kernel"},
        {spv::ExecutionModelTaskNV, "task"},
        {spv::ExecutionModelMeshNV, "mesh"},
        {spv::ExecutionModelTaskEXT, "task"},
        {spv::ExecutionModelMeshEXT, "mesh"},
        {spv::ExecutionModelRayGenerationKHR, "raygen"},
        {spv::ExecutionModelIntersectionKHR, "intersection"},
        {spv::ExecutionModelAnyHitKHR, "any-hit"},
        {spv::ExecutionModelClosestHitKHR, "closest-hit"},
        {spv::ExecutionModelMissKHR, "miss"},
        {spv::ExecutionModelCallableKHR, "callable"},
    };
    const auto *found = std::ranges::find_if(kNames, [=](const auto &entry) { return entry.model == model; });
    return found == std::end(kNames) ? "execution model " + std::to_string(model) : found->name;
}

using Kind = LintFinding::Kind;
using When = spirv::MicromapMode::When;

class Lint
{
public:
    explicit Lint(std::span<const uint32_t> words) : words_(words) {}

    void add(Kind kind, const std::string &entryPoint, const std::string &message)
    {
        const LintFinding finding{kind, entryPoint, message};
        if (std::ranges::find(findings, finding) == findings.end())
            findings.push_back(finding);
    }

    void checkMode(const spirv::EntryPoint &entry)
    {
        const bool declares = entry.mode.when != When::Absent;
        if (entry.mode.when == When::Invalid)
            add(Kind::InvalidMode, entry.name,
                "OpacityMicromapIdKHR has two different operands, or one that is no constant of type bool");
        else if (declares && !entry.queries)
            add(Kind::ModeWithoutQueries, entry.name, "OpacityMicromapIdKHR has no effect: there are no ray queries");
        if (!declares && entry.queries)
            add(Kind::QueriesWithoutMode, entry.name,
                "ray queries without OpacityMicromapIdKHR must not meet micromaps, unless VK_EXT_opacity_micromap is "
                "enabled; --enable-micromaps adds it");
    }

    // Checks the declarations that the mode needs in the module.
    void checkDeclarations()
    {
        std::string error;
        const auto module = spirv::Module::parse(words_, error);
        if (!module || spirv::declaredModes(*module).empty())
            return;
        if (!module->hasCapability(spv::CapabilityRayTracingOpacityMicromapExecutionModeKHR))
            add(Kind::InvalidMode, {}, "the capability RayTracingOpacityMicromapExecutionModeKHR is missing");
        if (!module->hasExtension(spirv::kKhrExtension))
            add(Kind::InvalidMode, {}, std::string("the extension ") + spirv::kKhrExtension + " is missing");
    }

    // Rewrites as the layer does, for modules and for stages of pipelines that use micromaps.
    void checkEmulation(std::span<const spirv::EntryPoint> entryPoints)
    {
        rewrite({}, {});
        for (const spirv::EntryPoint &entry : entryPoints)
            for (const PipelineRole &role : kPipelineRoles)
                for (const uint32_t fixed : {spirv::HiddenFlags{}.fixed, 0u})
                    if (role.model == entry.model)
                        rewrite(entry.name, spirv::PipelineStage{entry.name, role.model, role.prologue, {fixed}});
    }

    std::vector<LintFinding> findings;

private:
    void rewrite(const std::string &entryPoint, const std::optional<spirv::PipelineStage> &stage)
    {
        spirv::RewriteOptions options;
        options.queriesConsume = spirv::QueriesConsume::WhereDeclared;
        options.pipelineStage = stage;
        const spirv::RewriteResult result = spirv::rewrite(words_, options);
        if (result.status == spirv::RewriteResult::Status::Failed)
            add(Kind::Emulation, entryPoint, "the layer cannot emulate micromaps for it: " + result.error);
        if (result.lacksHiddenFlags)
            add(Kind::RayFlags, entryPoint,
                "where micromaps are emulated and rays differ in their flags, it does not see Opaque, CullNoOpaque and "
                "ForceOpacityMicromap2State");
    }

    std::span<const uint32_t> words_;
};

std::vector<LintFinding> lint(std::span<const uint32_t> words, std::span<const spirv::EntryPoint> entryPoints)
{
    Lint lint(words);
    for (const spirv::EntryPoint &entry : entryPoints)
        lint.checkMode(entry);
    lint.checkDeclarations();
    lint.checkEmulation(entryPoints);
    return std::move(lint.findings);
}

std::string versionOf(const SpirvFile &file)
{
    return fmt::format("{}.{}", file.version >> 16, file.version >> 8 & 0xff);
}

std::string describe(const spirv::MicromapMode &mode)
{
    switch (mode.when) {
    case When::Absent: return "no execution mode";
    case When::Never: return "execution mode false";
    case When::Always: return "execution mode true";
    case When::Specialized:
        return fmt::format("execution mode by specialization constant {} (default {})", mode.constantId, mode.initial);
    case When::Computed: return "execution mode by an expression of specialization constants";
    case When::Invalid: break;
    }
    return "invalid execution mode";
}

std::string describe(const spirv::EntryPoint &entry)
{
    const char *rays = entry.queries && entry.traces ? "ray queries, traced rays"
                       : entry.queries               ? "ray queries"
                       : entry.traces                ? "traced rays: the pipeline needs the micromap bit"
                                                     : "no rays";
    std::string text = fmt::format("{} ({}): {}", entry.name, stageName(entry.model), rays);
    if (entry.queries || entry.mode.when != When::Absent)
        text += "; " + describe(entry.mode);
    return text;
}

const char *nameOf(When when)
{
    switch (when) {
    case When::Absent: return "absent";
    case When::Never: return "false";
    case When::Always: return "true";
    case When::Specialized: return "constant";
    case When::Computed: return "computed";
    case When::Invalid: break;
    }
    return "invalid";
}

const char *nameOf(Kind kind)
{
    switch (kind) {
    case Kind::QueriesWithoutMode: return "queriesWithoutMode";
    case Kind::ModeWithoutQueries: return "modeWithoutQueries";
    case Kind::InvalidMode: return "invalidMode";
    case Kind::Emulation: return "emulation";
    case Kind::RayFlags: break;
    }
    return "rayFlags";
}

void write(const spirv::EntryPoint &entry, JsonWriter &json)
{
    json.beginObject().member("name", entry.name).member("stage", stageName(entry.model));
    json.member("rayQueries", entry.queries).member("tracesRays", entry.traces);
    json.key("micromaps").beginObject().member("mode", nameOf(entry.mode.when));
    if (entry.mode.when == When::Specialized)
        json.member("constantId", entry.mode.constantId).member("default", entry.mode.initial);
    json.end().end();
}

void write(const LintFinding &finding, JsonWriter &json)
{
    json.beginObject().member("kind", nameOf(finding.kind)).key("entryPoint");
    finding.entryPoint.empty() ? json.null() : json.value(finding.entryPoint);
    json.member("message", finding.message).end();
}

void write(const SpirvFile &file, JsonWriter &json)
{
    json.beginObject().member("file", file.path);
    if (!file.error.empty()) {
        json.member("error", file.error).end();
        return;
    }
    json.member("bytes", file.bytes).member("version", versionOf(file));
    if (file.output)
        json.member("output", file.output->path)
            .member("outputBytes", file.output->bytes)
            .member("changed", file.output->changed);
    json.list("entryPoints", file.entryPoints, [&](const auto &entry) { write(entry, json); });
    if (file.findings)
        json.list("findings", *file.findings, [&](const auto &finding) { write(finding, json); });
    json.end();
}

void printSpirv(const SpirvFile &file)
{
    if (!file.error.empty())
        return;
    fmt::print("{}: SPIR-V {}, {}\n", file.path, versionOf(file), counted(file.entryPoints.size(), "entry point"));
    for (const spirv::EntryPoint &entry : file.entryPoints)
        fmt::print("  {}\n", describe(entry));
    if (file.findings)
        for (const LintFinding &finding : *file.findings)
            fmt::print("  finding: {}{}\n", finding.entryPoint.empty() ? "" : finding.entryPoint + ": ",
                       finding.message);
    if (file.findings && file.findings->empty())
        fmt::print("  no findings\n");
    if (file.output)
        fmt::print("  {}: {}{}\n", file.output->path, counted(file.output->bytes, "byte"),
                   file.output->changed ? "" : ", unchanged");
}

std::string spirvJson(const char *action, std::span<const SpirvFile> files)
{
    JsonWriter json;
    beginReport(json, "spirv");
    json.member("action", action);
    json.list("files", files, [&](const SpirvFile &file) { write(file, json); });
    return json.end().text();
}

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
    std::optional<std::string> api;
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
    for (const PipelineRole &role : kPipelineRoles)
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
    if (!options.rewrite && (options.stage || options.api))
        throw UsageError(std::string(options.stage ? "--stage" : "--api") + " is for --rewrite");
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
    for (const PipelineRole &role : kPipelineRoles)
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
