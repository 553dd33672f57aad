// SPDX-License-Identifier: Apache-2.0
#include "harness/program/process.h"

namespace vt
{

// Windows cannot repeat the addresses of a process: lavapipe compiles more there.
void prepareProcess(char **, const std::string &) {}

} // namespace vt
