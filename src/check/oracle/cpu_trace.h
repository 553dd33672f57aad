// SPDX-License-Identifier: Apache-2.0
// The oracle: every hit of a ray with a scene, by brute force in double precision, resolved by the words of the
// specification. Shares no code with Vellum.
#pragma once

#include <cstdint>

#include <array>
#include <map>
#include <optional>

#include "check/oracle/scene.h"

namespace vellum::check::oracle
{

enum class Opacity { Opaque, NonOpaque };

struct Hit {
    uint32_t instance, geometry, primitive;
    uint32_t customIndex;
    bool box;
    Opacity opacity;
    bool frontFace;
    double t; // of a box: where the ray enters it, or tMin
    double u, v;
    // False: a box that the ray does not meet for certain. "The occurrence of an AABB intersection candidate does not
    // guarantee the ray intersects the application-provided AABB."
    bool certain;
    // A triangle of a geometry that promises to show each candidate once.
    bool once = false;
    uint32_t record = 0; // instanceShaderBindingTableRecordOffset
    int state = 0;       // for outcomeOf
};

// The number of the micro-triangle at barycentrics (u, v). `edge` becomes how near the next line between two of them
// is, if that is nearer.
uint32_t microTriangleAt(double u, double v, uint32_t level, double &edge);

// An element of a lossy micromap as a triangle of an object has it. Of a triangle with a special index: 0.
struct LossyElement {
    uint32_t object, geometry, primitive, element;
    auto operator<=>(const LossyElement &) const = default;
};
// The states that a device has in place of those that a lossy build was given. "The implementation, on an identically
// created instance and device, must perform any lossy substitutions invariantly with respect to acceleration structures
// and micromaps constructed with an equivalent shape and data."
using Substitution = std::map<LossyElement, int>;

struct LossyHit {
    uint32_t instance;
    LossyElement at;
    int state; // state in the build's input
};

struct Hits {
    std::vector<Hit> hits; // neither ignored nor culled
    // A hit so close to an edge, to the line between two micro-triangles, to the ends of the ray or to another hit that
    // rounding decides: nothing can be said of the ray.
    bool unsure = false;
    std::vector<LossyHit> lossy; // also those that are ignored or culled
};

// Elements that `substitution` lacks have the states that the build was given.
Hits allHits(const Scene &scene, const Ray &ray, const Substitution &substitution = {});
// The hits of each ray of the scene.
std::vector<Hits> allHits(const Scene &scene, const Substitution &substitution = {});

// The hit of the ray on one triangle, whatever its opacity and whatever the ray culls; nothing: it does not meet it for
// certain.
std::optional<Hit> hitOf(const Scene &scene, const Ray &ray, uint32_t instance, uint32_t geometry, uint32_t primitive);

// Returns whether some ray can meet the instance: it is active, has a mask, and its object something that is neither
// inactive nor degenerate.
bool canBeMet(const Scene &scene, const Instance &instance);

// The first triangle that the ray meets, whatever its opacity.
std::optional<Hit> nearestTriangle(const Scene &scene, const Ray &ray);
// A ray as the one of that hit, that meets the triangle at other barycentrics.
Ray aimedAt(const Scene &scene, const Hit &hit, Ray ray, std::array<double, 2> place);

} // namespace vellum::check::oracle
