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
    info_.mipLevels = static_cast<std::uint32_t>(levels.size());
    info_.component = format == Format::Float ? 0 : 3;
    info_.wrapU = addressMode(first.wrapU);
    info_.wrapV = addressMode(first.wrapV);
    info_.filter = first.filter == vellum::Filter::Nearest ? VK_FILTER_NEAREST : VK_FILTER_LINEAR;
    info_.border = first.border;

    VkImageCreateInfo image{};
    image.sType = VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO;
    image.imageType = VK_IMAGE_TYPE_2D;
    image.format = format == Format::Float ? VK_FORMAT_R32_SFLOAT : VK_FORMAT_R8G8B8A8_UNORM;
    image.extent = {first.width, first.height, 1};
    image.mipLevels = info_.mipLevels;
    image.arrayLayers = 1;
    image.samples = VK_SAMPLE_COUNT_1_BIT;
    image.tiling = VK_IMAGE_TILING_OPTIMAL;
    image.usage = VK_IMAGE_USAGE_SAMPLED_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT;
    VT_CHECK(vkCreateImage(gpu.device(), &image, nullptr, &image_));
    VkMemoryRequirements needs;
    vkGetImageMemoryRequirements(gpu.device(), image_, &needs);
    const VkMemoryAllocateInfo allocation{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO, nullptr, needs.size,
                                          gpu.memoryType(needs.memoryTypeBits, 0)};
    VT_CHECK(vkAllocateMemory(gpu.device(), &allocation, nullptr, &memory_));
    VT_CHECK(vkBindImageMemory(gpu.device(), image_, memory_, 0));
    upload(levels, format, image.format);
}

void AlphaImage::upload(std::span<const vellum::AlphaTexture> levels, Format format, VkFormat texels)
{
    std::vector<std::uint8_t> bytes;
    std::vector<VkBufferImageCopy> regions;
    for (std::uint32_t level = 0; level < levels.size(); ++level) {
        VkBufferImageCopy region{};
        region.bufferOffset = bytes.size();
        region.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, level, 0, 1};
        region.imageExtent = {levels[level].width, levels[level].height, 1};
        regions.push_back(region);
        for (const float alpha : levels[level].alpha) {
            if (format == Format::Float) {
                const auto *raw = reinterpret_cast<const std::uint8_t *>(&alpha);
                bytes.insert(bytes.end(), raw, raw + 4);
            } else {
                // The other components are what alpha is not.
                const auto byte = static_cast<std::uint8_t>(std::lround(alpha * 255.0f));
                const auto other = static_cast<std::uint8_t>(255 - byte);
                bytes.insert(bytes.end(), {other, other, other, byte});
            }
        }
    }
    const Buffer staging = gpu_.upload(std::span<const std::uint8_t>(bytes), VK_BUFFER_USAGE_TRANSFER_SRC_BIT);
    gpu_.submit([&](VkCommandBuffer commands) {
        VkImageMemoryBarrier barrier{};
        barrier.sType = VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER;
        barrier.dstAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
        barrier.newLayout = VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL;
        barrier.srcQueueFamilyIndex = barrier.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
        barrier.image = image_;
        barrier.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, VK_REMAINING_MIP_LEVELS, 0, 1};
        vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_TOP_OF_PIPE_BIT, VK_PIPELINE_STAGE_TRANSFER_BIT, 0, 0, nullptr,
                             0, nullptr, 1, &barrier);
        vkCmdCopyBufferToImage(commands, staging.handle(), image_, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL,
                               static_cast<std::uint32_t>(regions.size()), regions.data());
        barrier.srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
        barrier.dstAccessMask = VK_ACCESS_SHADER_READ_BIT;
        barrier.oldLayout = VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL;
        barrier.newLayout = VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL;
        vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, 0, 0,
                             nullptr, 0, nullptr, 1, &barrier);
    });
    VkImageViewCreateInfo view{};
    view.sType = VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO;
    view.image = image_;
    view.viewType = VK_IMAGE_VIEW_TYPE_2D;
    view.format = texels;
    view.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, VK_REMAINING_MIP_LEVELS, 0, 1};
    VT_CHECK(vkCreateImageView(gpu_.device(), &view, nullptr, &info_.view));
}

AlphaImage::~AlphaImage()
{
    vkDestroyImageView(gpu_.device(), info_.view, nullptr);
    vkDestroyImage(gpu_.device(), image_, nullptr);
    vkFreeMemory(gpu_.device(), memory_, nullptr);
}

Mesh Mesh::of(std::span<const vellum::TriangleUvs> triangles)
{
    Mesh mesh;
    const auto *raw = reinterpret_cast<const std::uint8_t *>(triangles.data());
    mesh.uvs.assign(raw, raw + triangles.size_bytes());
    mesh.triangles = static_cast<std::uint32_t>(triangles.size());
    mesh.vertices = 3 * mesh.triangles;
    return mesh;
}

