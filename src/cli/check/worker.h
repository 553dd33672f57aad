// SPDX-License-Identifier: Apache-2.0
// A worker process of `vellum check`: only here does the driver run, which may crash, hang and print what it likes.
#pragma once

#include "check/groups/group.h"

namespace vellum::cli
{

// Answers the requests of stdin until it ends, on stdout. What the driver prints goes to stderr. Returns an exit code.
int runWorker(const check::SessionOptions &options);

} // namespace vellum::cli
