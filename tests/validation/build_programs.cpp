// SPDX-License-Identifier: Apache-2.0
// Wrong builds.
#include "programs.h"

namespace vt
{
namespace
{

// One triangle of level 2.
MicromapInput oneTriangle()
{
    MicromapInput input;
    input.add(2, kFourState, std::vector<uint8_t>(16, 1));
    return input;
}

// Records the build of a micromap after `change`.
template <typename Change>
void buildChanged(Gpu &gpu, Change change)
{
    const Micromap micromap(gpu, oneTriangle());
    StructureBuild build(micromap.buildInfo(), micromap.handle().khr);
    change(build);
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = nullptr;
    gpu.submit([&](VkCommandBuffer commands) {
        gpu.vk().CmdBuildAccelerationStructuresKHR(commands, 1, &build.info, &ranges);
    });
}

void twoGeometries(Gpu &gpu, bool wrong)
{
    buildChanged(gpu, [wrong](StructureBuild &b) { b.info.geometryCount = wrong ? 2 : 1; });
}

constexpr WrongProgram kPrograms[] = {
    {"VUID-VkAccelerationStructureBuildGeometryInfoKHR-geometryCount-11560", Api::Khr, kNeedsNothing, twoGeometries},
};

} // namespace

std::span<const WrongProgram> buildPrograms()
{
    return kPrograms;
}

} // namespace vt
