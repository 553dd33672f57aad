// SPDX-License-Identifier: Apache-2.0
#include "cli/bench/structure_timing.h"

#include "vk/vk_init.h"

namespace vellum::cli
{
namespace
{

constexpr VkBufferUsageFlags kAddress = VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;
constexpr VkBufferUsageFlags kInput = kAddress | VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR;
constexpr float kTriangle[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};

} // namespace

// One of one geometry, with memory of its own.
class TimedStructure
{
public:
    TimedStructure(Device &device, VkAccelerationStructureTypeKHR type,
                   const VkAccelerationStructureGeometryKHR &geometry, uint32_t primitives)
        : device_(device), geometry_(geometry), range_{primitives, 0, 0, 0}
    {
        info_ = vkInit<VkAccelerationStructureBuildGeometryInfoKHR>(
            {.type = type, .geometryCount = 1, .pGeometries = &geometry_});
        auto sizes = vkInit<VkAccelerationStructureBuildSizesInfoKHR>();
        const DeviceFunctions &vk = device.functions();
        vk.getAccelerationStructureBuildSizes(device.handle(), VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &info_,
                                              &primitives, &sizes);
        storage_ = Buffer(device, sizes.accelerationStructureSize,
                          kAddress | VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR, Buffer::Place::Device);
        const VkDeviceSize alignment = device.scratchAlignment();
        scratch_ = Buffer(device, sizes.buildScratchSize + alignment, kAddress | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT,
                          Buffer::Place::Device);
        auto create = vkInit<VkAccelerationStructureCreateInfoKHR>(
            {.buffer = storage_.handle(), .size = sizes.accelerationStructureSize, .type = type});
        check(vk.createAccelerationStructure(device.handle(), &create, nullptr, &info_.dstAccelerationStructure),
              "creating an acceleration structure");
        info_.scratchData.deviceAddress = scratch_.address(alignment);
    }
    ~TimedStructure()
    {
        device_.functions().destroyAccelerationStructure(device_.handle(), info_.dstAccelerationStructure, nullptr);
    }
    TimedStructure(const TimedStructure &) = delete;
    TimedStructure &operator=(const TimedStructure &) = delete;

    [[nodiscard]] const VkAccelerationStructureBuildGeometryInfoKHR &info() const { return info_; }
    [[nodiscard]] const VkAccelerationStructureBuildRangeInfoKHR &range() const { return range_; }
    [[nodiscard]] VkDeviceAddress address() const
    {
        auto info = vkInit<VkAccelerationStructureDeviceAddressInfoKHR>(
            {.accelerationStructure = info_.dstAccelerationStructure});
        return device_.functions().getAccelerationStructureDeviceAddress(device_.handle(), &info);
    }

private:
    Device &device_;
    VkAccelerationStructureGeometryKHR geometry_;
    VkAccelerationStructureBuildRangeInfoKHR range_;
    Buffer storage_, scratch_;
    VkAccelerationStructureBuildGeometryInfoKHR info_{};
};

TimedBuilds::TimedBuilds(Device &device, const std::vector<std::unique_ptr<TimedStructure>> &structures)
    : device_(device), timer_(device), commands_(device.allocateCommands())
{
    std::vector<VkAccelerationStructureBuildGeometryInfoKHR> infos;
    std::vector<const VkAccelerationStructureBuildRangeInfoKHR *> ranges;
    for (const auto &structure : structures) {
        infos.push_back(structure->info());
        ranges.push_back(&structure->range());
    }
    auto begin = vkInit<VkCommandBufferBeginInfo>();
    check(vkBeginCommandBuffer(commands_, &begin), "recording");
    timer_.begin(commands_);
    device.functions().cmdBuildAccelerationStructures(commands_, static_cast<uint32_t>(infos.size()), infos.data(),
                                                      ranges.data());
    timer_.end(commands_);
    check(vkEndCommandBuffer(commands_), "recording");
    device.submitAndWait(commands_);
}

Milliseconds TimedBuilds::run()
{
    return timer_.time([this] { device_.submitAndWait(commands_); });
}

TimedWorld::TimedWorld(const DeviceInfo &info, std::optional<MicromapApi> api)
    : device_(info, {api, info.rayTracingPipelines}),
      vertices_(uploadBuffer(device_, std::as_bytes(std::span(kTriangle)), kInput, 16))
{
    bottoms_.push_back(bottom());
    TimedBuilds(device_, bottoms_);
}

TimedWorld::~TimedWorld() = default;

std::unique_ptr<TimedBuilds> TimedWorld::top(uint32_t count)
{
    std::vector<VkAccelerationStructureInstanceKHR> instances(count);
    for (uint32_t i = 0; i < count; ++i) {
        VkAccelerationStructureInstanceKHR &instance = instances[i];
        for (int axis = 0; axis < 3; ++axis)
            instance.transform.matrix[axis][axis] = 1;
        instance.transform.matrix[0][3] = static_cast<float>(i % 317) * 2;
        instance.transform.matrix[1][3] = static_cast<float>(i / 317) * 2;
        instance.mask = 0xff;
        instance.accelerationStructureReference = bottoms_[0]->address();
    }
    instances_.push_back(uploadBuffer(device_, std::as_bytes(std::span(instances)), kInput, 16));
    auto geometry = vkInit<VkAccelerationStructureGeometryKHR>({.geometryType = VK_GEOMETRY_TYPE_INSTANCES_KHR});
    geometry.geometry.instances = vkInit<VkAccelerationStructureGeometryInstancesDataKHR>();
    geometry.geometry.instances.data.deviceAddress = instances_.back().address(16);
    std::vector<std::unique_ptr<TimedStructure>> one;
    one.push_back(
        std::make_unique<TimedStructure>(device_, VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR, geometry, count));
    auto builds = std::make_unique<TimedBuilds>(device_, one);
    tops_.push_back(std::move(one[0]));
    return builds;
}

std::unique_ptr<TimedBuilds> TimedWorld::bottoms(uint32_t count)
{
    std::vector<std::unique_ptr<TimedStructure>> many;
    for (uint32_t i = 0; i < count; ++i)
        many.push_back(bottom());
    auto builds = std::make_unique<TimedBuilds>(device_, many);
    for (auto &structure : many)
        bottoms_.push_back(std::move(structure));
    return builds;
}

std::unique_ptr<TimedStructure> TimedWorld::bottom()
{
    auto geometry = vkInit<VkAccelerationStructureGeometryKHR>({.geometryType = VK_GEOMETRY_TYPE_TRIANGLES_KHR});
    auto &triangles = geometry.geometry.triangles;
    triangles = vkInit<VkAccelerationStructureGeometryTrianglesDataKHR>({.vertexFormat = VK_FORMAT_R32G32B32_SFLOAT});
    triangles.vertexData.deviceAddress = vertices_.address(16);
    triangles.vertexStride = 3 * sizeof(float);
    triangles.maxVertex = 2;
    triangles.indexType = VK_INDEX_TYPE_NONE_KHR;
    return std::make_unique<TimedStructure>(device_, VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR, geometry, 1);
}

} // namespace vellum::cli
