// SPDX-License-Identifier: Apache-2.0
// Traces no rays.
#version 460
layout(local_size_x = 8) in;
layout(binding = 1) buffer Out { uint result[]; };
void main() { result[gl_GlobalInvocationID.x] *= 3; }
