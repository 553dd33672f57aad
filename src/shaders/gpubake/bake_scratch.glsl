// SPDX-License-Identifier: Apache-2.0
// Code that all shaders of the GPU baker share: the scratch memory, and the work of each invocation.
#extension GL_EXT_control_flow_attributes : require
#include "base/memory.glsl"
#include "gpu_bake.h"

layout(push_constant) uniform Push
{
    uvec2 scratch;
    uint first; // of each shader's own
    uint second;
} push;

#define SCRATCH(i) Words(push.scratch).w[i]

float scratchFloat(uint i)
{
    return uintBitsToFloat(SCRATCH(i));
}
uvec2 scratchAddress(uint i)
{
    return uvec2(SCRATCH(i), SCRATCH(i + 1u));
}
bool flagSet(uint flag)
{
    return (SCRATCH(kBakeFlags) & flag) != 0u;
}

// Workgroups are counted in two dimensions: there can be more than fit one.
uint workgroup()
{
    return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
}
// A macro: in a function up here, glslang would take the size of workgroups to be 1.
#define INVOCATION (workgroup() * gl_WorkGroupSize.x + gl_LocalInvocationID.x)

uint triangleAt(uint triangle)
{
    return kBakeHeaderWords + triangle * kBakeTriangleWords;
}
