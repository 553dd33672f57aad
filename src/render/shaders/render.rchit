// SPDX-License-Identifier: Apache-2.0
// Reports the hit of a primary ray.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_ray_tracing : require
#include "payload.glsl"

layout(location = 0) rayPayloadInEXT Payload payload;
hitAttributeEXT vec2 barycentrics;

void main()
{
    payload.hit = describeHit(gl_HitTEXT, gl_InstanceCustomIndexEXT + gl_GeometryIndexEXT, gl_PrimitiveID, barycentrics,
                              mat3(gl_WorldToObjectEXT));
}
