// SPDX-License-Identifier: Apache-2.0
#include "check/oracle/query_fault.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "check/oracle/outcome.h"

namespace vellum::check::oracle
{

namespace
{

constexpr std::array kStates{"transparent", "opaque", "unknown-transparent", "unknown-opaque"};

constexpr const char *nameOf(VkIndexType type)
{
    return type == VK_INDEX_TYPE_UINT8_EXT ? "8" : type == VK_INDEX_TYPE_UINT16 ? "16" : "32";
}

// Why a triangle has the opacity that is expected.
std::string reasonFor(const Scene &scene, const Ray &ray, const Hit &hit)
{
    const Instance &instance = scene.instances[hit.instance];
    const Mesh &mesh = scene.objects[instance.object].meshes[hit.geometry];
    std::string reason;
    if (!mesh.micromap || (instance.flags & kFlagDisable) != 0) {
        reason = std::string(mesh.micromap ? "its instance disables micromaps" : "it has no micromap") +
                 (mesh.opaque ? ", its geometry is opaque" : ", its geometry is not opaque");
    } else {
        const MeshMicromap &use = *mesh.micromap;
        const int32_t index = use.indexOf(hit.primitive);
        const auto place = static_cast<size_t>(index) + use.base;
        if (index < 0)
            reason = "special index " + std::to_string(index) + ", " + kStates[static_cast<size_t>(-1 - index)];
        else
            reason = std::string("state ") + kStates[static_cast<size_t>(hit.state) % kStates.size()] +
                     " of triangle " + std::to_string(place) + " of micromap " + std::to_string(*use.micromap);
        if (index >= 0 && use.indexType != VK_INDEX_TYPE_NONE_KHR)
            reason += std::string(", by the ") + nameOf(use.indexType) + "-bit index " + std::to_string(index) +
                      (use.base > 0 ? " and baseTriangle " + std::to_string(use.base) : "");
        else if (use.base > 0 && index >= 0)
            reason += ", by baseTriangle " + std::to_string(use.base);
        if ((instance.flags & kFlagTwoState) != 0 || (ray.flags & kRayForceTwoState) != 0)
            reason += ", with two states forced";
    }
    if ((instance.flags & VK_GEOMETRY_INSTANCE_FORCE_OPAQUE_BIT_KHR) != 0)
        reason += ", forced opaque by its instance";
    if ((instance.flags & VK_GEOMETRY_INSTANCE_FORCE_NO_OPAQUE_BIT_KHR) != 0)
        reason += ", forced non-opaque by its instance";
    if ((ray.flags & (kRayOpaque | kRayNoOpaque)) != 0)
        reason += std::string(", forced ") + ((ray.flags & kRayOpaque) != 0 ? "opaque" : "non-opaque") + " by the ray";
    if ((ray.flags & (kRayCullOpaque | kRayCullNoOpaque)) != 0)
        reason += std::string(", where the ray culls what is ") +
                  ((ray.flags & kRayCullOpaque) != 0 ? "opaque" : "not opaque");
    return reason;
}

std::string placeInWords(double t, double u, double v, bool front)
{
    return "t " + std::to_string(t) + ", u " + std::to_string(u) + ", v " + std::to_string(v) +
           (front ? ", front face" : ", back face");
}

} // namespace

bool culledByFacing(const Scene &scene, const Ray &ray, const Hit &hit)
{
    const bool disabled =
        (scene.instances[hit.instance].flags & VK_GEOMETRY_INSTANCE_TRIANGLE_FACING_CULL_DISABLE_BIT_KHR) != 0;
    return (ray.flags & kRaySkipTriangles) != 0 ||
           (!disabled && (ray.flags & (hit.frontFace ? kRayCullFront : kRayCullBack)) != 0);
}

int rankOf(std::string_view cause)
{
    return cause == kOpacityCause ? 2 : cause == kNotMetCause || cause == kMetCause ? 1 : 0;
}

std::string opacityFault(const Scene &scene, const Ray &ray, const Hit &hit, Deviation deviation,
                         const std::string &reported)
{
    const Instance &instance = scene.instances[hit.instance];
    const Mesh &mesh = scene.objects[instance.object].meshes[hit.geometry];
    const char *expected = "no hit";
    std::string_view cause = kOpacityCause;
    const Outcome outcome = outcomeOf(hit.state, mesh.opaque, instance.flags, ray.flags);
    const bool plain = !mesh.micromap && !everyTriangleHasMicromap;
    if (plain && deviation == Deviation::Lost)
        cause = kNotMetCause;
    else if (plain && outcome != Outcome::Opaque && outcome != Outcome::NonOpaque)
        cause = kMetCause;
    if (outcome == Outcome::Opaque)
        expected = "an opaque hit";
    else if (outcome == Outcome::NonOpaque)
        expected = "a non-opaque candidate";
    return std::string(cause) + " (instance " + std::to_string(hit.instance) + ", geometry " +
           std::to_string(hit.geometry) + ", triangle " + std::to_string(hit.primitive) + ": expected " + expected +
           ", as " + reasonFor(scene, ray, hit) + "; the device reported " + reported + ")";
}

std::string queryFault(const Scene &scene, const Ray &ray, const std::vector<Hit> &hits, const Result &result)
{
    if (result.flags != ray.flags)
        return "ray flags read back wrong (" + std::to_string(result.flags) + ")";
    if ((result.frontFace & 32) != 0)
        return "a value that the loop around rayQueryProceedEXT changes is wrong after the loop";
    if (result.tMin < ray.tMin || result.tMin > ray.tMin)
        return "tMin read back wrong";
    // Every candidate must be one that traversal may hand out.
    bool generated = false;
    const Candidate *end = nullptr; // at which the shader terminated the query
    for (const Candidate &c : result.candidates) {
        const auto hit = std::find_if(hits.begin(), hits.end(), [&c](const Hit &h) {
            return names(h, c) && h.box == c.box() && (h.box || h.opacity == Opacity::NonOpaque);
        });
        if (hit == hits.end())
            return c.box() ? "a candidate of a box that the ray does not meet" + inWords(c)
                           : opacityFault(scene, ray, c, "a candidate");
        if (end != nullptr)
            return "a candidate after the query was terminated" + inWords(c);
        if (!c.box() && c.confirmed() && ray.rule == kTerminate)
            end = &c;
        if (!c.consistent())
            return "origin, direction and transform of a candidate do not fit together" + inWords(c);
        if (c.recordOffset() != hit->record)
            return "record offset of a candidate" + inWords(c) + ": expected " + std::to_string(hit->record) +
                   ", the device reported " + std::to_string(c.recordOffset());
        if (cameAgain(*hit, result.candidates))
            return "a candidate came twice" + inWords(c);
        if (hit->box) {
            generated |= c.confirmed();
            if (c.boxOpaque() != (hit->opacity == Opacity::Opaque))
                return "candidateAABBOpaque" + inWords(c) + ": expected " +
                       (c.boxOpaque() ? "false, the device reported true" : "true, the device reported false");
        } else if (std::abs(double{c.u} - hit->u) > 1e-3 || std::abs(double{c.v} - hit->v) > 1e-3 ||
                   std::abs(double{c.t} - hit->t) > 1e-3 || c.frontFace() != hit->frontFace) {
            return "place of a candidate (" + numbersOf(c) + ": expected " +
                   placeInWords(hit->t, hit->u, hit->v, hit->frontFace) + "; the device reported " +
                   placeInWords(double{c.t}, double{c.u}, double{c.v}, c.frontFace()) + ")";
        }
    }

    // They may come any number of times. The shader keeps no more of them, so nothing can be said of the others.
    if (result.candidateCount > kCapacity)
        return {};
    const auto seen = [&result](const Hit &hit) {
        return std::ranges::any_of(result.candidates, [&hit](const Candidate &c) { return names(hit, c); });
    };
    // The hit that stays: the nearest accepted triangle, or what the shader generated for a box.
    const Hit *nearest = nullptr;
    for (const Hit &h : hits) {
        if (!h.box && (h.opacity == Opacity::Opaque || confirms(ray, h)) && (nearest == nullptr || h.t < nearest->t))
            nearest = &h;
    }
    const double limit = std::min(nearest != nullptr ? nearest->t : double{ray.tMax},
                                  generated ? double{ray.generate} : double{ray.tMax});
    if (result.committed != kNone) {
        const auto hit = std::find_if(hits.begin(), hits.end(), [&](const Hit &h) {
            return h.box == (result.committed == kGenerated) && names(h, result);
        });
        if (hit != hits.end() && (result.frontFace & 16) != 0)
            return "origin, direction and transform of the committed hit do not fit together";
        if (hit != hits.end() && result.frontFace >> 8 != hit->record)
            return "record offset of the committed hit";
    }
    if (end != nullptr) {
        // It is dropped if an opaque hit or that of a box was found before, and is nearer: "If t > t_max, the candidate
        // is dropped" (Ray Closest Hit Determination).
        const bool nearer = result.t < end->t + 1e-3f;
        const bool opaque = nearer && result.committed == kTriangle && std::ranges::any_of(hits, [&](const Hit &h) {
                                return !h.box && h.opacity == Opacity::Opaque && names(h, result) &&
                                       std::abs(double{result.t} - h.t) < 1e-3;
                            });
        const bool ofBox = nearer && result.committed == kGenerated && generated;
        return opaque || ofBox ||
                       (result.committed == kTriangle && names(result, *end) && std::abs(result.t - end->t) < 1e-3f)
                   ? ""
                   : "the query was terminated, and its last candidate is neither committed nor behind another hit";
    }
    if (result.committed == kTriangle) {
        const auto hit = std::find_if(hits.begin(), hits.end(), [&](const Hit &h) {
            return !h.box && names(h, result) && (h.opacity == Opacity::Opaque || confirms(ray, h));
        });
        if (hit == hits.end())
            return opacityFault(scene, ray, result, "it as the committed hit");
        if (std::abs(double{result.u} - hit->u) > 1e-3 || std::abs(double{result.v} - hit->v) > 1e-3 ||
            std::abs(double{result.t} - hit->t) > 1e-3 || ((result.frontFace & 1) != 0) != hit->frontFace)
            return "place of the committed triangle (" + numbersOf(result) + ": expected " +
                   placeInWords(hit->t, hit->u, hit->v, hit->frontFace) + "; the device reported " +
                   placeInWords(double{result.t}, double{result.u}, double{result.v}, (result.frontFace & 1) != 0) +
                   ")";
        if ((ray.flags & kRayTerminateOnFirstHit) == 0 && hit->t > limit + 1e-3) {
            if (nearest != nullptr && hit->t > nearest->t + 1e-3 && !seen(*nearest))
                return opacityFault(scene, ray, *nearest, Deviation::Lost, "none, but one farther away");
            return "the committed triangle is not the nearest" + inWords(result);
        }
    } else if (result.committed == kGenerated) {
        if (!generated || (nearest != nullptr && double{ray.generate} > nearest->t + 1e-3 &&
                           (ray.flags & kRayTerminateOnFirstHit) == 0)) {
            if (generated && !seen(*nearest))
                return opacityFault(scene, ray, *nearest, Deviation::Lost, "none, but the hit of a box farther away");
            return "a generated hit that should not be" + inWords(result);
        }
        if (std::none_of(hits.begin(), hits.end(), [&](const Hit &h) { return h.box && names(h, result); }))
            return "the generated hit names no box";
    } else if (nearest != nullptr || generated) {
        if (nearest != nullptr && !seen(*nearest))
            return opacityFault(scene, ray, *nearest, Deviation::Lost, "none");
        return nearest != nullptr ? "a confirmed candidate was not committed" + inWords(*nearest)
                                  : "a generated hit was not committed";
    }

    // No candidate nearer than that hit may be missing.
    if ((ray.flags & kRayTerminateOnFirstHit) != 0 && result.committed != kNone)
        return {};
    for (const Hit &h : hits) {
        if (!h.certain || h.t > limit - 1e-3 || (!h.box && h.opacity == Opacity::Opaque))
            continue;
        if (seen(h))
            continue;
        if (h.box)
            return "a box is no candidate that the ray meets" + inWords(h);
        if (result.committed == kTriangle && names(h, result))
            return opacityFault(scene, ray, h, Deviation::Reported, "an opaque hit");
        return opacityFault(scene, ray, h, Deviation::Lost, "none");
    }
    return {};
}

} // namespace vellum::check::oracle
