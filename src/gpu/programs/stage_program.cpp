// SPDX-License-Identifier: Apache-2.0
#include "gpu/programs/stage_program.h"

#include "gpu/micromap_commands.h"
#include "gpu/pipeline_builder.h"
#include "gpu/programs/graphics.h"
#include "gpu/programs/helper_scene.h"

#include "shaders/launcher.h"
#include "shaders/plain_fragment.h"
#include "shaders/plain_mesh.h"
#include "shaders/plain_miss.h"
#include "shaders/plain_vertex.h"

namespace vellum::gpu
{
namespace
{

constexpr uint32_t kComputeGroup = 64; // threads

class Dispatches : public StageProgram
{
public:
    explicit Dispatches(Device &gpu) : gpu_(gpu) {}
    [[nodiscard]] VkPipelineBindPoint point() const override { return VK_PIPELINE_BIND_POINT_COMPUTE; }
    void prepare(const LaunchPlan &launch, uint32_t count) override
    {
        groups_ = (count + kComputeGroup - 1) / kComputeGroup;
        command_ = IndirectCommand(gpu_, launch, VkDispatchIndirectCommand{groups_, 1, 1});
    }
    void launch(VkCommandBuffer commands) const override
    {
        switch (command_.kind()) {
        case Launch::Direct: return vkCmdDispatch(commands, groups_, 1, 1);
        case Launch::Indirect: return vkCmdDispatchIndirect(commands, command_.buffer(), command_.offset());
        case Launch::Indirect2: {
            const auto info =
                vkInit<VkDispatchIndirect2InfoKHR>({.addressRange = command_.range(), .addressFlags = kUnknownUsage});
            gpu_.vk().CmdDispatchIndirect2KHR(commands, &info);
        }
        }
    }

protected:
    Device &gpu_;

private:
    uint32_t groups_ = 0;
    IndirectCommand command_;
};

class ComputeProgram : public Dispatches
{
public:
    ComputeProgram(Device &gpu, VkPipelineLayout layout, const StageShader &shader) : Dispatches(gpu)
    {
        const std::vector<uint32_t> code = gpu.code(shader.words);
        const auto inlined =
            vkInit<VkShaderModuleCreateInfo>({.codeSize = code.size() * sizeof(uint32_t), .pCode = code.data()});
        const VkShaderModule module = shader.inlineModule ? VK_NULL_HANDLE : gpu.shader(shader.words);
        const auto info = vkInit<VkComputePipelineCreateInfo>(
            {.stage = vkInit<VkPipelineShaderStageCreateInfo>({.pNext = shader.inlineModule ? &inlined : nullptr,
                                                               .stage = VK_SHADER_STAGE_COMPUTE_BIT,
                                                               .module = module,
                                                               .pName = "main",
                                                               .pSpecializationInfo = shader.specialization}),
             .layout = layout});
        CHECK_VK(vkCreateComputePipelines(gpu.device(), VK_NULL_HANDLE, 1, &info, nullptr, &pipeline_));
        vkDestroyShaderModule(gpu.device(), module, nullptr);
    }
    ~ComputeProgram() override { vkDestroyPipeline(gpu_.device(), pipeline_, nullptr); }

