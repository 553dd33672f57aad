// From a slot to an opacity state: the functions that are linked into the application's shaders (src/spirv/module/link.h).
// main() and everything the linked functions do not reach are left behind.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require

#include "curve.h"
#include "opacity.h"
#include "ray_flags.h"
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

// Two words that lie together are declared as an address, whether they are one or not: a driver for the CPU loads each
// member lane by lane, and an address in one load. What it would be the address of has the alignment that glslang takes for
// that of the load.
layout(buffer_reference, std430, buffer_reference_align = 8) readonly buffer Eight { uint w[]; };
layout(buffer_reference, std430, buffer_reference_align = 8) readonly buffer Pairs { Eight at; };

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

// Where the instance record of a slot is. Most devices never have more than the first slots, which no load leads to. The
// root and pages cross no multiple of 2^32.
uvec2 vellumRecord(const in uint slot)
{
    uint low = kFirstSlotsLow;
    uint high = kFirstSlotsHigh;
    if (slot >= kFirstSlots) {
        const uint page = (slot >> kSlotsPerPageLog2) & (kDirectoryPages - 1u);
        const uvec2 entry = uvec2(Pairs(uvec2(page * 8u + kRootHeaderWords * 4u + kRootLow, kRootHigh)).at);
        low = entry.x;
        high = entry.y;
    }
    return uvec2(low + ((slot & ((1u << kSlotsPerPageLog2) - 1u)) << kInstanceRecordLog2), high);
}

// An address and a sum that the lower word may carry over from. Compilers for GPUs make less of it than of an index, which
// is extended to 64 bits with its sign.
uvec2 vellumPlus(const in uvec2 address, const in uint low, const in uint high)
{
    const uint sum = address.x + low;
    return uvec2(sum, address.y + high + (sum < low ? 1u : 0u));
}

// State of the micro-triangle at barycentrics uv.
//   geometries  address of the BLAS's geometry records
//   triangle    index of the triangle's record, from the same address on
//   geometry    address of the geometry's record
uint vellumState(const in uvec2 geometries, const in uint triangle, const in uvec2 geometry, const in vec2 uv)
{
    // Not where it is needed: so it does not wait for the triangle's record.
    const uvec2 units = uvec2(Geometry(geometry).units);
    const uvec2 record = uvec2(Pairs(vellumPlus(geometries, triangle << 3u, triangle >> 29u)).at);
    const uint kind = record.x & kKindMask;
    const bool far = kind == kKindFar;
    const uint n = far ? ((record.x >> kUnitShift) & kKindMask) + kKindData : kind;
    const bool upperHalf = n == kKindUpperHalf + kKindData;
    // Of kKindInline, 0, too.
    const uint level = upperHalf ? 3u : (n + 2u * kCoarseLevel + 1u) >> 1u;

    // One curve index serves both: its leading digits are the index at the coarse level.
    const uint index = curveIndex(uv.x, uv.y, level);
    const uint coarse = (record.y >> (2u * (index >> (2u * (level - kCoarseLevel))))) & 3u;
    uint state = coarse;
    // One way out, for LLVM 21 behind lavapipe 26: with a return here, and loops in the body of the query's loop
    // (Shapes.*/16), it zeroes the register of a -1 that the driver's traversal compares with, brings it back only on the
    // way past the load, and the traversal runs off.
    if (far || (kind != kKindInline && coarse >= kCoarseLook)) {
        const uint fourState = (n & 1u) ^ 1u;
        const uint bit = (index << fourState) + (upperHalf ? kDataUnitBytes * 4u : 0u);
        const uint unit = (far ? record.y : record.x >> kUnitShift) + (bit >> 7u);
        const uint word = Word(vellumPlus(units, (unit << 4u) | ((bit >> 3u) & 12u), unit >> 28u)).w;
        state = (word >> (bit & 31u)) & (1u + 2u * fourState);
    }
    return state;
}

// kHit* of a triangle candidate that the driver holds for non-opaque, and the application's instanceCustomIndex. rayFlags are
// the application's.
uvec2 vellumResolveIndexed(const in uint slot, const in uint geometry, const in uint primitive, const in vec2 uv,
                           const in uint rayFlags)
{
    const uvec2 record = vellumRecord(slot);
    const uvec2 words = uvec2(Instance(record).words);
    const uvec2 geometries = uvec2(Instance(record).geometries);
    uvec2 ofGeometry = geometries;
    uint word = words.y;
    if ((word & kManyGeometries) != 0u) {
        ofGeometry = vellumPlus(geometries, geometry << 4u, geometry >> 28u);
        word &= Geometry(ofGeometry).triangles;
    }
    const uint triangles = word >> kGeometryTrianglesShift;
    uint state = (word & kGeometryRecordOpaque) != 0u ? kStateOpaque : kStateNone;
    if (triangles != 0u) {
        state = vellumState(geometries, triangles + primitive, ofGeometry, uv);
        if ((rayFlags & kRayForce2State) != 0u)
            state &= 1u;
    }
    return uvec2(hitOfRay(hitInTable(words.x, state), rayFlags), words.x & kCustomIndexMask);
}

uint vellumResolve(const in uint slot, const in uint geometry, const in uint primitive, const in vec2 uv,
                   const in uint rayFlags)
{
    return vellumResolveIndexed(slot, geometry, primitive, uv, rayFlags).x;
}

// The application's instanceCustomIndex.
uint vellumCustomIndex(const in uint slot)
{
    return InstanceWords(vellumRecord(slot)).w[0] & kCustomIndexMask;
}

uint vellumDriverFlags(const in uint f)
{
    return driverRayFlags(f);
}

uint vellumIdleFlags(const in uint f)
{
    return idleRayFlags(f);
}

uint vellumApplicationFlags(const in uint f)
{
    return applicationRayFlags(f);
}

// True if a box is to be culled by the CullNoOpaque flag, the one of those hidden from the driver that culls boxes.
// Where the build of the boxes was not seen nobody can tell here; the any-hit shader, which runs for boxes that are not
// opaque, will.
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
