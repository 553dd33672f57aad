// SPDX-License-Identifier: Apache-2.0
// Work that is divided among threads.
#pragma once

#include <cstddef>
#include <functional>

#include "bake/bake.h"
#include "core/parallel.h"

namespace vellum
{

// inParallel() of work that may be cancelled: then it throws BakeCancelled.
template <typename State, typename Function>
void inParallel(unsigned threads, size_t count, const std::function<bool()> &cancelled, Function &&function)
{
    inParallel<State>(threads, count, [&](size_t i, State &state) {
        if (cancelled && cancelled())
            throw BakeCancelled();
        function(i, state);
    });
}

} // namespace vellum
