// SPDX-License-Identifier: Apache-2.0
#include "check/case/queries.h"

#include <algorithm>
#include <fmt/format.h>
#include <span>

namespace vellum::check
{

using Is = QueryState::Is;
using QueryKind = QueryCommand::Kind;

namespace
{

bool hasTargets(QueryKind kind)
{
    return kind == QueryKind::Write || kind == QueryKind::WriteOnHost;
}

} // namespace

bool allAvailable(const QueryStates &states, const QueryCommand &command)
{
    return std::ranges::all_of(std::span(states).subspan(command.first, command.count),
                               [](const QueryState &state) { return state.is == Is::Available; });
}

bool allWereAvailable(const QueryStates &states, const QueryCommand &command)
{
    return std::ranges::all_of(std::span(states).subspan(command.first, command.count), &QueryState::wasAvailable);
}

std::string advance(QueryStates &states, const QueryCommand &command)
{
    if (hasTargets(command.kind) ? command.targets.empty() || command.count != command.targets.size()
                                 : command.count == 0 || !command.targets.empty())
        return "has targets that it does not use, or lacks them";
    if (command.kind == QueryKind::WriteOnHost)
        return {};
    // VUID-vkGetQueryPoolResults-firstQuery-09436, -firstQuery-09437 and those of the other commands
    if (uint64_t{command.first} + command.count > states.size())
        return fmt::format("uses queries {} to {} of a pool of {}", command.first,
                           uint64_t{command.first} + command.count - 1, states.size());
    const auto queries = std::span(states).subspan(command.first, command.count);
    const auto all = [&](Is is) {
        return std::ranges::all_of(queries, [is](const auto &query) { return query.is == is; });
    };
    switch (command.kind) {
    case QueryKind::Write:
        // VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-queryPool-02494,
        // VUID-vkCmdWriteMicromapsPropertiesEXT-None-12417
        if (!all(Is::Unavailable))
            return "writes queries that are not reset";
        for (size_t i = 0; i < queries.size(); ++i)
            queries[i] = {Is::Available, command.targets[i], true};
        return {};
    case QueryKind::Read:
        // VUID-vkGetQueryPoolResults-None-09401
        if (std::ranges::any_of(queries, [](const auto &query) { return query.is == Is::Uninitialized; }))
            return "reads queries that were never reset";
        return command.wait && !all(Is::Available) ? "waits for queries that are not written" : "";
    case QueryKind::Copy:
        // VUID-vkCmdCopyQueryPoolResults-None-08752, VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-None-13084: "must have
        // been made available by prior executed commands". They may be reset since; then something must be written.
        if (!allWereAvailable(states, command))
            return "copies queries that were never available";
        return all(Is::Available) || (!command.wait && (command.availability || command.partial))
                   ? ""
                   : "copies queries that are not available, and waits, or asks for neither availability nor a part";
    default:
        for (QueryState &query : queries)
            query = {.is = Is::Unavailable, .wasAvailable = query.wasAvailable};
        return {};
    }
}

} // namespace vellum::check
