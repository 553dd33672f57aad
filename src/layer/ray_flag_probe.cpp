#include "layer/ray_flag_probe.h"

#include <cstring>
#include <vector>

#include "core/ray_flags.h"
#include "layer/device.h"
#include "layer/pnext.h"
#include "layer/ray_flag_probe_pipeline.h"

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
    explicit Probe(Device &device) : device_(device), next_(device.next), pipeline_(device.gpu) {}

    ~Probe()
    {
        for (const VkAccelerationStructureKHR structure : {bottom_, top_}) {
            if (structure)
                next_.DestroyAccelerationStructureKHR(device_.handle, structure, nullptr);
        }
        if (pool_)
            next_.DestroyCommandPool(device_.handle, pool_, nullptr);
    }

    // Asks about what is true in `asked`.
    CarriedRayFlagBits run(const CarriedRayFlagBits &asked, uint32_t family, VkDeviceQueueCreateFlags queueFlags,
                           PFN_vkSetDeviceLoaderData setLoaderData)
    {
        CarriedRayFlagBits carried{!asked.inQueries, !asked.inPipelines};
        if (!prepareCommands(family, queueFlags, setLoaderData) || !buildTriangle() || !buildInstance() ||
            results_.create(device_.gpu, 16) != VK_SUCCESS)
            return carried;
        const bool query = asked.inQueries && traceQuery();
        const bool pipeline = asked.inPipelines && tracePipeline();
        if (next_.EndCommandBuffer(commands_) != VK_SUCCESS || !submit())
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
    bool prepareCommands(uint32_t family, VkDeviceQueueCreateFlags queueFlags, PFN_vkSetDeviceLoaderData setLoaderData)
    {
        const VkDeviceQueueInfo2 queueInfo{VK_STRUCTURE_TYPE_DEVICE_QUEUE_INFO_2, nullptr, queueFlags, family, 0};
        next_.GetDeviceQueue2(device_.handle, &queueInfo, &queue_);
        const VkCommandPoolCreateInfo poolInfo{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO, nullptr, 0, family};
        if (!queue_ || next_.CreateCommandPool(device_.handle, &poolInfo, nullptr, &pool_) != VK_SUCCESS)
            return false;
        const VkCommandBufferAllocateInfo info{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO, nullptr, pool_,
                                               VK_COMMAND_BUFFER_LEVEL_PRIMARY, 1};
        if (next_.AllocateCommandBuffers(device_.handle, &info, &commands_) != VK_SUCCESS)
            return false;
        // Dispatchable objects that a layer makes for itself need the loader's table, which layers below read.
        setLoaderData(device_.handle, queue_);
        setLoaderData(device_.handle, commands_);
        VkCommandBufferBeginInfo begin{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
        begin.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
        return next_.BeginCommandBuffer(commands_, &begin) == VK_SUCCESS;
    }

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
        instance.accelerationStructureReference = device_.structureAddress(bottom_);
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
        if (buffer.create(device_.gpu, bytes, VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR) !=
            VK_SUCCESS)
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
        next_.GetAccelerationStructureBuildSizesKHR(device_.handle, VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR,
                                                    &info, &one, &sizes);
        if (memory.create(device_.gpu, sizes.accelerationStructureSize,
                          VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR) != VK_SUCCESS ||
            scratch.create(device_.gpu, sizes.buildScratchSize + kScratchAlignment) != VK_SUCCESS)
            return false;
        VkAccelerationStructureCreateInfoKHR create{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_KHR};
        create.buffer = memory.buffer();
        create.size = sizes.accelerationStructureSize;
        create.type = type;
        if (next_.CreateAccelerationStructureKHR(device_.handle, &create, nullptr, &structure) != VK_SUCCESS)
            return false;
        info.dstAccelerationStructure = structure;
        info.scratchData.deviceAddress = (scratch.address() + kScratchAlignment - 1) & ~(kScratchAlignment - 1);
        const VkAccelerationStructureBuildRangeInfoKHR range{1, 0, 0, 0};
        const VkAccelerationStructureBuildRangeInfoKHR *ranges = &range;
        next_.CmdBuildAccelerationStructuresKHR(commands_, 1, &info, &ranges);
        InjectedWork(device_, commands_).barrier();
        return true;
    }

    bool traceQuery()
    {
        const RayFlagProbePush push{device_.structureAddress(top_), results_.address(), kProbedBits, 0};
        InjectedWork work(device_, commands_);
        const bool traced = work.dispatch(InjectedShader::RayFlagProbe, push, 1, 1);
        work.barrier();
        return traced;
    }

    bool tracePipeline()
    {
        const RayFlagProbePush push{device_.structureAddress(top_), results_.address() + 8, kProbedBits, 0};
        const bool traced = pipeline_.record(commands_, push);
        InjectedWork(device_, commands_).barrier();
        return traced;
    }

    bool submit()
    {
        VkSubmitInfo info{VK_STRUCTURE_TYPE_SUBMIT_INFO};
        info.commandBufferCount = 1;
        info.pCommandBuffers = &commands_;
        return next_.QueueSubmit(queue_, 1, &info, VK_NULL_HANDLE) == VK_SUCCESS &&
               next_.QueueWaitIdle(queue_) == VK_SUCCESS;
    }

    Device &device_;
    const DeviceTable &next_;
    VkQueue queue_ = VK_NULL_HANDLE;
    VkCommandPool pool_ = VK_NULL_HANDLE;
    VkCommandBuffer commands_ = VK_NULL_HANDLE;
    GpuBuffer vertices_, instances_, results_;
    GpuBuffer bottomMemory_, bottomScratch_, topMemory_, topScratch_;
    RayFlagPipelineProbe pipeline_;
    VkAccelerationStructureKHR bottom_ = VK_NULL_HANDLE;
    VkAccelerationStructureKHR top_ = VK_NULL_HANDLE;
};

} // namespace

CarriedRayFlagBits probeRayFlagBits(Device &device, const VkDeviceCreateInfo &info,
                                    PFN_vkSetDeviceLoaderData setLoaderData)
{
    const CarriedRayFlagBits asked{enablesRayQueries(info), enablesPipelines(info)};
    if (!asked.inQueries && !asked.inPipelines)
        return {};
    const InstanceTable &instance = device.instance->next;
    uint32_t count = 0;
    instance.GetPhysicalDeviceQueueFamilyProperties(device.physicalDevice, &count, nullptr);
    std::vector<VkQueueFamilyProperties> families(count);
    instance.GetPhysicalDeviceQueueFamilyProperties(device.physicalDevice, &count, families.data());
    for (uint32_t i = 0; i < info.queueCreateInfoCount; ++i) {
        const VkDeviceQueueCreateInfo &queues = info.pQueueCreateInfos[i];
        const bool isProtected = (queues.flags & VK_DEVICE_QUEUE_CREATE_PROTECTED_BIT) != 0;
        if (!isProtected && queues.queueFamilyIndex < count &&
            (families[queues.queueFamilyIndex].queueFlags & VK_QUEUE_COMPUTE_BIT) != 0)
            return setLoaderData ? Probe(device).run(asked, queues.queueFamilyIndex, queues.flags, setLoaderData)
                                 : CarriedRayFlagBits{!asked.inQueries, !asked.inPipelines};
    }
    return {}; // no queue that could trace a ray
}

} // namespace vellum::layer
