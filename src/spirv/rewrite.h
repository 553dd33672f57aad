// Rewrites an application's SPIR-V so that it resolves opacity micromaps itself, on a driver that has none.
//
// What the rewritten module relies on (the layer's side of it):
//   - hits on geometry with a micromap reach the shader as non-opaque triangle candidates;
//   - the driver's instanceCustomIndex is a slot of the root table (core/records.h), for every instance;
//   - instances without geometry records keep their flags; of the others, the instance record holds the true ones.
//
// What changes for the driver: the module needs physical storage buffer addresses (bufferDeviceAddress); opacity
// micromap extensions, capabilities and execution modes are gone.
//
// Stages of ray tracing pipelines are rewritten per pipeline: those of pipelines that do not use micromaps only get
// their custom index back and hide the ray flag that the driver does not know, the others hide all ray flags that
// matter from the driver, and hits are decided before the application's shader.
//
// Extension strings, capabilities and execution modes of micromaps are removed. Which ray queries consume micromaps is
// QueriesConsume. Of those that do not, traversal is the driver's: VUID-vkCmdDispatch-micromap-11636 keeps them away
// from geometry with micromaps (where they meet it all the same, its hits are non-opaque).
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

// What code of ours at the head of a stage decides.
enum class Decides {
    Nothing,
    TriangleHits, // an any-hit shader of triangle hit groups
    BoxHits,      // an any-hit shader of procedural hit groups
    BoxCulling    // an intersection shader
};

// Which ray queries consume micromaps.
enum class QueriesConsume {
    Always,       // all: VK_EXT_opacity_micromap is enabled. The execution mode does not matter, nor does its operand.
    WhereDeclared // those of entry points with the execution mode OpacityMicromapIdKHR and a true operand
};

// The ray flags that are hidden from the driver (core/ray_flags.h), and how they reach the shaders that a ray calls, in
// a pipeline that uses micromaps. The same for all stages of all pipelines that work together.
struct HiddenFlags {
    // Those that all rays have alike are constants of the rewritten shaders. Where there are others, all lie before the
    // application's payload (payload_prefix.h), which intersection shaders cannot see.
    uint32_t fixed = shared::kHiddenRayFlags;
    uint32_t constant = 0; // the fixed ones that all rays have
    // The type of the ray's payload (payload_types.h), for a shader that declares none. Empty where it is not known: it
    // gets the prefix alone.
    std::vector<uint32_t> payload{};
    auto operator<=>(const HiddenFlags &) const = default;
    [[nodiscard]] bool inPayload() const { return fixed != shared::kHiddenRayFlags; }
};

// A stage of a ray tracing pipeline that uses micromaps.
struct PipelineStage {
    std::string_view entryPoint;
    uint32_t executionModel = 0; // SPIR-V's
    Decides decides = Decides::Nothing;
    HiddenFlags hidden;
};

struct RewriteOptions {
    uint64_t rootAddress = 0; // GPU address of the root table, 8-byte aligned
    uint64_t firstSlots = 0;  // GPU address of the instance records of the first kFirstSlots slots, 16-byte aligned
    QueriesConsume queriesConsume = QueriesConsume::Always;
    // Whether flags that all ray queries of a module pass as constants become constants of the rewritten module. Else
    // they travel like those that are computed.
    bool constantQueryFlags = true;
    // The result is good for this stage only: other entry points are gone.
    std::optional<PipelineStage> pipelineStage;
};

struct RewriteResult {
    enum class Status {
        Unchanged, // nothing to do: give the driver the words it was going to get
        Rewritten, // `words` replaces the module
        Failed     // malformed, or of a shape that cannot be rewritten: `error` says why, for a person
    };
    Status status = Status::Unchanged;
    std::vector<uint32_t> words; // only when Rewritten
    std::string error;           // only when Failed
    // It has ray queries, and only declarations could let them consume micromaps, but no entry point declares anything.
    bool queriesForget = false;
    // It is an intersection shader that reads the ray's flags and does not see those that are hidden.
    bool lacksHiddenFlags = false;
};

// Tells apart what is linked into rewritten modules: modules with the same hash read tables of the same layout.
uint64_t linkedCodeHash();

// Modules that scan() (module/scan.h) finds to trace no rays are Unchanged, whatever they hold, but for pipeline
// stages. Reads nothing outside `words` and throws nothing but std::bad_alloc.
RewriteResult rewrite(std::span<const uint32_t> words, const RewriteOptions &options);

} // namespace vellum::spirv
