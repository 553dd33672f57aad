// SPDX-License-Identifier: Apache-2.0
// A conformance case as plain data: a scene, how it is built, what is done with it, and how rays are traced. All that
// a run needs, so that a failure can be made smaller, written to a file and run again.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "check/oracle/pipeline_fault.h"
#include "gpu/execution_mode.h"
#include "gpu/programs/pipeline_libraries.h"

namespace vellum::check
{

// The commands that record or execute builds.
enum class BuildCommand {
    Device,   // vkCmdBuild...
    Indirect, // vkCmdBuildAccelerationStructuresIndirectKHR for structures, where the device has it
    Host,     // vkBuildMicromapsEXT for micromaps, where the device has it
};

// Conditional rendering that builds, copies and queries are recorded within. It does not affect these commands, but
// discards a dispatch that follows each build and copy, except before rays.
enum class Conditional {
    None,
    False,        // the predicate is false
    InvertedTrue, // it is inverted, and the predicate is true
    // As above, by vkCmdBeginConditionalRendering2EXT
    FalseAtAddress,
    InvertedTrueAtAddress,
};
inline bool isInverted(Conditional conditional)
{
    return conditional == Conditional::InvertedTrue || conditional == Conditional::InvertedTrueAtAddress;
}
inline bool isAtAddress(Conditional conditional)
{
    return conditional == Conditional::FalseAtAddress || conditional == Conditional::InvertedTrueAtAddress;
}

struct BuildPlan {
    BuildCommand micromaps = BuildCommand::Device;
    BuildCommand structures = BuildCommand::Device;
    bool together = false; // all micromaps by one command, all bottom-level structures by another
    // With `together` and VK_KHR_opacity_micromap: structures without micromaps are built by the command that builds
    // the micromaps; and steps that build a micromap build an object that does not use it by the same command.
    bool mixed = false;
    uint32_t threads = 1;          // threads that record builds, in command buffers that are submitted to all queues
    bool instancePointers = false; // the top level reads an array of pointers
    bool geometryPointers = false; // the top level's geometry comes by ppGeometries
    bool single = false;           // everything by one command buffer, with the rays; without steps only
    Conditional conditional = Conditional::None;
    // Indirect builds allow that many triangles and instances more than they build: ppMaxPrimitiveCounts.
    uint32_t spareTriangles = 0;
    uint32_t spareInstances = 0;
    uint32_t skippedInstances = 0; // garbage before the first instance, which primitiveOffset skips
    // Each command buffer of builds, copies and updates is a secondary one; is submitted twice, where that changes
    // nothing.
    bool secondary = false;
    bool twice = false;
    // Commands that build several objects, or micromaps and objects, build an unrelated top level first; that which
    // builds the top level builds an unrelated object first.
    bool unrelated = false;
    bool otherTop = false; // the command that builds the top level builds another one of other instances as well
    // The memory of what builds read: members of BuildInputs::Plan. Late: Memory::Apart only.
    bool sharedInputs = false;
    bool aliasedInputs = false;
    bool lateInputs = false;
    // Each command buffer of builds, copies and updates is recorded twice, and then executed; except those of
    // MoveObject.
    bool rerecorded = false;
    // `single`: builds of micromaps, of objects, and of the top level with the rays are in three command buffers of one
    // submission, which are recorded in reverse order. TracePlan::twice submits only the last of them again.
    bool backwards = false;
    // A second device carries out the same, in memory apart: something of it while each command buffer of the first one
    // is recorded. Not with threads.
    bool secondDevice = false;
    bool deferred = false; // host builds get a deferred operation
    // Builds, copies and updates are recorded by another thread than what else is in their command buffer.
    bool anotherThread = false;
};

// Something that is done after everything was built and before rays are traced. The top level is built after all steps
// on objects and micromaps, before those on itself.
struct Step {
    enum class Kind {
        // On a bottom-level structure. The old one is destroyed afterwards.
        CloneObject,
        CompactObject,
        ReloadObject, // serialized and deserialized; `relocated`: the micromaps that it uses as well
        UpdateObject, // with the same data, or `mirrored`
        RebuildObject,
        ReplaceObject,  // built again with what `other` has
        MoveObject,     // cloned, and `other` built in its memory by the same submission
        RenameObject,   // a second handle at the same address
        RebuildObjects, // every second object, the target among them, by one command (`update`: the target is updated)
        // On a micromap; the structures that use it are built again (`update`: updated).
        CloneMicromap, // and the original built again with `states`, if there are any
        CompactMicromap,
        ReloadMicromap, // serialized and deserialized; `inPlace`: by the handle of before, once `states` were built
                        // there
        SetStates,      // built anew with `states`, which have the levels and formats of before if `inPlace`
        // On a mesh.
        SetIndices, // `micromapUse` instead of what it had; the structure is updated (`update`) or built again
        // On the top level.
        CloneTop,
        CompactTop,
        ReloadTop,  // `relocated`: refers to clones of its objects, whose originals are destroyed
        UpdateTop,  // updated with `instances`
        RebuildTop, // built again with `instances`
        Count
    };
    Kind kind = Kind::CloneObject;
    uint32_t target = 0; // an object or a micromap
    uint32_t other = 0;  // MoveObject, ReplaceObject: another object. SetIndices: a mesh of the object
    bool update = false;
    // Updates write a new structure (dstAccelerationStructure is not srcAccelerationStructure), and the old one is
    // destroyed afterwards.
    bool outOfPlace = false;
    // Serialized and deserialized with other addresses in the data. VK_KHR_opacity_micromap has those of micromaps.
    bool relocated = false;
    // ReloadObject, `relocated`: the structure is deserialized first, when its micromaps are created and have no
    // content.
    bool structureFirst = false;
    bool mirrored = false; // UpdateObject, RebuildObject: x of vertices and boxes is mirrored
    // A clone is first made as large as VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SIZE_KHR reports; the target of an update
    // (`outOfPlace`) is as large as vkGetAccelerationStructureBuildSizesKHR reports, instead of as its source.
    bool exact = false;
    bool inPlace = false;  // by the same handle
    bool host = false;     // On a micromap: by host commands
    bool deferred = false; // host commands get a deferred operation
    std::vector<oracle::MicromapTriangle> states;
    std::optional<oracle::MeshMicromap> micromapUse;
    std::vector<oracle::Instance> instances;
};

// A ray tracing pipeline, all of whose tables trace all rays.
struct PipelinePlan {
    // Libraries, and the pipeline, which is the last part; stages and groups are numbered as kTracerStageNames and
    // kTracerGroupNames. Empty: a pipeline without libraries.
    std::vector<PipelinePart> parts;
    VkPipelineCreateFlags flags = 0; // besides the micromap bit
    TraceParameters parameters{.recordStride = 1};
    oracle::TablePlan table;
    std::vector<oracle::TablePlan> otherTables;

