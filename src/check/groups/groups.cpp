// SPDX-License-Identifier: Apache-2.0
#include "check/groups/group.h"

#include "check/groups/random_case.h"

namespace vellum::check
{

std::span<const Group> groups()
{
    static const std::vector<Group> all = [] {
        std::vector<Group> list;
        for (const std::span<const Group> some :
             {resolutionGroups(), pipelineGroups(), buildGroups(), objectGroups(), queryGroups(), scaleGroups()})
            list.insert(list.end(), some.begin(), some.end());
        return list;
    }();
    return all;
}

} // namespace vellum::check
