// SPDX-License-Identifier: Apache-2.0
// Declarations that the shaders of pipeline_tracer.glsl and its relatives share. The first three bindings are those of
// tracer.glsl.
#include "ray.glsl"

struct Candidate { // an any-hit invocation
    uint customIndex;
    uint instance;
    uint geometry;
    uint primitive;
    uint bits; // 1: box, 4: front face, 8: accepted
    float t;
    float u;
    float v;
};

struct Note { // one for each candidate
    uint flags;
    uint hitKind;
    uint record; // recordRead()
    uint intact; // 1: the payload is what the ray generation shader wrote
};

struct Visit { // an invocation of an intersection shader
    uint customIndex;
    uint instance;
    uint geometry;
    uint primitive;
    uint flags;
    uint record;
    uint reported; // 1: reported a hit, 2: which was accepted
    float tMin;
};

struct More { // one for each result
    uint visits;
    uint hitKind;
    uint record;
    uint invocations; // closest-hit and miss shaders, together
    uint intact;
    uint called; // read by the callable shader in its record
    uint pad0, pad1;
};

struct Payload {
    uint id;
    uint rule;
    uint count;
    uint invocations;
    uint flags;
    uint committed;
    uint customIndex;
    uint instance;
    uint geometry;
    uint primitive;
    uint hitKind;
    uint record;
    float t;
    float u;
    float v;
    float tMin;
    uint canary;
};

layout(binding = 0) uniform accelerationStructureEXT scene;
layout(binding = 1, std430) readonly buffer Rays { Ray rays[]; };
layout(binding = 2, std430) buffer Results { Result results[]; };
layout(binding = 3, std430) buffer Candidates { Candidate candidates[]; };
layout(binding = 4, std430) buffer Notes { Note notes[]; };
layout(binding = 5, std430) buffer Visits { Visit visits[]; };
layout(binding = 6, std430) buffer Mores { More mores[]; };
layout(push_constant) uniform Push
{
    uint rayCount;
    uint capacity; // candidates kept for each ray, and visits
    uint sbtOffset;
    uint sbtStride;
    uint missIndex;
    uint recordWords; // of data that shaders read in their records: RecordData
    uvec2 sceneAddress;
} push;

uint canaryOf(uint id)
{
    return id * 0x9e3779b1u + 0x7f4a7c15u;
}

const uint kUnknown = 0xffffffffu;
