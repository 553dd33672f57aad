// SPDX-License-Identifier: Apache-2.0
#include "compiled.h"

#include <algorithm>
#include <cstdlib>

#include "kernel/absent_gpu.h"

namespace vellum::test
{
namespace
{

constexpr VkPipelineCreateFlags kStatistics = VK_PIPELINE_CREATE_CAPTURE_STATISTICS_BIT_KHR;
constexpr uint32_t kPushBytes = 128; // the least that every device has

template <class Function>
Function load(const vt::Device &gpu, const char *name)
{
    return reinterpret_cast<Function>(vkGetDeviceProcAddr(gpu.device(), name));
}

VkPipelineShaderStageCreateInfo stageInfo(VkShaderStageFlagBits stage, VkShaderModule module, const char *entry)
{
    return vkInit<VkPipelineShaderStageCreateInfo>({.stage = stage, .module = module, .pName = entry});
}

struct DriverNames {
    std::string name;
    std::string manifest; // how its file name begins
};

DriverNames namesOf(Driver driver)
{
    switch (driver) {
    case Driver::Anv: return {"ANV", "intel_icd"};
    case Driver::Radv: return {"RADV", "radeon_icd"};
    case Driver::Turnip: return {"turnip", "freedreno_icd"}; // for arm64 only
    }
    return {};
}

std::optional<std::string> manifestOf(const std::string &prefix)
{
    std::error_code ignored;
    for (const auto &entry : std::filesystem::directory_iterator("/usr/share/vulkan/icd.d", ignored)) {
        if (entry.path().filename().string().starts_with(prefix))
            return entry.path().string();
    }
    return {};
}

} // namespace

Driver driverOf(const std::string &gpu)
{
    for (const char *intel : {"dg2", "mtl", "lnl", "bmg"}) {
        if (gpu == intel)
            return Driver::Anv;
    }
    return gpu == "a740" || gpu == "a750" ? Driver::Turnip : Driver::Radv;
}

std::string useGpu(const std::string &gpu, vt::Options &options)
{
    const DriverNames driver = namesOf(driverOf(gpu));
    const std::optional<std::string> manifest = manifestOf(driver.manifest);
    if (!manifest)
        return driver.name + " is not installed (Debian: mesa-vulkan-drivers)";
    kernel::install(gpu);
    options.absentGpu = gpu;
    // The message is about GPUs that another kernel driver supports as well.
    setenv("INTEL_XE_IGNORE_EXPERIMENTAL_WARNING", "1", 1);
    // VK_LAYER_PATH would hide VK_ADD_LAYER_PATH; implicit layers of this machine are not wanted.
    unsetenv("VK_LAYER_PATH");
    unsetenv("VK_INSTANCE_LAYERS");
    setenv("VK_ADD_LAYER_PATH", VELLUM_TEST_LAYER_PATH, 1);
    setenv("VK_LOADER_LAYERS_DISABLE", "~implicit~", 1);
    setenv("VK_DRIVER_FILES", manifest->c_str(), 1);
    setenv("VK_ICD_FILENAMES", manifest->c_str(), 1);
    setenv("MESA_SHADER_CACHE_DISABLE", "true", 1);
    return {};
}

Layout::Layout(vt::Device &gpu, const std::vector<ModuleFacts> &modules) : gpu_(gpu)
{
    std::map<uint32_t, std::map<uint32_t, VkDescriptorSetLayoutBinding>> sets;
    for (const ModuleFacts &facts : modules) {
        for (const Binding &b : facts.bindings) {
            VkDescriptorSetLayoutBinding &made = sets[b.set][b.binding];
            made = {b.binding, b.type, std::max(b.count, made.descriptorCount), VK_SHADER_STAGE_ALL, nullptr};
        }
    }
    const uint32_t count = sets.empty() ? 0 : sets.rbegin()->first + 1;
    for (uint32_t set = 0; set < count; ++set) {
        std::vector<VkDescriptorSetLayoutBinding> bindings;
        for (const auto &[number, binding] : sets[set])
            bindings.push_back(binding);
        auto info = vkInit<VkDescriptorSetLayoutCreateInfo>(
            {.bindingCount = static_cast<uint32_t>(bindings.size()), .pBindings = bindings.data()});
        VT_CHECK(vkCreateDescriptorSetLayout(gpu.device(), &info, nullptr, &sets_.emplace_back()));
    }
    const VkPushConstantRange range{VK_SHADER_STAGE_ALL, 0, kPushBytes};
    auto info = vkInit<VkPipelineLayoutCreateInfo>({.setLayoutCount = static_cast<uint32_t>(sets_.size()),
                                                    .pSetLayouts = sets_.data(),
                                                    .pushConstantRangeCount = 1,
                                                    .pPushConstantRanges = &range});
    VT_CHECK(vkCreatePipelineLayout(gpu.device(), &info, nullptr, &layout_));
}

Layout::~Layout()
{
    vkDestroyPipelineLayout(gpu_.device(), layout_, nullptr);
    for (const VkDescriptorSetLayout set : sets_)
        vkDestroyDescriptorSetLayout(gpu_.device(), set, nullptr);
}

Compiled Compiled::compute(vt::Device &gpu, std::span<const uint32_t> words, const std::string &entry)
{
    Compiled made(gpu);
    const Layout layout(gpu, {factsOf(words)});
    const VkShaderModule module = gpu.shader(words);
    auto info =
        vkInit<VkComputePipelineCreateInfo>({.flags = kStatistics,
                                             .stage = stageInfo(VK_SHADER_STAGE_COMPUTE_BIT, module, entry.c_str()),
                                             .layout = layout.handle()});
    const VkResult result = vkCreateComputePipelines(gpu.device(), VK_NULL_HANDLE, 1, &info, nullptr, &made.pipeline_);
    vkDestroyShaderModule(gpu.device(), module, nullptr);
    VT_CHECK(result);
    return made;
}

Compiled Compiled::graphics(vt::Device &gpu, std::span<const uint32_t> vertex, std::span<const uint32_t> fragment)
{
    Compiled made(gpu);
    const Layout layout(gpu, {factsOf(vertex), factsOf(fragment)});
    const VkShaderModule modules[]{gpu.shader(vertex), gpu.shader(fragment)};
    const VkPipelineShaderStageCreateInfo stages[]{stageInfo(VK_SHADER_STAGE_VERTEX_BIT, modules[0], "main"),
                                                   stageInfo(VK_SHADER_STAGE_FRAGMENT_BIT, modules[1], "main")};
    auto input = vkInit<VkPipelineVertexInputStateCreateInfo>();
    auto assembly = vkInit<VkPipelineInputAssemblyStateCreateInfo>({.topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST});
    const VkViewport viewport{0, 0, 16, 16, 0, 1};
    const VkRect2D scissor{{0, 0}, {16, 16}};
    auto view = vkInit<VkPipelineViewportStateCreateInfo>();
    view.viewportCount = view.scissorCount = 1;
    view.pViewports = &viewport;
    view.pScissors = &scissor;
    auto raster = vkInit<VkPipelineRasterizationStateCreateInfo>({.lineWidth = 1});
    auto samples = vkInit<VkPipelineMultisampleStateCreateInfo>({.rasterizationSamples = VK_SAMPLE_COUNT_1_BIT});
    VkPipelineColorBlendAttachmentState attachment{};
    attachment.colorWriteMask = 0xf;
    auto blend = vkInit<VkPipelineColorBlendStateCreateInfo>({.attachmentCount = 1, .pAttachments = &attachment});
    const VkFormat format = VK_FORMAT_R8G8B8A8_UNORM;
    auto rendering =
        vkInit<VkPipelineRenderingCreateInfo>({.colorAttachmentCount = 1, .pColorAttachmentFormats = &format});
    auto info = vkInit<VkGraphicsPipelineCreateInfo>({.pNext = &rendering,
                                                      .flags = kStatistics,
                                                      .stageCount = 2,
                                                      .pStages = stages,
                                                      .pVertexInputState = &input,
                                                      .pInputAssemblyState = &assembly,
                                                      .pViewportState = &view,
                                                      .pRasterizationState = &raster,
                                                      .pMultisampleState = &samples,
                                                      .pColorBlendState = &blend,
                                                      .layout = layout.handle()});
    const VkResult result = vkCreateGraphicsPipelines(gpu.device(), VK_NULL_HANDLE, 1, &info, nullptr, &made.pipeline_);
    for (const VkShaderModule module : modules)
        vkDestroyShaderModule(gpu.device(), module, nullptr);
    VT_CHECK(result);
    return made;
}

Compiled Compiled::rays(vt::Device &gpu, vt::PipelineSetup setup)
{
    Compiled made(gpu);
    std::vector<ModuleFacts> facts;
    for (const vt::PipelineStage &stage : setup.stages)
        facts.push_back(factsOf(stage.words));
    std::optional<Layout> layout;
    if (setup.layout == VK_NULL_HANDLE)
        setup.layout = layout.emplace(gpu, facts).handle();
    setup.flags |= kStatistics;
    const vt::PipelineInfo info(gpu, setup);
    VT_CHECK(gpu.vk().CreateRayTracingPipelinesKHR(gpu.device(), VK_NULL_HANDLE, VK_NULL_HANDLE, 1, &info.get(),
                                                   nullptr, &made.pipeline_));
    return made;
}

Compiled::Compiled(Compiled &&other) noexcept : gpu_(other.gpu_), pipeline_(other.pipeline_)
{
    other.pipeline_ = VK_NULL_HANDLE;
}

Compiled::~Compiled()
{
    vkDestroyPipeline(gpu_->device(), pipeline_, nullptr);
}

std::vector<Executable> Compiled::executables() const
{
    const auto properties =
        load<PFN_vkGetPipelineExecutablePropertiesKHR>(*gpu_, "vkGetPipelineExecutablePropertiesKHR");
    const auto statistics =
        load<PFN_vkGetPipelineExecutableStatisticsKHR>(*gpu_, "vkGetPipelineExecutableStatisticsKHR");
    const auto pipeline = vkInit<VkPipelineInfoKHR>({.pipeline = pipeline_});
    uint32_t count = 0;
    VT_CHECK(properties(gpu_->device(), &pipeline, &count, nullptr));
    std::vector<VkPipelineExecutablePropertiesKHR> all(count, {VK_STRUCTURE_TYPE_PIPELINE_EXECUTABLE_PROPERTIES_KHR});
    VT_CHECK(properties(gpu_->device(), &pipeline, &count, all.data()));
    std::vector<Executable> made;
    for (uint32_t i = 0; i < count; ++i) {
        const auto info = vkInit<VkPipelineExecutableInfoKHR>({.pipeline = pipeline_, .executableIndex = i});
        uint32_t values = 0;
        VT_CHECK(statistics(gpu_->device(), &info, &values, nullptr));
        std::vector<VkPipelineExecutableStatisticKHR> found(values,
                                                            {VK_STRUCTURE_TYPE_PIPELINE_EXECUTABLE_STATISTIC_KHR});
        VT_CHECK(statistics(gpu_->device(), &info, &values, found.data()));
        Executable &one = made.emplace_back(Executable{all[i].name, all[i].stages, {}});
        for (const VkPipelineExecutableStatisticKHR &s : found) {
            if (s.format == VK_PIPELINE_EXECUTABLE_STATISTIC_FORMAT_UINT64_KHR)
                one.statistics[s.name] = s.value.u64;
        }
    }
    return made;
}

} // namespace vellum::test
