// SPDX-License-Identifier: Apache-2.0
#include "cli/scene/leaf_texture.h"

#include <algorithm>
#include <cmath>

#include "cli/scene/math.h"
#include "cli/scene/random.h"

namespace vellum::cli
{
namespace
{

constexpr int kSubsamples = 4; // per direction and texel

struct Leaf {
    float x, y;       // where the blade begins; y up, both 0..1
    float dirX, dirY; // unit vector from there to the tip
    float length, width;
    float age;            // 0 young, 1 old
    float stalkX, stalkY; // where the stalk leaves the twig
};

struct Paint {
    Vec3 color{};
    bool covered = false;
};

float smooth(float low, float high, float x)
{
    const float t = std::clamp((x - low) / (high - low), 0.0f, 1.0f);
    return t * t * (3 - 2 * t);
}

// Half of the blade's width, as a share of the largest, at `s` from stalk to tip.
float outline(const LeafStyle &style, float s)
{
    if (s <= 0 || s >= 1)
        return 0;
    // Two arcs that meet where the leaf is widest; the outer one ends in a drawn-out tip.
    const float p = s < style.widest ? s / style.widest : (1 - s) / (1 - style.widest);
    return s < style.widest ? std::sqrt(p * (2 - p)) : std::pow(std::sin(p * kPi / 2), 1.35f);
}

float distanceToSegment(float px, float py, float ax, float ay, float bx, float by)
{
    const float dx = bx - ax;
    const float dy = by - ay;
    const float t = std::clamp(((px - ax) * dx + (py - ay) * dy) / (dx * dx + dy * dy + 1e-12f), 0.0f, 1.0f);
    return std::hypot(px - ax - t * dx, py - ay - t * dy);
}

Paint paintLeaf(const LeafStyle &style, const Leaf &leaf, float x, float y)
{
    Paint paint;
    const Vec3 stalk = style.young * 0.8f + style.wood * 0.2f;
    const float s = ((x - leaf.x) * leaf.dirX + (y - leaf.y) * leaf.dirY) / leaf.length;
    const float across = (-(x - leaf.x) * leaf.dirY + (y - leaf.y) * leaf.dirX) / (0.5f * leaf.width);
    const float t = std::abs(across);
    const float bite = 1 - style.teeth * (0.5f + 0.5f * std::sin(s * 150 + t));
    const float edge = outline(style, s) * bite;
    if (edge <= 0 || t > edge) {
        if (distanceToSegment(x, y, leaf.stalkX, leaf.stalkY, leaf.x, leaf.y) < 0.0045f)
            paint = {stalk, true};
        return paint;
    }
    const float inside = t / edge;
    // Side veins run forward and bend towards the tip; between them the blade bulges.
    const float phase =
        (s - 0.30f * t * leaf.width / leaf.length * 2 - 0.06f * t * t) * static_cast<float>(style.veins);
    const float ripple = phase - std::floor(phase);
    const float vein = smooth(0.10f, 0.0f, std::min(ripple, 1 - ripple)) * smooth(1.0f, 0.55f, inside);
    const float midrib = smooth(0.085f, 0.03f, t * (0.6f + s));
    Vec3 color = style.young * (1 - leaf.age) + style.old * leaf.age;
    color = color * (0.90f + 0.16f * std::sin(ripple * kPi));      // bulges
    color = color * (across > 0 ? 1.07f : 0.93f);                  // the blade is folded along its midrib
    color = color * (1.06f - 0.20f * smooth(0.75f, 1.0f, inside)); // the rim
    color = color * (0.92f + 0.14f * s);
    const Vec3 light = style.young * 0.55f + Vec3{0.78f, 0.82f, 0.50f} * 0.45f;
    const float lines = std::max(0.45f * vein, 0.85f * midrib);
    return {color * (1 - lines) + light * lines, true};
}

float twigX(float along)
{
    return 0.5f + 0.035f * std::sin(along * 4.2f + 0.4f) - 0.0136f;
}

std::vector<Leaf> arrange(const LeafStyle &style)
{
    Random random(style.seed);
    std::vector<Leaf> leaves;
    const float top = 0.97f - style.length;
    for (int i = 0; i <= style.leaves; ++i) {
        const bool tip = i == style.leaves;
        const float along =
            tip ? top : 0.12f + (top - 0.14f) * static_cast<float>(i) / static_cast<float>(style.leaves);
        const float side = i % 2 == 0 ? 1.0f : -1.0f;
        const float angle = tip ? random.between(-0.12f, 0.12f) : side * random.between(0.75f, 1.15f);
        // Leaves in the middle of a twig are the largest.
        const float size = (0.78f + 0.22f * std::sin(kPi * along / top)) * random.between(0.9f, 1.05f);
        Leaf leaf{};
        leaf.dirX = std::sin(angle);
        leaf.dirY = std::cos(angle);
        leaf.stalkX = twigX(along);
        leaf.stalkY = along;
        leaf.x = leaf.stalkX + 0.045f * leaf.dirX;
        leaf.y = leaf.stalkY + 0.045f * leaf.dirY;
        leaf.length = style.length * size;
        leaf.width = style.width * size;
        leaf.age = std::clamp(random.between(0.1f, 1.0f) * (1.15f - 0.5f * along), 0.0f, 1.0f);
        // Within the picture, with a margin, whatever the style asks for.
        const float tipX = leaf.x + leaf.dirX * leaf.length;
        if (tipX < 0.02f || tipX > 0.98f)
            leaf.length = ((tipX < 0.5f ? 0.02f : 0.98f) - leaf.x) / leaf.dirX;
        leaves.push_back(leaf);
    }
    return leaves;
}

Paint paintAt(const LeafStyle &style, const std::vector<Leaf> &leaves, float x, float y)
{
    // The last leaf is in front.
    for (auto leaf = leaves.rbegin(); leaf != leaves.rend(); ++leaf) {
        const Paint paint = paintLeaf(style, *leaf, x, y);
        if (paint.covered)
            return paint;
    }
    const float top = leaves.back().stalkY;
    const float offset = x - twigX(y);
    const float radius = 0.011f - 0.007f * y;
    if (y <= top && std::abs(offset) < radius)
        return {style.wood * (1.0f - 0.35f * offset / radius), true};
    return {};
}

uint8_t toByte(float x)
{
    return static_cast<uint8_t>(std::lround(std::clamp(x, 0.0f, 1.0f) * 255));
}

} // namespace

Image paintTwig(const LeafStyle &style, uint32_t size)
{
    const std::vector<Leaf> leaves = arrange(style);
    const Vec3 mean = (style.young + style.old) * 0.5f;
    Image image{size, size, {}};
    image.rgba.reserve(size_t{4} * size * size);
    const float step = 1.0f / (static_cast<float>(size) * kSubsamples);
    for (uint32_t row = 0; row < size; ++row) {
        for (uint32_t column = 0; column < size; ++column) {
            Vec3 sum{};
            int covered = 0;
            for (int i = 0; i < kSubsamples * kSubsamples; ++i) {
                const float sx = static_cast<float>(i % kSubsamples) + 0.5f;
                const float sy = static_cast<float>(i / kSubsamples) + 0.5f;
                const float x = (static_cast<float>(column * kSubsamples) + sx) * step;
                const float y = 1 - (static_cast<float>(row * kSubsamples) + sy) * step;
                const Paint paint = paintAt(style, leaves, x, y);
                if (!paint.covered)
                    continue;
                sum = sum + paint.color;
                ++covered;
            }
            const Vec3 color = covered > 0 ? sum * (1.0f / static_cast<float>(covered)) : mean;
            for (const float channel : color)
                image.rgba.push_back(toByte(channel));
            image.rgba.push_back(toByte(static_cast<float>(covered) / (kSubsamples * kSubsamples)));
        }
    }
    return image;
}

} // namespace vellum::cli
