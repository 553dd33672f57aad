// SPDX-License-Identifier: Apache-2.0
// The input of both programs: a leaf on a card of two triangles, baked by libvellum.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <vellum/bake.h>

inline constexpr uint32_t kLeafSize = 64; // texels
inline constexpr double kLeafCutoff = 0.5;

// Positions double as texture coordinates.
inline constexpr std::array<float, 12> kCardPositions = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0};
inline constexpr std::array<uint16_t, 6> kCardIndices = {0, 1, 2, 3, 2, 1};
inline constexpr uint32_t kCardTriangles = 2;

// Alpha of an ellipse with a soft border, or of an opaque card.
inline std::vector<float> paintLeaf(bool opaque)
{
    if (opaque)
        return std::vector<float>(kLeafSize * kLeafSize, 1.0f);
    std::vector<float> alpha;
    for (uint32_t y = 0; y < kLeafSize; ++y)
        for (uint32_t x = 0; x < kLeafSize; ++x) {
            const double dx = (x + 0.5) / kLeafSize * 2 - 1;
            const double dy = ((y + 0.5) / kLeafSize * 2 - 1) / 0.6;
            alpha.push_back(static_cast<float>(std::clamp(0.5 + (0.8 - (dx * dx + dy * dy)) * 8, 0.0, 1.0)));
        }
    return alpha;
}

// `maxLevel`: the highest subdivision level that the device supports.
inline vellum::Micromap bakeLeaf(const std::vector<float> &alpha, uint32_t maxLevel)
{
    const vellum::Texture texture{
        .texels = std::as_bytes(std::span(alpha)),
        .width = kLeafSize,
        .height = kLeafSize,
        .format = vellum::AlphaFormat::R32Sfloat,
        .addressModeU = vellum::AddressMode::ClampToEdge,
        .addressModeV = vellum::AddressMode::ClampToEdge,
    };
    const vellum::BakeInput card{
        .textures = {&texture, 1},
        .uvs = std::as_bytes(std::span(kCardPositions)),
        .uvStride = 3 * sizeof(float),
        .indices = std::as_bytes(std::span(kCardIndices)),
        .indexType = vellum::IndexType::Uint16,
        .cutoff = kLeafCutoff,
    };
    return vellum::bake(card, {.level = std::min(5u, maxLevel)});
}
