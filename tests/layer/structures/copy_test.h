// SPDX-License-Identifier: Apache-2.0
// Shared by the tests of copies of acceleration structures.
#pragma once

#include <memory>
#include <vector>

#include "gpu/copies.h"
#include "harness/harness.h"

namespace vt
{

class Copies : public GpuTest
{
protected:
    explicit Copies(const Options &options = {.shared = true}) : GpuTest(options) {}

    std::unique_ptr<Structure> made(VkAccelerationStructureTypeKHR type, VkDeviceSize size)
    {
        auto structure = std::make_unique<Structure>(gpu(), type);
        structure->create(size);
        return structure;
    }
    std::vector<Geometry> plain() { return {Geometry{.vertices = triangleRow(6)}}; }
};

} // namespace vt
