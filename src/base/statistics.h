// SPDX-License-Identifier: Apache-2.0
// Statistics of repeated measurements.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

namespace vellum
{

// The one in the middle, or the mean of the two. `values` must not be empty.
double median(std::vector<double> values);

// A quarter of the values is below `low`, half of them below `middle`, three quarters below `high`.
struct Quartiles {
    double low = 0;
    double middle = 0; // the median
    double high = 0;
};

// By linear interpolation between neighbours. `values` must not be empty.
Quartiles quartiles(std::vector<double> values);

// Runs the two in turn, A B A B ... A. Each B counts against the mean of the A before it and the A after it, so that a
// drift of the machine's speed cancels, and the median of these ratios is what single disturbances do not move.
class PairedTiming
{
public:
    using Run = std::function<double()>; // returns how long it took

    PairedTiming(Run a, Run b) : a_(std::move(a)), b_(std::move(b)) {}

    // Adds a pair.
    void measure();

    [[nodiscard]] size_t pairs() const { return ratios_.size(); }
    // After at least one pair: the median durations, and the ratios of B to A.
    [[nodiscard]] double a() const { return median(times_[0]); }
    [[nodiscard]] double b() const { return median(times_[1]); }
    [[nodiscard]] Quartiles ratio() const { return quartiles(ratios_); }
    // The standard error of the median ratio, relative to it, estimated from the quartiles as if the ratios were
    // normally distributed. Means something from about five pairs on.
    [[nodiscard]] double uncertainty() const;

private:
    Run a_, b_;
    std::vector<double> times_[2];
    std::vector<double> ratios_;
};

// The share of all processors that other programs take, 0 to 1, measured for some seconds: threads compute for as long,
// and what interrupts them is counted. 0 where no thread can be started.
double shareOfOthers(double seconds);

} // namespace vellum
