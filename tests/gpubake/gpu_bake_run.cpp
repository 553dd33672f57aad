// SPDX-License-Identifier: Apache-2.0
#include "gpu_bake_run.h"

#include <algorithm>
#include <cmath>

namespace vt
{
namespace
{

VkSamplerAddressMode addressMode(vellum::Wrap wrap)
{
    switch (wrap) {
    case vellum::Wrap::Repeat: return VK_SAMPLER_ADDRESS_MODE_REPEAT;
    case vellum::Wrap::Mirror: return VK_SAMPLER_ADDRESS_MODE_MIRRORED_REPEAT;
    case vellum::Wrap::Border: return VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_BORDER;
    case vellum::Wrap::MirrorOnce: return VK_SAMPLER_ADDRESS_MODE_MIRROR_CLAMP_TO_EDGE;
    case vellum::Wrap::Clamp: break;
    }
    return VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE;
}

} // namespace

AlphaImage::AlphaImage(Gpu &gpu, std::span<const vellum::AlphaTexture> levels, Format format) : gpu_(gpu)
{
    const vellum::AlphaTexture &first = levels.front();
    info_.width = first.width;
    info_.height = first.height;
    info_.mipLevels = static_cast<uint32_t>(levels.size());
    info_.component = format == Format::Float ? 0 : 3;
    info_.wrapU = addressMode(first.wrapU);
    info_.wrapV = addressMode(first.wrapV);
    info_.filter = first.filter == vellum::Filter::Nearest ? VK_FILTER_NEAREST : VK_FILTER_LINEAR;
    info_.border = first.border;

    const auto image =
        vkInit<VkImageCreateInfo>({.imageType = VK_IMAGE_TYPE_2D,
                                   .format = format == Format::Float ? VK_FORMAT_R32_SFLOAT : VK_FORMAT_R8G8B8A8_UNORM,
                                   .extent = {first.width, first.height, 1},
                                   .mipLevels = info_.mipLevels,
                                   .arrayLayers = 1,
                                   .samples = VK_SAMPLE_COUNT_1_BIT,
                                   .tiling = VK_IMAGE_TILING_OPTIMAL,
                                   .usage = VK_IMAGE_USAGE_SAMPLED_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT});
    image_.emplace(gpu, image);
    upload(levels, format, image.format);
}

void AlphaImage::upload(std::span<const vellum::AlphaTexture> levels, Format format, VkFormat texels)
{
    std::vector<uint8_t> bytes;
    std::vector<VkBufferImageCopy> regions;
    for (uint32_t level = 0; level < levels.size(); ++level) {
        VkBufferImageCopy region{};
        region.bufferOffset = bytes.size();
        region.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, level, 0, 1};
        region.imageExtent = {levels[level].width, levels[level].height, 1};
        regions.push_back(region);
        for (size_t texel = 0; texel < size_t{levels[level].width} * levels[level].height; ++texel) {
            const float alpha =
                levels[level].value(levels[level].place(texel % levels[level].width, texel / levels[level].width));
            if (format == Format::Float) {
                const auto *raw = reinterpret_cast<const uint8_t *>(&alpha);
                bytes.insert(bytes.end(), raw, raw + 4);
            } else {
                // The other components are what alpha is not.
                const auto byte = static_cast<uint8_t>(std::lround(alpha * 255.0f));
                const auto other = static_cast<uint8_t>(255 - byte);
                bytes.insert(bytes.end(), {other, other, other, byte});
            }
        }
    }
    const Buffer staging = gpu_.upload(std::span<const uint8_t>(bytes), VK_BUFFER_USAGE_TRANSFER_SRC_BIT);
    gpu_.submit([&](VkCommandBuffer commands) {
        auto barrier = vkInit<VkImageMemoryBarrier>(
            {.dstAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT, .newLayout = VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL});
        barrier.srcQueueFamilyIndex = barrier.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
        barrier.image = image_->handle();
        barrier.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, VK_REMAINING_MIP_LEVELS, 0, 1};
        vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_TOP_OF_PIPE_BIT, VK_PIPELINE_STAGE_TRANSFER_BIT, 0, 0, nullptr,
                             0, nullptr, 1, &barrier);
        vkCmdCopyBufferToImage(commands, staging.handle(), image_->handle(), VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL,
                               static_cast<uint32_t>(regions.size()), regions.data());
        barrier.srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
        barrier.dstAccessMask = VK_ACCESS_SHADER_READ_BIT;
        barrier.oldLayout = VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL;
        barrier.newLayout = VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL;
        vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, 0, 0,
                             nullptr, 0, nullptr, 1, &barrier);
    });
    auto view = vkInit<VkImageViewCreateInfo>(
        {.image = image_->handle(),
         .viewType = VK_IMAGE_VIEW_TYPE_2D,
         .format = texels,
         .subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, VK_REMAINING_MIP_LEVELS, 0, 1}});
    VT_CHECK(vkCreateImageView(gpu_.device(), &view, nullptr, &info_.view));
}

