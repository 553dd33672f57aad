// SPDX-License-Identifier: Apache-2.0
// The group about queries of sizes.
#include <array>

#include "check/case/queries.h"
#include "check/groups/random_case.h"

namespace vellum::check
{
namespace
{

using Is = QueryState::Is;
using CommandKind = QueryCommand::Kind;
using Property = QueryPlan::Property;
using Of = QueryTarget::Of;

// The objects that a pool of that property can query.
std::vector<QueryTarget> targetsOf(const oracle::Scene &scene, Property property, bool structures, bool micromaps,
                                   const DeviceLimits &limits)
{
    const bool rejected = property == Property::SerializationSize && !limits.serializesMicromaps();
    std::vector<QueryTarget> targets;
    if (structures)
        targets.push_back({Of::Top, 0});
    for (uint32_t o = 0; structures && property != Property::BottomLevelPointers && o < scene.objects.size(); ++o) {
        if (!rejected || std::ranges::none_of(scene.objects[o].meshes,
                                              [](const oracle::Mesh &mesh) { return mesh.micromap.has_value(); }))
            targets.push_back({Of::Object, o});
    }
    for (uint32_t m = 0; micromaps && m < scene.micromaps.size(); ++m) {
        if (property != Property::CompactedSize ||
            (scene.micromaps[m].flags & VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT) != 0)
            targets.push_back({Of::Micromap, m});
    }
    return targets;
}

class Plan
{
public:
    Plan(Random &random, const oracle::Scene &scene, const DeviceLimits &limits) : random_(random), limits_(limits)
    {
        plan_.property = static_cast<Property>(below(random, limits.maintenance ? 4 : 2));
        const bool older = plan_.property == Property::CompactedSize || plan_.property == Property::SerializationSize;
        // Micromaps of VK_EXT_opacity_micromap have pools of their own.
        const bool micromaps =
            limits.api == Api::Khr ? plan_.property != Property::BottomLevelPointers : older && chance(random, 60);
        targets_ = targetsOf(scene, plan_.property, limits.api == Api::Khr || !micromaps, micromaps, limits);
        onHost_ = micromaps && limits.api == Api::Ext && limits.hostCommands;
    }

    // Nothing if there is nothing to query.
    std::optional<QueryPlan> make()
    {
        if (targets_.empty())
            return {};
        plan_.count = 1 + below(random_, 12);
        states_.resize(plan_.count);
        reset(0, plan_.count);
        // Writes and reads without a wait, so that faults show before anything waits.
        write();
        read(0, plan_.count);
        for (uint32_t i = 3 + below(random_, 12); i > 0; --i) {
            switch (below(random_, 10)) {
            case 0: reset(below(random_, plan_.count), 1 + below(random_, plan_.count)); break;
            case 1:
            case 2:
            case 3: write(); break;
            case 4:
            case 5:
            case 6: read(below(random_, plan_.count), 1 + below(random_, plan_.count)); break;
            case 7:
            case 8: copy(); break;
            default: writeOnHost(); break;
            }
        }
        write();
        read(0, plan_.count);
        return plan_;
    }

private:
    void add(QueryCommand command)
    {
        advance(states_, command);
        plan_.commands.push_back(std::move(command));
    }
    void reset(uint32_t first, uint32_t count)
    {
        add({.kind = limits_.hostReset && chance(random_, 40) ? CommandKind::ResetOnHost : CommandKind::Reset,
             .first = first,
             .count = std::min(count, plan_.count - first)});
    }
    std::vector<QueryTarget> someTargets(uint32_t count)
    {
        std::vector<QueryTarget> targets;
        for (uint32_t i = 0; i < count; ++i)
            targets.push_back(targets_[below(random_, static_cast<uint32_t>(targets_.size()))]);
        return targets;
    }
    // A range of queries that have a property, which includes a random one; empty if no query has it.
    template <class Has>
    std::pair<uint32_t, uint32_t> rangeOf(const Has &has)
    {
        std::vector<uint32_t> firsts;
        for (uint32_t i = 0; i < plan_.count; ++i)
            if (has(states_[i]))
                firsts.push_back(i);
        if (firsts.empty())
            return {};
        const uint32_t first = firsts[below(random_, static_cast<uint32_t>(firsts.size()))];
        uint32_t end = first;
        while (end < plan_.count && has(states_[end]))
            ++end;
        return {first, 1 + below(random_, end - first)};
    }
    void write()
    {
        const auto [first, count] = rangeOf([](const QueryState &query) { return query.is == Is::Unavailable; });
        if (count > 0)
            add({.kind = CommandKind::Write, .first = first, .count = count, .targets = someTargets(count)});
    }
    // A command that reads results, with random options.
    QueryCommand results(CommandKind kind, uint32_t first, uint32_t count)
    {
        return {.kind = kind,
                .first = first,
                .count = count,
                .wide = chance(random_, 60),
                .availability = chance(random_, 50),
                .partial = chance(random_, 25),
                .padding = chance(random_, 50) ? below(random_, 4) : 0};
    }
    void read(uint32_t first, uint32_t count)
    {
        QueryCommand command = results(CommandKind::Read, first, std::min(count, plan_.count - first));
        command.wait = allAvailable(states_, command) && chance(random_, 50);
        add(std::move(command));
    }
    void copy()
    {
        // Some were reset since they were available.
        const bool reset = chance(random_, 40);
        const auto [first, count] = rangeOf(
            [reset](const QueryState &query) { return reset ? query.wasAvailable : query.is == Is::Available; });
        if (count == 0)
            return;
        QueryCommand command = results(CommandKind::Copy, first, count);
        const bool available = allAvailable(states_, command);
        command.wait = available && chance(random_, 60);
        command.availability |= !available && !command.partial;
        command.byAddress = limits_.api == Api::Khr && chance(random_, 40);
        command.offset = below(random_, 4);
        add(std::move(command));
    }
    void writeOnHost()
    {
        if (!onHost_)
            return;
        const uint32_t count = 1 + below(random_, 6);
        add({.kind = CommandKind::WriteOnHost,
             .count = count,
             .targets = someTargets(count),
             .padding = below(random_, 4)});
    }

