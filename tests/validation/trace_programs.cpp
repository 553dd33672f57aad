// SPDX-License-Identifier: Apache-2.0
// Invalid traces: shaders and pipelines that do not declare that their rays may hit micromaps, or that promise that
// they hit none of some kind.
#include "command_buffer/shader_objects.h"
#include "gpu/execution_mode.h"
#include "gpu/pipeline_tracer.h"
#include "gpu/tracer.h"
#include "programs.h"
#include "vk/newer.h"

#include "shaders/tracer_comp.h"
#include "shaders/tracer_frag.h"
#include "shaders/tracer_mask_1.h"
#include "shaders/tracer_rgen.h"

namespace vt
{
namespace
{

// Four triangles with micromaps, or without. Indices: of the micromap, special ones, or both.
struct Scene {
    enum class With { Nothing, Micromap, SpecialIndices, MixedIndices };

    Scene(Gpu &gpu, With with) : blas(gpu), tlas(gpu)
    {
        MicromapInput input;
        for (uint8_t state = 0; state < 4; ++state)
            input.add(2, kFourState, std::vector<uint8_t>(16, state));
        micromap = std::make_unique<Micromap>(gpu, std::move(input));
        micromap->build();
        Geometry geometry{.vertices = triangleRow(4)};
        if (with != With::Nothing)
            geometry.micromap = Attachment{micromap.get()};
        if (with == With::SpecialIndices || with == With::MixedIndices) {
            geometry.micromap->indexType = VK_INDEX_TYPE_UINT16;
            geometry.micromap->indices = {-1, with == With::MixedIndices ? 1 : -2, -3, -4};
        }
        blas.build({geometry});
        tlas.build(std::vector{instance(blas, {}, 321)});
    }

    static std::vector<Ray> rays()
    {
        std::vector<Ray> rays(4);
        for (size_t i = 0; i < 4; ++i)
            rays[i].origin = {1.5f * static_cast<float>(i) + 0.3f, 0.3f, 1};
        return rays;
    }

