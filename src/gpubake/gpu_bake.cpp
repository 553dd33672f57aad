#include "vellum/gpu_bake.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "core/gpu_bake.h"
#include "gpubake/parameters.h"
#include "gpubake/pipelines.h"

namespace vellum
{
namespace
{

using namespace vellum::shared;
using gpubake::Parameters;
using gpubake::Pipelines;
using gpubake::Shader;

static_assert(sizeof(GpuBakeResult) == (1 + kBakeLevels + 4) * 4);
static_assert(kGpuBakeLevels == kBakeLevels);
static_assert(sizeof(VkMicromapTriangleEXT) == 8);

// As bake_begin.comp places them.
struct MipCells {
    std::uint32_t x;
    std::uint32_t y;
};
MipCells cellsOf(const GpuAlphaInfo &alpha, std::uint32_t mip)
{
    const bool bilinear = alpha.filter == VK_FILTER_LINEAR;
    const auto along = [&](std::uint32_t size, VkSamplerAddressMode mode) {
        return bakeCells(bakeMipSize(size, mip), gpubake::wrapOf(mode).value_or(kBakeClamp), bilinear);
    };
    return {along(alpha.width, alpha.wrapU), along(alpha.height, alpha.wrapV)};
}

// Writes commands for one bake.
class Recording
{
public:
    Recording(const Pipelines &pipelines, VkCommandBuffer commands, const GpuBaker::Scratch &scratch,
              VkDescriptorSet set)
        : m_pipelines(pipelines), m_functions(pipelines.functions()), m_commands(commands), m_scratch(scratch)
    {
        m_functions.CmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipelines.layout(), 0, 1, &set, 0,
                                          nullptr);
        barrier(); // against what a bake before this one does with the same scratch memory
    }

    void setWords(std::uint32_t first, const std::uint32_t *words, std::uint32_t count)
    {
        bind(Shader::Params);
        struct {
            VkDeviceAddress scratch;
            std::uint32_t first, count;
            std::array<std::uint32_t, kBakePushedWords> words;
        } push{};
        static_assert(sizeof push == gpubake::kPushBytes);
        for (std::uint32_t done = 0; done < count; done += push.count) {
            push.scratch = m_scratch.address;
            push.first = first + done;
            push.count = std::min(count - done, kBakePushedWords);
            std::copy_n(words + done, push.count, push.words.begin());
            m_functions.CmdPushConstants(m_commands, m_pipelines.layout(), VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof push,
                                         &push);
            m_functions.CmdDispatch(m_commands, 1, 1, 1);
        }
    }

    void run(Shader shader, std::uint64_t invocations, std::uint32_t each, std::uint32_t first = 0,
             std::uint32_t second = 0)
    {
        const std::uint64_t groups = (invocations + each - 1) / each;
        if (groups == 0)
            return;
        begin(shader, first, second);
        m_functions.CmdDispatch(m_commands,
                                static_cast<std::uint32_t>(std::min<std::uint64_t>(groups, kBakeMostGroups)),
                                static_cast<std::uint32_t>((groups + kBakeMostGroups - 1) / kBakeMostGroups), 1);
        barrier();
    }

    void runIndirect(Shader shader, std::uint32_t groupsAt)
    {
        begin(shader, 0, 0);
        m_functions.CmdDispatchIndirect(m_commands, m_scratch.buffer, m_scratch.offset + 4 * VkDeviceSize{groupsAt});
        barrier();
    }

    void barrier()
    {
        const VkMemoryBarrier all{VK_STRUCTURE_TYPE_MEMORY_BARRIER, nullptr, VK_ACCESS_SHADER_WRITE_BIT,
                                  VK_ACCESS_SHADER_READ_BIT | VK_ACCESS_SHADER_WRITE_BIT |
                                      VK_ACCESS_INDIRECT_COMMAND_READ_BIT};
        m_functions.CmdPipelineBarrier(m_commands,
                                       VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT | VK_PIPELINE_STAGE_DRAW_INDIRECT_BIT,
                                       VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT | VK_PIPELINE_STAGE_DRAW_INDIRECT_BIT, 0, 1,
                                       &all, 0, nullptr, 0, nullptr);
    }

private:
    void bind(Shader shader)
    {
        m_functions.CmdBindPipeline(m_commands, VK_PIPELINE_BIND_POINT_COMPUTE, m_pipelines[shader]);
    }
    void begin(Shader shader, std::uint32_t first, std::uint32_t second)
    {
        bind(shader);
        const struct {
            VkDeviceAddress scratch;
            std::uint32_t first, second;
        } push{m_scratch.address, first, second};
        m_functions.CmdPushConstants(m_commands, m_pipelines.layout(), VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof push,
                                     &push);
    }