vellum::State GpuBaked::stateOf(std::uint32_t triangle, std::uint32_t microTriangle) const
{
    if (const auto special = vellum::specialState(indices[triangle]))
        return *special;
    const VkMicromapTriangleEXT &record = records.at(static_cast<std::size_t>(indices[triangle]));
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

BakeRunner::BakeRunner(Gpu &gpu) : gpu_(gpu)
{
    VT_CHECK(vellum::GpuBaker::create({gpu.device(), vkGetDeviceProcAddr}, baker_));
}

GpuBaked BakeRunner::bake(const AlphaImage &image, const Mesh &mesh, const vellum::GpuBakeOptions &options, Steps steps,
                          const vellum::GpuBakeRoom *given)
{
    using vellum::GpuBaker;
    std::unique_ptr<vellum::GpuAlpha> alpha;
    VT_CHECK(baker_->createAlpha(image.info(), alpha));
    const Buffer uvs = gpu_.upload(std::span<const std::uint8_t>(mesh.uvs), VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    const Buffer meshIndices =
        gpu_.upload(std::span<const std::uint8_t>(mesh.indices), VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    vellum::GpuBakeInput input;
    input.uvs = uvs.address();
    input.uvStride = mesh.uvStride;
    input.uvFormat = mesh.uvFormat;
    input.vertices = mesh.vertices;
    input.indices = mesh.indexType == VK_INDEX_TYPE_NONE_KHR ? 0 : meshIndices.address();
    input.indexType = mesh.indexType;
    input.triangles = mesh.triangles;

    const Guarded memory(gpu_, GpuBaker::scratchBytes(image.info(), mesh.triangles), 4,
                         kBakeStorage | VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT);
    const GpuBaker::Scratch scratch{memory.buffer(), memory.offset(), memory.address()};
    const Guarded result(gpu_, sizeof(vellum::GpuBakeResult), 4, kBakeStorage);
    const auto read = [&] {
        vellum::GpuBakeResult r;
        std::memcpy(&r, result.bytes(), sizeof r);
        return r;
    };
    bool recorded = true;
    const auto submit = [&](const std::function<bool(VkCommandBuffer)> &record) {
        gpu_.submit([&](VkCommandBuffer commands) {
            recorded = recorded && record(commands);
            barrier(commands);
        });
    };
    vellum::GpuBakeRoom room;
    if (given != nullptr)
        room = *given;
    else if (steps == Steps::One)
        for (std::uint32_t level = options.automatic ? 0 : options.level; level <= options.level; ++level)
            room.triangles[level] = mesh.triangles;
    if (steps == Steps::Two) {
        submit([&](VkCommandBuffer commands) {
            return baker_->recordSizes(commands, *alpha, input, options, scratch, result.address());
        });
        if (given == nullptr)
            room.triangles = read().triangles;
    }
    const Guarded data(gpu_, GpuBaker::dataBytes(room, options.format), 256, kBakeStorage);
    const Guarded records(gpu_, GpuBaker::recordBytes(room), 256, kBakeStorage);
    const Guarded indices(gpu_, 4 * VkDeviceSize{mesh.triangles}, 4, kBakeStorage);
    room.data = data.address();
    room.records = records.address();
    room.indices = indices.address();
    submit([&](VkCommandBuffer commands) {
        return steps == Steps::One
                   ? baker_->record(commands, *alpha, input, options, scratch, room, result.address())
                   : baker_->recordData(commands, *alpha, input, options, scratch, room, result.address());
    });
    EXPECT_TRUE(recorded);
    EXPECT_TRUE(memory.intact()) << "scratch memory";
    EXPECT_TRUE(result.intact() && data.intact() && records.intact() && indices.intact()) << "output";

    GpuBaked baked;
    baked.result = read();
    baked.data.assign(data.bytes(), data.bytes() + data.size());
    baked.records.resize(static_cast<std::size_t>(records.size() / sizeof(VkMicromapTriangleEXT)));
    std::memcpy(baked.records.data(), records.bytes(), static_cast<std::size_t>(records.size()));
    baked.indices.resize(mesh.triangles);
    std::memcpy(baked.indices.data(), indices.bytes(), static_cast<std::size_t>(indices.size()));
    return baked;
}

GpuBaked BakeRunner::bake(const vellum::AlphaTexture &texture, std::span<const vellum::TriangleUvs> triangles,
                          const vellum::GpuBakeOptions &options)
{
    const AlphaImage image(gpu_, std::span(&texture, 1), AlphaImage::Format::Float);
    return bake(image, Mesh::of(triangles), options);
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
    gpu.test = kTests[static_cast<std::size_t>(options.test)];
    gpu.valueTolerance = options.valueTolerance;
    gpu.subtexelTolerance = options.subtexelTolerance;
    gpu.barycentricTolerance = options.barycentricTolerance;
    gpu.interpolationTolerance = options.interpolationTolerance;
    return gpu;
}

} // namespace vt
