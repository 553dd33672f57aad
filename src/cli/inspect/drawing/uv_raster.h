// Which triangle is at which pixel of a rectangle of the UV plane.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "bake/bake.h"

namespace vellum::cli
{

// A rectangle of the UV plane and the pixels that show it. v grows downwards, as in the image.
struct UvWindow {
    double left = 0;
    double top = 0;
    double scale = 1; // pixels for 1 of u or v
    std::uint32_t width = 0;
    std::uint32_t height = 0;
};

class UvRaster
{
public:
    explicit UvRaster(const UvWindow &window);

    // Gives the triangle's pixels that no triangle before has taken to it. A pixel is taken once, so any number of
    // triangles over each other costs little.
    void add(const TriangleUvs &uvs, std::int32_t number);
    [[nodiscard]] bool full() const { return m_free == 0; }

    // The number given to add(), or -1.
    [[nodiscard]] std::int32_t at(std::size_t x, std::size_t y) const { return m_numbers[y * m_window.width + x]; }

private:
    // The first free pixel of the row from `x` on; the width where there is none.
    std::uint32_t nextFree(std::uint32_t *row, std::uint32_t x) const;

    UvWindow m_window;
    std::vector<std::int32_t> m_numbers;
    std::vector<std::uint32_t> m_next; // in each row, by pixel and one more: itself if free, else one further on
    std::size_t m_free;
};

// Barycentrics of a place in the UV plane. Of no use where the triangle has no area.
class UvBarycentrics
{
public:
    explicit UvBarycentrics(const TriangleUvs &uvs);

    struct Weights {
        double u = 0;
        double v = 0;
        [[nodiscard]] double w() const { return 1 - u - v; }
    };
    [[nodiscard]] Weights at(double u, double v) const
    {
        const double x = u - m_originU;
        const double y = v - m_originV;
        return {x * m_uPerU + y * m_uPerV, x * m_vPerU + y * m_vPerV};
    }
    [[nodiscard]] bool usable() const { return m_usable; }
    // How fast each weight grows, per unit of the plane: the inverse of the triangle's heights.
    [[nodiscard]] double slopeU() const { return m_slopeU; }
    [[nodiscard]] double slopeV() const { return m_slopeV; }
    [[nodiscard]] double slopeW() const { return m_slopeW; }

private:
    double m_originU, m_originV;
    double m_uPerU = 0, m_uPerV = 0, m_vPerU = 0, m_vPerV = 0;
    double m_slopeU = 0, m_slopeV = 0, m_slopeW = 0;
    bool m_usable = false;
};

} // namespace vellum::cli
