// SPDX-License-Identifier: Apache-2.0
// FLAGS(ray): the flags that a ray is traced with. RAY_FLAGS=n: this constant; SPEC_FLAGS: a specialization constant; else
// the ray's own.
#ifdef SPEC_FLAGS
layout(constant_id = 0) const uint kFlags = 0u;
// Its name is enough for newer compilers to declare the capability; newer validators miss it once flags are specialized.
const uint kForce2State = gl_RayFlagsForceOpacityMicromap2StateEXT;
#define FLAGS(ray) kFlags
#elif defined(RAY_FLAGS) && (RAY_FLAGS & 0x400) != 0
// Uses the name of the flag, for which newer compilers declare the capability. Newer validators require it where the
// flag is a constant.
#define FLAGS(ray) (uint(RAY_FLAGS) | gl_RayFlagsForceOpacityMicromap2StateEXT)
#elif defined(RAY_FLAGS)
#define FLAGS(ray) uint(RAY_FLAGS)
#else
#define FLAGS(ray) ray.flags
#endif
