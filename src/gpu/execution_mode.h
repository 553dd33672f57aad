// SPDX-License-Identifier: Apache-2.0
// Changes to compiled shaders: the execution mode OpacityMicromapIdKHR and the capability of its ray flag, for which
// compilers are too old, and specialization constants made literal.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace vellum::gpu
{

enum class Mode { Absent, False, True, Specialized, Computed };

// The module with the execution mode; Specialized: by the constant with that id, which is false; Computed: where that
// constant is true and that with the next id is not, both of which are false. It must have one entry point, a bool type
// and debug names.
std::vector<uint32_t> withMode(std::span<const uint32_t> words, Mode mode, uint32_t specId = 0);

// Another entry point of a module, which is not used. Empty: it does nothing. Shared: both entry points call the same
// functions. Empty, SharedBefore: it comes first and has the lower id; SharedAfter: it comes second, with the higher.
enum class OtherEntry { None, Empty, SharedBefore, SharedAfter };

// Adds the entry point "other" of the same stage, which declares that mode. The module must be as above.
std::vector<uint32_t> withOtherEntry(std::span<const uint32_t> words, Mode mode, OtherEntry kind);

// Adds the mode, true, if the module has ray queries.
std::vector<uint32_t> withModeWhereNeeded(std::span<const uint32_t> words);

// Adds the capability RayTracingOpacityMicromapEXT, which the ray flag ForceOpacityMicromap2State needs, even if it is
// only set at run time.
std::vector<uint32_t> withMicromapFlag(std::span<const uint32_t> words);

// Adds the capability RayTraversalPrimitiveCullingKHR, which the ray flags SkipTrianglesKHR and SkipAABBsKHR need.
std::vector<uint32_t> withPrimitiveCulling(std::span<const uint32_t> words);

// The 32-bit specialization constant with that id is an ordinary constant of that value.
std::vector<uint32_t> withLiteral(std::span<const uint32_t> words, uint32_t specId, uint32_t value);

// Ray flags of ray queries and traced rays are signed integers, which SPIR-V allows and compilers of GLSL never write:
// constants of such a type, or a bitcast. The module must have that type.
std::vector<uint32_t> withSignedFlags(std::span<const uint32_t> words);

// Ray flags that are no constants are the result of an OpSelect of two constants instead: `first` where they equal it,
// else `second`. The module must have a bool type and flags that are unsigned.
std::vector<uint32_t> withSelectedFlags(std::span<const uint32_t> words, uint32_t first, uint32_t second);

} // namespace vellum::gpu
