// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Corrects a size that the driver returned. The size of a micromap is rounded up to a marked size (markedMicromapSize in
// layer/micromaps/micromap_input.h); the size of serialized data grows by the layer's trailer.
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
    const uvec2 found = uvec2(value.w[0], value.w[1]);
    const uvec2 size = push.trailer != 0u ? addressPlus(found, push.trailer) : marked(found);
    value.w[0] = size.x;
    value.w[1] = size.y;
}
