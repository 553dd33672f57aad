// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Copies the first words of serialized data, before it is deserialized, and states what the target will hold.
#include "shared.h"
#include "findings.h"
#include "records.h"
#include "push.h"
#include "base/memory.glsl"

layout(local_size_x = 64) in;

layout(push_constant, std430) uniform Push
{
    DeserializedWordsPush push;
};

void main()
{
    Words source = Words(push.source);
    CoherentWords target = CoherentWords(push.target);
    for (uint i = gl_LocalInvocationIndex; i < push.count; i += gl_WorkGroupSize.x)
        target.w[kDeserializedWordsAt + i] = source.w[i];
    memoryBarrierBuffer();
    barrier();
    if (gl_LocalInvocationIndex == 0u) {
        memoryBarrierBuffer();
        atomicAdd(target.w[0], 1u);
        // Only data of the layer's own micromaps shows how many triangles they have.
        const uint header = kSerializedMicromapHeaderWords;
        const bool isMicromap = push.count >= header + kMicromapHeaderWords &&
                                source.w[kSerializedLayoutUuid] == kMicromapLayoutUuid0 &&
                                source.w[kSerializedLayoutUuid + 3u] == kMicromapLayoutVersion &&
                                source.w[header + kMicromapHeaderMagic] == kMicromapMagic;
        CoherentWords record = CoherentWords(push.record);
        record.w[0] = isMicromap ? kRecordMicromap : kRecordUnknown;
        if (isMicromap) {
            record.w[1] = source.w[header + kMicromapHeaderFlags];
            record.w[2] = source.w[header + kMicromapHeaderTriangles];
        }
    }
}
