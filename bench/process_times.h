// SPDX-License-Identifier: Apache-2.0
// Times of this process.
#pragma once

#include <algorithm>
#include <chrono>
#include <ctime>

namespace vellum::bench
{

// The time of all threads; a driver that is the CPU itself works in them, too.
inline double processorSeconds()
{
    timespec time{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
    return static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_nsec) * 1e-9;
}

// Seconds of the process's work and of the clock; the best of all measurements.
struct BestTimes {
    double cpu = 1e300;
    double wall = 1e300;

    template <typename Function>
    void measure(Function &&function)
    {
        const auto start = std::chrono::steady_clock::now();
        const double before = processorSeconds();
        function();
        cpu = std::min(cpu, processorSeconds() - before);
        wall = std::min(wall, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
    }
};

} // namespace vellum::bench
