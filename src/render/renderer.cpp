// SPDX-License-Identifier: Apache-2.0
#include "render/renderer.h"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstring>
#include <stdexcept>
#include <string>

#include "gpu/pipeline_builder.h"
#include "shaders/render_comp.h"
#include "shaders/render_comp_micromaps.h"
#include "shaders/render_rahit.h"
#include "shaders/render_rchit.h"
#include "shaders/render_rgen.h"
#include "shaders/render_rmiss.h"

namespace vellum::render
{
namespace
{

constexpr VkSpecializationMapEntry kConstants[] = {
    {0, offsetof(TraceConstants, textures), sizeof(TraceConstants::textures)},
    {1, offsetof(TraceConstants, heavyReads), sizeof(TraceConstants::heavyReads)},
    {2, offsetof(TraceConstants, counting), sizeof(TraceConstants::counting)},
    {3, offsetof(TraceConstants, painting), sizeof(TraceConstants::painting)},
    {4, offsetof(TraceConstants, vertexAlphas), sizeof(TraceConstants::vertexAlphas)}};

constexpr uint32_t kGroupEdge = 8; // local size of the compute shader, along both axes

VkSpecializationInfo specializationOf(const TraceConstants &constants)
{
    return {static_cast<uint32_t>(std::size(kConstants)), kConstants, sizeof constants, &constants};
}

// Draws by ray queries: one compute shader, shaders/render.comp.
class QueryPipeline final : public TracePipeline
{
public:
    QueryPipeline(gpu::Device &device, const TracePipelineInfo &info) : device_(device)
    {
        // With VK_EXT_opacity_micromap all ray queries consume micromaps, with VK_KHR_opacity_micromap those of shaders
        // with the execution mode, which is allowed with that extension only.
        const VkShaderModule module = device.shader(
            info.micromaps && device.khr() ? std::span<const uint32_t>(render_comp_micromaps) : render_comp);
        const VkSpecializationInfo specialization = specializationOf(info.constants);
        auto create = vkInit<VkComputePipelineCreateInfo>({.layout = info.layout});
        create.stage = vkInit<VkPipelineShaderStageCreateInfo>({.stage = VK_SHADER_STAGE_COMPUTE_BIT,
                                                                .module = module,
                                                                .pName = "main",
                                                                .pSpecializationInfo = &specialization});
        const VkResult result =
            vkCreateComputePipelines(device.device(), VK_NULL_HANDLE, 1, &create, nullptr, &pipeline_);
        vkDestroyShaderModule(device.device(), module, nullptr);
        gpu::checkResult(result, "vkCreateComputePipelines");
    }
    ~QueryPipeline() override { vkDestroyPipeline(device_.device(), pipeline_, nullptr); }

    void record(VkCommandBuffer commands, uint32_t width, uint32_t height) const override
    {
        vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline_);
        vkCmdDispatch(commands, (width + kGroupEdge - 1) / kGroupEdge, (height + kGroupEdge - 1) / kGroupEdge, 1);
    }

private:
    gpu::Device &device_;
    VkPipeline pipeline_ = VK_NULL_HANDLE;
};

// Draws by a ray tracing pipeline: the ray generation shader traces and shades, the any-hit shader does the alpha test.
// One hit group serves all geometry; solid geometry is opaque and does not reach the any-hit shader.
class RayTracingPipeline final : public TracePipeline
{
public:
    RayTracingPipeline(gpu::Device &device, const TracePipelineInfo &info)
        : mostRays_(device.pipelineProperties().maxRayDispatchInvocationCount), pipeline_(device, setupOf(info)),
          table_(device, pipeline_, {.raygen = {0, {}}, .miss = {{1, {}}}, .hit = {{2, {}}}, .dataWords = 0})
    {
    }

    void record(VkCommandBuffer commands, uint32_t width, uint32_t height) const override
    {
        if (uint64_t{width} * height > mostRays_)
            throw std::runtime_error("the picture is too large for the device: it traces at most " +
                                     std::to_string(mostRays_) + " pixels at once");
        vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR, pipeline_.handle());
        table_.trace(commands, width, height);
    }

private:
    gpu::PipelineSetup setupOf(const TracePipelineInfo &info)
    {
        constants_ = info.constants;
        specialization_ = specializationOf(constants_);
        gpu::PipelineSetup setup;
        const auto add = [&](VkShaderStageFlagBits stage, std::span<const uint32_t> words) {
            setup.stages.push_back({.stage = stage, .words = words, .specialization = &specialization_});
        };
        add(VK_SHADER_STAGE_RAYGEN_BIT_KHR, render_rgen);
        add(VK_SHADER_STAGE_MISS_BIT_KHR, render_rmiss);
        add(VK_SHADER_STAGE_ANY_HIT_BIT_KHR, render_rahit);
        add(VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR, render_rchit);
        setup.groups = {{.general = 0}, {.general = 1}, {.closestHit = 3, .anyHit = 2}};
        setup.layout = info.layout;
        // The bit is the same with either extension.
        setup.flags = info.micromaps ? gpu::kMicromapBit : VkPipelineCreateFlags{0};
        return setup;
    }

