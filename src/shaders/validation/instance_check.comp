// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Checks the instances (VkAccelerationStructureInstanceKHR) of a top-level structure against the structures that they name.
#include "shared.h"
#include "findings.h"
#include "push.h"
#include "base/memory.glsl"

layout(local_size_x = 64) in;

layout(push_constant, std430) uniform Push
{
    InstanceCheckPush push;
};

#include "validation/log.glsl"

const uint kInstanceBytes = 64u;
const uint kFlagsWord = 13u; // shader binding table offset 24 bits, flags 8
const uint kReferenceWord = 14u;
const uint kForceTwoState = 0x10u;
const uint kDisableMicromaps = 0x20u;

uvec2 loadAddress(uvec2 at)
{
    Words words = Words(at);
    return uvec2(words.w[0], words.w[1]);
}

// The record of the structure that a reference names; record 0, which states nothing, if it is unknown. `isKnown`: the
// table has the reference.
Words recordOf(uvec2 reference, out bool isKnown)
{
    isKnown = true;
    Words table = Words(push.references);
    uint bucket = referenceBucket(reference.x, reference.y);
    for (uint probe = 0u; probe < kReferenceProbes; ++probe) {
        const uint at = bucket * kReferenceBucketWords;
        const uvec2 key = uvec2(table.w[at], table.w[at + 1u]);
        if (all(equal(key, reference)))
            return Words(elementAddress(push.records, table.w[at + 2u], kStructureRecordWords * 4u));
        if (all(equal(key, uvec2(0))))
            break;
        bucket = bucket + 1u & (1u << kReferenceBucketsLog2) - 1u;
    }
    isKnown = false;
    return Words(push.records);
}

void main()
{
    const uint i = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
    uint count = push.count;
    uvec2 array = push.instances;
    if (any(notEqual(push.range, uvec2(0)))) { // VkAccelerationStructureBuildRangeInfoKHR: primitiveCount, primitiveOffset
        Words range = Words(readable(push.range, push.records));
        count = min(count, range.w[0]);
        array = addressPlus(array, range.w[1]);
    }
    if (i >= count)
        return;
    const uvec2 address = push.pointers != 0u ? loadAddress(elementAddress(array, i, 8u)) : elementAddress(array, i, kInstanceBytes);
    if ((address.x & 15u) != 0u)
        reportFinding(kFindingPointer, i, address.x, address.y);
    Words instance = Words(address);
    const uint flags = instance.w[kFlagsWord] >> 24u;
    const uvec2 reference = uvec2(instance.w[kReferenceWord], instance.w[kReferenceWord + 1u]);
    if (push.feature == 0u) {
        if ((flags & (kForceTwoState | kDisableMicromaps)) != 0u) {
            reportFinding(kFindingFeature, i, flags, 0u);
            return;
        }
    }
    if (all(equal(reference, uvec2(0))))
        return;
    bool isKnown;
    Words record = recordOf(reference, isKnown);
    const uint kind = record.w[0];
    if (!isKnown && record.w[kRecordAllReferences] != 0u)
        reportFinding(kFindingNoStructure, i, reference.x, reference.y);
    else if (kind == kRecordMicromap || kind == kRecordTop || kind == kRecordDestroyed)
        reportFinding(kind == kRecordMicromap ? kFindingMicromap : kind == kRecordTop ? kFindingTopLevel : kFindingDestroyed,
                      i, reference.x, reference.y);
    else if (kind == kRecordBottom && (flags & kDisableMicromaps) != 0u && (record.w[1] & push.allowDisable) == 0u)
        reportFinding(kFindingDisable, i, reference.x, reference.y);
}
