// SPDX-License-Identifier: Apache-2.0
// Copies between images and address ranges, and the texel blocks of formats ("Compatible Formats").
#include <algorithm>
#include <array>
#include <optional>
#include <tuple>
#include <vector>

#include "layer/validation/ranges/ranges.h"

namespace vellum::layer::ranges
{
namespace
{

// A block of texels in memory, of one aspect of a format.
struct TexelBlock {
    uint32_t bytes = 0;
    uint32_t width = 1;
    uint32_t height = 1;
};

// Formats from one number to the next row's have blocks of one size.
struct FormatRow {
    int first; // VkFormat
    TexelBlock block;
};

constexpr std::array<FormatRow, 40> kCoreFormats{{
    {1, {1}},           {2, {2}},           {9, {1}},           {16, {2}},
    {23, {3}},          {37, {4}},          {70, {2}},          {77, {4}},
    {84, {6}},          {91, {8}},          {98, {4}},          {101, {8}},
    {104, {12}},        {107, {16}},        {110, {8}},         {113, {16}},
    {116, {24}},        {119, {32}},        {122, {4}},         {124, {0}},
    {131, {8, 4, 4}},   {135, {16, 4, 4}},  {139, {8, 4, 4}},   {141, {16, 4, 4}},
    {147, {8, 4, 4}},   {151, {16, 4, 4}},  {153, {8, 4, 4}},   {155, {16, 4, 4}},
    {157, {16, 4, 4}},  {159, {16, 5, 4}},  {161, {16, 5, 5}},  {163, {16, 6, 5}},
    {165, {16, 6, 6}},  {167, {16, 8, 5}},  {169, {16, 8, 6}},  {171, {16, 8, 8}},
    {173, {16, 10, 5}}, {175, {16, 10, 6}}, {177, {16, 10, 8}}, {179, {16, 10, 10}}, // 181 and 183: 12x10 and 12x12
}};
constexpr int kLastCoreFormat = 184;
constexpr int kFirstYcbcr = 1000156000;

// For formats with several planes, the index among those with components of one size: 3-plane 420, 2-plane 420, 3-plane
// 422, 2-plane 422, 3-plane 444; -1 for other formats.
int planesOf(VkFormat format, bool &wide)
{
    const int number = format - kFirstYcbcr;
    for (const int first : {2, 12, 22, 29}) {
        if (number >= first && number < first + 5) {
            wide = first != 2;
            return number - first;
        }
    }
    return -1;
}

std::optional<TexelBlock> depthStencilBlock(VkFormat format, VkImageAspectFlags aspect)
{
    if (aspect == VK_IMAGE_ASPECT_STENCIL_BIT)
        return TexelBlock{1};
    const bool narrow = format == VK_FORMAT_D16_UNORM || format == VK_FORMAT_D16_UNORM_S8_UINT;
    return aspect == VK_IMAGE_ASPECT_DEPTH_BIT ? std::optional(TexelBlock{narrow ? 2u : 4u}) : std::nullopt;
}

bool isDepthStencil(VkFormat format)
{
    return format >= VK_FORMAT_D16_UNORM && format <= VK_FORMAT_D32_SFLOAT_S8_UINT;
}

bool isMultiPlanar(VkFormat format)
{
    bool wide = false;
    return planesOf(format, wide) >= 0;
}

std::optional<TexelBlock> texelBlockOf(VkFormat format, VkImageAspectFlags aspect)
{
    bool wide = false;
    if (const int planes = planesOf(format, wide); planes >= 0) {
        const bool both = (planes == 1 || planes == 3) && aspect == VK_IMAGE_ASPECT_PLANE_1_BIT;
        return TexelBlock{(wide ? 2u : 1u) * (both ? 2u : 1u)};
    }
    if (isDepthStencil(format))
        return depthStencilBlock(format, aspect);
    if (format < 1 || format > kLastCoreFormat || aspect != VK_IMAGE_ASPECT_COLOR_BIT)
        return std::nullopt;
    if (format >= VK_FORMAT_ASTC_12x10_UNORM_BLOCK)
        return TexelBlock{16, 12, format >= VK_FORMAT_ASTC_12x12_UNORM_BLOCK ? 12u : 10u};
    const auto *next = std::ranges::upper_bound(kCoreFormats, static_cast<int>(format), {}, &FormatRow::first);
    return (next - 1)->block;
}

// The ids of one of the two commands.
struct CopyRules {
    const rules::Range &range;
    const char *flagRule;       // PROTECTED in an unprotected command buffer
    const char *noFlagRule;     // no PROTECTED in a protected one; null: no rule
    const char *imageRule;      // protected image in an unprotected command buffer
    const char *plainImageRule; // unprotected image in a protected one; null: no rule
    const char *queueRule;      // addresses on queues of transfers only
};
constexpr CopyRules kToImage{rules::kToImage,
                             "VUID-vkCmdCopyMemoryToImageKHR-commandBuffer-13102",
                             nullptr,
                             "VUID-vkCmdCopyMemoryToImageKHR-commandBuffer-13103",
                             "VUID-vkCmdCopyMemoryToImageKHR-commandBuffer-13021",
                             "VUID-vkCmdCopyMemoryToImageKHR-commandBuffer-13104"};
constexpr CopyRules kToMemory{rules::kFromImage,
                              "VUID-vkCmdCopyImageToMemoryKHR-commandBuffer-13102",
                              "VUID-vkCmdCopyImageToMemoryKHR-commandBuffer-13025",
                              "VUID-vkCmdCopyImageToMemoryKHR-commandBuffer-13103",
                              nullptr,
                              "VUID-vkCmdCopyImageToMemoryKHR-commandBuffer-13104"};

// The steps that the search for regions that overlap may take in one command. What it does not find then is not
// reported.
constexpr uint64_t kMostSteps = 1u << 18;

uint64_t product(uint64_t a, uint64_t b) // UINT64_MAX: it is larger
{
    return a != 0 && b > UINT64_MAX / a ? UINT64_MAX : a * b;
}

uint64_t sum(uint64_t a, uint64_t b) // the same
{
    return b > UINT64_MAX - a ? UINT64_MAX : a + b;
}

// The rows of texel blocks in memory that a region accesses ("Buffer and Image Addressing").
struct Rows {
    VkDeviceAddress address = 0;
    VkDeviceSize bytes = 0; // of a row
    VkDeviceSize rowPitch = 0, slicePitch = 0;
    uint64_t rows = 0, slices = 0; // rows in a slice
    [[nodiscard]] uint64_t count() const { return rows * slices; }
    // UINT64_MAX: more than memory can have.
    [[nodiscard]] VkDeviceSize size() const
    {
        return bytes == 0 || count() == 0
                   ? 0
                   : sum(sum(product(slices - 1, slicePitch), product(rows - 1, rowPitch)), bytes);
    }
    [[nodiscard]] VkDeviceAddress begin(uint64_t row) const
    {
        return address + row / rows * slicePitch + row % rows * rowPitch;
    }
    // The first row that ends behind `at`. Rows do not overlap.
    [[nodiscard]] uint64_t firstFrom(VkDeviceAddress at) const
    {
        uint64_t low = 0, high = count();
        while (low < high) {
            const uint64_t middle = low + (high - low) / 2;
            if (begin(middle) + bytes <= at)
                low = middle + 1;
            else
                high = middle;
        }
        return low;
    }
};

Rows rowsOf(const VkDeviceMemoryImageCopyKHR &region, const TexelBlock &block, const ValidatedImage &image)
{
    const auto blocks = [](uint64_t texels, uint32_t size) { return (texels + size - 1) / size; };
    const uint64_t length = region.addressRowLength ? region.addressRowLength : region.imageExtent.width;
    const uint64_t height = region.addressImageHeight ? region.addressImageHeight : region.imageExtent.height;
    const VkImageSubresourceLayers &part = region.imageSubresource;
    const uint32_t layers = part.layerCount == VK_REMAINING_ARRAY_LAYERS
                                ? image.arrayLayers - std::min(image.arrayLayers, part.baseArrayLayer)
                                : part.layerCount;
    Rows rows;
    rows.address = region.addressRange.address;
    rows.bytes = blocks(region.imageExtent.width, block.width) * block.bytes;
    rows.rowPitch = blocks(length, block.width) * block.bytes;
    rows.slicePitch = product(blocks(height, block.height), rows.rowPitch);
    rows.rows = blocks(region.imageExtent.height, block.height);
    rows.slices = std::max(layers, region.imageExtent.depth);
    return rows;
}

// Returns whether a row of one overlaps a row of the other; false if the steps do not suffice. Each takes the next row
// that is not before the other's.
bool overlap(const Rows &a, const Rows &b, uint64_t &steps)
{
    for (uint64_t row = a.firstFrom(b.address); row < a.count() && steps != 0; --steps) {
        const uint64_t other = b.firstFrom(a.begin(row));
        if (other == b.count())
            return false;
        if (b.begin(other) < a.begin(row) + a.bytes)
            return true;
        row = a.firstFrom(b.begin(other));
    }
    return false;
}

class ImageCopyCheck
{
public:
    ImageCopyCheck(const RangeCheck &ranges, const CopyRules &rules, const VkCopyDeviceMemoryImageInfoKHR &info)
        : device_(ranges.device()), ranges_(ranges), rules_(rules), info_(info),
          image_(ranges.device().objects.images.get(info.image))
    {
        const DeviceModel &device = ranges.device();
        const auto log = device.logs.get(ranges.commandBuffer());
        const auto &families = device.facts.queueFamilies;
        onTransferQueue_ = log && log->family < families.size() && !device.facts.maintenance11 &&
                           (families[log->family] & (VK_QUEUE_GRAPHICS_BIT | VK_QUEUE_COMPUTE_BIT)) == 0;
    }

