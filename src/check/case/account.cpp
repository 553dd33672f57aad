// SPDX-License-Identifier: Apache-2.0
#include "check/case/case.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "check/case/address_copies.h"
#include "check/case/names.h"
#include "check/oracle/cpu_trace.h"
#include "check/oracle/outcome.h"

namespace vellum::check
{
namespace
{

using oracle::Hit;
using oracle::MeshMicromap;
using oracle::MicromapTriangle;
using oracle::Scene;
using Kind = Step::Kind;

std::string counted(size_t count, std::string_view what)
{
    return fmt::format("{} {}{}", count, what, count == 1 ? "" : "s");
}

// "none" or the names of the bits.
template <size_t N>
std::string namesOf(uint32_t flags, const std::array<Bit, N> &bits)
{
    std::vector<std::string_view> names;
    for (const Bit &bit : bits)
        if ((flags & bit.value) != 0)
            names.push_back(bit.name);
    return names.empty() ? "none" : fmt::format("{}", fmt::join(names, " | "));
}

template <size_t N>
std::string wordsOf(uint32_t set, const std::array<Bit, N> &bits)
{
    std::vector<std::string_view> words;
    for (const Bit &bit : bits)
        if ((set & bit.value) != 0)
            words.push_back(bit.name);
    return fmt::format("{}", fmt::join(words, ", "));
}

std::string describeUsage(bool pointers, uint32_t form)
{
    return std::string(pointers ? ", ppUsageCounts" : "") +
           (form != 0 ? fmt::format(", usage counts: {}", wordsOf(form, kUsageNames)) : "");
}

// A line for each element, or for several in a row that are described alike; at most kMost.
template <class T, class Describe>
std::string listed(const std::vector<T> &elements, const char *one, const char *many, const Describe &describeOne)
{
    constexpr size_t kMost = 64;
    std::string text;
    size_t lines = 0;
    for (size_t i = 0; i < elements.size();) {
        if (lines++ == kMost)
            return text + fmt::format("\n     and {} more", elements.size() - i);
        const std::string words = describeOne(elements[i]);
        size_t end = i + 1;
        while (end < elements.size() && describeOne(elements[end]) == words)
            ++end;
        text += end - i == 1 ? fmt::format("\n     {} {}: {}", one, i, words)
                             : fmt::format("\n     {} {} to {}, each: {}", many, i, end - 1, words);
        i = end;
    }
    return text;
}

std::string describe(const std::vector<MicromapTriangle> &triangles)
{
    return listed(triangles, "triangle", "triangles", [](const MicromapTriangle &triangle) {
        std::array<size_t, 4> counts{};
        for (const uint8_t state : triangle.states)
            ++counts[state & 3];
        std::vector<std::string> states;
        for (size_t s = 0; s < counts.size(); ++s)
            if (counts[s] > 0)
                states.push_back(fmt::format("{} {}", counts[s], kStateNames[s]));
        return fmt::format("level {}, {}-state: {}", triangle.level, triangle.format == kTwoState ? 2 : 4,
                           fmt::join(states, ", "));
    });
}

std::string describe(const MeshMicromap &use)
{
    std::string text = use.micromap ? fmt::format("micromap {}", *use.micromap) : "a null micromap";
    if (use.indexType == VK_INDEX_TYPE_NONE_KHR) {
        text += ", without indices";
    } else {
        constexpr size_t kMost = 16;
        const std::vector<int32_t> some(
            use.indices.begin(), use.indices.begin() + static_cast<ptrdiff_t>(std::min(kMost, use.indices.size())));
        text += fmt::format(", {} [{}{}]", nameOf(kIndexTypeNames, use.indexType), fmt::join(some, ", "),
                            use.indices.size() > kMost ? ", ..." : "");
        if (use.stride)
            text += fmt::format(", indexStride {}", *use.stride);
        if (use.indexOffset > 0)
            text += fmt::format(", {} bytes before the first index", use.indexOffset);
    }
    return text + (use.base > 0 ? fmt::format(", baseTriangle {}", use.base) : "") +
           describeUsage(use.usagePointers, use.usage);
}

// Describes the members whose values are not the simplest ones.
std::string describe(const oracle::MeshLayout &layout)
{
    std::string text;
    if (layout.vertexFormat != VK_FORMAT_R32G32B32_SFLOAT)
        text += fmt::format(", {}", nameOf(kVertexFormatNames, layout.vertexFormat));
    if (layout.stride != 0)
        text += fmt::format(", stride {}", layout.stride);
    if (layout.isIndexed())
        text += fmt::format(", vertices by {}{}", nameOf(kIndexTypeNames, layout.indexType),
                            layout.firstIndex > 0 ? fmt::format(" from {} on", layout.firstIndex) : "");
    if (layout.primitiveOffset != 0)
        text += fmt::format(", primitiveOffset {}", layout.primitiveOffset);
    if (layout.firstVertex != 0)
        text += fmt::format(", firstVertex {}", layout.firstVertex);
    if (layout.transform)
        text += ", transformData";
    if (layout.transformOffset != 0)
        text += fmt::format(", transformOffset {}", layout.transformOffset);
    return text;
}

std::string describe(const oracle::Mesh &mesh)
{
    std::string text = mesh.boxes.empty()
                           ? counted(mesh.triangles(), "triangle")
                           : fmt::format("{} AABB{}", mesh.boxes.size(), mesh.boxes.size() == 1 ? "" : "s");
    const auto inactive =
        std::ranges::count_if(mesh.vertices, [](const Vec3 &vertex) { return std::isnan(vertex[0]); });
    if (inactive > 0)
        text += fmt::format(", {} of NaN", counted(static_cast<size_t>(inactive), "corner"));
    text += mesh.opaque ? ", VK_GEOMETRY_OPAQUE_BIT_KHR" : ", not opaque";
    if (mesh.noDuplicates)
        text += ", VK_GEOMETRY_NO_DUPLICATE_ANY_HIT_INVOCATION_BIT_KHR";
    return text + describe(mesh.layout) + (mesh.micromap ? ", " + describe(*mesh.micromap) : "");
}

std::string describe(const oracle::Instance &instance)
{
    std::string text = fmt::format("object {}, flags {}", instance.object, namesOf(instance.flags, kInstanceFlagNames));
    if (instance.record)
        text += fmt::format(", instanceShaderBindingTableRecordOffset {}", *instance.record);
    if (instance.mask != 0xff)
        text += fmt::format(", mask {:#x}", instance.mask);
    return text + (instance.inactive ? ", inactive (reference 0)" : "");
}

std::string describe(const std::vector<oracle::Instance> &instances)
{
    return listed(instances, "instance", "instances",
                  [](const oracle::Instance &instance) { return describe(instance); });
}

class Account
{
public:
    Account(const Case &c, const Verdict &verdict, Api api)
        : case_(c), verdict_(verdict), khr_(api == Api::Khr), after_(sceneAfter(c))
    {
    }

