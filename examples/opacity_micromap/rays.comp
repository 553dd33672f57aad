// One ray per character of the picture. There are no descriptors: the two addresses are push constants.
#version 460
#extension GL_EXT_ray_query : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require

layout(local_size_x = 1) in;

layout(buffer_reference, std430) writeonly buffer Picture { uint seen[]; };
layout(push_constant) uniform Push {
    uvec2 scene; // addresses
    uvec2 picture;
} push;

// As in main.c
const uint kNothing = 0u;
const uint kHit = 1u;       // committed, and the shader was never asked
const uint kConfirmed = 2u; // the shader was asked and confirmed
const uint kRejected = 3u;  // the shader was asked and did not

// Stands for the alpha test of a texture, which is what costs time: stripes.
bool isOpaque(vec2 barycentrics)
{
    return fract(6.0 * barycentrics.y) < 0.5;
}

void main()
{
    const uvec2 at = gl_GlobalInvocationID.xy;
    const uvec2 size = gl_NumWorkGroups.xy;
    const vec2 position = vec2(float(at.x) + 0.5, float(size.y - at.y) - 0.5) / vec2(size);

    rayQueryEXT query;
    rayQueryInitializeEXT(query, accelerationStructureEXT(push.scene), gl_RayFlagsNoneEXT, 0xff, vec3(position, -1.0),
                          0.0, vec3(0.0, 0.0, 1.0), 2.0);
    bool asked = false;
    // Where the micromap says transparent or opaque, no candidate comes here.
    while (rayQueryProceedEXT(query)) {
        asked = true;
        if (isOpaque(rayQueryGetIntersectionBarycentricsEXT(query, false)))
            rayQueryConfirmIntersectionEXT(query);
    }
    const bool hit = rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionTriangleEXT;
    Picture(push.picture).seen[at.y * size.x + at.x] = asked ? (hit ? kConfirmed : kRejected) : (hit ? kHit : kNothing);
}
