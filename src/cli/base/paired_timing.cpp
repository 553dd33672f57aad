// SPDX-License-Identifier: Apache-2.0
#include "cli/base/paired_timing.h"

#include <cmath>

namespace vellum::cli
{

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

} // namespace vellum::cli
