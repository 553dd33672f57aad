// SPDX-License-Identifier: Apache-2.0
// Many objects, as engines have them: what each costs must not depend on how many there are. Memory and allocations are
// tested; times are only noted with the results (--gtest_output), as times are no tests.
//   VELLUM_STRESS=full    ten times as many
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <string>
#include <vector>

#include "gpu/copies.h"
#include "harness/harness.h"
#include "harness/mock_driver.h"
#include "structures/footprint.h"

namespace vt
{

inline size_t scaled(size_t count)
{
    const char *setting = std::getenv("VELLUM_STRESS");
    return setting != nullptr && std::string(setting) == "full" ? 10 * count : count;
}

// Allocations of device memory, below Vellum's layer: a device may allow as few as 4096 at a time
// (maxMemoryAllocationCount).
inline uint64_t allocations()
{
    static const auto count = testDriverFunction<uint64_t (*)()>("vellumSpyAllocations");
    return count();
}

class Scale : public GpuTest
{
protected:
    explicit Scale(const Options &options = {.validation = false}) : GpuTest(options) {}

    // Does something `count` times, and notes the microseconds that each took in the first and the last quarter.
    template <class Work>
    void timed(const std::string &name, size_t count, Work work)
    {
        using Clock = std::chrono::steady_clock;
        std::vector<Clock::time_point> at{Clock::now()};
        for (size_t i = 0; i < count; ++i) {
            work(i);
            at.push_back(Clock::now());
        }
        const size_t quarter = std::max<size_t>(count / 4, 1);
        const auto note = [&](const char *which, size_t first) {
            const std::chrono::duration<double, std::micro> time = at[first + quarter] - at[first];
            RecordProperty(name + which, std::to_string(time.count() / static_cast<double>(quarter)));
        };
        note("_first_us", 0);
        note("_last_us", count - quarter);
    }
};

} // namespace vt
