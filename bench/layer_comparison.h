// SPDX-License-Identifier: Apache-2.0
// Benchmarks of one device without the layer and the same with it.
#pragma once

#include "cli/render_command.h"

namespace vellum::bench
{

using Comparison = void (*)(const gpu::DeviceInfo &off, const gpu::DeviceInfo &on, unsigned repetitions);

// The main() of such a program: reads its command line and runs `comparison` on the device that the user wants, without
// caches of pipelines. Returns the exit status.
int compareDevices(int argc, char **argv, const char *program, const char *description, const char *repeated,
                   Comparison comparison);

} // namespace vellum::bench