    void bind(VkCommandBuffer commands) const override { vkCmdBindPipeline(commands, point(), pipeline_); }

private:
    VkPipeline pipeline_ = VK_NULL_HANDLE;
};

// VK_EXT_shader_object, which the oldest supported headers lack.
struct ShaderCreateInfo {
    uint32_t sType = 1000482002; // VK_STRUCTURE_TYPE_SHADER_CREATE_INFO_EXT
    const void *pNext = nullptr;
    VkFlags flags = 0;
    VkShaderStageFlagBits stage{};
    VkShaderStageFlags nextStage = 0;
    uint32_t codeType = 1; // VK_SHADER_CODE_TYPE_SPIRV_EXT
    size_t codeSize = 0;
    const void *pCode = nullptr;
    const char *pName = "main";
    uint32_t setLayoutCount = 0;
    const VkDescriptorSetLayout *pSetLayouts = nullptr;
    uint32_t pushConstantRangeCount = 0;
    const VkPushConstantRange *pPushConstantRanges = nullptr;
    const VkSpecializationInfo *pSpecializationInfo = nullptr;
};
using ShaderObject = uint64_t; // VkShaderEXT
using CreateShaders = VkResult(VKAPI_PTR *)(VkDevice, uint32_t, const ShaderCreateInfo *, const VkAllocationCallbacks *,
                                            ShaderObject *);
using DestroyShader = void(VKAPI_PTR *)(VkDevice, ShaderObject, const VkAllocationCallbacks *);
using BindShaders = void(VKAPI_PTR *)(VkCommandBuffer, uint32_t, const VkShaderStageFlagBits *, const ShaderObject *);

class ShaderObjectProgram : public Dispatches
{
public:
    ShaderObjectProgram(Device &gpu, const StageShader &shader) : Dispatches(gpu)
    {
        const std::vector<uint32_t> code = gpu.code(shader.words);
        const VkPushConstantRange range{shader.stage, 0, shader.pushSize};
        const ShaderCreateInfo info{.stage = shader.stage,
                                    .codeSize = code.size() * sizeof(uint32_t),
                                    .pCode = code.data(),
                                    .setLayoutCount = 1,
                                    .pSetLayouts = &shader.objectLayout,
                                    .pushConstantRangeCount = 1,
                                    .pPushConstantRanges = &range,
                                    .pSpecializationInfo = shader.specialization};
        CHECK_VK(load<CreateShaders>("vkCreateShadersEXT")(gpu.device(), 1, &info, nullptr, &object_));
    }
    ~ShaderObjectProgram() override { load<DestroyShader>("vkDestroyShaderEXT")(gpu_.device(), object_, nullptr); }

    void bind(VkCommandBuffer commands) const override
    {
        constexpr VkShaderStageFlagBits kStage = VK_SHADER_STAGE_COMPUTE_BIT;
        load<BindShaders>("vkCmdBindShadersEXT")(commands, 1, &kStage, &object_);
    }

private:
    template <class Command>
    [[nodiscard]] Command load(const char *name) const
    {
        return reinterpret_cast<Command>(vkGetDeviceProcAddr(gpu_.device(), name));
    }

