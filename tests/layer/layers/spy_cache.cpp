// SPDX-License-Identifier: Apache-2.0
// If VELLUM_TEST_SPY_CACHE is set, the spy is a driver with pipeline caches; lavapipe's never hold anything. A
// pipeline's key consists of everything that a driver would compile: the words of its modules, entry points,
// specialization, flags, groups and libraries. Creation feedback reports hits.
#include "layers/spy.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <map>
#include <set>
#include <vector>

namespace spy
{
namespace
{

using Key = uint64_t;

bool caching()
{
    return std::getenv("VELLUM_TEST_SPY_CACHE") != nullptr;
}

class Hash
{
public:
    void add(const void *data, size_t bytes)
    {
        for (const auto *byte = static_cast<const uint8_t *>(data); bytes > 0; ++byte, --bytes)
            key_ = (key_ ^ *byte) * 0x100000001b3u; // FNV-1a
    }
    template <class Number>
    void add(Number number)
    {
        add(&number, sizeof number);
    }
    [[nodiscard]] Key key() const { return key_; }

private:
    Key key_ = 0xcbf29ce484222325u;
};

std::map<VkShaderModule, Key> modules;
std::map<VkPipeline, Key> keys;
std::map<VkPipelineCache, std::set<Key>> caches;

Key keyOfWords(const VkShaderModuleCreateInfo &info)
{
    Hash hash;
    hash.add(info.pCode, info.codeSize);
    return hash.key();
}

void addStage(Hash &hash, const VkPipelineShaderStageCreateInfo &stage)
{
    hash.add(stage.stage);
    hash.add(stage.flags);
    hash.add(stage.pName, std::strlen(stage.pName));
    const void *inlined = inChain(stage.pNext, VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
    hash.add(stage.module != VK_NULL_HANDLE ? modules.at(stage.module)
                                            : keyOfWords(*static_cast<const VkShaderModuleCreateInfo *>(inlined)));
    if (const VkSpecializationInfo *special = stage.pSpecializationInfo) {
        hash.add(special->pMapEntries, special->mapEntryCount * sizeof(VkSpecializationMapEntry));
        hash.add(special->pData, special->dataSize);
    }
}

Key cacheKeyOf(const VkComputePipelineCreateInfo &info)
{
    Hash hash;
    hash.add(info.flags);
    addStage(hash, info.stage);
    return hash.key();
}

Key cacheKeyOf(const VkRayTracingPipelineCreateInfoKHR &info)
{
    Hash hash;
    hash.add(info.flags);
    hash.add(info.maxPipelineRayRecursionDepth);
    for (const VkPipelineShaderStageCreateInfo &stage : std::span(info.pStages, info.stageCount))
        addStage(hash, stage);
    for (const VkRayTracingShaderGroupCreateInfoKHR &group : std::span(info.pGroups, info.groupCount)) {
        hash.add(group.type);
        for (const uint32_t shader :
             {group.generalShader, group.closestHitShader, group.anyHitShader, group.intersectionShader})
            hash.add(shader);
    }
    for (uint32_t i = 0; info.pLibraryInfo != nullptr && i < info.pLibraryInfo->libraryCount; ++i)
        hash.add(keys.at(info.pLibraryInfo->pLibraries[i]));
    return hash.key();
}

template <class Info>
void look(VkPipelineCache cache, const Info &info, VkPipeline pipeline)
{
    if (!caching() || pipeline == VK_NULL_HANDLE)
        return;
    std::lock_guard lock(mutex);
    const Key key = cacheKeyOf(info);
    keys[pipeline] = key;
    const bool hit = cache != VK_NULL_HANDLE && !caches[cache].insert(key).second;
    const auto *feedback = static_cast<const VkPipelineCreationFeedbackCreateInfo *>(
        inChain(info.pNext, VK_STRUCTURE_TYPE_PIPELINE_CREATION_FEEDBACK_CREATE_INFO));
    if (feedback != nullptr)
        feedback->pPipelineCreationFeedback->flags =
            VK_PIPELINE_CREATION_FEEDBACK_VALID_BIT |
            (hit ? VK_PIPELINE_CREATION_FEEDBACK_APPLICATION_PIPELINE_CACHE_HIT_BIT : 0);
}

VKAPI_ATTR VkResult VKAPI_CALL createCache(VkDevice handle, const VkPipelineCacheCreateInfo *info,
                                           const VkAllocationCallbacks *allocator, VkPipelineCache *cache)
{
    VkPipelineCacheCreateInfo empty = *info;
    if (caching())
        empty.initialDataSize = 0;
    const VkResult result = SPY_NEXT(vkCreatePipelineCache)(handle, &empty, allocator, cache);
    if (result == VK_SUCCESS && caching()) {
        std::lock_guard lock(mutex);
        std::vector<Key> known(info->initialDataSize / sizeof(Key));
        if (!known.empty())
            std::memcpy(known.data(), info->pInitialData, known.size() * sizeof(Key));
        caches[*cache] = {known.begin(), known.end()};
    }
    return result;
}

VKAPI_ATTR VkResult VKAPI_CALL getCacheData(VkDevice handle, VkPipelineCache cache, size_t *size, void *data)
{
    if (!caching())
        return SPY_NEXT(vkGetPipelineCacheData)(handle, cache, size, data);
    std::lock_guard lock(mutex);
    const std::set<Key> &known = caches[cache];
    const size_t capacity = *size / sizeof(Key);
    *size = known.size() * sizeof(Key);
    if (data == nullptr)
        return VK_SUCCESS;
    if (capacity < known.size())
        return VK_INCOMPLETE;
    std::copy(known.begin(), known.end(), static_cast<Key *>(data));
    return VK_SUCCESS;
}

} // namespace

void keepWords(VkShaderModule module, const VkShaderModuleCreateInfo &info)
{
    if (!caching())
        return;
    std::lock_guard lock(mutex);
    modules[module] = keyOfWords(info);
}

void lookInCache(VkPipelineCache cache, const VkComputePipelineCreateInfo &info, VkPipeline pipeline)
{
    look(cache, info, pipeline);
}
void lookInCache(VkPipelineCache cache, const VkRayTracingPipelineCreateInfoKHR &info, VkPipeline pipeline)
{
    look(cache, info, pipeline);
}

std::span<const Row> pipelineCaches()
{
    static const Row rows[]{
        {"vkCreatePipelineCache", SPY_FUNCTION(createCache)},
        {"vkGetPipelineCacheData", SPY_FUNCTION(getCacheData)},
    };
    return rows;
}

} // namespace spy