    Random &random_;
    const DeviceLimits &limits_;
    QueryPlan plan_;
    QueryStates states_;
    std::vector<QueryTarget> targets_;
    bool onHost_ = false;
};

Case querySizes(Random &random, const DeviceLimits &limits)
{
    using Kind = Step::Kind;
    constexpr std::array memories{Memory::Apart, Memory::Packed, Memory::PackedToTheEnd};
    Limits scene = smallScene(limits);
    scene.rays = 40;
    scene.objects = 5;
    Case c{.memory = memories[below(random, 3)], .scene = makeScene(random, scene, limits)};
    for (oracle::SceneMicromap &micromap : c.scene.micromaps)
        micromap.flags |= chance(random, 60) ? VkBuildMicromapFlagsEXT{VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT} : 0u;
    c.build.together = chance(random, 50);
    if (chance(random, 10))
        (void)makeFine(random, c.scene, limits);
    constexpr std::array kinds{Kind::CloneObject,   Kind::CompactObject,   Kind::ReloadObject,
                               Kind::CloneMicromap, Kind::CompactMicromap, Kind::SetStates,
                               Kind::CloneTop,      Kind::CompactTop,      Kind::ReloadTop};
    addSteps(random, c, kinds, below(random, 4), limits);
    for (uint32_t i = 1 + below(random, 3); i > 0; --i) {
        if (auto plan = randomQueries(random, c.scene, limits))
            c.queries.push_back(std::move(*plan));
    }
    return c;
}

constexpr std::array kQueriesGroups{
    Group{"queries",
          "sizes of micromaps and structures by several queries of a pool: ranges, strides, 32 and 64 bits, "
          "availability, "
          "copies of results, also of queries that were reset since, resets by device and host, host queries",
          "vkCmdWriteAccelerationStructuresPropertiesKHR, vkCmdWriteMicromapsPropertiesEXT, "
          "vkWriteMicromapsPropertiesEXT, vkGetQueryPoolResults, vkCmdCopyQueryPoolResults, "
          "vkCmdCopyQueryPoolResultsToMemoryKHR, vkCmdResetQueryPool, vkResetQueryPool",
          250, runGroup<querySizes>, 160},
};

} // namespace

std::optional<QueryPlan> randomQueries(Random &random, const oracle::Scene &scene, const DeviceLimits &limits)
{
    return Plan(random, scene, limits).make();
}

std::span<const Group> queryGroups()
{
    return kQueriesGroups;
}

} // namespace vellum::check
