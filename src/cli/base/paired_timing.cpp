#include "cli/base/paired_timing.h"

#include <cmath>

namespace vellum::cli
{

void PairedTiming::measure()
{
    if (m_times[0].empty())
        m_times[0].push_back(m_a());
    const double before = m_times[0].back();
    const double b = m_b();
    const double after = m_a();
    m_times[0].push_back(after);
    m_times[1].push_back(b);
    m_ratios.push_back(2 * b / (before + after));
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
