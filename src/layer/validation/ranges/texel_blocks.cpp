// SPDX-License-Identifier: Apache-2.0
// Texel blocks of formats ("Compatible Formats").
#include <algorithm>
#include <array>

#include "layer/validation/ranges/image_copies.h"

namespace vellum::layer
{
namespace
{

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

// Of formats with several planes, the place among those with components of one size: 3-plane 420, 2-plane 420, 3-plane
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

} // namespace

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

} // namespace vellum::layer
