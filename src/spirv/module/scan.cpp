// SPDX-License-Identifier: Apache-2.0
#include "spirv/module/scan.h"

#include <algorithm>
#include <optional>
#include <unordered_map>

#include "spirv/module/module.h"
#include "spirv/module/numbers.h"
#include "spirv/module/ray_instructions.h"

namespace vellum::spirv
{
namespace
{

constexpr uint32_t kStrideMask = 15; // the bits of an SBT stride that are used (OpTraceRayKHR)

bool isRayTracingStage(uint32_t model)
{
    return model >= spv::ExecutionModelRayGenerationKHR && model <= spv::ExecutionModelCallableKHR;
}

// Capabilities of ray queries. Those of ray tracing pipelines are many, but modules that need them have a ray tracing
// stage.
bool declaresRays(uint32_t capability)
{
    switch (capability) {
    case spv::CapabilityRayQueryKHR:
    case spv::CapabilityRayTracingKHR:
    case spv::CapabilityRayTraversalPrimitiveCullingKHR:
    case spv::CapabilityRayQueryPositionFetchKHR:
    case spv::CapabilityRayTracingOpacityMicromapKHR:
    case spv::CapabilityRayTracingOpacityMicromapExecutionModeKHR: return true;
    default: return false;
    }
}

// The rays that a module's stages trace.
class FlagScan
{
public:
    void visit(Words in)
    {
        const uint32_t opcode = opcodeOf(in);
        if (opcode == spv::OpConstant && in.size() == 4)
            constants_[in[2]] = in[3];
        else if (opcode == spv::OpConstantNull && in.size() == 3)
            constants_[in[2]] = 0;
        else if (opcode == spv::OpRayQueryInitializeKHR)
            queries_.add(flagsIn(in, 3));
        else if (const auto ray = rayInstruction(opcode); ray && !ray->onlyExecutes() && !ray->empties) {
            fromQuery_ = fromQuery_ || ray->query != 0;
            if (ray->query == 0)
                traced_.add(ray->flags != 0 ? flagsIn(in, ray->flags) : TracedFlags{.traces = true});
            if (ray->stride() != 0)
                traced_.mostStride =
                    std::max(traced_.mostStride, valueIn(in, ray->stride()).value_or(kStrideMask) & kStrideMask);
        }
    }

    // `whole`: all instructions were visited.
    TracedFlags result(bool whole)
    {
        // Hit objects that are made from a ray query have the query's flags.
        if (fromQuery_)
            traced_.add(queries_);
        if (!whole)
            traced_.add({.traces = traced_.traces, .fixed = 0, .mostStride = kStrideMask});
        return traced_;
    }

private:
    [[nodiscard]] std::optional<uint32_t> valueIn(Words in, uint32_t word) const
    {
        const auto value = word < in.size() ? constants_.find(in[word]) : constants_.end();
        return value == constants_.end() ? std::nullopt : std::optional(value->second);
    }
    [[nodiscard]] TracedFlags flagsIn(Words in, uint32_t word) const
    {
        const auto value = valueIn(in, word);
        if (!value)
            return {.traces = true, .fixed = 0};
        return {.traces = true, .constant = *value & shared::kHiddenRayFlags};
    }

    std::unordered_map<uint32_t, uint32_t> constants_;
    TracedFlags traced_, queries_;
    bool fromQuery_ = false;
};

} // namespace

void TracedFlags::add(const TracedFlags &other)
{
    mostStride = std::max(mostStride, other.mostStride);
    if (!other.traces)
        return;
    fixed = traces ? fixed & other.fixed & ~(constant ^ other.constant) : other.fixed;
    constant = other.constant & fixed;
    traces = true;
}

ModuleScan scan(std::span<const uint32_t> words)
{
    ModuleScan found;
    if (!isSpirv(words)) {
        found.traced.mostStride = kStrideMask;
        return found;
    }
    FlagScan flags;
    const size_t end = visitInstructions(words, [&](Words in) {
        const uint32_t opcode = opcodeOf(in);
        const uint32_t operand = in.size() > 1 ? in[1] : 0;
        found.hasStages = found.hasStages || (opcode == spv::OpEntryPoint && isRayTracingStage(operand));
        found.tracesRays =
            found.tracesRays || found.hasStages || (opcode == spv::OpCapability && declaresRays(operand));
        if (opcode == spv::OpFunction && !found.hasStages)
            return false;
        if (found.hasStages)
            flags.visit(in);
        return true;
    });
    if (found.hasStages)
        found.traced = flags.result(end == words.size());
    return found;
}

bool forcesTwoStatesWithoutCapability(std::span<const uint32_t> words)
{
    if (!isSpirv(words))
        return false;
    std::unordered_map<uint32_t, uint32_t> constants;
    bool capability = false, forces = false;
    visitInstructions(words, [&](Words in) {
        const uint32_t opcode = opcodeOf(in);
        if (opcode == spv::OpCapability && in.size() == 2)
            capability = capability || in[1] == spv::CapabilityRayTracingOpacityMicromapKHR;
        else if (opcode == spv::OpConstant && in.size() == 4)
            constants[in[2]] = in[3];
        const auto ray = rayInstruction(opcode);
        const uint32_t flags = opcode == spv::OpRayQueryInitializeKHR ? 3 : ray ? ray->flags : 0;
        if (flags != 0 && flags < in.size()) {
            const auto value = constants.find(in[flags]);
            forces = forces || (value != constants.end() && (value->second & shared::kRayForce2State) != 0);
        }
        return !capability;
    });
    return forces && !capability;
}

} // namespace vellum::spirv
