// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Begins the check of a micromap build: the memory of its usage counts.
#include "shared.h"
#include "findings.h"
#include "push.h"
#include "base/memory.glsl"

layout(local_size_x = 64) in;

layout(push_constant, std430) uniform Push
{
    UsageBeginPush push;
};

void main()
{
    const uint i = gl_GlobalInvocationID.x;
    if (i < kUsageWords)
        Words(push.counts).w[i] = i < kUsageKinds ? push.declared[i] : 0u;
}
