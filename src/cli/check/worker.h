// SPDX-License-Identifier: Apache-2.0
// A worker process of `vellum check`: only here does the driver run, which may crash, hang and print what it likes.
#pragma once

#include "cli/check/protocol.h"

namespace vellum::cli
{

// Answers the requests of stdin until it ends, on stdout. What the driver prints goes to stderr. Returns an exit code.
int runWorker(const WorkerOptions &options);

} // namespace vellum::cli
