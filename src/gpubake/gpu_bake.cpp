// SPDX-License-Identifier: Apache-2.0
#include "vellum/gpu_bake.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <optional>
#include <span>
#include <utility>
#include <vulkan/vulkan.h>

#include "core/gpu_bake.h"
#include "core/micromap.h"
#include "core/portable_math.h"
#include "shaders/bake_begin.h"
#include "shaders/bake_blocks.h"
#include "shaders/bake_cells.h"
#include "shaders/bake_count.h"
#include "shaders/bake_measure.h"
#include "shaders/bake_params.h"
#include "shaders/bake_place.h"
#include "shaders/bake_plan.h"
#include "shaders/bake_probe.h"
#include "shaders/bake_records.h"
#include "shaders/bake_scan.h"
#include "shaders/bake_write.h"

namespace vellum
{
namespace
{

using namespace vellum::shared;

// The Vulkan functions that the GPU baker calls, from the application's vkGetDeviceProcAddr.
#define VELLUM_GPU_BAKE_FUNCTIONS(X)                                                                                   \
    X(AllocateDescriptorSets)                                                                                          \
    X(CmdBindDescriptorSets)                                                                                           \
    X(CmdBindPipeline)                                                                                                 \
    X(CmdDispatch)                                                                                                     \
    X(CmdDispatchIndirect)                                                                                             \
    X(CmdPipelineBarrier)                                                                                              \
    X(CmdPushConstants)                                                                                                \
    X(CreateComputePipelines)                                                                                          \
    X(CreateDescriptorPool)                                                                                            \
    X(CreateDescriptorSetLayout)                                                                                       \
    X(CreatePipelineLayout)                                                                                            \
    X(CreateShaderModule)                                                                                              \
    X(DestroyDescriptorPool)                                                                                           \
    X(DestroyDescriptorSetLayout)                                                                                      \
    X(DestroyPipeline)                                                                                                 \
    X(DestroyPipelineLayout)                                                                                           \
    X(DestroyShaderModule)                                                                                             \
    X(UpdateDescriptorSets)

struct Functions {
    // False where one is missing.
    bool load(VkDevice device, PFN_vkGetDeviceProcAddr getDeviceProcAddr);

#define VELLUM_GPU_BAKE_MEMBER(name) PFN_vk##name name = nullptr;
    VELLUM_GPU_BAKE_FUNCTIONS(VELLUM_GPU_BAKE_MEMBER)
#undef VELLUM_GPU_BAKE_MEMBER
};

// In the order in which they run.
enum class Shader : uint8_t {
    Params,
    Begin,
    Cells,
    Blocks,
    Plan,
    Count,
    Scan,
    Place,
    Probe,
    Measure,
    Write,
    Records,
};
inline constexpr size_t kShaders = 12;

// Push constants are at most what every device has.
inline constexpr uint32_t kPushBytes = 128;

// The compute pipelines, all with one layout: an image in set 0, and push constants.
class Pipelines
{
public:
    Pipelines(VkDevice device, const VkAllocationCallbacks *allocator) : device_(device), allocator_(allocator) {}
    ~Pipelines();
    Pipelines(const Pipelines &) = delete;
    Pipelines &operator=(const Pipelines &) = delete;

    VkResult create(PFN_vkGetDeviceProcAddr getDeviceProcAddr, VkPipelineCache cache);

    [[nodiscard]] VkDevice device() const { return device_; }
    [[nodiscard]] const VkAllocationCallbacks *allocator() const { return allocator_; }
    [[nodiscard]] const Functions &functions() const { return functions_; }
    [[nodiscard]] VkDescriptorSetLayout setLayout() const { return setLayout_; }
    [[nodiscard]] VkPipelineLayout layout() const { return layout_; }
    [[nodiscard]] VkPipeline operator[](Shader shader) const { return pipelines_[static_cast<size_t>(shader)]; }

private:
    VkResult createLayouts();

