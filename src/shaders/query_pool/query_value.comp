// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Writes the value of one query about a micromap (layer/query_pool/query_pool.cpp).
#include "shared.h"
#include "records.h"
#include "push.h"
#include "base/memory.glsl"
#include "base/micromap_layout.glsl"

layout(local_size_x = 1) in;

layout(push_constant, std430) uniform Push
{
    QueryValuePush push;
};

void main()
{
    Words header = Words(push.micromap);
    uvec2 bytes = uvec2(kMicromapHeaderWords * 4u, 0u);
    const bool holdsHeader = push.micromapBytes.y != 0u || push.micromapBytes.x >= kMicromapHeaderWords * 4u;
    if (holdsHeader && header.w[kMicromapHeaderMagic] == kMicromapMagic)
        bytes = micromapBytes(header.w[kMicromapHeaderTriangles], header.w[kMicromapHeaderUnits]);
    if (bytes.y > push.micromapBytes.y || (bytes.y == push.micromapBytes.y && bytes.x > push.micromapBytes.x))
        bytes = push.micromapBytes;
    const uint kind = push.kind & 3u;
    uvec2 value = bytes;
    if (kind == kQueryMicromapSerialized)
        value = addressPlus(bytes, kSerializedMicromapHeaderWords * 4u);
    if ((push.kind & kQueryMarked) != 0u)
        value = marked(value);
    Words target = Words(push.target);
    target.w[0] = value.x;
    target.w[1] = value.y;
}
