#include "layer/pipelines/ray_flag_probe.h"

#include <cstring>

#include "core/ray_flags.h"
#include "layer/commands/start_up_commands.h"
#include "layer/ground/pnext.h"
#include "layer/pipelines/device_pipelines.h"
#include "layer/pipelines/ray_flag_probe_pipeline.h"

namespace vellum::layer
{
namespace
{

constexpr uint32_t kProbedBits = shared::kCarriedRayFlags;
constexpr uint32_t kCommittedTriangle = 1;

bool enablesRayQueries(const VkDeviceCreateInfo &info)
{
    const auto *features = findInChain<VkPhysicalDeviceRayQueryFeaturesKHR>(
        info.pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_QUERY_FEATURES_KHR);
    return features && features->rayQuery;
}

bool enablesPipelines(const VkDeviceCreateInfo &info)
{
    const auto *features = findInChain<VkPhysicalDeviceRayTracingPipelineFeaturesKHR>(
        info.pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_TRACING_PIPELINE_FEATURES_KHR);
    return features && features->rayTracingPipeline;
}

// One triangle, one instance of it, and one ray each way, on a queue of the application that nobody has yet.
class Probe
{
public:
    explicit Probe(DevicePipelines &device)
        : device_(device), next_(device.driver.next), commands_(device.driver), pipeline_(device.buffers.gpu)
    {
    }

    ~Probe()
    {
        for (const VkAccelerationStructureKHR structure : {bottom_, top_}) {
            if (structure)
                next_.DestroyAccelerationStructureKHR(device_.driver.handle, structure, nullptr);
        }
    }

