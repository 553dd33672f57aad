// SPDX-License-Identifier: Apache-2.0
#include "check/oracle/query_judge.h"

#include <algorithm>
#include <cmath>

namespace vellum::check::oracle
{

std::string queryFault(const Ray &ray, const std::vector<Hit> &hits, const Result &result)
{
    if (result.flags != ray.flags)
        return "ray flags read back wrong (" + std::to_string(result.flags) + ")";
    if (result.tMin < ray.tMin || result.tMin > ray.tMin)
        return "tMin read back wrong";
    if (result.candidateCount > kCapacity)
        return "too many candidates";

    // Every candidate must be one that traversal may hand out.
    bool generated = false;
    const Candidate *end = nullptr; // at which the shader terminated the query
    for (const Candidate &c : result.candidates) {
        const auto hit = std::find_if(hits.begin(), hits.end(), [&c](const Hit &h) {
            return names(h, c) && h.box == c.box() && (h.box || h.opacity == Opacity::NonOpaque);
        });
        if (hit == hits.end())
            return "an invalid candidate" + inWords(c);
        if (end != nullptr)
            return "a candidate after the query was terminated" + inWords(c);
        if (!c.box() && c.confirmed() && ray.rule == kTerminate)
            end = &c;
        if (!c.consistent())
            return "origin, direction and transform of a candidate do not fit together" + inWords(c);
        if (c.recordOffset() != hit->record)
            return "record offset of a candidate" + inWords(c);
        if (cameAgain(*hit, result.candidates))
            return "a candidate came twice" + inWords(c);
        if (hit->box) {
            generated |= c.confirmed();
            if (c.boxOpaque() != (hit->opacity == Opacity::Opaque))
                return "candidateAABBOpaque";
        } else if (std::abs(double{c.u} - hit->u) > 1e-3 || std::abs(double{c.v} - hit->v) > 1e-3 ||
                   std::abs(double{c.t} - hit->t) > 1e-3 || c.frontFace() != hit->frontFace) {
            return "place of a candidate";
        }
    }

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
    if (end != nullptr)
        return result.committed == kTriangle && names(result, *end) && std::abs(result.t - end->t) < 1e-3f
                   ? ""
                   : "the query was terminated, and not its last candidate is committed";
    if (result.committed == kTriangle) {
        const auto hit = std::find_if(hits.begin(), hits.end(), [&](const Hit &h) {
            return !h.box && names(h, result) && (h.opacity == Opacity::Opaque || confirms(ray, h));
        });
        if (hit == hits.end())
            return "the committed triangle is not one that may be committed";
        if (std::abs(double{result.u} - hit->u) > 1e-3 || std::abs(double{result.v} - hit->v) > 1e-3 ||
            std::abs(double{result.t} - hit->t) > 1e-3 || ((result.frontFace & 1) != 0) != hit->frontFace)
            return "place of the committed triangle";
        if ((ray.flags & kRayTerminateOnFirstHit) == 0 && hit->t > limit + 1e-3)
            return "the committed triangle is not the nearest";
    } else if (result.committed == kGenerated) {
        if (!generated || (nearest != nullptr && double{ray.generate} > nearest->t + 1e-3 &&
                           (ray.flags & kRayTerminateOnFirstHit) == 0))
            return "a generated hit that should not be";
        if (std::none_of(hits.begin(), hits.end(), [&](const Hit &h) { return h.box && names(h, result); }))
            return "the generated hit names no box";
    } else if (nearest != nullptr || generated) {
        return "nothing committed";
    }

    // No candidate nearer than that hit may be missing.
    if ((ray.flags & kRayTerminateOnFirstHit) != 0 && result.committed != kNone)
        return {};
    for (const Hit &h : hits) {
        if (!h.certain || h.t > limit - 1e-3 || (!h.box && h.opacity == Opacity::Opaque))
            continue;
        if (std::none_of(result.candidates.begin(), result.candidates.end(),
                         [&h](const Candidate &c) { return names(h, c); }))
            return "a missing candidate" + inWords(h);
    }
    return {};
}

} // namespace vellum::check::oracle
