// SPDX-License-Identifier: Apache-2.0
#include "rendering.h"

namespace vellum::test
{

Outcome Rendering::render(std::vector<std::string> options)
{
    options.insert(options.begin(), {"render", "--size", "96x64"});
    Outcome outcome = runVellum(options);
    EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
    EXPECT_EQ(outcome.errors, "");
    return outcome;
}

Outcome Rendering::render(const std::string &trace, std::vector<std::string> options)
{
    options.insert(options.begin(), {"--trace", trace, "--frames", "1"});
    return render(std::move(options));
}

} // namespace vellum::test
