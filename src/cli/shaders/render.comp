// One primary and one shadow ray per sample by ray queries, in the usual form of an alpha test: every candidate that
// the proceed loop hands over samples the texture. With micromaps the same shader simply gets fewer of them.
#version 460
#extension GL_EXT_ray_query : require
#extension GL_EXT_nonuniform_qualifier : require

layout(local_size_x = 8, local_size_y = 8) in;

layout(constant_id = 0) const uint kTextures = 1;
layout(constant_id = 1) const uint kHeavyReads = 0; // additional texture reads per candidate
layout(constant_id = 2) const bool kCount = false;  // write how many candidates each ray was handed

const uint kSolid = 0u;
const uint kLeaves = 1u;
const uint kGround = 2u;

struct GeometryRecord {
    uint firstTriangle;
    int texture;
    float cutoff;
    uint kind;
    vec4 color;
};

layout(binding = 0) uniform accelerationStructureEXT world;
layout(std430, binding = 1) writeonly buffer Pixels { uint pixels[]; };
layout(std430, binding = 2) readonly buffer Geometries { GeometryRecord geometries[]; };
layout(std430, binding = 3) readonly buffer Uvs { vec2 uvs[]; };
layout(std430, binding = 4) readonly buffer Normals { uint normals[]; };
layout(std430, binding = 5) writeonly buffer Counts { uvec2 counts[]; }; // candidates, rays
layout(binding = 6) uniform sampler2D textures[kTextures];

layout(push_constant) uniform Frame {
    vec4 origin;  // w: scale of the scene
    vec4 right;   // w: pixels across
    vec4 up;      // w: pixels down
    vec4 forward; // w: samples per pixel
    vec4 sun;     // towards it
} frame;

const float kFar = 1e30;
uint candidates = 0u;
uint rays = 0u;

vec2 textureCoordinates(GeometryRecord g, uint primitive, vec2 b)
{
    const uint first = 3u * (g.firstTriangle + primitive);
    return uvs[first] * (1.0 - b.x - b.y) + uvs[first + 1u] * b.x + uvs[first + 2u] * b.y;
}

// The application's alpha test.
bool isLeaf(uint geometry, uint primitive, vec2 barycentrics)
{
    const GeometryRecord g = geometries[geometry];
    if (g.texture < 0)
        return true;
    const vec2 uv = textureCoordinates(g, primitive, barycentrics);
    float alpha = textureLod(textures[nonuniformEXT(g.texture)], uv, 0.0).a * g.color.a;
    if (kHeavyReads > 0u) {
        // Work of a costly material, of which nothing is left in the result: no sum of alphas is below zero.
        float sum = 0.0;
        for (uint i = 1u; i <= kHeavyReads; ++i)
            sum += textureLod(textures[nonuniformEXT(g.texture)], uv + vec2(0.0137, 0.0071) * float(i), 0.0).a;
        alpha += min(sum, 0.0);
    }
    return alpha >= g.cutoff;
}

struct Hit {
    bool found;
    uint geometry;
    uint primitive;
    vec2 barycentrics;
    float t;
    mat4x3 objectToWorld;
};

Hit traceClosest(vec3 origin, vec3 direction)
{
    rayQueryEXT query;
    rayQueryInitializeEXT(query, world, gl_RayFlagsNoneEXT, 0xff, origin, 0.0, direction, kFar);
    while (rayQueryProceedEXT(query)) {
        if (kCount)
            ++candidates;
        const uint geometry = rayQueryGetIntersectionInstanceCustomIndexEXT(query, false) +
                              rayQueryGetIntersectionGeometryIndexEXT(query, false);
        if (isLeaf(geometry, rayQueryGetIntersectionPrimitiveIndexEXT(query, false),
                   rayQueryGetIntersectionBarycentricsEXT(query, false)))
            rayQueryConfirmIntersectionEXT(query);
    }
    if (kCount)
        ++rays;
    Hit hit;
    hit.found = rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionTriangleEXT;
    if (hit.found) {
        hit.geometry = rayQueryGetIntersectionInstanceCustomIndexEXT(query, true) +
                       rayQueryGetIntersectionGeometryIndexEXT(query, true);
        hit.primitive = rayQueryGetIntersectionPrimitiveIndexEXT(query, true);
        hit.barycentrics = rayQueryGetIntersectionBarycentricsEXT(query, true);
        hit.t = rayQueryGetIntersectionTEXT(query, true);
        hit.objectToWorld = rayQueryGetIntersectionObjectToWorldEXT(query, true);
    }
    return hit;
}

