// SPDX-License-Identifier: Apache-2.0
// Shader stages, by SPIR-V's execution models.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "spirv/rewrite.h"

namespace vellum::cli
{

// "compute", "any-hit"
std::string stageName(uint32_t model);

// What a shader is rewritten as in a ray tracing pipeline that uses micromaps.
struct PipelineRole {
    const char *name;
    uint32_t model;
    spirv::Prologue prologue;
};
std::span<const PipelineRole> pipelineRoles();

} // namespace vellum::cli
