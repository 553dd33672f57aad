// SPDX-License-Identifier: Apache-2.0
// All faults and freedoms, and the levels of the faulty driver.
#include "faulty_driver/faults.h"

#include <array>

namespace driver
{

const char *const kQuirkVariable = "VELLUM_TEST_FAULT";

namespace
{

std::span<const Quirk> allFaults()
{
    static constexpr const char *kOffByDefault = "a parameter that most programs leave at its default";
    static constexpr const char *kNarrow = "a field that is stored with too few bits";
    static constexpr const char *kCaching = "a driver that keeps what it made before, keyed by the handle";
    static constexpr Quirk faults[]{
        // attachments.cpp
        {"base-without-indices", Level::Attachments, "baseTriangle is ignored without an index buffer", kOffByDefault},
        {"base-twice", Level::Attachments, "baseTriangle is added to each index twice",
         "an offset that is applied when indices are read and when triangles are fetched"},
        {"base-on-special-indices", Level::Attachments, "baseTriangle is added to special indices as well",
         "a shader that adds the base before it compares"},
        {"index-8-as-16", Level::Attachments, "8-bit micromap indices are read as 16-bit ones",
         "EXT drivers, whose vertex indices have 16 bits at least"},
        {"special-index-not-extended", Level::Attachments,
         "8- and 16-bit special indices are compared with the 32-bit values, so that they are ordinary ones",
         "a shader that zero-extends indices"},
        {"special-index-by-low-byte", Level::Attachments,
         "every index whose low byte is one of 0xFC to 0xFF is a special one", "a comparison of 8-bit values"},
        {"index-stride", Level::Attachments, "indexStride is ignored: indices are tightly packed", kOffByDefault},
        {"null-micromap-opaque", Level::Attachments,
         "where there is no micromap, every special index means fully opaque",
         "null handles that disable a shader path"},
        {"micromap-of-first-geometry", Level::Attachments,
         "all geometries of a structure use the micromap of the first one that has one",
         "engines with one geometry in each structure, and drivers that were tested with them"},
        {"opaque-geometry-without-micromap", Level::Attachments,
         "geometries with VK_GEOMETRY_OPAQUE_BIT_KHR have no micromap", "an opaque fast path that is chosen first"},
        {"indexed-geometry-without-micromap", Level::Attachments, "geometries with vertex indices have no micromap",
         "a build that has a kernel for each index type"},
        {"transformed-geometry-without-micromap", Level::Attachments, "geometries with transformData have no micromap",
         kOffByDefault},
        {"other-vertex-format-without-micromap", Level::Attachments,
         "geometries with another vertexFormat than R32G32B32_SFLOAT have no micromap",
         "a slow path for formats that are converted first"},
        {"no-duplicates-without-micromap", Level::Attachments,
         "geometries with VK_GEOMETRY_NO_DUPLICATE_ANY_HIT_INVOCATION_BIT_KHR have no micromap",
         "flags that are compared where one bit was meant"},
        {"micromap-by-vertex-index", Level::Attachments,
         "with vertex indices, a triangle's micromap is found by its first index instead of its number",
         "a number that is computed after indices were fetched"},
        {"geometry-pointers-as-first", Level::Attachments,
         "all geometries of ppGeometries use the micromap of the first", kOffByDefault},
        {"empty-geometry-shifts-micromaps", Level::Attachments,
         "geometries behind one without triangles use the micromap of the one before them",
         "empty geometries that are skipped"},
        {"primitive-offset-moves-indices", Level::Attachments,
         "primitiveOffset also moves into the buffer of micromap indices", "vertex indices, where it does"},
        {"special-unknown-swapped", Level::Attachments,
         "the special indices unknown-transparent and unknown-opaque are exchanged", "-3 and -4, swapped"},
        {"update-drops-micromap", Level::Attachments, "an update of a structure removes its micromaps",
         "updates that rewrite all leaves"},
        {"update-keeps-indices", Level::Attachments, "an update of a structure keeps its micromap indices", kCaching},
        {"update-keeps-micromap", Level::Attachments, "an update of a structure keeps its micromaps", kCaching},
        {"fast-trace-without-micromap", Level::Attachments,
         "structures built with VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR have no micromaps",
         "a second builder, which lacks what the first one learnt"},
        {"update-elsewhere-drops-micromap", Level::Attachments,
         "an update that writes another structure than it reads removes micromaps",
         "updates that were tested in place only"},
        {"clone-is-shallow", Level::Attachments, "a clone of a micromap shows what the original becomes later",
         "reference-counted storage"},
        {"compaction-loses-last-triangle", Level::Attachments,
         "the last triangle of a compacted micromap is unknown-opaque", "an exclusive bound"},
        {"geometry-index-4-bits", Level::Attachments, "a geometry has the micromap of that with its number modulo 16",
         kNarrow},
        {"geometry-index-8-bits", Level::Attachments, "a geometry has the micromap of that with its number modulo 256",
         kNarrow},
        {"geometry-index-16-bits", Level::Attachments,
         "a geometry has the micromap of that with its number modulo 65,536", kNarrow},
        {"primitive-index-10-bits", Level::Attachments,
         "a triangle has the micromap index of that with its number modulo 1,024", kNarrow},
        {"primitive-index-16-bits", Level::Attachments,
         "a triangle has the micromap index of that with its number modulo 65,536", kNarrow},
        {"micromap-triangles-lost-from-1024", Level::Attachments,
         "triangles of a micromap from number 1,024 on are unknown-opaque", "a cache of fixed size"},
        {"micromap-triangles-lost-from-65536", Level::Attachments,
         "triangles of a micromap from number 65,536 on are unknown-opaque", "a cache of fixed size"},
        {"base-8-bits", Level::Attachments, "baseTriangle has 8 bits", kNarrow},
        {"base-16-bits", Level::Attachments, "baseTriangle has 16 bits", kNarrow},
        {"index-8-sign-extended", Level::Attachments, "8-bit micromap indices are sign-extended",
         "the special indices, which are negative"},
        {"index-16-sign-extended", Level::Attachments, "16-bit micromap indices are sign-extended",
         "the special indices, which are negative"},
        {"lossy-copy-loses-more", Level::Attachments, "the first triangle of a copied lossy micromap is unknown-opaque",
         "copies that compress again"},
        {"lossy-once-more", Level::Attachments,
         "the first triangle of a lossy micromap is unknown-opaque in a structure that is updated",
         "an update that takes another path than a build"},
        // micromaps.cpp
        {"usage-pointers-as-first", Level::Micromaps, "every element of ppUsageCounts is read as the first one",
         kOffByDefault},
        {"usage-count-0-ends", Level::Micromaps, "usage counts end at the first element whose count is 0",
         "lists that end with a zero"},
        {"usage-counts-once", Level::Micromaps,
         "of usage counts with the same format and level, only the last one counts", "a table by format and level"},
        {"data-offset-multiple-of-4", Level::Micromaps, "dataOffset is rounded down to a multiple of 4",
         "data that is read in words"},
        {"sharing-by-16-bytes", Level::Micromaps,
         "triangles of one format and level share their data where the first 16 bytes are equal",
         "deduplication by the beginning of the data"},
        {"sharing-ignores-last-byte", Level::Micromaps,
         "triangles of one format and level share their data where all bytes but the last are equal",
         "deduplication with an exclusive bound"},
        {"triangle-stride", Level::Micromaps, "triangleArrayStride is ignored: triangles are tightly packed",
         kOffByDefault},
        {"two-state-as-four", Level::Micromaps, "2-state data is read as 4-state data",
         "a format that is read from the first triangle"},
        {"level-0-as-1", Level::Micromaps, "triangles of level 0 are read as ones of level 1",
         "hardware whose lowest level is 1"},
        {"data-offset-16-bits", Level::Micromaps, "dataOffset has 16 bits", kNarrow},
        {"four-state-as-two", Level::Micromaps, "4-state data is read as 2-state data",
         "a format that is read from the first triangle"},
        {"highest-level-truncated", Level::Micromaps, "triangles of level 12 are read as ones of level 11",
         "hardware whose highest level is 11"},
        {"micro-triangle-index-16-bits", Level::Micromaps, "the index of a micro-triangle has 16 bits", kNarrow},
        {"curve-mirrored-on-odd-levels", Level::Micromaps,
         "on odd levels the curve of micro-triangles runs in the opposite direction",
         "a curve that is flipped once too often"},
        {"opaque-becomes-unknown", Level::Micromaps,
         "opaque micro-triangles are unknown-opaque, so that any-hit shaders run for them", "drivers that play safe"},
        {"unknown-states-swapped", Level::Micromaps, "the states unknown-transparent and unknown-opaque are exchanged",
         "2 and 3, swapped"},
        {"lossy-opaque-to-transparent", Level::Micromaps,
         "a lossy build makes opaque micro-triangles next to transparent ones transparent",
         "lossy compression by majority, where only unknown is allowed"},
        {"lossy-differs-by-device", Level::Micromaps,
         "on every device but the first, lossy builds make opaque micro-triangles unknown-opaque",
         "lossy compression by a heuristic that learns"},
        {"lossy-differs-by-address", Level::Micromaps,
         "whether lossy builds make opaque micro-triangles unknown-opaque depends on where the data is",
         "a race of the threads that choose what is lost"},
        {"micromap-built-once", Level::Micromaps, "a micromap that is built again keeps its content", kCaching},
        {"only-first-micromap-build", Level::Micromaps, "of several micromaps in one build command, one is built",
         "engines that build one at a time"},
        {"micromap-built-late", Level::Micromaps,
         "builds of micromaps are executed at the end of the command buffer, whatever barriers follow them",
         "a missing barrier"},
        {"only-first-host-build", Level::Micromaps, "of several micromaps in one vkBuildMicromapsEXT, one is built",
         "engines that build one at a time"},
        {"host-build-returns-early", Level::Micromaps,
         "vkBuildMicromapsEXT returns before it has built: the micromap is there after the next submission",
         "a deferred operation without a wait"},
        // instances.cpp
        {"disable-in-first-instance-only", Level::Instances,
         "VK_GEOMETRY_INSTANCE_DISABLE_OPACITY_MICROMAPS counts in the first instance only",
         "a flag that is read from record 0"},
        {"instance-2-state-ignored", Level::Instances, "VK_GEOMETRY_INSTANCE_FORCE_OPACITY_MICROMAP_2_STATE is ignored",
         "a flag that no engine sets"},
        {"custom-index-16-bits", Level::Instances, "instanceCustomIndex has 16 bits", kNarrow},
        {"instance-mask-7-bits", Level::Instances, "the highest bit of an instance's mask is ignored", kNarrow},
        {"mirrored-instance-faces-away", Level::Instances,
         "an instance whose transform mirrors has front and back faces exchanged",
         "facing that is computed in world space"},
        {"force-opaque-disables-micromaps", Level::Instances,
         "VK_GEOMETRY_INSTANCE_FORCE_OPAQUE_BIT_KHR also makes transparent micro-triangles opaque",
         "an opaque fast path that is chosen first"},
        {"update-keeps-instance-flags", Level::Instances, "an update of a top-level structure keeps instance flags",
         "updates that rewrite transforms only"},
        {"instances-displaced", Level::Instances, "instances are a hundredth to the side", "transforms of half floats"},
        {"copy-loses-instance-flags", Level::Instances, "instances of a cloned top-level structure have no flags",
         "copies that convert instances"},
        {"instance-flags-lost-from-64", Level::Instances, "instances from number 64 on have no flags",
         "a bit mask of the instances of a wave"},
        {"instance-flags-lost-from-256", Level::Instances, "instances from number 256 on have no flags", kNarrow},
        {"instance-flags-lost-from-65536", Level::Instances, "instances from number 65,536 on have no flags", kNarrow},
        // copies.cpp
        {"compacted-size-of-another", Level::Copies,
         "where one command queries several compacted sizes, each is that of the next structure",
         "a shifted array index"},
        {"query-of-previous", Level::Copies, "a query of a size returns that of the structure queried before",
         "a result that is read before it is written"},
        {"query-first-ignored", Level::Copies,
         "properties are written to the queries from 0 on, whatever firstQuery is", kOffByDefault},
        {"results-stride-ignored", Level::Copies, "vkGetQueryPoolResults writes results without gaps", kOffByDefault},
        {"results-without-availability", Level::Copies, "vkGetQueryPoolResults returns every query as available",
         "queries that are written at once"},
        {"copied-results-stride-ignored", Level::Copies, "vkCmdCopyQueryPoolResults writes results without gaps",
         kOffByDefault},
        {"reset-does-nothing", Level::Copies, "vkCmdResetQueryPool does nothing", "pools that are used once"},
        {"host-reset-does-nothing", Level::Copies, "vkResetQueryPool does nothing", "pools that are used once"},
        {"deserialization-keeps-old", Level::Copies, "a micromap is not deserialized into memory that held one before",
         kCaching},
        {"serialized-header-size", Level::Copies,
         "the header of serialized data states the size of the data as the size that deserialization needs",
         "two adjacent fields"},
        {"memory-copy-clears-rest", Level::Copies,
         "vkCmdCopyMemoryKHR clears what the destination range has behind the size of the source",
         "staging memory as large as the destination"},
        {"image-copy-row-length", Level::Copies, "vkCmdCopyImageToMemoryKHR ignores addressRowLength", kOffByDefault},
        // generic.cpp
        {"generic-cleared-to-its-end", Level::Generic,
         "a build clears the whole range of a GENERIC structure, which other structures may share",
         "lavapipe 25.0.7, under programs like vkd3d-proton"},
        // boxes.cpp
        {"boxes-shrunk", Level::Boxes, "boxes are smaller than they were given", "quantization that rounds inwards"},
        // shaders.cpp
        {"mode-constant-true", Level::Shaders,
         "a specialization constant of the execution mode that defaults to false defaults to true",
         "the driver of dxil-spirv's issue 282"},
        {"ray-2-state-ignored", Level::Shaders, "the ray flag ForceOpacityMicromap2State is ignored",
         "a flag that no engine sets"},
        {"cull-opaque-ignored", Level::Shaders, "the ray flag CullOpaque is ignored",
         "hardware that culls by the geometry's flag"},
        {"terminating-rays-ignore-2-state", Level::Shaders,
         "rays with TerminateOnFirstHit ignore ForceOpacityMicromap2State", "a second traversal loop for shadow rays"},
        // commands.cpp
        {"null-record-skips-any-hit", Level::Commands, "no any-hit shader runs where a hit table has a null record",
         "RADV, which compiles the table into one shader"},
        {"hit-stride-of-misses", Level::Commands,
         "vkCmdTraceRaysKHR takes the stride of hit records from the miss region", "two adjacent parameters"},
        {"record-data-lost", Level::Commands, "the data of hit records is zero",
         "copies of hit tables that convert handles"},
        {"first-hit-table-stays", Level::Commands, "all traces of a command buffer use the hit table of its first",
         "state that is set once for each command buffer"},
        {"library-stages-unused", Level::Commands,
         "shaders of libraries are unused in hit groups of pipelines that link these", "issue 34 of Vellum"},
        {"second-queue-loses-micromaps", Level::Commands,
         "command buffers that build micromaps are executed by the first queue only",
         "programs with one queue, and drivers that were tested with them", "queues"},
        {"indirect-build-with-host-counts", Level::Commands,
         "an indirect build takes its primitive counts from ppMaxPrimitiveCounts", "a build that is sized for the most",
         "capable"},
        // state.cpp
        {"build-clears-push-constants", Level::State, "builds change the first push constant of the command buffer",
         "builds that are dispatches of the driver's own shaders"},
        {"build-under-predicate", Level::State, "builds within conditional rendering are discarded",
         "builds that are dispatches of the driver's own shaders"},
        {"indirect-trace-hit-stride", Level::State,
         "vkCmdTraceRaysIndirect2KHR ignores hitShaderBindingTableStride: all hits use the first record",
         kOffByDefault},
        {"deferred-copies-forgotten", Level::State, "vkCopyMicromapEXT with a deferred operation copies nothing",
         kOffByDefault},
        {"every-version-accepted", Level::State, "serialized data of every version is compatible", "a stub"},
        // process.cpp
        {"hangs", Level::Process, "waiting for the device never returns", "a GPU hang without recovery"},
        {"dies", Level::Process, "the process aborts when a command buffer is ended", "an assertion of a driver"},
        {"loses-device", Level::Process, "every submission and wait returns VK_ERROR_DEVICE_LOST", "a GPU reset"},
        {"does-nothing", Level::Process, "submissions succeed and execute nothing", "a stub driver"},
    };
    return faults;
}

// Behaviour that the specification allows but lavapipe does not show, with the text that allows it. A check that
// reports one of these as a failure is wrong.
std::span<const Quirk> allFreedoms()
{
    static constexpr Quirk freedoms[]{
        {"coarse-arithmetic", Level::Instances,
         "distances and barycentrics differ by a few units in the last place of world coordinates (Ray Traversal)"},
        {"boxes-grown", Level::Boxes,
         "boxes are candidates of rays that pass next to them (Ray Intersection Candidate Determination)"},
        {"host-reads-after-barriers", Level::Copies,
         "the host does not see serialized data if no barrier for it was recorded since (Fences: waiting for one does "
         "not make memory visible to the host)"},
        {"clones-as-large-as-sources", Level::Copies,
         "a clone of a VkMicromapEXT writes as many bytes as the source has (VkCopyMicromapModeEXT)"},
        {"instance-offsets-by-16", Level::Instances,
         "primitiveOffset of instances loses its lowest four bits "
         "(VUID-VkAccelerationStructureBuildRangeInfoKHR-primitiveOffset-03660)"},
        {"lossy-by-content", Level::Micromaps,
         "a third of the elements of lossy micromaps are unknown, depending on nothing but their content (Ray Opacity "
         "Micromap)"},
    };
    return freedoms;
}

} // namespace

std::span<const Quirk> allQuirks()
{
    static const std::vector<Quirk> all = [] {
        std::vector<Quirk> both(allFaults().begin(), allFaults().end());
        both.insert(both.end(), allFreedoms().begin(), allFreedoms().end());
        return both;
    }();
    return all;
}

std::span<const NamedLevel> allLevels()
{
    static const NamedLevel all[]{
        {Level::Process, faults::processRows(), true},
        {Level::Shaders, faults::shaderRows(), true},
        {Level::Instances, faults::instanceRows(), true},
        {Level::Attachments, faults::attachmentRows(), true},
        {Level::Copies, faults::copyRows(), true},
        {Level::Generic, faults::genericRows(), true},
        {Level::Boxes, faults::boxRows(), true},
        {Level::Micromaps, faults::micromapRows(), true},
        {Level::Commands, faults::commandRows(), true},
        {Level::State, faults::stateRows(), true},
        {Level::Submissions, faults::submissionRows(), true},
    };
    return all;
}

} // namespace driver

// Tests and scripts look this up in the library. Member 0 of fault i is its name, 1 what is wrong, 2 what it imitates,
// 3 the quirks that it needs; null after the last fault.
extern "C" __attribute__((visibility("default"))) const char *vellumFault(unsigned i, unsigned member);
extern "C" const char *vellumFault(unsigned i, unsigned member)
{
    const auto all = driver::allFaults();
    if (i >= all.size())
        return nullptr;
    const driver::Quirk &fault = all[i];
    return std::array{fault.name, fault.claim, fault.imitates, fault.quirks}.at(member);
}
