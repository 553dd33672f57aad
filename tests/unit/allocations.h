// SPDX-License-Identifier: Apache-2.0
// Allocations by operator new of the program of a test.
#pragma once

namespace vellum::test
{

extern thread_local long allocationsLeft; // of this thread before one fails; negative: none fails

} // namespace vellum::test
