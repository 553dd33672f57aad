// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_EXT_ray_query : require
#extension GL_GOOGLE_include_directive : require
// A ray query in a vertex, fragment or ray generation shader: one vertex, pixel or launch for each ray.
#ifdef RAYGEN
#extension GL_EXT_ray_tracing : require
#endif
#include "rays.glsl"

#ifdef FRAGMENT
layout(location = 0) out vec4 color;
#endif

void main()
{
#if defined(VERTEX)
    const uint id = uint(gl_VertexIndex);
    gl_Position = vec4(0.0, 0.0, 0.0, 1.0);
    gl_PointSize = 1.0;
#elif defined(FRAGMENT)
    const uint id = uint(gl_FragCoord.x);
    color = vec4(1.0);
#elif defined(RAYGEN)
    const uint id = gl_LaunchIDEXT.x;
#endif
    const Ray ray = rays[id];
    uint count = 0u;
    rayQueryEXT q;
    START(q, ray);
    while (rayQueryProceedEXT(q)) {
        VISIT(q, ray, count)
    }
    REPORT(q, id, count)
}
