// SPDX-License-Identifier: Apache-2.0
// vellum-structure-bench: builds of acceleration structures without micromaps, with the layer and without, in turns:
// what the layer adds to rebuilding a TLAS and to building many small BLASes. Times of single submissions, from
// submission to the end of the wait.
#include <chrono>
#include <cstdio>

#include <fmt/format.h>

#include "cli/render_command.h"
#include "cli/vulkan/resources.h"
#include "layer_comparison.h"
#include "side_by_side.h"
#include "vk/vk_init.h"

namespace
{

using namespace vellum;
using cli::Buffer;

constexpr VkBufferUsageFlags kAddress = VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;
constexpr VkBufferUsageFlags kInput = kAddress | VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR;

// A structure of one geometry, with memory of its own.
class Structure
{
public:
    Structure(cli::Device &device, VkAccelerationStructureTypeKHR type,
              const VkAccelerationStructureGeometryKHR &geometry, uint32_t primitives)
        : device_(device), geometry_(geometry), range_{primitives, 0, 0, 0}
    {
        info_ = vkInit<VkAccelerationStructureBuildGeometryInfoKHR>(
            {.type = type, .geometryCount = 1, .pGeometries = &geometry_});
        auto sizes = vkInit<VkAccelerationStructureBuildSizesInfoKHR>();
        const cli::DeviceFunctions &vk = device.functions();
        vk.getAccelerationStructureBuildSizes(device.handle(), VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &info_,
                                              &primitives, &sizes);
        storage_ = Buffer(device, sizes.accelerationStructureSize,
                          kAddress | VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR, Buffer::Place::Device);
        const VkDeviceSize alignment = device.scratchAlignment();
        scratch_ = Buffer(device, sizes.buildScratchSize + alignment, kAddress | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT,
                          Buffer::Place::Device);
        auto create = vkInit<VkAccelerationStructureCreateInfoKHR>(
            {.buffer = storage_.handle(), .size = sizes.accelerationStructureSize, .type = type});
        cli::check(vk.createAccelerationStructure(device.handle(), &create, nullptr, &info_.dstAccelerationStructure),
                   "creating an acceleration structure");
        info_.scratchData.deviceAddress = scratch_.address(alignment);
    }
    ~Structure()
    {
        device_.functions().destroyAccelerationStructure(device_.handle(), info_.dstAccelerationStructure, nullptr);
    }
    Structure(const Structure &) = delete;
    Structure &operator=(const Structure &) = delete;

    [[nodiscard]] const VkAccelerationStructureBuildGeometryInfoKHR &info() const { return info_; }
    [[nodiscard]] const VkAccelerationStructureBuildRangeInfoKHR &range() const { return range_; }
    [[nodiscard]] VkDeviceAddress address() const
    {
        auto info = vkInit<VkAccelerationStructureDeviceAddressInfoKHR>(
            {.accelerationStructure = info_.dstAccelerationStructure});
        return device_.functions().getAccelerationStructureDeviceAddress(device_.handle(), &info);
    }

private:
    cli::Device &device_;
    VkAccelerationStructureGeometryKHR geometry_;
    VkAccelerationStructureBuildRangeInfoKHR range_;
    Buffer storage_, scratch_;
    VkAccelerationStructureBuildGeometryInfoKHR info_{};
};

// A command buffer that builds all of them by one command, and how long it takes.
class Builds
{
public:
    Builds(cli::Device &device, const std::vector<std::unique_ptr<Structure>> &structures)
        : device_(device), commands_(device.allocateCommands())
    {
        std::vector<VkAccelerationStructureBuildGeometryInfoKHR> infos;
        std::vector<const VkAccelerationStructureBuildRangeInfoKHR *> ranges;
        for (const auto &structure : structures) {
            infos.push_back(structure->info());
            ranges.push_back(&structure->range());
        }
        auto begin = vkInit<VkCommandBufferBeginInfo>();
        cli::check(vkBeginCommandBuffer(commands_, &begin), "recording");
        device.functions().cmdBuildAccelerationStructures(commands_, static_cast<uint32_t>(infos.size()), infos.data(),
                                                          ranges.data());
        cli::check(vkEndCommandBuffer(commands_), "recording");
        device.submitAndWait(commands_);
    }
    double milliseconds()
    {
        const auto begin = std::chrono::steady_clock::now();
        device_.submitAndWait(commands_);
        return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
    }

private:
    cli::Device &device_;
    VkCommandBuffer commands_;
};

// Everything that is built on one device.
class World
{
public:
    World(const cli::DeviceInfo &info, std::optional<cli::MicromapApi> api)
        : device_(info, {api, info.rayTracingPipelines}),
          vertices_(cli::uploadBuffer(device_, std::as_bytes(std::span(kTriangle)), kInput, 16))
    {
        bottoms_.push_back(bottom());
        Builds(device_, bottoms_);
    }

