// SPDX-License-Identifier: Apache-2.0
#include "base/statistics.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <system_error>
#include <thread>

namespace vellum
{
double median(std::vector<double> values)
{
    return quartiles(std::move(values)).middle;
}

Quartiles quartiles(std::vector<double> values)
{
    std::sort(values.begin(), values.end());
    const auto at = [&](double share) {
        const double place = share * static_cast<double>(values.size() - 1);
        const auto below = static_cast<size_t>(place);
        const size_t above = std::min(below + 1, values.size() - 1);
        return values[below] + (place - static_cast<double>(below)) * (values[above] - values[below]);
    };
    return {at(0.25), at(0.5), at(0.75)};
}

void PairedTiming::measure()
{
    if (times_[0].empty())
        times_[0].push_back(a_());
    const double before = times_[0].back();
    const double b = b_();
    const double after = a_();
    times_[0].push_back(after);
    times_[1].push_back(b);
    ratios_.push_back(2 * b / (before + after));
}

double PairedTiming::uncertainty() const
{
    const Quartiles q = ratio();
    // The quartiles of a normal distribution are 1.349 standard deviations apart; its median's error is 1.253 times
    // that of its mean.
    const double deviation = (q.high - q.low) / 1.349;
    return 1.253 * deviation / std::sqrt(static_cast<double>(pairs())) / q.middle;
}

namespace
{

// The share of the time that this thread does not compute.
double shareOfInterruptions(double seconds)
{
    using Clock = std::chrono::steady_clock;
    constexpr uint32_t kSteps = 10000; // some microseconds
    std::vector<double> times;
    const Clock::time_point begin = Clock::now();
    Clock::time_point last = begin;
    volatile uint32_t value = 1;
    while (std::chrono::duration<double>(last - begin).count() < seconds) {
        for (uint32_t i = 0; i < kSteps; ++i)
            value = value * 1664525 + 1013904223;
        const Clock::time_point now = Clock::now();
        times.push_back(std::chrono::duration<double>(now - last).count());
        last = now;
    }
    const double computing = median(times) * static_cast<double>(times.size());
    return std::clamp(1 - computing / std::chrono::duration<double>(last - begin).count(), 0.0, 1.0);
}

} // namespace

double shareOfOthers(double seconds)
{
    std::vector<double> shares(std::max(std::thread::hardware_concurrency(), 1U));
    std::vector<std::jthread> threads;
    try {
        for (double &share : shares)
            threads.emplace_back([&share, seconds] { share = shareOfInterruptions(seconds); });
    } catch (const std::system_error &) { // a limit of threads
    }
    for (std::jthread &thread : threads)
        thread.join();
    return std::accumulate(shares.begin(), shares.end(), 0.0) / static_cast<double>(shares.size());
}

} // namespace vellum
