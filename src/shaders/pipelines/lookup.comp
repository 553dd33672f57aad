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
layout(buffer_reference, std430, buffer_reference_align = 8) readonly buffer Pairs { Eight at[]; };

// Records by their members (core/records.h), so that only the words that are needed are loaded.
struct InstanceRecord {
    uint customIndex;
    uint opaqueBoxes;
    Quads geometries;
};
struct GeometryRecord {
    uint triangles;
    uint unused;
    Quads units;
};
layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer Instances { InstanceRecord at[]; };
layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer Geometries { GeometryRecord at[]; };

// Where the instance record of a slot is: in this page, with this index. Most devices never have more than the first
// slots, which no load leads to.
uvec2 vellumPage(const in uint slot)
{
    if (slot < kFirstSlots)
        return uvec2(kFirstSlotsLow, kFirstSlotsHigh);
    const uint page = (slot >> kSlotsPerPageLog2) & (kDirectoryPages - 1u);
    return uvec2(Pairs(uvec2(kRootLow, kRootHigh)).at[kRootHeaderWords / 2u + page]);
}

uint vellumInPage(const in uint slot)
{
    return slot < kFirstSlots ? slot : slot & ((1u << kSlotsPerPageLog2) - 1u);
}

// State of the micro-triangle at barycentrics uv.
//   geometries  address of the BLAS's geometry records
//   geometry    index of the geometry
//   triangle    index of the triangle's record, from the same address on
uint vellumState(const in uvec2 geometries, const in uint geometry, const in uint triangle, const in vec2 uv)
{
    const uvec2 record = uvec2(Pairs(geometries).at[triangle]);
    const uint kind = record.x & kKindMask;
    const bool far = kind == kKindFar;
    const uint n = far ? (record.x >> kUnitShift) & kKindMask : kind - kKindData;
    const bool upperHalf = n == kKindUpperHalf;
    const uint level = kind == kKindInline ? kCoarseLevel : upperHalf ? 3u : 3u + (n >> 1u);

    // One curve index serves both: its leading digits are the index at the coarse level.
    const uint index = curveIndex(uv.x, uv.y, level);
    const uint coarse = (record.y >> (2u * (index >> (2u * (level - kCoarseLevel))))) & 3u;
    uint state = coarse;
    // One way out, for LLVM 21 behind lavapipe 26: with a return here, and loops in the body of the query's loop
    // (Shapes.*/16), it zeroes the register of a -1 that the driver's traversal compares with, brings it back only on the
    // way past the load, and the traversal runs off.
    if (far || (kind != kKindInline && coarse >= kCoarseLook)) {
        const uint bits = 1u + (n & 1u);
        const uint bit = index * bits + (upperHalf ? kDataUnitBytes * 4u : 0u);
        const uint unit = (far ? record.y : record.x >> kUnitShift) + (bit >> 7u);
        const uvec2 units = uvec2(Geometries(geometries).at[geometry].units);
        const uint word = Quads(units).at[unit][(bit >> 5u) & 3u];
        state = (word >> (bit & 31u)) & ((1u << bits) - 1u);
    }
    return state;
}

// kHit* of a triangle candidate that the driver holds for non-opaque. rayFlags are the application's.
uint vellumResolve(const in uint slot, const in uint geometry, const in uint primitive, const in vec2 uv,
                   const in uint rayFlags)
{
    const uvec2 tagged = uvec2(Instances(vellumPage(slot)).at[vellumInPage(slot)].geometries);
    const uint flags = (tagged.x & kInstanceFlagsMask) << kInstanceFlagsShift;
    const uvec2 geometries = uvec2(tagged.x & ~kInstanceFlagsMask, tagged.y);
    uint state = kStateNone;
    bool opaque = false;
    // Without geometry records there are no flags either: the driver has seen the instance's FORCE flags and the geometry's,
    // and the candidate already is their result.
    if ((geometries.x | geometries.y) != 0u) {
        const uint word = Geometries(geometries).at[geometry].triangles;
        const uint triangles = word >> kGeometryTrianglesShift;
        opaque = (word & kGeometryRecordOpaque) != 0u;
        if (triangles != 0u && (flags & kInstanceDisableMicromaps) == 0u)
            state = vellumState(geometries, geometry, triangles + primitive, uv);
    }
    return resolveHit(state, opaque, flags, rayFlags);
}

// The application's instanceCustomIndex.
uint vellumCustomIndex(const in uint slot)
{
    return Instances(vellumPage(slot)).at[vellumInPage(slot)].customIndex & 0xffffffu;
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
    const uint word = Instances(vellumPage(slot)).at[vellumInPage(slot)].customIndex;
    if ((word & kInstanceBoxes) == 0u)
        return false;
    const uint flags = ((word >> kInstanceBoxFlagsShift) & kInstanceFlagsMask) << kInstanceFlagsShift;
    const uint opaque = Instances(vellumPage(slot)).at[vellumInPage(slot)].opaqueBoxes;
    return resolveHit(kStateNone, ((opaque >> (geometry & 31u)) & 1u) != 0u, flags, rayFlags) == kHitIgnored;
}

void main() {}
