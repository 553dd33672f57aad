// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Writes the instances in the tail of a top-level structure, which the driver builds from: those of the application, with the
// slot in place of the custom index, and without the flags that would keep hits from the shader. Writes the instance records.
// Every driver compiles this shader for a first build, so it has few branches: most values are chosen.
#include "shared.h"
#include "opacity.h"
#include "records.h"
#include "push.h"
#include "base/memory.glsl"
#include "base/structure_descriptor.glsl"
#include "instance.glsl"

layout(local_size_x = 64) in;

layout(push_constant, std430) uniform Push
{
    TlasInstancesPush push;
};

bool isIn(uint kinds, uint kind)
{
    return (kinds >> kind & 1u) != 0u;
}

void main()
{
    // Loaded before the first branch, where a CPU driver loads once what is the same for all invocations.
    const uvec2 table = hashTable(push.root);
    const uint greatestOffset = Words(push.counters).w[kGreatestRecordOffset];
    const uint i = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
    if (i >= push.count)
        return;
    const uvec2 target = addressPlus(push.tail, i * kInstanceBytes);
    const uvec2 source = addressPlus(push.source, i * kInstanceBytes);
    if (push.source != push.tail) {
        for (uint p = 0u; p < kIndexPair; ++p)
            storePair(target, p, pairAt(source, p));
    }
    uvec2 words = pairAt(source, kIndexPair);
    const uvec2 reference = pairAt(source, kReferencePair);

    const uvec2 descriptor = findDescriptor(table, reference);
    const bool known = any(notEqual(descriptor, uvec2(0)));
    const uvec2 stated = known ? descriptorWords(descriptor) : push.root; // core/records.h
    const uint kindWord = Words(stated).w[2];
    const uint built = kindWord >> kDescriptorGenerationShift == generationOf(descriptor) ? kindWord & kDescriptorKindMask : kDescriptorUnbuilt;
    const uint kind = known ? built : kDescriptorMicromap;
    const bool recorded = kind == kDescriptorBottom;
    const bool boxes = kind == kDescriptorBoxes;

    const uint flags = words.y >> kFlagsByte;
    const uint someFlags = flags >> kInstanceFlagsShift & kInstanceFlagsMask;
    const uint shift = recorded ? (someFlags & 7u) * 8u : 0u;
    uvec2 record = uvec2((shift < 32u ? push.hitTables.x : push.hitTables.y) >> (shift & 31u) << kHitTableShift, 0u);
    uvec2 records = uvec2(flags & kHiddenFlags, 0u);
    if (recorded) {
        records = pairAt(stated, 0u);
        const uint onlyGeometry = Words(records).w[0];
        const uint triangles = Words(stated).w[4] == 1u ? onlyGeometry : kManyGeometries | kManyGeometriesMask;
        record.y = (flags & kInstanceDisableMicromaps) != 0u ? kInstanceWithoutMicromaps : triangles;
    }
    if (boxes) {
        record.x = kInstanceBoxes | someFlags << kInstanceBoxFlagsShift;
        records = uvec2(Words(stated).w[7], kInstanceNoRecords);
    }
    record.x |= words.x & kCustomIndexMask;
    storePair(push.records, 2u * i, record);
    storePair(push.records, 2u * i + 1u, records);

    const bool wrong = isIn(push.wrongKinds, kind) && any(notEqual(reference, uvec2(0)));
    // The driver reads hit records of all instances, so the layer's copies of hit tables must be large enough (hit_records.comp).
    const uint offset = words.y & kRecordOffsetMask;
    if (wrong || offset > greatestOffset) {
        Words counters = Words(push.counters);
        atomicMax(counters.w[kGreatestRecordOffset], offset);
        if (wrong) {
            atomicAdd(counters.w[kind == kDescriptorUnbuilt ? push.unbuiltError : push.unknownError], 1u);
            memoryBarrierBuffer();
            atomicAdd(counters.w[kGpuErrorTotal], 1u);
        }
    }

    words.x = words.x & ~kCustomIndexMask | push.firstSlot + i;
    // FORCE_OPAQUE would make the driver commit hits that the micromap ignores.
    words.y &= ~((recorded ? kHiddenFlags | kInstanceForceOpaque : kHiddenFlags) << kFlagsByte);
    // The driver follows references when it builds, so it gets none that lead nowhere.
    storePair(target, kIndexPair, words);
    storePair(target, kReferencePair, isIn(push.usableKinds, kind) ? reference : uvec2(0));
}
