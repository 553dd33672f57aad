// SPDX-License-Identifier: Apache-2.0
#include "verify/verify.h"

#include <algorithm>
#include <cstring>
#include <numeric>
#include <stdexcept>

#include "core/parallel.h"
#include "verify/walk.h"

namespace vellum::verify
{
namespace
{

// Triangles with the same coordinates and the same index have the same findings.
struct Groups {
    std::vector<uint32_t> first; // of each group, a triangle
    std::vector<uint32_t> of;    // for each triangle, its group
};

Groups groupsOf(std::span<const TriangleCorners> triangles, const Micromap &micromap)
{
    static_assert(sizeof(TriangleCorners) == 10 * sizeof(float)); // no padding
    const auto compare = [&](uint32_t a, uint32_t b) {
        if (micromap.indices[a] != micromap.indices[b])
            return micromap.indices[a] < micromap.indices[b] ? -1 : 1;
        return std::memcmp(&triangles[a], &triangles[b], sizeof(TriangleCorners));
    };
    std::vector<uint32_t> order(triangles.size());
    std::iota(order.begin(), order.end(), 0u);
    std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
        const int difference = compare(a, b);
        return difference != 0 ? difference < 0 : a < b;
    });
    Groups groups;
    groups.of.resize(triangles.size());
    for (size_t i = 0; i < order.size(); ++i) {
        if (i == 0 || compare(order[i - 1], order[i]) != 0)
            groups.first.push_back(order[i]);
        groups.of[order[i]] = static_cast<uint32_t>(groups.first.size() - 1);
    }
    return groups;
}

Claims claimsOf(const Micromap &micromap, uint32_t triangle, const Options &options)
{
    const int32_t index = micromap.indices[triangle];
    if (const auto special = specialState(index)) {
        const bool known = *special == State::Opaque || *special == State::Transparent;
        return {nullptr, *special, 0, known && options.twoStateSpecials ? Format::TwoState : Format::FourState};
    }
    const MicromapTriangle &t = micromap.triangles[static_cast<uint32_t>(index) + micromap.baseTriangle];
    return {micromap.data.data() + t.dataOffset, State::Opaque, t.subdivisionLevel, t.format};
}

// The result for a group.
struct Looked {
    Counts counts;
    uint64_t limit = 0; // of its work
    uint64_t work = 0;
};

// Groups are looked at in blocks, so that what one may cost does not depend on which thread is first.
constexpr size_t kBlock = 256;

// Goes through the triangles with findings once more, until there are enough.
std::vector<Finding> list(const Texels &texels, std::span<const TriangleCorners> triangles, const Micromap &micromap,
                          const Options &options, const Groups &groups, const std::vector<Looked> &looked,
                          uint64_t &work)
{
    std::vector<Finding> findings;
    std::array<size_t, kKinds> listed{};
    for (uint32_t t = 0; t < triangles.size(); ++t) {
        const Counts &its = looked[groups.of[t]].counts;
        bool wanted = false;
        for (size_t kind = 0; kind < kKinds; ++kind)
            wanted = wanted || (its.findings[kind] > 0 && listed[kind] < options.maxFindings);
        if (!wanted || work >= options.work)
            continue;
        std::vector<Finding> here;
        TriangleWalk walk(texels, triangles[t], claimsOf(micromap, t, options), options, looked[groups.of[t]].limit,
                          &here);
        walk();
        work += walk.worked();
        for (Finding &finding : here) {
            if (listed[static_cast<size_t>(finding.kind)]++ >= options.maxFindings)
                continue;
            finding.triangle = t;
            findings.push_back(finding);
        }
    }
    return findings;
}

} // namespace

Counts &Counts::operator+=(const Counts &other)
{
    opaque += other.opaque;
    transparent += other.transparent;
    unknown += other.unknown;
    for (size_t i = 0; i < kKinds; ++i)
        findings[i] += other.findings[i];
    open += other.open;
    twoStateTrue += other.twoStateTrue;
    twoStateMixed += other.twoStateMixed;
    twoStateReversed += other.twoStateReversed;
    return *this;
}

uint64_t Counts::microTriangles() const
{
    return opaque + transparent + unknown + twoStateTrue + twoStateMixed + twoStateReversed;
}

Result verify(const AlphaTexture &texture, std::span<const TriangleCorners> triangles, const Micromap &micromap,
              const Options &options)
{
    return verify(Texels(texture), triangles, micromap, options);
}

Result verify(const Texels &texels, std::span<const TriangleCorners> triangles, const Micromap &micromap,
              const Options &options)
{
    if (const auto finding = micromap.validate())
        throw std::invalid_argument(*finding);
    if (micromap.indices.size() != triangles.size())
        throw std::invalid_argument("a micromap with " + std::to_string(micromap.indices.size()) + " indices for " +
                                    std::to_string(triangles.size()) + " triangles");

    const Groups groups = groupsOf(triangles, micromap);
    std::vector<Looked> looked(groups.first.size());
    Progress progress(options.progress, looked.size());
    const unsigned threads = threadCount(options.threads);
    const auto claims = [&](size_t group) { return claimsOf(micromap, groups.first[group], options); };
    Result result;
    size_t first = 0;
    while (first < looked.size() && result.work < options.work) {
        const uint64_t left = options.work - result.work;
        size_t count = 0;
        for (uint64_t least = 0; count < kBlock && first + count < looked.size() && (count == 0 || least < left);)
            least += TriangleWalk::leastWork(claims(first + count++));
        inParallel(threads, count, [&](size_t i) {
            Looked &group = looked[first + i];
            group.limit = left / count;
            const uint32_t t = groups.first[first + i];
            TriangleWalk walk(texels, triangles[t], claims(first + i), options, group.limit, nullptr);
            group.counts = walk();
            group.work = walk.worked();
            progress.done(1);
        });
        for (size_t i = first; i < first + count; ++i)
            result.work += looked[i].work;
        first += count;
    }
    for (; first < looked.size(); ++first)
        looked[first].counts.open = microTriangleCount(claims(first).level);

    result.distinct = looked.size();
    for (const uint32_t group : groups.of)
        result.counts += looked[group].counts;
    result.findings = list(texels, triangles, micromap, options, groups, looked, result.work);
    return result;
}

} // namespace vellum::verify
