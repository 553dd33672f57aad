// SPDX-License-Identifier: Apache-2.0
// Two instances without micromaps, for rays that run a shader of a hit group in any scene: a ray along -z from (0, 0,
// 1) hits a triangle, one from (10, 0, 1) a box, both non-opaque.
#pragma once

#include "gpu/scene.h"

namespace vellum::gpu
{

class HelperScene
{
public:
    // record: the instances' record offset.
    explicit HelperScene(Device &gpu, uint32_t record = 0);
    [[nodiscard]] VkDeviceAddress address() const { return top_.address(); }

private:
    Blas triangle_, box_;
    Tlas top_;
};

} // namespace vellum::gpu