AlphaImage::~AlphaImage()
{
    vkDestroyImageView(gpu_.device(), info_.view, nullptr);
}

Mesh Mesh::of(std::span<const vellum::TriangleUvs> triangles)
{
    Mesh mesh;
    const auto *raw = reinterpret_cast<const uint8_t *>(triangles.data());
    mesh.uvs.assign(raw, raw + triangles.size_bytes());
    mesh.triangles = static_cast<uint32_t>(triangles.size());
    mesh.vertices = 3 * mesh.triangles;
    return mesh;
}

vellum::State GpuBaked::stateOf(uint32_t triangle, uint32_t microTriangle) const
{
    if (const auto special = vellum::specialState(indices[triangle]))
        return *special;
    const VkMicromapTriangleEXT &record = records.at(static_cast<size_t>(indices[triangle]));
    return vellum::readState(data.data() + record.dataOffset, microTriangle,
                             static_cast<vellum::Format>(record.format));
}

vellum::Micromap GpuBaked::micromap() const
{
    vellum::Micromap micromap;
    micromap.indices = indices;
    micromap.data = data;
    for (const VkMicromapTriangleEXT &record : records)
        micromap.triangles.push_back(
            {record.dataOffset, record.subdivisionLevel, static_cast<vellum::Format>(record.format)});
    return micromap;
}

vellum::GpuBakeOutput outputForAll(const Mesh &mesh, const vellum::GpuBakeOptions &options)
{
    vellum::GpuBakeOutput output;
    for (uint32_t level = options.automatic ? 0 : options.level; level <= options.level; ++level)
        output.triangles[level] = mesh.triangles;
    return output;
}

BakeJob::BakeJob(Gpu &gpu, const vellum::GpuBaker &baker, const AlphaImage &image, const Mesh &mesh,
                 const vellum::GpuBakeOptions &options)
    : baker_(baker), options_(options),
      uvs_(gpu.upload(std::span<const uint8_t>(mesh.uvs), VK_BUFFER_USAGE_STORAGE_BUFFER_BIT)),
      meshIndices_(gpu.upload(std::span<const uint8_t>(mesh.indices), VK_BUFFER_USAGE_STORAGE_BUFFER_BIT)),
      scratch_(gpu, vellum::GpuBaker::scratchBytes(image.info(), mesh.triangles), 4,
               kBakeStorage | VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT),
      result_(gpu, sizeof(vellum::GpuBakeResult), 4, kBakeStorage), gpu_(gpu)
{
    VT_CHECK(baker.createAlpha(image.info(), alpha_));
    input_.uvs = uvs_.address();
    input_.uvStride = mesh.uvStride;
    input_.uvFormat = mesh.uvFormat;
    input_.vertices = mesh.vertices;
    input_.indices = mesh.indexType == VK_INDEX_TYPE_NONE_KHR ? 0 : meshIndices_.address();
    input_.indexType = mesh.indexType;
    input_.triangles = mesh.triangles;
}

BakeJob::~BakeJob()
{
    EXPECT_TRUE(scratch_.intact()) << "scratch memory";
    EXPECT_TRUE(result_.intact()) << "result";
    if (data_.buffer() != VK_NULL_HANDLE) {
        EXPECT_TRUE(data_.intact()) << "data";
        EXPECT_TRUE(records_.intact()) << "records";
        EXPECT_TRUE(indices_.intact()) << "indices";
    }
}

void BakeJob::setOutput(const vellum::GpuBakeOutput &output, VkBufferUsageFlags more)
{
    output_ = output;
    data_ = Guarded(gpu_, vellum::GpuBaker::dataBytes(output, options_.format), 256, kBakeStorage | more);
    records_ = Guarded(gpu_, vellum::GpuBaker::recordBytes(output), 256, kBakeStorage | more);
    indices_ = Guarded(gpu_, 4 * VkDeviceSize{input_.triangles}, 4, kBakeStorage);
    output_.data = data_.address();
    output_.records = records_.address();
    output_.indices = indices_.address();
}

