// SPDX-License-Identifier: Apache-2.0
// The group whose cases combine what other groups vary each for itself.
#include <array>
#include <string_view>
#include <vector>

#include "check/case/fields.h"
#include "check/case/trace.h"
#include "check/groups/random_case.h"

namespace vellum::check
{
namespace
{

using Flags = TracePlan::Flags;
using Method = TracePlan::Method;

// Fields of `plan`, which is a part of the case, become those of `other`, where that has no defaults and the case stays
// valid.
template <class Plan>
void takeSome(Random &random, Case &c, Plan &plan, const Plan &other, uint32_t percent)
{
    static const Plan kStandard;
    const std::vector<const void *> others = fields::all(other), standard = fields::all(kStandard);
    size_t next = 0;
    fields::EachField take{[&]<class Field>(std::string_view, Field &field) {
        const size_t i = next++;
        const Field &taken = *static_cast<const Field *>(others[i]);
        if (taken == *static_cast<const Field *>(standard[i]) || taken == field || !chance(random, percent))
            return;
        Field before = std::exchange(field, taken);
        if (!invalid(c).empty())
            field = std::move(before);
    }};
    fields::of(take, plan);
}

// Ray flags as the source that the plan has for them needs: few different ones, unless they are of run time.
void fitRayFlags(Random &random, Case &c)
{
    const Flags flags = c.trace.flags;
    const auto fit = [&](Case &changed) {
        if (flags == Flags::Specialized || flags == Flags::Literal) {
            setConstantFlags(random, changed.scene);
        } else if (flags == Flags::Selected) {
            changed.trace.flags = Flags::RunTime;
            selectFlags(random, changed, 100);
        } else if (flags == Flags::Mixed) {
            for (Ray &ray : changed.scene.rays)
                ray.flags = chance(random, 60) ? changed.scene.rays[0].flags : ray.flags;
        }
    };
    // Flags at random may be those that the pipeline's flags exclude.
    for (int attempt = 0; attempt < 8; ++attempt)
        if (changeIfValid(c, fit))
            return;
    changeIfValid(c, [](Case &changed) { changed.trace.flags = Flags::RunTime; });
}

bool usesHost(const Case &c)
{
    return c.build.micromaps == BuildCommand::Host || std::ranges::any_of(c.steps, &Step::host) ||
           std::ranges::any_of(c.scene.micromaps, &oracle::SceneMicromap::onHost);
}

} // namespace

Case combinations(Random &random, const DeviceLimits &limits)
{
    const auto makeOf = [&](std::span<const MakeCase> makers) {
        return makers[below(random, static_cast<uint32_t>(makers.size()))](random, limits);
    };
    const auto madeByOther = [&] {
        for (;;) {
            Case made = makeOf(chance(random, 50) ? buildMakers() : objectMakers());
            if (limits.hostCommands || !usesHost(made))
                return made;
        }
    };
    Case c = madeByOther();
    const Case other = madeByOther();
    takeSome(random, c, c.build, other.build, 50);
    if (chance(random, 50))
        changeIfValid(c, [&](Case &changed) { changed.memory = other.memory; });
    constexpr size_t kMostRays = 96;
    if (c.scene.rays.size() > kMostRays)
        c.scene.rays.resize(kMostRays);

    const std::span<const MakeCase> tracers = limits.pipelines && chance(random, 60) ? pipelineMakers() : queryMakers();
    const Case traced = makeOf(tracers), otherTraced = makeOf(tracers);
    changeIfValid(c, [&](Case &changed) { changed.trace.method = traced.trace.method; });
    if (c.trace.method == Method::Pipeline) {
        terminateSome(random, c.scene);
        if (chance(random, 60))
            changeIfValid(c, [&](Case &changed) {
                changed.trace.pipeline.parameters = traced.trace.pipeline.parameters;
                changed.trace.pipeline.table.misses = changed.trace.pipeline.parameters.missIndex + 1;
                setRecords(random, changed);
            });
    }
    for (const Case *of : {&other, &otherTraced, &traced})
        takeSome(random, c, c.trace, of->trace, 60);
    if (limits.countedDraws && chance(random, 50)) // few cases draw
        changeIfValid(c, [](Case &changed) { changed.trace.launch.counted = true; });
    if (chance(random, 50))
        changeIfValid(c, [](Case &changed) { changed.trace.dynamicStrides = true; });
    fitRayFlags(random, c);
    // Scenes with micromaps: sceneRule
    c.trace.withoutMicromaps = false;
    if (!consumesMicromaps(c.trace))
        c.trace.mode = TracePlan::Mode::True;

    if (!c.build.single && c.queries.empty() && chance(random, 40))
        if (std::optional<QueryPlan> plan = randomQueries(random, c.scene, limits))
            c.queries.push_back(std::move(*plan));
    if (!c.build.single && limits.addressCommands() && chance(random, 20))
        c.addressCopies = randomAddressCopies(random);
    return c;
}

namespace
{

constexpr std::array kCombinationGroups{
    Group{"combinations",
          "builds, memory, steps, queries and traces as other groups vary them, each with all others: one case builds "
          "in secondary command buffers, updates and compacts, and traces by a pipeline of libraries with indirect "
          "commands",
          "all sections that the groups of builds, objects, queries and pipelines name", 800, runGroup<combinations>,
          120},
};

} // namespace

std::span<const Group> combinationGroups()
{
    return kCombinationGroups;
}

} // namespace vellum::check