    std::unique_ptr<Builds> top(uint32_t count)
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
        instances_.push_back(cli::uploadBuffer(device_, std::as_bytes(std::span(instances)), kInput, 16));
        auto geometry = vkInit<VkAccelerationStructureGeometryKHR>({.geometryType = VK_GEOMETRY_TYPE_INSTANCES_KHR});
        geometry.geometry.instances = vkInit<VkAccelerationStructureGeometryInstancesDataKHR>();
        geometry.geometry.instances.data.deviceAddress = instances_.back().address(16);
        std::vector<std::unique_ptr<Structure>> one;
        one.push_back(
            std::make_unique<Structure>(device_, VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR, geometry, count));
        auto builds = std::make_unique<Builds>(device_, one);
        tops_.push_back(std::move(one[0]));
        return builds;
    }

    std::unique_ptr<Builds> bottoms(uint32_t count)
    {
        std::vector<std::unique_ptr<Structure>> many;
        for (uint32_t i = 0; i < count; ++i)
            many.push_back(bottom());
        auto builds = std::make_unique<Builds>(device_, many);
        for (auto &structure : many)
            bottoms_.push_back(std::move(structure));
        return builds;
    }

private:
    static constexpr float kTriangle[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};

    std::unique_ptr<Structure> bottom()
    {
        auto geometry = vkInit<VkAccelerationStructureGeometryKHR>({.geometryType = VK_GEOMETRY_TYPE_TRIANGLES_KHR});
        auto &triangles = geometry.geometry.triangles;
        triangles =
            vkInit<VkAccelerationStructureGeometryTrianglesDataKHR>({.vertexFormat = VK_FORMAT_R32G32B32_SFLOAT});
        triangles.vertexData.deviceAddress = vertices_.address(16);
        triangles.vertexStride = 3 * sizeof(float);
        triangles.maxVertex = 2;
        triangles.indexType = VK_INDEX_TYPE_NONE_KHR;
        return std::make_unique<Structure>(device_, VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR, geometry, 1);
    }

    cli::Device device_;
    Buffer vertices_;
    std::vector<Buffer> instances_;
    std::vector<std::unique_ptr<Structure>> bottoms_, tops_;
};

void run(const cli::DeviceInfo &off, const cli::DeviceInfo &on, unsigned repetitions)
{
    World bare(off, std::nullopt), layered(on, cli::MicromapApi::Khr);
    fmt::print("{}, {}, medians of {}, milliseconds\n\n"
               "| what is built | layer off | layer on | on - off | on/off |\n|---|--:|--:|--:|--:|\n",
               on.name, on.implementation, repetitions);
    const auto row = [&](const std::string &name, Builds &classic, Builds &own) {
        bench::SideBySide times;
        for (unsigned r = 0; r < repetitions; ++r)
            times.measure([&] { return classic.milliseconds(); }, [&] { return own.milliseconds(); });
        fmt::print("| {} | {:.3f} | {:.3f} | {:.3f} | {:.2f} |\n", name, times.classic(), times.own(),
                   times.own() - times.classic(), times.ratio());
        std::fflush(stdout);
    };
    for (const uint32_t count : {1u, 1000u, 100000u})
        row(fmt::format("TLAS of {} instances", count), *bare.top(count), *layered.top(count));
    row("1,000 BLASes of one triangle", *bare.bottoms(1000), *layered.bottoms(1000));
}

} // namespace

int main(int argc, char **argv)
{
    return bench::compareDevices(argc, argv, "vellum-structure-bench",
                                 "Builds of acceleration structures with the layer and without; prints Markdown.",
                                 "Builds of each kind", run);
}
