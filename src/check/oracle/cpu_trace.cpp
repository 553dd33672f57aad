// SPDX-License-Identifier: Apache-2.0
#include "check/oracle/cpu_trace.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "check/oracle/outcome.h"
#include "check/oracle/scene_build.h"

namespace vellum::check::oracle
{
namespace
{

constexpr double kDistance = 1e-4; // in t
constexpr double kGrazing = 0.02;  // cosine
// How far a driver's rounding may move a triangle or a ray, in units of the object. The specification says only:
// "Implementations should take efforts to maintain as much precision as possible".
constexpr double kPlace = 5e-6;
constexpr double kMostMargin = 5e-4;  // in barycentrics and t: half of what the checks of rays tolerate
constexpr double kFlat = 1e-9;        // products of edges, of vertices in one line
constexpr double kNearSegment = 1e-3; // to a triangle whose vertices are in one line
constexpr double kWidest = 0.05;      // limit for slivers

using Point = std::array<double, 3>;

Point operator-(const Point &a, const Point &b)
{
    return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
double dot(const Point &a, const Point &b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
Point cross(const Point &a, const Point &b)
{
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
Point widen(const Vec3 &v)
{
    return {double{v[0]}, double{v[1]}, double{v[2]}};
}

struct LocalRay {
    Point origin, direction;
};

LocalRay toObject(const VkTransformMatrixKHR &transform, const Ray &ray)
{
    Point columns[3], place{};
    for (size_t c = 0; c < 3; ++c) {
        for (size_t r = 0; r < 3; ++r)
            columns[c][r] = double{transform.matrix[r][c]};
        place[c] = double{transform.matrix[c][3]};
    }
    const double determinant = dot(columns[0], cross(columns[1], columns[2]));
    const auto solve = [&](const Point &p) { // Cramer
        return Point{dot(p, cross(columns[1], columns[2])) / determinant,
                     dot(p, cross(columns[2], columns[0])) / determinant,
                     dot(p, cross(columns[0], columns[1])) / determinant};
    };
    return {solve(widen(ray.origin) - place), solve(widen(ray.direction))};
}

} // namespace

// Descends the curve: nearest vertex 0, middle with flipped order, nearest vertex 1, nearest vertex 2 with flipped
// order. A flipped triangle is traversed from its vertex 2 to its vertex 0.
uint32_t microTriangleAt(double u, double v, uint32_t level, double &edge)
{
    // Weights of the current sub-triangle's vertices 0, 1, 2, in the order the curve visits them.
    std::array<double, 3> weights{1 - u - v, u, v};
    uint32_t index = 0;
    double size = 1;
    for (uint32_t l = 0; l < level; ++l) {
        size /= 2;
        for (const double w : weights)
            edge = std::min(edge, std::abs(w - 0.5) * 2 * size);
        const auto [w0, w1, w2] = weights;
        uint32_t child = 1;
        if (w0 > 0.5) {
            child = 0;
            weights = {2 * w0 - 1, 2 * w1, 2 * w2};
            // Entered at vertex 0, left at the middle of 0 and 2, which the next one is entered at.
        } else if (w1 > 0.5) {
            child = 2;
            weights = {2 * w0, 2 * w1 - 1, 2 * w2};
        } else if (w2 > 0.5) {
            child = 3;
            // Vertices: middle of 1 and 2, middle of 2 and 0, vertex 2. Entered where child 2 was left.
            weights = {2 * w1, 2 * w0, 2 * w2 - 1};
        } else {
            // Vertices: middle of 2 and 0, middle of 1 and 2, middle of 0 and 1.
            weights = {1 - 2 * w1, 1 - 2 * w0, 1 - 2 * w2};
        }
        index = index * 4 + child;
    }
    return index;
}

namespace
{

// The 4-state value at a place of a triangle, and the micro-triangle that has it.
int stateAt(const Scene &scene, const MeshMicromap &use, uint32_t primitive, double u, double v, double &edge,
            uint32_t &element)
{
    const int32_t index = use.indexOf(primitive);
    if (index < 0)
        return -1 - index;
    const MicromapTriangle &triangle =
        scene.micromaps[*use.micromap].triangles[static_cast<uint32_t>(index) + use.base];
    element = microTriangleAt(u, v, triangle.level, edge);
    return triangle.states[element];
}

// The specification says "any element's state value" (Ray Opacity Micromap); the proposal of VK_KHR_opacity_micromap
// also allows it where triangles have special indices.
bool isLossy(const Scene &scene, const MeshMicromap &use)
{
    return use.micromap && (scene.micromaps[*use.micromap].flags & kLossy) != 0;
}

class Tracing
{
public:
    Tracing(const Scene &scene, const Ray &ray, const Substitution &substitution)
        : scene_(scene), ray_(ray), substitution_(substitution)
    {
    }

    Hits run()
    {
        for (uint32_t i = 0; i < scene_.instances.size(); ++i) {
            const Instance &instance = scene_.instances[i];
            if (instance.inactive || (instance.mask & ray_.cullMask & 0xff) == 0)
                continue;
            local_ = toObject(instance.transform, ray_);
            const Object &object = scene_.objects[instance.object];
            for (uint32_t g = 0; g < object.meshes.size(); ++g) {
                const Mesh &mesh = object.meshes[g];
                for (uint32_t p = 0; p < mesh.boxes.size(); ++p)
                    box(instance, mesh, {i, g, p, instance.customIndex, true, {}, false, 0, 0, 0, false});
                for (uint32_t p = 0; p < mesh.triangles(); ++p)
                    triangle(instance, mesh,
                             {i, g, p, instance.customIndex, false, {}, false, 0, 0, 0, true, mesh.noDuplicates});
            }
        }
        for (size_t i = 0; i < out_.hits.size(); ++i) {
            for (size_t k = 0; k < i; ++k) {
                if (std::abs(out_.hits[i].t - out_.hits[k].t) < std::max(slackOf_[i], slackOf_[k]) &&
                    !out_.hits[i].box && !out_.hits[k].box)
                    out_.unsure = true;
            }
        }
        return std::move(out_);
    }

    // One triangle, without culling and opacity.
    std::optional<Hit> runFor(uint32_t i, uint32_t g, uint32_t p)
    {
        everything_ = true;
        const Instance &instance = scene_.instances[i];
        local_ = toObject(instance.transform, ray_);
        triangle(instance, scene_.objects[instance.object].meshes[g],
                 {i, g, p, instance.customIndex, false, {}, false, 0, 0, 0, true});
        return out_.hits.empty() ? std::nullopt : std::optional(out_.hits[0]);
    }

private:
    void add(const Instance &instance, const Mesh &mesh, Hit hit, int state)
    {
        hit.state = state;
        switch (outcomeOf(state, mesh.opaque, instance.flags, ray_.flags)) {
        case Outcome::Opaque: hit.opacity = Opacity::Opaque; break;
        case Outcome::NonOpaque: hit.opacity = Opacity::NonOpaque; break;
        default:
            if (!everything_)
                return;
        }
        hit.record = recordOffset(scene_, hit.instance);
        out_.hits.push_back(hit);
        slackOf_.push_back(slack_);
    }

    // Vertices in one line
    static bool isSegment(const Point &e1, const Point &e2)
    {
        const Point normal = cross(e1, e2);
        return dot(normal, normal) < kFlat * kFlat && dot(e1, e1) + dot(e2, e2) > 0;
    }

    // "Degenerate triangles do not generate any intersections", but a driver that intersects transformed vertices finds
    // an area by rounding.
    void segment(const Point &toOrigin, const Point &edge)
    {
        const Point across = cross(local_.direction, edge);
        const double length = std::sqrt(dot(across, across));
        out_.unsure |= std::abs(dot(toOrigin, across)) <= kNearSegment * length;
    }

    // Möller and Trumbore.
    void triangle(const Instance &instance, const Mesh &mesh, Hit hit)
    {
        if ((ray_.flags & kRaySkipTriangles) != 0 && !everything_)
            return;
        const Corners corners = cornersOf(mesh, hit.primitive);
        const Point &v0 = corners[0];
        const Point e1 = corners[1] - v0;
        const Point e2 = corners[2] - v0;
        const Point p = cross(local_.direction, e2);
        const double determinant = dot(e1, p);
        const Point toOrigin = local_.origin - v0;
        if (std::abs(determinant) < kFlat && isSegment(e1, e2))
            return segment(toOrigin, dot(e1, e1) > dot(e2, e2) ? e1 : e2);
        hit.u = dot(toOrigin, p) / determinant;
        if (hit.u < -kWidest || hit.u > 1 + kWidest)
            return; // most triangles of a large scene
        const Point q = cross(toOrigin, e1);
        hit.v = dot(local_.direction, q) / determinant;
        hit.t = dot(e2, q) / determinant;
        const double inside = std::min({hit.u, hit.v, 1 - hit.u - hit.v});
        if (!(inside > -kWidest))
            return;
        const Point normal = cross(e1, e2);
        const double area = std::sqrt(dot(normal, normal));
        // Degenerate triangles and inactive ones, whose area is NaN, are never hit.
        if (!(area > 0))
            return;
        const double cosine = determinant / (area * std::sqrt(dot(local_.direction, local_.direction)));
        const double length = std::sqrt(std::max({dot(e1, e1), dot(e2, e2), dot(e2 - e1, e2 - e1)}));
        // kPlace in barycentrics, where the height above the longest edge decides, and along the ray.
        const double moved = std::max(double{scene_.edge}, kPlace * length / (area * std::abs(cosine)));
        slack_ = std::max(kDistance, kPlace / (std::abs(cosine) * std::sqrt(dot(local_.direction, local_.direction))));
        // A sliver, or seen edge-on, or by a ray with a short direction: nearly everything about the hit is rounding.
        const bool bad = std::abs(cosine) < kGrazing || area < 0.02 || moved > kMostMargin || slack_ > kMostMargin;
        const double margin = bad ? kWidest : moved;
        if (!(inside > -margin) || hit.t < double{ray_.tMin} - slack_ || hit.t > double{ray_.tMax} + slack_)
            return;
        // Front faces are those whose vertices appear clockwise to the ray: their normal points along it in a
        // right-handed view, towards it as Vulkan counts (confirmed on a driver by OracleWithoutLayer).
        hit.frontFace = determinant > 0;
        if ((instance.flags & VK_GEOMETRY_INSTANCE_TRIANGLE_FLIP_FACING_BIT_KHR) != 0)
            hit.frontFace = !hit.frontFace;
        if (!everything_ && (instance.flags & VK_GEOMETRY_INSTANCE_TRIANGLE_FACING_CULL_DISABLE_BIT_KHR) == 0 && !bad &&
            (ray_.flags & (hit.frontFace ? kRayCullFront : kRayCullBack)) != 0)
            return;
        double edge = inside;
        int state = kNoMicromap;
        uint32_t element = 0;
        if (inside > 0 && mesh.micromap)
            state = stateAt(scene_, *mesh.micromap, hit.primitive, hit.u, hit.v, edge, element);
        if (bad || edge < moved || nearEnds(hit.t)) {
            out_.unsure = true;
            return;
        }
        if (mesh.micromap && isLossy(scene_, *mesh.micromap)) {
            const LossyElement at{instance.object, hit.geometry, hit.primitive, element};
            out_.lossy.push_back({hit.instance, at, state});
            if (const auto found = substitution_.find(at); found != substitution_.end())
                state = found->second;
        }
        add(instance, mesh, hit, state);
    }

    [[nodiscard]] bool nearEnds(double t) const
    {
        return std::abs(t - double{ray_.tMin}) < slack_ || std::abs(t - double{ray_.tMax}) < slack_;
    }

    // The part of the ray inside the box grown by `growth`; false: none between tMin and tMax.
    bool slab(const VkAabbPositionsKHR &box, double growth, double &from, double &to) const
    {
        const Point low{double{box.minX}, double{box.minY}, double{box.minZ}};
        const Point high{double{box.maxX}, double{box.maxY}, double{box.maxZ}};
        from = double{ray_.tMin};
        to = double{ray_.tMax};
        for (size_t a = 0; a < 3; ++a) {
            if (high[a] - low[a] < -2 * growth)
                return false; // thinner than what it is to shrink by
            const double first = (low[a] - growth - local_.origin[a]) / local_.direction[a];
            const double second = (high[a] + growth - local_.origin[a]) / local_.direction[a];
            from = std::max(from, std::min(first, second));
            to = std::min(to, std::max(first, second));
        }
        return from < to;
    }

    void box(const Instance &instance, const Mesh &mesh, Hit hit)
    {
        if ((ray_.flags & kRaySkipBoxes) != 0)
            return;
        const VkAabbPositionsKHR &bounds = mesh.boxes[hit.primitive];
        if (std::isnan(bounds.minX))
            return; // inactive
        double from = 0, to = 0;
        hit.certain = slab(bounds, -2e-3, from, to);
        hit.t = from;
        add(instance, mesh, hit, kBox);
    }

    const Scene &scene_;
    const Ray &ray_;
    const Substitution &substitution_;
    LocalRay local_{};
    double slack_ = kDistance;      // of the current hit, in t
    std::vector<double> slackOf_{}; // of each of the hits
    bool everything_ = false;       // also what is culled or ignored
    Hits out_;
};

} // namespace

Hits allHits(const Scene &scene, const Ray &ray, const Substitution &substitution)
{
    return Tracing(scene, ray, substitution).run();
}

std::optional<Hit> hitOf(const Scene &scene, const Ray &ray, uint32_t instance, uint32_t geometry, uint32_t primitive)
{
    const bool exists = instance < scene.instances.size() && !scene.instances[instance].inactive &&
                        geometry < scene.objects[scene.instances[instance].object].meshes.size() &&
                        primitive < scene.objects[scene.instances[instance].object].meshes[geometry].triangles();
    static const Substitution kNone;
    return exists ? Tracing(scene, ray, kNone).runFor(instance, geometry, primitive) : std::nullopt;
}

bool canBeMet(const Scene &scene, const Instance &instance)
{
    const auto hasArea = [](const Mesh &mesh, uint32_t triangle) {
        const auto [a, b, c] = cornersOf(mesh, triangle);
        const Point normal = cross(b - a, c - a);
        return dot(normal, normal) > 0; // inactive: NaN
    };
    const auto hasVolume = [](const VkAabbPositionsKHR &box) {
        return box.maxX > box.minX && box.maxY > box.minY && box.maxZ > box.minZ;
    };
    const auto has = [&](const Mesh &mesh) {
        bool any = std::ranges::any_of(mesh.boxes, hasVolume);
        for (uint32_t t = 0; !any && t < mesh.triangles(); ++t)
            any = hasArea(mesh, t);
        return any;
    };
    return !instance.inactive && (instance.mask & 0xff) != 0 &&
           std::ranges::any_of(scene.objects[instance.object].meshes, has);
}

std::optional<Hit> nearestTriangle(const Scene &scene, const Ray &ray)
{
    Scene bare = scene; // without micromaps, no hit is ignored
    for (Object &object : bare.objects)
        for (Mesh &mesh : object.meshes)
            mesh.micromap.reset();
    std::optional<Hit> nearest;
    for (const Hit &hit : allHits(bare, ray).hits)
        if (!hit.box && (!nearest || hit.t < nearest->t))
            nearest = hit;
    return nearest;
}

Ray aimedAt(const Scene &scene, const Hit &hit, Ray ray, std::array<double, 2> place)
{
    const Instance &instance = scene.instances[hit.instance];
    const Corners corners = cornersOf(scene.objects[instance.object].meshes[hit.geometry], hit.primitive);
    const auto [u, v] = place;
    for (size_t r = 0; r < 3; ++r) {
        double at = double{instance.transform.matrix[r][3]};
        for (size_t k = 0; k < 3; ++k)
            at += double{instance.transform.matrix[r][k]} *
                  ((1 - u - v) * corners[0][k] + u * corners[1][k] + v * corners[2][k]);
        ray.origin[r] = static_cast<float>(at - hit.t * double{ray.direction[r]});
    }
    return ray;
}

std::vector<Hits> allHits(const Scene &scene, const Substitution &substitution)
{
    std::vector<Hits> hits;
    for (const Ray &ray : scene.rays)
        hits.push_back(allHits(scene, ray, substitution));
    return hits;
}

} // namespace vellum::check::oracle