    std::string write()
    {
        line("Case of group {}, seed {}, by VK_{}_opacity_micromap.", case_.group, case_.seed, khr_ ? "KHR" : "EXT");
        if (case_.memory != Memory::Apart)
            line("All objects are side by side in few buffers{}.",
                 case_.memory == Memory::PackedToTheEnd ? "; structures are GENERIC and reach to the end of theirs"
                                                        : "");
        line("");
        line("Commands:");
        writeMicromaps();
        writeAddressCopies();
        writeObjects();
        for (const Step &step : case_.steps)
            if (targetOf(step.kind) != Target::Top)
                number("{}", commandsOf(step));
        writeTop();
        for (const Step &step : case_.steps)
            if (targetOf(step.kind) == Target::Top)
                number("{}", commandsOf(step));
        for (const QueryPlan &plan : case_.queries)
            writeQueries(plan);
        writeRay();
        return text_;
    }

private:
    template <class... T>
    void line(fmt::format_string<T...> format, T &&...values)
    {
        text_ += fmt::format(format, std::forward<T>(values)...) + "\n";
    }
    template <class... T>
    void number(fmt::format_string<T...> format, T &&...values)
    {
        text_ += fmt::format("{:3}. ", ++number_) + fmt::format(format, std::forward<T>(values)...) + "\n";
    }

