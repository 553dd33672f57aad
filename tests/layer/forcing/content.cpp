// SPDX-License-Identifier: Apache-2.0
#include "forcing/content.h"

#include <array>
#include <cstring>

namespace forcing
{
namespace
{

constexpr uint16_t k2State = VK_OPACITY_MICROMAP_FORMAT_2_STATE_EXT;
constexpr uint16_t k4State = VK_OPACITY_MICROMAP_FORMAT_4_STATE_EXT;

struct Triangle {
    uint16_t level;
    uint16_t format;
    uint8_t states; // of each byte
};
constexpr uint8_t kUnknown = 0xff;  // unknown-opaque
constexpr uint8_t kUnknowns = 0xee; // unknown-transparent and unknown-opaque in turn
constexpr uint8_t kOpaque2 = 0xff, kOpaque4 = 0x55;
constexpr std::array<Triangle, 7> kTriangles{{
    {4, k4State, kUnknown},
    {1, k4State, kUnknown},
    {6, k4State, kUnknown},
    {4, k4State, kOpaque4},
    {5, k2State, kOpaque2},
    {0, k2State, kOpaque2},
    {4, k4State, kUnknowns},
}};
constexpr int16_t kTransparent = VK_OPACITY_MICROMAP_SPECIAL_INDEX_FULLY_TRANSPARENT_EXT;
constexpr int16_t kOpaque = VK_OPACITY_MICROMAP_SPECIAL_INDEX_FULLY_OPAQUE_EXT;
constexpr int16_t kUnknownTransparent = VK_OPACITY_MICROMAP_SPECIAL_INDEX_FULLY_UNKNOWN_TRANSPARENT_EXT;
constexpr int16_t kUnknownOpaque = VK_OPACITY_MICROMAP_SPECIAL_INDEX_FULLY_UNKNOWN_OPAQUE_EXT;

MicromapContent makeContent()
{
    MicromapContent content;
    for (const Triangle &t : kTriangles) {
        const uint32_t bits = (1u << 2 * t.level) * (t.format == k4State ? 2 : 1);
        content.triangles.push_back({static_cast<uint32_t>(content.data.size()), t.level, t.format});
        content.data.insert(content.data.end(), (bits + 7) / 8, t.states);
        content.usage.push_back({1, t.level, t.format});
    }
    return content;
}

} // namespace

const MicromapContent &micromapContent()
{
    static const MicromapContent content = makeContent();
    return content;
}

std::span<const int16_t> indexPattern(Content content, bool opaque)
{
    static constexpr std::array<int16_t, 5> kMixed[2]{{0, kUnknownOpaque, 1, 2, kUnknownOpaque},
                                                      {3, kOpaque, 4, 5, kOpaque}};
    static constexpr std::array<int16_t, 1> kData[2]{{6}, {3}};
    static constexpr std::array<int16_t, 2> kSpecial[2]{{kUnknownTransparent, kUnknownOpaque}, {kOpaque, kOpaque}};
    static constexpr std::array<int16_t, 1> kNothing{kTransparent};
    switch (content) {
    case Content::Mixed: return kMixed[opaque];
    case Content::Data: return kData[opaque];
    case Content::Special: return kSpecial[opaque];
    case Content::Transparent: break;
    }
    return kNothing;
}

} // namespace forcing
