// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "check/case/address_copies.h"
#include "check/case/built_case.h"
#include "check/case/lossy.h"
#include "check/case/names.h"
#include "check/case/trace.h"
#include "check/oracle/query_fault.h"

namespace vellum::check
{

namespace
{

// The feature that the device lacks for the queries of a case; empty: none.
std::string missingForQueries(const Device &gpu, const Case &c)
{
    using Kind = QueryCommand::Kind;
    using Property = QueryPlan::Property;
    const bool maintenance = gpu.has(VK_KHR_RAY_TRACING_MAINTENANCE_1_EXTENSION_NAME);
    bool exact = std::ranges::any_of(c.steps, [](const Step &step) { return step.exact && !step.outOfPlace; });
    for (const QueryPlan &plan : c.queries) {
        const bool newer = plan.property == Property::Size || plan.property == Property::BottomLevelPointers;
        exact |= newer;
        bool micromaps = false, structures = false;
        for (const QueryCommand &command : plan.commands) {
            if (command.kind == Kind::ResetOnHost && !gpu.hasHostQueryReset())
                return "hostQueryReset is not supported";
            if (command.kind == Kind::WriteOnHost && !gpu.hasMicromapHostCommands())
                return "micromapHostCommands is not supported";
            if (command.byAddress && !gpu.has(VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME))
                return "VK_KHR_device_address_commands is not supported";
            for (const QueryTarget &target : command.targets)
                (target.of == QueryTarget::Of::Micromap ? micromaps : structures) = true;
        }
        if (!gpu.khr() && micromaps && (structures || newer))
            return "VK_EXT_opacity_micromap has other queries for micromaps";
    }
    return exact && !maintenance ? "VK_KHR_ray_tracing_maintenance1 is not supported" : "";
}

// The feature that the device lacks for the copies at addresses of a case; empty: none.
std::string missingForAddresses(const Device &gpu, const AddressPlan &plan)
{
    if (!plan.commands.empty() && !gpu.has(VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME))
        return "VK_KHR_device_address_commands is not supported";
    return usesImage(plan) && !supportsImage(gpu, plan) ? "an image of the type, format and size is not supported" : "";
}

uint32_t levelLimit(const Device &gpu, const oracle::MicromapTriangle &triangle, VkBuildMicromapFlagsEXT flags)
{
    const bool lossy = (flags & kLossy) != 0 && triangle.format == kFourState;
    return lossy ? gpu.maxLossyLevel() : gpu.maxLevel(triangle.format);
}

// A limit that is lower than the specification requires, and too low for a micromap of the case; empty: none.
std::string limitFault(const Device &gpu, const oracle::Scene &scene)
{
    for (const oracle::SceneMicromap &micromap : scene.micromaps)
        for (const oracle::MicromapTriangle &triangle : micromap.triangles)
            if (const uint32_t limit = levelLimit(gpu, triangle, micromap.flags); triangle.level > limit)
                return "a limit is lower than the specification requires (subdivision level " + std::to_string(limit) +
                       ", not at least " + std::to_string(kRequiredLevel) + ")";
    return {};
}

// The feature that the device lacks for a build of a micromap of these flags; empty: none.
std::string missingForMicromap(const Device &gpu, std::span<const oracle::MicromapTriangle> triangles,
                               VkBuildMicromapFlagsEXT flags)
{
    if (triangles.size() > gpu.maxMicromapTriangles())
        return "more triangles in a micromap than maxMicromapTriangles";
    for (const oracle::MicromapTriangle &triangle : triangles) {
        if (triangle.level > std::max(levelLimit(gpu, triangle, flags), kRequiredLevel))
            return "a subdivision level is above the limit of the device";
    }
    return {};
}

// The feature that the device lacks for the flags of structures; empty: none.
std::string missingForFlags(const Device &gpu, const oracle::Scene &scene)
{
    VkBuildAccelerationStructureFlagsKHR flags = scene.topFlags;
    for (const oracle::Object &object : scene.objects)
        flags |= object.flags;
    // VUID-VkAccelerationStructureBuildGeometryInfoKHR-flags-11709
    if ((flags & kAllowDataUpdate) != 0 && gpu.khr())
        return "VK_KHR_opacity_micromap has no updates of the data of micromaps";
    if ((flags & kAllowDataAccess) != 0 && !gpu.has("VK_KHR_ray_tracing_position_fetch"))
        return "VK_KHR_ray_tracing_position_fetch is not supported";
    return {};
}

// The feature that the device lacks for a case, whose steps lead to the scene `after`; empty: none.
std::string missing(const Device &gpu, const Case &c, const oracle::Scene &after)
{
    if (c.build.micromaps == BuildCommand::Host && !gpu.hasMicromapHostCommands())
        return "micromapHostCommands is not supported";
    if (std::ranges::any_of(c.steps, &Step::host) && !gpu.hasMicromapHostCommands())
        return "micromapHostCommands is not supported";
    if (c.build.conditional != Conditional::None && !gpu.has(VK_EXT_CONDITIONAL_RENDERING_EXTENSION_NAME))
        return "VK_EXT_conditional_rendering is not supported";
    if (isAtAddress(c.build.conditional) && !gpu.has(VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME))
        return "VK_KHR_device_address_commands is not supported";
    if (c.build.structures == BuildCommand::Indirect && !gpu.hasIndirectBuilds())
        return "accelerationStructureIndirectBuild is not supported";
    if (std::string lacks = missingForQueries(gpu, c) + missingForFlags(gpu, c.scene); !lacks.empty())
        return lacks;
    if (std::string lacks = missingForAddresses(gpu, c.addressCopies); !lacks.empty())
        return lacks;
    if (c.scene.instances.size() > gpu.maxInstances())
        return "more instances than maxInstanceCount";
    for (const oracle::Object &object : c.scene.objects) {
        uint64_t primitives = 0;
        for (const oracle::Mesh &mesh : object.meshes)
            primitives += mesh.vertices.size() / 3 + mesh.boxes.size();
        if (object.meshes.size() > gpu.maxGeometries() || primitives > gpu.maxPrimitives())
            return "more geometries or primitives than maxGeometryCount or maxPrimitiveCount";
    }
    for (const oracle::SceneMicromap &micromap : c.scene.micromaps) {
        if (micromap.onHost && !gpu.hasMicromapHostCommands())
            return "micromapHostCommands is not supported";
        // VUID-VkAccelerationStructureGeometryMicromapDataKHR-triangleArrayStride-11647
        if (micromap.triangleStride % 4 != 0 && gpu.khr())
            return "VK_KHR_opacity_micromap has strides of triangle arrays in multiples of 4 only";
        if ((micromap.flags & kLossy) != 0 && !gpu.khr())
            return "VK_EXT_opacity_micromap has no lossy builds";
        if ((micromap.flags & kLossy) != 0 && !gpu.has(VK_KHR_RAY_QUERY_EXTENSION_NAME))
            return "VK_KHR_ray_query is not supported, by which states of lossy builds are found out";
        if (std::string lacks = missingForMicromap(gpu, micromap.triangles, micromap.flags); !lacks.empty())
            return lacks;
    }
    for (const Step &step : c.steps) {
        if (step.states.empty())
            continue;
        if (std::string lacks = missingForMicromap(gpu, step.states, c.scene.micromaps[step.target].flags);
            !lacks.empty())
            return lacks;
    }
    const auto hasByteIndices = [](const std::optional<oracle::MeshMicromap> &use) {
        return use && use->indexType == VK_INDEX_TYPE_UINT8_EXT;
    };
    const bool byteIndices = std::ranges::any_of(c.steps, hasByteIndices, &Step::micromapUse) ||
                             std::ranges::any_of(c.scene.objects, [&](const oracle::Object &object) {
                                 return std::ranges::any_of(object.meshes, hasByteIndices, &oracle::Mesh::micromap);
                             });
    if (byteIndices && !(gpu.khr() && gpu.has(VK_EXT_INDEX_TYPE_UINT8_EXTENSION_NAME)))
        return "micromap indices of 8 bits are not supported";
    if (!skipsPrimitives(gpu) && std::ranges::any_of(c.scene.rays, [](const Ray &ray) {
            return (ray.flags & (kRaySkipTriangles | kRaySkipBoxes)) != 0;
        }))
        return "neither rayTraversalPrimitiveCulling nor rayQuery is supported";
    const std::vector<VkFormat> formats = gpu.vertexFormats();
    for (const oracle::Object &object : c.scene.objects)
        for (const oracle::Mesh &mesh : object.meshes)
            if (std::ranges::find(formats, mesh.layout.vertexFormat) == formats.end())
                return "a vertex format is not supported";
    if (const auto lacks = missingFor(gpu, c.trace))
        return *lacks;
    return sceneRule(gpu, c.trace, after).value_or("");
}

// BuildPlan::secondDevice: the twin of the device carries out the same case.
class SecondDevice
{
public:
    // Null: the case has none.
    static std::unique_ptr<SecondDevice> of(Device &gpu, const Case &c, const oracle::Scene &after,
                                            std::span<const oracle::Hits> hits)
    {
        return c.build.secondDevice ? std::make_unique<SecondDevice>(gpu, c, after, hits) : nullptr;
    }
    SecondDevice(Device &gpu, const Case &c, const oracle::Scene &after, std::span<const oracle::Hits> hits)
        : gpu_(gpu), trace_(c.trace), after_(after), hits_(hits), built_(gpu.twin(), c)
    {
    }
    void advance() { built_.advance(); }
    // Finishes what is built and traces.
    void trace()
    {
        built_.finish();
        faults_ = traceFaults(gpu_.twin(), built_.top(), after_, hits_, trace_,
                              [this](VkCommandBuffer commands) { built_.recordWithRays(commands); });
    }
    // Adds its faults to those of the first device's rays.
    void addFaults(std::vector<std::string> &faults) const
    {
        for (size_t i = 0; i < faults_.size(); ++i)
            if (faults[i].empty() && !faults_[i].empty())
                faults[i] = faults_[i] + " (on the second device)";
    }

private:
    Device &gpu_;
    const TracePlan &trace_;
    const oracle::Scene &after_;
    std::span<const oracle::Hits> hits_;
    BuiltCase built_;
    std::vector<std::string> faults_;
};

} // namespace

Verdict run(Device &gpu, const Case &c)
{
    Verdict verdict;
    const oracle::Scene after = sceneAfter(c);
    if (std::string lacks = missing(gpu, c, after); !lacks.empty()) {
        verdict.cause = std::move(lacks);
        verdict.skipped = true;
        return verdict;
    }
    if (const std::string fault = limitFault(gpu, c.scene); !fault.empty()) {
        verdict.cause = oracle::causeOf(fault);
        verdict.detail = fault;
        return verdict;
    }
    gpu.insertLabel(c.group + " " + std::to_string(c.seed));
    gpu.takeFaults();
    std::vector<oracle::Hits> hits = oracle::allHits(after);
    const bool lossy = std::ranges::any_of(hits, [](const oracle::Hits &of) { return !of.lossy.empty(); });
    LossyStates expected;
    if (lossy) {
        expected = lossyStatesOfTwin(gpu, c, after, hits);
        hits = oracle::allHits(after, expected.states);
        verdict.substitution = expected.states;
    }
    std::vector<std::string> faults;
    {
        BuiltCase built(gpu, c);
        const std::unique_ptr<SecondDevice> second = SecondDevice::of(gpu, c, after, hits);
        if (second)
            built.setBetween([&] { second->advance(); });
        built.finish();
        PlannedTracer::Record withRays;
        if (c.build.single || c.trace.besideBuild || second)
            withRays = [&](VkCommandBuffer commands) {
                built.recordWithRays(commands);
                if (second)
                    second->trace();
            };
        faults = traceFaults(gpu, built.top(), after, hits, c.trace, withRays);
        if (second)
            second->addFaults(faults);
        if (lossy) {
            const std::vector<std::string> all =
                lossyFaults(expected, lossyStatesIn(gpu, built, after, hits, c.trace), hits);
            for (size_t i = 0; i < all.size(); ++i)
                faults[i] = all[i].empty() ? faults[i] : all[i];
        }
    }
    // Objects check their memory when they are destroyed.
    if (c.build.secondDevice)
        for (const std::string &fault : gpu.twin().takeFaults())
            gpu.fault(fault + " (on the second device)");
    for (size_t i = 0; i < faults.size(); ++i) {
        verdict.rays += hits[i].unsure ? 0u : 1u;
        if (faults[i].empty())
            continue;
        verdict.wrongRays.push_back(static_cast<uint32_t>(i));
        // The opacity of a hit describes a fault of several rays, if one does: one fault has one cause.
        if (!verdict.ray || oracle::rankOf(oracle::causeOf(faults[i])) > oracle::rankOf(verdict.cause)) {
            verdict.ray = static_cast<uint32_t>(i);
            verdict.cause = oracle::causeOf(faults[i]);
            verdict.detail = "ray " + std::to_string(i) + ": " + faults[i];
        }
    }
    for (const std::string &fault : gpu.takeFaults()) {
        verdict.detail += (verdict.detail.empty() ? "" : "\n") + fault;
        if (verdict.cause.empty())
            verdict.cause = oracle::causeOf(fault);
    }
    return verdict;
}

} // namespace vellum::check
