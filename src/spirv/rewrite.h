// SPDX-License-Identifier: Apache-2.0
// Rewrites an application's SPIR-V so that it resolves opacity micromaps itself, on a driver that has none.
//
// The rewritten module requires of the layer:
//   - hits on geometry with a micromap reach the shader as non-opaque triangle candidates;
//   - the driver's instanceCustomIndex is a slot of the root table (core/records.h), for every instance;
//   - instances without geometry records keep their flags; the instance record of others holds the application's flags.
//
// The rewritten module needs physical storage buffer addresses (bufferDeviceAddress). It has no extension, capability
// or execution mode of opacity micromaps.
//
// Stages of ray tracing pipelines are rewritten once for modules and once per pipeline that uses micromaps. The former
// only restore the custom index and hide the ray flag that the driver does not know. The latter hide all ray flags that
// concern opacity, and decide hits before the application's shader.
//
// QueriesConsume selects the ray queries that consume micromaps. The driver traverses for the others, which must not
// meet geometry with micromaps (VUID-vkCmdDispatch-micromap-11636); if they do, its hits are non-opaque.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/ray_flags.h"

namespace vellum::spirv
{

// The decision of the code that the rewriter puts before a stage's own.
enum class Prologue {
    None,
    TriangleHits, // any-hit shader of triangle hit groups
    BoxHits,      // any-hit shader of procedural hit groups
    EitherHits,   // any-hit shader of a library, which hit groups of both kinds may name
    BoxCulling    // intersection shader
};

// The ray queries that consume micromaps.
enum class QueriesConsume {
    Always,       // all, as with VK_EXT_opacity_micromap; the execution mode is ignored
    WhereDeclared // those of entry points with the execution mode OpacityMicromapIdKHR and a true operand
};

// How hidden ray flags (core/ray_flags.h) reach the shaders of a ray, in a pipeline that uses micromaps. All stages of
// a pipeline and its libraries have the same.
struct HiddenFlags {
    // Flags in which all rays agree; they are constants of the rewritten shaders. If there are others, all flags are in
    // a prefix of the payload (payload_prefix.h), which intersection shaders cannot read.
    uint32_t fixed = shared::kHiddenRayFlags;
    uint32_t constant = 0; // the fixed flags that are set
    // Payload type (payload_types.h) for a shader that declares no payload. Empty if unknown: it gets the prefix alone.
    std::vector<uint32_t> payload{};
    auto operator<=>(const HiddenFlags &) const = default;
    [[nodiscard]] bool inPayload() const { return fixed != shared::kHiddenRayFlags; }
};

// A stage of a ray tracing pipeline that uses micromaps.
struct PipelineStage {
    std::string_view entryPoint;
    uint32_t executionModel = 0; // SPIR-V's
    Prologue prologue = Prologue::None;
    HiddenFlags hidden;
    bool operator==(const PipelineStage &) const = default;
};

struct RewriteOptions {
    uint64_t rootAddress = 0; // GPU address of the root table, 8-byte aligned
    uint64_t firstSlots = 0;  // GPU address of the instance records of the first kFirstSlots slots, 16-byte aligned
    QueriesConsume queriesConsume = QueriesConsume::Always;
    // Flags that all ray queries of a module pass as constants become constants of the rewritten module. Otherwise they
    // travel as computed ones do.
    bool constantQueryFlags = true;
    // Rewrites for this stage only, and removes all other entry points.
    std::optional<PipelineStage> pipelineStage;
    bool operator==(const RewriteOptions &) const = default;
};

struct RewriteResult {
    enum class Status {
        Unchanged, // the driver can use the application's words
        Rewritten, // `words` replaces the module
        Failed     // the module is malformed or has an unsupported form, which `error` describes
    };
    Status status = Status::Unchanged;
    std::vector<uint32_t> words; // only when Rewritten
    std::string error;           // only when Failed
    // It has ray queries that need the execution mode to consume micromaps, and no entry point has it.
    bool queriesForget = false;
    // It is an intersection shader that reads the ray flags and does not get the hidden ones.
    bool lacksHiddenFlags = false;
};

// Hash of the code that is linked into rewritten modules: with the same hash they read tables of the same layout.
uint64_t linkedCodeHash();

// Without a pipeline stage, a module that traces no rays by scan() (module/scan.h) is Unchanged, even if it is
// malformed. Reads nothing outside `words` and throws nothing but std::bad_alloc.
RewriteResult rewrite(std::span<const uint32_t> words, const RewriteOptions &options);

} // namespace vellum::spirv
