#include "layer/pipelines/ray_flag_probe_pipeline.h"

#include <array>
#include <cstring>

#include "layer/pipelines/ray_tracing_pipeline.h"
#include "shaders/ray_flag_probe_rahit.h"
#include "shaders/ray_flag_probe_rchit.h"
#include "shaders/ray_flag_probe_rgen.h"

namespace vellum::layer
{
namespace
{

constexpr uint32_t kGroups = 2;           // ray generation, hit
constexpr VkDeviceSize kRecordBytes = 64; // a multiple of any shaderGroupBaseAlignment
constexpr uint32_t kBaseAlignment = 64;

struct Stage {
    VkShaderStageFlagBits stage;
    const uint32_t *words;
    size_t bytes;
};

constexpr Stage kStages[] = {
    {VK_SHADER_STAGE_RAYGEN_BIT_KHR, ray_flag_probe_rgen, sizeof ray_flag_probe_rgen},
    {VK_SHADER_STAGE_ANY_HIT_BIT_KHR, ray_flag_probe_rahit, sizeof ray_flag_probe_rahit},
    {VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR, ray_flag_probe_rchit, sizeof ray_flag_probe_rchit},
};

} // namespace

RayFlagPipelineProbe::~RayFlagPipelineProbe()
{
    if (pipeline_)
        context_.next->DestroyPipeline(context_.device, pipeline_, nullptr);
    if (layout_)
        context_.next->DestroyPipelineLayout(context_.device, layout_, nullptr);
}

bool RayFlagPipelineProbe::createPipeline()
{
    const DeviceTable &next = *context_.next;
    const VkPushConstantRange range{VK_SHADER_STAGE_RAYGEN_BIT_KHR, 0, sizeof(shared::RayFlagProbePush)};
    VkPipelineLayoutCreateInfo layout{VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO};
    layout.pushConstantRangeCount = 1;
    layout.pPushConstantRanges = &range;
    if (next.CreatePipelineLayout(context_.device, &layout, nullptr, &layout_) != VK_SUCCESS)
        return false;

    std::array<VkPipelineShaderStageCreateInfo, std::size(kStages)> stages{};
    bool complete = true;
    for (size_t i = 0; i < stages.size(); ++i) {
        const VkShaderModuleCreateInfo info{VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO, nullptr, 0, kStages[i].bytes,
                                            kStages[i].words};
        stages[i] = {VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO};
        stages[i].stage = kStages[i].stage;
        stages[i].pName = "main";
        complete =
            next.CreateShaderModule(context_.device, &info, nullptr, &stages[i].module) == VK_SUCCESS && complete;
    }
    std::array<VkRayTracingShaderGroupCreateInfoKHR, kGroups> groups{};
    for (VkRayTracingShaderGroupCreateInfoKHR &group : groups) {
        group.sType = VK_STRUCTURE_TYPE_RAY_TRACING_SHADER_GROUP_CREATE_INFO_KHR;
        group.generalShader = group.closestHitShader = group.anyHitShader = group.intersectionShader =
            VK_SHADER_UNUSED_KHR;
    }
    groups[0].type = VK_RAY_TRACING_SHADER_GROUP_TYPE_GENERAL_KHR;
    groups[0].generalShader = 0;
    groups[1].type = VK_RAY_TRACING_SHADER_GROUP_TYPE_TRIANGLES_HIT_GROUP_KHR;
    groups[1].anyHitShader = 1;
    groups[1].closestHitShader = 2;
    VkRayTracingPipelineCreateInfoKHR info{VK_STRUCTURE_TYPE_RAY_TRACING_PIPELINE_CREATE_INFO_KHR};
    info.stageCount = static_cast<uint32_t>(stages.size());
    info.pStages = stages.data();
    info.groupCount = kGroups;
    info.pGroups = groups.data();
    info.maxPipelineRayRecursionDepth = 1;
    info.layout = layout_;
    const bool created = complete && next.CreateRayTracingPipelinesKHR(context_.device, VK_NULL_HANDLE, VK_NULL_HANDLE,
                                                                       1, &info, nullptr, &pipeline_) == VK_SUCCESS;
    for (const VkPipelineShaderStageCreateInfo &stage : stages) {
        if (stage.module)
            next.DestroyShaderModule(context_.device, stage.module, nullptr);
    }
    return created;
}

bool RayFlagPipelineProbe::createTable()
{
    std::array<std::byte, kGroups * kGroupHandleBytes> handles{};
    if (table_.create(context_, kGroups * kRecordBytes + kBaseAlignment,
                      VK_BUFFER_USAGE_SHADER_BINDING_TABLE_BIT_KHR) != VK_SUCCESS ||
        context_.next->GetRayTracingShaderGroupHandlesKHR(context_.device, pipeline_, 0, kGroups, handles.size(),
                                                          handles.data()) != VK_SUCCESS)
        return false;
    auto *bytes = reinterpret_cast<std::byte *>(table_.words()) + (-table_.address() & (kBaseAlignment - 1));
    for (uint32_t group = 0; group < kGroups; ++group)
        std::memcpy(bytes + group * kRecordBytes, handles.data() + group * kGroupHandleBytes, kGroupHandleBytes);
    return true;
}

bool RayFlagPipelineProbe::record(VkCommandBuffer commands, const shared::RayFlagProbePush &push)
{
    if (!createPipeline() || !createTable())
        return false;
    const DeviceTable &next = *context_.next;
    const VkDeviceAddress table = (table_.address() + kBaseAlignment - 1) & ~VkDeviceAddress{kBaseAlignment - 1};
    const VkStridedDeviceAddressRegionKHR raygen{table, kRecordBytes, kRecordBytes};
    const VkStridedDeviceAddressRegionKHR hit{table + kRecordBytes, kRecordBytes, kRecordBytes};
    const VkStridedDeviceAddressRegionKHR none{};
    next.CmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR, pipeline_);
    next.CmdPushConstants(commands, layout_, VK_SHADER_STAGE_RAYGEN_BIT_KHR, 0, sizeof push, &push);
    next.CmdTraceRaysKHR(commands, &raygen, &none, &hit, &none, 1, 1, 1);
    return true;
}

} // namespace vellum::layer
