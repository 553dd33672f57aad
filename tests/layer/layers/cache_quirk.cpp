// SPDX-License-Identifier: Apache-2.0
// The quirk "caching": VK_EXT_shader_module_identifier and VK_KHR_pipeline_binary, made out of lavapipe. What was once
// compiled is known by its code alone for as long as the process lives, also on later devices, as if it lay in a cache
// on disk. A binary is the code of all stages of a pipeline; what it is used for must be what it was captured from.
#include "layers/driver.h"

#include <cstring>
#include <deque>
#include <map>
#include <optional>
#include <vector>

#include "vk/newer.h"

namespace
{

using namespace driver;
constexpr Level kLevel = Level::Caches;

using Words = std::vector<uint32_t>;
using Identifier = std::array<uint8_t, 32>;

constexpr const char *kExtensions[]{"VK_EXT_shader_module_identifier", "VK_KHR_pipeline_binary"};
constexpr auto kBinaryFeatures = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PIPELINE_BINARY_FEATURES_KHR;
constexpr auto kBinaryProperties = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PIPELINE_BINARY_PROPERTIES_KHR;
constexpr VkFlags64 kCaptureData = VkFlags64{1} << 31;

struct OneFeature {
    VkStructureType sType;
    void *pNext;
    VkBool32 enabled;
};

// The driver's report about a pipeline without its code. Stages include their entry points.
struct Shape {
    std::vector<std::string> stages;
    std::vector<std::array<uint32_t, 5>> groups;
    uint32_t payloadSize = 0;
    bool operator==(const Shape &) const = default;
};
struct Captured {
    Shape shape;
    std::vector<Words> code;
};

std::mutex mutex;
std::map<VkShaderModule, Words> modules;
std::map<Identifier, Words> compiled;
std::map<Identifier, Captured> captured; // by the key of its binary; the internal cache, too
std::map<VkPipeline, Identifier> captures;
std::map<uint64_t, Identifier> binaries;
uint64_t lastBinary = 0;

class Hash
{
public:
    void add(const void *bytes, size_t size)
    {
        for (size_t i = 0; i < size; ++i) {
            state_ = (state_ ^ static_cast<const uint8_t *>(bytes)[i]) * 0x100000001b3u;
            state_ ^= state_ >> 29;
        }
    }
    [[nodiscard]] Identifier get() const
    {
        Identifier identifier;
        uint64_t word = state_;
        for (size_t at = 0; at < identifier.size(); at += 8) {
            word = (word ^ word >> 31) * 0x9e3779b97f4a7c15u;
            std::memcpy(&identifier[at], &word, 8);
        }
        return identifier;
    }

private:
    uint64_t state_ = 0xcbf29ce484222325u;
};

Identifier identifierOf(const Words &words)
{
    Hash hash;
    hash.add(words.data(), words.size() * 4);
    return hash.get();
}

Words wordsOf(const VkShaderModuleCreateInfo &info)
{
    return {info.pCode, info.pCode + info.codeSize / 4};
}

std::optional<Words> codeOf(const VkPipelineShaderStageCreateInfo &stage)
{
    std::lock_guard lock(mutex);
    if (const auto module = modules.find(stage.module); module != modules.end())
        return module->second;
    if (const auto *inlined =
            inChain<VkShaderModuleCreateInfo>(stage.pNext, VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO))
        return wordsOf(*inlined);
    const auto *known = inChain<VkPipelineShaderStageModuleIdentifierCreateInfoEXT>(
        stage.pNext, VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_MODULE_IDENTIFIER_CREATE_INFO_EXT);
    Identifier identifier{};
    if (known == nullptr || known->identifierSize != identifier.size())
        return std::nullopt;
    std::copy_n(known->pIdentifier, identifier.size(), identifier.begin());
    const auto found = compiled.find(identifier);
    return found == compiled.end() ? std::nullopt : std::optional(found->second);
}

std::span<const VkPipelineShaderStageCreateInfo> stagesOf(const VkComputePipelineCreateInfo &info)
{
    return {&info.stage, 1};
}
std::span<const VkPipelineShaderStageCreateInfo> stagesOf(const VkGraphicsPipelineCreateInfo &info)
{
    return {info.pStages, info.pStages == nullptr ? 0 : info.stageCount};
}
std::span<const VkPipelineShaderStageCreateInfo> stagesOf(const VkRayTracingPipelineCreateInfoKHR &info)
{
    return {info.pStages, info.stageCount};
}

template <class Info>
Shape shapeOf(const Info &info)
{
    Shape shape;
    for (const VkPipelineShaderStageCreateInfo &stage : stagesOf(info))
        shape.stages.push_back(std::to_string(stage.stage) + stage.pName);
    if constexpr (std::is_same_v<Info, VkRayTracingPipelineCreateInfoKHR>) {
        for (uint32_t i = 0; i < info.groupCount; ++i) {
            const VkRayTracingShaderGroupCreateInfoKHR &g = info.pGroups[i];
            shape.groups.push_back({static_cast<uint32_t>(g.type), g.generalShader, g.closestHitShader, g.anyHitShader,
                                    g.intersectionShader});
        }
        if (info.pLibraryInterface != nullptr)
            shape.payloadSize = info.pLibraryInterface->maxPipelineRayPayloadSize;
    }
    return shape;
}

template <class Info>
std::vector<Words> allCode(const Info &info)
{
    std::vector<Words> code;
    for (const VkPipelineShaderStageCreateInfo &stage : stagesOf(info))
        code.push_back(codeOf(stage).value_or(Words{}));
    return code;
}

Identifier keyOfPipeline(const Shape &shape, const std::vector<Words> &code)
{
    Hash hash;
    for (const std::string &stage : shape.stages)
        hash.add(stage.data(), stage.size());
    for (const auto &group : shape.groups)
        hash.add(group.data(), sizeof group);
    hash.add(&shape.payloadSize, sizeof shape.payloadSize);
    for (const Words &words : code)
        hash.add(words.data(), words.size() * 4);
    return hash.get();
}

// --- devices ---

VKAPI_ATTR VkResult VKAPI_CALL enumerateExtensions(VkPhysicalDevice handle, const char *layer, uint32_t *count,
                                                   VkExtensionProperties *properties)
{
    return listExtensions(kLevel, handle, layer, count, properties, [](std::vector<VkExtensionProperties> &all) {
        for (const char *name : kExtensions) {
            VkExtensionProperties own{};
            std::strcpy(own.extensionName, name);
            own.specVersion = 1;
            all.push_back(own);
        }
    });
}

VKAPI_ATTR void VKAPI_CALL getFeatures(VkPhysicalDevice handle, VkPhysicalDeviceFeatures2 *features)
{
    DRIVER_NEXT(vkGetPhysicalDeviceFeatures2)(handle, features);
    for (const auto type : {VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_MODULE_IDENTIFIER_FEATURES_EXT, kBinaryFeatures}) {
        if (auto *f = inChainOut<OneFeature>(features->pNext, type))
            f->enabled = VK_TRUE;
    }
}

VKAPI_ATTR void VKAPI_CALL getProperties(VkPhysicalDevice handle, VkPhysicalDeviceProperties2 *properties)
{
    DRIVER_NEXT(vkGetPhysicalDeviceProperties2)(handle, properties);
    if (auto *p = inChainOut<VkPhysicalDeviceShaderModuleIdentifierPropertiesEXT>(
            properties->pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_MODULE_IDENTIFIER_PROPERTIES_EXT))
        std::memset(p->shaderModuleIdentifierAlgorithmUUID, 0x17, VK_UUID_SIZE);
    struct BinaryProperties {
        VkStructureType sType;
        void *pNext;
        VkBool32 internalCache, others[4];
    };
    if (auto *p = inChainOut<BinaryProperties>(properties->pNext, kBinaryProperties))
        *p = {p->sType, p->pNext, VK_TRUE, {}};
}

VKAPI_ATTR VkResult VKAPI_CALL createDevice(VkPhysicalDevice handle, const VkDeviceCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkDevice *device)
{
    std::vector<const char *> names(info->ppEnabledExtensionNames,
                                    info->ppEnabledExtensionNames + info->enabledExtensionCount);
    for (const char *own : kExtensions)
        std::erase_if(names, [own](const char *name) { return std::strcmp(name, own) == 0; });
    VkDeviceCreateInfo below = *info;
    below.enabledExtensionCount = static_cast<uint32_t>(names.size());
    below.ppEnabledExtensionNames = names.data();
    return DRIVER_NEXT(vkCreateDevice)(handle, &below, allocator, device);
}

// --- modules ---

VKAPI_ATTR VkResult VKAPI_CALL createModule(VkDevice handle, const VkShaderModuleCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkShaderModule *module)
{
    const VkResult result = DRIVER_NEXT(vkCreateShaderModule)(handle, info, allocator, module);
    std::lock_guard lock(mutex);
    if (result == VK_SUCCESS)
        modules[*module] = wordsOf(*info);
    return result;
}

VKAPI_ATTR void VKAPI_CALL destroyModule(VkDevice handle, VkShaderModule module, const VkAllocationCallbacks *allocator)
{
    {
        std::lock_guard lock(mutex);
        modules.erase(module);
    }
    DRIVER_NEXT(vkDestroyShaderModule)(handle, module, allocator);
}

void give(VkShaderModuleIdentifierEXT *out, const Words &words)
{
    const Identifier identifier = identifierOf(words);
    out->identifierSize = static_cast<uint32_t>(identifier.size());
    std::copy(identifier.begin(), identifier.end(), out->identifier);
}

VKAPI_ATTR void VKAPI_CALL moduleIdentifier(VkDevice, VkShaderModule module, VkShaderModuleIdentifierEXT *out)
{
    std::lock_guard lock(mutex);
    give(out, modules.at(module));
}

VKAPI_ATTR void VKAPI_CALL infoIdentifier(VkDevice, const VkShaderModuleCreateInfo *info,
                                          VkShaderModuleIdentifierEXT *out)
{
    give(out, wordsOf(*info));
}

// --- pipelines ---

// A pipeline with modules of this level's for all of its stages: of what they have, are named by, or were in a binary.
template <class Info>
class WithModules
{
public:
    WithModules(VkDevice device, const Info &info, std::vector<Words> code) : device_(device), info_(info)
    {
        // Lavapipe would not know the code.
        info_.flags &= ~static_cast<VkPipelineCreateFlags>(VK_PIPELINE_CREATE_FAIL_ON_PIPELINE_COMPILE_REQUIRED_BIT);
        const auto from = stagesOf(info);
        stages_.assign(from.begin(), from.end());
        for (size_t i = 0; i < stages_.size(); ++i) {
            const auto module =
                vkInit<VkShaderModuleCreateInfo>({.codeSize = code[i].size() * 4, .pCode = code[i].data()});
            driver::next<PFN_vkCreateShaderModule>(kLevel, keyOf(device), "vkCreateShaderModule")(
                device, &module, nullptr, &stages_[i].module);
            stages_[i].pNext = nullptr;
        }
        if constexpr (std::is_same_v<Info, VkComputePipelineCreateInfo>)
            info_.stage = stages_[0];
        else
            info_.pStages = stages_.data();
    }
    WithModules(const WithModules &) = delete;
    WithModules &operator=(const WithModules &) = delete;
    ~WithModules()
    {
        for (const VkPipelineShaderStageCreateInfo &stage : stages_)
            driver::next<PFN_vkDestroyShaderModule>(kLevel, keyOf(device_),
                                                    "vkDestroyShaderModule")(device_, stage.module, nullptr);
    }
    [[nodiscard]] const Info &get() const { return info_; }

private:
    VkDevice device_;
    Info info_;
    std::vector<VkPipelineShaderStageCreateInfo> stages_;
};

bool captures64(const void *chain)
{
    const auto *flags =
        inChain<VkPipelineCreateFlags2CreateInfoKHR>(chain, VK_STRUCTURE_TYPE_PIPELINE_CREATE_FLAGS_2_CREATE_INFO_KHR);
    return flags != nullptr && (flags->flags & kCaptureData) != 0;
}

// Makes one pipeline, by `create`.
template <class Info, class Create>
VkResult make(VkDevice device, const Info &info, VkPipeline *pipeline, Create create)
{
    const Shape shape = shapeOf(info);
    const auto *from = inChain<VkPipelineBinaryInfoKHR>(info.pNext, VK_STRUCTURE_TYPE_PIPELINE_BINARY_INFO_KHR);
    if (from != nullptr && from->binaryCount > 0) {
        Captured binary;
        {
            std::lock_guard lock(mutex);
            binary = captured.at(binaries.at(reinterpret_cast<uint64_t>(from->pPipelineBinaries[0])));
        }
        if (!(binary.shape == shape))
            report("a pipeline is not the one that its binary was captured from");
        const WithModules own(device, info, binary.code);
        return create(own.get(), pipeline);
    }
    std::vector<Words> code;
    bool byName = false;
    for (const VkPipelineShaderStageCreateInfo &stage : stagesOf(info)) {
        const auto words = codeOf(stage);
        if (!words) {
            *pipeline = VK_NULL_HANDLE;
            return VK_PIPELINE_COMPILE_REQUIRED;
        }
        code.push_back(*words);
        byName = byName || (stage.module == VK_NULL_HANDLE &&
                            inChain(stage.pNext, VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO) == nullptr);
    }
    VkResult result = VK_SUCCESS;
    if (byName) {
        const WithModules own(device, info, code);
        result = create(own.get(), pipeline);
    } else {
        result = create(info, pipeline);
    }
    std::lock_guard lock(mutex);
    for (const Words &words : code)
        compiled[identifierOf(words)] = words;
    captures.erase(*pipeline);
    if (result == VK_SUCCESS && captures64(info.pNext)) {
        const Identifier key = keyOfPipeline(shape, code);
        captured[key] = {shape, code};
        captures[*pipeline] = key;
    }
    return result;
}

template <class Info, class Create>
VkResult makeAll(VkDevice device, uint32_t count, const Info *infos, VkPipeline *pipelines, Create create)
{
    VkResult worst = VK_SUCCESS;
    for (uint32_t i = 0; i < count; ++i) {
        const VkResult result = make(device, infos[i], &pipelines[i], create);
        if (result < 0 || worst == VK_SUCCESS)
            worst = result;
    }
    return worst;
}

VKAPI_ATTR VkResult VKAPI_CALL createCompute(VkDevice handle, VkPipelineCache cache, uint32_t count,
                                             const VkComputePipelineCreateInfo *infos,
                                             const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    return makeAll(handle, count, infos, pipelines, [&](const auto &info, VkPipeline *pipeline) {
        return DRIVER_NEXT(vkCreateComputePipelines)(handle, cache, 1, &info, allocator, pipeline);
    });
}

VKAPI_ATTR VkResult VKAPI_CALL createGraphics(VkDevice handle, VkPipelineCache cache, uint32_t count,
                                              const VkGraphicsPipelineCreateInfo *infos,
                                              const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    return makeAll(handle, count, infos, pipelines, [&](const auto &info, VkPipeline *pipeline) {
        return DRIVER_NEXT(vkCreateGraphicsPipelines)(handle, cache, 1, &info, allocator, pipeline);
    });
}

VKAPI_ATTR VkResult VKAPI_CALL createRays(VkDevice handle, VkDeferredOperationKHR operation, VkPipelineCache cache,
                                          uint32_t count, const VkRayTracingPipelineCreateInfoKHR *infos,
                                          const VkAllocationCallbacks *allocator, VkPipeline *pipelines)
{
    const VkResult result = makeAll(handle, count, infos, pipelines, [&](const auto &info, VkPipeline *pipeline) {
        return DRIVER_NEXT(vkCreateRayTracingPipelinesKHR)(handle, VK_NULL_HANDLE, cache, 1, &info, allocator,
                                                           pipeline);
    });
    return operation != VK_NULL_HANDLE && result == VK_SUCCESS ? VK_OPERATION_NOT_DEFERRED_KHR : result;
}

// --- binaries ---

void giveKey(VkPipelineBinaryKeyKHR *out, const Identifier &key)
{
    out->keySize = static_cast<uint32_t>(key.size());
    std::copy(key.begin(), key.end(), out->key);
}

Identifier keyOfInfo(const VkPipelineCreateInfoKHR *info)
{
    if (info == nullptr)
        return Identifier{0x42};
    const auto *structure = static_cast<const VkBaseInStructure *>(info->pNext);
    const auto key = [structure](auto type) {
        const auto &pipeline = *reinterpret_cast<const decltype(type) *>(structure);
        return keyOfPipeline(shapeOf(pipeline), allCode(pipeline));
    };
    switch (structure->sType) {
    case VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO: return key(VkComputePipelineCreateInfo{});
    case VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_CREATE_INFO: return key(VkGraphicsPipelineCreateInfo{});
    default: return key(VkRayTracingPipelineCreateInfoKHR{});
    }
}

VKAPI_ATTR VkResult VKAPI_CALL getKey(VkDevice, const VkPipelineCreateInfoKHR *info, VkPipelineBinaryKeyKHR *key)
{
    giveKey(key, keyOfInfo(info));
    return VK_SUCCESS;
}

// The data of a binary is its key once more; all else is `captured`.
VKAPI_ATTR VkResult VKAPI_CALL createBinaries(VkDevice, const VkPipelineBinaryCreateInfoKHR *info,
                                              const VkAllocationCallbacks *, VkPipelineBinaryHandlesInfoKHR *out)
{
    std::vector<Identifier> keys;
    if (info->pKeysAndDataInfo != nullptr) {
        for (uint32_t i = 0; i < info->pKeysAndDataInfo->binaryCount; ++i) {
            const VkPipelineBinaryDataKHR &data = info->pKeysAndDataInfo->pPipelineBinaryData[i];
            Identifier key{};
            if (data.dataSize == key.size())
                std::memcpy(key.data(), data.pData, key.size());
            std::lock_guard lock(mutex);
            if (data.dataSize != key.size() || !captured.contains(key) ||
                std::memcmp(info->pKeysAndDataInfo->pPipelineBinaryKeys[i].key, key.data(), key.size()) != 0)
                report("data of a binary is not as it was given, or its key is not");
            keys.push_back(key);
        }
    } else if (info->pPipelineCreateInfo != nullptr) {
        const Identifier key = keyOfInfo(info->pPipelineCreateInfo);
        std::lock_guard lock(mutex);
        if (!captured.contains(key)) {
            out->pipelineBinaryCount = 0; // "overwritten with the number of handles actually written"
            return VK_PIPELINE_BINARY_MISSING_KHR;
        }
        keys.push_back(key);
    } else {
        std::lock_guard lock(mutex);
        keys.push_back(captures.at(info->pipeline));
    }
    if (out->pPipelineBinaries == nullptr) {
        out->pipelineBinaryCount = static_cast<uint32_t>(keys.size());
        return VK_SUCCESS;
    }
    std::lock_guard lock(mutex);
    const auto all = static_cast<uint32_t>(keys.size());
    out->pipelineBinaryCount = std::min(out->pipelineBinaryCount, all);
    for (uint32_t i = 0; i < out->pipelineBinaryCount; ++i) {
        binaries[++lastBinary] = keys[i];
        out->pPipelineBinaries[i] = reinterpret_cast<VkPipelineBinaryKHR>(lastBinary);
    }
    return out->pipelineBinaryCount < all ? VK_INCOMPLETE : VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL destroyBinary(VkDevice, VkPipelineBinaryKHR binary, const VkAllocationCallbacks *)
{
    std::lock_guard lock(mutex);
    binaries.erase(reinterpret_cast<uint64_t>(binary));
}

VKAPI_ATTR VkResult VKAPI_CALL getData(VkDevice, const VkPipelineBinaryDataInfoKHR *info, VkPipelineBinaryKeyKHR *key,
                                       size_t *size, void *data)
{
    std::lock_guard lock(mutex);
    const Identifier &own = binaries.at(reinterpret_cast<uint64_t>(info->pipelineBinary));
    giveKey(key, own);
    const bool fits = data == nullptr || *size >= own.size();
    *size = own.size();
    if (data != nullptr && fits)
        std::memcpy(data, own.data(), own.size());
    return fits ? VK_SUCCESS : VK_ERROR_NOT_ENOUGH_SPACE_KHR;
}

VKAPI_ATTR VkResult VKAPI_CALL release(VkDevice, const void *)
{
    return VK_SUCCESS;
}

} // namespace

driver::LevelRows driver::cacheRows()
{
    static const Row device[]{
        {"vkCreateShaderModule", DRIVER_FUNCTION(createModule)},
        {"vkDestroyShaderModule", DRIVER_FUNCTION(destroyModule)},
        {"vkGetShaderModuleIdentifierEXT", DRIVER_FUNCTION(moduleIdentifier), Row::Where::Always},
        {"vkGetShaderModuleCreateInfoIdentifierEXT", DRIVER_FUNCTION(infoIdentifier), Row::Where::Always},
        {"vkCreateComputePipelines", DRIVER_FUNCTION(createCompute)},
        {"vkCreateGraphicsPipelines", DRIVER_FUNCTION(createGraphics)},
        {"vkCreateRayTracingPipelinesKHR", DRIVER_FUNCTION(createRays)},
        {"vkGetPipelineKeyKHR", DRIVER_FUNCTION(getKey), Row::Where::Always},
        {"vkCreatePipelineBinariesKHR", DRIVER_FUNCTION(createBinaries), Row::Where::Always},
        {"vkDestroyPipelineBinaryKHR", DRIVER_FUNCTION(destroyBinary), Row::Where::Always},
        {"vkGetPipelineBinaryDataKHR", DRIVER_FUNCTION(getData), Row::Where::Always},
        {"vkReleaseCapturedPipelineDataKHR", DRIVER_FUNCTION(release), Row::Where::Always},
    };
    static const Row instance[]{
        {"vkCreateDevice", DRIVER_FUNCTION(createDevice)},
        {"vkEnumerateDeviceExtensionProperties", DRIVER_FUNCTION(enumerateExtensions)},
        {"vkGetPhysicalDeviceFeatures2", DRIVER_FUNCTION(getFeatures)},
        {"vkGetPhysicalDeviceProperties2", DRIVER_FUNCTION(getProperties)},
    };
    return {device, instance};
}
