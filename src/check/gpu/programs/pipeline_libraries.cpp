// SPDX-License-Identifier: Apache-2.0
#include "check/gpu/programs/pipeline_libraries.h"

namespace vellum::check
{

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

MadePipeline linked(Device &gpu, const PipelineSetup &from, const LibraryPlan &plan)
{
    std::vector<RayPipeline> libraries;
    std::vector<uint32_t> places(from.groups.size());
    uint32_t next = 0;
    for (const uint32_t g : plan.own)
        places[g] = next++;
    PipelineSetup linking = partOf(from, plan.own);
    PipelineSetup outer = partOf(from, {});
    for (const std::vector<uint32_t> &groups : plan.libraries) {
        PipelineSetup library = partOf(from, groups);
        library.flags |= VK_PIPELINE_CREATE_LIBRARY_BIT_KHR;
        libraries.emplace_back(gpu, library);
        (plan.nested ? outer : linking).libraries.push_back(libraries.back().handle());
        for (const uint32_t g : groups)
            places[g] = next++;
    }
    if (plan.nested) {
        outer.flags |= VK_PIPELINE_CREATE_LIBRARY_BIT_KHR;
        libraries.emplace_back(gpu, outer);
        linking.libraries = {libraries.back().handle()};
    }
    return {RayPipeline(gpu, linking), std::move(places), std::move(libraries)};
}

} // namespace vellum::check