    void check() const
    {
        const Place info = ranges_.command().member("pCopyMemoryInfo");
        checkProtectedImage(info);
        for (uint32_t i = 0; i < info_.regionCount; ++i) {
            const Place place = info.element("pRegions", i);
            checkRegion(place, info_.pRegions[i]);
        }
        if (rules_.range.usage == VK_BUFFER_USAGE_TRANSFER_DST_BIT)
            checkOverlap(info);
    }

private:
    void checkProtectedImage(const Place &info) const
    {
        if (!image_ || device_.facts.protectedNoFault)
            return;
        const bool isProtected = (image_->flags & VK_IMAGE_CREATE_PROTECTED_BIT) != 0;
        const char *rule = isProtected ? rules_.imageRule : rules_.plainImageRule;
        if (rule && isProtected != ranges_.isProtected())
            ranges_.fault(info.member("image"), rule,
                          isProtected ? "a protected image, in a command buffer that is not protected"
                                      : "an image that is not protected, in a protected command buffer");
    }

    void checkRegion(const Place &place, const VkDeviceMemoryImageCopyKHR &region) const
    {
        const VkDeviceAddressRangeKHR &range = region.addressRange;
        ranges_.check(place, range, region.addressFlags, flagged::kImageCopy, rules_.range);
        ranges_.checkProtection(place, "addressFlags", region.addressFlags, rules_.flagRule, rules_.noFlagRule);
        const Place member = place.member("addressRange");
        if (onTransferQueue_ && range.address % 4 != 0)
            ranges_.fault(member, rules_.queueRule,
                          textOf(range) + ": on a queue of transfers, the address must be a multiple of 4");
        const auto block = image_ ? texelBlockOf(image_->format, region.imageSubresource.aspectMask) : std::nullopt;
        if (!block)
            return;
        const bool depth = isDepthStencil(image_->format);
        const uint32_t alignment = depth ? 4 : block->bytes;
        if (range.address % alignment != 0)
            ranges_.fault(member,
                          depth                           ? "VUID-VkCopyDeviceMemoryImageInfoKHR-image-13031"
                          : isMultiPlanar(image_->format) ? "VUID-VkCopyDeviceMemoryImageInfoKHR-image-13030"
                                                          : "VUID-VkCopyDeviceMemoryImageInfoKHR-image-13029",
                          textOf(range) + ": for this format, the address must be a multiple of " +
                              std::to_string(alignment));
        const VkDeviceSize size = rowsOf(region, *block, *image_).size();
        if (range.size < size)
            ranges_.fault(member, "VUID-VkDeviceMemoryImageCopyKHR-size-13037",
                          std::to_string(range.size) + " bytes; the region accesses " + std::to_string(size));
    }