    ShaderObject object_ = 0;
};

Graphics::Shaders graphicsShaders(const StageShader &shader)
{
    Graphics::Shaders shaders{.vertex = plain_vertex,
                              .fragment = plain_fragment,
                              .inlineModules = shader.inlineModule,
                              .topology = VK_PRIMITIVE_TOPOLOGY_POINT_LIST,
                              .specialization = shader.specialization,
                              .vertexBuffers = shader.vertexBuffers,
                              .dynamicStrides = shader.dynamicStrides};
    switch (shader.stage) {
    case VK_SHADER_STAGE_VERTEX_BIT: shaders.vertex = shader.words; break;
    case VK_SHADER_STAGE_GEOMETRY_BIT: shaders.geometry = shader.words; break;
    case VK_SHADER_STAGE_FRAGMENT_BIT:
        shaders.fragment = shader.words;
        shaders.topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST;
        break;
    default: // VK_SHADER_STAGE_TASK_BIT_EXT, VK_SHADER_STAGE_MESH_BIT_EXT
        shaders.vertex = {};
        shaders.mesh = shader.stage == VK_SHADER_STAGE_MESH_BIT_EXT ? shader.words : plain_mesh;
        if (shader.stage == VK_SHADER_STAGE_TASK_BIT_EXT)
            shaders.task = shader.words;
    }
    return shaders;
}

class GraphicsProgram : public StageProgram
{
public:
    GraphicsProgram(Device &gpu, VkPipelineLayout layout, const StageShader &shader)
        : pixels_(shader.stage == VK_SHADER_STAGE_FRAGMENT_BIT),
          graphics_(gpu, layout, graphicsShaders(shader), pixels_ ? kMostRays : 1)
    {
    }
    [[nodiscard]] VkPipelineBindPoint point() const override { return VK_PIPELINE_BIND_POINT_GRAPHICS; }
    void bind(VkCommandBuffer commands) const override { graphics_.bind(commands); }
    void prepare(const LaunchPlan &launch, uint32_t count) override
    {
        graphics_.prepare(launch, pixels_ ? 3 : count); // one triangle over all pixels
    }
    void launch(VkCommandBuffer commands) const override { graphics_.draw(commands); }

private:
    bool pixels_;
    Graphics graphics_;
};

// A ray tracing pipeline: the shader itself as ray generation shader, or launcher.rgen and the shader.
class RayProgram : public StageProgram
{
public:
    RayProgram(Device &gpu, VkPipelineLayout layout, const StageShader &shader)
        : helper_(shader.stage == VK_SHADER_STAGE_RAYGEN_BIT_KHR ? nullptr : new HelperScene(gpu)),
          pipeline_(gpu, setupOf(layout, shader)), table_(gpu, pipeline_, recordsOf(shader.stage))
    {
    }
    [[nodiscard]] VkPipelineBindPoint point() const override { return VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR; }
    void bind(VkCommandBuffer commands) const override { vkCmdBindPipeline(commands, point(), pipeline_.handle()); }
    void prepare(const LaunchPlan &launch, uint32_t count) override { table_.prepare(launch, count); }
    void launch(VkCommandBuffer commands) const override { table_.trace(commands); }
    [[nodiscard]] VkDeviceAddress helperScene() const override { return helper_ ? helper_->address() : 0; }

private:
    static PipelineSetup setupOf(VkPipelineLayout layout, const StageShader &shader)
    {
        static constexpr VkSpecializationMapEntry kEntry{0, 0, sizeof(uint32_t)};
        static constexpr std::array<uint32_t, 4> kTargets{0, 1, 2, 3}; // of launcher.rgen
        const auto target = [](uint32_t i) { return VkSpecializationInfo{1, &kEntry, sizeof(uint32_t), &kTargets[i]}; };
        static const std::array<VkSpecializationInfo, 4> kInfos{target(0), target(1), target(2), target(3)};
        PipelineSetup setup;
        setup.layout = layout;
        setup.stages = {{shader.stage, shader.words, "main", shader.specialization, shader.inlineModule}};
        if (shader.stage == VK_SHADER_STAGE_RAYGEN_BIT_KHR) {
            setup.groups = {{.general = 0}};
            return setup;
        }
        uint32_t kind = 2;
        PipelineGroup group{};
        switch (shader.stage) {
        case VK_SHADER_STAGE_MISS_BIT_KHR: kind = 0, group.general = 0; break;
        case VK_SHADER_STAGE_CALLABLE_BIT_KHR: kind = 1, group.general = 0; break;
        case VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR: group.closestHit = 0; break;
        case VK_SHADER_STAGE_ANY_HIT_BIT_KHR: group.anyHit = 0; break;
        default: kind = 3, group.intersection = 0;
        }
        setup.stages.push_back({VK_SHADER_STAGE_RAYGEN_BIT_KHR, launcher, "main", &kInfos[kind]});
        setup.stages.push_back({VK_SHADER_STAGE_MISS_BIT_KHR, plain_miss});
        setup.groups = {{.general = 1}, {.general = 2}, group};
        return setup;
    }

    static BindingRecords recordsOf(VkShaderStageFlagBits stage)
    {
        BindingRecords records;
        if (stage == VK_SHADER_STAGE_RAYGEN_BIT_KHR)
            return records;
        const BindingRecord own{2, {}};
        records.miss = {stage == VK_SHADER_STAGE_MISS_BIT_KHR ? own : BindingRecord{1, {}}};
        if (stage == VK_SHADER_STAGE_CALLABLE_BIT_KHR)
            records.callable = {own};
        else if (stage != VK_SHADER_STAGE_MISS_BIT_KHR)
            records.hit = {own};
        return records;
    }

    std::unique_ptr<HelperScene> helper_;
    RayPipeline pipeline_;
    BindingTable table_;
};

} // namespace

VkShaderStageFlags pushStages(VkShaderStageFlagBits stage)
{
    return (VkShaderStageFlags{stage} & PipelineResources::kStages) != 0 ? PipelineResources::kStages
                                                                         : VkShaderStageFlags{stage};
}

std::unique_ptr<StageProgram> makeStageProgram(Device &gpu, VkPipelineLayout layout, const StageShader &shader)
{
    if (shader.objectLayout != VK_NULL_HANDLE)
        return std::make_unique<ShaderObjectProgram>(gpu, shader);
    if (shader.stage == VK_SHADER_STAGE_COMPUTE_BIT)
        return std::make_unique<ComputeProgram>(gpu, layout, shader);
    if (pushStages(shader.stage) == PipelineResources::kStages)
        return std::make_unique<RayProgram>(gpu, layout, shader);
    return std::make_unique<GraphicsProgram>(gpu, layout, shader);
}

} // namespace vellum::gpu
