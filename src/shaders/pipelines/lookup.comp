// SPDX-License-Identifier: Apache-2.0
// Looks up an opacity state by a slot: the functions that are linked into the application's shaders
// (src/spirv/module/link.h). main() and everything that the linked functions do not reach are not linked.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require

#include "curve.h"
#include "opacity.h"
#include "records.h"

layout(local_size_x = 1) in;

// Addresses of the root table and of its first slots. The linker turns them into ordinary constants.
layout(constant_id = 0) const uint kRootLow = 0u;
layout(constant_id = 1) const uint kRootHigh = 0u;
layout(constant_id = 2) const uint kFirstSlotsLow = 0u;
layout(constant_id = 3) const uint kFirstSlotsHigh = 0u;

// Everything is indexed in whole records, so that no byte offset has to fit 32 bits. Data units are read word by word
// but addressed by unit.
layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer Quads { uvec4 at[]; };

// Two adjacent words are declared as an address, even if they are not one: a CPU driver loads each member lane by lane,
// and an address by one load. glslang uses the alignment of the type that it points to as that of the load. The address
// is in a structure because glslang declares RuntimeDescriptorArray for a runtime array of addresses, and devices need
// not support that.
layout(buffer_reference, std430, buffer_reference_align = 8) readonly buffer Eight { uint w[]; };
struct Pair {
    Eight words;
};
layout(buffer_reference, std430, buffer_reference_align = 8) readonly buffer Pairs { Pair at[]; };

// Records by their members (core/records.h), so that only the words that are needed are loaded.
layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer Instance
{
    Eight words;
    Quads geometries;
};
layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer InstanceWords { uint w[3]; };
layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer Geometry
{
    uint triangles;
    uint unused;
    Quads units;
};
layout(buffer_reference, std430, buffer_reference_align = 4) readonly buffer Word { uint w; };

// Address of a slot's instance record. Most devices never use more than the first slots, whose address is a constant.
// Neither the root nor a page crosses a multiple of 2^32. The address of a page in the root is that of slot 0, as if the page
// began with the records of all slots before its own.
uvec2 vellumRecord(const in uint slot)
{
    const uint number = slot & kCustomIndexMask;
    uvec2 base = uvec2(kFirstSlotsLow, kFirstSlotsHigh);
    if (number >= kFirstSlots) {
        const uint page = number >> kSlotsPerPageLog2;
        base = uvec2(Pairs(uvec2(page * 8u + kRootHeaderWords * 4u + kRootLow, kRootHigh)).at[0].words);
    }
    return uvec2(base.x + (number << kInstanceRecordLog2), base.y);
}

// An address plus a 32-bit offset. GPU compilers generate less code for it than for an index, which they sign-extend to 64
// bits.
uvec2 vellumPlus(const in uvec2 address, const in uint low)
{
    const uint sum = address.x + low;
    return uvec2(sum, address.y + (sum < low ? 1u : 0u));
}

const uint kCoarseShift = 2u * (kMaxSubdivisionLevel - kCoarseLevel) - 1u;             // of the index, to twice the coarse one
const uint kCoarseBits = 2u * ((1u << (2u * kCoarseLevel)) - 1u);                      // of the coarse index, times two
const uint kKindFinest4 = kKindData + 2u * (kMaxSubdivisionLevel - kCoarseLevel) - 1u; // 4-state data of the highest level

// The instance record of a slot.
uvec4 vellumInstance(const in uint slot)
{
    const uvec2 record = vellumRecord(slot);
    return uvec4(uvec2(Instance(record).words), uvec2(Instance(record).geometries));
}