    uint32_t mostRays_; // of one vkCmdTraceRaysKHR
    TraceConstants constants_;
    VkSpecializationInfo specialization_{};
    gpu::RayPipeline pipeline_;
    gpu::BindingTable table_;
};

} // namespace

std::vector<Trace> tracesOf(const gpu::DeviceInfo &device)
{
    std::vector<Trace> traces;
    if (device.rayQueries)
        traces.push_back(Trace::Query);
    if (device.rayTracingPipelines)
        traces.push_back(Trace::Pipeline);
    return traces;
}

TraceStages stagesOf(Trace trace)
{
    if (trace == Trace::Query)
        return {VK_PIPELINE_BIND_POINT_COMPUTE, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, VK_SHADER_STAGE_COMPUTE_BIT};
    return {VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR, VK_PIPELINE_STAGE_RAY_TRACING_SHADER_BIT_KHR,
            VK_SHADER_STAGE_RAYGEN_BIT_KHR | VK_SHADER_STAGE_ANY_HIT_BIT_KHR | VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR |
                VK_SHADER_STAGE_MISS_BIT_KHR};
}

std::unique_ptr<TracePipeline> makeTracePipeline(gpu::Device &device, Trace trace, const TracePipelineInfo &info)
{
    if (trace == Trace::Query)
        return std::make_unique<QueryPipeline>(device, info);
    return std::make_unique<RayTracingPipeline>(device, info);
}

Camera fitCamera(std::span<const Vec3> points, const View &view, float aspect)
{
    const float yaw = view.yaw * kPi / 180;
    const float pitch = view.pitch * kPi / 180;
    const Vec3 forward = {-std::sin(yaw) * std::cos(pitch), -std::sin(pitch), -std::cos(yaw) * std::cos(pitch)};
    const Vec3 right = normalize(cross(forward, {0, 1, 0}));
    const Vec3 up = cross(right, forward);
    constexpr float kBorder = 0.92f;
    const float tall = std::tan(view.fieldOfView * 0.5f * kPi / 180);
    const float wide = tall * aspect;

    // A point stays in the picture's left half-plane border while x >= -wide * (z + distance), and so on: for each
    // border the camera's place along it is bounded by one point, and two opposite borders give distance and middle.
    const auto extent = [&](const Vec3 &axis, float slope) {
        float low = 1e30f;
        float high = -1e30f;
        for (const Vec3 &p : points) {
            const float away = dot(p, forward) * slope * kBorder;
            low = std::min(low, dot(p, axis) + away);
            high = std::max(high, dot(p, axis) - away);
        }
        // middle and distance from the plane through the world's origin
        return std::array<float, 2>{0.5f * (low + high), 0.5f * (high - low) / (slope * kBorder)};
    };
    const auto across = extent(right, wide);
    const auto upward = extent(up, tall);
    const float distance = std::max(across[1], upward[1]);
    float depth = 0;
    for (const Vec3 &p : points)
        depth += dot(p, forward) / static_cast<float>(points.size());

    Camera camera;
    const float kept = (distance + depth) / view.zoom - depth;
    camera.origin = right * across[0] + up * upward[0] - forward * kept;
    camera.forward = forward;
    camera.right = right * wide;
    camera.up = up * tall;
    return camera;
}

