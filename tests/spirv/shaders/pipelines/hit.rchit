// SPDX-License-Identifier: Apache-2.0
// Reads the custom index in a ray tracing stage.
#version 460
#extension GL_EXT_ray_tracing : require
layout(location = 0) rayPayloadInEXT uint payload;
void main() { payload = gl_InstanceCustomIndexEXT + gl_InstanceID; }
