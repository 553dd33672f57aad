// SPDX-License-Identifier: Apache-2.0
#include "check/gpu/known_faults.h"

#include <algorithm>
#include <array>

namespace vellum::check
{
namespace
{

constexpr uint32_t kMesa26 = VK_MAKE_API_VERSION(0, 26, 0, 0);
constexpr uint32_t kNotFixed = UINT32_MAX; // in any version that is known

constexpr std::array<KnownFault, 4> kFaults{{
    {Fault::ReportChangesAttributes, VK_DRIVER_ID_MESA_LLVMPIPE, 0, kNotFixed,
     "a hit that an intersection shader reports and that is not accepted changes the attributes of the committed hit",
     "attributes of such committed hits are not judged"},
    {Fault::SharedIntersectionStage, VK_DRIVER_ID_MESA_LLVMPIPE, 0, kNotFixed,
     "where two hit groups share an intersection shader, the any-hit shader of one of them runs for both",
     "hit groups do not share intersection shaders"},
    {Fault::RayGenerationInLibrary, VK_DRIVER_ID_MESA_LLVMPIPE, 0, kNotFixed,
     "a ray generation shader of a pipeline library does not run", "ray generation shaders are not in libraries"},
    {Fault::InstanceBehindInvisible, VK_DRIVER_ID_MESA_LLVMPIPE, kMesa26, kNotFixed,
     "an instance behind one that is inactive or has mask 0 crashes shaders that trace",
     "such instances are active and have another mask, except at the end"},
}};

} // namespace

std::vector<KnownFault> knownFaults(VkDriverId driver, uint32_t version)
{
    std::vector<KnownFault> faults;
    std::copy_if(kFaults.begin(), kFaults.end(), std::back_inserter(faults), [&](const KnownFault &fault) {
        return fault.driver == driver && version >= fault.first && version < fault.end;
    });
    return faults;
}

} // namespace vellum::check
