// SPDX-License-Identifier: Apache-2.0
// Allocations of the whole program that fail when a test wants it. The libraries take their memory from here, as every
// library that a program with its own operator new loads.
#pragma once

#include <atomic>

namespace vellum::test
{

extern std::atomic<long> allocationsLeft;  // until one fails; negative for never
extern std::atomic<long> allocationsAlive; // not freed yet

} // namespace vellum::test
