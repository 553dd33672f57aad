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
    uint flags; // as the shader reads them
    uint committed;
    uint customIndex;
    uint instance;
    uint geometry;
    uint primitive;
    float t;
    float u;
    float v;
    float tMin;
    uint frontFace; // 1: front; of ray queries also 16: not consistent; record offset << 8
};