bool isShadowed(vec3 origin, vec3 direction, float near)
{
    rayQueryEXT query;
    rayQueryInitializeEXT(query, world, gl_RayFlagsTerminateOnFirstHitEXT, 0xff, origin, near, direction, kFar);
    while (rayQueryProceedEXT(query)) {
        if (kCount)
            ++candidates;
        const uint geometry = rayQueryGetIntersectionInstanceCustomIndexEXT(query, false) +
                              rayQueryGetIntersectionGeometryIndexEXT(query, false);
        if (isLeaf(geometry, rayQueryGetIntersectionPrimitiveIndexEXT(query, false),
                   rayQueryGetIntersectionBarycentricsEXT(query, false)))
            rayQueryConfirmIntersectionEXT(query);
    }
    if (kCount)
        ++rays;
    return rayQueryGetIntersectionTypeEXT(query, true) != gl_RayQueryCommittedIntersectionNoneEXT;
}

float hash(vec2 p)
{
    uvec2 q = uvec2(ivec2(p)) * uvec2(1597334677u, 3812015801u);
    uint n = (q.x ^ q.y) * 1597334677u;
    n = (n ^ (n >> 15)) * 2246822519u;
    return float(n >> 8) * (1.0 / 16777216.0);
}

float noise(vec2 p)
{
    const vec2 cell = floor(p);
    const vec2 part = p - cell;
    const vec2 s = part * part * (3.0 - 2.0 * part);
    return mix(mix(hash(cell), hash(cell + vec2(1, 0)), s.x),
               mix(hash(cell + vec2(0, 1)), hash(cell + vec2(1, 1)), s.x), s.y);
}

const vec3 kHaze = vec3(0.62, 0.74, 0.86);

vec3 sky(vec3 direction)
{
    const float height = max(direction.y, 0.0);
    vec3 color = mix(kHaze, vec3(0.10, 0.27, 0.62), 1.0 - exp(-3.4 * height));
    const float toSun = max(dot(direction, frame.sun.xyz), 0.0);
    color += vec3(1.0, 0.80, 0.50) * (0.22 * pow(toSun, 12.0) + 0.35 * pow(toSun, 160.0));
    // Thin high clouds.
    if (direction.y > 0.02) {
        const vec2 p = direction.xz / (direction.y + 0.12) * 1.3;
        const float clouds = 0.5 * noise(p * vec2(1.0, 2.2) + 40.0) + 0.3 * noise(p * 2.7 + 80.0) + 0.2 * noise(p * 6.1 + 160.0);
        color = mix(color, vec3(0.98, 0.97, 0.95), 0.75 * smoothstep(0.48, 0.85, clouds) * smoothstep(0.02, 0.25, direction.y));
    }
    return color;
}

vec3 groundColor(vec3 position, float distance)
{
    const vec2 p = position.xz * (60.0 / frame.origin.w) + 4096.0;
    const float patches = noise(p * 0.11) * 0.6 + noise(p * 0.37) * 0.4;
    const float fade = 1.0 / (1.0 + 0.6 * distance / frame.origin.w);
    const float blades = mix(0.5, noise(p * vec2(9.0, 6.0)) * 0.5 + noise(p * 23.0) * 0.5, fade);
    vec3 color = mix(vec3(0.030, 0.062, 0.012), vec3(0.070, 0.084, 0.022), patches);
    color = mix(color, vec3(0.095, 0.090, 0.035), 0.5 * smoothstep(0.55, 0.8, noise(p * 0.9) * 0.5 + noise(p * 3.1) * 0.5));
    return color * (0.25 + 1.5 * blades * blades * 1.4);
}

vec3 decodeNormal(uint packed)
{
    const vec2 e = vec2(packed & 4095u, (packed >> 12) & 4095u) / 4095.0 * 2.0 - 1.0;
    vec3 n = vec3(e, 1.0 - abs(e.x) - abs(e.y));
    if (n.z < 0.0)
        n.xy = (1.0 - abs(n.yx)) * vec2(n.x >= 0.0 ? 1.0 : -1.0, n.y >= 0.0 ? 1.0 : -1.0);
    return normalize(n);
}

