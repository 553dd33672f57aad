// SPDX-License-Identifier: Apache-2.0
#include "render/grove.h"

#include <algorithm>
#include <cmath>

#include "render/math.h"

namespace vellum::render
{
namespace
{

// The shape and colours of a kind of leaf. Lengths are in sizes of the texture.
struct LeafStyle {
    uint64_t seed = 1;
    int leaves = 11;                 // along the twig, alternating, and one at its tip
    float length = 0.30f;            // of a leaf blade
    float width = 0.17f;             // of a leaf blade, where it is widest
    float widest = 0.42f;            // where that is, from stalk (0) to tip (1)
    float teeth = 0;                 // depth of the edge's teeth, as a share of the width
    int veins = 7;                   // pairs of side veins
    Vec3 young{0.40f, 0.53f, 0.20f}; // the leaves' sRGB colours are between these
    Vec3 old{0.19f, 0.33f, 0.12f};
    Vec3 wood{0.33f, 0.25f, 0.16f};
};

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
    // Two arcs that meet where the leaf is widest; the outer one ends in a long tip.
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
        // Keeps the leaf within the picture, with a margin, whatever its style.
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

// A square picture with the twig growing from the middle of the bottom edge (the last row) to the top; alpha is how
// much of a texel is covered. Texels without any leaf have the leaves' mean colour, so that no dark rim is filtered in.
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

// The growth of a kind of plant. Lengths in metres, angles in radians.
struct Habit {
    float trunkLength, trunkRadius;
    int levels;      // of branches after the trunk
    int children[3]; // on each branch of the level before
    float shrink;    // length of a child to its parent's
    float spread;    // between a child and its parent
    float rise;      // how strongly shoots turn upwards
    float bare;      // share of a branch below its first child
    float cardSize;
    int cards;       // on each branch of the last level
    float droop;     // of the cards
    uint32_t leaves; // their geometry in the scene
};

struct Shoot {
    Vec3 base, direction;
    float length, radius;
};

struct Frame {
    Vec3 side, other;
};

Frame frameOf(const Vec3 &direction)
{
    const Vec3 helper = std::abs(direction[1]) < 0.9f ? Vec3{0, 1, 0} : Vec3{1, 0, 0};
    const Vec3 side = normalize(cross(direction, helper));
    return {side, cross(direction, side)};
}

class Grower
{
public:
    Grower(Scene &scene, uint64_t seed) : scene_(scene), random_(seed) {}

    void grow(const Habit &habit, const Vec3 &foot, float scale)
    {
        Habit scaled = habit;
        scaled.trunkLength *= scale;
        scaled.trunkRadius *= scale;
        const Vec3 up = normalize({random_.between(-0.06f, 0.06f), 1, random_.between(-0.06f, 0.06f)});
        // The foot is sunk, so that no gap shows where the ground is.
        shoot(scaled, {foot - Vec3{0, 0.05f, 0}, up, scaled.trunkLength, scaled.trunkRadius}, 0);
    }

private:
    static constexpr uint32_t kWood = 0; // geometry of branches
    static constexpr int kSegments = 6;

    void shoot(const Habit &habit, const Shoot &s, int level)
    {
        std::vector<Vec3> path = {s.base};
        Vec3 direction = s.direction;
        for (int i = 0; i < kSegments; ++i) {
            const float wander = level == 0 ? 0.10f : 0.24f;
            direction = normalize(direction + Vec3{random_.between(-wander, wander),
                                                   habit.rise / kSegments + random_.between(-wander, wander) * 0.5f,
                                                   random_.between(-wander, wander)});
            path.push_back(path.back() + direction * (s.length / kSegments));
        }
        tube(path, s.radius, level == 0);
        if (level == habit.levels) {
            foliage(habit, path);
            return;
        }
        const int count = habit.children[level];
        for (int i = 0; i < count; ++i) {
            const float along =
                habit.bare + (1 - habit.bare) * (static_cast<float>(i) + 0.7f) / static_cast<float>(count);
            child(habit, s, path, std::min(along, 0.98f), 2.39996f * static_cast<float>(i), level);
        }
    }

    void child(const Habit &habit, const Shoot &parent, const std::vector<Vec3> &path, float along, float turn,
               int level)
    {
        const float place = along * kSegments;
        const auto segment = std::min<size_t>(static_cast<size_t>(place), kSegments - 1);
        const Vec3 base = path[segment] + (path[segment + 1] - path[segment]) * (place - static_cast<float>(segment));
        const Vec3 direction = normalize(path[segment + 1] - path[segment]);
        const Frame frame = frameOf(direction);
        const float angle = turn + random_.between(-0.5f, 0.5f);
        const float spread = habit.spread * random_.between(0.8f, 1.2f) * (1.15f - 0.5f * along);
        const Vec3 out = frame.side * std::cos(angle) + frame.other * std::sin(angle);
        // Lower branches are longer: a rounded crown.
        const float length = parent.length * habit.shrink * (1.15f - 0.55f * along) * random_.between(0.85f, 1.15f);
        const float radius = parent.radius * (1 - 0.8f * along) * 0.55f + 0.004f;
        shoot(habit, {base, normalize(direction * std::cos(spread) + out * std::sin(spread)), length, radius},
              level + 1);
    }

