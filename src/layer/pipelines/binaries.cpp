// SPDX-License-Identifier: Apache-2.0
#include "layer/pipelines/binaries.h"

#include <algorithm>
#include <cstring>
#include <functional>
#include <random>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/hash.h"
#include "core/ray_flags.h"
#include "layer/base/commands.h"
#include "layer/base/undo.h"
#include "layer/pipelines/device_pipelines.h"
#include "layer/pipelines/driver_stages.h"
#include "layer/pipelines/module_identifiers.h"
#include "layer/pipelines/pipeline_creation.h"
#include "layer/pipelines/shaders.h"

namespace vellum::layer
{

const std::array<uint8_t, VK_UUID_SIZE> &rewriterUuid()
{
    static const auto uuid = [] {
        const uint64_t linked = spirv::linkedCodeHash();
        const uint64_t version = Hash::of(std::as_bytes(std::span(std::string_view(VELLUM_VERSION))));
        std::array<uint8_t, VK_UUID_SIZE> bytes{};
        std::memcpy(bytes.data(), &linked, sizeof linked);
        std::memcpy(bytes.data() + sizeof linked, &version, sizeof version);
        return bytes;
    }();
    return uuid;
}

const std::array<uint8_t, VK_UUID_SIZE> &processUuid()
{
    static const auto uuid = [] {
        std::random_device random;
        std::array<uint8_t, VK_UUID_SIZE> bytes{};
        for (uint8_t &byte : bytes)
            byte = static_cast<uint8_t>(random());
        return bytes;
    }();
    return uuid;
}

ShaderBinaryHeader shaderBinaryHeader(DevicePipelines &device)
{
    const spirv::RewriteOptions options = rewriteOptions(device);
    const uint64_t all = options.queriesConsume == spirv::QueriesConsume::Always ? 1 : 0;
    return {rewriterUuid(), options.rootAddress, options.firstSlots | all << 63};
}

VkResult getShaderBinaryData(DevicePipelines &device, VkDevice handle, VkShaderEXT shader, size_t *size, void *data)
{
    constexpr size_t kHeader = sizeof(ShaderBinaryHeader);
    if (!data) {
        const VkResult result = device.driver.next.GetShaderBinaryDataEXT(handle, shader, size, nullptr);
        *size += kHeader;
        return result;
    }
    if (*size < kHeader) {
        *size = 0; // "If pDataSize is less than the size of the binary ... nothing is written"
        return VK_INCOMPLETE;
    }
    size_t driverSize = *size - kHeader;
    const VkResult result = device.driver.next.GetShaderBinaryDataEXT(handle, shader, &driverSize,
                                                                      static_cast<std::byte *>(data) + kHeader);
    if (result == VK_SUCCESS) {
        const ShaderBinaryHeader header = shaderBinaryHeader(device);
        std::memcpy(data, &header, kHeader);
        *size = driverSize + kHeader;
    } else {
        *size = 0;
    }
    return result;
}

namespace
{

// All that the code of a binary depends on. It is part of the keys.
struct BinaryFacts {
    ShaderBinaryHeader device;
    uint64_t settings;
    uint32_t hiddenFixed, hiddenConstant; // spirv::HiddenFlags
    bool operator==(const BinaryFacts &) const = default;
};
static_assert(sizeof(BinaryFacts) == 48);

// Before the driver's data.
struct BinaryHeader {
    BinaryFacts facts;
    uint64_t size, checksum; // of the driver's data, which drivers need not validate
};
static_assert(sizeof(BinaryHeader) == 64); // keeps the alignment of 16 bytes

BinaryFacts factsOf(DevicePipelines &device, const HiddenInBinary &hidden)
{
    return {shaderBinaryHeader(device), rewriteSettings(device), hidden.fixed, hidden.constant};
}

std::span<const std::byte> driverData(const VkPipelineBinaryDataKHR &data)
{
    return std::span(static_cast<const std::byte *>(data.pData), data.dataSize).subspan(sizeof(BinaryHeader));
}

// The ray flags of a binary; unknown if its header does not match the device, or its data is damaged.
HiddenInBinary hiddenFlagsOf(DevicePipelines &device, const VkPipelineBinaryDataKHR &data)
{
    BinaryHeader header{};
    if (data.dataSize <= sizeof header)
        return {};
    std::memcpy(&header, data.pData, sizeof header);
    const HiddenInBinary hidden{true, header.facts.hiddenFixed, header.facts.hiddenConstant};
    const bool matches = header.facts == factsOf(device, hidden) && (hidden.fixed & ~shared::kHiddenRayFlags) == 0 &&
                         (hidden.constant & ~hidden.fixed) == 0;
    const std::span<const std::byte> driversData = driverData(data);
    if (!matches || header.size != driversData.size() ||
        header.checksum != hashBytes(driversData.data(), driversData.size()))
        return {};
    return hidden;
}

void mixKey(VkPipelineBinaryKeyKHR &key, const Mask &mask)
{
    mix(key.key, std::min(key.keySize, VK_MAX_PIPELINE_BINARY_KEY_SIZE_KHR), mask);
}

// The mask for keys of binaries. Unlike the key of the pipeline, these depend on how ray flags travel.
Mask binaryMask(DevicePipelines &device, const HiddenInBinary &hidden)
{
    const BinaryFacts facts = factsOf(device, hidden);
    return maskOf(std::as_bytes(std::span(&facts, 1)));
}

// Calls `use` with the driver's create info. VK_PIPELINE_COMPILE_REQUIRED if code that must be rewritten is missing.
using Use = std::function<VkResult(const VkPipelineCreateInfoKHR &, const HiddenInBinary &)>;
VkResult withDriverInfo(DevicePipelines &device, const VkPipelineCreateInfoKHR &info, const Use &use)
{
    const auto *const structure = static_cast<const VkBaseInStructure *>(info.pNext);
    const auto useChanged = [&](auto own) {
        DriverPipelineInfo changed(device);
        if (const VkResult result = changed.change(own); result != VK_SUCCESS)
            return result;
        const VkPipelineCreateInfoKHR driverInfo{info.sType, &own};
        return changed.identifiers.useUntilKnown([&] { return use(driverInfo, {}); });
    };
    switch (structure ? structure->sType : VK_STRUCTURE_TYPE_MAX_ENUM) {
    case VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO:
        return useChanged(*reinterpret_cast<const VkComputePipelineCreateInfo *>(structure));
    case VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_CREATE_INFO:
        return useChanged(*reinterpret_cast<const VkGraphicsPipelineCreateInfo *>(structure));
    case VK_STRUCTURE_TYPE_RAY_TRACING_PIPELINE_CREATE_INFO_KHR:
        return withDriverInfo(device, *reinterpret_cast<const VkRayTracingPipelineCreateInfoKHR *>(structure),
                              [&](const VkRayTracingPipelineCreateInfoKHR &own, const HiddenInBinary &hidden) {
                                  const VkPipelineCreateInfoKHR driverInfo{
                                      info.sType, const_cast<VkRayTracingPipelineCreateInfoKHR *>(&own)};
                                  return use(driverInfo, hidden);
                              });
    default: return use(info, {});
    }
}

// Replaces VK_ERROR_INVALID_SHADER_NV, which the command must not return. The layer has already reported the shader.
VkResult withoutShaderError(VkResult result, VkResult instead)
{
    return result == VK_ERROR_INVALID_SHADER_NV ? instead : result;
}

// Records binaries that the driver has created. Destroys them if out of memory.
void addBinaries(DevicePipelines &device, VkDevice handle, const VkAllocationCallbacks *allocator,
                 std::span<VkPipelineBinaryKHR> binaries, const std::function<HiddenInBinary(size_t)> &hidden)
{
    Undo undo([&] {
        for (VkPipelineBinaryKHR &binary : binaries) {
            if (binary)
                destroyPipelineBinary(device, handle, binary, allocator);
            binary = nullptr;
        }
    });
    for (size_t i = 0; i < binaries.size(); ++i) {
        if (binaries[i])
            device.pipelineBinaries.set(binaries[i], hidden(i));
    }
    undo.keep();
}

// The driver creates the binaries that match; the handles of others are null ("all pipeline binaries ... will be
// attempted").
VkResult createFromData(DevicePipelines &device, VkDevice handle, const VkPipelineBinaryCreateInfoKHR &info,
                        const VkAllocationCallbacks *allocator, VkPipelineBinaryHandlesInfoKHR &binaries)
{
    const VkPipelineBinaryKeysAndDataKHR &application = *info.pKeysAndDataInfo;
    const uint32_t count = std::min(application.binaryCount, binaries.pipelineBinaryCount);
    VkResult result = count < application.binaryCount ? VK_INCOMPLETE : VK_SUCCESS;
    std::vector<VkPipelineBinaryKeyKHR> keys;
    std::vector<VkPipelineBinaryDataKHR> data;
    std::vector<HiddenInBinary> hidden;
    std::vector<uint32_t> locations;
    for (uint32_t i = 0; i < count; ++i) {
        const HiddenInBinary known = hiddenFlagsOf(device, application.pPipelineBinaryData[i]);
        if (!known.known) {
            device.driver.report().error(
                "VELLUM-pipeline-binary",
                "vkCreatePipelineBinariesKHR: binary " + std::to_string(i) +
                    " was created by another version of the layer, with other settings, or on a device whose tables "
                    "had other addresses, which changes the global key; or it is damaged");
            result = VK_ERROR_INITIALIZATION_FAILED;
            continue;
        }
        mixKey(keys.emplace_back(application.pPipelineBinaryKeys[i]), binaryMask(device, known));
        VkPipelineBinaryDataKHR &own = data.emplace_back(application.pPipelineBinaryData[i]);
        own.pData = static_cast<std::byte *>(own.pData) + sizeof(BinaryHeader);
        own.dataSize -= sizeof(BinaryHeader);
        hidden.push_back(known);
        locations.push_back(i);
    }
    binaries.pipelineBinaryCount = count;
    if (locations.empty())
        return result;
    std::vector<VkPipelineBinaryKHR> made(locations.size());
    VkPipelineBinaryHandlesInfoKHR handles = binaries;
    handles.pipelineBinaryCount = static_cast<uint32_t>(made.size());
    handles.pPipelineBinaries = made.data();
    const VkPipelineBinaryKeysAndDataKHR own{handles.pipelineBinaryCount, keys.data(), data.data()};
    VkPipelineBinaryCreateInfoKHR driverInfo = info;
    driverInfo.pKeysAndDataInfo = &own;
    const VkResult drivers = device.driver.next.CreatePipelineBinariesKHR(handle, &driverInfo, allocator, &handles);
    addBinaries(device, handle, allocator, made, [&](size_t i) { return hidden[i]; });
    for (size_t i = 0; i < made.size(); ++i)
        binaries.pPipelineBinaries[locations[i]] = made[i];
    return result < 0 || drivers == VK_SUCCESS ? result : drivers;
}

// Writes a key for a pipeline that cannot be created, such as one with micromaps whose code is missing. It depends on
// all that the layer knows of the create info.
void writeSubstituteKey(DevicePipelines &device, const VkPipelineCreateInfoKHR &info, VkPipelineBinaryKeyKHR &key)
{
    std::string bytes;
    const auto add = [&bytes](const void *data, size_t size) { bytes.append(static_cast<const char *>(data), size); };
    const auto addNumber = [&add](uint64_t number) { add(&number, sizeof number); };
    const auto addStage = [&](const VkPipelineShaderStageCreateInfo &stage) {
        addNumber(stage.stage);
        add(stage.pName, std::strlen(stage.pName) + 1);
        const auto *name = findInChain<VkPipelineShaderStageModuleIdentifierCreateInfoEXT>(
            stage.pNext, VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_MODULE_IDENTIFIER_CREATE_INFO_EXT);
        if (name && !stage.module)
            add(name->pIdentifier, name->identifierSize);
        if (const auto code = device.rayTracingModules.get(stage.module))
            add(code->words.data(), code->words.size() * 4);
        else
            addNumber(reinterpret_cast<uint64_t>(stage.module));
        if (const VkSpecializationInfo *special = stage.pSpecializationInfo) {
            add(special->pMapEntries, special->mapEntryCount * sizeof(VkSpecializationMapEntry));
            add(special->pData, special->dataSize);
        }
    };
    const auto *const structure = static_cast<const VkBaseInStructure *>(info.pNext);
    addNumber(structure->sType);
    if (structure->sType == VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO) {
        const auto &own = *reinterpret_cast<const VkComputePipelineCreateInfo *>(structure);
        addNumber(pipelineFlags(own.pNext, own.flags));
        addStage(own.stage);
    } else if (structure->sType == VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_CREATE_INFO) {
        const auto &own = *reinterpret_cast<const VkGraphicsPipelineCreateInfo *>(structure);
        addNumber(pipelineFlags(own.pNext, own.flags));
        std::for_each_n(own.pStages, hasShaderStages(own) ? own.stageCount : 0, addStage);
    } else {
        const auto &own = *reinterpret_cast<const VkRayTracingPipelineCreateInfoKHR *>(structure);
        addNumber(pipelineFlags(own.pNext, own.flags));
        addNumber(own.maxPipelineRayRecursionDepth);
        std::for_each_n(own.pStages, own.stageCount, addStage);
        for (const VkRayTracingShaderGroupCreateInfoKHR &group : std::span(own.pGroups, own.groupCount)) {
            for (const uint32_t part : {static_cast<uint32_t>(group.type), group.generalShader, group.closestHitShader,
                                        group.anyHitShader, group.intersectionShader})
                addNumber(part);
        }
        for (uint32_t i = 0; own.pLibraryInfo && i < own.pLibraryInfo->libraryCount; ++i)
            addNumber(reinterpret_cast<uint64_t>(own.pLibraryInfo->pLibraries[i]));
    }
    const Mask substitute = maskOf(std::as_bytes(std::span(bytes)));
    std::copy_n(substitute.begin(), std::min(key.keySize, VK_MAX_PIPELINE_BINARY_KEY_SIZE_KHR), key.key);
}

} // namespace

const VkPipelineBinaryInfoKHR *binariesOf(const void *pNext)
{
    const auto *info = findInChain<VkPipelineBinaryInfoKHR>(pNext, VK_STRUCTURE_TYPE_PIPELINE_BINARY_INFO_KHR);
    return info && info->binaryCount > 0 ? info : nullptr;
}

HiddenInBinary hiddenFlagsIn(const DevicePipelines &device, const VkPipelineBinaryInfoKHR &info)
{
    return device.pipelineBinaries.get(info.pPipelineBinaries[0]);
}

VkResult createPipelineBinaries(DevicePipelines &device, VkDevice handle, const VkPipelineBinaryCreateInfoKHR *info,
                                const VkAllocationCallbacks *allocator, VkPipelineBinaryHandlesInfoKHR *binaries)
{
    const bool emulated = device.driver.emulated();
    const uint32_t count = binaries->pipelineBinaryCount; // of the array, for each call of the driver
    const uint32_t capacity = binaries->pPipelineBinaries ? count : 0;
    std::fill_n(binaries->pPipelineBinaries, capacity, nullptr);
    if (emulated && info->pKeysAndDataInfo && binaries->pPipelineBinaries)
        return createFromData(device, handle, *info, allocator, *binaries);
    binaries->pipelineBinaryCount = 0; // unless the driver is called
    const auto create = [&](const VkPipelineBinaryCreateInfoKHR &driverInfo, const HiddenInBinary &hidden) {
        binaries->pipelineBinaryCount = count;
        const VkResult result = device.driver.next.CreatePipelineBinariesKHR(handle, &driverInfo, allocator, binaries);
        if (emulated) // even if some failed
            addBinaries(device, handle, allocator, {binaries->pPipelineBinaries, capacity},
                        [&](size_t) { return hidden; });
        return result;
    };
    if (info->pPipelineCreateInfo && !info->pKeysAndDataInfo) {
        const VkResult result =
            withDriverInfo(device, *info->pPipelineCreateInfo,
                           [&](const VkPipelineCreateInfoKHR &pipeline, const HiddenInBinary &hidden) {
                               VkPipelineBinaryCreateInfoKHR driverInfo = *info;
                               driverInfo.pPipelineCreateInfo = &pipeline;
                               return create(driverInfo, hidden);
                           });
        const bool missing = result == VK_PIPELINE_COMPILE_REQUIRED || result == VK_PIPELINE_BINARY_MISSING_KHR;
        if (missing)
            binaries->pipelineBinaryCount = 0;
        return missing ? VK_PIPELINE_BINARY_MISSING_KHR : withoutShaderError(result, VK_ERROR_INITIALIZATION_FAILED);
    }
    const auto pipeline = device.rayTracingPipelines.get(info->pipeline);
    return create(*info, pipeline ? pipeline->hidden : HiddenInBinary{true});
}

void destroyPipelineBinary(DevicePipelines &device, VkDevice handle, VkPipelineBinaryKHR binary,
                           const VkAllocationCallbacks *allocator)
{
    device.pipelineBinaries.take(binary);
    device.driver.next.DestroyPipelineBinaryKHR(handle, binary, allocator);
}

VkResult getPipelineKey(DevicePipelines &device, VkDevice handle, const VkPipelineCreateInfoKHR *info,
                        VkPipelineBinaryKeyKHR *key)
{
    VkResult result = VK_PIPELINE_COMPILE_REQUIRED;
    if (info)
        result = withDriverInfo(device, *info, [&](const VkPipelineCreateInfoKHR &driverInfo, const HiddenInBinary &) {
            return device.driver.next.GetPipelineKeyKHR(handle, &driverInfo, key);
        });
    else
        result = device.driver.next.GetPipelineKeyKHR(handle, nullptr, key);
    if (info && result == VK_PIPELINE_COMPILE_REQUIRED) {
        result = device.driver.next.GetPipelineKeyKHR(handle, nullptr, key); // for the key's size
        writeSubstituteKey(device, *info, *key);
    }
    if (result == VK_SUCCESS && device.driver.emulated())
        mixKey(*key, deviceMask(device));
    return withoutShaderError(result, VK_ERROR_UNKNOWN);
}

VkResult getPipelineBinaryData(DevicePipelines &device, VkDevice handle, const VkPipelineBinaryDataInfoKHR *info,
                               VkPipelineBinaryKeyKHR *key, size_t *size, void *data)
{
    size_t driverSize = 0;
    VkResult result = device.driver.next.GetPipelineBinaryDataKHR(handle, info, key, &driverSize, nullptr);
    const size_t needed = driverSize + sizeof(BinaryHeader);
    if (result == VK_SUCCESS && data && *size < needed)
        result = VK_ERROR_NOT_ENOUGH_SPACE_KHR;
    else if (result == VK_SUCCESS && data)
        result = device.driver.next.GetPipelineBinaryDataKHR(handle, info, key, &driverSize,
                                                             static_cast<std::byte *>(data) + sizeof(BinaryHeader));
    const HiddenInBinary hidden = device.pipelineBinaries.get(info->pipelineBinary);
    if (result == VK_SUCCESS && data) {
        const VkPipelineBinaryDataKHR all{driverSize + sizeof(BinaryHeader), data};
        const BinaryHeader header{factsOf(device, hidden), driverSize, hashBytes(driverData(all).data(), driverSize)};
        std::memcpy(data, &header, sizeof header);
    }
    *size = result == VK_SUCCESS && data ? driverSize + sizeof(BinaryHeader) : needed;
    mixKey(*key, binaryMask(device, hidden));
    return result;
}

} // namespace vellum::layer
