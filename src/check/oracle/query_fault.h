// SPDX-License-Identifier: Apache-2.0
// Checks what a ray query observed.
#pragma once

#include <algorithm>
#include <optional>
#include <string>
#include <string_view>

#include "check/oracle/scene_build.h"

namespace vellum::check::oracle
{

// Identifies the candidate or hit in a fault: "instance 0, geometry 1, primitive 5".
template <class T>
std::string numbersOf(const T &x)
{
    return "instance " + std::to_string(x.instance) + ", geometry " + std::to_string(x.geometry) + ", primitive " +
           std::to_string(x.primitive);
}
// The description in parentheses, with the custom index.
template <class T>
std::string inWords(const T &x)
{
    return " (" + numbersOf(x) + ", custom index " + std::to_string(x.customIndex) + ")";
}

inline constexpr std::string_view kOpacityCause = "wrong opacity of a triangle";
// Of a triangle without a micromap.
inline constexpr std::string_view kNotMetCause = "a triangle is not met";
inline constexpr std::string_view kMetCause = "a triangle is met that should not be";
// The device did not report a triangle that it must report, or reported one otherwise than it must.
enum class Deviation { Lost, Reported };
// The fault that a triangle is opaque, non-opaque or ignored otherwise than expected: what is expected of it and why,
// and what the device reported of it instead. If micromaps cannot be the reason that it is lost or met, the fault has
// another cause than its opacity.
std::string opacityFault(const Scene &scene, const Ray &ray, const Hit &hit, Deviation deviation,
                         const std::string &reported);
// How well a cause describes the fault of several rays, of which some have other causes.
int rankOf(std::string_view cause);
// Returns whether the ray ignores the triangle for another reason than its opacity.
bool culledByFacing(const Scene &scene, const Ray &ray, const Hit &hit);
// Describes a hit that the device must not report: with another cause if the ray does not meet that triangle at all.
template <class T>
std::string opacityFault(const Scene &scene, const Ray &ray, const T &named, const std::string &reported)
{
    if (const std::optional<Hit> hit = hitOf(scene, ray, named.instance, named.geometry, named.primitive);
        hit && hit->customIndex == named.customIndex && !culledByFacing(scene, ray, *hit))
        return opacityFault(scene, ray, *hit, Deviation::Reported, reported);
    return "a hit of something that the ray does not meet" + inWords(named) + ": the device reported " + reported;
}

// A fault without what varies from case to case, which is in parentheses or on further lines.
inline std::string causeOf(const std::string &fault)
{
    return fault.substr(0, std::min(fault.find(" ("), fault.find('\n')));
}

// Returns whether a hit that is to be shown once is several of the candidates: "This operation may be executed multiple
// times for the same intersection candidate unless VK_GEOMETRY_NO_DUPLICATE_ANY_HIT_INVOCATION_BIT_KHR was specified
// for the intersected geometry" (Triangle and Generated Intersection Candidates).
inline bool cameAgain(const Hit &hit, const std::vector<Candidate> &candidates)
{
    return hit.once && std::ranges::count_if(candidates, [&](const Candidate &c) { return names(hit, c); }) > 1;
}

// The fault of the result of a ray whose hits, by allHits, are not unsure; empty: none.
std::string queryFault(const Scene &scene, const Ray &ray, const std::vector<Hit> &hits, const Result &result);

} // namespace vellum::check::oracle
