// SPDX-License-Identifier: Apache-2.0
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

// The layout that bake_begin.comp uses.
struct MipCells {
    uint32_t x;
    uint32_t y;
};
MipCells cellsOf(const GpuAlphaInfo &alpha, uint32_t mip)
{
    const bool bilinear = alpha.filter == VK_FILTER_LINEAR;
    const auto along = [&](uint32_t size, VkSamplerAddressMode mode) {
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
        : pipelines_(pipelines), functions_(pipelines.functions()), commands_(commands), scratch_(scratch)
    {
        functions_.CmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipelines.layout(), 0, 1, &set, 0,
                                         nullptr);
        barrier(); // against what a bake before this one does with the same scratch memory
    }

    void setWords(uint32_t first, const uint32_t *words, uint32_t count)
    {
        bind(Shader::Params);
        struct {
            VkDeviceAddress scratch;
            uint32_t first, count;
            std::array<uint32_t, kBakePushedWords> words;
        } push{};
        static_assert(sizeof push == gpubake::kPushBytes);
        for (uint32_t done = 0; done < count; done += push.count) {
            push.scratch = scratch_.address;
            push.first = first + done;
            push.count = std::min(count - done, kBakePushedWords);
            std::copy_n(words + done, push.count, push.words.begin());
            functions_.CmdPushConstants(commands_, pipelines_.layout(), VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof push,
                                        &push);
            functions_.CmdDispatch(commands_, 1, 1, 1);
        }
    }

    void run(Shader shader, uint64_t invocations, uint32_t each, uint32_t first = 0, uint32_t second = 0)
    {
        const uint64_t groups = (invocations + each - 1) / each;
        if (groups == 0)
            return;
        begin(shader, first, second);
        functions_.CmdDispatch(commands_, static_cast<uint32_t>(std::min<uint64_t>(groups, kBakeMostGroups)),
                               static_cast<uint32_t>((groups + kBakeMostGroups - 1) / kBakeMostGroups), 1);
        barrier();
    }

    void runIndirect(Shader shader, uint32_t groupsAt)
    {
        begin(shader, 0, 0);
        functions_.CmdDispatchIndirect(commands_, scratch_.buffer, scratch_.offset + 4 * VkDeviceSize{groupsAt});
        barrier();
    }

    void barrier()
    {
        const VkMemoryBarrier all{VK_STRUCTURE_TYPE_MEMORY_BARRIER, nullptr, VK_ACCESS_SHADER_WRITE_BIT,
                                  VK_ACCESS_SHADER_READ_BIT | VK_ACCESS_SHADER_WRITE_BIT |
                                      VK_ACCESS_INDIRECT_COMMAND_READ_BIT};
        functions_.CmdPipelineBarrier(commands_,
                                      VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT | VK_PIPELINE_STAGE_DRAW_INDIRECT_BIT,
                                      VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT | VK_PIPELINE_STAGE_DRAW_INDIRECT_BIT, 0, 1,
                                      &all, 0, nullptr, 0, nullptr);
    }

private:
    void bind(Shader shader)
    {
        functions_.CmdBindPipeline(commands_, VK_PIPELINE_BIND_POINT_COMPUTE, pipelines_[shader]);
    }
    void begin(Shader shader, uint32_t first, uint32_t second)
    {
        bind(shader);
        const struct {
            VkDeviceAddress scratch;
            uint32_t first, second;
        } push{scratch_.address, first, second};
        functions_.CmdPushConstants(commands_, pipelines_.layout(), VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof push, &push);
    }

    const Pipelines &pipelines_;
    const gpubake::Functions &functions_;
    VkCommandBuffer commands_;
    GpuBaker::Scratch scratch_;
};

void setParameters(Recording &recording, const Parameters &parameters)
{
    recording.setWords(0, parameters.data(), kBakeSetWords);
    constexpr std::array<uint32_t, 4> kNone{};
    recording.setWords(kBakeSpecials, kNone.data(), 4);
    recording.barrier();
}

void makeMasks(Recording &recording, const GpuAlphaInfo &alpha)
{
    recording.run(Shader::Begin, 1, 1);
    for (uint32_t mip = 0; mip < alpha.mipLevels; ++mip) {
        const MipCells cells = cellsOf(alpha, mip);
        constexpr uint64_t kRows = 4; // same value as in bake_cells.comp
        recording.run(Shader::Cells, bakeMaskPitch(cells.x) * ((cells.y + kRows - 1) / kRows), 64, mip);
        for (uint32_t step = 1; step < bakeMaskSteps(cells.x, cells.y); ++step)
            recording.run(Shader::Blocks, bakeMaskWords(cells.x, cells.y, step) / 2, 64, mip, step);
    }
}

// Lists the triangles that are not known to be one state, or those that get data.
void countList(Recording &recording, uint32_t triangles, uint32_t which)
{
    recording.run(Shader::Count, triangles, kBakeBlock, which);
    recording.run(Shader::Scan, 1, 1, which);
}

