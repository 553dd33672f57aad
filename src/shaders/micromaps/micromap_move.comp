// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Serializes, deserializes or copies a micromap (layouts: core/records.h). Only bytes in use are read and written: a handle
// may be far larger than what was built there, and other data may follow it.
#include "shared.h"
#include "curve.h"
#include "records.h"
#include "compaction.h"
#include "push.h"
#include "base/memory.glsl"
#include "base/micromap_layout.glsl"
#include "base/structure_descriptor.glsl"

layout(local_size_x = 64) in;

layout(push_constant, std430) uniform Push
{
    MicromapMovePush push;
};

layout(buffer_reference, std430, buffer_reference_align = 16) buffer Quads { uvec4 at[]; };

const uint kSerializedHeaderUnits = kSerializedMicromapHeaderWords / 4u;
const uint kMicromapHeaderUnits16 = kMicromapHeaderWords / 4u;

bool less(uvec2 a, uvec2 b)
{
    return a.y < b.y || (a.y == b.y && a.x < b.x);
}

const uint kNoError = ~0u; // not a kGpuError*

uint headerError(uvec2 header, out uvec2 bytes)
{
    Words words = Words(header);
    bytes = micromapBytes(words.w[kMicromapHeaderTriangles], words.w[kMicromapHeaderUnits]);
    return words.w[kMicromapHeaderMagic] != kMicromapMagic ? kGpuErrorMicromapNotBuilt : kNoError;
}

uint mode;

void copyUnits(uvec2 from, uvec2 to, uint count, uint records, uint units)
{
    // The invocations take turns, unit by unit.
    Quads source = Quads(from);
    Quads target = Quads(to);
    for (uint i = gl_WorkGroupID.y * gl_NumWorkGroups.x * gl_WorkGroupSize.x + gl_GlobalInvocationID.x; i < count;
         i += push.invocations) {
        uvec4 v = source.at[i];
        if (mode == kMoveDeserialize && i >= kMicromapHeaderUnits16 && i < kMicromapHeaderUnits16 + records)
            v = uvec4(trustedRecord(v.xy, units), trustedRecord(v.zw, units));
        target.at[i] = v;
    }
}

bool holdsMicromapData()
{
    if (less(push.serializedBytes, uvec2((kSerializedMicromapHeaderWords + kMicromapHeaderWords) * 4u, 0u)))
        return false;
    Words words = Words(push.serialized);
    return words.w[kSerializedLayoutUuid] == kMicromapLayoutUuid0 &&
           words.w[kSerializedLayoutUuid + 1u] == kMicromapLayoutUuid1 &&
           words.w[kSerializedLayoutUuid + 2u] == kMicromapLayoutUuid2;
}

// The error of the micromap that is copied, or kNoError. `bytes`: its bytes in use.
uint errorOfSource(uvec2 header, out uvec2 bytes)
{
    bytes = uvec2(0u);
    if (mode == kMoveDeserialize) {
        if (!holdsMicromapData() ||
            Words(push.serialized).w[kSerializedLayoutUuid + 3u] != kMicromapLayoutVersion ||
            headerError(header, bytes) != kNoError ||
            less(push.serializedBytes, addressPlus(bytes, kSerializedMicromapHeaderWords * 4u)))
            return kGpuErrorMicromapData;
        return kNoError;
    }
    const uvec2 readable = mode == kMoveCopy ? push.serializedBytes : push.micromapBytes;
    if (less(readable, uvec2(kMicromapHeaderWords * 4u, 0u)) || headerError(header, bytes) != kNoError ||
        less(readable, bytes))
        return kGpuErrorMicromapNotBuilt;
    return kNoError;
}

// The error of the target of a copy of so many bytes, or kNoError.
uint errorOfTarget(uvec2 bytes)
{
    if (mode == kMoveSerialize)
        return less(push.serializedBytes, addressPlus(bytes, kSerializedMicromapHeaderWords * 4u))
                   ? kGpuErrorMicromapTooSmall
                   : kNoError;
    // This comes before the check of the size: the header of a target that is too small is written, and must not be part of
    // the source. VUID-VkCopyAccelerationStructureInfoKHR-dst-07791 is about the memory that is accessed.
    const bool tooSmall = less(push.micromapBytes, bytes);
    if (mode == kMoveCopy && (less(addressMinus(push.micromap, push.serialized), bytes) ||
                              less(addressMinus(push.serialized, push.micromap), tooSmall ? push.micromapBytes : bytes)))
        return kGpuErrorMicromapOverlap;
    return tooSmall ? kGpuErrorMicromapTooSmall : kNoError;
}

void main()
{
    // A compaction has written the micromap, or failed.
    if ((push.compaction.x | push.compaction.y) != 0u &&
        Words(readable(push.compaction, push.micromap)).w[kCompactionOutcome] != kCompactionLeft)
        return;
    mode = push.mode & ~(kMoveMarked | kMoveOnlyMicromaps);
    const uint me = gl_WorkGroupID.y * gl_NumWorkGroups.x * gl_WorkGroupSize.x + gl_GlobalInvocationID.x;
    const uvec2 header = mode == kMoveDeserialize ? addressPlus(push.serialized, kSerializedMicromapHeaderWords * 4u)
                         : mode == kMoveCopy      ? push.serialized
                                                  : push.micromap;
    if ((push.mode & kMoveOnlyMicromaps) != 0u && !holdsMicromapData())
        return;
    // Memory that is too small for a header holds no micromap, and may end before the magic number does.
    const bool tiny = less(push.micromapBytes, uvec2(kMicromapHeaderWords * 4u, 0u));
    uvec2 bytes;
    uint error = errorOfSource(header, bytes);
    if (error == kNoError)
        error = errorOfTarget(bytes);
    if (error != kNoError) {
        if (me == 0u) {
            gpuError(push.root, error);
            // A target that overlaps the source is not changed: it may be the source.
            if (mode != kMoveSerialize && error != kGpuErrorMicromapOverlap && !tiny)
                Words(push.micromap).w[kMicromapHeaderMagic] = 0u;
        }
        return;
    }
    const uint triangles = Words(header).w[kMicromapHeaderTriangles];
    const uint units = Words(header).w[kMicromapHeaderUnits];
    const uint records = (triangles >> 1u) + (triangles & 1u);
    const uint count = bytes.x >> 4u | bytes.y << 28u;
    if (mode != kMoveSerialize) {
        copyUnits(header, push.micromap, count, records, units);
        return;
    }
    const uvec2 whole = addressPlus(bytes, kSerializedMicromapHeaderWords * 4u);
    copyUnits(push.micromap, addressPlus(push.serialized, kSerializedMicromapHeaderWords * 4u), count, records, units);
    if (me == 0u) {
        Quads target = Quads(push.serialized);
        target.at[0] = push.driverUuid;
        target.at[1] =
            uvec4(kMicromapLayoutUuid0, kMicromapLayoutUuid1, kMicromapLayoutUuid2, kMicromapLayoutVersion);
        uvec2 deserialized = bytes;
        if ((push.mode & kMoveMarked) != 0u)
            deserialized = marked(bytes);
        target.at[2] = uvec4(whole, deserialized);
        target.at[3] = uvec4(0u);
    }
}
