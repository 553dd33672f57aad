// SPDX-License-Identifier: Apache-2.0
// A ray tracing stage with nothing to rewrite.
#version 460
#extension GL_EXT_ray_tracing : require
layout(location = 0) rayPayloadInEXT uint payload;
void main() { payload = 0; }
