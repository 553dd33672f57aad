// SPDX-License-Identifier: Apache-2.0
// Marks that an instruction was executed: linked into the application's shaders by validation (src/spirv/sites/trace_sites.h).
#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require

layout(local_size_x = 1) in;

// Address of the marks. The linker turns it into ordinary constants.
layout(constant_id = 0) const uint kMarksLow = 0u;
layout(constant_id = 1) const uint kMarksHigh = 0u;

layout(buffer_reference, std430, buffer_reference_align = 4) buffer Marks { uint w[]; };

void vellumTraced(const in uint mark)
{
    Marks(uvec2(kMarksLow, kMarksHigh)).w[mark] = 1u;
}

void main()
{
    vellumTraced(0u);
}
