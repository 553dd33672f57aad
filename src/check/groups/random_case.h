// SPDX-License-Identifier: Apache-2.0
// Building blocks of the groups' random cases.
#pragma once

#include <algorithm>

#include "check/case/case.h"
#include "check/groups/group.h"
#include "check/oracle/random_scene.h"

namespace vellum::check
{

using oracle::below;
using oracle::chance;
using oracle::Limits;
using oracle::Random;

// What a device allows, and what cases avoid on it.
struct DeviceLimits {
    Api api = Api::Khr;
    bool byteIndices = false; // VK_INDEX_TYPE_UINT8 for micromaps
    bool rayQueries = true;
    bool pipelines = false;      // ray tracing pipelines
    bool skipsPrimitives = true; // rays do
    bool hostCommands = false;
    bool indirectBuilds = false;
    bool hostReset = false;   // of queries
    bool maintenance = false; // VK_KHR_ray_tracing_maintenance1
    bool maintenance6 = false;
    bool shaderObjects = false;
    bool countedDraws = false; // vkCmdDrawIndirectCount
    uint32_t chained = 0;      // bits of ChainedInfo
    bool dataAccess = false;   // VK_KHR_ray_tracing_position_fetch
    uint32_t maxLevel2 = 0, maxLevel4 = 0, maxLossyLevel = 0;
    std::vector<VkFormat> vertexFormats = {kVertexFormats.begin(), kVertexFormats.begin() + kRequiredVertexFormats};
    std::vector<KnownFault> faults;

    // Only VK_KHR_opacity_micromap demands multiples of 4:
    // VUID-VkAccelerationStructureGeometryMicromapDataKHR-triangleArrayStride-11647.
    [[nodiscard]] bool oddStrides() const { return api == Api::Ext; }
    // VK_KHR_device_address_commands, on which VK_KHR_opacity_micromap depends.
    [[nodiscard]] bool addressCommands() const { return api == Api::Khr; }
    // Bottom-level structures with micromaps can be serialized.
    [[nodiscard]] bool serializesMicromaps() const { return api == Api::Ext || !has(Fault::LayerSerializedStructures); }
    [[nodiscard]] bool has(Fault fault) const
    {
        return std::ranges::any_of(faults, [fault](const KnownFault &known) { return known.fault == fault; });
    }
};

DeviceLimits limitsOf(const Device &gpu);

using MakeCase = Case (*)(Random &random, const DeviceLimits &limits);

// Limits of a small scene that most groups use.
Limits smallScene(const DeviceLimits &limits);
// A scene of these limits, with no levels above what the device allows.
oracle::Scene makeScene(Random &random, const Limits &scene, const DeviceLimits &limits);
// An instance of object 0 without a transform.
oracle::Instance instanceInPlace(Random &random);
// A ray against z with random flags, which cull by opacity at most. The caller places its origin.
Ray rayDown(Random &random);
// Rays that meet the right-angled triangle there (appendTriangle) at the centres of micro-triangles of that level.
void aimAt(Random &random, oracle::Scene &scene, const Vec3 &place, uint32_t level, uint32_t rays);
// States that are the same within sub-triangles, as those of a picture are: none smaller than of 4^least states.
oracle::MicromapTriangle patchyTriangle(Random &random, uint32_t level, uint32_t least);
// Some micromap triangle gets a high level, with 2^16 bytes of data or more, where the device allows it. Returns its
// micromap and its number; nothing where there are no triangles.
std::optional<std::pair<uint32_t, uint32_t>> makeFine(Random &random, oracle::Scene &scene, const DeviceLimits &limits);
// A random step of that kind; nothing where the scene has nothing that it could be done to.
std::optional<Step> randomStep(Random &random, const oracle::Scene &scene, Step::Kind kind, const DeviceLimits &limits);
// Appends `count` steps of random kinds.
void addSteps(Random &random, Case &c, std::span<const Step::Kind> kinds, uint32_t count, const DeviceLimits &limits);
// Lets objects be updated in more than the data of their micromaps, if a step does that.
void allowUpdates(Case &c);

// All rays get the flags of the first one with other flags of opacity, each as likely as the others.
void setConstantFlags(Random &random, oracle::Scene &scene);
// As above, and the shader knows them.
void fixFlags(Random &random, Case &c);
// In so many of the cases with ray flags of run time, rays get one of two, between which the shader selects.
void selectFlags(Random &random, Case &c, uint32_t percent);
// Some candidates end their rays.
void terminateSome(Random &random, oracle::Scene &scene);
// Record offsets of instances, which any ray of the case's pipelines may use: triangles and boxes reach different ones.
void setRecords(Random &random, Case &c);
// In so many of the cases, conditional rendering is active around builds, where the device has no fault in that.
void makeConditional(Random &random, Case &c, const DeviceLimits &limits, uint32_t percent);
// How the inputs of builds lie in memory, and when they are written; some micromaps get the states of others.
void varyInputs(Random &random, Case &c);
// A command of that form for the case's shader.
Launch randomCommand(Random &random, const DeviceLimits &limits);
// Flags that nothing needs, and inputs that are stated in unusual forms. makeScene does it.
void varyBuilds(Random &random, oracle::Scene &scene, const DeviceLimits &limits);
// All micromaps have the sizes that builds on the host need.
inline void buildableOnHost(oracle::Scene &scene)
{
    for (oracle::SceneMicromap &micromap : scene.micromaps)
        micromap.onHost = true;
}
// A pool of queries of a random property, and what is done with it; nothing where there is nothing to query.
std::optional<QueryPlan> randomQueries(Random &random, const oracle::Scene &scene, const DeviceLimits &limits);

// Builds, memory, steps and queries of one case, with commands of others, and with how others trace.
Case combinations(Random &random, const DeviceLimits &limits);

// Random commands that copy, update and fill memory at device addresses.
AddressPlan randomAddressCopies(Random &random);

// Changes the case by a function, if that leaves it valid. Returns whether it does.
bool changeIfValid(Case &c, const auto &change)
{
    Case changed = c;
    change(changed);
    if (!invalid(changed).empty())
        return false;
    c = std::move(changed);
    return true;
}

// Runs a case, and makes it smaller if it fails, for at most that many seconds.
Outcome runAndShrink(Session &session, const Case &c, double seconds);
// Runs a random case as above.
Outcome runRandomCase(Session &session, std::string_view group, uint64_t seed, MakeCase make);
// Rays skip neither triangles nor boxes, unless the case needs that.
void skipNothing(Case &c);
// Implements Group::run.
template <MakeCase make>
Outcome runGroup(Session &session, std::string_view group, uint64_t seed)
{
    return runRandomCase(session, group, seed, make);
}

// The groups of each file.
std::span<const Group> resolutionGroups();
std::span<const Group> pipelineGroups();
std::span<const Group> buildGroups();
std::span<const Group> objectGroups();
std::span<const Group> queryGroups();
std::span<const Group> addressGroups();
std::span<const Group> combinationGroups();
std::span<const Group> scaleGroups();

// What groups make, for cases that combine it: builds, steps on what was built, traces by queries and by pipelines.
std::span<const MakeCase> buildMakers();
std::span<const MakeCase> objectMakers();
std::span<const MakeCase> queryMakers();
std::span<const MakeCase> pipelineMakers();

} // namespace vellum::check
