// SPDX-License-Identifier: Apache-2.0
// Intel's GPUs by the kernel driver xe, which ANV queries.
#pragma once

#include <memory>
#include <string>

#include "kernel_driver.h"

namespace vellum::test::kernel::xe
{

// Null for a name that no GPU here has: dg2, mtl, lnl, bmg, one of each generation that traces rays.
std::unique_ptr<KernelDriver> create(const std::string &gpu, Objects &objects, SyncObjects &syncs);

} // namespace vellum::test::kernel::xe
