// SPDX-License-Identifier: Apache-2.0
// AMD's GPUs by the kernel driver amdgpu, which RADV queries.
#pragma once

#include <memory>
#include <string>

#include "kernel_driver.h"

namespace vellum::test::kernel::amdgpu
{

// Null for a name that no GPU here has: vega10, navi21, navi31, gfx1201.
std::unique_ptr<KernelDriver> create(const std::string &gpu, Objects &objects, SyncObjects &syncs);

} // namespace vellum::test::kernel::amdgpu