    [[nodiscard]] std::string micromapBuild() const
    {
        if (case_.build.micromaps == BuildCommand::Host)
            return case_.build.deferred ? "vkBuildMicromapsEXT, deferred," : "vkBuildMicromapsEXT";
        return khr_ ? "vkCmdBuildAccelerationStructuresKHR" : "vkCmdBuildMicromapsEXT";
    }
    [[nodiscard]] const char *structureBuild() const
    {
        return case_.build.structures == BuildCommand::Indirect ? "vkCmdBuildAccelerationStructuresIndirectKHR"
                                                                : "vkCmdBuildAccelerationStructuresKHR";
    }
    void writeMicromaps()
    {
        for (size_t i = 0; i < case_.scene.micromaps.size(); ++i) {
            const oracle::SceneMicromap &micromap = case_.scene.micromaps[i];
            std::string more;
            if (micromap.triangleStride != sizeof(VkMicromapTriangleEXT))
                more += fmt::format(", triangleArrayStride {}", micromap.triangleStride);
            more += describeUsage(micromap.usagePointers, micromap.usage);
            if (micromap.onHost)
                more += ", sizes for HOST_OR_DEVICE";
            if (micromap.layout != 0)
                more += fmt::format(", data of triangles: {}", wordsOf(micromap.layout, kDataNames));
            number("{} builds micromap {}, flags {}{}{}:{}", micromapBuild(), i,
                   namesOf(micromap.flags, kMicromapFlagNames), more,
                   case_.build.together && i > 0 ? ", by the same command" : "", describe(micromap.triangles));
        }
    }
    void writeObjects()
    {
        for (size_t o = 0; o < case_.scene.objects.size(); ++o) {
            const oracle::Object &object = case_.scene.objects[o];
            number("{} builds object {}, a bottom-level structure, flags {} and those that what follows needs{}{}:",
                   structureBuild(), o, namesOf(object.flags, kStructureFlagNames),
                   object.geometryPointers ? ", ppGeometries" : "",
                   case_.build.together && o > 0 ? ", by the same command" : "");
            text_ +=
                listed(object.meshes, "geometry", "geometries", [](const oracle::Mesh &mesh) { return describe(mesh); })
                    .substr(1) +
                "\n";
        }
        if (case_.build.mixed)
            line("     Those without micromaps are built by the command that builds the micromaps.");
        if (case_.build.threads > 1)
            line("     {} threads record these builds, which are submitted to all queues.", case_.build.threads);
    }
    void writeTop()
    {
        number("{} builds the top level{}{}{}:", structureBuild(),
               case_.build.instancePointers ? " from an array of pointers" : "",
               case_.build.geometryPointers ? ", by ppGeometries" : "",
               case_.scene.topFlags != 0 ? fmt::format(", flags {} and those that what follows needs",
                                                       namesOf(case_.scene.topFlags, kStructureFlagNames))
                                         : "");
        writeInstances(case_.scene.instances);
        if (case_.build.backwards)
            line("     All builds and the rays are in three command buffers of one submission, which are recorded in "
                 "reverse order: of the micromaps, the objects, and the rest.");
        else if (case_.build.single)
            line("     All builds and the rays are in one command buffer.");
        if (case_.build.conditional != Conditional::None)
            line("     Builds, copies and queries are within conditional rendering whose predicate is {}{}.",
                 isInverted(case_.build.conditional) ? "true and inverted" : "false",
                 case_.build.single ? "" : ", and so is a dispatch after each build and copy");
        if (isAtAddress(case_.build.conditional))
            line("     It begins by vkCmdBeginConditionalRendering2EXT.");
        if (case_.build.unrelated)
            line("     Commands that build several objects build an unrelated top level first; that which builds the "
                 "top "
                 "level builds an unrelated object first.");
        if (case_.build.sharedInputs)
            line("     Inputs that other inputs begin with are in their memory.");
        if (case_.build.aliasedInputs)
            line("     A second buffer has the first half of the memory of each input.");
        if (case_.build.lateInputs)
            line("     Inputs are written when the commands are recorded.");
        if (case_.build.rerecorded)
            line("     Command buffers of builds, copies and updates are recorded twice, and then executed.");
        if (case_.build.anotherThread)
            line("     Another thread records builds, copies and updates than what else is in their command buffers.");
        if (case_.build.secondDevice)
            line("     A second device carries out the same, something while each command buffer is recorded.");
        if (case_.build.secondary)
            line("     Builds, copies and updates are in secondary command buffers.");
        if (case_.build.twice)
            line("     Command buffers of builds, copies and updates are submitted twice.");
        if (case_.build.spareInstances > 0)
            line("     ppMaxPrimitiveCounts allows for {} more.", case_.build.spareInstances);
        if (case_.build.skippedInstances > 0)
            line("     primitiveOffset skips {} before them.", case_.build.skippedInstances);
        if (case_.build.otherTop)
            line("     The same command builds another top level, of the same instances in reverse order without "
                 "flags.");
    }
    void writeInstances(const std::vector<oracle::Instance> &instances)
    {
        text_ += describe(instances).substr(1) + "\n";
    }

    [[nodiscard]] std::string commandsOf(const Step &step) const;
    void writeTracePlan();
    void writePipeline(const PipelinePlan &pipeline);
    void writeQueries(const QueryPlan &plan);
    void writeAddressCopies();
    void writeRay();
    void writeHit(const Ray &ray, const Hit &hit);
    [[nodiscard]] int explainState(const Hit &hit);

