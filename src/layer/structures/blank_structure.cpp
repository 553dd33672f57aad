#include "layer/structures/blank_structure.h"

#include <cstring>

#include "core/records.h"
#include "layer/commands/start_up_commands.h"
#include "layer/ground/pnext.h"
#include "layer/structures/device_structures.h"
#include "layer/structures/structure_layout.h"

namespace vellum::layer
{
namespace
{

constexpr VkDeviceSize kSpareBytes = 4096;

// One triangle, in a structure that is larger than it needs: does the driver copy all of it?
class Trial
{
public:
    explicit Trial(DeviceStructures &device) : device_(device), next_(device.driver.next), commands_(device.driver) {}
    ~Trial()
    {
        if (structure_)
            next_.DestroyAccelerationStructureKHR(device_.driver.handle, structure_, nullptr);
    }
    Trial(const Trial &) = delete;
    Trial &operator=(const Trial &) = delete;

    void run(const VkDeviceCreateInfo &info, PFN_vkSetDeviceLoaderData setLoaderData)
    {
        if (commands_.chooseQueue(info) && commands_.begin(setLoaderData) && build() && serialize() &&
            commands_.submitAndWait())
            keep();
    }

private:
    bool build()
    {
        constexpr float kVertices[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
        if (vertices_.create(device_.buffers.gpu, sizeof kVertices,
                             VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR) != VK_SUCCESS)
            return false;
        std::memcpy(vertices_.words(), kVertices, sizeof kVertices);
        VkAccelerationStructureGeometryKHR geometry{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR};
        geometry.geometryType = VK_GEOMETRY_TYPE_TRIANGLES_KHR;
        VkAccelerationStructureGeometryTrianglesDataKHR &triangles = geometry.geometry.triangles;
        triangles = {VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_TRIANGLES_DATA_KHR};
        triangles.vertexFormat = VK_FORMAT_R32G32B32_SFLOAT;
        triangles.vertexData.deviceAddress = vertices_.address();
        triangles.vertexStride = 3 * sizeof(float);
        triangles.maxVertex = 2;
        triangles.indexType = VK_INDEX_TYPE_NONE_KHR;
        VkAccelerationStructureBuildGeometryInfoKHR info{
            VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_GEOMETRY_INFO_KHR};
        info.type = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR;
        info.geometryCount = 1;
        info.pGeometries = &geometry;
        const uint32_t one = 1;
        VkAccelerationStructureBuildSizesInfoKHR sizes{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR};
        next_.GetAccelerationStructureBuildSizesKHR(
            device_.driver.handle, VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &info, &one, &sizes);
        bytes_ = sizes.accelerationStructureSize + kSpareBytes;
        if (memory_.create(device_.buffers.gpu, bytes_, VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR) !=
                VK_SUCCESS ||
            scratch_.create(device_.buffers.gpu, sizes.buildScratchSize + kPartAlignment) != VK_SUCCESS)
            return false;
        VkAccelerationStructureCreateInfoKHR create{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_KHR};
        create.buffer = memory_.buffer();
        create.size = bytes_;
        create.type = info.type;
        if (next_.CreateAccelerationStructureKHR(device_.driver.handle, &create, nullptr, &structure_) != VK_SUCCESS)
            return false;
        info.dstAccelerationStructure = structure_;
        info.scratchData.deviceAddress = alignUp(scratch_.address(), kPartAlignment);
        const VkAccelerationStructureBuildRangeInfoKHR range{1, 0, 0, 0};
        const VkAccelerationStructureBuildRangeInfoKHR *ranges = &range;
        next_.CmdBuildAccelerationStructuresKHR(commands_.handle(), 1, &info, &ranges);
        InjectedWork(device_.commands, commands_.handle()).barrier();
        return true;
    }

    bool serialize()
    {
        if (serialized_.create(device_.buffers.gpu, bytes_ + 2 * kSpareBytes) != VK_SUCCESS)
            return false;
        VkCopyAccelerationStructureToMemoryInfoKHR info{
            VK_STRUCTURE_TYPE_COPY_ACCELERATION_STRUCTURE_TO_MEMORY_INFO_KHR};
        info.src = structure_;
        info.dst.deviceAddress = alignUp(serialized_.address(), kPartAlignment);
        info.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_SERIALIZE_KHR;
        next_.CmdCopyAccelerationStructureToMemoryKHR(commands_.handle(), &info);
        InjectedWork(device_.commands, commands_.handle()).barrier();
        return true;
    }

    void keep()
    {
        const VkDeviceSize skipped = alignUp(serialized_.address(), kPartAlignment) - serialized_.address();
        const uint32_t *words = serialized_.words() + skipped / 4;
        // The header that the specification gives.
        uint64_t bytes = words[8] | uint64_t{words[9]} << 32;
        uint64_t size = words[10] | uint64_t{words[11]} << 32;
        BlankStructure &blank = device_.blank;
        if (bytes < shared::kSerializedHeaderWords * 4 || bytes > bytes_ + kSpareBytes)
            return;
        blank.wholeCopies = bytes >= bytes_;
        if (blank.wholeCopies) {
            bytes -= kSpareBytes;
            size -= kSpareBytes;
        }
        if (blank.memory.create(device_.buffers.gpu, alignUp(bytes, 16)) != VK_SUCCESS)
            return;
        uint32_t *kept = blank.memory.words();
        std::memcpy(kept, words, bytes);
        kept[8] = static_cast<uint32_t>(bytes);
        kept[10] = static_cast<uint32_t>(size);
        blank.units = static_cast<uint32_t>(alignUp(bytes, 16) / 16);
        blank.structureBytes = alignUp(size, kPartAlignment);
    }

    DeviceStructures &device_;
    const DeviceTable &next_;
    StartUpCommands commands_;
    GpuBuffer vertices_, memory_, scratch_, serialized_;
    VkDeviceSize bytes_ = 0;
    VkAccelerationStructureKHR structure_ = VK_NULL_HANDLE;
};

} // namespace

void makeBlankStructure(DeviceStructures &device, const VkDeviceCreateInfo &info,
                        PFN_vkSetDeviceLoaderData setLoaderData)
{
    const auto *features = findInChain<VkPhysicalDeviceAccelerationStructureFeaturesKHR>(
        info.pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR);
    if (features && features->accelerationStructure)
        Trial(device).run(info, setLoaderData);
}

} // namespace vellum::layer
