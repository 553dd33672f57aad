// SPDX-License-Identifier: Apache-2.0
// Addresses of the parts of a micromap (core/records.h). Needs records.h and memory.glsl.

// Record of a micromap triangle.
Words micromapRecord(uvec2 micromap, uint triangle)
{
    return Words(elementAddress(addressPlus(micromap, kMicromapHeaderWords * 4u), triangle, kTriangleRecordWords * 4u));
}

// Address of the data units of a micromap with that many triangles: after the records, which are padded to 16 bytes.
uvec2 micromapUnits(uvec2 micromap, uint triangles)
{
    return elementAddress(addressPlus(micromap, kMicromapHeaderWords * 4u), triangles + 1u >> 1u, 2u * kTriangleRecordWords * 4u);
}

// A record that can be trusted, of a micromap with so many data units: itself, or unknown-opaque where it names data outside
// the micromap.
uvec2 trustedRecord(uvec2 record, uint units)
{
    return staysInside(record.x, record.y, units) ? record : uvec2(kKindInline, ~0u);
}

// Bytes of a micromap that are in use, in 64 bits.
uvec2 micromapBytes(uint triangles, uint units)
{
    const uint pairs = (triangles >> 1u) + (triangles & 1u);
    const uvec2 records = elementAddress(uvec2(kMicromapHeaderWords * 4u, 0u), pairs, 2u * kTriangleRecordWords * 4u);
    return elementAddress(records, units, kDataUnitBytes);
}

// The least size that is kMicromapSizeMark modulo 256 and not below `bytes`.
uvec2 marked(uvec2 bytes)
{
    const uvec2 above = addressPlus(bytes, 255u - kMicromapSizeMark);
    return uvec2((above.x & ~255u) + kMicromapSizeMark, above.y);
}

// Returns whether memory of so many units of 16 bytes holds a micromap. Other memory may hold anything, such as the header of a
// larger micromap.
bool holdsMicromap(uvec2 micromap, uint size)
{
    if (size < kMicromapHeaderWords / 4u)
        return false;
    Words header = Words(micromap);
    const uvec2 bytes = micromapBytes(header.w[kMicromapHeaderTriangles], header.w[kMicromapHeaderUnits]);
    return header.w[kMicromapHeaderMagic] == kMicromapMagic && bytes.y < 16u && (bytes.x >> 4u | bytes.y << 28u) <= size;
}
