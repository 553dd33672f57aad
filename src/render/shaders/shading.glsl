// SPDX-License-Identifier: Apache-2.0
// The picture of the scene, except how a ray is traced.
#include "hit.glsl"

const float kFar = 1e30;
uint candidates = 0u;
uint rays = 0u;

// The shader that includes this defines the two by ray queries or by traceRayEXT, and counts if kCount: one primary and
// one shadow ray per sample, with the usual alpha test of every candidate. With micromaps there are simply fewer.
Hit traceClosest(vec3 origin, vec3 direction);
bool isShadowed(vec3 origin, vec3 direction, float near);
// The displayed colour with kPaint; never called without.
vec3 paintPoint(vec3 origin, vec3 direction);

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

// `t`: where the ray ended, as in Hit.
vec3 shade(vec3 origin, vec3 direction, out float t)
{
    const Hit hit = traceClosest(origin, direction);
    t = hit.t;
    if (hit.t == kNothing)
        return sky(direction);
    const GeometryRecord g = geometries[hit.geometry];
    const vec3 position = origin + direction * hit.t;
    const vec3 sun = frame.sun.xyz;

    vec3 albedo = g.color.rgb;
    if (g.texture >= 0)
        albedo *= pow(textureLod(textures[nonuniformEXT(g.texture)], hit.uv, 0.0).rgb, vec3(2.2));
    if (g.kind == kGround)
        albedo = groundColor(position, hit.t);
    else if (g.kind == kSolid)
        albedo *= 0.30 + 0.55 * noise(vec2(position.x + position.z, position.y * 0.25) * (700.0 / frame.origin.w) + 4096.0);

    const bool shadowed = isShadowed(position, sun, 2e-4 * frame.origin.w);
    const vec3 sunColor = vec3(1.0, 0.90, 0.74) * 4.3;
    const float facing = dot(hit.normal, sun);
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
    const float open = hit.visibility * hit.visibility * 0.6 + hit.visibility * 0.4;
    light += mix(vec3(0.42, 0.40, 0.25), vec3(0.78, 0.98, 1.25), hit.normal.y * 0.5 + 0.5) * (0.10 + 0.90 * open);
    if (g.kind == kLeaves)
        light += vec3(0.10, 0.13, 0.02) * (1.0 - open);
    vec3 color = albedo * light;
    if (g.kind == kLeaves && !shadowed) // a soft gloss
        color += vec3(0.05) * pow(max(dot(hit.normal, normalize(sun - direction)), 0.0), 24.0);
    const float haze = 1.0 - exp(-0.0035 * pow(hit.t / frame.origin.w, 1.8));
    return mix(color, kHaze, haze);
}

// A filmic curve (the rational fit to ACES by K. Narkowicz), then sRGB's gamma.
vec3 display(vec3 color)
{
    color *= 0.82;
    color = clamp(color * (2.51 * color + 0.03) / (color * (2.43 * color + 0.59) + 0.14), 0.0, 1.0);
    return pow(color, vec3(1.0 / 2.2));
}

void drawPixel(uvec2 pixel)
{
    const uvec2 size = pictureSize();
    const uint samples = uint(frame.forward.w);
    vec3 color = vec3(0.0);
    for (uint i = 0u; i < samples; ++i) {
        // The R2 sequence, whose first point is the pixel's centre.
        const vec2 place = fract(0.5 + float(i) * vec2(0.7548776662, 0.5698402910));
        const vec2 point = (vec2(pixel) + place) / vec2(size) * 2.0 - 1.0;
        const vec3 direction = normalize(frame.forward.xyz + point.x * frame.right.xyz - point.y * frame.up.xyz);
        float t;
        color += kPaint ? paintPoint(frame.origin.xyz, direction) : shade(frame.origin.xyz, direction, t);
    }
    const uint index = pixel.y * size.x + pixel.x;
    color /= float(samples);
    pixels[index] = packUnorm4x8(vec4(kPaint ? color : display(color), 1.0));
    if (kCount)
        counts[index] = uvec2(candidates, rays);
}
