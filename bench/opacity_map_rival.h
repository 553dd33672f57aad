// meshoptimizer's baker, by the C functions of its shared library (experimental ones, of 2026).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "bake/bake.h"

namespace vellum::bench
{

struct RivalResult {
    std::vector<unsigned char> data;
    std::vector<unsigned char> levels; // of each entry
    std::vector<unsigned> offsets;
    std::vector<int> indices; // of each triangle: an entry or a special index
};

class OpacityMapRival
{
public:
    // Throws std::runtime_error without the library or its functions. It stays loaded.
    explicit OpacityMapRival(const std::string &library);

    // Levels are those of `own`, the result of Vellum's baker for the same triangles.
    [[nodiscard]] RivalResult bake(const std::vector<std::uint8_t> &alpha, std::uint32_t size,
                                   const std::vector<TriangleUvs> &triangles, const Micromap &own) const;

private:
    using Measure = std::size_t (*)(unsigned char *, unsigned *, int *, const unsigned *, std::size_t, const float *,
                                    std::size_t, std::size_t, unsigned, unsigned, int, float);
    using Rasterize = void (*)(unsigned char *, int, int, const float *, const float *, const float *,
                               const unsigned char *, std::size_t, std::size_t, unsigned, unsigned);
    using Compact = std::size_t (*)(unsigned char *, std::size_t, unsigned char *, unsigned *, std::size_t, int *,
                                    std::size_t, int);

    Measure m_measure;
    Rasterize m_rasterize;
    Compact m_compact;
};

struct RivalScore {
    double unknown;         // share of micro-triangles
    double wrongPerMillion; // of those that it claims to know
};

// `exact` is the result of Vellum's baker without tolerances: what it does not claim nobody may.
RivalScore score(const RivalResult &theirs, const Micromap &exact);

} // namespace vellum::bench
