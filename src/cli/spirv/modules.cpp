// SPDX-License-Identifier: Apache-2.0
#include "cli/spirv/modules.h"

#include <algorithm>
#include <cstring>
#include <iterator>

#include "base/error.h"
#include "cli/base/files.h"
#include "core/utf8_path.h"
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

    // What the mode needs of the module.
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

} // namespace vellum::cli