    VkDevice device_;
    const VkAllocationCallbacks *allocator_;
    bool loaded_ = false;
    Functions functions_;
    VkDescriptorSetLayout setLayout_ = VK_NULL_HANDLE;
    VkPipelineLayout layout_ = VK_NULL_HANDLE;
    std::array<VkPipeline, kShaders> pipelines_{};
};

bool Functions::load(VkDevice device, PFN_vkGetDeviceProcAddr getDeviceProcAddr)
{
    if (getDeviceProcAddr == nullptr)
        return false;
#define VELLUM_GPU_BAKE_LOAD(name)                                                                                     \
    name = reinterpret_cast<PFN_vk##name>(getDeviceProcAddr(device, "vk" #name));                                      \
    if (name == nullptr)                                                                                               \
        return false;
    VELLUM_GPU_BAKE_FUNCTIONS(VELLUM_GPU_BAKE_LOAD)
#undef VELLUM_GPU_BAKE_LOAD
    return true;
}

using Code = std::span<const uint32_t>;

// Indexed by Shader.
constexpr std::array<Code, kShaders> kCode = {
    Code(bake_params), Code(bake_begin), Code(bake_cells), Code(bake_blocks),  Code(bake_plan),  Code(bake_count),
    Code(bake_scan),   Code(bake_place), Code(bake_probe), Code(bake_measure), Code(bake_write), Code(bake_records)};

Pipelines::~Pipelines()
{
    if (!loaded_)
        return;
    for (VkPipeline pipeline : pipelines_)
        functions_.DestroyPipeline(device_, pipeline, allocator_);
    functions_.DestroyPipelineLayout(device_, layout_, allocator_);
    functions_.DestroyDescriptorSetLayout(device_, setLayout_, allocator_);
}

VkResult Pipelines::createLayouts()
{
    const VkDescriptorSetLayoutBinding image{0, VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE, 1, VK_SHADER_STAGE_COMPUTE_BIT,
                                             nullptr};
    const VkDescriptorSetLayoutCreateInfo set{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO, nullptr, 0, 1,
                                              &image};
    const VkResult result = functions_.CreateDescriptorSetLayout(device_, &set, allocator_, &setLayout_);
    if (result != VK_SUCCESS)
        return result;
    const VkPushConstantRange push{VK_SHADER_STAGE_COMPUTE_BIT, 0, kPushBytes};
    VkPipelineLayoutCreateInfo layout{};
    layout.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO;
    layout.setLayoutCount = 1;
    layout.pSetLayouts = &setLayout_;
    layout.pushConstantRangeCount = 1;
    layout.pPushConstantRanges = &push;
    return functions_.CreatePipelineLayout(device_, &layout, allocator_, &layout_);
}

VkResult Pipelines::create(PFN_vkGetDeviceProcAddr getDeviceProcAddr, VkPipelineCache cache)
{
    loaded_ = functions_.load(device_, getDeviceProcAddr);
    if (!loaded_)
        return VK_ERROR_INITIALIZATION_FAILED;
    VkResult result = createLayouts();
    for (size_t i = 0; i < kShaders && result == VK_SUCCESS; ++i) {
        const VkShaderModuleCreateInfo code{VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO, nullptr, 0,
                                            kCode[i].size_bytes(), kCode[i].data()};
        VkShaderModule module = VK_NULL_HANDLE;
        result = functions_.CreateShaderModule(device_, &code, allocator_, &module);
        if (result != VK_SUCCESS)
            break;
        VkComputePipelineCreateInfo info{};
        info.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
        info.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
        info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
        info.stage.module = module;
        info.stage.pName = "main";
        info.layout = layout_;
        result = functions_.CreateComputePipelines(device_, cache, 1, &info, allocator_, &pipelines_[i]);
        functions_.DestroyShaderModule(device_, module, allocator_);
    }
    return result;
}

using Parameters = std::array<uint32_t, shared::kBakeSetWords>;

constexpr uint32_t kMostTexels = 65536;
constexpr uint32_t kMostTriangles = 1u << 24;

bool usableTolerance(double tolerance)
{
    return tolerance >= 0 && std::isfinite(floatAtLeast(tolerance));
}

uint32_t bitsOf(float value)
{
    return std::bit_cast<uint32_t>(value);
}

void setAddress(Parameters &words, uint32_t at, VkDeviceAddress address)
{
    words[at] = static_cast<uint32_t>(address);
    words[at + 1] = static_cast<uint32_t>(address >> 32);
}

// The size of a UV component, and the number of the format; nothing for one that cannot be read.
struct UvFormat {
    uint32_t number;
    uint32_t componentBytes;
};
std::optional<UvFormat> uvFormatOf(VkFormat format)
{
    switch (format) {
    case VK_FORMAT_R32G32_SFLOAT: return UvFormat{kBakeUvFloat, 4};
    case VK_FORMAT_R16G16_SFLOAT: return UvFormat{kBakeUvHalf, 2};
    case VK_FORMAT_R16G16_UNORM: return UvFormat{kBakeUvUnorm16, 2};
    default: return std::nullopt;
    }
}

// Bytes of an index, 0 without indices.
std::optional<uint32_t> indexBytesOf(VkIndexType type)
{
    switch (type) {
    case VK_INDEX_TYPE_NONE_KHR: return 0;
    case VK_INDEX_TYPE_UINT8_EXT: return 1;
    case VK_INDEX_TYPE_UINT16: return 2;
    case VK_INDEX_TYPE_UINT32: return 4;
    default: return std::nullopt;
    }
}

bool setInput(Parameters &words, const GpuBakeInput &input)
{
    const std::optional<UvFormat> format = uvFormatOf(input.uvFormat);
    const std::optional<uint32_t> indexBytes = indexBytesOf(input.indexType);
    if (!format || !indexBytes || input.triangles > kMostTriangles)
        return false;
    if (input.uvs % format->componentBytes != 0 || input.uvStride % format->componentBytes != 0)
        return false;
    if (*indexBytes != 0 && input.indices % *indexBytes != 0)
        return false;
    words[kBakeTriangles] = input.triangles;
    words[kBakeVertices] = input.vertices;
    setAddress(words, kBakeUvs, input.uvs);
    words[kBakeUvStride] = input.uvStride;
    words[kBakeUvFormat] = format->number;
    setAddress(words, kBakeIndices, input.indices);
    words[kBakeIndexBytes] = *indexBytes;
    return true;
}

bool setOptions(Parameters &words, const GpuBakeOptions &options)
{
    const bool twoState = options.format == VK_OPACITY_MICROMAP_FORMAT_2_STATE_EXT;
    if (!twoState && options.format != VK_OPACITY_MICROMAP_FORMAT_4_STATE_EXT)
        return false;
    if (options.level >= kBakeLevels || std::isnan(options.cutoff) || !(options.texelsPerEdge >= 0))
        return false;
    for (const double tolerance : {options.valueTolerance, options.subtexelTolerance, options.barycentricTolerance,
                                   options.interpolationTolerance})
        if (!usableTolerance(tolerance))
            return false;
    uint32_t flags = (options.automatic ? kBakeAutomatic : 0u) | (twoState ? kBakeTwoState : 0u) |
                     (options.specialIndices ? 0u : kBakeNoSpecial);
    if (options.twoStateRule != GpuTwoStateRule::Nearest)
        flags |=
            options.twoStateRule == GpuTwoStateRule::UnknownIsOpaque ? kBakeUnknownIsOpaque : kBakeUnknownIsTransparent;
    // alpha < cutoff is the contrary of alpha >= cutoff, and alpha <= cutoff is -alpha >= -cutoff.
    double cutoff = options.cutoff;
    switch (options.test) {
    case VK_COMPARE_OP_GREATER_OR_EQUAL: break;
    case VK_COMPARE_OP_LESS: flags |= kBakeSwap; break;
    case VK_COMPARE_OP_LESS_OR_EQUAL: flags |= kBakeNegate; break;
    case VK_COMPARE_OP_GREATER: flags |= kBakeNegate | kBakeSwap; break;
    default: return false;
    }
    if ((flags & kBakeNegate) != 0)
        cutoff = -cutoff;
    words[kBakeFlags] |= flags;
    words[kBakeLevel] = options.level;
    words[kBakeTexelsPerEdge] = bitsOf(kLevelSlack * options.texelsPerEdge * options.texelsPerEdge);
    words[kBakeSubtexel] = bitsOf(floatAtLeast(options.subtexelTolerance));
    words[kBakeInterpolation] = bitsOf(floatAtLeast(options.interpolationTolerance));
    words[kBakeBarycentric] = bitsOf(floatAtLeast(options.barycentricTolerance));
    words[kBakeOpaqueFrom] = bitsOf(floatAtLeast(cutoff + options.valueTolerance));
    words[kBakeTransparentBelow] = bitsOf(floatAtLeast(cutoff - options.valueTolerance));
    words[kBakeCutoff] = bitsOf(floatAtLeast(cutoff));
    return true;
}

bool setOutput(Parameters &words, const GpuBakeOutput &output, VkOpacityMicromapFormatEXT format)
{
    if (GpuBaker::dataBytes(output, format) > 0xffffffffu || output.data % 4 != 0 || output.records % 4 != 0 ||
        output.indices % 4 != 0)
        return false;
    setAddress(words, kBakeData, output.data);
    setAddress(words, kBakeRecords, output.records);
    setAddress(words, kBakeSpecialIndices, output.indices);
    for (uint32_t level = 0; level < kBakeLevels; ++level)
        words[kBakeCapacity + level] = output.triangles[level];
    return true;
}

// The wrap number of an address mode; nothing for one that does not exist.
std::optional<uint32_t> wrapOf(VkSamplerAddressMode mode)
{
    switch (mode) {
    case VK_SAMPLER_ADDRESS_MODE_REPEAT: return kBakeRepeat;
    case VK_SAMPLER_ADDRESS_MODE_MIRRORED_REPEAT: return kBakeMirror;
    case VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE: return kBakeClamp;
    case VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_BORDER: return kBakeBorderMode;
    case VK_SAMPLER_ADDRESS_MODE_MIRROR_CLAMP_TO_EDGE: return kBakeMirrorOnce;
    default: return std::nullopt;
    }
}

// Returns whether the description of an image is in range.
bool valid(const GpuAlphaInfo &alpha)
{
    const auto inRange = [](uint32_t value, uint32_t most) { return value >= 1 && value <= most; };
    return alpha.view != VK_NULL_HANDLE && inRange(alpha.width, kMostTexels) && inRange(alpha.height, kMostTexels) &&
           inRange(alpha.mipLevels, kBakeMostMips) && alpha.component < 4 && wrapOf(alpha.wrapU) &&
           wrapOf(alpha.wrapV) && (alpha.filter == VK_FILTER_NEAREST || alpha.filter == VK_FILTER_LINEAR);
}

// Converts what the application passes to the words that the shaders read (core/gpu_bake.h). Returns nothing if an
// argument is out of range, or the data would be 2^32 bytes or more. `output` is null for recordSizes().
std::optional<Parameters> parametersOf(const GpuAlphaInfo &alpha, const GpuBakeInput &input,
                                       const GpuBakeOptions &options, const GpuBakeOutput *output,
                                       VkDeviceAddress result)
{
    Parameters words{};
    words[kBakeMips] = alpha.mipLevels;
    words[kBakeBorder] = bitsOf(alpha.border);
    words[kBakeWidth] = alpha.width;
    words[kBakeHeight] = alpha.height;
    words[kBakeFlags] = (alpha.filter == VK_FILTER_NEAREST ? kBakeNearest : 0u) |
                        (output == nullptr ? kBakeSizesOnly : 0u) | alpha.component << kBakeComponentShift |
                        *wrapOf(alpha.wrapU) << kBakeWrapUShift | *wrapOf(alpha.wrapV) << kBakeWrapVShift;
    if (result % 4 != 0 || !setInput(words, input) || !setOptions(words, options))
        return std::nullopt;
    if (output != nullptr && !setOutput(words, *output, options.format))
        return std::nullopt;
    setAddress(words, kBakeResult, result);
    return words;
}

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
        return bakeCells(bakeMipSize(size, mip), wrapOf(mode).value_or(kBakeClamp), bilinear);
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
        static_assert(sizeof push == kPushBytes);
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
    const Functions &functions_;
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
    if (!valid(info))
        return VK_ERROR_FORMAT_NOT_SUPPORTED;
    const Pipelines &pipelines = *state_->pipelines;
    const Functions &functions = pipelines.functions();
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
    const auto parameters = parametersOf(image.info, input, options, &output, result);
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
    const auto parameters = parametersOf(image.info, input, options, nullptr, result);
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
    const auto parameters = parametersOf(image.info, input, options, &output, result);
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