    const Pipelines &m_pipelines;
    const gpubake::Functions &m_functions;
    VkCommandBuffer m_commands;
    GpuBaker::Scratch m_scratch;
};

void setParameters(Recording &recording, const Parameters &parameters)
{
    recording.setWords(0, parameters.data(), kBakeSetWords);
    constexpr std::array<std::uint32_t, 4> kNone{};
    recording.setWords(kBakeSpecials, kNone.data(), 4);
    recording.barrier();
}

void makeMasks(Recording &recording, const GpuAlphaInfo &alpha)
{
    recording.run(Shader::Begin, 1, 1);
    for (std::uint32_t mip = 0; mip < alpha.mipLevels; ++mip) {
        const MipCells cells = cellsOf(alpha, mip);
        constexpr std::uint64_t kRows = 4; // as bake_cells.comp
        recording.run(Shader::Cells, bakeMaskPitch(cells.x) * ((cells.y + kRows - 1) / kRows), 64, mip);
        for (std::uint32_t step = 1; step < bakeMaskSteps(cells.x, cells.y); ++step)
            recording.run(Shader::Blocks, bakeMaskWords(cells.x, cells.y, step) / 2, 64, mip, step);
    }
}

// Lists the triangles that are not known to be one state, or those that get data.
void countList(Recording &recording, std::uint32_t triangles, std::uint32_t which)
{
    recording.run(Shader::Count, triangles, kBakeBlock, which);
    recording.run(Shader::Scan, 1, 1, which);
}

// What both ways begin with: until it is known which triangles get data.
void findStates(Recording &recording, const GpuAlphaInfo &alpha, std::uint32_t triangles, bool specialIndices)
{
    makeMasks(recording, alpha);
    recording.run(Shader::Plan, triangles, 64);
    if (specialIndices) {
        countList(recording, triangles, 0);
        recording.run(Shader::Place, triangles, kBakeBlock, 0);
        recording.runIndirect(Shader::Probe, kBakeProbeGroups);
        recording.runIndirect(Shader::Measure, kBakeMeasureGroups);
    }
    countList(recording, triangles, 1);
}

void writeData(Recording &recording, std::uint32_t triangles, const GpuBakeRoom &room)
{
    recording.run(Shader::Place, triangles, kBakeBlock, 1);
    recording.runIndirect(Shader::Write, kBakeWriteGroups);
    const std::uint64_t records = GpuBaker::recordBytes(room) / sizeof(VkMicromapTriangleEXT);
    recording.run(Shader::Records, std::max<std::uint64_t>(records, 4), 64);
}

} // namespace

struct GpuAlpha::State {
    State(std::shared_ptr<const Pipelines> all, const GpuAlphaInfo &i) : pipelines(std::move(all)), info(i) {}
    ~State() { pipelines->functions().DestroyDescriptorPool(pipelines->device(), pool, pipelines->allocator()); }
    State(const State &) = delete;
    State &operator=(const State &) = delete;

    std::shared_ptr<const Pipelines> pipelines;
    GpuAlphaInfo info;
    VkDescriptorPool pool = VK_NULL_HANDLE;
    VkDescriptorSet set = VK_NULL_HANDLE;
};

GpuAlpha::GpuAlpha(std::unique_ptr<State> state) : m_state(std::move(state)) {}
GpuAlpha::~GpuAlpha() = default;

struct GpuBaker::State {
    std::shared_ptr<Pipelines> pipelines;
};

GpuBaker::GpuBaker(std::unique_ptr<State> state) : m_state(std::move(state)) {}
GpuBaker::~GpuBaker() = default;

VkResult GpuBaker::create(const Info &info, std::unique_ptr<GpuBaker> &baker)
{
    auto state = std::make_unique<State>();
    state->pipelines = std::make_shared<Pipelines>(info.device, info.allocator);
    const VkResult result = state->pipelines->create(info.getDeviceProcAddr, info.cache);
    if (result == VK_SUCCESS)
        baker.reset(new GpuBaker(std::move(state)));
    return result;
}

