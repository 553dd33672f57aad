// SPDX-License-Identifier: Apache-2.0
// Wrong pipelines, shader objects and shader modules.
#include <algorithm>

#include "gpu/execution_mode.h"
#include "gpu/pipeline_builder.h"
#include "gpu/programs/graphics.h"
#include "gpu/tracer.h"
#include "range_commands.h"

#include "shaders/empty_raygen.h"
#include "shaders/plain_fragment.h"
#include "shaders/plain_vertex.h"
#include "shaders/tracer_comp.h"
#include "shaders/tracer_two_states.h"

namespace vt
{
namespace
{

constexpr VkFlags64 kNotMixed = VK_PIPELINE_CREATE_2_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_KHR;

VkPipelineCreateFlags2CreateInfoKHR flagsOf(VkFlags64 flags)
{
    return vkInit<VkPipelineCreateFlags2CreateInfoKHR>({.flags = flags});
}

// A layout without descriptors.
class EmptyLayout
{
public:
    explicit EmptyLayout(Gpu &gpu) : gpu_(gpu)
    {
        const auto info = vkInit<VkPipelineLayoutCreateInfo>();
        VT_CHECK(vkCreatePipelineLayout(gpu.device(), &info, nullptr, &layout_));
    }
    EmptyLayout(const EmptyLayout &) = delete;
    EmptyLayout &operator=(const EmptyLayout &) = delete;
    ~EmptyLayout() { vkDestroyPipelineLayout(gpu_.device(), layout_, nullptr); }
    [[nodiscard]] VkPipelineLayout get() const { return layout_; }

private:
    Gpu &gpu_;
    VkPipelineLayout layout_ = VK_NULL_HANDLE;
};

VkShaderModule moduleOf(const Gpu &gpu, std::span<const uint32_t> words)
{
    const auto info = vkInit<VkShaderModuleCreateInfo>({.codeSize = words.size_bytes(), .pCode = words.data()});
    VkShaderModule module = VK_NULL_HANDLE;
    VT_CHECK(vkCreateShaderModule(gpu.device(), &info, nullptr, &module));
    return module;
}

// A compute pipeline with ray queries.
VkPipeline computePipeline(Gpu &gpu, VkPipelineLayout layout, Mode mode, VkFlags64 flags)
{
    const VkShaderModule module =
        moduleOf(gpu, mode == Mode::Absent ? std::vector(std::begin(tracer_comp), std::end(tracer_comp))
                                           : withMode(tracer_comp, mode));
    const auto flags2 = flagsOf(flags);
    auto info = vkInit<VkComputePipelineCreateInfo>({.layout = layout});
    if (flags > UINT32_MAX)
        info.pNext = &flags2;
    info.flags = static_cast<VkPipelineCreateFlags>(flags);
    info.stage = vkInit<VkPipelineShaderStageCreateInfo>(
        {.stage = VK_SHADER_STAGE_COMPUTE_BIT, .module = module, .pName = "main"});
    VkPipeline pipeline = VK_NULL_HANDLE;
    VT_CHECK(vkCreateComputePipelines(gpu.device(), VK_NULL_HANDLE, 1, &info, nullptr, &pipeline));
    vkDestroyShaderModule(gpu.device(), module, nullptr);
    return pipeline;
}

void makeCompute(Gpu &gpu, Mode mode, VkFlags64 flags)
{
    const Tracer tracer(gpu);
    vkDestroyPipeline(gpu.device(), computePipeline(gpu, tracer.layout(), mode, flags), nullptr);
}

// A dispatch of no workgroups, whose number is in a sparse buffer with memory or without.
void dispatchFromUnboundMemory(Gpu &gpu, bool wrong)
{
    const Tracer tracer(gpu);
    const VkPipeline pipeline = computePipeline(gpu, tracer.layout(), Mode::False, 0);
    RangeBuffer buffer(gpu, VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT,
                       VK_BUFFER_CREATE_SPARSE_BINDING_BIT);
    if (!wrong)
        buffer.bind();
    const auto info =
        vkInit<VkDispatchIndirect2InfoKHR>({.addressRange = {buffer.address(), sizeof(VkDispatchIndirectCommand)},
                                            .addressFlags = kUnknownUsage | VK_ADDRESS_COMMAND_FULLY_BOUND_BIT_KHR});
    gpu.submit([&](VkCommandBuffer commands) {
        vkCmdFillBuffer(commands, buffer.handle(), 0, 64, 0);
        barrier(commands);
        vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
        gpu.vk().CmdDispatchIndirect2KHR(commands, &info);
    });
    vkDestroyPipeline(gpu.device(), pipeline, nullptr);
}

void computeWithMicromapBit(Gpu &gpu, bool wrong)
{
    makeCompute(gpu, Mode::True, wrong ? kMicromapBit : 0);
}

void computeWithPromise(Gpu &gpu, bool wrong)
{
    makeCompute(gpu, Mode::Absent, wrong ? kNotMixed : 0);
}

// The mode, true or false, in a pipeline that promises to meet no micromaps.
void modeAgainstThePromise(Gpu &gpu, bool wrong)
{
    makeCompute(gpu, wrong ? Mode::True : Mode::False, VK_PIPELINE_CREATE_2_DISALLOW_OPACITY_MICROMAP_BIT_ARM);
}

void makeGraphics(Gpu &gpu, VkFlags64 flags)
{
    const EmptyLayout layout(gpu);
    const auto flags2 = flagsOf(flags);
    const Graphics graphics(gpu, layout.get(), {.vertex = plain_vertex, .fragment = plain_fragment, .pNext = &flags2},
                            4);
}

void graphicsWithMicromapBit(Gpu &gpu, bool wrong)
{
    makeGraphics(gpu, wrong ? kMicromapBit : 0);
}

void graphicsWithPromise(Gpu &gpu, bool wrong)
{
    makeGraphics(gpu, wrong ? kNotMixed : 0);
}

RayPipeline makeRayTracing(Gpu &gpu, const EmptyLayout &layout, VkFlags64 flags, VkPipeline library = VK_NULL_HANDLE)
{
    PipelineSetup setup;
    setup.stages = {{VK_SHADER_STAGE_RAYGEN_BIT_KHR, empty_raygen}};
    setup.groups = {{.general = 0}};
    setup.layout = layout.get();
    if (library)
        setup.libraries = {library};
    PipelineInfo info(gpu, setup);
    auto flags2 = flagsOf(flags);
    if (flags > UINT32_MAX) {
        flags2.pNext = info.get().pNext;
        info.get().pNext = &flags2;
    }
    info.get().flags = static_cast<VkPipelineCreateFlags>(flags);
    VkPipeline pipeline = VK_NULL_HANDLE;
    VT_CHECK(gpu.vk().CreateRayTracingPipelinesKHR(gpu.device(), VK_NULL_HANDLE, VK_NULL_HANDLE, 1, &info.get(),
                                                   nullptr, &pipeline));
    return {gpu, pipeline};
}

template <VkFlags64 right, VkFlags64 wrongFlags>
void rayTracing(Gpu &gpu, bool wrong)
{
    const EmptyLayout layout(gpu);
    makeRayTracing(gpu, layout, wrong ? wrongFlags : right);
}

void libraryWithoutMicromapBit(Gpu &gpu, bool wrong)
{
    const EmptyLayout layout(gpu);
    constexpr VkFlags64 kLibrary = VK_PIPELINE_CREATE_LIBRARY_BIT_KHR;
    const RayPipeline library = makeRayTracing(gpu, layout, wrong ? kLibrary : kLibrary | kMicromapBit);
    makeRayTracing(gpu, layout, kMicromapBit, library.handle());
}

void shaderWithPromise(Gpu &gpu, bool wrong)
{
    const auto create =
        reinterpret_cast<PFN_vkCreateShadersEXT>(vkGetDeviceProcAddr(gpu.device(), "vkCreateShadersEXT"));
    const auto destroy =
        reinterpret_cast<PFN_vkDestroyShaderEXT>(vkGetDeviceProcAddr(gpu.device(), "vkDestroyShaderEXT"));
    VkShaderCreateInfoEXT info{};
    info.sType = VK_STRUCTURE_TYPE_SHADER_CREATE_INFO_EXT;
    info.flags =
        wrong ? static_cast<VkFlags>(VK_SHADER_CREATE_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_EXT) : 0;
    info.stage = VK_SHADER_STAGE_VERTEX_BIT;
    info.codeType = VK_SHADER_CODE_TYPE_SPIRV_EXT;
    info.codeSize = sizeof plain_vertex;
    info.pCode = plain_vertex;
    info.pName = "main";
    VkShaderEXT shader = VK_NULL_HANDLE;
    VT_CHECK(create(gpu.device(), 1, &info, nullptr, &shader));
    destroy(gpu.device(), shader, nullptr);
}

void flagWithoutCapability(Gpu &gpu, bool wrong)
{
    const std::vector<uint32_t> right = withMode(withMicromapFlag(tracer_two_states), Mode::True);
    std::vector<uint32_t> without = withMode(tracer_two_states, Mode::True);
    // glslang 16 declares it where the source enables GL_EXT_opacity_micromap.
    constexpr uint32_t kCapability[] = {2u << 16 | 17, 5381}; // OpCapability RayTracingOpacityMicromapKHR
    if (const auto declared = std::ranges::search(without, kCapability); !declared.empty())
        declared[1] = 1; // Shader, once more
    vkDestroyShaderModule(gpu.device(), moduleOf(gpu, wrong ? without : right), nullptr);
}

constexpr WrongProgram kPrograms[] = {
    {"VUID-VkComputePipelineCreateInfo-flags-07367", Api::Khr, kNeedsNothing, computeWithMicromapBit},
    {"VUID-VkComputePipelineCreateInfo-flags-11593", Api::Ext, kNeedsMaintenance5, computeWithPromise, "", "", false,
     "ext"},
    {"VUID-VkGraphicsPipelineCreateInfo-flags-07401", Api::Khr, kNeedsMaintenance5, graphicsWithMicromapBit},
    {"VUID-VkGraphicsPipelineCreateInfo-flags-11595", Api::Ext, kNeedsMaintenance5, graphicsWithPromise, "", "", false,
     "ext"},
    {"VUID-VkRayTracingPipelineCreateInfoKHR-flags-10392", Api::Khr, kNeedsPipelines | kNeedsMaintenance5,
     rayTracing<VK_PIPELINE_CREATE_2_DISALLOW_OPACITY_MICROMAP_BIT_ARM,
                VK_PIPELINE_CREATE_2_DISALLOW_OPACITY_MICROMAP_BIT_ARM | kMicromapBit>},
    {"VUID-VkRayTracingPipelineCreateInfoKHR-flags-11597", Api::Khr, kNeedsPipelines | kNeedsNoFeature,
     rayTracing<0, kMicromapBit>},
    {"VUID-VkRayTracingPipelineCreateInfoKHR-flags-11599", Api::Khr, kNeedsPipelines | kNeedsMaintenance5,
     rayTracing<kNotMixed | kMicromapBit, kNotMixed>},
    {"VUID-VkRayTracingPipelineCreateInfoKHR-flags-11599", Api::Ext, kNeedsPipelines | kNeedsMaintenance5,
     rayTracing<kMicromapBit, kNotMixed | kMicromapBit>, "Feature", "", false, "ext"},
    {"VUID-VkRayTracingPipelineCreateInfoKHR-pLibraries-11598", Api::Khr, kNeedsPipelines, libraryWithoutMicromapBit},
    {"VUID-VkDispatchIndirect2InfoKHR-addressRange-13097", Api::Khr, kNeedsAddressCommands, dispatchFromUnboundMemory},
    {"VUID-VkShaderCreateInfoEXT-micromap-11623", Api::Ext, kNeedsShaderObjects, shaderWithPromise, "", "", false,
     "ext"},
    {"VUID-RuntimeSpirv-micromap-11630", Api::Khr, kNeedsMaintenance5, modeAgainstThePromise},
    {"VUID-RuntimeSpirv-RayTracingOpacityMicromapKHR-11542", Api::Khr, kNeedsNothing, flagWithoutCapability},
};

} // namespace

std::span<const WrongProgram> pipelinePrograms()
{
    return kPrograms;
}

} // namespace vt