    // Rows of different regions that are written.
    void checkOverlap(const Place &info) const
    {
        std::vector<std::pair<Rows, uint32_t>> regions;
        for (uint32_t i = 0; image_ && i < info_.regionCount; ++i) {
            const VkDeviceMemoryImageCopyKHR &region = info_.pRegions[i];
            const auto block = texelBlockOf(image_->format, region.imageSubresource.aspectMask);
            if (!block)
                continue;
            const Rows rows = rowsOf(region, *block, *image_);
            // Other regions violate the rules of ranges.
            if (rows.size() != 0 && rows.size() <= region.addressRange.size &&
                sum(rows.address, rows.size()) != UINT64_MAX)
                regions.emplace_back(rows, i);
        }
        std::ranges::sort(regions, {}, [](const auto &region) { return region.first.address; });
        uint64_t steps = kMostSteps;
        for (size_t a = 0; a < regions.size(); ++a) {
            const VkDeviceAddress end = regions[a].first.address + regions[a].first.size();
            for (size_t b = a + 1; b < regions.size() && regions[b].first.address < end && steps != 0; ++b) {
                if (!overlap(regions[a].first, regions[b].first, steps))
                    continue;
                const Place place = info.element("pRegions", regions[b].second);
                return ranges_.fault(place.member("addressRange"), "VUID-VkCopyDeviceMemoryImageInfoKHR-pRegions-12473",
                                     "the region writes bytes that pRegions[" + std::to_string(regions[a].second) +
                                         "] writes");
            }
        }
    }

    const DeviceModel &device_;
    const RangeCheck &ranges_;
    const CopyRules &rules_;
    const VkCopyDeviceMemoryImageInfoKHR &info_;
    std::shared_ptr<const ValidatedImage> image_; // null if it is unknown
    bool onTransferQueue_ = false;
};

} // namespace

void cmdCopyMemoryToImage(const RangeCheck &ranges, const VkCopyDeviceMemoryImageInfoKHR *info)
{
    ImageCopyCheck(ranges, kToImage, *info).check();
}

void cmdCopyImageToMemory(const RangeCheck &ranges, const VkCopyDeviceMemoryImageInfoKHR *info)
{
    ImageCopyCheck(ranges, kToMemory, *info).check();
}

} // namespace vellum::layer::ranges
