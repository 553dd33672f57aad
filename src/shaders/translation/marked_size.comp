#version 460
#extension GL_GOOGLE_include_directive : require
// Rounds the size of a micromap up to the next one that the layer tells applications (markedMicromapSize in
// layer/micromaps/micromap_input.h).
#include "shared.h"
#include "records.h"
#include "push.h"
#include "ground/memory.glsl"
#include "ground/micromap_layout.glsl"

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
