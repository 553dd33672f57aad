// SPDX-License-Identifier: Apache-2.0
// Acceleration structures: builds and their sizes.
#include "forcing/forcing.h"

#include <array>
#include <deque>
#include <functional>

#include "layer/base/pnext.h"

namespace forcing
{
namespace
{

using vellum::layer::findInChain;
using BuildInfo = VkAccelerationStructureBuildGeometryInfoKHR;

bool hasMicromap(const VkAccelerationStructureGeometryTrianglesDataKHR &triangles)
{
    return findInChain(triangles.pNext, VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_EXT) ||
           findInChain(triangles.pNext, VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_KHR);
}

// Copies of build infos in which every triangle geometry has a micromap.
class ForcedBuilds
{
public:
    // The most triangles that geometry g of build i may have.
    using Triangles = std::function<uint32_t(uint32_t i, uint32_t g)>;

    ForcedBuilds(Device &device, std::span<const BuildInfo> builds, const Triangles &triangles)
        : infos_(builds.begin(), builds.end())
    {
        for (uint32_t i = 0; device.micromap && i < infos_.size(); ++i) {
            BuildInfo &info = infos_[i];
            if (info.type != VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR)
                force(*device.micromap, info, [&](uint32_t g) { return triangles(i, g); });
        }
    }
    [[nodiscard]] const BuildInfo *infos() const { return infos_.data(); }

private:
    void force(ForcedMicromap &micromap, BuildInfo &info, const std::function<uint32_t(uint32_t)> &triangles)
    {
        if (info.pGeometries == nullptr && info.ppGeometries == nullptr)
            return;
        std::vector<VkAccelerationStructureGeometryKHR> &geometries = geometries_.emplace_back();
        for (uint32_t g = 0; g < info.geometryCount; ++g) {
            const auto *geometry = info.pGeometries != nullptr ? &info.pGeometries[g] : info.ppGeometries[g];
            if (geometry == nullptr) // the program is wrong, and Vellum says so
                return;
            geometries.push_back(*geometry);
            force(micromap, geometries.back(), triangles(g));
        }
        info.pGeometries = geometries.data();
        info.ppGeometries = nullptr;
    }

    void force(ForcedMicromap &micromap, VkAccelerationStructureGeometryKHR &geometry, uint32_t triangles)
    {
        auto &data = geometry.geometry.triangles;
        if (geometry.geometryType != VK_GEOMETRY_TYPE_TRIANGLES_KHR || hasMicromap(data))
            return;
        const bool opaque = (geometry.flags & VK_GEOMETRY_OPAQUE_BIT_KHR) != 0;
        if (micromap.attach(opaque, triangles, data.pNext, attachments_.emplace_back()))
            ++counts.geometries;
    }

    std::vector<BuildInfo> infos_;
    std::deque<std::vector<VkAccelerationStructureGeometryKHR>> geometries_;
    std::deque<Attachment> attachments_;
};

VKAPI_ATTR void VKAPI_CALL getBuildSizes(VkDevice handle, VkAccelerationStructureBuildTypeKHR type,
                                         const BuildInfo *info, const uint32_t *most,
                                         VkAccelerationStructureBuildSizesInfoKHR *sizes)
{
    Device &device = deviceOf(handle);
    const ForcedBuilds forced(device, {info, 1}, [=](uint32_t, uint32_t g) { return most ? most[g] : 0; });
    device.next.GetAccelerationStructureBuildSizesKHR(handle, type, forced.infos(), most, sizes);
}

VKAPI_ATTR void VKAPI_CALL cmdBuild(VkCommandBuffer commands, uint32_t count, const BuildInfo *infos,
                                    const VkAccelerationStructureBuildRangeInfoKHR *const *ranges)
{
    Device &device = deviceOf(commands);
    const ForcedBuilds forced(device, {infos, count}, [=](uint32_t i, uint32_t g) {
        return ranges != nullptr && ranges[i] != nullptr ? ranges[i][g].primitiveCount : 0;
    });
    device.next.CmdBuildAccelerationStructuresKHR(commands, count, forced.infos(), ranges);
}

VKAPI_ATTR void VKAPI_CALL cmdBuildIndirect(VkCommandBuffer commands, uint32_t count, const BuildInfo *infos,
                                            const VkDeviceAddress *addresses, const uint32_t *strides,
                                            const uint32_t *const *most)
{
    Device &device = deviceOf(commands);
    const ForcedBuilds forced(device, {infos, count}, [=](uint32_t i, uint32_t g) {
        return most != nullptr && most[i] != nullptr ? most[i][g] : 0;
    });
    device.next.CmdBuildAccelerationStructuresIndirectKHR(commands, count, forced.infos(), addresses, strides, most);
}

} // namespace

std::span<const Row> buildRows()
{
    static const std::array rows{
        FORCING_ROW("vkGetAccelerationStructureBuildSizesKHR", getBuildSizes),
        FORCING_ROW("vkCmdBuildAccelerationStructuresKHR", cmdBuild),
        FORCING_ROW("vkCmdBuildAccelerationStructuresIndirectKHR", cmdBuildIndirect),
    };
    return rows;
}

} // namespace forcing
