// SPDX-License-Identifier: Apache-2.0
// Access to memory by 64-bit addresses held as two words, so that no 64-bit integers are needed.
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require

layout(buffer_reference, std430, buffer_reference_align = 4) buffer Words { uint w[]; };
// Words for a reader outside the invocation that wrote them: memoryBarrierBuffer() orders only coherent stores.
layout(buffer_reference, std430, buffer_reference_align = 4) coherent buffer CoherentWords { uint w[]; };

// `other`, an address that can be read, in place of a null address that no active invocation loads from. Lavapipe 26 loads
// from an address that is the same for all invocations even if none is active: in a branch that is not taken, and once more
// when a loop has ended.
uvec2 readable(uvec2 address, uvec2 other)
{
    return (address.x | address.y) == 0u ? other : address;
}

uvec2 addressPlus(uvec2 address, uint bytes)
{
    uint carry;
    const uint low = uaddCarry(address.x, bytes, carry);
    return uvec2(low, address.y + carry);
}

// address + index * stride, in 64 bits
uvec2 elementAddress(uvec2 address, uint index, uint stride)
{
    uint high, low;
    umulExtended(index, stride, high, low);
    const uvec2 sum = addressPlus(address, low);
    return uvec2(sum.x, sum.y + high);
}

// Reads `bytes` (1..4) bytes at any address; the rest of the result is 0. Reads only words that hold one of these bytes, so
// that the last byte of a buffer can be read.
uint loadBytes(uvec2 address, uint bytes)
{
    const uint misalignment = address.x & 3u;
    Words words = Words(uvec2(address.x & ~3u, address.y));
    uint value = words.w[0] >> (misalignment * 8u);
    if (misalignment + bytes > 4u)
        value |= words.w[1] << ((4u - misalignment) * 8u);
    return bytes >= 4u ? value : value & ((1u << (bytes * 8u)) - 1u);
}