namespace
{

constexpr uint32_t kTextureBinding = 8;
constexpr uint32_t kHeavyReads = 16;

using Clock = std::chrono::steady_clock;

double millisecondsSince(Clock::time_point start)
{
    return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

Image whiteImage()
{
    return {1, 1, {255, 255, 255, 255}};
}

// The states of micromaps as the shader of --mode states reads them.

// Second words. With kStatesData, the level in the low bits and kStatesTwo for the 2-state format.
constexpr uint32_t kStatesNone = 0; // no micromap
constexpr uint32_t kStatesOne = 0x100;
constexpr uint32_t kStatesData = 0x200;
constexpr uint32_t kStatesTwo = 0x400;

struct Entry {
    uint32_t first = 0;
    uint32_t second = kStatesNone;
};

Entry entryOf(const Micromap &micromap, size_t triangle, uint32_t firstByte)
{
    const int32_t index = micromap.indices[triangle];
    if (const auto state = specialState(index))
        return {static_cast<uint32_t>(*state), kStatesOne};
    const MicromapTriangle &t = micromap.triangles[static_cast<uint32_t>(index) + micromap.baseTriangle];
    return {firstByte + t.dataOffset,
            kStatesData | t.subdivisionLevel | (t.format == Format::TwoState ? kStatesTwo : 0)};
}

// Words: a colour for each State; two for each triangle of the renderer's scene, in the order of its records; then the
// micromaps' data. A triangle's first word is where its data begins, in bytes from the table's beginning, or its one
// state; the second word is which of these (kStates...), and its level and format.
// `micromaps`: one for each geometry of the scene, null for those without.
std::vector<uint32_t> makeStateTable(const RenderScene &scene, std::span<const Micromap *const> micromaps)
{
    std::vector<uint32_t> table(kStateColors.begin(), kStateColors.end());
    const size_t triangles = scene.normals.size() / 3;
    table.resize(table.size() + 2 * triangles, 0);
    for (size_t i = 0; i < micromaps.size(); ++i) {
        if (micromaps[i] == nullptr)
            continue;
        const Micromap &micromap = *micromaps[i];
        const size_t firstWord = table.size();
        table.resize(firstWord + (micromap.data.size() + 3) / 4, 0);
        if (!micromap.data.empty())
            std::memcpy(table.data() + firstWord, micromap.data.data(), micromap.data.size());
        for (size_t t = 0; t < micromap.indices.size(); ++t) {
            const Entry entry = entryOf(micromap, t, static_cast<uint32_t>(4 * firstWord));
            const size_t at = kStateColors.size() + 2 * (scene.records[i].firstTriangle + t);
            table[at] = entry.first;
            table[at + 1] = entry.second;
        }
    }
    return table;
}

} // namespace

Renderer::Renderer(gpu::Device &device, const RenderSettings &settings, World &&world)
    : device_(device), settings_(settings), world_(std::move(world)), timer_(device)
{
}

// Delegates, so that the destructor also runs where this throws.
Renderer::Renderer(gpu::Device &device, const RenderScene &scene, std::span<const Micromap *const> micromaps,
                   const RenderSettings &settings)
    : Renderer(device, settings,
               World(device, scene, settings.paintStates ? std::span<const Micromap *const>() : micromaps))
{
    if (!device.hasVariableTextureIndices())
        throw std::runtime_error(
            "the device cannot index textures by variables (shaderSampledImageArrayNonUniformIndexing)");
    frame_ = makeFrame(scene, settings);
    uploadScene(scene, micromaps);
    createLayouts();
    createDescriptors();
    pipeline_ = makePipeline(false);
    recordFrame();
}

Renderer::~Renderer()
{
    const VkDevice device = device_.device();
    vkFreeCommandBuffers(device, device_.pool(), commands_ == VK_NULL_HANDLE ? 0 : 1, &commands_);
    vkDestroyDescriptorPool(device, pool_, nullptr);
    vkDestroyPipelineLayout(device, layout_, nullptr);
    vkDestroyDescriptorSetLayout(device, setLayout_, nullptr);
}

Renderer::Frame Renderer::makeFrame(const RenderScene &scene, const RenderSettings &settings)
{
    const float aspect = static_cast<float>(settings.width) / static_cast<float>(settings.height);
    Camera camera = fitCamera(scene.outline, settings.view, aspect);
    const Vec3 size = scene.bounds.size();
    const float scale = std::max({size[0], size[1], size[2], 1e-6f});
    // Not below the ground, whatever the view.
    camera.origin[1] = std::max(camera.origin[1], scene.ground.positions.front()[1] + 0.02f * scale);
    // From behind the viewer's left shoulder, as on a summer afternoon.
    const float azimuth = (settings.view.yaw - 62) * kPi / 180;
    const Vec3 sun = normalize({std::sin(azimuth), 0.95f, std::cos(azimuth)});
    Frame frame{};
    const auto set = [](float *to, const Vec3 &v, float w) {
        std::copy(v.begin(), v.end(), to);
        to[3] = w;
    };
    set(frame.origin, camera.origin, scale);
    set(frame.right, camera.right, static_cast<float>(settings.width));
    set(frame.up, camera.up, static_cast<float>(settings.height));
    set(frame.forward, camera.forward, static_cast<float>(settings.samples));
    set(frame.sun, sun, 0);
    return frame;
}

void Renderer::uploadScene(const RenderScene &scene, std::span<const Micromap *const> micromaps)
{
    constexpr VkBufferUsageFlags kStorage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT;
    const auto upload = [this](auto content) { return device_.upload(content.data(), content.size_bytes(), kStorage); };
    const size_t pixels = size_t{settings_.width} * settings_.height;
    std::vector<uint32_t> states(1); // a buffer cannot be empty
    if (settings_.paintStates)
        states = makeStateTable(scene, micromaps);
    const VkDeviceSize largest =
        std::max({pixels * 8, scene.uvs.size() * sizeof(float), scene.normals.size() * 4, states.size() * 4});
    if (largest > device_.limits().maxStorageBufferRange)
        throw std::runtime_error("the picture or the scene is too large for the device: a buffer of " +
                                 std::to_string(largest) + " bytes, where " +
                                 std::to_string(device_.limits().maxStorageBufferRange) + " are allowed");
    records_ = upload(std::span(scene.records));
    uvs_ = upload(std::span(scene.uvs));
    alphas_ = upload(std::span(scene.alphas));
    hasAlphas_ = !scene.alphas.empty();
    normals_ = upload(std::span(scene.normals));
    states_ = upload(std::span(states));
    pixels_ = gpu::Buffer(device_, pixels * 4, kStorage | VK_BUFFER_USAGE_TRANSFER_SRC_BIT, gpu::Buffer::Place::Device);
    counts_ = gpu::Buffer(device_, pixels * 8, kStorage | VK_BUFFER_USAGE_TRANSFER_SRC_BIT, gpu::Buffer::Place::Device);
    for (const uint32_t material : scene.texturedMaterials) {
        const Material &m = scene.scene.materials[material];
        textures_.emplace_back(device_, scene.scene.images[static_cast<size_t>(m.image)], m);
    }
    if (textures_.empty()) // an array cannot be empty
        textures_.emplace_back(device_, whiteImage(), Material{});
    if (textures_.size() > device_.limits().maxPerStageDescriptorSampledImages)
        throw std::runtime_error("the scene has more textures than the device allows");
}

void Renderer::createLayouts()
{
    const VkShaderStageFlags stages = stagesOf(settings_.trace).shaders;
    std::vector<VkDescriptorSetLayoutBinding> bindings;
    const auto textures = static_cast<uint32_t>(textures_.size());
    for (uint32_t i = 0; i <= kTextureBinding; ++i) {
        const VkDescriptorType type = i == 0                 ? VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR
                                      : i == kTextureBinding ? VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER
                                                             : VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
        bindings.push_back({i, type, i == kTextureBinding ? textures : 1, stages, nullptr});
    }
    const VkDescriptorSetLayoutCreateInfo set{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO, nullptr, 0,
                                              static_cast<uint32_t>(bindings.size()), bindings.data()};
    CHECK_VK(vkCreateDescriptorSetLayout(device_.device(), &set, nullptr, &setLayout_));
    const VkPushConstantRange range{stages, 0, sizeof(Frame)};
    const VkPipelineLayoutCreateInfo layout{
        VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO, nullptr, 0, 1, &setLayout_, 1, &range};
    CHECK_VK(vkCreatePipelineLayout(device_.device(), &layout, nullptr, &layout_));
}

void Renderer::createDescriptors()
{
    const auto textures = static_cast<uint32_t>(textures_.size());
    const VkDescriptorPoolSize sizes[] = {{VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR, 1},
                                          {VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 7},
                                          {VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, textures}};
    const VkDescriptorPoolCreateInfo pool{VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO, nullptr, 0, 1, 3, sizes};
    CHECK_VK(vkCreateDescriptorPool(device_.device(), &pool, nullptr, &pool_));
    const VkDescriptorSetAllocateInfo allocate{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO, nullptr, pool_, 1,
                                               &setLayout_};
    CHECK_VK(vkAllocateDescriptorSets(device_.device(), &allocate, &set_));

    const VkAccelerationStructureKHR top = world_.top();
    const VkWriteDescriptorSetAccelerationStructureKHR structure{
        VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET_ACCELERATION_STRUCTURE_KHR, nullptr, 1, &top};
    std::vector<VkDescriptorBufferInfo> buffers;
    for (const gpu::Buffer *buffer : {&pixels_, &records_, &uvs_, &normals_, &counts_, &states_, &alphas_})
        buffers.push_back({buffer->handle(), 0, VK_WHOLE_SIZE});
    std::vector<VkDescriptorImageInfo> images;
    for (const Texture &texture : textures_)
        images.push_back({texture.sampler(), texture.view(), VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL});
    VkWriteDescriptorSet writes[3];
    std::fill(std::begin(writes), std::end(writes),
              VkWriteDescriptorSet{VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET, nullptr, set_, 0, 0, 1,
                                   VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR, nullptr, nullptr, nullptr});
    writes[0].pNext = &structure;
    writes[1].dstBinding = 1; // and the bindings after it, which have the same type
    writes[1].descriptorCount = static_cast<uint32_t>(buffers.size());
    writes[1].descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
    writes[1].pBufferInfo = buffers.data();
    writes[2].dstBinding = kTextureBinding;
    writes[2].descriptorCount = textures;
    writes[2].descriptorType = VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER;
    writes[2].pImageInfo = images.data();
    vkUpdateDescriptorSets(device_.device(), 3, writes, 0, nullptr);
}

std::unique_ptr<TracePipeline> Renderer::makePipeline(bool counting) const
{
    TracePipelineInfo info;
    info.layout = layout_;
    info.micromaps = world_.micromapBytes() != 0;
    info.constants.textures = static_cast<uint32_t>(textures_.size());
    info.constants.heavyReads = settings_.heavy ? kHeavyReads : 0;
    info.constants.painting = settings_.paintStates ? VK_TRUE : VK_FALSE;
    info.constants.vertexAlphas = hasAlphas_ ? VK_TRUE : VK_FALSE;
    info.constants.counting = counting ? VK_TRUE : VK_FALSE;
    return makeTracePipeline(device_, settings_.trace, info);
}

void Renderer::record(VkCommandBuffer commands, const TracePipeline &pipeline) const
{
    const TraceStages stages = stagesOf(settings_.trace);
    vkCmdBindDescriptorSets(commands, stages.bindPoint, layout_, 0, 1, &set_, 0, nullptr);
    vkCmdPushConstants(commands, layout_, stages.shaders, 0, sizeof(Frame), &frame_);
    pipeline.record(commands, settings_.width, settings_.height);
    const VkMemoryBarrier barrier{VK_STRUCTURE_TYPE_MEMORY_BARRIER, nullptr, VK_ACCESS_SHADER_WRITE_BIT,
                                  VK_ACCESS_TRANSFER_READ_BIT | VK_ACCESS_SHADER_WRITE_BIT};
    vkCmdPipelineBarrier(commands, stages.pipelineStage, VK_PIPELINE_STAGE_TRANSFER_BIT | stages.pipelineStage, 0, 1,
                         &barrier, 0, nullptr, 0, nullptr);
}

void Renderer::recordFrame()
{
    commands_ = device_.begin(0);
    timer_.begin(commands_);
    record(commands_, *pipeline_);
    timer_.end(commands_);
    device_.end(commands_);
}

gpu::Milliseconds Renderer::timedFrame()
{
    return timer_.time([this] { device_.execute(commands_); });
}

double Renderer::firstFrame()
{
    const Clock::time_point start = Clock::now();
    const std::unique_ptr<TracePipeline> pipeline = makePipeline(false);
    device_.submit([&](VkCommandBuffer commands) { record(commands, *pipeline); });
    return millisecondsSince(start);
}

Picture Renderer::picture()
{
    const size_t pixels = size_t{settings_.width} * settings_.height;
    return {settings_.width, settings_.height, pixels_.words(pixels)};
}

std::vector<uint32_t> Renderer::countPixels()
{
    if (!countingPipeline_)
        countingPipeline_ = makePipeline(true);
    device_.submit([this](VkCommandBuffer commands) { record(commands, *countingPipeline_); });
    const size_t pixels = size_t{settings_.width} * settings_.height;
    return counts_.words(2 * pixels);
}

CandidateCount Renderer::count()
{
    const std::vector<uint32_t> counts = countPixels();
    CandidateCount sum;
    for (size_t i = 0; i < counts.size(); i += 2) {
        sum.candidates += counts[i];
        sum.rays += counts[i + 1];
    }
    return sum;
}

std::vector<float> Renderer::candidatesPerPixel()
{
    const std::vector<uint32_t> counts = countPixels();
    std::vector<float> values;
    for (size_t i = 0; i < counts.size(); i += 2)
        values.push_back(static_cast<float>(counts[i]) / static_cast<float>(settings_.samples));
    return values;
}

} // namespace vellum::render