// Records the common part of one and two steps: until it is known which triangles get data.
void findStates(Recording &recording, const GpuAlphaInfo &alpha, uint32_t triangles, bool specialIndices)
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

void writeData(Recording &recording, uint32_t triangles, const GpuBakeOutput &output)
{
    recording.run(Shader::Place, triangles, kBakeBlock, 1);
    recording.runIndirect(Shader::Write, kBakeWriteGroups);
    const uint64_t records = GpuBaker::recordBytes(output) / sizeof(VkMicromapTriangleEXT);
    recording.run(Shader::Records, std::max<uint64_t>(records, 4), 64);
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

GpuAlpha::GpuAlpha(std::unique_ptr<State> state) : state_(std::move(state)) {}
GpuAlpha::~GpuAlpha() = default;

struct GpuBaker::State {
    std::shared_ptr<Pipelines> pipelines;
};

GpuBaker::GpuBaker(std::unique_ptr<State> state) : state_(std::move(state)) {}
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
    const Pipelines &pipelines = *state_->pipelines;
    const gpubake::Functions &functions = pipelines.functions();
    auto state = std::make_unique<GpuAlpha::State>(state_->pipelines, info);
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

VkDeviceSize GpuBaker::scratchBytes(const GpuAlphaInfo &alpha, uint32_t triangles)
{
    VkDeviceSize words = bakeMaskStart(triangles);
    for (uint32_t mip = 0; mip < alpha.mipLevels; ++mip) {
        const MipCells cells = cellsOf(alpha, mip);
        for (uint32_t step = 0; step < bakeMaskSteps(cells.x, cells.y); ++step)
            words += bakeMaskWords(cells.x, cells.y, step);
    }
    return words * 4;
}

bool GpuBaker::record(VkCommandBuffer commands, const GpuAlpha &alpha, const GpuBakeInput &input,
                      const GpuBakeOptions &options, const Scratch &scratch, const GpuBakeOutput &output,
                      VkDeviceAddress result) const
{
    const GpuAlpha::State &image = *alpha.state_;
    const auto parameters = gpubake::parametersOf(image.info, input, options, &output, result);
    if (!parameters || scratch.address % 4 != 0 || scratch.offset % 4 != 0)
        return false;
    Recording recording(*state_->pipelines, commands, scratch, image.set);
    setParameters(recording, *parameters);
    findStates(recording, image.info, input.triangles, options.specialIndices);
    writeData(recording, input.triangles, output);
    return true;
}

bool GpuBaker::recordSizes(VkCommandBuffer commands, const GpuAlpha &alpha, const GpuBakeInput &input,
                           const GpuBakeOptions &options, const Scratch &scratch, VkDeviceAddress result) const
{
    const GpuAlpha::State &image = *alpha.state_;
    const auto parameters = gpubake::parametersOf(image.info, input, options, nullptr, result);
    if (!parameters || scratch.address % 4 != 0 || scratch.offset % 4 != 0)
        return false;
    Recording recording(*state_->pipelines, commands, scratch, image.set);
    setParameters(recording, *parameters);
    findStates(recording, image.info, input.triangles, options.specialIndices);
    return true;
}

bool GpuBaker::recordData(VkCommandBuffer commands, const GpuAlpha &alpha, const GpuBakeInput &input,
                          const GpuBakeOptions &options, const Scratch &scratch, const GpuBakeOutput &output,
                          VkDeviceAddress result) const
{
    const GpuAlpha::State &image = *alpha.state_;
    const auto parameters = gpubake::parametersOf(image.info, input, options, &output, result);
    if (!parameters || scratch.address % 4 != 0 || scratch.offset % 4 != 0)
        return false;
    Recording recording(*state_->pipelines, commands, scratch, image.set);
    setParameters(recording, *parameters);
    countList(recording, input.triangles, 1);
    writeData(recording, input.triangles, output);
    return true;
}

uint64_t GpuBaker::dataBytes(const GpuBakeOutput &output, VkOpacityMicromapFormatEXT format)
{
    uint64_t bytes = 0;
    for (uint32_t level = 0; level < kBakeLevels; ++level)
        bytes += uint64_t{output.triangles[level]} * 4 *
                 bakeDataWords(level, format == VK_OPACITY_MICROMAP_FORMAT_2_STATE_EXT);
    return bytes;
}

uint64_t GpuBaker::recordBytes(const GpuBakeOutput &output)
{
    return std::accumulate(output.triangles.begin(), output.triangles.end(), uint64_t{0}) *
           sizeof(VkMicromapTriangleEXT);
}

std::vector<VkMicromapUsageEXT> GpuBaker::usage(const GpuBakeOutput &output, VkOpacityMicromapFormatEXT format)
{
    std::vector<VkMicromapUsageEXT> usage;
    for (uint32_t level = 0; level < kBakeLevels; ++level)
        if (output.triangles[level] != 0)
            usage.push_back({output.triangles[level], level, static_cast<uint32_t>(format)});
    return usage;
}

} // namespace vellum