    bool operator==(const PipelinePlan &) const = default;
};

// The object and property of a query.
struct QueryTarget {
    enum class Of { Object, Micromap, Top };
    Of of = Of::Object;
    uint32_t number = 0;

    bool operator==(const QueryTarget &) const = default;
};

// A command on a range of the queries of a pool, or one of the host without a pool.
struct QueryCommand {
    enum class Kind {
        Reset,       // vkCmdResetQueryPool
        ResetOnHost, // vkResetQueryPool
        Write,       // vkCmdWrite...Properties
        Read,        // vkGetQueryPoolResults
        Copy,        // vkCmdCopyQueryPoolResults
        WriteOnHost, // vkWriteMicromapsPropertiesEXT, of micromaps
        Count
    };
    Kind kind = Kind::Reset;
    uint32_t first = 0;
    uint32_t count = 1;               // of queries; where there are targets, as many as those
    std::vector<QueryTarget> targets; // Write, WriteOnHost
    // Read, Copy
    bool wide = false;         // VK_QUERY_RESULT_64_BIT
    bool availability = false; // VK_QUERY_RESULT_WITH_AVAILABILITY_BIT
    bool wait = false;         // VK_QUERY_RESULT_WAIT_BIT; Read: nothing else waits for what was submitted
    bool partial = false;      // VK_QUERY_RESULT_PARTIAL_BIT
    bool byAddress = false;    // Copy: vkCmdCopyQueryPoolResultsToMemoryKHR, where the device has it
    uint32_t offset = 0;       // Copy: of the first result. In units of 8 bytes
    uint32_t padding = 0;      // between two results. WriteOnHost as well. In units of 8 bytes
};

// A pool of queries of one property, and what is done with it when all structures are there.
struct QueryPlan {
    enum class Property { CompactedSize, SerializationSize, Size, BottomLevelPointers };
    Property property = Property::SerializationSize;
    uint32_t count = 1; // of the pool
    std::vector<QueryCommand> commands;
};

// A region of a command of VK_KHR_device_address_commands that copies, updates or fills: a range of a buffer, and what
// it is copied from or to.
struct AddressRegion {
    uint32_t buffer = 0;     // that is written; CopyToImage: that is read
    uint32_t offset = 0;     // of the range in it
    uint32_t size = 4;       // Copy, Update, Fill: the bytes that are written
    uint32_t spare = 0;      // bytes behind those of the command that its range has as well; not of Fill
    uint32_t from = 0;       // Copy: the buffer that is read
    uint32_t fromOffset = 0; // Copy
    // CopyToImage, CopyFromImage
    uint32_t level = 0, layer = 0, layers = 1;
    uint32_t x = 0, y = 0, z = 0;
    uint32_t width = 1, height = 1, depth = 1;
    uint32_t rowLength = 0, imageHeight = 0;
};

struct AddressCommand {
    enum class Kind {
        Copy,          // vkCmdCopyMemoryKHR
        CopyToImage,   // vkCmdCopyMemoryToImageKHR
        CopyFromImage, // vkCmdCopyImageToMemoryKHR
        Update,        // vkCmdUpdateMemoryKHR
        Fill,          // vkCmdFillMemoryKHR
        Count
    };
    Kind kind = Kind::Copy;
    std::vector<AddressRegion> regions; // Update, Fill: one
    uint32_t value = 0;                 // Fill: the word. Update: the number that its data is made from
    bool fullyBound = false;            // VK_ADDRESS_COMMAND_FULLY_BOUND_BIT_KHR
};

// Commands that copy, update and fill memory at device addresses. A command buffer of its own executes them when the
// micromaps are built, with a barrier between them.
struct AddressPlan {
    std::vector<uint32_t> buffers; // their sizes
    // The image of these commands
    VkFormat format = VK_FORMAT_R8G8B8A8_UNORM;
    bool volume = false; // VK_IMAGE_TYPE_3D
    uint32_t width = 1, height = 1, depth = 1, levels = 1, layers = 1;
    bool optimal = false; // VK_IMAGE_LAYOUT_TRANSFER_..._OPTIMAL instead of GENERAL
    std::vector<AddressCommand> commands;
};

// How the rays are traced.
struct TracePlan {
    enum class Method { Query, Pipeline };
    // The source of ray flags. Specialized, Literal: rays with the same flags are traced together, by a pipeline of
    // their own, so they should have few different ones; the parameters of traceRayEXT that name records are such
    // constants, too. Selected: the shader selects one of two literal constants for each ray, so rays are traced
    // together that have at most two different flags. Only in pipelines: Mixed: two instructions trace, one with the
    // literal flags of the first ray. Computed: a function traces in a loop, with flags that it computes.
    enum class Flags { RunTime, Specialized, Literal, Selected, Mixed, Computed };
    // The execution mode of modules with ray queries (VK_KHR_opacity_micromap). Computed: from two specialization
    // constants. False: sceneRule.
    enum class Mode { True, False, SpecializedTrue, SpecializedFalse, ComputedTrue, ComputedFalse };
    // The shader of a pipeline that traces the rays; not ray generation: in recursion.
    enum class From { RayGeneration, ClosestHit, Miss };
    // How a shader uses its ray query. Array: one of two queries in an array. Functions: functions that get it as a
    // parameter initialize it, proceed and read it. Again: it is initialized with other flags and proceeds before.
    // Sites: it is initialized and proceeds in two locations, of which rays take either. Getters: origins, directions
    // and transforms are read as well. Condition: the condition of its loop also counts. Carried: its loop swaps
    // two values in each iteration, and has two continue paths. Beside: another query, with other flags, proceeds in
    // the same loop.
    enum class Query { Plain, Array, Functions, Again, Sites, Getters, Condition, Carried, Beside };