VkResult GpuBaker::createAlpha(const GpuAlphaInfo &info, std::unique_ptr<GpuAlpha> &alpha) const
{
    if (!gpubake::valid(info))
        return VK_ERROR_FORMAT_NOT_SUPPORTED;
    const Pipelines &pipelines = *m_state->pipelines;
    const gpubake::Functions &functions = pipelines.functions();
    auto state = std::make_unique<GpuAlpha::State>(m_state->pipelines, info);
    const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE, 1};
    const VkDescriptorPoolCreateInfo pool{VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO, nullptr, 0, 1, 1, &size};
    VkResult result = functions.CreateDescriptorPool(pipelines.device(), &pool, pipelines.allocator(), &state->pool);
    if (result != VK_SUCCESS)
        return result;
    const VkDescriptorSetLayout layout = pipelines.setLayout();
    const VkDescriptorSetAllocateInfo allocate{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO, nullptr, state->pool, 1,
                                               &layout};
    result = functions.AllocateDescriptorSets(pipelines.device(), &allocate, &state->set);
    if (result != VK_SUCCESS)
        return result;
    const VkDescriptorImageInfo image{VK_NULL_HANDLE, info.view, info.layout};
    VkWriteDescriptorSet write{};
    write.sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET;
    write.dstSet = state->set;
    write.descriptorCount = 1;
    write.descriptorType = VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE;
    write.pImageInfo = &image;
    functions.UpdateDescriptorSets(pipelines.device(), 1, &write, 0, nullptr);
    alpha.reset(new GpuAlpha(std::move(state)));
    return VK_SUCCESS;
}

VkDeviceSize GpuBaker::scratchBytes(const GpuAlphaInfo &alpha, std::uint32_t triangles)
{
    VkDeviceSize words = bakeMaskStart(triangles);
    for (std::uint32_t mip = 0; mip < alpha.mipLevels; ++mip) {
        const MipCells cells = cellsOf(alpha, mip);
        for (std::uint32_t step = 0; step < bakeMaskSteps(cells.x, cells.y); ++step)
            words += bakeMaskWords(cells.x, cells.y, step);
    }
    return words * 4;
}

bool GpuBaker::record(VkCommandBuffer commands, const GpuAlpha &alpha, const GpuBakeInput &input,
                      const GpuBakeOptions &options, const Scratch &scratch, const GpuBakeRoom &room,
                      VkDeviceAddress result) const
{
    const GpuAlpha::State &image = *alpha.m_state;
    const auto parameters = gpubake::parametersOf(image.info, input, options, &room, result);
    if (!parameters || scratch.address % 4 != 0 || scratch.offset % 4 != 0)
        return false;
    Recording recording(*m_state->pipelines, commands, scratch, image.set);
    setParameters(recording, *parameters);
    findStates(recording, image.info, input.triangles, options.specialIndices);
    writeData(recording, input.triangles, room);
    return true;
}

bool GpuBaker::recordSizes(VkCommandBuffer commands, const GpuAlpha &alpha, const GpuBakeInput &input,
                           const GpuBakeOptions &options, const Scratch &scratch, VkDeviceAddress result) const
{
    const GpuAlpha::State &image = *alpha.m_state;
    const auto parameters = gpubake::parametersOf(image.info, input, options, nullptr, result);
    if (!parameters || scratch.address % 4 != 0 || scratch.offset % 4 != 0)
        return false;
    Recording recording(*m_state->pipelines, commands, scratch, image.set);
    setParameters(recording, *parameters);
    findStates(recording, image.info, input.triangles, options.specialIndices);
    return true;
}

bool GpuBaker::recordData(VkCommandBuffer commands, const GpuAlpha &alpha, const GpuBakeInput &input,
                          const GpuBakeOptions &options, const Scratch &scratch, const GpuBakeRoom &room,
                          VkDeviceAddress result) const
{
    const GpuAlpha::State &image = *alpha.m_state;
    const auto parameters = gpubake::parametersOf(image.info, input, options, &room, result);
    if (!parameters || scratch.address % 4 != 0 || scratch.offset % 4 != 0)
        return false;
    Recording recording(*m_state->pipelines, commands, scratch, image.set);
    setParameters(recording, *parameters);
    countList(recording, input.triangles, 1);
    writeData(recording, input.triangles, room);
    return true;
}

std::uint64_t GpuBaker::dataBytes(const GpuBakeRoom &room, VkOpacityMicromapFormatEXT format)
{
    std::uint64_t bytes = 0;
    for (std::uint32_t level = 0; level < kBakeLevels; ++level)
        bytes += std::uint64_t{room.triangles[level]} * 4 *
                 bakeDataWords(level, format == VK_OPACITY_MICROMAP_FORMAT_2_STATE_EXT);
    return bytes;
}

std::uint64_t GpuBaker::recordBytes(const GpuBakeRoom &room)
{
    return std::accumulate(room.triangles.begin(), room.triangles.end(), std::uint64_t{0}) *
           sizeof(VkMicromapTriangleEXT);
}

std::vector<VkMicromapUsageEXT> GpuBaker::usage(const GpuBakeRoom &room, VkOpacityMicromapFormatEXT format)
{
    std::vector<VkMicromapUsageEXT> usage;
    for (std::uint32_t level = 0; level < kBakeLevels; ++level)
        if (room.triangles[level] != 0)
            usage.push_back({room.triangles[level], level, static_cast<std::uint32_t>(format)});
    return usage;
}

} // namespace vellum
