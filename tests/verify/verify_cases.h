// SPDX-License-Identifier: Apache-2.0
// Micromaps with any states, for the tests of verification.
#pragma once

#include <vector>

#include "bake/bake.h"
#include "bake_cases.h"
#include "verify/verify.h"

namespace vellum::test
{

inline std::vector<verify::TriangleCorners> toCorners(const std::vector<TriangleUvs> &triangles)
{
    std::vector<verify::TriangleCorners> corners;
    for (const TriangleUvs &t : triangles)
        corners.push_back({{t[0].u, t[1].u, t[2].u}, {t[0].v, t[1].v, t[2].v}, {1, 1, 1}});
    return corners;
}

// One micromap triangle for each of `triangles`, each with its own states.
inline Micromap emptyMicromap(size_t triangles, uint32_t level, Format format)
{
    Micromap micromap;
    for (size_t t = 0; t < triangles; ++t) {
        micromap.triangles.push_back(
            {static_cast<uint32_t>(micromap.data.size()), static_cast<uint16_t>(level), format});
        micromap.data.resize(micromap.data.size() + packedBytes(level, format));
        micromap.indices.push_back(static_cast<int32_t>(t));
    }
    return micromap;
}

inline void setState(Micromap &micromap, uint32_t triangle, uint32_t micro, State state)
{
    const MicromapTriangle &t = micromap.triangles[triangle];
    writeState(micromap.data.data() + t.dataOffset, micro, t.format, state);
}

// Each triangle gets its own data, special indices as well.
inline Micromap unshared(const Micromap &baked, uint32_t level)
{
    Micromap micromap = emptyMicromap(baked.indices.size(), level, Format::FourState);
    for (uint32_t t = 0; t < baked.indices.size(); ++t) {
        const auto special = specialState(baked.indices[t]);
        for (uint32_t i = 0; i < microTriangleCount(level); ++i) {
            if (special) {
                setState(micromap, t, i, *special);
                continue;
            }
            const MicromapTriangle &from = baked.triangles[static_cast<size_t>(baked.indices[t])];
            setState(micromap, t, i, readState(baked.data.data() + from.dataOffset, i, from.format));
        }
    }
    return micromap;
}

inline verify::Options verifyOptions(const BakeOptions &bake)
{
    verify::Options options;
    options.cutoff = bake.cutoff;
    options.tolerances = {bake.valueTolerance, bake.subtexelTolerance, bake.barycentricTolerance,
                          bake.interpolationTolerance};
    options.threads = 1;
    options.maxFindings = size_t{1} << 30;
    return options;
}

} // namespace vellum::test
