// SPDX-License-Identifier: Apache-2.0
// Allocations of Vellum's layer that fail when a test wants it. Libraries take their memory from the operator new of
// the program that loads them; what others than the layer allocate never fails.
#pragma once

#include <cstdint>

namespace vt
{

enum class Failing { Once, FromThenOn };
// The n-th allocation of the layer from now on fails, or all from then on; with n = 0, none. The layer must be loaded.
// Returns how many there were since the last call.
uint64_t failAllocations(uint64_t n, Failing failing);

} // namespace vt
