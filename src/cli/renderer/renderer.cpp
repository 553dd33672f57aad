#include "cli/renderer/renderer.h"

#include <algorithm>
#include <chrono>

#include "cli/renderer/state_table.h"

namespace vellum::cli
{
namespace
{

constexpr std::uint32_t kTextureBinding = 8;
constexpr std::uint32_t kHeavyReads = 16;

using Clock = std::chrono::steady_clock;

double millisecondsSince(Clock::time_point start)
{
    return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

Image whiteImage()
{
    return {1, 1, {255, 255, 255, 255}};
}

} // namespace

Renderer::Renderer(Device &device, const RenderSettings &settings, World &&world)
    : m_device(device), m_settings(settings), m_world(std::move(world))
{
}

// Delegates, so that the destructor also runs where this throws.
Renderer::Renderer(Device &device, const RenderScene &scene, std::span<const Micromap *const> micromaps,
                   const RenderSettings &settings)
    : Renderer(device, settings,
               World(device, scene, settings.paintStates ? std::span<const Micromap *const>() : micromaps))
{
    m_frame = makeFrame(scene, settings);
    uploadScene(scene, micromaps);
    createLayouts();
    createDescriptors();
    m_pipeline = makePipeline(false);
    recordFrame();
}

Renderer::~Renderer()
{
    const VkDevice device = m_device.handle();
    vkDestroyQueryPool(device, m_timestamps, nullptr);
    vkDestroyDescriptorPool(device, m_pool, nullptr);
    vkDestroyPipelineLayout(device, m_layout, nullptr);
    vkDestroyDescriptorSetLayout(device, m_setLayout, nullptr);
}

Renderer::Frame Renderer::makeFrame(const RenderScene &scene, const RenderSettings &settings)
{
    const float aspect = static_cast<float>(settings.width) / static_cast<float>(settings.height);
    Camera camera = fitCamera(scene.outline, settings.view, aspect);
    const Vec3 size = scene.bounds.size();
    const float scale = std::max({size[0], size[1], size[2], 1e-6f});
    // Not below the ground, however the view is turned.
    camera.origin[1] = std::max(camera.origin[1], scene.ground.positions.front()[1] + 0.02f * scale);
    // From behind the viewer's left shoulder, a summer afternoon.
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
    const std::size_t pixels = std::size_t{m_settings.width} * m_settings.height;
    std::vector<std::uint32_t> states(1); // a buffer cannot be empty
    if (m_settings.paintStates)
        states = makeStateTable(scene, micromaps);
    const VkDeviceSize largest =
        std::max({pixels * 8, scene.uvs.size() * sizeof(float), scene.normals.size() * 4, states.size() * 4});
    if (largest > m_device.limits().maxStorageBufferRange)
        throw Error("the picture or the scene is too large for the device: a buffer of " + std::to_string(largest) +
                    " bytes, where " + std::to_string(m_device.limits().maxStorageBufferRange) + " are allowed");
    m_records = uploadBuffer(m_device, std::as_bytes(std::span(scene.records)), kStorage);
    m_uvs = uploadBuffer(m_device, std::as_bytes(std::span(scene.uvs)), kStorage);
    m_alphas = uploadBuffer(m_device, std::as_bytes(std::span(scene.alphas)), kStorage);
    m_hasAlphas = !scene.alphas.empty();
    m_normals = uploadBuffer(m_device, std::as_bytes(std::span(scene.normals)), kStorage);
    m_states = uploadBuffer(m_device, std::as_bytes(std::span(states)), kStorage);
    m_pixels = Buffer(m_device, pixels * 4, kStorage | VK_BUFFER_USAGE_TRANSFER_SRC_BIT, Buffer::Place::Device);
    m_counts = Buffer(m_device, pixels * 8, kStorage | VK_BUFFER_USAGE_TRANSFER_SRC_BIT, Buffer::Place::Device);
    for (const std::uint32_t material : scene.texturedMaterials) {
        const Material &m = scene.scene.materials[material];
        m_textures.emplace_back(m_device, scene.scene.images[static_cast<std::size_t>(m.image)], m);
    }
    if (m_textures.empty()) // an array cannot be empty
        m_textures.emplace_back(m_device, whiteImage(), Material{});
    if (m_textures.size() > m_device.limits().maxPerStageDescriptorSampledImages)
        throw Error("the scene has more textures than the device allows");
}

void Renderer::createLayouts()
{
    const VkShaderStageFlags stages = stagesOf(m_settings.trace).shaders;
    std::vector<VkDescriptorSetLayoutBinding> bindings;
    const auto textures = static_cast<std::uint32_t>(m_textures.size());
    for (std::uint32_t i = 0; i <= kTextureBinding; ++i) {
        const VkDescriptorType type = i == 0                 ? VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR
                                      : i == kTextureBinding ? VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER
                                                             : VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
        bindings.push_back({i, type, i == kTextureBinding ? textures : 1, stages, nullptr});
    }
    const VkDescriptorSetLayoutCreateInfo set{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO, nullptr, 0,
                                              static_cast<std::uint32_t>(bindings.size()), bindings.data()};
    check(vkCreateDescriptorSetLayout(m_device.handle(), &set, nullptr, &m_setLayout), "creating a descriptor layout");
    const VkPushConstantRange range{stages, 0, sizeof(Frame)};
    const VkPipelineLayoutCreateInfo layout{
        VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO, nullptr, 0, 1, &m_setLayout, 1, &range};
    check(vkCreatePipelineLayout(m_device.handle(), &layout, nullptr, &m_layout), "creating a pipeline layout");
}

void Renderer::createDescriptors()
{
    const auto textures = static_cast<std::uint32_t>(m_textures.size());
    const VkDescriptorPoolSize sizes[] = {{VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR, 1},
                                          {VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 7},
                                          {VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, textures}};
    const VkDescriptorPoolCreateInfo pool{VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO, nullptr, 0, 1, 3, sizes};
    check(vkCreateDescriptorPool(m_device.handle(), &pool, nullptr, &m_pool), "creating a descriptor pool");
    const VkDescriptorSetAllocateInfo allocate{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO, nullptr, m_pool, 1,
                                               &m_setLayout};
    check(vkAllocateDescriptorSets(m_device.handle(), &allocate, &m_set), "allocating descriptors");

    const VkAccelerationStructureKHR top = m_world.top();
    const VkWriteDescriptorSetAccelerationStructureKHR structure{
        VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET_ACCELERATION_STRUCTURE_KHR, nullptr, 1, &top};
    std::vector<VkDescriptorBufferInfo> buffers;
    for (const Buffer *buffer : {&m_pixels, &m_records, &m_uvs, &m_normals, &m_counts, &m_states, &m_alphas})
        buffers.push_back({buffer->handle(), 0, VK_WHOLE_SIZE});
    std::vector<VkDescriptorImageInfo> images;
    for (const Texture &texture : m_textures)
        images.push_back({texture.sampler(), texture.view(), VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL});
    VkWriteDescriptorSet writes[3];
    std::fill(std::begin(writes), std::end(writes),
              VkWriteDescriptorSet{VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET, nullptr, m_set, 0, 0, 1,
                                   VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR, nullptr, nullptr, nullptr});
    writes[0].pNext = &structure;
    writes[1].dstBinding = 1; // and the bindings after it, which have the same type
    writes[1].descriptorCount = static_cast<std::uint32_t>(buffers.size());
    writes[1].descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
    writes[1].pBufferInfo = buffers.data();
    writes[2].dstBinding = kTextureBinding;
    writes[2].descriptorCount = textures;
    writes[2].descriptorType = VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER;
    writes[2].pImageInfo = images.data();
    vkUpdateDescriptorSets(m_device.handle(), 3, writes, 0, nullptr);
}

std::unique_ptr<TracePipeline> Renderer::makePipeline(bool counting) const
{
    TracePipelineInfo info;
    info.layout = m_layout;
    info.micromaps = m_world.micromapBytes() != 0;
    info.constants.textures = static_cast<std::uint32_t>(m_textures.size());
    info.constants.heavyReads = m_settings.heavy ? kHeavyReads : 0;
    info.constants.painting = m_settings.paintStates ? VK_TRUE : VK_FALSE;
    info.constants.vertexAlphas = m_hasAlphas ? VK_TRUE : VK_FALSE;
    info.constants.counting = counting ? VK_TRUE : VK_FALSE;
    return makeTracePipeline(m_device, m_settings.trace, info);
}

void Renderer::record(VkCommandBuffer commands, const TracePipeline &pipeline) const
{
    const TraceStages stages = stagesOf(m_settings.trace);
    vkCmdBindDescriptorSets(commands, stages.bindPoint, m_layout, 0, 1, &m_set, 0, nullptr);
    vkCmdPushConstants(commands, m_layout, stages.shaders, 0, sizeof(Frame), &m_frame);
    pipeline.record(commands, m_settings.width, m_settings.height);
    const VkMemoryBarrier barrier{VK_STRUCTURE_TYPE_MEMORY_BARRIER, nullptr, VK_ACCESS_SHADER_WRITE_BIT,
                                  VK_ACCESS_TRANSFER_READ_BIT | VK_ACCESS_SHADER_WRITE_BIT};
    vkCmdPipelineBarrier(commands, stages.pipelineStage, VK_PIPELINE_STAGE_TRANSFER_BIT | stages.pipelineStage, 0, 1,
                         &barrier, 0, nullptr, 0, nullptr);
}

void Renderer::recordFrame()
{
    if (m_device.hasTimestamps()) {
        VkQueryPoolCreateInfo info{};
        info.sType = VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO;
        info.queryType = VK_QUERY_TYPE_TIMESTAMP;
        info.queryCount = 2;
        check(vkCreateQueryPool(m_device.handle(), &info, nullptr, &m_timestamps), "creating a query pool");
        m_nanosecondsPerTick = static_cast<double>(m_device.limits().timestampPeriod);
    }
    m_commands = m_device.allocateCommands();
    const VkCommandBufferBeginInfo begin{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO, nullptr, 0, nullptr};
    check(vkBeginCommandBuffer(m_commands, &begin), "recording commands");
    if (m_timestamps != VK_NULL_HANDLE) {
        vkCmdResetQueryPool(m_commands, m_timestamps, 0, 2);
        vkCmdWriteTimestamp(m_commands, VK_PIPELINE_STAGE_TOP_OF_PIPE_BIT, m_timestamps, 0);
    }
    record(m_commands, *m_pipeline);
    if (m_timestamps != VK_NULL_HANDLE)
        vkCmdWriteTimestamp(m_commands, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, m_timestamps, 1);
    check(vkEndCommandBuffer(m_commands), "recording commands");
}

double Renderer::frame()
{
    const Clock::time_point start = Clock::now();
    m_device.submitAndWait(m_commands);
    if (m_timestamps == VK_NULL_HANDLE)
        return millisecondsSince(start);
    std::uint64_t ticks[2] = {};
    check(vkGetQueryPoolResults(m_device.handle(), m_timestamps, 0, 2, sizeof(ticks), ticks, sizeof(ticks[0]),
                                VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT),
          "reading timestamps");
    return static_cast<double>(ticks[1] - ticks[0]) * m_nanosecondsPerTick * 1e-6;
}

double Renderer::firstFrame()
{
    const Clock::time_point start = Clock::now();
    const std::unique_ptr<TracePipeline> pipeline = makePipeline(false);
    m_device.run([&](VkCommandBuffer commands) { record(commands, *pipeline); });
    return millisecondsSince(start);
}

Picture Renderer::picture()
{
    const std::size_t pixels = std::size_t{m_settings.width} * m_settings.height;
    return {m_settings.width, m_settings.height, downloadWords(m_device, m_pixels, pixels)};
}

std::vector<std::uint32_t> Renderer::countPixels()
{
    if (!m_countingPipeline)
        m_countingPipeline = makePipeline(true);
    m_device.run([this](VkCommandBuffer commands) { record(commands, *m_countingPipeline); });
    const std::size_t pixels = std::size_t{m_settings.width} * m_settings.height;
    return downloadWords(m_device, m_counts, 2 * pixels);
}

CandidateCount Renderer::count()
{
    const std::vector<std::uint32_t> counts = countPixels();
    CandidateCount sum;
    for (std::size_t i = 0; i < counts.size(); i += 2) {
        sum.candidates += counts[i];
        sum.rays += counts[i + 1];
    }
    return sum;
}

std::vector<float> Renderer::candidatesPerPixel()
{
    const std::vector<std::uint32_t> counts = countPixels();
    std::vector<float> values;
    for (std::size_t i = 0; i < counts.size(); i += 2)
        values.push_back(static_cast<float>(counts[i]) / static_cast<float>(m_settings.samples));
    return values;
}

} // namespace vellum::cli
