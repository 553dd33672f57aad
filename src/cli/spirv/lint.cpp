// SPDX-License-Identifier: Apache-2.0
#include "cli/spirv/lint.h"

#include <algorithm>

#include "cli/spirv/stages.h"
#include "spirv/module/micromap_mode.h"
#include "spirv/rewrite.h"

namespace vellum::cli
{
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
