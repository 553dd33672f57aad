// SPDX-License-Identifier: Apache-2.0
// A fragment shader with an alpha test and calls in the body.
#version 460
#extension GL_EXT_ray_query : require
layout(binding = 0) uniform accelerationStructureEXT scene;
layout(binding = 1) uniform sampler2D alpha;
layout(location = 0) in vec3 position;
layout(location = 0) out vec4 color;

bool solid(vec2 uv) { return textureLod(alpha, uv, 0.0).a > 0.5; }

void main()
{
    float light = 0.0;
    for (int i = 0; i < 4; ++i) {
        rayQueryEXT q;
        rayQueryInitializeEXT(q, scene, gl_RayFlagsTerminateOnFirstHitEXT, 0xff, position, 0.0, vec3(i, 1, 0), 9.0);
        while (rayQueryProceedEXT(q)) {
            if (solid(rayQueryGetIntersectionBarycentricsEXT(q, false)))
                rayQueryConfirmIntersectionEXT(q);
        }
        if (rayQueryGetIntersectionTypeEXT(q, true) == gl_RayQueryCommittedIntersectionNoneEXT)
            light += 0.25;
    }
    color = vec4(light);
}