// kHit* of a triangle candidate that is non-opaque for the driver. rayFlags are the application's.
// A driver compiles this for each any-hit shader, and a branch takes it longer than instructions: mix() selects without one.
// A single return, because of LLVM 21 in lavapipe 26: with a return after the coarse mask, and loops in the body of the
// query's loop (Shapes.*/16), it zeroes the register of a -1 that the driver's traversal compares with, restores it only on
// the path that skips the load, and the traversal does not end.
uint vellumResolve(const in uvec4 instance, const in uint geometry, const in uint primitive, const in vec2 uv,
                   const in uint rayFlags)
{
    // Also for the only geometry. The shift does not overflow: 2^28 records would take 4 GiB.
    const uvec2 geometryRecord = vellumPlus(instance.zw, geometry << 4u);
    uint word = instance.y;
    if ((word & kManyGeometries) != 0u)
        word &= Geometry(geometryRecord).triangles;
    const uint triangles = word >> kGeometryTrianglesShift;
    uint state = (word & kGeometryRecordOpaque) != 0u ? kStateOpaque : kStateNone;
    if (triangles != 0u) {
        // Loaded early, so that it does not wait for the triangle's record.
        const uvec2 units = uvec2(Geometry(geometryRecord).units);
        const uvec2 record = uvec2(Pairs(instance.zw).at[triangles + primitive].words);
        // The index does not depend on the record, and is computed while that is loaded. Its leading digits are the
        // index at every level: the coarse level and the micromap's.
        const uint index = finestCurveIndex(uv.x, uv.y);
        state = (record.y >> ((index >> kCoarseShift) & kCoarseBits)) & 3u;
        const uint kind = record.x & kKindMask;
        // The coarse mask answers, unless the kind is greater than this.
        const uint answered = state < kCoarseLook ? kKindFar - 1u : kKindInline;
        if (kind > answered) {
            const bool far = kind == kKindFar;
            const uint near = record.x >> kUnitShift;
            const uint n = mix(kind, (near & kKindMask) + kKindData, far);
            const uint fourState = ~n & 1u;
            // In 4-state data one bit below the level remains, where the lower bit of the state is.
            const uint digits = (index << 1u) >> (kKindFinest4 - n);
            const uint farByte = (record.x >> (kFarByteShift - 3u)) & (kFarByteMask << 3u); // its first bit
            const uint bit = (digits & ~fourState) + mix(0u, farByte, far);
            const uint unit = mix(near, record.y, far) + (bit >> 7u);
            const uvec2 base = uvec2(units.x, units.y + (unit >> 28u));
            const uint data = Word(vellumPlus(base, (unit << 4u) | ((bit >> 3u) & 12u))).w;
            state = (data >> (bit & 31u)) & (1u + 2u * fourState);
        }
        state &= ~((rayFlags & kRayForce2State) >> 9u); // its bit 1, which unknown states have
    }
    return hitOfRay(hitInTable(instance.x, state), rayFlags);
}

// The application's instanceCustomIndex.
uint vellumIndexOf(const in uvec4 instance)
{
    return instance.x & kCustomIndexMask;
}

uint vellumCustomIndex(const in uint slot)
{
    return InstanceWords(vellumRecord(slot)).w[0] & kCustomIndexMask;
}

// Returns whether CullNoOpaque culls a box; of the flags that are hidden from the driver, only this one culls boxes. False if the
// layer does not know the build of the boxes; then the any-hit shader, which runs for non-opaque boxes, decides.
bool vellumCullsBox(const in uint slot, const in uint geometry, const in uint rayFlags)
{
    if ((rayFlags & kRayCullNoOpaque) == 0u)
        return false;
    const uint word = InstanceWords(vellumRecord(slot)).w[0];
    if ((word & kInstanceBoxes) == 0u)
        return false;
    const uint flags = ((word >> kInstanceBoxFlagsShift) & kInstanceFlagsMask) << kInstanceFlagsShift;
    const uint opaque = InstanceWords(vellumRecord(slot)).w[2];
    return resolveHit(kStateNone, ((opaque >> (geometry & 31u)) & 1u) != 0u, flags, rayFlags) == kHitIgnored;
}

void main() {}
