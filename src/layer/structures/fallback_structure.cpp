// SPDX-License-Identifier: Apache-2.0
// A bottom-level structure of one triangle as the driver serializes it. It is made by a probe of the driver when it is
// needed first.
#include <cstring>

#include "core/records.h"
#include "layer/structures/device_structures.h"
#include "layer/structures/structure_layout.h"

namespace vellum::layer
{
namespace
{

constexpr VkDeviceSize kSpareBytes = 4096;

// The smallest acceleration structure that there is, with the memory that its build needs. Nothing of the layer is in
// it.
class TriangleStructure
{
public:
    explicit TriangleStructure(const GpuContext &context) : context_(context) {}
    ~TriangleStructure();
    TriangleStructure(const TriangleStructure &) = delete;
    TriangleStructure &operator=(const TriangleStructure &) = delete;

    // Records the build of a bottom-level structure of one triangle, (0,0,0) (1,0,0) (0,1,0); the structure is larger
    // by `spareBytes` than the driver's size. Commands after it may use the structure. Returns false if the driver
    // cannot create an object.
    bool buildTriangle(VkCommandBuffer commands, VkDeviceSize spareBytes);

    [[nodiscard]] VkAccelerationStructureKHR handle() const { return handle_; }
    [[nodiscard]] VkDeviceSize size() const { return size_; }

private:
    bool makeInput(const void *data, size_t bytes);
    bool build(VkCommandBuffer commands, const VkAccelerationStructureGeometryKHR &geometry, VkDeviceSize spareBytes);

