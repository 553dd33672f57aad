// SPDX-License-Identifier: Apache-2.0
// The shaders of an application with alpha-tested geometry: one closest hit for each pixel, and the texture of every candidate by
// way of its texture coordinates. One of QUERY, RAYGEN, MISS, CLOSEST_HIT, ANY_HIT is defined. With HEAVY the alpha comes from a
// material with several textures and some arithmetic, and what was hit is shaded.
#version 460
#extension GL_EXT_nonuniform_qualifier : require
#ifdef QUERY
#extension GL_EXT_ray_query : require
layout(local_size_x = 8, local_size_y = 8) in;
#else
#extension GL_EXT_ray_tracing : require
#endif

struct GeometryRecord {
    uint firstTriangle;
    uint texture;
    float cutoff;
    float scale;
};

layout(binding = 0) uniform accelerationStructureEXT world;
layout(binding = 1, rgba8) uniform writeonly image2D picture;
layout(std430, binding = 2) readonly buffer Geometries { GeometryRecord geometries[]; };
layout(std430, binding = 3) readonly buffer Uvs { vec2 uvs[]; };
layout(binding = 4) uniform sampler2D textures[64];
layout(push_constant) uniform Frame
{
    vec4 origin;
    vec4 right;
    vec4 up;
    vec4 forward;
} frame;

vec2 textureCoordinates(GeometryRecord g, uint primitive, vec2 b)
{
    const uint first = 3u * (g.firstTriangle + primitive);
    return uvs[first] * (1.0 - b.x - b.y) + uvs[first + 1u] * b.x + uvs[first + 2u] * b.y;
}

vec4 material(uint texture, vec2 uv)
{
    vec4 color = textureLod(textures[nonuniformEXT(texture)], uv, 0.0);
#ifdef HEAVY
    for (uint layer = 1u; layer < 6u; ++layer) {
        const vec4 next = textureLod(textures[nonuniformEXT(texture + layer)], uv * float(layer) + color.xy, 0.0);
        color = mix(color, next * sin(color.wzyx * float(layer)), next.a);
    }
#endif
    return color;
}

bool isThere(uint geometry, uint primitive, vec2 b)
{
    const GeometryRecord g = geometries[geometry];
    return material(g.texture, textureCoordinates(g, primitive, b)).a * g.scale >= g.cutoff;
}

vec4 shade(uint geometry, uint primitive, vec2 b)
{
    const GeometryRecord g = geometries[geometry];
    return material(g.texture, textureCoordinates(g, primitive, b));
}

vec3 rayDirection(uvec2 pixel, uvec2 size)
{
    const vec2 p = (vec2(pixel) + 0.5) / vec2(size) * 2.0 - 1.0;
    return normalize(frame.forward.xyz + p.x * frame.right.xyz + p.y * frame.up.xyz);
}

#if defined(QUERY)

void main()
{
    const uvec2 pixel = gl_GlobalInvocationID.xy;
    rayQueryEXT query;
    rayQueryInitializeEXT(query, world, gl_RayFlagsNoneEXT, 0xff, frame.origin.xyz, 0.0,
                          rayDirection(pixel, gl_NumWorkGroups.xy * 8u), 1e6);
    while (rayQueryProceedEXT(query)) {
        const uint geometry = rayQueryGetIntersectionInstanceCustomIndexEXT(query, false) +
                              rayQueryGetIntersectionGeometryIndexEXT(query, false);
        if (isThere(geometry, rayQueryGetIntersectionPrimitiveIndexEXT(query, false),
                    rayQueryGetIntersectionBarycentricsEXT(query, false)))
            rayQueryConfirmIntersectionEXT(query);
    }
    vec4 color = vec4(0.5);
    if (rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionTriangleEXT)
        color = shade(rayQueryGetIntersectionInstanceCustomIndexEXT(query, true) +
                          rayQueryGetIntersectionGeometryIndexEXT(query, true),
                      rayQueryGetIntersectionPrimitiveIndexEXT(query, true),
                      rayQueryGetIntersectionBarycentricsEXT(query, true));
    imageStore(picture, ivec2(pixel), color);
}

#elif defined(RAYGEN)

layout(location = 0) rayPayloadEXT vec4 color;

void main()
{
    traceRayEXT(world, gl_RayFlagsNoneEXT, 0xff, 0, 0, 0, frame.origin.xyz, 0.0,
                rayDirection(gl_LaunchIDEXT.xy, gl_LaunchSizeEXT.xy), 1e6, 0);
    imageStore(picture, ivec2(gl_LaunchIDEXT.xy), color);
}

#elif defined(MISS)

layout(location = 0) rayPayloadInEXT vec4 color;

void main()
{
    color = vec4(0.5);
}

#elif defined(CLOSEST_HIT)

layout(location = 0) rayPayloadInEXT vec4 color;
hitAttributeEXT vec2 barycentrics;

void main()
{
    color = shade(gl_InstanceCustomIndexEXT + gl_GeometryIndexEXT, gl_PrimitiveID, barycentrics);
}

#else

hitAttributeEXT vec2 barycentrics;

void main()
{
    if (!isThere(gl_InstanceCustomIndexEXT + gl_GeometryIndexEXT, gl_PrimitiveID, barycentrics))
        ignoreIntersectionEXT;
}

#endif
