// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Rounds up a size of a micromap that the driver returned to a marked size (markedMicromapSize in
// layer/micromaps/micromap_input.h).
#include "shared.h"
#include "records.h"
#include "push.h"
#include "base/memory.glsl"
#include "base/micromap_layout.glsl"

layout(local_size_x = 1) in;

layout(push_constant, std430) uniform Push
{
    MarkedSizePush push;
};

void main()
{
    Words value = Words(push.value);
    const uvec2 size = marked(uvec2(value.w[0], value.w[1]));
    value.w[0] = size.x;
    value.w[1] = size.y;
}
