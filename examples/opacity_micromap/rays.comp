// SPDX-License-Identifier: Apache-2.0
// One ray per invocation, straight at the card. Counts the results of the rays. There are no descriptors: everything is
// at an address in the push constants.
#version 460
#extension GL_EXT_ray_query : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require

layout(local_size_x = 1) in;

layout(buffer_reference, std430) readonly buffer Alpha { float texels[]; };
layout(buffer_reference, std430) buffer Counts { uint passed, candidates, wrong; };
layout(push_constant) uniform Push {
    uvec2 scene; // addresses
    uvec2 alpha;
    uvec2 counts;
    uint alphaSize; // of the square texture
    float cutoff;
} push;

// The bilinear filter of a sampler that clamps to the edge.
float alphaAt(vec2 uv)
{
    const vec2 at = uv * float(push.alphaSize) - 0.5;
    const ivec2 last = ivec2(push.alphaSize) - 1;
    const ivec2 low = clamp(ivec2(floor(at)), ivec2(0), last);
    const ivec2 high = clamp(ivec2(floor(at)) + 1, ivec2(0), last);
    const int width = int(push.alphaSize);
    Alpha alpha = Alpha(push.alpha);
    return mix(mix(alpha.texels[low.y * width + low.x], alpha.texels[low.y * width + high.x], fract(at.x)),
               mix(alpha.texels[high.y * width + low.x], alpha.texels[high.y * width + high.x], fract(at.x)),
               fract(at.y));
}

void main()
{
    // No ray meets the diagonal between the two triangles.
    const vec2 position = (vec2(gl_GlobalInvocationID.xy) + vec2(0.25, 0.5)) / vec2(gl_NumWorkGroups.xy);
    uint candidates = 0u;
    // [query]
    rayQueryEXT query;
    rayQueryInitializeEXT(query, accelerationStructureEXT(push.scene), gl_RayFlagsNoneEXT, 0xff, vec3(position, -1.0),
                          0.0, vec3(0.0, 0.0, 1.0), 2.0);
    // Opaque and transparent micro-triangles return no candidate: only unknown ones cost an alpha test.
    while (rayQueryProceedEXT(query)) {
        ++candidates;
        const vec2 barycentrics = rayQueryGetIntersectionBarycentricsEXT(query, false);
        const vec2 uv =
            rayQueryGetIntersectionPrimitiveIndexEXT(query, false) == 0 ? barycentrics : vec2(1.0) - barycentrics;
        if (alphaAt(uv) >= push.cutoff)
            rayQueryConfirmIntersectionEXT(query);
    }
    // [query end]
    const bool passed = rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionNoneEXT;
    Counts counts = Counts(push.counts);
    atomicAdd(counts.passed, passed ? 1u : 0u);
    atomicAdd(counts.candidates, candidates);
    atomicAdd(counts.wrong, passed == (alphaAt(position) < push.cutoff) ? 0u : 1u);
}
