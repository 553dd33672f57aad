// SPDX-License-Identifier: Apache-2.0
// A simulated GPU for Mesa's drivers ANV and RADV, which open the GPU's file and query a kernel driver by ioctl. A
// program that is linked with this has its own ioctl and drmGetDevices2. They take precedence over those of the
// system's libraries, also for drivers that are loaded later, and answer for one GPU. Memory and synchronization
// objects are real ones of the process, so everything up to the submission of commands runs in the driver as it would
// with a GPU. Submitted work completes at once and does nothing.
#pragma once

#include <string>

namespace vellum::test::kernel
{

// Gives this process a GPU, by its name in xe.h or amdgpu.h. Throws if the name is unknown.
void install(const std::string &gpu);

} // namespace vellum::test::kernel
