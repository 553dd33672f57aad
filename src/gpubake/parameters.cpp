// SPDX-License-Identifier: Apache-2.0
#include "gpubake/parameters.h"

#include <bit>
#include <cmath>

#include "core/micromap.h"
#include "core/portable_math.h"

namespace vellum::gpubake
{
namespace
{

using namespace vellum::shared;

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

} // namespace

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

bool valid(const GpuAlphaInfo &alpha)
{
    const auto inRange = [](uint32_t value, uint32_t most) { return value >= 1 && value <= most; };
    return alpha.view != VK_NULL_HANDLE && inRange(alpha.width, kMostTexels) && inRange(alpha.height, kMostTexels) &&
           inRange(alpha.mipLevels, kBakeMostMips) && alpha.component < 4 && wrapOf(alpha.wrapU) &&
           wrapOf(alpha.wrapV) && (alpha.filter == VK_FILTER_NEAREST || alpha.filter == VK_FILTER_LINEAR);
}

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

} // namespace vellum::gpubake