    const GpuContext &context_;
    GpuBuffer input_, memory_, scratch_;
    VkDeviceSize size_ = 0;
    VkAccelerationStructureKHR handle_ = VK_NULL_HANDLE;
};

TriangleStructure::~TriangleStructure()
{
    if (handle_)
        context_.next->DestroyAccelerationStructureKHR(context_.device, handle_, nullptr);
}

bool TriangleStructure::makeInput(const void *data, size_t bytes)
{
    if (input_.create(context_, bytes, VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR) !=
        VK_SUCCESS)
        return false;
    std::memcpy(input_.words(), data, bytes);
    return true;
}

bool TriangleStructure::buildTriangle(VkCommandBuffer commands, VkDeviceSize spareBytes)
{
    constexpr float kVertices[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    if (!makeInput(kVertices, sizeof kVertices))
        return false;
    VkAccelerationStructureGeometryKHR geometry{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR};
    geometry.geometryType = VK_GEOMETRY_TYPE_TRIANGLES_KHR;
    VkAccelerationStructureGeometryTrianglesDataKHR &triangles = geometry.geometry.triangles;
    triangles = {VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_TRIANGLES_DATA_KHR};
    triangles.vertexFormat = VK_FORMAT_R32G32B32_SFLOAT;
    triangles.vertexData.deviceAddress = input_.address();
    triangles.vertexStride = 3 * sizeof(float);
    triangles.maxVertex = 2;
    triangles.indexType = VK_INDEX_TYPE_NONE_KHR;
    return build(commands, geometry, spareBytes);
}

bool TriangleStructure::build(VkCommandBuffer commands, const VkAccelerationStructureGeometryKHR &geometry,
                              VkDeviceSize spareBytes)
{
    const DeviceTable &next = *context_.next;
    VkAccelerationStructureBuildGeometryInfoKHR info{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_GEOMETRY_INFO_KHR};
    info.type = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR;
    info.geometryCount = 1;
    info.pGeometries = &geometry;
    const uint32_t one = 1;
    VkAccelerationStructureBuildSizesInfoKHR sizes{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR};
    next.GetAccelerationStructureBuildSizesKHR(context_.device, VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &info,
                                               &one, &sizes);
    size_ = sizes.accelerationStructureSize + spareBytes;
    if (memory_.create(context_, size_, VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR) != VK_SUCCESS ||
        scratch_.create(context_, sizes.buildScratchSize + kPartAlignment) != VK_SUCCESS)
        return false;
    VkAccelerationStructureCreateInfoKHR create{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_KHR};
    create.buffer = memory_.buffer();
    create.size = size_;
    create.type = info.type;
    if (next.CreateAccelerationStructureKHR(context_.device, &create, nullptr, &handle_) != VK_SUCCESS)
        return false;
    info.dstAccelerationStructure = handle_;
    info.scratchData.deviceAddress = alignUp(scratch_.address(), kPartAlignment);
    const VkAccelerationStructureBuildRangeInfoKHR range{1, 0, 0, 0};
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = &range;
    next.CmdBuildAccelerationStructuresKHR(commands, 1, &info, &ranges);
    const VkMemoryBarrier memory{VK_STRUCTURE_TYPE_MEMORY_BARRIER, nullptr, VK_ACCESS_MEMORY_WRITE_BIT,
                                 VK_ACCESS_MEMORY_READ_BIT | VK_ACCESS_MEMORY_WRITE_BIT};
    next.CmdPipelineBarrier(commands, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, 0, 1,
                            &memory, 0, nullptr, 0, nullptr);
    return true;
}

// Serializes one triangle, in a structure that is larger than it needs: does the driver copy all of it?
class SerializationProbe : public Probe
{
public:
    explicit SerializationProbe(DeviceStructures &device) : device_(device), triangle_(device.buffers.gpu) {}

    bool record(VkCommandBuffer commands) override
    {
        if (!triangle_.buildTriangle(commands, kSpareBytes) ||
            serialized_.create(device_.buffers.gpu, triangle_.size() + 2 * kSpareBytes) != VK_SUCCESS ||
            // Made here, where a failure leads to another probe.
            device_.fallback.memory.create(device_.buffers.gpu, alignUp(triangle_.size() + kSpareBytes, 16)) !=
                VK_SUCCESS)
            return false;
        VkCopyAccelerationStructureToMemoryInfoKHR info{
            VK_STRUCTURE_TYPE_COPY_ACCELERATION_STRUCTURE_TO_MEMORY_INFO_KHR};
        info.src = triangle_.handle();
        info.dst.deviceAddress = alignUp(serialized_.address(), kPartAlignment);
        info.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_SERIALIZE_KHR;
        device_.driver.next.CmdCopyAccelerationStructureToMemoryKHR(commands, &info);
        return true;
    }

    void read() override
    {
        const VkDeviceSize skipped = alignUp(serialized_.address(), kPartAlignment) - serialized_.address();
        const uint32_t *words = serialized_.words() + skipped / 4;
        // The sizes in the header that the specification defines.
        uint64_t bytes = words[8] | uint64_t{words[9]} << 32;
        uint64_t size = words[10] | uint64_t{words[11]} << 32;
        FallbackStructure &fallback = device_.fallback;
        if (bytes < shared::kSerializedHeaderWords * 4 || bytes > triangle_.size() + kSpareBytes)
            return;
        fallback.wholeCopies = bytes >= triangle_.size();
        if (fallback.wholeCopies) {
            bytes -= kSpareBytes;
            size -= kSpareBytes;
        }
        uint32_t *kept = fallback.memory.words();
        std::memcpy(kept, words, bytes);
        kept[8] = static_cast<uint32_t>(bytes);
        kept[10] = static_cast<uint32_t>(size);
        fallback.units = static_cast<uint32_t>(alignUp(bytes, 16) / 16);
        fallback.structureBytes = alignUp(size, kPartAlignment);
    }

private:
    DeviceStructures &device_;
    TriangleStructure triangle_;
    GpuBuffer serialized_;
};

} // namespace

FallbackFacts fallbackStructure(DeviceStructures &device)
{
    FallbackStructure &fallback = device.fallback;
    std::lock_guard lock(fallback.mutex);
    // A probe that was not carried out is repeated by the next call.
    if (!fallback.probed)
        fallback.probed = !device.driver.enabled.structures || !device.commands.probes.exists() ||
                          device.commands.probes.run(std::make_unique<SerializationProbe>(device));
    if (fallback.units == 0)
        return {.wholeCopies = fallback.wholeCopies};
    return {fallback.memory.address(), fallback.memory.words(), fallback.units, fallback.structureBytes,
            fallback.wholeCopies};
}

} // namespace vellum::layer