    Method method = Method::Query;
    // Query: the stage that has the ray query: any that kQueryStages lists.
    VkShaderStageFlagBits stage = VK_SHADER_STAGE_COMPUTE_BIT;
    Flags flags = Flags::RunTime;
    Mode mode = Mode::True;
    // Query: with VK_KHR_opacity_micromap, the other entry point declares the other value of the mode. Task shaders
    // have no function to share.
    OtherEntry otherEntry = OtherEntry::None;
    bool byAddress = false;     // the acceleration structure is a device address instead of a descriptor
    bool inlineModules = false; // VkShaderModuleCreateInfo in the stages' pNext
    bool secondary = false;     // traced in a secondary command buffer; compute shaders and pipelines
    bool besideBuild = false;   // traced while another structure is built by the same submission
    // Pipeline, descriptors and push constants are bound before the builds of the same command buffer.
    bool boundFirst = false;
    bool pipelineLast = false;  // boundFirst: the pipeline or shader object is bound after the builds
    bool maintenance6 = false;  // by vkCmdBindDescriptorSets2KHR and vkCmdPushConstants2KHR
    bool twice = false;         // the command buffer that traces is submitted twice
    bool rerecorded = false;    // it is recorded twice, and then executed; without builds and a barrier for tables
    Query query = Query::Plain; // Query; other than Plain: in the compute stage, not byAddress
    // Query: the module went through spirv-opt; in the compute stage, not byAddress, with flags of run time.
    bool optimized = false;
    bool signedFlags = false;   // ray flags are a signed integer
    bool shaderObjects = false; // Query, in a compute shader: VK_EXT_shader_object
    // Query, in a compute shader: a pipeline is bound before the shader object, or a shader object before the pipeline.
    bool rebound = false;
    // Query, in a vertex shader: the numbers of rays come from vertex buffers, bound by vkCmdBindVertexBuffers3KHR, and
    // by an index buffer, bound by vkCmdBindIndexBuffer3KHR. With a descriptor and flags of run time
    bool vertexBuffers = false;
    bool dynamicStrides = false; // vertexBuffers: VK_DYNAMIC_STATE_VERTEX_INPUT_BINDING_STRIDE
    // Pipeline
    PipelinePlan pipeline;
    std::vector<PipelinePlan> otherPipelines; // alive at the same time; their traces follow in the command buffer
    bool tablesInPlace = false; // each table of a pipeline overwrites the one before it, with the same command buffer
    uint32_t tableBarrier = 0;  // tablesInPlace: bits of TableBarrier
    // The first pipeline is destroyed afterwards, and the others trace again.
    bool firstDestroyed = false;
    bool dynamicStackSize = false;
    From from = From::RayGeneration;
    bool flags2 = false;      // VkPipelineCreateFlags2CreateInfo
    uint32_t chained = 0;     // bits of ChainedInfo
    bool unusedStage = false; // a stage that no group uses
    LaunchPlan launch;        // Query: without height and depth
    HitAttributes attributes = HitAttributes::Vec2;
    uint32_t creation = 0; // of all pipelines: bits of PipelineCreation
    // The ray generation shader executes a callable shader: From::RayGeneration, Flags::RunTime or Selected,
    // descriptors, no parts.
    bool callables = false;
    bool withoutMicromaps = false; // without the micromap bit: sceneRule