bool BakeJob::record(VkCommandBuffer commands)
{
    return baker_.record(commands, *alpha_, input_, options_,
                         {scratch_.buffer(), scratch_.offset(), scratch_.address()}, output_, result_.address());
}

bool BakeJob::recordSizes(VkCommandBuffer commands)
{
    return baker_.recordSizes(commands, *alpha_, input_, options_,
                              {scratch_.buffer(), scratch_.offset(), scratch_.address()}, result_.address());
}

bool BakeJob::recordData(VkCommandBuffer commands)
{
    return baker_.recordData(commands, *alpha_, input_, options_,
                             {scratch_.buffer(), scratch_.offset(), scratch_.address()}, output_, result_.address());
}

vellum::GpuBakeResult BakeJob::result() const
{
    vellum::GpuBakeResult result{};
    std::memcpy(&result, result_.bytes(), sizeof result);
    return result;
}

GpuBaked BakeJob::read() const
{
    GpuBaked baked;
    baked.result = result();
    baked.data.assign(data_.bytes(), data_.bytes() + data_.size());
    // The address is null without records.
    const auto *records = reinterpret_cast<const VkMicromapTriangleEXT *>(records_.bytes());
    baked.records.assign(records, records + records_.size() / sizeof *records);
    const auto *indices = reinterpret_cast<const int32_t *>(indices_.bytes());
    baked.indices.assign(indices, indices + indices_.size() / sizeof *indices);
    return baked;
}

BakeRunner::BakeRunner(Gpu &gpu) : gpu_(gpu)
{
    VT_CHECK(vellum::GpuBaker::create({gpu.device(), vkGetDeviceProcAddr}, baker_));
}

GpuBaked BakeRunner::bake(const AlphaImage &image, const Mesh &mesh, const vellum::GpuBakeOptions &options, Steps steps,
                          const vellum::GpuBakeOutput *output)
{
    BakeJob job(gpu_, *baker_, image, mesh, options);
    bool recorded = true;
    const auto submit = [&](const std::function<bool(VkCommandBuffer)> &record) {
        gpu_.submit([&](VkCommandBuffer commands) {
            recorded = record(commands) && recorded;
            barrier(commands);
        });
    };
    if (steps == Steps::One) {
        job.setOutput(output != nullptr ? *output : outputForAll(mesh, options));
        submit([&](VkCommandBuffer commands) { return job.record(commands); });
    } else {
        submit([&](VkCommandBuffer commands) { return job.recordSizes(commands); });
        vellum::GpuBakeOutput needed;
        needed.triangles = job.result().triangles;
        job.setOutput(output != nullptr ? *output : needed);
        submit([&](VkCommandBuffer commands) { return job.recordData(commands); });
    }
    EXPECT_TRUE(recorded);
    return job.read();
}

GpuBaked BakeRunner::bake(const vellum::AlphaTexture &texture, std::span<const vellum::TriangleUvs> triangles,
                          const vellum::GpuBakeOptions &options, Steps steps)
{
    const AlphaImage image(gpu_, std::span(&texture, 1), AlphaImage::Format::Float);
    return bake(image, Mesh::of(triangles), options, steps);
}

vellum::GpuBakeOptions onGpu(const vellum::BakeOptions &options)
{
    vellum::GpuBakeOptions gpu;
    gpu.format = options.format == vellum::Format::TwoState ? VK_OPACITY_MICROMAP_FORMAT_2_STATE_EXT
                                                            : VK_OPACITY_MICROMAP_FORMAT_4_STATE_EXT;
    gpu.twoStateRule = static_cast<vellum::GpuTwoStateRule>(options.twoStateRule);
    gpu.automatic = !options.level;
    gpu.level = options.level.value_or(options.maxLevel);
    gpu.texelsPerEdge = static_cast<float>(options.texelsPerEdge);
    gpu.specialIndices = !options.disallowMixedSpecialIndices;
    gpu.cutoff = options.cutoff;
    constexpr VkCompareOp kTests[] = {VK_COMPARE_OP_GREATER_OR_EQUAL, VK_COMPARE_OP_GREATER,
                                      VK_COMPARE_OP_LESS_OR_EQUAL, VK_COMPARE_OP_LESS};
    gpu.test = kTests[static_cast<size_t>(options.test)];
    gpu.valueTolerance = options.valueTolerance;
    gpu.subtexelTolerance = options.subtexelTolerance;
    gpu.barycentricTolerance = options.barycentricTolerance;
    gpu.interpolationTolerance = options.interpolationTolerance;
    return gpu;
}

} // namespace vt
