#version 460
#extension GL_GOOGLE_include_directive : require
// Micromap build that shares identical data: empties the table and the list of parts.
layout(local_size_x = 64) in;

#include "micromap_source.glsl"

void main()
{
    const uint i = globalInvocation();
    if (i <= push.tableMask)
        Words(tableAddress()).w[i] = 0u;
    if (i == 0u)
        Words(push.scratch).w[kScratchPartCount] = 0u;
}
