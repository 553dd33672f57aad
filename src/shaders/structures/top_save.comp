// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Serializes a top-level acceleration structure: its instances as the application wrote them, and one handle per instance.
// The driver's serialized data would hold slots of this device.
#include "shared.h"
#include "opacity.h"
#include "records.h"
#include "base/memory.glsl"
#include "base/structure_descriptor.glsl"
#include "serialized.glsl"
#include "instance.glsl"
#include "push.h"

layout(local_size_x = 64) in;

layout(push_constant, std430) uniform Push
{
    TopSavePush push;
};

void main()
{
    const uint me = gl_WorkGroupID.x * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
    const uint all = gl_NumWorkGroups.x * gl_WorkGroupSize.x;
    Descriptor descriptor = loadDescriptor(push.descriptor);
    uint offset = unitsBetween(push.begin, descriptor.tail);
    if (descriptor.kind != kDescriptorTop || !fits(offset, descriptor.units, push.structureUnits)) {
        descriptor.count = 0u;
        offset = 0u;
    }
    const uint block = (descriptor.count + 1u) / 2u + kSerializedHeaderUnits;
    const uint tailUnits = descriptor.count * kInstanceUnits;
    const uint total = block + kBlockUnits + tailUnits;
    if (total > push.capacity) {
        if (me == 0u)
            gpuError(push.root, kGpuErrorMemoryTooSmall);
        return;
    }
    Words b = Words(unitAddress(push.blob, block));
    if (push.pass == 0u) {
        if (me != 0u)
            return;
        Words header = Words(push.blob);
        Words fallback = Words(push.fallback);
        for (uint w = 0u; w < 8u; ++w)
            header.w[w] = w < 4u ? fallback.w[w] : fallback.w[w] ^ kCompatibilityWord;
        const uvec2 totalBytes = bytesOfUnits(total);
        const uvec2 size = bytesOfUnits(topLevelSizeUnits(max(offset + tailUnits, push.leastUnits)));
        header.w[8] = totalBytes.x;
        header.w[9] = totalBytes.y;
        header.w[10] = size.x;
        header.w[11] = size.y;
        header.w[12] = descriptor.count;
        header.w[13] = 0u;
        for (uint w = 0u; w < 16u; ++w)
            b.w[w] = 0u;
        b.w[kBlockHeaderMagic] = kBlockMagic;
        b.w[kBlockHeaderVersion] = kBlockVersion;
        b.w[kBlockHeaderKind] = kDescriptorTop;
        b.w[kBlockHeaderCount] = descriptor.count;
        b.w[kBlockHeaderTailUnits] = tailUnits;
        return;
    }
    Units from = Units(descriptor.tail);
    Units to = Units(unitAddress(push.blob, block + kBlockUnits));
    Words handles = Words(addressPlus(push.blob, kSerializedHeaderWords * 4u));
    uint sum = 0u;
    for (uint i = me; i < descriptor.count; i += all) {
        for (uint u = 0u; u < kInstanceUnits; ++u) {
            const uint at = i * kInstanceUnits + u;
            uvec4 value = from.at[at];
            if (u == kLastUnit) {
                value.xy = originalWords(push.root, value.xy);
                handles.w[2u * i] = value.z;
                handles.w[2u * i + 1u] = value.w;
            }
            to.at[at] = value;
            sum += checkOf(value, at);
        }
    }
    atomicAdd(b.w[kBlockHeaderChecksum], sum);
}
