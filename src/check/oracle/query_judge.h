// SPDX-License-Identifier: Apache-2.0
// Judges what a ray query saw.
#pragma once

#include <algorithm>
#include <string>

#include "check/oracle/scene_build.h"

namespace vellum::check::oracle
{

// Which candidate or hit a fault is about, in parentheses: "a missing candidate (instance 0, ...)".
template <class T>
std::string inWords(const T &x)
{
    return " (instance " + std::to_string(x.instance) + ", geometry " + std::to_string(x.geometry) + ", primitive " +
           std::to_string(x.primitive) + ", custom index " + std::to_string(x.customIndex) + ")";
}

// A fault without what varies from case to case, which is in parentheses or on further lines.
inline std::string causeOf(const std::string &fault)
{
    return fault.substr(0, std::min(fault.find(" ("), fault.find('\n')));
}

// Whether a hit that is to be shown once is several of the candidates: "This operation may be executed multiple times
// for the same intersection candidate unless VK_GEOMETRY_NO_DUPLICATE_ANY_HIT_INVOCATION_BIT_KHR was specified for the
// intersected geometry" (Triangle and Generated Intersection Candidates).
inline bool cameAgain(const Hit &hit, const std::vector<Candidate> &candidates)
{
    return hit.once && std::ranges::count_if(candidates, [&](const Candidate &c) { return names(hit, c); }) > 1;
}

// What is wrong with the result of a ray whose hits, by allHits, are not unsure; empty: nothing.
std::string queryFault(const Ray &ray, const std::vector<Hit> &hits, const Result &result);

} // namespace vellum::check::oracle
