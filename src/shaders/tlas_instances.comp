#version 460
#extension GL_GOOGLE_include_directive : require
// Copies the application's instances for the driver to build from, with the slot in place of the custom index and without
// the flags that would keep hits from the shader, and writes the instance records. VkAccelerationStructureInstanceKHR.
#include "shared.h"
#include "opacity.h"
#include "records.h"
#include "memory.glsl"

layout(local_size_x = 64) in;

layout(push_constant, std430) uniform Push
{
    uvec2 source;
    uvec2 target;
    uvec2 root;
    uint count;
    uint firstSlot;
    uint arrayOfPointers;
} push;

const uint kInstanceBytes = 64u;
const uint kCustomIndexWord = 12u; // custom index 24 bits, mask 8
const uint kFlagsWord = 13u;       // shader binding table offset 24 bits, flags 8
const uint kReferenceWord = 14u;

uvec2 loadAddress(uvec2 at)
{
    Words words = Words(at);
    return uvec2(words.w[0], words.w[1]);
}

// The cell of the BLAS with this reference; zero where it has none.
uvec4 findCell(uvec2 reference)
{
    if (all(equal(reference, uvec2(0))))
        return uvec4(0);
    Words table = Words(loadAddress(push.root));
    const uint mask = table.w[0];
    uint bucket = hashReference(reference.x, reference.y) & mask;
    for (uint probes = 0u; probes <= mask; ++probes) {
        const uint at = kHashHeaderWords + bucket * kHashBucketWords;
        const uvec2 key = uvec2(table.w[at], table.w[at + 1u]);
        if (all(equal(key, reference))) {
            Words cell = Words(uvec2(table.w[at + 2u], table.w[at + 3u]));
            return uvec4(cell.w[0], cell.w[1], cell.w[2], cell.w[3]);
        }
        if (all(equal(key, uvec2(0))))
            break;
        bucket = (bucket + 1u) & mask;
    }
    return uvec4(0);
}

void writeRecord(uint slot, uint customIndex, uint flags, uvec4 cell)
{
    const uvec2 records = cell.xy;
    const uint recordFlags = (flags >> kInstanceFlagsShift) & kInstanceFlagsMask;
    const uvec2 entry = elementAddress(push.root, (slot >> kSlotsPerPageLog2) + kRootHeaderWords / 2u, 8u);
    const uint inPage = slot & ((1u << kSlotsPerPageLog2) - 1u);
    Words record = Words(elementAddress(loadAddress(entry), inPage, kInstanceRecordWords * 4u));
    record.w[0] = customIndex | (cell.z != 0u ? kInstanceBoxes | (recordFlags << kInstanceBoxFlagsShift) : 0u);
    record.w[1] = cell.w;
    record.w[2] = records.x | (any(notEqual(records, uvec2(0))) ? recordFlags : 0u);
    record.w[3] = records.y;
}

void main()
{
    const uint i = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
    if (i >= push.count)
        return;
    const uvec2 at = push.arrayOfPointers != 0u ? loadAddress(elementAddress(push.source, i, 8u))
                                                : elementAddress(push.source, i, kInstanceBytes);
    Words source = Words(at);
    Words target = Words(elementAddress(push.target, i, kInstanceBytes));
    for (uint w = 0u; w < kCustomIndexWord; ++w)
        target.w[w] = source.w[w];

    const uint customAndMask = source.w[kCustomIndexWord];
    const uint offsetAndFlags = source.w[kFlagsWord];
    const uvec2 reference = uvec2(source.w[kReferenceWord], source.w[kReferenceWord + 1u]);
    const uvec4 cell = findCell(reference);

    // The driver knows no micromap bits. FORCE_OPAQUE would make it commit hits that the micromap ignores.
    uint hidden = kInstanceForce2State | kInstanceDisableMicromaps;
    if (any(notEqual(cell.xy, uvec2(0))))
        hidden |= kInstanceForceOpaque;

    const uint slot = push.firstSlot + i;
    target.w[kCustomIndexWord] = slot | (customAndMask & 0xff000000u);
    target.w[kFlagsWord] = offsetAndFlags & ~(hidden << 24u);
    target.w[kReferenceWord] = reference.x;
    target.w[kReferenceWord + 1u] = reference.y;
    writeRecord(slot, customAndMask & 0x00ffffffu, offsetAndFlags >> 24u, cell);
}
