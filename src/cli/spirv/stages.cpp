// SPDX-License-Identifier: Apache-2.0
#include "cli/spirv/stages.h"

#include <algorithm>
#include <iterator>

#include "spirv/module/numbers.h"

namespace vellum::cli
{

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

} // namespace vellum::cli
