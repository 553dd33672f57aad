#include "layer/pipelines/pipeline_binaries.h"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include "layer/pipelines/device_pipelines.h"
#include "layer/pipelines/driver_stages.h"
#include "layer/pipelines/module_identifiers.h"
#include "layer/pipelines/shader_binary.h"
#include "layer/pipelines/shaders.h"

namespace vellum::layer
{
namespace
{

// Before the driver's data.
struct BinaryHeader {
    ShaderBinaryHeader device;
    uint32_t hiddenWay, hiddenConstant; // spirv::HiddenFlags
    uint64_t padding;                   // keeps an alignment of 16 bytes
};
static_assert(sizeof(BinaryHeader) == 48);

BinaryHeader headerOf(DevicePipelines &device, const HiddenInBinary &hidden)
{
    return {shaderBinaryHeader(device), static_cast<uint32_t>(hidden.way), hidden.constant, 0};
}

// Of a header that fits the device; otherwise not known.
HiddenInBinary hiddenFlagsOf(DevicePipelines &device, const newer::PipelineBinaryData &data)
{
    using Way = spirv::HiddenFlags::Way;
    BinaryHeader header{};
    if (data.dataSize < sizeof header)
        return {};
    std::memcpy(&header, data.pData, sizeof header);
    if (!(header.device == shaderBinaryHeader(device)) || header.hiddenWay > static_cast<uint32_t>(Way::InPayload))
        return {};
    return {true, static_cast<Way>(header.hiddenWay), header.hiddenConstant};
}

void mixKey(DevicePipelines &device, newer::PipelineBinaryKey &key)
{
    mix(key.key, std::min(key.keySize, newer::kMaxPipelineBinaryKeySize), deviceMask(device));
}

// Calls `use` with a create info as the driver gets it. VK_PIPELINE_COMPILE_REQUIRED where there is no code for it.
using Use = std::function<VkResult(const newer::PipelineCreateInfo &, const HiddenInBinary &)>;
VkResult withDriverInfo(DevicePipelines &device, const newer::PipelineCreateInfo &info, const Use &use)
{
    const auto *const structure = static_cast<const VkBaseInStructure *>(info.pNext);
    const auto useOwn = [&](auto &own) {
        const newer::PipelineCreateInfo driverInfo{info.sType, &own};
        return use(driverInfo, {});
    };
    DriverStages stages(device);
    DriverIdentifiers identifiers(device);
    std::deque<Chain> chains;
    if (structure && structure->sType == VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO) {
        auto own = *reinterpret_cast<const VkComputePipelineCreateInfo *>(structure);
        const VkResult result = translate(device, own, stages, identifiers, chains);
        return result == VK_SUCCESS ? useOwn(own) : result;
    }
    if (structure && structure->sType == VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_CREATE_INFO) {
        auto own = *reinterpret_cast<const VkGraphicsPipelineCreateInfo *>(structure);
        const VkResult result = translate(device, own, stages, identifiers, chains);
        return result == VK_SUCCESS ? useOwn(own) : result;
    }
    if (structure && structure->sType == VK_STRUCTURE_TYPE_RAY_TRACING_PIPELINE_CREATE_INFO_KHR) {
        return withDriverInfo(device, *reinterpret_cast<const VkRayTracingPipelineCreateInfoKHR *>(structure),
                              [&](const VkRayTracingPipelineCreateInfoKHR &own, const HiddenInBinary &hidden) {
                                  const newer::PipelineCreateInfo driverInfo{
                                      info.sType, const_cast<VkRayTracingPipelineCreateInfoKHR *>(&own)};
                                  return use(driverInfo, hidden);
                              });
    }
    return use(info, {});
}

VkResult failAll(newer::PipelineBinaryHandlesInfo &binaries)
{
    if (binaries.pPipelineBinaries)
        std::fill_n(binaries.pPipelineBinaries, binaries.pipelineBinaryCount, nullptr);
    return VK_ERROR_INITIALIZATION_FAILED;
}

VkResult createFromData(DevicePipelines &device, VkDevice handle, const newer::PipelineBinaryCreateInfo &info,
                        const VkAllocationCallbacks *allocator, newer::PipelineBinaryHandlesInfo &binaries)
{
    const newer::PipelineBinaryKeysAndData &given = *info.pKeysAndDataInfo;
    std::vector<newer::PipelineBinaryKey> keys(given.pPipelineBinaryKeys,
                                               given.pPipelineBinaryKeys + given.binaryCount);
    std::vector<newer::PipelineBinaryData> data(given.pPipelineBinaryData,
                                                given.pPipelineBinaryData + given.binaryCount);
    std::vector<HiddenInBinary> hidden(given.binaryCount);
    for (uint32_t i = 0; i < given.binaryCount; ++i) {
        mixKey(device, keys[i]);
        hidden[i] = hiddenFlagsOf(device, data[i]);
        if (!hidden[i].known) {
            device.driver.report().error("VELLUM-pipeline-binary",
                                         "vkCreatePipelineBinariesKHR: binary " + std::to_string(i) +
                                             " is of another version of the layer, or of a device that had its tables "
                                             "elsewhere. The global key tells");
            return failAll(binaries);
        }
        data[i].pData = static_cast<std::byte *>(data[i].pData) + sizeof(BinaryHeader);
        data[i].dataSize -= sizeof(BinaryHeader);
    }
    const newer::PipelineBinaryKeysAndData own{given.binaryCount, keys.data(), data.data()};
    newer::PipelineBinaryCreateInfo driverInfo = info;
    driverInfo.pKeysAndDataInfo = &own;
    const VkResult result = device.driver.next.CreatePipelineBinariesKHR(handle, &driverInfo, allocator, &binaries);
    const uint32_t made = binaries.pPipelineBinaries ? std::min(binaries.pipelineBinaryCount, given.binaryCount) : 0;
    for (uint32_t i = 0; i < made; ++i) {
        if (binaries.pPipelineBinaries[i])
            device.pipelineBinaries.set(binaries.pPipelineBinaries[i], hidden[i]);
    }
    return result;
}

} // namespace

const newer::PipelineBinaryInfo *binariesOf(const void *pNext)
{
    const auto *info = findInChain<newer::PipelineBinaryInfo>(pNext, newer::kPipelineBinaryInfo);
    return info && info->binaryCount > 0 ? info : nullptr;
}

HiddenInBinary hiddenFlagsIn(const DevicePipelines &device, const newer::PipelineBinaryInfo &info)
{
    return device.pipelineBinaries.get(info.pPipelineBinaries[0]);
}

VkResult createPipelineBinaries(DevicePipelines &device, VkDevice handle, const newer::PipelineBinaryCreateInfo *info,
                                const VkAllocationCallbacks *allocator, newer::PipelineBinaryHandlesInfo *binaries)
{
    if (info->pKeysAndDataInfo)
        return createFromData(device, handle, *info, allocator, *binaries);
    const auto create = [&](const newer::PipelineBinaryCreateInfo &driverInfo, const HiddenInBinary &hidden) {
        const VkResult result = device.driver.next.CreatePipelineBinariesKHR(handle, &driverInfo, allocator, binaries);
        for (uint32_t i = 0; binaries->pPipelineBinaries && i < binaries->pipelineBinaryCount; ++i) {
            if (result >= 0 && binaries->pPipelineBinaries[i])
                device.pipelineBinaries.set(binaries->pPipelineBinaries[i], hidden);
        }
        return result;
    };
    if (info->pPipelineCreateInfo) {
        const VkResult result =
            withDriverInfo(device, *info->pPipelineCreateInfo,
                           [&](const newer::PipelineCreateInfo &pipeline, const HiddenInBinary &hidden) {
                               newer::PipelineBinaryCreateInfo driverInfo = *info;
                               driverInfo.pPipelineCreateInfo = &pipeline;
                               return create(driverInfo, hidden);
                           });
        if (result != VK_PIPELINE_COMPILE_REQUIRED)
            return result;
        failAll(*binaries);
        return newer::kPipelineBinaryMissing;
    }
    const auto pipeline = device.rayTracingPipelines.get(info->pipeline);
    return create(*info, pipeline ? pipeline->hidden : HiddenInBinary{true});
}

void destroyPipelineBinary(DevicePipelines &device, VkDevice handle, newer::PipelineBinary binary,
                           const VkAllocationCallbacks *allocator)
{
    device.pipelineBinaries.take(binary);
    device.driver.next.DestroyPipelineBinaryKHR(handle, binary, allocator);
}

VkResult getPipelineKey(DevicePipelines &device, VkDevice handle, const newer::PipelineCreateInfo *info,
                        newer::PipelineBinaryKey *key)
{
    VkResult result = VK_PIPELINE_COMPILE_REQUIRED;
    if (info)
        result =
            withDriverInfo(device, *info, [&](const newer::PipelineCreateInfo &driverInfo, const HiddenInBinary &) {
                return device.driver.next.GetPipelineKeyKHR(handle, &driverInfo, key);
            });
    else
        result = device.driver.next.GetPipelineKeyKHR(handle, nullptr, key);
    // Without its code a ray tracing pipeline that uses micromaps cannot be made, and its key cannot be that of the
    // pipeline with its code. It is one that no pipeline has.
    if (result == VK_PIPELINE_COMPILE_REQUIRED) {
        result = device.driver.next.GetPipelineKeyKHR(handle, nullptr, key); // for its size
        static std::atomic<uint64_t> numbers{0};
        const struct {
            std::array<uint8_t, VK_UUID_SIZE> process;
            uint64_t number;
        } unique{processUuid(), ++numbers};
        const Mask bytes = maskOf(std::as_bytes(std::span(&unique, 1)));
        std::copy_n(bytes.begin(), std::min(key->keySize, newer::kMaxPipelineBinaryKeySize), key->key);
    }
    if (result == VK_SUCCESS)
        mixKey(device, *key);
    return result;
}

VkResult getPipelineBinaryData(DevicePipelines &device, VkDevice handle, const newer::PipelineBinaryDataInfo *info,
                               newer::PipelineBinaryKey *key, size_t *size, void *data)
{
    size_t driverSize = 0;
    VkResult result = device.driver.next.GetPipelineBinaryDataKHR(handle, info, key, &driverSize, nullptr);
    const size_t needed = driverSize + sizeof(BinaryHeader);
    if (result == VK_SUCCESS && data && *size < needed)
        result = newer::kNotEnoughSpace;
    else if (result == VK_SUCCESS && data)
        result = device.driver.next.GetPipelineBinaryDataKHR(handle, info, key, &driverSize,
                                                             static_cast<std::byte *>(data) + sizeof(BinaryHeader));
    if (result == VK_SUCCESS && data) {
        const BinaryHeader header = headerOf(device, device.pipelineBinaries.get(info->pipelineBinary));
        std::memcpy(data, &header, sizeof header);
    }
    *size = result == VK_SUCCESS && data ? driverSize + sizeof(BinaryHeader) : needed;
    mixKey(device, *key);
    return result;
}

} // namespace vellum::layer