    bool operator==(const TracePlan &) const = default;
};

// The subdivision level that the specification requires of every device ("Required Limits").
inline constexpr uint32_t kRequiredLevel = 3;

struct Case {
    std::string group;
    uint64_t seed = 0; // the seed that it was made from
    Memory memory = Memory::Apart;
    oracle::Scene scene;
    BuildPlan build;
    std::vector<Step> steps;
    std::vector<QueryPlan> queries;
    AddressPlan addressCopies;
    TracePlan trace;
};

// The scene after all steps, which is what rays must meet.
oracle::Scene sceneAfter(const Case &c);

// The fault of a run of a case; no fault: nothing.
struct Verdict {
    std::string cause; // one line without numbers that vary
    std::string detail;
    uint64_t rays = 0;                 // rays compared with the oracle
    std::optional<uint32_t> ray;       // the first that is wrong
    std::vector<uint32_t> wrongRays;   // all that are wrong
    oracle::Substitution substitution; // substitutions that lossy builds must have made
    bool skipped = false;              // the device lacks what the case needs, which `cause` says
    [[nodiscard]] bool failed() const { return !cause.empty() && !skipped; }
};
// Runs it. Throws what checkResult throws: VK_ERROR_DEVICE_LOST, for one.
Verdict run(Device &gpu, const Case &c);

// --- steps: step.cpp ---

// The type of a step's target.
enum class Target { Object, Micromap, Top };
Target targetOf(Step::Kind kind);

// Returns whether the step updates that object. scene: after the step
bool isUpdated(const Step &step, uint32_t object, const oracle::Scene &scene);

// The content of the scene after the step; copies change nothing.
void applyTo(oracle::Scene &scene, const Step &step);

// --- validity: validity.cpp ---

// The first rule of Vulkan that the case breaks, as "where: what", or nothing. Running a valid case makes no invalid
// call and reads nothing out of range, whatever file it comes from.
std::string invalid(const Case &c);

// --- files: json.cpp ---

// Fields with their default value are omitted. Floating-point numbers are read back as they were.
std::string toJson(const Case &c);

// Throws std::runtime_error, whose what() is one line: where the text is wrong, and what is wrong there. What it
// returns is valid.
Case caseFromJson(std::string_view text);

// --- reports: account.cpp, picture.cpp ---

// Describes, in lines of text, what is built by which commands, what is then done, how the wrong ray is traced (the
// first one if the verdict names none), what it must meet and by which rules, and what was found.
std::string accountOf(const Case &c, const Verdict &verdict, Api api);

// A picture of the triangle that a wrong ray meets: the expected states of its micro-triangles, and where the device
// agrees. SVG; empty: the ray meets no triangle, or one whose micro-triangles are too many to draw. `runs` runs a case
// that differs in its rays only: one at the centre of each micro-triangle.
std::string pictureOf(const Case &c, const Verdict &verdict, const std::function<Verdict(const Case &)> &runs);

} // namespace vellum::check
