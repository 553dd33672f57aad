// SPDX-License-Identifier: Apache-2.0
#include "cli/spirv/modules.h"

#include <algorithm>
#include <cstring>
#include <fmt/format.h>
#include <iterator>

#include "base/error.h"
#include "base/text.h"
#include "cli/base/files.h"
#include "core/utf8_path.h"
#include "inspect/report_parts.h"
#include "spirv/module/micromap_mode.h"
#include "spirv/module/module.h"
#include "spirv/module/numbers.h"
#include "spirv/rewrite.h"

namespace vellum::cli
{
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

std::string structureError(std::span<const uint32_t> words)
{
    std::string error;
    return spirv::Module::parse(words, error) ? std::string() : error;
}

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

std::span<const PipelineRole> pipelineRoles()
{
    static constexpr PipelineRole kRoles[] = {
        {"raygen", spv::ExecutionModelRayGenerationKHR, spirv::Prologue::None},
        {"any-hit", spv::ExecutionModelAnyHitKHR, spirv::Prologue::TriangleHits},
        {"any-hit-box", spv::ExecutionModelAnyHitKHR, spirv::Prologue::BoxHits},
        {"intersection", spv::ExecutionModelIntersectionKHR, spirv::Prologue::BoxCulling},
        {"closest-hit", spv::ExecutionModelClosestHitKHR, spirv::Prologue::None},
        {"miss", spv::ExecutionModelMissKHR, spirv::Prologue::None},
        {"callable", spv::ExecutionModelCallableKHR, spirv::Prologue::None},
    };
    return kRoles;
}

namespace
{

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
            for (const PipelineRole &role : pipelineRoles())
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

} // namespace

std::vector<LintFinding> lint(std::span<const uint32_t> words, std::span<const spirv::EntryPoint> entryPoints)
{
    Lint lint(words);
    for (const spirv::EntryPoint &entry : entryPoints)
        lint.checkMode(entry);
    lint.checkDeclarations();
    lint.checkEmulation(entryPoints);
    return std::move(lint.findings);
}

namespace
{

using Kind = LintFinding::Kind;
using When = spirv::MicromapMode::When;

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

} // namespace

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

} // namespace vellum::cli