    std::unique_ptr<Micromap> micromap;
    Blas blas;
    Tlas tlas;
};
using With = Scene::With;

// --- the execution mode of ray queries ---

void computeWithoutMode(Gpu &gpu, bool wrong)
{
    const Scene scene(gpu, With::Micromap);
    Tracer(gpu, withMode(tracer_comp, wrong ? Mode::Absent : Mode::True)).trace(scene.tlas, Scene::rays());
}

void modeIsFalse(Gpu &gpu, bool wrong)
{
    const Scene scene(gpu, With::Micromap);
    Tracer(gpu, withMode(tracer_comp, wrong ? Mode::False : Mode::True)).trace(scene.tlas, Scene::rays());
}

void modeIsSpecialized(Gpu &gpu, bool wrong)
{
    const Scene scene(gpu, With::Micromap);
    Tracer(gpu, withMode(tracer_comp, Mode::Specialized, Tracer::kModeConstant),
           {.specializedMode = wrong ? VK_FALSE : VK_TRUE})
        .trace(scene.tlas, Scene::rays());
}

void meetsMicromap(Gpu &gpu, bool wrong)
{
    const Scene scene(gpu, wrong ? With::Micromap : With::Nothing);
    Tracer(gpu, withMode(tracer_comp, Mode::Absent)).trace(scene.tlas, Scene::rays());
}

// The same pipeline and descriptors; the valid program runs no ray query.
void executesQuery(Gpu &gpu, bool wrong)
{
    const Scene scene(gpu, With::Micromap);
    Tracer(gpu, withMode(tracer_comp, Mode::Absent)).trace(scene.tlas, wrong ? Scene::rays() : std::vector<Ray>());
}

// The instance is hidden by its mask.
void instanceIsVisible(Gpu &gpu, bool wrong)
{
    Scene scene(gpu, With::Micromap);
    scene.tlas.build(std::vector{instance(scene.blas, {}, 321, 0, wrong ? 0xff : 0)});
    Tracer(gpu, withMode(tracer_comp, Mode::Absent)).trace(scene.tlas, Scene::rays());
}

// The rays' cull mask excludes the instance.
template <bool isConstant>
void instanceIsNotCulled(Gpu &gpu, bool wrong)
{
    Scene scene(gpu, With::Micromap);
    scene.tlas.build(std::vector{instance(scene.blas, {}, 321, 0, wrong ? (isConstant ? 0x3 : 0xff) : 0xfe)});
    std::vector<Ray> rays = Scene::rays();
    for (Ray &ray : rays)
        ray.cullMask = 1;
    const std::span<const uint32_t> shader = isConstant ? std::span<const uint32_t>(tracer_mask_1) : tracer_comp;
    Tracer(gpu, withMode(shader, Mode::Absent)).trace(scene.tlas, rays);
}

void inlineModule(Gpu &gpu, bool wrong)
{
    const Scene scene(gpu, With::Micromap);
    Tracer(gpu, withMode(tracer_comp, wrong ? Mode::Absent : Mode::True), {.inlineModule = true})
        .trace(scene.tlas, Scene::rays());
}

void fragmentWithoutMode(Gpu &gpu, bool wrong)
{
    const Scene scene(gpu, With::Micromap);
    Tracer(gpu, withMode(tracer_frag, wrong ? Mode::Absent : Mode::True), {.stage = VK_SHADER_STAGE_FRAGMENT_BIT})
        .trace(scene.tlas, Scene::rays());
}

void rayGenerationWithoutMode(Gpu &gpu, bool wrong)
{
    const Scene scene(gpu, With::Micromap);
    Tracer(gpu, withMode(tracer_rgen, wrong ? Mode::Absent : Mode::True), {.stage = VK_SHADER_STAGE_RAYGEN_BIT_KHR})
        .trace(scene.tlas, Scene::rays());
}

// Two dispatches of one pipeline, the second of them with another set.
void secondSet(Gpu &gpu, bool wrong)
{
    const Scene without(gpu, With::Nothing);
    const Scene scene(gpu, wrong ? With::Micromap : With::Nothing);
    Tracer tracer(gpu, withMode(tracer_comp, Mode::Absent));
    tracer.trace(without.tlas, Scene::rays());
    VT_CHECK(vkDeviceWaitIdle(gpu.device()));
    tracer.trace(scene.tlas, Scene::rays());
}

// --- where the structure comes from ---

// Traces once the structure has been set in the descriptor set in another way, or pushed.
template <typename Set>
void traceWithSet(Gpu &gpu, bool wrong, Set set)
{
    const Scene without(gpu, With::Nothing);
    const Scene scene(gpu, With::Micromap);
    Tracer tracer(gpu, withMode(tracer_comp, Mode::Absent));
    // The set has the other structure before.
    tracer.prepare(wrong ? without.tlas : scene.tlas, Scene::rays());
    set(tracer, wrong ? scene.tlas : without.tlas);
    traceAndWait(gpu, tracer);
    VT_CHECK(vkDeviceWaitIdle(gpu.device()));
}

void updatedByTemplate(Gpu &gpu, bool wrong)
{
    traceWithSet(gpu, wrong, [&gpu](const Tracer &tracer, const Tlas &tlas) {
        const VkDescriptorUpdateTemplateEntry entry{
            0, 0, 1, VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR, sizeof(uint64_t), 0};
        const auto info = vkInit<VkDescriptorUpdateTemplateCreateInfo>(
            {.descriptorUpdateEntryCount = 1,
             .pDescriptorUpdateEntries = &entry,
             .templateType = VK_DESCRIPTOR_UPDATE_TEMPLATE_TYPE_DESCRIPTOR_SET,
             .descriptorSetLayout = tracer.setLayout()});
        VkDescriptorUpdateTemplate update = VK_NULL_HANDLE;
        VT_CHECK(vkCreateDescriptorUpdateTemplate(gpu.device(), &info, nullptr, &update));
        const struct {
            uint64_t other;
            VkAccelerationStructureKHR structure;
        } data{0, tlas.handle()};
        vkUpdateDescriptorSetWithTemplate(gpu.device(), tracer.set(), update, &data);
        vkDestroyDescriptorUpdateTemplate(gpu.device(), update, nullptr);
    });
}

void copiedDescriptor(Gpu &gpu, bool wrong)
{
    traceWithSet(gpu, wrong, [&gpu](const Tracer &tracer, const Tlas &tlas) {
        Tracer other(gpu);
        other.prepare(tlas, Scene::rays());
        const auto copy =
            vkInit<VkCopyDescriptorSet>({.srcSet = other.set(), .dstSet = tracer.set(), .descriptorCount = 1});
        vkUpdateDescriptorSets(gpu.device(), 0, nullptr, 1, &copy);
    });
}

// A bottom-level structure in a descriptor.
void bottomLevelDescriptor(Gpu &gpu, bool wrong)
{
    const Scene scene(gpu, With::Nothing);
    Tracer tracer(gpu);
    tracer.prepare(scene.tlas, Scene::rays());
    const VkAccelerationStructureKHR structure = wrong ? scene.blas.handle() : scene.tlas.handle();
    const auto structures = vkInit<VkWriteDescriptorSetAccelerationStructureKHR>(
        {.accelerationStructureCount = 1, .pAccelerationStructures = &structure});
    const auto write = vkInit<VkWriteDescriptorSet>({.pNext = &structures,
                                                     .dstSet = tracer.set(),
                                                     .descriptorCount = 1,
                                                     .descriptorType = VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR});
    vkUpdateDescriptorSets(gpu.device(), 1, &write, 0, nullptr);
}

// --- commands of other vendors, which the spy plays by a dispatch ---

template <typename Record>
void traceBy(Gpu &gpu, bool wrong, const char *command, Record record)
{
    const Scene scene(gpu, With::Micromap);
    const PFN_vkVoidFunction function = vkGetDeviceProcAddr(gpu.device(), command);
    Tracer tracer(gpu, withMode(tracer_comp, wrong ? Mode::Absent : Mode::True));
    tracer.prepare(scene.tlas, Scene::rays());
    gpu.submit([&](VkCommandBuffer commands) {
        barrier(commands);
        tracer.bind(commands);
        record(commands, function);
        barrier(commands);
    });
    VT_CHECK(vkDeviceWaitIdle(gpu.device()));
}

void dispatchTile(Gpu &gpu, bool wrong)
{
    traceBy(gpu, wrong, "vkCmdDispatchTileQCOM", [](VkCommandBuffer commands, PFN_vkVoidFunction function) {
        const VkDispatchTileInfoQCOM info{VK_STRUCTURE_TYPE_DISPATCH_TILE_INFO_QCOM, nullptr};
        reinterpret_cast<PFN_vkCmdDispatchTileQCOM>(function)(commands, &info);
    });
}

void generatedNv(Gpu &gpu, bool wrong)
{
    traceBy(gpu, wrong, "vkCmdExecuteGeneratedCommandsNV", [](VkCommandBuffer commands, PFN_vkVoidFunction function) {
        const auto info = vkInit<VkGeneratedCommandsInfoNV>({.pipelineBindPoint = VK_PIPELINE_BIND_POINT_COMPUTE});
        reinterpret_cast<PFN_vkCmdExecuteGeneratedCommandsNV>(function)(commands, VK_FALSE, &info);
    });
}

void generatedExt(Gpu &gpu, bool wrong)
{
    traceBy(gpu, wrong, "vkCmdExecuteGeneratedCommandsEXT", [](VkCommandBuffer commands, PFN_vkVoidFunction function) {
        const VkGeneratedCommandsInfoEXT info{VK_STRUCTURE_TYPE_GENERATED_COMMANDS_INFO_EXT, nullptr,
                                              VK_SHADER_STAGE_COMPUTE_BIT};
        reinterpret_cast<PFN_vkCmdExecuteGeneratedCommandsEXT>(function)(commands, VK_FALSE, &info);
    });
}

// A structure that is built again, without micromaps, before it is traced.
void builtAgain(Gpu &gpu, bool wrong)
{
    Scene scene(gpu, With::Micromap);
    if (!wrong)
        scene.blas.build({{.vertices = triangleRow(4)}});
    Tracer(gpu, withMode(tracer_comp, Mode::Absent)).trace(scene.tlas, Scene::rays());
}

// --- the bit of ray tracing pipelines ---

void pipelineWithoutBit(Gpu &gpu, bool wrong)
{
    const Scene scene(gpu, With::Micromap);
    PipelineTracer(gpu, {.flags = wrong ? 0 : kMicromapBit}).trace(scene.tlas, Scene::rays());
}

void raysMeetMicromap(Gpu &gpu, bool wrong)
{
    const Scene scene(gpu, wrong ? With::Micromap : With::Nothing);
    PipelineTracer(gpu, {.flags = 0}).trace(scene.tlas, Scene::rays());
}

// --- promises ---

constexpr VkFlags64 kDisallowMixed = VkFlags64{1} << 41;

// Traces by a compute pipeline with these flags.
void traceWithFlags(Gpu &gpu, const Scene &scene, VkFlags64 flags, Mode mode = Mode::True)
{
    Tracer tracer(gpu);
    tracer.prepare(scene.tlas, Scene::rays());
    const VkShaderModule module = gpu.shader(withMode(tracer_comp, mode));
    const auto flags2 = vkInit<VkPipelineCreateFlags2CreateInfoKHR>({.flags = flags});
    const auto info = vkInit<VkComputePipelineCreateInfo>(
        {.pNext = &flags2,
         .stage = vkInit<VkPipelineShaderStageCreateInfo>(
             {.stage = VK_SHADER_STAGE_COMPUTE_BIT, .module = module, .pName = "main"}),
         .layout = tracer.layout()});
    VkPipeline pipeline = VK_NULL_HANDLE;
    VT_CHECK(vkCreateComputePipelines(gpu.device(), VK_NULL_HANDLE, 1, &info, nullptr, &pipeline));
    gpu.submit([&](VkCommandBuffer commands) {
        barrier(commands);
        tracer.bind(commands);
        vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
        tracer.dispatch(commands);
        barrier(commands);
    });
    VT_CHECK(vkDeviceWaitIdle(gpu.device()));
    vkDestroyPipeline(gpu.device(), pipeline, nullptr);
    vkDestroyShaderModule(gpu.device(), module, nullptr);
}

void promiseOfUnmixedIndices(Gpu &gpu, bool wrong)
{
    const Scene scene(gpu, With::MixedIndices);
    traceWithFlags(gpu, scene, wrong ? kDisallowMixed : 0);
}

void mixedIndices(Gpu &gpu, bool wrong)
{
    const Scene scene(gpu, wrong ? With::MixedIndices : With::SpecialIndices);
    traceWithFlags(gpu, scene, kDisallowMixed);
}

void indicesOfMicromap(Gpu &gpu, bool wrong)
{
    const Scene scene(gpu, wrong ? With::MixedIndices : With::Micromap);
    traceWithFlags(gpu, scene, kDisallowMixed);
}

void shaderObjectPromise(Gpu &gpu, bool wrong)
{
    const Scene scene(gpu, wrong ? With::MixedIndices : With::SpecialIndices);
    const auto create = reinterpret_cast<CreateShaders>(vkGetDeviceProcAddr(gpu.device(), "vkCreateShadersEXT"));
    const auto destroy = reinterpret_cast<DestroyShader>(vkGetDeviceProcAddr(gpu.device(), "vkDestroyShaderEXT"));
    const auto bind = reinterpret_cast<BindShaders>(vkGetDeviceProcAddr(gpu.device(), "vkCmdBindShadersEXT"));
    Tracer tracer(gpu);
    tracer.prepare(scene.tlas, Scene::rays());
    TracerShader description(gpu, tracer);
    description.info.flags |= 0x1000; // OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX
    ShaderHandle shader = 0;
    VT_CHECK(create(gpu.device(), 1, &description.info, nullptr, &shader));
    gpu.submit([&](VkCommandBuffer commands) {
        barrier(commands);
        tracer.bind(commands);
        const VkShaderStageFlagBits stage = VK_SHADER_STAGE_COMPUTE_BIT;
        bind(commands, 1, &stage, &shader);
        tracer.dispatch(commands);
        barrier(commands);
    });
    VT_CHECK(vkDeviceWaitIdle(gpu.device()));
    destroy(gpu.device(), shader, nullptr);
}

// A part of a graphics pipeline, of another part.
class GraphicsPart
{
public:
    GraphicsPart(Gpu &gpu, VkFlags64 promise, VkGraphicsPipelineLibraryFlagBitsEXT part, VkPipeline other) : gpu_(gpu)
    {
        const auto flags =
            vkInit<VkPipelineCreateFlags2CreateInfoKHR>({.flags = promise | VK_PIPELINE_CREATE_LIBRARY_BIT_KHR});
        const auto library = vkInit<VkGraphicsPipelineLibraryCreateInfoEXT>(
            {.pNext = const_cast<VkPipelineCreateFlags2CreateInfoKHR *>(&flags), .flags = VkFlags(part)});
        const auto libraries = vkInit<VkPipelineLibraryCreateInfoKHR>(
            {.pNext = &library, .libraryCount = other ? 1u : 0u, .pLibraries = &other});
        const auto samples =
            vkInit<VkPipelineMultisampleStateCreateInfo>({.rasterizationSamples = VK_SAMPLE_COUNT_1_BIT});
        const auto blend = vkInit<VkPipelineColorBlendStateCreateInfo>();
        const auto vertices = vkInit<VkPipelineVertexInputStateCreateInfo>();
        const auto assembly = vkInit<VkPipelineInputAssemblyStateCreateInfo>();
        const auto info = vkInit<VkGraphicsPipelineCreateInfo>({.pNext = &libraries,
                                                                .pVertexInputState = &vertices,
                                                                .pInputAssemblyState = &assembly,
                                                                .pMultisampleState = &samples,
                                                                .pColorBlendState = &blend});
        VT_CHECK(vkCreateGraphicsPipelines(gpu.device(), VK_NULL_HANDLE, 1, &info, nullptr, &pipeline_));
    }
    GraphicsPart(const GraphicsPart &) = delete;
    GraphicsPart &operator=(const GraphicsPart &) = delete;
    ~GraphicsPart() { vkDestroyPipeline(gpu_.device(), pipeline_, nullptr); }
    [[nodiscard]] VkPipeline handle() const { return pipeline_; }

private:
    Gpu &gpu_;
    VkPipeline pipeline_ = VK_NULL_HANDLE;
};

void libraryWithoutPromise(Gpu &gpu, bool wrong)
{
    const GraphicsPart library(gpu, wrong ? 0 : kDisallowMixed,
                               VK_GRAPHICS_PIPELINE_LIBRARY_VERTEX_INPUT_INTERFACE_BIT_EXT, VK_NULL_HANDLE);
    const GraphicsPart pipeline(gpu, kDisallowMixed, VK_GRAPHICS_PIPELINE_LIBRARY_FRAGMENT_OUTPUT_INTERFACE_BIT_EXT,
                                library.handle());
}

// VK_ARM_pipeline_opacity_micromap
constexpr VkFlags64 kDisallowMicromaps = VK_PIPELINE_CREATE_2_DISALLOW_OPACITY_MICROMAP_BIT_ARM;

void disallowedMicromaps(Gpu &gpu, bool wrong)
{
    const Scene scene(gpu, wrong ? With::Micromap : With::Nothing);
    traceWithFlags(gpu, scene, kDisallowMicromaps, Mode::Absent);
}

constexpr unsigned kPlain = kNeedsPlainShaders;
constexpr WrongProgram kPrograms[] = {
    {"VUID-vkCmdDispatch-micromap-11636", Api::Khr, kPlain, computeWithoutMode},
    {"VUID-vkCmdDispatch-micromap-11636", Api::Khr, kPlain, modeIsFalse, "False"},
    {"VUID-vkCmdDispatch-micromap-11636", Api::Khr, kPlain, modeIsSpecialized, "Specialized"},
    {"VUID-vkCmdDispatch-micromap-11636", Api::Khr, kPlain, meetsMicromap, "Meets"},
    {"VUID-vkCmdDispatch-micromap-11636", Api::Khr, kPlain, executesQuery, "Executes"},
    {"VUID-vkCmdDispatch-micromap-11636", Api::Khr, kPlain, instanceIsVisible, "Visible"},
    {"VUID-vkCmdDispatch-micromap-11636", Api::Khr, kPlain, instanceIsNotCulled<false>, "Culled"},
    {"VUID-vkCmdDispatch-micromap-11636", Api::Khr, kPlain, instanceIsNotCulled<true>, "CulledByConstant"},
    {"VUID-vkCmdDispatch-micromap-11636", Api::Khr, kPlain, inlineModule, "Inline"},
    {"VUID-vkCmdDispatch-micromap-11636", Api::Khr, kPlain, secondSet, "SecondSet"},
    {"VUID-vkCmdDispatch-micromap-11636", Api::Khr, kPlain, updatedByTemplate, "Template"},
    {"VUID-vkCmdDispatch-micromap-11636", Api::Khr, kPlain, copiedDescriptor, "Copied"},
    {"VUID-vkCmdDispatch-micromap-11636", Api::Khr, kPlain, builtAgain, "BuiltAgain"},
    {"VUID-vkCmdDispatchTileQCOM-micromap-11636", Api::Khr, kPlain | kNeedsVendorCommands, dispatchTile},
    {"VUID-vkCmdExecuteGeneratedCommandsNV-micromap-11636", Api::Khr, kPlain | kNeedsVendorCommands, generatedNv},
    {"VUID-vkCmdExecuteGeneratedCommandsEXT-micromap-11636", Api::Khr, kPlain | kNeedsVendorCommands, generatedExt},
    {"VUID-VkWriteDescriptorSetAccelerationStructureKHR-pAccelerationStructures-03579", Api::Khr, kNeedsNothing,
     bottomLevelDescriptor},
    {"VUID-vkCmdDraw-micromap-11636", Api::Khr, kPlain, fragmentWithoutMode},
    {"VUID-vkCmdTraceRaysKHR-micromap-11636", Api::Khr, kPlain | kNeedsPipelines, rayGenerationWithoutMode},
    {"VUID-vkCmdTraceRaysKHR-micromap-11640", Api::Khr, kNeedsPipelines, pipelineWithoutBit},
    {"VUID-vkCmdTraceRaysKHR-micromap-11640", Api::Ext, kNeedsPipelines, pipelineWithoutBit, "Ext"},
    {"VUID-vkCmdTraceRaysKHR-micromap-11640", Api::Khr, kNeedsPipelines, raysMeetMicromap, "Meet"},
    {"VUID-vkCmdTraceRaysKHR-micromap-11640", Api::Ext, kNeedsPipelines, raysMeetMicromap, "MeetExt"},
    {"VUID-vkCmdDispatch-micromap-11638", Api::Khr, kPlain, promiseOfUnmixedIndices},
    {"VUID-vkCmdDispatch-micromap-11638", Api::Khr, kPlain, mixedIndices, "Special"},
    {"VUID-vkCmdDispatch-micromap-11638", Api::Khr, kPlain, indicesOfMicromap, "Micromap"},
    {"VUID-vkCmdDispatch-micromap-11639", Api::Khr, kNeedsShaderObjects, shaderObjectPromise},
    {"VUID-VkGraphicsPipelineCreateInfo-pLibraries-11594", Api::Khr, kPlain, libraryWithoutPromise},
    {"pipeline-disallows-micromaps", Api::Ext, kPlain, disallowedMicromaps, "", "", false, "ext"},
};

} // namespace

std::span<const WrongProgram> tracePrograms()
{
    return kPrograms;
}

} // namespace vt
