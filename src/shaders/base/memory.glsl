// SPDX-License-Identifier: Apache-2.0
// Access to memory by 64-bit addresses held as two words, so that no 64-bit integers are needed.
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require

layout(buffer_reference, std430, buffer_reference_align = 4) buffer Words { uint w[]; };
// Words for a reader outside the invocation that wrote them: memoryBarrierBuffer() orders only coherent stores.
layout(buffer_reference, std430, buffer_reference_align = 4) coherent buffer CoherentWords { uint w[]; };

// Two adjacent words are declared as an address: a CPU driver loads and stores each member of a vector lane by lane, and an
// address at once. The type that it points to is aligned to 8 bytes because glslang uses that as the alignment of the access,
// which must not be less than 8 (VUID-StandaloneSpirv-PhysicalStorageBuffer64-06314). The address is in a structure because
// glslang declares RuntimeDescriptorArray for a runtime array of addresses, and devices need not support that.
layout(buffer_reference, std430, buffer_reference_align = 8) buffer Eight { uint w[]; };
struct Pair {
    Eight words;
};
layout(buffer_reference, std430, buffer_reference_align = 8) buffer Pairs { Pair at[]; };
// Pairs that the host may change while shaders read them.
layout(buffer_reference, std430, buffer_reference_align = 8) readonly volatile buffer ChangingPairs { Pair at[]; };

uvec2 pairAt(uvec2 address, uint i)
{
    return uvec2(Pairs(address).at[i].words);
}

void storePair(uvec2 address, uint i, uvec2 pair)
{
    Pairs(address).at[i].words = Eight(pair);
}

uvec2 changingPairAt(uvec2 address, uint i)
{
    return uvec2(ChangingPairs(address).at[i].words);
}

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
