// What the kernel tells of a GPU.
#pragma once

#include <vector>

#include "absent_gpu.h"

namespace vellum::test::intel
{

constexpr u32 kPageSize = 0x10000; // of the GPU's own memory; the system's pages fit, too

// The bytes that a query answers with; none where this GPU has no answer.
std::vector<std::byte> answer(const Gpu &gpu, Query query);

} // namespace vellum::test::intel