vec3 shade(vec3 origin, vec3 direction)
{
    const Hit hit = traceClosest(origin, direction);
    if (!hit.found)
        return sky(direction);
    const GeometryRecord g = geometries[hit.geometry];
    const uint first = 3u * (g.firstTriangle + hit.primitive);
    const vec3 weights = vec3(1.0 - hit.barycentrics.x - hit.barycentrics.y, hit.barycentrics);
    vec3 normal = vec3(0.0);
    float visibility = 0.0;
    for (uint i = 0u; i < 3u; ++i) {
        normal += weights[i] * decodeNormal(normals[first + i]);
        visibility += weights[i] * float(normals[first + i] >> 24) / 255.0;
    }
    normal = normalize(mat3(hit.objectToWorld) * normal);
    const vec3 position = origin + direction * hit.t;
    const vec3 sun = frame.sun.xyz;

    vec3 albedo = g.color.rgb;
    if (g.texture >= 0) {
        const vec2 uv = textureCoordinates(g, hit.primitive, hit.barycentrics);
        albedo *= pow(textureLod(textures[nonuniformEXT(g.texture)], uv, 0.0).rgb, vec3(2.2));
    }
    if (g.kind == kGround)
        albedo = groundColor(position, hit.t);
    else if (g.kind == kSolid)
        albedo *= 0.30 + 0.55 * noise(vec2(position.x + position.z, position.y * 0.25) * (700.0 / frame.origin.w) + 4096.0);

    const bool shadowed = isShadowed(position, sun, 2e-4 * frame.origin.w);
    const vec3 sunColor = vec3(1.0, 0.90, 0.74) * 4.3;
    const float facing = dot(normal, sun);
    vec3 light = vec3(0.0);
    if (!shadowed) {
        if (g.kind == kLeaves) {
            // Leaves are thin: what falls on the far side shines through, warmer.
            const float through = pow(max(dot(direction, sun), 0.0), 3.0);
            light = sunColor * (0.62 * max(facing * 0.8 + 0.2, 0.0) + vec3(1.1, 1.1, 0.45) * (0.06 + 0.6 * through));
        } else {
            light = sunColor * max(facing, 0.0);
        }
    }
    // Sky from above, the ground's reflection from below, both as far as they are seen.
    const float open = visibility * visibility * 0.6 + visibility * 0.4;
    light += mix(vec3(0.42, 0.40, 0.25), vec3(0.78, 0.98, 1.25), normal.y * 0.5 + 0.5) * (0.10 + 0.90 * open);
    if (g.kind == kLeaves)
        light += vec3(0.10, 0.13, 0.02) * (1.0 - open);
    vec3 color = albedo * light;
    if (g.kind == kLeaves && !shadowed) // a soft gloss
        color += vec3(0.05) * pow(max(dot(normal, normalize(sun - direction)), 0.0), 24.0);
    const float haze = 1.0 - exp(-0.0035 * pow(hit.t / frame.origin.w, 1.8));
    return mix(color, kHaze, haze);
}

// A filmic curve (the rational fit to ACES by K. Narkowicz), then sRGB's gamma.
uint encode(vec3 color)
{
    color *= 0.82;
    color = clamp(color * (2.51 * color + 0.03) / (color * (2.43 * color + 0.59) + 0.14), 0.0, 1.0);
    return packUnorm4x8(vec4(pow(color, vec3(1.0 / 2.2)), 1.0));
}

void main()
{
    const uvec2 size = uvec2(frame.right.w, frame.up.w);
    const uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= size.x || pixel.y >= size.y)
        return;
    const uint samples = uint(frame.forward.w);
    vec3 color = vec3(0.0);
    for (uint i = 0u; i < samples; ++i) {
        // The R2 sequence, whose first point is the pixel's centre.
        const vec2 place = fract(0.5 + float(i) * vec2(0.7548776662, 0.5698402910));
        const vec2 point = (vec2(pixel) + place) / vec2(size) * 2.0 - 1.0;
        const vec3 direction = normalize(frame.forward.xyz + point.x * frame.right.xyz - point.y * frame.up.xyz);
        color += shade(frame.origin.xyz, direction);
    }
    const uint index = pixel.y * size.x + pixel.x;
    pixels[index] = encode(color / float(samples));
    if (kCount)
        counts[index] = uvec2(candidates, rays);
}
