// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Converts the header of a serialized micromap between the driver's form and the application's. The driver expects the size
// that it has written; applications create a structure of the size that they read, which must be marked for micromaps
// (kMicromapSizeMark). The driver's size is kept in a trailer. Data without a trailer is not changed.
#include "shared.h"
#include "records.h"
#include "push.h"
#include "base/memory.glsl"
#include "base/micromap_layout.glsl"

layout(local_size_x = 1) in;

layout(push_constant, std430) uniform Push
{
    SerializedHeaderPush push;
};

// Words of the header, after two UUIDs: 64-bit sizes.
const uint kTotal = 8u;
const uint kDeserialized = 10u;
const uint kHeaderBytes = 48u;

// Returns whether `bytes` can be the end of the driver's data, and the buffer can hold a trailer there.
bool fits(Words header, uint bytes)
{
    return header.w[kTotal + 1u] == 0u && bytes >= kHeaderBytes && bytes % 4u == 0u &&
           bytes <= 0xffffffffu - kSerializedTrailerBytes && bytes + kSerializedTrailerBytes <= push.readable;
}

bool isTrailer(Words trailer)
{
    return trailer.w[2] == kSerializedTrailerMagic0 && trailer.w[3] == kSerializedTrailerMagic1;
}

void main()
{
    Words header = Words(push.data);
    const bool open = push.mode == kSerializedOpen;
    const uint total = header.w[kTotal];
    const uint bytes = open ? total - min(total, kSerializedTrailerBytes) : total;
    if (!fits(header, bytes))
        return;
    Words trailer = Words(addressPlus(push.data, bytes));
    if (push.mode == kSerializedSeal) {
        trailer.w[0] = header.w[kDeserialized];
        trailer.w[1] = header.w[kDeserialized + 1u];
        trailer.w[2] = kSerializedTrailerMagic0;
        trailer.w[3] = kSerializedTrailerMagic1;
    } else if (!isTrailer(trailer)) {
        return;
    }
    const uvec2 own = uvec2(trailer.w[0], trailer.w[1]);
    const uvec2 size = open ? own : marked(own);
    header.w[kDeserialized] = size.x;
    header.w[kDeserialized + 1u] = size.y;
    header.w[kTotal] = open ? bytes : bytes + kSerializedTrailerBytes;
}
