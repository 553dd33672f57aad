// SPDX-License-Identifier: Apache-2.0
// VkAccelerationStructureInstanceKHR in the tail of a top-level structure. Needs opacity.h, records.h and memory.glsl.
// Its last 16-byte unit: custom index (24 bits) and mask, offset of hit records (24) and flags, reference.
const uint kInstanceBytes = 64u;
const uint kLastUnit = kInstanceUnits - 1u;
const uint kIndexPair = 6u; // its two pairs of words
const uint kReferencePair = 7u;
const uint kRecordOffsetMask = 0x00ffffffu;
const uint kFlagsByte = 24u;
// The driver knows no micromap bits.
const uint kHiddenFlags = kInstanceForce2State | kInstanceDisableMicromaps;

// The first two words of the last unit as the application wrote them. The instance record has the index, and the flags that
// the driver did not get.
uvec2 originalWords(uvec2 root, uvec2 inTail)
{
    const uint slot = inTail.x & kCustomIndexMask;
    Words entry = Words(addressPlus(root, (slot >> kSlotsPerPageLog2) * 8u + kRootHeaderWords * 4u));
    Words record = Words(uvec2(entry.w[0] + (slot << kInstanceRecordLog2), entry.w[1]));
    const uint first = record.w[0];
    const uvec2 records = uvec2(record.w[2], record.w[3]);
    uint flags;
    if (records.y == kInstanceNoRecords)
        flags = (first >> kInstanceBoxFlagsShift & kInstanceFlagsMask) << kInstanceFlagsShift;
    else if (records.y == 0u && records.x <= kHiddenFlags)
        flags = records.x;
    else
        flags = flagsInTable(first) | (record.w[1] == kInstanceWithoutMicromaps ? kInstanceDisableMicromaps : 0u);
    return uvec2(first & kCustomIndexMask | inTail.x & ~kCustomIndexMask, inTail.y | flags << kFlagsByte);
}
