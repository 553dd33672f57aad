// SPDX-License-Identifier: Apache-2.0
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
        classic_.insert(classic_.end(), {before, after});
        own_.push_back(middle);
        ratios_.push_back(2 * middle / (before + after));
    }

    // Medians, after at least one measurement.
    [[nodiscard]] double ratio() const { return cli::median(ratios_); }
    [[nodiscard]] double classic() const { return cli::median(classic_); }
    [[nodiscard]] double own() const { return cli::median(own_); }

private:
    std::vector<double> classic_, own_, ratios_;
};

} // namespace vellum::bench
