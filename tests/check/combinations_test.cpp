// SPDX-License-Identifier: Apache-2.0
// The group `combinations`: what a case may vary is varied together with everything else that may be.
#include <gtest/gtest.h>

#include <map>

#include "check/case/fields.h"
#include "check/case/names.h"
#include "check/groups/random_case.h"

using namespace vellum::check;

namespace
{

// The names of a plan's fields, each with whether it differs from its default.
template <class Plan>
std::map<std::string, bool> fieldsOf(const std::string &prefix, const Plan &plan)
{
    static const Plan kStandard;
    const std::vector<const void *> standard = fields::all(kStandard);
    std::map<std::string, bool> found;
    size_t next = 0;
    fields::EachField each{[&]<class Field>(std::string_view name, const Field &field) {
        found[prefix + std::string(name)] = !(field == *static_cast<const Field *>(standard[next++]));
    }};
    fields::of(each, plan);
    return found;
}

// What a case varies: fields, kinds of steps, whether there are queries and copies at addresses.
std::map<std::string, bool> variedBy(const Case &c)
{
    std::map<std::string, bool> varied = fieldsOf("build.", c.build);
    varied.merge(fieldsOf("trace.", c.trace));
    varied.merge(fieldsOf("pipeline.", c.trace.pipeline));
    for (const auto &[kind, name] : kStepNames)
        varied["step." + std::string(name)] = std::ranges::find(c.steps, kind, &Step::kind) != c.steps.end();
    varied["queries"] = !c.queries.empty();
    varied["addressCopies"] = !c.addressCopies.commands.empty();
    varied["memory"] = c.memory != Memory::Apart;
    return varied;
}

// How often each is varied, and each with each other one (in the order of their names), in many cases.
struct Counts {
    std::map<std::string, int> of;
    std::map<std::pair<std::string, std::string>, int> together;
};
Counts countsOfManyCases()
{
    const DeviceLimits all{.byteIndices = true,
                           .pipelines = true,
                           .hostCommands = true,
                           .indirectBuilds = true,
                           .hostReset = true,
                           .maintenance = true,
                           .maintenance6 = true,
                           .shaderObjects = true,
                           .countedDraws = true,
                           .chained = allOf(kChainedNames),
                           .dataAccess = true,
                           .maxLevel2 = 12,
                           .maxLevel4 = 12,
                           .maxLossyLevel = 12};
    Counts counts;
    Random random(1);
    for (int n = 0; n < 2500; ++n) {
        const Case c = combinations(random, all);
        EXPECT_EQ(invalid(c), "");
        std::vector<std::string> varied;
        for (const auto &[name, is] : variedBy(c)) {
            counts.of[name] += is ? 1 : 0;
            if (!is)
                continue;
            for (const std::string &other : varied)
                ++counts.together[{other, name}];
            varied.push_back(name);
        }
    }
    return counts;
}

// Rules of validity.cpp exclude the others: a ray query's options where a pipeline traces, and steps where one command
// buffer has all builds and the rays.
TEST(Combinations, NearlyAllPairsOccur)
{
    const Counts counts = countsOfManyCases();
    size_t pairs = 0;
    std::string never;
    for (const auto &[name, count] : counts.of)
        if (count == 0)
            never += name + " ";
    EXPECT_EQ(never, "trace.withoutMicromaps ");
    for (const auto &[a, ofA] : counts.of)
        for (const auto &[b, ofB] : counts.of)
            pairs += a < b ? 1u : 0u;
    EXPECT_GE(static_cast<double>(counts.together.size()) / static_cast<double>(pairs), 0.9);
}

} // namespace
