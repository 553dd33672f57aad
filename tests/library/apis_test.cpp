// SPDX-License-Identifier: Apache-2.0
// docs/apis.md: micromaps are for every interface what vellumBake() makes. The layouts and numbers here are those of
// the published texts: D3D12 of "DirectX Raytracing (DXR) Functional Spec" (microsoft/DirectX-Specs 9a31a84), OptiX 9
// of optix_types.h (NVIDIA/optix-dev f1f6dd8), and glTF of EXT_mesh_opacity_micromap (KhronosGroup/glTF, pull request
// 2623).
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "vellum/vellum.h"
#include "vk/newer.h"

namespace
{

// D3D12_RAYTRACING_OPACITY_MICROMAP_DESC, whose two bit fields are 16 bits wide; and OptixOpacityMicromapDesc.
struct Record {
    uint32_t byteOffset;
    uint16_t subdivisionLevel;
    uint16_t format;
};
// D3D12_RAYTRACING_OPACITY_MICROMAP_HISTOGRAM_ENTRY, OptixOpacityMicromapHistogramEntry,
// OptixOpacityMicromapUsageCount.
struct Count {
    uint32_t count;
    uint32_t subdivisionLevel;
    uint32_t format;
};

template <typename Ours, typename Theirs>
constexpr bool hasRecordLayout(uint32_t Theirs::*, uint16_t Theirs::*, uint16_t Theirs::*)
{
    return sizeof(Ours) == sizeof(Theirs) && alignof(Ours) == alignof(Theirs);
}

TEST(Apis, RecordsHaveOneLayout)
{
    static_assert(
        hasRecordLayout<VellumMicromapTriangle>(&Record::byteOffset, &Record::subdivisionLevel, &Record::format));
    static_assert(hasRecordLayout<VellumMicromapTriangle>(
        &VkMicromapTriangleKHR::dataOffset, &VkMicromapTriangleKHR::subdivisionLevel, &VkMicromapTriangleKHR::format));
    static_assert(offsetof(VellumMicromapTriangle, dataOffset) == offsetof(Record, byteOffset));
    static_assert(offsetof(VellumMicromapTriangle, subdivisionLevel) == offsetof(Record, subdivisionLevel));
    static_assert(offsetof(VellumMicromapTriangle, format) == offsetof(Record, format));
    static_assert(sizeof(VellumMicromapUsage) == sizeof(Count) && sizeof(VkMicromapUsageKHR) == sizeof(Count));
    static_assert(offsetof(VellumMicromapUsage, subdivisionLevel) == offsetof(Count, subdivisionLevel));
    static_assert(offsetof(VellumMicromapUsage, format) == offsetof(Count, format));
    static_assert(offsetof(VkMicromapUsageKHR, format) == offsetof(Count, format));
}

TEST(Apis, NumbersAreEqual)
{
    constexpr std::array kSpecial{-1, -2, -3, -4}; // transparent, opaque, unknown transparent, unknown opaque
    static_assert(VELLUM_SPECIAL_INDEX_FULLY_TRANSPARENT == kSpecial[0] &&
                  VK_OPACITY_MICROMAP_SPECIAL_INDEX_FULLY_TRANSPARENT_EXT == kSpecial[0]);
    static_assert(VELLUM_SPECIAL_INDEX_FULLY_OPAQUE == kSpecial[1] &&
                  VK_OPACITY_MICROMAP_SPECIAL_INDEX_FULLY_OPAQUE_EXT == kSpecial[1]);
    static_assert(VELLUM_SPECIAL_INDEX_FULLY_UNKNOWN_TRANSPARENT == kSpecial[2] &&
                  VK_OPACITY_MICROMAP_SPECIAL_INDEX_FULLY_UNKNOWN_TRANSPARENT_EXT == kSpecial[2]);
    static_assert(VELLUM_SPECIAL_INDEX_FULLY_UNKNOWN_OPAQUE == kSpecial[3] &&
                  VK_OPACITY_MICROMAP_SPECIAL_INDEX_FULLY_UNKNOWN_OPAQUE_EXT == kSpecial[3]);
    static_assert(VELLUM_STATE_TRANSPARENT == 0 && VELLUM_STATE_OPAQUE == 1 && VELLUM_STATE_UNKNOWN_TRANSPARENT == 2 &&
                  VELLUM_STATE_UNKNOWN_OPAQUE == 3);
    static_assert(VELLUM_MICROMAP_FORMAT_2_STATE == 1 && VELLUM_MICROMAP_FORMAT_4_STATE == 2 &&
                  VK_OPACITY_MICROMAP_FORMAT_2_STATE_EXT == 1 && VK_OPACITY_MICROMAP_FORMAT_4_STATE_EXT == 2);
}

template <typename Index>
void expectWritten()
{
    constexpr Index kHighest = static_cast<Index>(-5); // below the special ones
    const auto highest = static_cast<int32_t>(std::min<uint32_t>(kHighest, INT32_MAX));
    const std::vector<int32_t> indices{0, highest, -1, -2, -3, -4};
    std::vector<Index> written(indices.size(), 77);
    ASSERT_EQ(vellumWriteIndices(indices.data(), indices.size(), sizeof(Index), written.data()), VELLUM_SUCCESS);
    for (size_t i = 0; i < indices.size(); ++i)
        EXPECT_EQ(written[i], static_cast<Index>(indices[i])) << i;
    std::vector<int32_t> wrong{-5};
    if (sizeof(Index) < 4)
        wrong.push_back(highest + 1);
    for (const int32_t index : wrong)
        EXPECT_EQ(vellumWriteIndices(&index, 1, sizeof(Index), written.data()), VELLUM_ERROR_INVALID_ARGUMENT) << index;
}

TEST(Apis, IndicesAreWrittenInAnySize)
{
    expectWritten<uint8_t>();
    expectWritten<uint16_t>();
    expectWritten<uint32_t>();
    const int32_t one = 1;
    uint32_t output = 0;
    for (const uint32_t size : {0u, 3u, 8u})
        EXPECT_EQ(vellumWriteIndices(&one, 1, size, &output), VELLUM_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(vellumWriteIndices(nullptr, 1, 4, &output), VELLUM_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(vellumWriteIndices(&one, 1, 4, nullptr), VELLUM_ERROR_INVALID_ARGUMENT);
    EXPECT_EQ(vellumWriteIndices(&one, 0, 4, &output), VELLUM_SUCCESS);
}

} // namespace
