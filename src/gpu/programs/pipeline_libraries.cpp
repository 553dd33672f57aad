// SPDX-License-Identifier: Apache-2.0
#include "gpu/programs/pipeline_libraries.h"

#include <algorithm>
#include <iterator>
#include <stdexcept>

namespace vellum::gpu
{
namespace
{

// The stages or the groups of a part and of its libraries.
std::vector<uint32_t> allOf(std::vector<uint32_t> PipelinePart::*own, std::span<const PipelinePart> parts,
                            const PipelinePart &part)
{
    std::vector<uint32_t> all = part.*own;
    for (const uint32_t library : part.libraries)
        std::ranges::copy(allOf(own, parts, parts[library]), std::back_inserter(all));
    return all;
}

} // namespace

PipelineSetup partOf(const PipelineSetup &from, std::span<const uint32_t> groups)
{
    PipelineSetup setup = from;
    setup.stages.clear();
    setup.groups.clear();
    std::vector<uint32_t> places(from.stages.size(), kUnused);
    const auto place = [&](uint32_t stage) {
        if (stage == kUnused)
            return kUnused;
        if (places[stage] == kUnused) {
            places[stage] = static_cast<uint32_t>(setup.stages.size());
            setup.stages.push_back(from.stages[stage]);
        }
        return places[stage];
    };
    for (const uint32_t g : groups) {
        const PipelineGroup &group = from.groups[g];
        setup.groups.push_back(
            {place(group.general), place(group.closestHit), place(group.anyHit), place(group.intersection)});
    }
    return setup;
}

std::vector<uint32_t> stagesOf(std::span<const PipelinePart> parts, const PipelinePart &part)
{
    return allOf(&PipelinePart::stages, parts, part);
}

MadePipeline linked(Device &gpu, const PipelineSetup &from, std::span<const PipelinePart> parts)
{
    std::vector<RayPipeline> made;
    for (const PipelinePart &part : parts) {
        PipelineSetup setup = from;
        setup.stages.clear();
        setup.groups.clear();
        for (const uint32_t stage : part.stages)
            setup.stages.push_back(from.stages[stage]);
        const std::vector<uint32_t> stages = stagesOf(parts, part);
        const auto indexOf = [&](uint32_t stage) {
            const auto found = std::ranges::find(stages, stage);
            if (stage != kUnused && found == stages.end())
                throw std::logic_error("a group names a stage that neither its part nor a library of it has");
            return stage == kUnused ? kUnused : static_cast<uint32_t>(found - stages.begin());
        };
        for (const uint32_t g : part.groups) {
            const PipelineGroup &group = from.groups[g];
            setup.groups.push_back({indexOf(group.general), indexOf(group.closestHit), indexOf(group.anyHit),
                                    indexOf(group.intersection)});
        }
        for (const uint32_t library : part.libraries)
            setup.libraries.push_back(made[library].handle());
        if (part.micromapBit)
            setup.flags |= kMicromapBit;
        if (&part != &parts.back())
            setup.flags |= VK_PIPELINE_CREATE_LIBRARY_BIT_KHR;
        made.emplace_back(gpu, setup);
    }
    const std::vector<uint32_t> order = allOf(&PipelinePart::groups, parts, parts.back());
    std::vector<uint32_t> places;
    for (uint32_t g = 0; g < from.groups.size(); ++g)
        places.push_back(static_cast<uint32_t>(std::ranges::find(order, g) - order.begin()));
    RayPipeline pipeline = std::move(made.back());
    made.pop_back();
    return {std::move(pipeline), std::move(places), std::move(made)};
}

} // namespace vellum::gpu