    // Asks about what is true in `asked`.
    CarriedRayFlagBits run(const CarriedRayFlagBits &asked, const VkDeviceCreateInfo &info,
                           PFN_vkSetDeviceLoaderData setLoaderData)
    {
        if (!commands_.chooseQueue(info))
            return {}; // no queue that could trace a ray
        CarriedRayFlagBits carried{!asked.inQueries, !asked.inPipelines};
        if (!commands_.begin(setLoaderData) || !buildTriangle() || !buildInstance() ||
            results_.create(device_.buffers.gpu, 16) != VK_SUCCESS)
            return carried;
        const bool query = asked.inQueries && traceQuery();
        const bool pipeline = asked.inPipelines && tracePipeline();
        if (!commands_.submitAndWait())
            return carried;
        const uint32_t *results = results_.words();
        const auto returns = [](uint32_t flags) { return (flags & kProbedBits) == kProbedBits; };
        if (query)
            carried.inQueries = returns(results[0]) && results[1] == kCommittedTriangle;
        if (pipeline)
            carried.inPipelines = returns(results[2]) && returns(results[3]);
        return carried;
    }

private:
    bool buildTriangle()
    {
        constexpr float kVertices[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
        if (!makeInput(vertices_, kVertices, sizeof kVertices))
            return false;
        VkAccelerationStructureGeometryKHR geometry{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR};
        geometry.geometryType = VK_GEOMETRY_TYPE_TRIANGLES_KHR;
        geometry.flags = VK_GEOMETRY_OPAQUE_BIT_KHR;
        VkAccelerationStructureGeometryTrianglesDataKHR &triangles = geometry.geometry.triangles;
        triangles = {VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_TRIANGLES_DATA_KHR};
        triangles.vertexFormat = VK_FORMAT_R32G32B32_SFLOAT;
        triangles.vertexData.deviceAddress = vertices_.address();
        triangles.vertexStride = 3 * sizeof(float);
        triangles.maxVertex = 2;
        triangles.indexType = VK_INDEX_TYPE_NONE_KHR;
        return build(VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR, geometry, bottomMemory_, bottomScratch_, bottom_);
    }

    bool buildInstance()
    {
        VkAccelerationStructureInstanceKHR instance{};
        for (int i = 0; i < 3; ++i)
            instance.transform.matrix[i][i] = 1;
        instance.mask = 0xff;
        instance.accelerationStructureReference = device_.driver.structureAddress(bottom_);
        if (!makeInput(instances_, &instance, sizeof instance))
            return false;
        VkAccelerationStructureGeometryKHR geometry{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR};
        geometry.geometryType = VK_GEOMETRY_TYPE_INSTANCES_KHR;
        geometry.geometry.instances = {VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_INSTANCES_DATA_KHR};
        geometry.geometry.instances.data.deviceAddress = instances_.address();
        return build(VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR, geometry, topMemory_, topScratch_, top_);
    }

    bool makeInput(GpuBuffer &buffer, const void *data, size_t bytes)
    {
        if (buffer.create(device_.buffers.gpu, bytes,
                          VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR) != VK_SUCCESS)
            return false;
        std::memcpy(buffer.words(), data, bytes);
        return true;
    }

    bool build(VkAccelerationStructureTypeKHR type, const VkAccelerationStructureGeometryKHR &geometry,
               GpuBuffer &memory, GpuBuffer &scratch, VkAccelerationStructureKHR &structure)
    {
        constexpr VkDeviceSize kScratchAlignment = 256; // no driver asks for more
        VkAccelerationStructureBuildGeometryInfoKHR info{
            VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_GEOMETRY_INFO_KHR};
        info.type = type;
        info.geometryCount = 1;
        info.pGeometries = &geometry;
        const uint32_t one = 1;
        VkAccelerationStructureBuildSizesInfoKHR sizes{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR};
        next_.GetAccelerationStructureBuildSizesKHR(
            device_.driver.handle, VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &info, &one, &sizes);
        if (memory.create(device_.buffers.gpu, sizes.accelerationStructureSize,
                          VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR) != VK_SUCCESS ||
            scratch.create(device_.buffers.gpu, sizes.buildScratchSize + kScratchAlignment) != VK_SUCCESS)
            return false;
        VkAccelerationStructureCreateInfoKHR create{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_KHR};
        create.buffer = memory.buffer();
        create.size = sizes.accelerationStructureSize;
        create.type = type;
        if (next_.CreateAccelerationStructureKHR(device_.driver.handle, &create, nullptr, &structure) != VK_SUCCESS)
            return false;
        info.dstAccelerationStructure = structure;
        info.scratchData.deviceAddress = (scratch.address() + kScratchAlignment - 1) & ~(kScratchAlignment - 1);
        const VkAccelerationStructureBuildRangeInfoKHR range{1, 0, 0, 0};
        const VkAccelerationStructureBuildRangeInfoKHR *ranges = &range;
        next_.CmdBuildAccelerationStructuresKHR(commands_.handle(), 1, &info, &ranges);
        InjectedWork(device_.commands, commands_.handle()).barrier();
        return true;
    }

    bool traceQuery()
    {
        const RayFlagProbePush push{device_.driver.structureAddress(top_), results_.address(), kProbedBits, 0};
        InjectedWork work(device_.commands, commands_.handle());
        const bool traced = work.dispatch(InjectedShader::RayFlagProbe, push, 1, 1);
        work.barrier();
        return traced;
    }

    bool tracePipeline()
    {
        const RayFlagProbePush push{device_.driver.structureAddress(top_), results_.address() + 8, kProbedBits, 0};
        const bool traced = pipeline_.record(commands_.handle(), push);
        InjectedWork(device_.commands, commands_.handle()).barrier();
        return traced;
    }

    DevicePipelines &device_;
    const DeviceTable &next_;
    StartUpCommands commands_;
    GpuBuffer vertices_, instances_, results_;
    GpuBuffer bottomMemory_, bottomScratch_, topMemory_, topScratch_;
    RayFlagPipelineProbe pipeline_;
    VkAccelerationStructureKHR bottom_ = VK_NULL_HANDLE;
    VkAccelerationStructureKHR top_ = VK_NULL_HANDLE;
};

} // namespace

CarriedRayFlagBits probeRayFlagBits(DevicePipelines &device, const VkDeviceCreateInfo &info,
                                    PFN_vkSetDeviceLoaderData setLoaderData)
{
    const CarriedRayFlagBits asked{enablesRayQueries(info), enablesPipelines(info)};
    if (!asked.inQueries && !asked.inPipelines)
        return {};
    return Probe(device).run(asked, info, setLoaderData);
}

} // namespace vellum::layer
