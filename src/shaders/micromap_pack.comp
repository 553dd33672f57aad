#version 460
#extension GL_GOOGLE_include_directive : require
// Micromap build, second pass: 16 invocations a triangle, one for each sub-triangle of level 2. They copy the data to its
// place and find the coarse mask; a triangle that the mask describes completely needs no data and becomes inline.
#include "micromap_source.glsl"

layout(local_size_x = 64) in;

const uint kTrianglesPerGroup = 4u;
const uint kSubTriangles = 16u;
const uint kSmallWords = 8u; // the most words of a triangle whose sub-triangles are smaller than a word

shared uint masks[kTrianglesPerGroup];
shared uint smallWords[kTrianglesPerGroup * kSmallWords];

void main()
{
    const uint local = gl_LocalInvocationIndex / kSubTriangles;
    const uint sub = gl_LocalInvocationIndex % kSubTriangles;
    const uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    const uint triangle = group * kTrianglesPerGroup + local;

    if (sub == 0u)
        masks[local] = 0u;
    if (sub < kSmallWords)
        smallWords[local * kSmallWords + sub] = 0u;
    barrier();

    bool live = triangle < push.triangleCount;
    uint word0 = kRejected;
    uint word1 = 0u;
    Source s;
    s.valid = false;
    s.level = 0u;
    s.bitsPerState = 1u;
    s.dataOffset = 0u;
    if (live) {
        Words record = recordOf(triangle);
        word0 = record.w[0];
        word1 = record.w[1];
        if (word0 != kRejected)
            s = readSource(triangle);
    }
    live = live && s.valid && word0 != kRejected;

    const bool coarse = s.level <= kCoarseLevel;
    const uint unit = (word0 & kKindMask) == kKindFar ? word1 : word0 >> kUnitShift;
    const uint subBits = coarse ? 0u : s.bitsPerState << (2u * (s.level - kCoarseLevel));
    const uvec2 source = addressPlus(push.data, s.dataOffset);
    const uvec2 target = elementAddress(micromapUnits(push.micromap, push.triangleCount), unit, kDataUnitBytes);

    if (live && coarse) {
        const uint bit = (sub >> (2u * (kCoarseLevel - s.level))) * s.bitsPerState;
        const uint state = loadBytes(addressPlus(source, bit >> 3u), 1u) >> (bit & 7u) & ((1u << s.bitsPerState) - 1u);
        atomicOr(masks[local], state << (2u * sub));
    } else if (live && subBits < 32u) {
        const uint bit = sub * subBits;
        const uint ones = (1u << subBits) - 1u;
        const uint bytes = (subBits + 7u) >> 3u;
        const uint value = loadBytes(addressPlus(source, bit >> 3u), bytes) >> (bit & 7u) & ones;
        const uint opaque = s.bitsPerState == 1u ? ones : 0x55555555u & ones;
        atomicOr(smallWords[local * kSmallWords + (bit >> 5u)], value << (bit & 31u));
        atomicOr(masks[local], (value == 0u ? 0u : value == opaque ? 1u : kCoarseLook) << (2u * sub));
    } else if (live) {
        const uint words = subBits >> 5u;
        const uvec2 from = addressPlus(source, sub * words * 4u);
        Words to = Words(addressPlus(target, sub * words * 4u));
        const uint opaque = s.bitsPerState == 1u ? ~0u : 0x55555555u;
        uint any = 0u;
        uint all = ~0u;
        for (uint i = 0u; i < words; ++i) {
            const uint value = loadBytes(addressPlus(from, i * 4u), 4u);
            to.w[i] = value;
            any |= value;
            all &= value;
        }
        atomicOr(masks[local], (any == 0u ? 0u : any == opaque && all == opaque ? 1u : kCoarseLook) << (2u * sub));
    }
    barrier();

    if (live && !coarse && subBits < 32u && sub < subBits * kSubTriangles / 32u)
        Words(target).w[sub] = smallWords[local * kSmallWords + sub];
    if (live && sub == 0u) {
        const uint mask = masks[local];
        Words record = recordOf(triangle);
        // No entry says "look": transparent and opaque have the same numbers in both encodings.
        const bool fold = coarse || (mask & 0xaaaaaaaau) == 0u;
        if (fold)
            record.w[0] = kKindInline;
        if (fold || (word0 & kKindMask) != kKindFar)
            record.w[1] = mask;
    }
}
