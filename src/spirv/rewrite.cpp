// SPDX-License-Identifier: Apache-2.0
#include "spirv/rewrite.h"

#include "core/hash.h"
#include "spirv/built_ins.h"
#include "spirv/consumption.h"
#include "spirv/entry_wrapper.h"
#include "spirv/module/micromap_mode.h"
#include "spirv/module/numbers.h"
#include "spirv/module/scan.h"
#include "spirv/module/uses.h"
#include "spirv/payload_prefix.h"
#include "spirv/ray_query.h"
#include "spirv/trace_ray.h"

#include <algorithm>

#include "shaders/lookup.h"

namespace vellum::spirv
{
namespace
{

// Removes declarations of opacity micromaps, which the driver does not know. Returns whether there were any.
bool removeDeclarations(Module &module)
{
    size_t removed = 0;
    removed += std::erase_if(module.section(Section::Capabilities), [&](Instruction in) {
        const uint32_t capability = module.word(in, 1);
        return in.opcode == spv::OpCapability &&
               (capability == spv::CapabilityRayTracingOpacityMicromapKHR ||
                capability == spv::CapabilityRayTracingOpacityMicromapExecutionModeKHR);
    });
    removed += std::erase_if(module.section(Section::Extensions), [&](Instruction in) {
        const std::string name = module.string(in, 1);
        return in.opcode == spv::OpExtension && (name == kExtExtension || name == kKhrExtension);
    });
    removed += std::erase_if(module.section(Section::ExecutionModes),
                             [&](Instruction in) { return isMicromapMode(module.words(in)); });
    return removed != 0;
}

// Restores values that the driver returns, and hides ray flags of pipelines from it. Returns whether anything changed.
bool replaceInstructions(Module &module, BuiltIns &builtIns, TraceRays &traces)
{
    bool changed = false;
    Code code(module);
    const std::vector<Instruction> functions = module.section(Section::Functions);
    for (const Instruction in : functions) {
        if (builtIns.replace(in, code) || traces.replace(in, code))
            changed = true;
        else
            code.out.push_back(in);
    }
    module.section(Section::Functions) = std::move(code.out);
    return changed;
}

// The functions of a stage; without one, those of all entry points.
std::set<Id> stageFunctions(const Module &module, const std::optional<PipelineStage> &stage)
{
    std::vector<Id> functions;
    for (const Instruction in : module.section(Section::EntryPoints))
        if (!stage || isEntryPoint(module, in, *stage))
            functions.push_back(module.word(in, 2));
    return CallGraph(module).reachedFrom(std::move(functions));
}

// Returns whether hit objects need side variables for hidden flags. In pipelines without micromaps these are the flags
// of ray queries, and the flag that the driver does not know.
bool keepsHitObjectFlags(const Module &module, const std::optional<PipelineStage> &stage, bool force2State)
{
    const auto isHitObject = [](Instruction in) {
        return in.opcode == spv::OpTypeHitObjectNV || in.opcode == spv::OpTypeHitObjectEXT;
    };
    const auto isFromQuery = [](Instruction in) { return in.opcode == spv::OpHitObjectRecordFromQueryEXT; };
    if (!std::ranges::any_of(module.section(Section::Globals), isHitObject))
        return false;
    if (stage)
        return stage->hidden.inPayload();
    return force2State || std::ranges::any_of(module.section(Section::Functions), isFromQuery);
}

RewriteResult failed(std::string error)
{
    RewriteResult result;
    result.status = RewriteResult::Status::Failed;
    result.error = std::move(error);
    return result;
}

} // namespace

uint64_t linkedCodeHash()
{
    return Hash::of(lookup);
}

RewriteResult rewrite(std::span<const uint32_t> words, const RewriteOptions &options)
{
    if (!options.pipelineStage && !scan(words).tracesRays)
        return {};
    std::string error;
    std::optional<Module> module = Module::parse(words, error);
    if (!module)
        return failed(error);

    Types types(*module);
    Consumption consumption(*module, types);
    if (!consumption.read(options))
        return failed(consumption.error());
    const bool force2State = module->hasCapability(spv::CapabilityRayTracingOpacityMicromapKHR);
    bool changed = removeDeclarations(*module);
    Linker linker(*module, types, lookup,
                  {{0, static_cast<uint32_t>(options.rootAddress)},
                   {1, static_cast<uint32_t>(options.rootAddress >> 32)},
                   {2, static_cast<uint32_t>(options.firstSlots)},
                   {3, static_cast<uint32_t>(options.firstSlots >> 32)}});
    const std::set<Id> reached = stageFunctions(*module, options.pipelineStage);
    const bool inPipeline = options.pipelineStage.has_value();
    SideVariables hitObjects(*module, types, Beside::HitObjects);
    if (keepsHitObjectFlags(*module, options.pipelineStage, force2State)) {
        if (!hitObjects.declare())
            return failed(hitObjects.error());
        changed = true;
    }
    RayQueries queries(*module, types, linker, consumption, hitObjects,
                       {.reached = reached, .constantFlags = options.constantQueryFlags, .force2State = force2State});
    changed = queries.rewrite() || changed;
    if (!queries.error().empty())
        return failed(queries.error());

    if (!consumption.finish())
        return failed(consumption.error());

    PayloadPrefix prefix(*module, types, reached);
    if (inPipeline && options.pipelineStage->hidden.inPayload() && !prefix.widen())
        return failed(prefix.error());
    BuiltIns builtIns(*module, types, linker, prefix, hitObjects, options.pipelineStage);
    TraceRays traces(*module, types, prefix, hitObjects, options, reached, force2State);
    changed = replaceInstructions(*module, builtIns, traces) || changed;
    if (!traces.error().empty())
        return failed(traces.error());
    if (inPipeline) {
        EntryWrapper wrapper(*module, types, linker, prefix, builtIns.knownIndex());
        if (!wrapper.wrap(*options.pipelineStage))
            return failed(wrapper.error());
        changed = true;
    }
    if (!linker.finish())
        return failed(linker.error());
    RewriteResult result;
    result.lacksHiddenFlags = builtIns.lacksHiddenFlags();
    result.queriesForget = options.queriesConsume == QueriesConsume::WhereDeclared && !consumption.anyDeclared() &&
                           module->hasCapability(spv::CapabilityRayQueryKHR);
    if (changed) {
        result.status = RewriteResult::Status::Rewritten;
        result.words = module->serialize();
    }
    return result;
}

} // namespace vellum::spirv
