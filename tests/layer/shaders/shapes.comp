// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_EXT_ray_query : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
// The forms ray query code takes in applications; SHAPE picks one. Results as tracer.glsl writes them. Shapes with a
// second ray trace that of the next thread and report it where the thread's own result would be short of.
#include "rays.glsl"

layout(local_size_x = 64) in;
layout(push_constant) uniform Push
{
    uint rayCount;
    uint capacity;
    uvec2 sceneAddress;
} push;

#if SHAPE == 12
rayQueryEXT globalQuery;
#endif

#if SHAPE == 6
bool advance(rayQueryEXT q)
{
    return rayQueryProceedEXT(q);
}
void visit(rayQueryEXT q, uint rule)
{
    if (rule == 1u)
        rayQueryConfirmIntersectionEXT(q);
}
uint walk(rayQueryEXT q, uint rule)
{
    uint count = 0u;
    while (advance(q)) {
        ++count;
        visit(q, rule);
    }
    return count;
}
#endif

#if SHAPE == 15
uint walkEarly(rayQueryEXT q, Ray ray)
{
    uint count = 0u;
    while (rayQueryProceedEXT(q)) {
        switch (ray.rule) {
        case 0u: ++count; break;
        case 1u:
            ++count;
            rayQueryConfirmIntersectionEXT(q);
            break;
        default: return 1000u;
        }
        if (count == 50u)
            return count;
    }
    return count;
}
#endif

