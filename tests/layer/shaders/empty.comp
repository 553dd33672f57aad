// SPDX-License-Identifier: Apache-2.0
#version 460
// Needs nothing, and traces no rays.
layout(local_size_x = 1) in;

void main()
{
}
