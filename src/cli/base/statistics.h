// SPDX-License-Identifier: Apache-2.0
// What many measurements of one thing say together.
#pragma once

#include <vector>

namespace vellum::cli
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

} // namespace vellum::cli
