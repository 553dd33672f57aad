// SPDX-License-Identifier: Apache-2.0
// The oracle: every hit of a ray with a scene, by brute force in double precision, resolved by the words of the
// specification. Shares no code with Vellum.
#pragma once

#include <cstdint>

#include <array>
#include <functional>
#include <optional>
#include <span>
#include <string>

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
    int state = 0; // as outcomeOf takes it
};

// The number of the micro-triangle at barycentrics (u, v). `edge` becomes how near the next line between two of them
// is, if that is nearer.
uint32_t microTriangleAt(double u, double v, uint32_t level, double &edge);

struct Hits {
    std::vector<Hit> hits; // neither ignored nor culled
    // A hit so close to an edge, to the line between two micro-triangles, to the ends of the ray or to another hit that
    // rounding decides: nothing can be said of the ray.
    bool unsure = false;
    // Hits whose known state a lossy build may have made unknown.
    uint32_t lossy = 0;
};

// choices: for each of those, in order: 0: as it was given, 1: unknown-transparent, 2: unknown-opaque. The rest as
// given.
Hits allHits(const Scene &scene, const Ray &ray, std::span<const uint8_t> choices = {});

// What the ray meets of one triangle, whatever its opacity and whatever the ray culls; nothing: it does not meet it for
// certain.
std::optional<Hit> hitOf(const Scene &scene, const Ray &ray, uint32_t instance, uint32_t geometry, uint32_t primitive);

// The first triangle that the ray meets, whatever its opacity.
std::optional<Hit> nearestTriangle(const Scene &scene, const Ray &ray);
// A ray as the one of that hit, that meets the triangle at other barycentrics.
Ray aimedAt(const Scene &scene, const Hit &hit, Ray ray, std::array<double, 2> place);

// What is wrong with a ray by `judge`, which compares its result with hits and says what is wrong (empty: nothing),
// with every choice that lossy builds leave. exact: allHits without choices, not unsure.
std::string faultOf(const Scene &scene, const Ray &ray, const Hits &exact,
                    const std::function<std::string(const std::vector<Hit> &)> &judge);

} // namespace vellum::check::oracle
