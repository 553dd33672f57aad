// Comparing two times on a machine that has other work to do.
#pragma once

#include <vector>

#include "cli/base/statistics.h"

namespace vellum::bench
{

class SideBySide
{
public:
    // Both return milliseconds. `own` runs between two runs of `classic`: what else the machine does hits both.
    template <typename Classic, typename Own>
    void measure(Classic &&classic, Own &&own)
    {
        const double before = classic();
        const double middle = own();
        const double after = classic();
        m_classic.insert(m_classic.end(), {before, after});
        m_own.push_back(middle);
        m_ratios.push_back(2 * middle / (before + after));
    }

    // Medians, after at least one measurement.
    [[nodiscard]] double ratio() const { return cli::median(m_ratios); }
    [[nodiscard]] double classic() const { return cli::median(m_classic); }
    [[nodiscard]] double own() const { return cli::median(m_own); }

private:
    std::vector<double> m_classic, m_own, m_ratios;
};

} // namespace vellum::bench
