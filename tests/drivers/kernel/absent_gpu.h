// SPDX-License-Identifier: Apache-2.0
// A GPU that is not there, for Mesa's drivers ANV and RADV: they open the GPU's file and ask a kernel driver about it
// by ioctl. What is linked with this has its own ioctl and drmGetDevices2, which come before those of the system's
// libraries, also for drivers that are loaded later: they answer for one GPU. Memory and synchronization objects are
// real ones of the process, so everything up to the submission of commands runs in the driver as it would with a GPU.
// What is submitted is done at once, and does nothing.
#pragma once

#include <string>

namespace vellum::test::kernel
{

// Lets this process have a GPU from now on, by its name in xe.h or amdgpu.h. Throws if there is none of that name.
void install(const std::string &gpu);

} // namespace vellum::test::kernel
