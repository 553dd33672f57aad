// SPDX-License-Identifier: Apache-2.0
// For tests of `vellum render`.
#pragma once

#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "command.h"
#include "glb_file.h"

namespace vellum::test
{

class Rendering : public testing::Test
{
protected:
    // A small picture of the grove, which must succeed: leaves, solid wood, ground and sky.
    [[nodiscard]] static Outcome render(std::vector<std::string> options);
    // Renders one frame.
    [[nodiscard]] static Outcome render(const std::string &trace, std::vector<std::string> options);

    TemporaryFolder folder;
};

} // namespace vellum::test
