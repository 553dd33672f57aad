// SPDX-License-Identifier: Apache-2.0
// The effect of the commands of a QueryPlan on the queries of its pool, and the commands that are allowed.
#pragma once

#include <string>
#include <vector>

#include "check/case/case.h"

namespace vellum::check
{

struct QueryState {
    enum class Is { Uninitialized, Unavailable, Available };
    Is is = Is::Uninitialized;
    QueryTarget target;        // the target of an available query
    bool wasAvailable = false; // at some time
};
using QueryStates = std::vector<QueryState>; // of a pool

// Returns whether all queries that the command names are available.
bool allAvailable(const QueryStates &states, const QueryCommand &command);
// Returns whether all of them were available at some time.
bool allWereAvailable(const QueryStates &states, const QueryCommand &command);
// Carries out the command. Returns what forbids it; empty: nothing.
std::string advance(QueryStates &states, const QueryCommand &command);

} // namespace vellum::check