    void tube(const std::vector<Vec3> &path, float radius, bool trunk)
    {
        Geometry &g = scene_.geometries[kWood];
        const uint32_t sides = trunk ? 12 : 6;
        const auto first = static_cast<uint32_t>(g.positions.size());
        for (size_t i = 0; i < path.size(); ++i) {
            const Vec3 direction = normalize(path[std::min(i + 1, path.size() - 1)] - path[i > 0 ? i - 1 : 0]);
            const Frame frame = frameOf(direction);
            const float along = static_cast<float>(i) / static_cast<float>(path.size() - 1);
            const float flare = trunk && i == 0 ? 1.5f : 1.0f;
            const float r = radius * (1 - 0.8f * along) * flare;
            for (uint32_t k = 0; k < sides; ++k) {
                const float angle = 2 * kPi * static_cast<float>(k) / static_cast<float>(sides);
                g.positions.push_back(path[i] + frame.side * (r * std::cos(angle)) +
                                      frame.other * (r * std::sin(angle)));
                g.uvs.push_back({});
            }
        }
        for (uint32_t i = 0; i + 1 < path.size(); ++i) {
            for (uint32_t k = 0; k < sides; ++k) {
                const uint32_t a = first + i * sides + k;
                const uint32_t b = first + i * sides + (k + 1) % sides;
                g.indices.insert(g.indices.end(), {a, a + sides, b, b, a + sides, b + sides});
            }
        }
    }

    void foliage(const Habit &habit, const std::vector<Vec3> &path)
    {
        for (int i = 0; i < habit.cards; ++i) {
            const float along = 0.25f + 0.75f * (static_cast<float>(i) + 1) / static_cast<float>(habit.cards);
            const float place = std::min(along, 0.999f) * kSegments;
            const auto segment = static_cast<size_t>(place);
            const Vec3 base =
                path[segment] + (path[segment + 1] - path[segment]) * (place - static_cast<float>(segment));
            const Vec3 direction = normalize(path[segment + 1] - path[segment]);
            const Frame frame = frameOf(direction);
            const float angle = 2.39996f * static_cast<float>(i) + random_.between(-0.6f, 0.6f);
            const Vec3 out = frame.side * std::cos(angle) + frame.other * std::sin(angle);
            const Vec3 up = normalize(direction * 0.7f + out * 0.9f - Vec3{0, habit.droop, 0});
            card(habit.leaves, base, up, habit.cardSize * random_.between(0.8f, 1.15f));
        }
    }

    // A twig's square, with the middle of its lower edge at `base`.
    void card(uint32_t geometry, const Vec3 &base, const Vec3 &up, float size)
    {
        Geometry &g = scene_.geometries[geometry];
        // Leaves turn their faces upwards.
        const Vec3 wish = {random_.between(-0.8f, 0.8f), 1, random_.between(-0.8f, 0.8f)};
        const Vec3 across = normalize(cross(up, wish)) * (0.5f * size);
        const Vec3 top = base + up * size;
        const auto first = static_cast<uint32_t>(g.positions.size());
        g.positions.insert(g.positions.end(), {base - across, base + across, top + across, top - across});
        g.uvs.insert(g.uvs.end(), {{0, 1}, {1, 1}, {1, 0}, {0, 0}});
        for (const uint32_t corner : {0u, 1u, 2u, 0u, 2u, 3u})
            g.indices.push_back(first + corner);
    }

    Scene &scene_;
    Random random_;
};

Material leafMaterial(const char *name, int image)
{
    Material m;
    m.name = name;
    m.alphaMode = AlphaMode::Mask;
    m.image = image;
    m.wrapU = Wrap::Clamp;
    m.wrapV = Wrap::Clamp;
    return m;
}

constexpr uint32_t kBeechLeaves = 1;
constexpr uint32_t kBirchLeaves = 2;

} // namespace

Scene makeGrove()
{
    Scene scene;
    LeafStyle beech;
    beech.leaves = 7;
    beech.length = 0.36f;
    beech.width = 0.22f;
    LeafStyle birch;
    birch.seed = 7;
    birch.leaves = 9;
    birch.length = 0.27f;
    birch.width = 0.21f;
    birch.widest = 0.30f;
    birch.teeth = 0.16f;
    birch.veins = 6;
    birch.young = {0.46f, 0.55f, 0.23f};
    birch.old = {0.27f, 0.39f, 0.15f};
    scene.images = {paintTwig(beech, 512), paintTwig(birch, 512)};
    Material wood;
    wood.name = "branches";
    wood.baseColor = {0.36f, 0.29f, 0.22f, 1};
    scene.materials = {wood, leafMaterial("beech leaves", 0), leafMaterial("birch leaves", 1)};
    for (uint32_t i = 0; i < 3; ++i)
        scene.geometries.emplace_back().material = i;

    const Habit beechTree = {4.6f, 0.26f, 2, {11, 6, 0}, 0.62f, 1.0f, 0.30f, 0.30f, 0.80f, 8, 0.15f, kBeechLeaves};
    const Habit birchTree = {7.2f, 0.15f, 2, {16, 4, 0}, 0.30f, 0.95f, 0.25f, 0.28f, 0.75f, 7, 0.45f, kBirchLeaves};
    const Habit bush = {0.7f, 0.06f, 2, {9, 4, 0}, 0.85f, 0.95f, 0.35f, 0.15f, 0.66f, 6, 0.0f, kBeechLeaves};
    Grower grower(scene, 11);
    grower.grow(beechTree, {-2.2f, 0, -0.8f}, 1.0f);
    grower.grow(birchTree, {2.2f, 0, -2.2f}, 0.95f);
    grower.grow(birchTree, {4.2f, 0, -0.6f}, 0.8f);
    grower.grow(beechTree, {0.2f, 0, -5.0f}, 0.95f);
    grower.grow(bush, {0.9f, 0, 1.0f}, 1.0f);
    grower.grow(bush, {-4.4f, 0, 2.4f}, 0.9f);
    // Close to the camera, to show single leaves.
    grower.grow(bush, {4.9f, 0, 5.4f}, 1.25f);
    grower.grow(bush, {1.4f, 0, 8.4f}, 1.0f);
    scene.makeOneMesh();
    return scene;
}

} // namespace vellum::render
