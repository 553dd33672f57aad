// SPDX-License-Identifier: Apache-2.0
// Barriers of address ranges, and stages and accesses of micromap builds in all barriers, events, submissions and
// timestamps.
#include "layer/base/pnext.h"
#include "layer/validation/ranges/ranges.h"

namespace vellum::layer::ranges
{
namespace
{

constexpr VkPipelineStageFlags2 kMicromapBuild = VK_PIPELINE_STAGE_2_MICROMAP_BUILD_BIT_EXT;
constexpr VkPipelineStageFlags2 kStructureBuild = VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR;
// Stages that read in shaders, and those that stand for them.
constexpr VkPipelineStageFlags2 kShaderStages =
    VK_PIPELINE_STAGE_2_ALL_GRAPHICS_BIT | VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT |
    VK_PIPELINE_STAGE_2_PRE_RASTERIZATION_SHADERS_BIT | VK_PIPELINE_STAGE_2_VERTEX_SHADER_BIT |
    VK_PIPELINE_STAGE_2_TESSELLATION_CONTROL_SHADER_BIT | VK_PIPELINE_STAGE_2_TESSELLATION_EVALUATION_SHADER_BIT |
    VK_PIPELINE_STAGE_2_GEOMETRY_SHADER_BIT | VK_PIPELINE_STAGE_2_FRAGMENT_SHADER_BIT |
    VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT | VK_PIPELINE_STAGE_2_RAY_TRACING_SHADER_BIT_KHR |
    VK_PIPELINE_STAGE_2_TASK_SHADER_BIT_EXT | VK_PIPELINE_STAGE_2_MESH_SHADER_BIT_EXT |
    VK_PIPELINE_STAGE_2_SUBPASS_SHADING_BIT_HUAWEI | kStructureBuild | kMicromapBuild;
// Stages of extensions that the oldest headers do not know may be stages of shaders.
constexpr VkPipelineStageFlags2 kOtherStages = ~((VkPipelineStageFlags2{1} << 41) - 1);

// The ids of one half of a barrier: its first or second stages and accesses.
struct ScopeRules {
    const char *stages, *accesses; // members
    const char *shaderRead, *micromapWrite, *micromapRead, *feature;
};
struct BarrierRules {
    ScopeRules source, target;
};

constexpr BarrierRules kMemoryBarrier{
    {"srcStageMask", "srcAccessMask", "VUID-VkMemoryBarrier2-srcAccessMask-07454",
     "VUID-VkMemoryBarrier2-srcAccessMask-07457", "VUID-VkMemoryBarrier2-srcAccessMask-07458",
     "VUID-VkMemoryBarrier2-srcStageMask-11541"},
    {"dstStageMask", "dstAccessMask", "VUID-VkMemoryBarrier2-dstAccessMask-07454",
     "VUID-VkMemoryBarrier2-dstAccessMask-07457", "VUID-VkMemoryBarrier2-dstAccessMask-07458",
     "VUID-VkMemoryBarrier2-dstStageMask-11541"}};
constexpr BarrierRules kBufferBarrier{
    {"srcStageMask", "srcAccessMask", "VUID-VkBufferMemoryBarrier2-srcAccessMask-07454",
     "VUID-VkBufferMemoryBarrier2-srcAccessMask-07457", "VUID-VkBufferMemoryBarrier2-srcAccessMask-07458",
     "VUID-VkBufferMemoryBarrier2-srcStageMask-11541"},
    {"dstStageMask", "dstAccessMask", "VUID-VkBufferMemoryBarrier2-dstAccessMask-07454",
     "VUID-VkBufferMemoryBarrier2-dstAccessMask-07457", "VUID-VkBufferMemoryBarrier2-dstAccessMask-07458",
     "VUID-VkBufferMemoryBarrier2-dstStageMask-11541"}};
constexpr BarrierRules kImageBarrier{
    {"srcStageMask", "srcAccessMask", "VUID-VkImageMemoryBarrier2-srcAccessMask-07454",
     "VUID-VkImageMemoryBarrier2-srcAccessMask-07457", "VUID-VkImageMemoryBarrier2-srcAccessMask-07458",
     "VUID-VkImageMemoryBarrier2-srcStageMask-11541"},
    {"dstStageMask", "dstAccessMask", "VUID-VkImageMemoryBarrier2-dstAccessMask-07454",
     "VUID-VkImageMemoryBarrier2-dstAccessMask-07457", "VUID-VkImageMemoryBarrier2-dstAccessMask-07458",
     "VUID-VkImageMemoryBarrier2-dstStageMask-11541"}};
constexpr BarrierRules kRangeBarrier{
    {"srcStageMask", "srcAccessMask", "VUID-VkMemoryRangeBarrierKHR-srcAccessMask-07454",
     "VUID-VkMemoryRangeBarrierKHR-srcAccessMask-07457", "VUID-VkMemoryRangeBarrierKHR-srcAccessMask-07458",
     "VUID-VkMemoryRangeBarrierKHR-srcStageMask-11541"},
    {"dstStageMask", "dstAccessMask", "VUID-VkMemoryRangeBarrierKHR-dstAccessMask-07454",
     "VUID-VkMemoryRangeBarrierKHR-dstAccessMask-07457", "VUID-VkMemoryRangeBarrierKHR-dstAccessMask-07458",
     "VUID-VkMemoryRangeBarrierKHR-dstStageMask-11541"}};

void checkScope(const RangeCheck &ranges, const Place &barrier, VkPipelineStageFlags2 stages, VkAccessFlags2 accesses,
                const ScopeRules &rules)
{
    const Place member = barrier.member(rules.accesses);
    const auto needs = [&](VkAccessFlags2 access, VkPipelineStageFlags2 needed, const char *rule, const char *text) {
        if ((accesses & access) != 0 && (stages & needed) == 0)
            ranges.device()
                .at(member, ranges.commandBuffer())
                .report(rule, nullptr, std::string(text) + " in " + rules.stages);
    };
    needs(VK_ACCESS_2_SHADER_READ_BIT, kShaderStages | kOtherStages, rules.shaderRead,
          "SHADER_READ, without a stage that runs shaders or builds structures");
    // ALL_COMMANDS stands for all stages.
    needs(VK_ACCESS_2_MICROMAP_WRITE_BIT_EXT, kMicromapBuild | VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT,
          rules.micromapWrite, "MICROMAP_WRITE, without MICROMAP_BUILD");
    needs(VK_ACCESS_2_MICROMAP_READ_BIT_EXT, kMicromapBuild | kStructureBuild | VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT,
          rules.micromapRead, "MICROMAP_READ, without MICROMAP_BUILD or ACCELERATION_STRUCTURE_BUILD");
    checkStage(ranges.device(), barrier.member(rules.stages), stages, rules.feature, ranges.commandBuffer());
}

// Returns whether one half of a barrier may break a rule.
bool mayBreak(VkPipelineStageFlags2 stages, VkAccessFlags2 accesses)
{
    constexpr VkAccessFlags2 kMicromaps = VK_ACCESS_2_MICROMAP_WRITE_BIT_EXT | VK_ACCESS_2_MICROMAP_READ_BIT_EXT;
    return (stages & kMicromapBuild) != 0 || (accesses & kMicromaps) != 0 ||
           ((accesses & VK_ACCESS_2_SHADER_READ_BIT) != 0 && (stages & (kShaderStages | kOtherStages)) == 0);
}

template <typename Barrier>
void checkScopes(const RangeCheck &ranges, const Place &place, const Barrier &barrier, const BarrierRules &rules)
{
    if (mayBreak(barrier.srcStageMask, barrier.srcAccessMask))
        checkScope(ranges, place, barrier.srcStageMask, barrier.srcAccessMask, rules.source);
    if (mayBreak(barrier.dstStageMask, barrier.dstAccessMask))
        checkScope(ranges, place, barrier.dstStageMask, barrier.dstAccessMask, rules.target);
}

bool isFamily(const DeviceModel &device, uint32_t family)
{
    return family < device.facts.queueFamilies.size() || family == VK_QUEUE_FAMILY_EXTERNAL ||
           family == VK_QUEUE_FAMILY_FOREIGN_EXT;
}

void checkRangeBarrier(const RangeCheck &ranges, const Place &place, const VkMemoryRangeBarrierKHR &barrier)
{
    const DeviceModel &device = ranges.device();
    checkScopes(ranges, place, barrier, kRangeBarrier);
    ranges.check(place, barrier.addressRange, barrier.addressFlags, flagged::kBarrier, {});
    const uint32_t from = barrier.srcQueueFamilyIndex, to = barrier.dstQueueFamilyIndex;
    if (from == to)
        return;
    const std::string families = "from queue family " + std::to_string(from) + " to " + std::to_string(to);
    if (((barrier.srcStageMask | barrier.dstStageMask) & VK_PIPELINE_STAGE_2_HOST_BIT) != 0)
        ranges.fault(place, "VUID-VkMemoryRangeBarrierKHR-srcStageMask-13089",
                     families + ", with the stage HOST; they must be equal");
    const auto buffer = bufferAt(device, barrier.addressRange.address);
    if (!buffer || !buffer->exclusive)
        return;
    const std::string text =
        families + ", of exclusive buffer " + device.nameOf(buffer->handle) + ": there is no such family";
    if (!isFamily(device, from))
        ranges.fault(place.member("srcQueueFamilyIndex"), "VUID-VkMemoryRangeBarrierKHR-address-13087", text);
    if (!isFamily(device, to))
        ranges.fault(place.member("dstQueueFamilyIndex"), "VUID-VkMemoryRangeBarrierKHR-address-13088", text);
}

} // namespace

void checkStage(DeviceModel &device, const Place &place, VkPipelineStageFlags2 stages, const char *rule,
                ObjectHandle object)
{
    if ((stages & kMicromapBuild) != 0 && !device.driver.enabled.extFeature)
        device.at(place, object)
            .report(rule, nullptr,
                    "MICROMAP_BUILD; micromap of VkPhysicalDeviceOpacityMicromapFeaturesEXT is not enabled");
}

void checkDependency(const RangeCheck &check, const Place &place, const VkDependencyInfo &info)
{
    for (uint32_t i = 0; i < info.memoryBarrierCount; ++i)
        checkScopes(check, place.element("pMemoryBarriers", i), info.pMemoryBarriers[i], kMemoryBarrier);
    for (uint32_t i = 0; i < info.bufferMemoryBarrierCount; ++i)
        checkScopes(check, place.element("pBufferMemoryBarriers", i), info.pBufferMemoryBarriers[i], kBufferBarrier);
    for (uint32_t i = 0; i < info.imageMemoryBarrierCount; ++i)
        checkScopes(check, place.element("pImageMemoryBarriers", i), info.pImageMemoryBarriers[i], kImageBarrier);
    const auto *ranges =
        findInChain<VkMemoryRangeBarriersInfoKHR>(info.pNext, VK_STRUCTURE_TYPE_MEMORY_RANGE_BARRIERS_INFO_KHR);
    for (uint32_t i = 0; ranges && i < ranges->memoryRangeBarrierCount; ++i)
        checkRangeBarrier(check, place.element("pMemoryRangeBarriers", i), ranges->pMemoryRangeBarriers[i]);
}

void checkSubmission(DeviceModel &device, const Place &submit, const VkSubmitInfo2 &info)
{
    const auto check = [&](const char *array, uint32_t count, const VkSemaphoreSubmitInfo *semaphores) {
        for (uint32_t i = 0; i < count; ++i) {
            const Place place = submit.element(array, i);
            checkStage(device, place.member("stageMask"), semaphores[i].stageMask,
                       "VUID-VkSemaphoreSubmitInfo-stageMask-11541");
        }
    };
    check("pWaitSemaphoreInfos", info.waitSemaphoreInfoCount, info.pWaitSemaphoreInfos);
    check("pSignalSemaphoreInfos", info.signalSemaphoreInfoCount, info.pSignalSemaphoreInfos);
}

} // namespace vellum::layer::ranges
