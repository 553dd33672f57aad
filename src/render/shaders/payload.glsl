// SPDX-License-Identifier: Apache-2.0
// The payload of the ray tracing pipeline. One payload for both kinds of rays, since both use the same any-hit and miss shader.
#include "hit.glsl"

struct Payload {
    Hit hit;         // of a shadow ray: only whether it met something
    uint candidates; // only with kCount
};
