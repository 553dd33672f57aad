// SPDX-License-Identifier: Apache-2.0
// A ray and what becomes of it, as tracer.h lays them out.
struct Ray {
    float origin[3];
    float tMin;
    float direction[3];
    float tMax;
    uint flags;
    uint cullMask;
    uint rule;      // kNever, kAlways, ...: which candidates are confirmed
    float generate; // boxes' candidates report a hit at this t, if it is above 0
};

struct Result {
    uint candidates;
    uint flags; // flags that the shader reads
    uint committed;
    uint customIndex;
    uint instance;
    uint geometry;
    uint primitive;
    float t;
    float u;
    float v;
    float tMin;
    uint frontFace; // 1: front; of ray queries also 16: not consistent,
                    // 32: what the loop counts is wrong; record offset << 8
};

// The candidates that a shader confirms.
const uint kNever = 0u;
const uint kAlways = 1u;
const uint kHash = 2u;
const uint kTerminate = 3u;

bool confirms(uint rule, uint customIndex, uint instance, uint geometry, uint primitive)
{
    const uint h = (customIndex * 0x9e3779b1u) ^ (instance * 0x85ebca6bu) ^ (geometry * 0xc2b2ae35u) ^
                   (primitive * 0x27d4eb2fu);
    return rule == kAlways || rule == kTerminate || (rule == kHash && ((h ^ (h >> 15u)) & 0x40u) != 0u);
}