    const Case &case_;
    const Verdict &verdict_;
    bool khr_;
    Scene after_;
    std::string text_;
    int number_ = 0;
};

void Account::writeQueries(const QueryPlan &plan)
{
    number("A pool of {} queries of {}:", plan.count, nameOf(kPropertyNames, plan.property));
    for (const QueryCommand &command : plan.commands) {
        constexpr std::array kNames{"vkCmdResetQueryPool",       "vkResetQueryPool",
                                    "vkCmdWrite...Properties",   "vkGetQueryPoolResults",
                                    "vkCmdCopyQueryPoolResults", "vkWriteMicromapsPropertiesEXT"};
        std::string text =
            command.byAddress ? "vkCmdCopyQueryPoolResultsToMemoryKHR" : kNames[static_cast<size_t>(command.kind)];
        if (command.kind != QueryCommand::Kind::WriteOnHost)
            text += fmt::format(" of queries {} to {}", command.first, command.first + command.count - 1);
        for (const QueryTarget &target : command.targets)
            text += target.of == QueryTarget::Of::Top
                        ? ", the top level"
                        : fmt::format(", {} {}", nameOf(kQueryTargetNames, target.of), target.number);
        if (command.wide)
            text += ", 64 bits";
        if (command.availability)
            text += ", with availability";
        if (command.wait)
            text += ", waiting";
        if (command.partial)
            text += ", partial";
        if (command.offset > 0)
            text += fmt::format(", at offset {}", 8 * command.offset);
        if (command.padding > 0)
            text += fmt::format(", {} bytes between results", 8 * command.padding);
        line("     {}", text);
    }
}

// What a command does with a region.
std::string describe(const AddressPlan &plan, const AddressCommand &command, const AddressRegion &region)
{
    const std::string place = fmt::format("buffer {} + {}", region.buffer, region.offset);
    const std::string range =
        region.spare > 0 ? fmt::format(", in a range of {} bytes", rangeSize(plan, command, region)) : std::string();
    switch (command.kind) {
    case AddressCommand::Kind::Copy:
        return fmt::format("{} bytes from buffer {} + {} to {}{}", region.size, region.from, region.fromOffset, place,
                           range);
    case AddressCommand::Kind::Update: return fmt::format("{} bytes at {}{}", region.size, place, range);
    case AddressCommand::Kind::Fill:
        return fmt::format("{} bytes at {}, with {:#010x}", region.size, place, command.value);
    default: break;
    }
    const std::string image = fmt::format("level {}, layers {} to {}, {} x {} x {} texels at ({}, {}, {})",
                                          region.level, region.layer, region.layer + region.layers - 1, region.width,
                                          region.height, region.depth, region.x, region.y, region.z);
    const bool to = command.kind == AddressCommand::Kind::CopyToImage;
    return fmt::format("from {} to {}, addressRowLength {}, addressImageHeight {}{}", to ? place : image,
                       to ? image : place, region.rowLength, region.imageHeight, range);
}

void Account::writeAddressCopies()
{
    const AddressPlan &plan = case_.addressCopies;
    if (plan.commands.empty())
        return;
    number("Commands at device addresses of buffers of {} bytes, with a barrier after each:",
           fmt::join(plan.buffers, ", "));
    for (size_t i = 0; i < plan.commands.size(); ++i) {
        const AddressCommand &command = plan.commands[i];
        line("     command {}: {}{}:", i, nameOf(kAddressCommandNames, command.kind),
             command.fullyBound ? ", FULLY_BOUND" : "");
        for (const AddressRegion &region : command.regions)
            line("       {}", describe(plan, command, region));
    }
    if (usesImage(plan))
        line("     The image: {} x {} x {} {}, {}, {}, {}.", plan.width, plan.height, plan.depth,
             nameOf(kImageFormatNames, plan.format), counted(plan.levels, "level"), counted(plan.layers, "layer"),
             plan.optimal ? "VK_IMAGE_LAYOUT_TRANSFER_..._OPTIMAL" : "VK_IMAGE_LAYOUT_GENERAL");
}

std::string Account::commandsOf(const Step &step) const
{
    const uint32_t t = step.target;
    const char *const mirrored = step.mirrored ? ", with x of all vertices and boxes mirrored" : "";
    const char *const elsewhere = !step.outOfPlace ? ""
                                  : step.exact     ? " to a new structure, which is as large as queried"
                                                   : " to a new structure";
    const char *const exact = step.exact && !step.outOfPlace
                                  ? ", first to one as large as VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SIZE_KHR reports"
                                  : "";
    // The command for micromaps.
    const auto command = [&](const char *khr, const char *ext, const char *host) {
        return std::string(khr_ ? khr : step.host ? host : ext) + (step.deferred ? ", deferred," : "");
    };
    const std::string copyMicromap =
        command("vkCmdCopyAccelerationStructureKHR", "vkCmdCopyMicromapEXT", "vkCopyMicromapEXT");
    const std::string serialize = command("vkCmdCopyAccelerationStructureToMemoryKHR", "vkCmdCopyMicromapToMemoryEXT",
                                          "vkCopyMicromapToMemoryEXT");
    const std::string load = command("vkCmdCopyMemoryToAccelerationStructureKHR", "vkCmdCopyMemoryToMicromapEXT",
                                     "vkCopyMemoryToMicromapEXT");
    const std::string users = step.update
                                  ? fmt::format("the structures that use it are updated{} (MODE_UPDATE)", elsewhere)
                                  : "the structures that use it are built again";
    switch (step.kind) {
    case Kind::CloneObject: return fmt::format("vkCmdCopyAccelerationStructureKHR clones object {}{}.", t, exact);
    case Kind::CompactObject:
        return fmt::format("vkCmdWriteAccelerationStructuresPropertiesKHR queries the compacted size of object {}, to "
                           "which vkCmdCopyAccelerationStructureKHR compacts it.",
                           t);
    case Kind::ReloadObject:
        return fmt::format("vkCmdCopyAccelerationStructureToMemoryKHR serializes object {}, and "
                           "vkCmdCopyMemoryToAccelerationStructureKHR deserializes it to a new structure{}.",
                           t,
                           step.relocated ? fmt::format(", {} its micromaps are serialized and deserialized to new "
                                                        "ones, whose addresses are put into the data",
                                                        step.structureFirst ? "before" : "after")
                                          : "");
    case Kind::UpdateObject:
        return fmt::format("vkCmdBuildAccelerationStructuresKHR updates object {} with the same data{}{}.", t, mirrored,
                           elsewhere);
    case Kind::RebuildObject:
        return fmt::format("vkCmdBuildAccelerationStructuresKHR builds object {} again{}.", t, mirrored);
    case Kind::ReplaceObject:
        return fmt::format(
            "vkCmdBuildAccelerationStructuresKHR builds object {} again, with the geometries of object {}.", t,
            step.other);
    case Kind::MoveObject:
        return fmt::format(
            "vkCmdCopyAccelerationStructureKHR clones object {}, and object {} is built in its memory by "
            "the same command buffer.",
            t, step.other);
    case Kind::RenameObject:
        return fmt::format("vkCreateAccelerationStructureKHR makes a second handle at the address of object {}, whose "
                           "first one is destroyed.",
                           t);
    case Kind::RebuildObjects:
        return fmt::format("One vkCmdBuildAccelerationStructuresKHR builds every second object again, among them "
                           "{}{}{}.",
                           t, step.update ? ", which is updated" : "", elsewhere);
    case Kind::CloneMicromap:
        return fmt::format("{} clones micromap {}{}; {}.", copyMicromap, t,
                           step.states.empty() ? "" : ", and the original is built with other states", users);
    case Kind::CompactMicromap:
        return fmt::format("{} compacts micromap {} to the size that a query reports; {}.", copyMicromap, t, users);
    case Kind::ReloadMicromap:
        return fmt::format("{} serializes micromap {}, {} deserializes it to {}{}; {}.", serialize, t, load,
                           step.inPlace ? "its own memory" : "a new one",
                           step.states.empty() ? "" : ", where other states were built in between", users);
    case Kind::SetStates:
        return fmt::format("Micromap {} is built {}{} with other states; {}:{}", t,
                           step.inPlace ? "by its handle" : "anew", step.host ? " by vkBuildMicromapsEXT" : "", users,
                           describe(step.states));
    case Kind::SetIndices:
        return fmt::format("vkCmdBuildAccelerationStructuresKHR {} object {}{}, whose geometry {} has now {}.",
                           step.update ? "updates" : "builds again", t, elsewhere, step.other,
                           step.micromapUse ? describe(*step.micromapUse) : "no micromap");
    case Kind::CloneTop: return fmt::format("vkCmdCopyAccelerationStructureKHR clones the top level{}.", exact);
    case Kind::CompactTop: return "vkCmdCopyAccelerationStructureKHR compacts the top level.";
    case Kind::ReloadTop:
        return fmt::format("The top level is serialized and deserialized to a new structure{}.",
                           step.relocated ? ", with the addresses of clones of its objects in the data" : "");
    default: {
        return fmt::format("vkCmdBuildAccelerationStructuresKHR {} the top level{}:",
                           step.kind == Kind::UpdateTop ? "updates" : "builds again", elsewhere) +
               describe(step.instances);
    }
    }
}

// Writes where the state comes from, and returns it as outcomeOf takes it.
int Account::explainState(const Hit &hit)
{
    const oracle::Instance &instance = after_.instances[hit.instance];
    const oracle::Mesh &mesh = after_.objects[instance.object].meshes[hit.geometry];
    const char *const own = mesh.opaque ? "opaque (VK_GEOMETRY_OPAQUE_BIT_KHR)" : "not opaque";
    if (!mesh.micromap) {
        line("  - The triangle has no micromap; its geometry is {}.", own);
        return oracle::kNoMicromap;
    }
    const MeshMicromap &use = *mesh.micromap;
    const int32_t index = use.indexOf(hit.primitive);
    int state = -1 - index;
    uint32_t element = 0;
    if (index < 0) {
        line("  - Its index is {}, the special index for {}.", index, kStateNames[static_cast<size_t>(state)]);
    } else {
        const size_t number = static_cast<size_t>(index) + use.base;
        const oracle::SceneMicromap &micromap = after_.micromaps[*use.micromap];
        const MicromapTriangle &triangle = micromap.triangles[number];
        double edge = 1;
        const uint32_t micro = oracle::microTriangleAt(hit.u, hit.v, triangle.level, edge);
        state = triangle.states[micro];
        line("  - Index {} + baseTriangle {}: triangle {} of micromap {}, level {}. Micro-triangle {} of {} is {}.",
             index, use.base, number, *use.micromap, triangle.level, micro, triangle.states.size(),
             kStateNames[static_cast<size_t>(state)]);
        element = micro;
    }
    const auto made = verdict_.substitution.find({instance.object, hit.geometry, hit.primitive, element});
    if (made != verdict_.substitution.end()) {
        state = made->second;
        line("  - The build is lossy, which allows unknown states. An equal build on a second device is {} there, so "
             "this one must be as well.",
             kStateNames[static_cast<size_t>(state)]);
    }
    if ((instance.flags & kFlagDisable) != 0)
        line("  - The instance disables micromaps; the geometry is {}.", own);
    return state;
}

void Account::writeHit(const Ray &ray, const Hit &hit)
{
    const oracle::Instance &instance = after_.instances[hit.instance];
    const oracle::Mesh &mesh = after_.objects[instance.object].meshes[hit.geometry];
    if (hit.box) {
        line("It {} AABB {} of geometry {} of instance {}.", hit.certain ? "meets" : "may meet", hit.primitive,
             hit.geometry, hit.instance);
    } else {
        line("It meets triangle {} of geometry {} of instance {} at t = {:.5g}, barycentrics ({:.5g}, {:.5g}).",
             hit.primitive, hit.geometry, hit.instance, hit.t, hit.u, hit.v);
    }
    const int state = hit.box ? oracle::kBox : explainState(hit);
    const bool micromap = state >= 0 && (instance.flags & kFlagDisable) == 0;
    if (micromap && ((instance.flags & kFlagTwoState) != 0 || (ray.flags & kRayForceTwoState) != 0))
        line("  - The {} forces two states: unknown-transparent is transparent, unknown-opaque is opaque.",
             (instance.flags & kFlagTwoState) != 0 ? "instance" : "ray");
    if ((instance.flags & VK_GEOMETRY_INSTANCE_FORCE_OPAQUE_BIT_KHR) != 0)
        line("  - The instance forces what is not transparent to be opaque.");
    if ((instance.flags & VK_GEOMETRY_INSTANCE_FORCE_NO_OPAQUE_BIT_KHR) != 0)
        line("  - The instance forces what is not transparent to be non-opaque.");
    switch (oracle::outcomeOf(state, mesh.opaque, instance.flags, ray.flags)) {
    case oracle::Outcome::Ignored: line("  - So it is ignored: no shader sees it."); break;
    case oracle::Outcome::Culled: line("  - The ray culls it by its opacity."); break;
    case oracle::Outcome::Opaque: line("  - So it is opaque: accepted, and no candidate."); break;
    case oracle::Outcome::NonOpaque: line("  - So it is non-opaque: a candidate."); break;
    }
}

// Writes the parts that are not the default of ray queries.
void Account::writeTracePlan()
{
    const TracePlan &trace = case_.trace;
    const TracePlan standard;
    if (trace.flags != standard.flags)
        line("Ray flags are {}.", nameOf(kFlagSourceNames, trace.flags));
    if (trace.signedFlags)
        line("Ray flags are a signed integer in the shader.");
    if (trace.method == TracePlan::Method::Query) {
        switch (trace.query) {
        case TracePlan::Query::Plain: break;
        case TracePlan::Query::Array: line("The ray query is one of two in an array."); break;
        case TracePlan::Query::Functions: line("The ray query is a parameter of functions."); break;
        case TracePlan::Query::Again: line("The ray query was initialized before, and is initialized again."); break;
        case TracePlan::Query::Getters: line("The shader also reads origins, directions and transforms."); break;
        case TracePlan::Query::Sites:
            line("The ray query is initialized in two places, of which rays take one.");
            break;
        case TracePlan::Query::Condition: line("The condition of the loop also counts."); break;
        case TracePlan::Query::Carried:
            line("The loop swaps two values in each iteration, and has two continue paths.");
            break;
        case TracePlan::Query::Beside: line("Another ray query with other flags proceeds in the same loop."); break;
        }
        if (trace.shaderObjects)
            line("The shader is a shader object.");
        if (trace.rebound)
            line("A {} is bound before it.", trace.shaderObjects ? "pipeline" : "shader object");
        if (trace.vertexBuffers)
            line("Numbers of rays come from buffers that vkCmdBindVertexBuffers3KHR and vkCmdBindIndexBuffer3KHR "
                 "bind{}.",
                 trace.dynamicStrides ? ", which sets their strides" : "");
        if (trace.optimized)
            line("The module is optimized by spirv-opt.");
        if (trace.otherEntry != OtherEntry::None)
            line("The module has another entry point, whose execution mode is the opposite{}.",
                 trace.otherEntry == OtherEntry::Empty          ? ""
                 : trace.otherEntry == OtherEntry::SharedBefore ? "; it comes first, and calls the same function"
                                                                : "; it comes second, and calls the same function");
        return;
    }
    if (trace.from != standard.from)
        line("A {} shader traces the rays, in recursion.", nameOf(kFromNames, trace.from));
    if (trace.withoutMicromaps)
        line("The pipeline lacks the micromap bit.");
    if (trace.attributes != standard.attributes)
        line("Hit attributes are not a vec2: {}.", nameOf(kAttributeNames, trace.attributes));
    if (trace.creation != 0)
        line("Pipelines are created: {}.", wordsOf(trace.creation, kCreationNames));
    if (trace.flags2)
        line("Pipeline flags are in VkPipelineCreateFlags2CreateInfo.");
    if ((trace.chained & (kChainFeedback | kChainRobustness)) != 0)
        line("Other structures in the pNext chain of the create info{}: {}.",
             !trace.flags2                             ? ""
             : (trace.chained & kChainFlagsFirst) != 0 ? ", behind that"
                                                       : ", before that",
             wordsOf(trace.chained & ~uint32_t{kChainFlagsFirst}, kChainedNames));
    if (trace.callables)
        line("The ray generation shader executes a callable shader as well.");
    writePipeline(trace.pipeline);
    for (const PipelinePlan &pipeline : trace.otherPipelines) {
        line("Another pipeline traces the rays afterwards, by the same command buffer:");
        writePipeline(pipeline);
    }
    if (trace.tablesInPlace)
        line("Each binding table of a pipeline is written over the one before, by the command buffer that traces. The "
             "barrier is {} for {}.",
             (trace.tableBarrier & kBarrierOfMemory) != 0 ? "of all memory," : "of its buffer,",
             (trace.tableBarrier & kBarrierForTables) != 0 ? "VK_ACCESS_2_SHADER_BINDING_TABLE_READ_BIT_KHR"
                                                           : "VK_ACCESS_2_SHADER_READ_BIT");
    if (trace.firstDestroyed)
        line("Then the first pipeline is destroyed, and the others trace again.");
}

void Account::writePipeline(const PipelinePlan &pipeline)
{
    if (pipeline.flags != 0)
        line("Pipeline flags: {}.", namesOf(pipeline.flags, kPipelineFlagNames));
    const auto listOf = [](const std::vector<uint32_t> &numbers, const auto &names) {
        std::vector<std::string_view> list;
        for (const uint32_t number : numbers)
            list.push_back(nameOf(names, number));
        return list.empty() ? std::string("none") : fmt::format("{}", fmt::join(list, ", "));
    };
    for (size_t i = 0; i < pipeline.parts.size(); ++i) {
        const PipelinePart &part = pipeline.parts[i];
        line("     {}: stages {}; groups {}{}{}.",
             i + 1 == pipeline.parts.size() ? std::string("pipeline") : fmt::format("library {}", i),
             listOf(part.stages, kTracerStageNames), listOf(part.groups, kTracerGroupNames),
             part.libraries.empty() ? "" : fmt::format("; links libraries {}", fmt::join(part.libraries, ", ")),
             part.micromapBit ? "; with the micromap bit" : "");
    }
    const TraceParameters &parameters = pipeline.parameters;
    line("traceRayEXT: sbtRecordOffset {}, sbtRecordStride {}, missIndex {}.", parameters.recordOffset,
         parameters.recordStride, parameters.missIndex);
    for (size_t t = 0; t <= pipeline.otherTables.size(); ++t) {
        const oracle::TablePlan &table = t == 0 ? pipeline.table : pipeline.otherTables[t - 1];
        std::string text = fmt::format("Hit records: {}", table.length ? fmt::format("{}", *table.length)
                                                                       : "as many as the scene reaches");
        std::vector<std::string_view> kinds;
        for (const oracle::HitRecord record : table.records)
            kinds.push_back(nameOf(kHitRecordNames, record));
        if (!kinds.empty())
            text += fmt::format(", in turn {}", fmt::join(kinds, ", "));
        if (table.zeroData)
            text += fmt::format(", the data of record {} begins with 0", *table.zeroData);
        if (table.layout.zeroStride)
            text += ", stride 0";
        if (table.layout.hitPadding > 0)
            text += fmt::format(", stride {} handle alignments longer than needed", table.layout.hitPadding);
        if (table.layout.cut)
            text += ", the region ends with the data of the last record";
        if (table.layout.otherStride)
            text += ", after a trace of no rays with another stride of the region";
        text += fmt::format("; {} miss record{}{}", table.misses, table.misses == 1 ? "" : "s",
                            table.nullMiss ? ", that of the rays zero" : "");
        line("{}.", text);
    }
}

void Account::writeRay()
{
    const std::string tracer = case_.trace.method == TracePlan::Method::Pipeline
                                   ? std::string("a ray tracing pipeline")
                                   : fmt::format("a ray query in stage {}", nameOf(kStageNames, case_.trace.stage));
    line("");
    if (!verdict_.ray) { // the fault is not about a ray
        line("{} traced by {}.", counted(after_.rays.size(), "ray"), tracer);
        if (!verdict_.detail.empty())
            line("\nFound:\n{}", verdict_.detail);
        return;
    }
    const size_t number = std::min<size_t>(*verdict_.ray, after_.rays.size() - 1);
    const Ray &ray = after_.rays[number];
    line("Ray {} of {}, traced by {}:", number, after_.rays.size(), tracer);
    if (case_.trace.secondary)
        line("The commands that trace are in a secondary command buffer.");
    if (case_.trace.boundFirst)
        line("What traces was bound before the builds of the same command buffer{}.",
             case_.trace.pipelineLast ? "; the shader is bound after them" : "");
    if (case_.trace.twice)
        line("The command buffer is submitted twice{}.",
             case_.build.backwards ? ", those of the micromaps and the objects once" : "");
    if (case_.trace.rerecorded)
        line("The command buffer is recorded twice, and then executed.");
    if (case_.trace.maintenance6)
        line("The descriptor set is bound by vkCmdBindDescriptorSets2KHR, and constants are pushed by "
             "vkCmdPushConstants2KHR.");
    writeTracePlan();
    const LaunchPlan &launch = case_.trace.launch;
    if (case_.trace.method == TracePlan::Method::Query && launch.command != Launch::Direct)
        line("The command is indirect{}{}{}.", launch.command == Launch::Indirect2 ? ", by an address" : "",
             launch.counted ? ", and reads how many draws it makes" : "",
             launch.offset > 0 ? fmt::format(", {} bytes before its parameters", 4 * launch.offset) : "");
    else if (case_.trace.method == TracePlan::Method::Pipeline && launch != LaunchPlan())
        line("The command is vkCmdTraceRays{}KHR, height {}, depth {}{}.",
             launch.command == Launch::Direct     ? ""
             : launch.command == Launch::Indirect ? "Indirect"
                                                  : "Indirect2",
             launch.height, launch.depth,
             launch.offset > 0 ? fmt::format(", {} bytes before its parameters", 4 * launch.offset) : "");
    line("origin ({}), direction ({}), t {} to {}, cull mask {:#x}, flags {}; candidates are confirmed: {}.",
         fmt::join(ray.origin, ", "), fmt::join(ray.direction, ", "), ray.tMin, ray.tMax, ray.cullMask,
         namesOf(ray.flags, kRayFlagNames), nameOf(kRuleNames, ray.rule));
    // Without micromaps, no hit is ignored.
    Scene bare = after_;
    for (oracle::Object &object : bare.objects)
        for (oracle::Mesh &mesh : object.meshes)
            mesh.micromap.reset();
    Ray plain = ray;
    plain.flags &= ~(kRayOpaque | kRayNoOpaque | kRayCullOpaque | kRayCullNoOpaque);
    oracle::Hits hits = oracle::allHits(bare, plain);
    std::ranges::sort(hits.hits, {}, &Hit::t);
    line("");
    line("Expected:");
    for (const Hit &hit : hits.hits)
        writeHit(ray, hit);
    if (hits.unsure)
        line("The ray also meets something so near to an edge that rounding decides.");
    else if (hits.hits.empty())
        line("It meets nothing.");
    if (!verdict_.detail.empty()) {
        line("");
        line("Found:");
        line("{}", verdict_.detail);
    }
}

} // namespace

std::string accountOf(const Case &c, const Verdict &verdict, Api api)
{
    return Account(c, verdict, api).write();
}

} // namespace vellum::check
