// Which outcomes of the alpha test are possible where: the texture cut into cells over each of which the filter reads
// the same texels.
//
// With bilinear filtering, cell (i, j) is the square between the centres of texels (i, j) and (i + 1, j + 1); with
// nearest filtering it is texel (i, j). Cells are addressed by unwrapped positions, as texture coordinates are.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "bake/texture.h"

namespace vellum
{

// A set of possible outcomes.
enum Outcome : unsigned {
    kMayBeTransparent = 1,
    kMayBeOpaque = 2,
    kMayBeEither = 3,
};

// A triangle in cell coordinates, and how far around it (in each axis) samples for it can fall.
struct Footprint {
    struct Point {
        double x, y;
    };
    std::array<Point, 3> corners;
    double marginX;
    double marginY;
};

class CellGrid
{
public:
    CellGrid(const AlphaTexture &texture, double cutoff, double valueTolerance);

    // Cell coordinates of the texture coordinate (u, v): floor of them is the cell.
    [[nodiscard]] Footprint::Point position(double u, double v) const;
    // Outcomes that samples in the footprint can have, a superset. Coordinates must be below 2^31.
    [[nodiscard]] unsigned outcomes(const Footprint &footprint) const;

private:
    // One axis: how unwrapped cells map to stored ones.
    struct Axis {
        std::int64_t size; // texels
        Wrap wrap;
        bool bilinear;
        [[nodiscard]] std::int64_t stored() const { return bilinear ? size + 1 : size; }
        [[nodiscard]] std::int64_t map(std::int64_t cell) const;
    };
    // How many cells before this one in its row can be transparent, and opaque.
    struct Before {
        std::uint32_t transparent, opaque;
    };
    struct Range {
        double low, high;
    };

    [[nodiscard]] unsigned outcomesOf(double low, double high) const;
    [[nodiscard]] unsigned storedRange(std::int64_t first, std::int64_t last, std::int64_t row) const;
    [[nodiscard]] unsigned rowRange(std::int64_t first, std::int64_t last, std::int64_t row) const;
    [[nodiscard]] unsigned insideCell(std::int64_t x, std::int64_t y, Range across, Range down) const;
    [[nodiscard]] bool farTooLarge(std::int64_t rows) const;

    const AlphaTexture &m_texture;
    double m_opaqueFrom;
    double m_transparentBelow;
    Axis m_u;
    Axis m_v;
    unsigned m_everywhere = 0;
    std::vector<Before> m_before; // stored rows of m_u.stored() + 1 entries
};

} // namespace vellum
