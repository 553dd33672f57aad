// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Micromap build that shares identical data, last pass: triangles that share the data of another get its record.
layout(local_size_x = 64) in;

#include "micromap_source.glsl"

void main()
{
    const uint triangle = globalInvocation();
    if (triangle >= push.triangleCount)
        return;
    const uint owner = ownerOf(triangle);
    if (owner == triangle)
        return;
    Words from = recordOf(owner);
    Words to = recordOf(triangle);
    to.w[0] = from.w[0];
    to.w[1] = from.w[1];
}
