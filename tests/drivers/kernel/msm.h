// SPDX-License-Identifier: Apache-2.0
// Qualcomm's GPUs by the kernel driver msm, which turnip queries.
#pragma once

#include <memory>
#include <string>

#include "kernel_driver.h"

namespace vellum::test::kernel::msm
{

// Null for a name that no GPU here has: a740, a750.
std::unique_ptr<KernelDriver> create(const std::string &gpu, Objects &objects, SyncObjects &syncs);

} // namespace vellum::test::kernel::msm