void main()
{
    const uint id = gl_GlobalInvocationID.x;
    if (id >= push.rayCount)
        return;
    const Ray ray = rays[id];
    const Ray other = rays[(id + 1u) % push.rayCount];
    uint count = 0u;

#if SHAPE == 0 // while
    rayQueryEXT q;
    START(q, ray);
    while (rayQueryProceedEXT(q)) {
        VISIT(q, ray, count)
    }
    REPORT(q, id, count)
#elif SHAPE == 1 // do-while
    rayQueryEXT q;
    START(q, ray);
    bool more;
    do {
        more = rayQueryProceedEXT(q);
        if (more) {
            VISIT(q, ray, count)
        }
    } while (more);
    REPORT(q, id, count)
#elif SHAPE == 2 // for with a counter
    rayQueryEXT q;
    START(q, ray);
    for (int i = 0; i < 100 && rayQueryProceedEXT(q); ++i) {
        VISIT(q, ray, count)
    }
    REPORT(q, id, count)
#elif SHAPE == 3 // proceed only in an if
    rayQueryEXT q;
    START(q, ray);
    [[dont_unroll]] for (int i = 0; i < 40; ++i) {
        if (rayQueryProceedEXT(q)) {
            VISIT(q, ray, count)
        }
    }
    REPORT(q, id, count)
#elif SHAPE == 4 // loop without a body
    rayQueryEXT q;
    START(q, ray);
    while (rayQueryProceedEXT(q)) {
    }
    REPORT(q, id, count)
#elif SHAPE == 5 // endless loop with a break
    rayQueryEXT q;
    START(q, ray);
    while (true) {
        if (!rayQueryProceedEXT(q))
            break;
        VISIT(q, ray, count)
    }
    REPORT(q, id, count)
#elif SHAPE == 6 // passed to functions
    rayQueryEXT q;
    START(q, ray);
    count = walk(q, ray.rule);
    REPORT(q, id, count)
#elif SHAPE == 7 // an array of queries, indexed at run time
    rayQueryEXT q[3];
    START(q[0], ray);
    START(q[1], other);
    START(q[2], ray);
    uint counts[3] = uint[3](0u, 0u, 0u);
    for (uint i = 0u; i < 3u; ++i) {
        const uint k = (i + id) % 3u;
        while (rayQueryProceedEXT(q[k])) {
            ++counts[k];
            if ((k == 1u ? other.rule : ray.rule) == 1u)
                rayQueryConfirmIntersectionEXT(q[k]);
        }
    }
    REPORT(q[2], id, counts[2])
    results[id].u = float(counts[1]);
    results[id].v = rayQueryGetIntersectionTypeEXT(q[1], true) == 0u ? 0.0 : rayQueryGetIntersectionTEXT(q[1], true);
#elif SHAPE == 8 // two queries taking turns
    rayQueryEXT a;
    rayQueryEXT b;
    START(a, ray);
    START(b, other);
    uint second = 0u;
    bool moreA = true;
    bool moreB = true;
    while (moreA || moreB) {
        if (moreA) {
            moreA = rayQueryProceedEXT(a);
            if (moreA) {
                VISIT(a, ray, count)
            }
        }
        if (moreB) {
            moreB = rayQueryProceedEXT(b);
            if (moreB) {
                VISIT(b, other, second)
            }
        }
    }
    REPORT(a, id, count)
    results[id].u = float(second);
    results[id].v = rayQueryGetIntersectionTypeEXT(b, true) == 0u ? 0.0 : rayQueryGetIntersectionTEXT(b, true);
#elif SHAPE == 9 // a query inside the loop of another
    rayQueryEXT a;
    START(a, ray);
    uint second = 0u;
    float secondT = 0.0;
    bool once = true;
    do {
        if (once) {
            rayQueryEXT b;
            START(b, other);
            while (rayQueryProceedEXT(b)) {
                VISIT(b, other, second)
            }
            secondT = rayQueryGetIntersectionTypeEXT(b, true) == 0u ? 0.0 : rayQueryGetIntersectionTEXT(b, true);
            once = false;
        }
        if (!rayQueryProceedEXT(a))
            break;
        VISIT(a, ray, count)
    } while (true);
    REPORT(a, id, count)
    results[id].u = float(second);
    results[id].v = secondT;
#elif SHAPE == 10 // terminated at the first candidate
    rayQueryEXT q;
    START(q, ray);
    while (rayQueryProceedEXT(q)) {
        ++count;
        rayQueryTerminateEXT(q);
    }
    REPORT(q, id, count)
#elif SHAPE == 11 // one query used again and again
    rayQueryEXT q;
    for (uint i = 0u; i < 4u; ++i) {
        count = 0u;
        if ((i & 1u) == 0u) {
            START(q, other);
        } else {
            START(q, ray);
        }
        while (rayQueryProceedEXT(q)) {
            ++count;
            if (((i & 1u) == 0u ? other.rule : ray.rule) == 1u)
                rayQueryConfirmIntersectionEXT(q);
        }
    }
    REPORT(q, id, count)
#elif SHAPE == 12 // a global query
    START(globalQuery, ray);
    while (rayQueryProceedEXT(globalQuery)) {
        VISIT(globalQuery, ray, count)
    }
    REPORT(globalQuery, id, count)
#elif SHAPE == 13 // a body with continues
    rayQueryEXT q;
    START(q, ray);
    while (rayQueryProceedEXT(q)) {
        if (rayQueryGetIntersectionTypeEXT(q, false) != gl_RayQueryCandidateIntersectionTriangleEXT)
            continue;
        ++count;
        if (ray.rule != 1u)
            continue;
        rayQueryConfirmIntersectionEXT(q);
    }
    REPORT(q, id, count)
#elif SHAPE == 14 // the result in a variable
    rayQueryEXT q;
    START(q, ray);
    bool more = rayQueryProceedEXT(q);
    while (more) {
        VISIT(q, ray, count)
        more = rayQueryProceedEXT(q);
    }
    REPORT(q, id, count)
#elif SHAPE == 15 // switch, and a return out of the loop
    rayQueryEXT q;
    START(q, ray);
    count = walkEarly(q, ray);
    REPORT(q, id, count)
#elif SHAPE == 16 // a loop with loops in its body
    rayQueryEXT q;
    START(q, ray);
    for (; rayQueryProceedEXT(q);) {
        for (uint i = 0u; i < 8u; ++i) {
            if (i == (id & 3u)) {
                ++count;
                break;
            }
        }
        uint k = 0u;
        while (k < 3u)
            ++k;
        if (k == 3u && ray.rule == 1u)
            rayQueryConfirmIntersectionEXT(q);
    }
    REPORT(q, id, count)
#elif SHAPE == 17 // a limit tested before
    rayQueryEXT q;
    START(q, ray);
    while (count < 3u && rayQueryProceedEXT(q)) {
        VISIT(q, ray, count)
    }
    REPORT(q, id, count)
#elif SHAPE == 18 // a limit tested after
    rayQueryEXT q;
    START(q, ray);
    while (rayQueryProceedEXT(q) && count < 3u) {
        VISIT(q, ray, count)
    }
    REPORT(q, id, count)
#elif SHAPE == 19 // only some threads, and flags that differ between branches
    rayQueryEXT q;
    if ((id & 1u) == 0u) {
        rayQueryInitializeEXT(q, scene, gl_RayFlagsNoneEXT, ray.cullMask, ORIGIN(ray), ray.tMin, DIRECTION(ray), ray.tMax);
    } else {
        rayQueryInitializeEXT(q, scene, gl_RayFlagsOpaqueEXT, ray.cullMask, ORIGIN(ray), ray.tMin, DIRECTION(ray), ray.tMax);
    }
    if ((id & 2u) == 0u) {
        while (rayQueryProceedEXT(q)) {
            VISIT(q, ray, count)
        }
    }
    REPORT(q, id, count)
#elif SHAPE == 20 // a single proceed, for opaque scenes and shadow rays
    rayQueryEXT q;
    rayQueryInitializeEXT(q, scene, gl_RayFlagsOpaqueEXT | gl_RayFlagsTerminateOnFirstHitEXT, ray.cullMask, ORIGIN(ray),
                          ray.tMin, DIRECTION(ray), ray.tMax);
    rayQueryProceedEXT(q);
    REPORT(q, id, count)
#elif SHAPE == 21 // negated condition, loop turned round
    rayQueryEXT q;
    START(q, ray);
    for (;;) {
        const bool done = !rayQueryProceedEXT(q);
        if (done)
            break;
        else {
            VISIT(q, ray, count)
        }
    }
    REPORT(q, id, count)
#elif SHAPE == 22 // the committed hit looked at while traversal goes on
    rayQueryEXT q;
    START(q, ray);
    float nearest = ray.tMax;
    while (rayQueryProceedEXT(q)) {
        if (rayQueryGetIntersectionTypeEXT(q, true) == gl_RayQueryCommittedIntersectionTriangleEXT) {
            const float t = rayQueryGetIntersectionTEXT(q, true);
            if (t > nearest || rayQueryGetIntersectionInstanceCustomIndexEXT(q, true) != 4242)
                count += 1000u;
            nearest = t;
        }
        if (rayQueryGetIntersectionTEXT(q, false) > nearest || rayQueryGetIntersectionInstanceCustomIndexEXT(q, false) != 4242)
            count += 1000u;
        VISIT(q, ray, count)
    }
    REPORT(q, id, count)
#endif
}
