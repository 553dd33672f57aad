// SPDX-License-Identifier: Apache-2.0
#include "bake/exact.h"

#include <algorithm>
#include <cmath>

#include "bake/numbers/wide.h"

namespace vellum
{
namespace
{

// Binary digits after the point.
int fractionBits(double value)
{
    if (value == 0)
        return 0;
    int exponent = 0;
    auto mantissa = static_cast<int64_t>(std::ldexp(std::frexp(value, &exponent), 53));
    for (exponent -= 53; mantissa % 2 == 0; ++exponent)
        mantissa /= 2;
    return std::max(0, -exponent);
}

// Products of two numbers that are within this are added up without overflow.
constexpr int64_t kSmall = int64_t{1} << 61;

// Returns whether a closed triangle, which may be a segment or a point, touches a box less its right or bottom side
// where those are open. Two convex sets are apart if and only if they are along x, along y or across an edge. The box
// without its side is the union of those that end a little before it: they must overlap by more than a point where an
// end moves.
template <typename Point>
bool touchesSmall(const std::array<Point, 3> &corners, int64_t left, int64_t top, int64_t right, int64_t bottom,
                  bool openRight, bool openBottom)
{
    const auto [minX, maxX] = std::minmax({corners[0].x, corners[1].x, corners[2].x});
    const auto [minY, maxY] = std::minmax({corners[0].y, corners[1].y, corners[2].y});
    if (maxX < left || maxY < top || (openRight ? minX >= right : minX > right) ||
        (openBottom ? minY >= bottom : minY > bottom))
        return false;
    for (size_t i = 0; i < 3; ++i) {
        const Point &start = corners[i];
        const Point &end = corners[(i + 1) % 3];
        const Int128 normalX = start.y - end.y;
        const Int128 normalY = end.x - start.x;
        const auto along = [&](int64_t x, int64_t y) { return normalX * x + normalY * y; };
        const Int128 edge = along(start.x, start.y);
        const Int128 other = along(corners[(i + 2) % 3].x, corners[(i + 2) % 3].y);
        const Int128 most = along(normalX > 0 ? right : left, normalY > 0 ? bottom : top);
        const Int128 least = along(normalX > 0 ? left : right, normalY > 0 ? top : bottom);
        const bool mostIsOpen = (normalX > 0 && openRight) || (normalY > 0 && openBottom);
        const bool leastIsOpen = (normalX < 0 && openRight) || (normalY < 0 && openBottom);
        const Int128 from = std::min(edge, other);
        const Int128 to = std::max(edge, other);
        if ((mostIsOpen ? from >= most : from > most) || (leastIsOpen ? to <= least : to < least))
            return false;
    }
    return true;
}

BigInt cross(const BigInt &ax, const BigInt &ay, const BigInt &bx, const BigInt &by)
{
    return ax * by - ay * bx;
}

} // namespace

struct ExactTriangle::Rational {
    BigInt numerator;
    BigInt denominator; // positive

    [[nodiscard]] bool operator<(const Rational &other) const
    {
        return compare(numerator * other.denominator, other.numerator * denominator) < 0;
    }
};

// A part of a segment, from 0 at its start to 1 at its end.
struct ExactTriangle::Range {
    Rational from{BigInt(0), BigInt(1)};
    Rational to{BigInt(1), BigInt(1)};
    bool empty = false;

    // Keeps where low <= start + s * delta <= high.
    void clip(const BigInt &start, const BigInt &delta, const BigInt &low, const BigInt &high)
    {
        if (delta.sign() == 0) {
            empty = empty || compare(start, low) < 0 || compare(start, high) > 0;
            return;
        }
        const bool rising = delta.sign() > 0;
        const BigInt length = rising ? delta : -delta;
        const Rational entry{rising ? low - start : start - high, length};
        const Rational exit{rising ? high - start : start - low, length};
        if (from < entry)
            from = entry;
        if (exit < to)
            to = exit;
        empty = empty || to < from;
    }
};

struct ExactTriangle::Box {
    BigInt left, top, right, bottom;

    [[nodiscard]] Range clip(const Point &start, const Point &delta) const
    {
        Range range;
        range.clip(start.x, delta.x, left, right);
        if (!range.empty)
            range.clip(start.y, delta.y, top, bottom);
        return range;
    }
};

// The filtered value in a cell, minus the cutoff: c + cx * x + cy * y + cxy * x * y, where x and y are in texels.
struct ExactTriangle::Patch {
    BigInt c, cx, cy, cxy;
};

ExactTriangle::ExactTriangle(const AlphaTexture &texture, double cutoff, const TriangleUvs &uvs, uint32_t level)
    : filter_(texture.filter),
      // No texel is as large as that, and the number of digits stays bounded.
      cutoff_(std::clamp(cutoff, -0x1p129, 0x1p129)), level_(level)
{
    int bitsX = 0;
    int bitsY = 0;
    for (const TexCoord &uv : uvs) {
        bitsX = std::max(bitsX, fractionBits(double{uv.u}));
        bitsY = std::max(bitsY, fractionBits(double{uv.v}));
    }
    // Lattice points divide by 2^level, and centres of texels by 2.
    shiftX_ = static_cast<unsigned>(bitsX) + level + 1;
    shiftY_ = static_cast<unsigned>(bitsY) + level + 1;
    for (size_t i = 0; i < 3; ++i) {
        vertices_[i].x = BigInt::scaled(double{uvs[i].u}, bitsX) * BigInt(texture.width);
        vertices_[i].y = BigInt::scaled(double{uvs[i].v}, bitsY) * BigInt(texture.height);
    }
    for (size_t i = 1; i < 3; ++i) {
        vertices_[i].x = vertices_[i].x - vertices_[0].x;
        vertices_[i].y = vertices_[i].y - vertices_[0].y;
    }

    small_ = shiftX_ < 60 && shiftY_ < 60;
    const auto whole = [&](float coordinate, int bits, uint32_t size) {
        const double scaled = std::ldexp(double{coordinate}, bits);
        small_ = small_ && std::abs(scaled) * size < static_cast<double>(kSmall / 2);
        return small_ ? static_cast<int64_t>(scaled) * size : 0;
    };
    for (size_t i = 0; i < 3; ++i)
        smallVertices_[i] = {whole(uvs[i].u, bitsX, texture.width), whole(uvs[i].v, bitsY, texture.height)};
    for (size_t i = 1; i < 3; ++i) {
        smallVertices_[i].x -= smallVertices_[0].x;
        smallVertices_[i].y -= smallVertices_[0].y;
    }
}

ExactTriangle::Point ExactTriangle::place(LatticePoint point) const
{
    const auto along = [&](const BigInt &base, const BigInt &first, const BigInt &second, unsigned shift) {
        const BigInt sum = (base << level_) + first * BigInt(point.i) + second * BigInt(point.j);
        return (sum << 1) - (BigInt(1) << (shift - 1)); // cells begin at centres of texels
    };
    return {along(vertices_[0].x, vertices_[1].x, vertices_[2].x, shiftX_),
            along(vertices_[0].y, vertices_[1].y, vertices_[2].y, shiftY_)};
}

ExactTriangle::Patch ExactTriangle::patch(const Cell &cell) const
{
    int bits = fractionBits(cutoff_);
    for (const float f : {cell.f00, cell.f10, cell.f01, cell.f11})
        bits = std::max(bits, fractionBits(double{f}));
    const auto scaled = [bits](float f) { return BigInt::scaled(double{f}, bits); };
    const BigInt f00 = scaled(cell.f00);
    const BigInt f10 = scaled(cell.f10);
    const BigInt f01 = scaled(cell.f01);
    return {f00 - BigInt::scaled(cutoff_, bits), f10 - f00, f01 - f00, scaled(cell.f11) - f10 - f01 + f00};
}

namespace
{

bool allFinite(const Cell &cell)
{
    return std::isfinite(cell.f00) && std::isfinite(cell.f10) && std::isfinite(cell.f01) && std::isfinite(cell.f11);
}

} // namespace

// Returns whether the closed triangle touches the box, less its right or bottom side where those are open.
bool ExactTriangle::touches(const std::array<Point, 3> &corners, const Box &box, bool openRight, bool openBottom) const
{
    // The two meet in a convex set. If some point of it is left of the right side, and some is above the bottom, then
    // the middle between those is both.
    bool left = !openRight;
    bool above = !openBottom;
    bool any = false;
    for (size_t i = 0; i < 3; ++i) {
        const Point &start = corners[i];
        const Point delta{corners[(i + 1) % 3].x - start.x, corners[(i + 1) % 3].y - start.y};
        const Range range = box.clip(start, delta);
        if (range.empty)
            continue;
        any = true;
        for (const Rational &s : {range.from, range.to}) {
            left = left || compare(start.x * s.denominator + delta.x * s.numerator, box.right * s.denominator) < 0;
            above = above || compare(start.y * s.denominator + delta.y * s.numerator, box.bottom * s.denominator) < 0;
        }
    }
    const auto turn = [&](size_t i, const BigInt &x, const BigInt &y) {
        const Point &a = corners[i];
        const Point &b = corners[(i + 1) % 3];
        return cross(b.x - a.x, b.y - a.y, x - a.x, y - a.y).sign();
    };
    const int area = turn(0, corners[2].x, corners[2].y);
    for (int corner = 0; corner < 4 && area != 0; ++corner) {
        const bool atRight = corner % 2 != 0;
        const bool atBottom = corner / 2 != 0;
        const BigInt &x = atRight ? box.right : box.left;
        const BigInt &y = atBottom ? box.bottom : box.top;
        if (turn(0, x, y) * area < 0 || turn(1, x, y) * area < 0 || turn(2, x, y) * area < 0)
            continue;
        any = true;
        left = left || !atRight;
        above = above || !atBottom;
    }
    return any && left && above;
}

// Nothing if the micro-triangle is far from the cell, or has too many digits.
std::optional<std::array<ExactTriangle::SmallPoint, 3>>
ExactTriangle::smallCorners(const std::array<LatticePoint, 3> &lattice, const Cell &cell) const
{
    if (!small_)
        return std::nullopt;
    bool fits = true;
    // Computes place(), less where the cell begins.
    const auto along = [&](int64_t base, int64_t first, int64_t second, const LatticePoint &point, unsigned shift,
                           int64_t begin) {
        const Int128 sum = (static_cast<Int128>(base) << level_) + static_cast<Int128>(first) * point.i +
                           static_cast<Int128>(second) * point.j;
        const Int128 place = 2 * sum - (Int128{1} << (shift - 1)) - static_cast<Int128>(begin) * (Int128{1} << shift);
        fits = fits && place > -kSmall && place < kSmall;
        return static_cast<int64_t>(place);
    };
    std::array<SmallPoint, 3> corners{};
    const auto &[base, first, second] = smallVertices_;
    for (size_t i = 0; i < 3; ++i)
        corners[i] = {along(base.x, first.x, second.x, lattice[i], shiftX_, cell.x),
                      along(base.y, first.y, second.y, lattice[i], shiftY_, cell.y)};
    return fits ? std::optional(corners) : std::nullopt;
}

template <typename Touches>
bool ExactTriangle::crossesNearest(const Cell &cell, Touches &&touchesQuarter) const
{
    bool opaque = false;
    bool transparent = false;
    const float texels[] = {cell.f00, cell.f10, cell.f01, cell.f11};
    for (unsigned quarter = 0; quarter < 4; ++quarter) {
        const float texel = texels[quarter];
        const bool newOpaque = !std::isfinite(texel) || double{texel} >= cutoff_;
        const bool newTransparent = !std::isfinite(texel) || double{texel} < cutoff_;
        if ((!newOpaque || opaque) && (!newTransparent || transparent))
            continue;
        if (touchesQuarter(quarter % 2 != 0, quarter / 2 != 0)) {
            opaque = opaque || newOpaque;
            transparent = transparent || newTransparent;
        }
    }
    return opaque && transparent;
}

// A position half way between two centres reads the texel behind it.
bool ExactTriangle::crossesNearest(const std::array<LatticePoint, 3> &lattice, const Cell &cell) const
{
    if (const auto corners = smallCorners(lattice, cell)) {
        const int64_t middleX = int64_t{1} << (shiftX_ - 1);
        const int64_t middleY = int64_t{1} << (shiftY_ - 1);
        return crossesNearest(cell, [&](bool right, bool bottom) {
            return touchesSmall(*corners, right ? middleX : 0, bottom ? middleY : 0, right ? 2 * middleX : middleX,
                                bottom ? 2 * middleY : middleY, !right, !bottom);
        });
    }
    const std::array<Point, 3> corners = cornersIn(lattice, cell);
    const BigInt middleX = BigInt(1) << (shiftX_ - 1);
    const BigInt middleY = BigInt(1) << (shiftY_ - 1);
    return crossesNearest(cell, [&](bool right, bool bottom) {
        const Box box{right ? middleX : BigInt(0), bottom ? middleY : BigInt(0), right ? middleX << 1 : middleX,
                      bottom ? middleY << 1 : middleY};
        return touches(corners, box, !right, !bottom);
    });
}

std::array<ExactTriangle::Point, 3> ExactTriangle::cornersIn(const std::array<LatticePoint, 3> &lattice,
                                                             const Cell &cell) const
{
    std::array<Point, 3> corners;
    for (size_t i = 0; i < 3; ++i) {
        corners[i] = place(lattice[i]);
        corners[i].x = corners[i].x - (BigInt(cell.x) << shiftX_);
        corners[i].y = corners[i].y - (BigInt(cell.y) << shiftY_);
    }
    return corners;
}

bool ExactTriangle::crosses(const std::array<LatticePoint, 3> &lattice, const Cell &cell) const
{
    if (filter_ == Filter::Nearest)
        return crossesNearest(lattice, cell);
    const BigInt unitX = BigInt(1) << shiftX_;
    const BigInt unitY = BigInt(1) << shiftY_;
    const std::array<Point, 3> corners = cornersIn(lattice, cell);
    const Box box{BigInt(0), BigInt(0), unitX, unitY};
    if (!allFinite(cell))
        return touches(corners, box, false, false);

    bool opaque = false;
    bool transparent = false;
    const auto add = [&](int sign) { (sign < 0 ? transparent : opaque) = true; };
    const Patch f = patch(cell);
    // A bilinear function has no extreme inside: its Hessian is indefinite. What is left are the corners of the part,
    // and the places on its slanted edges where the function stops to rise or to fall. Every corner of the part is the
    // end of a clipped edge or a corner of the cell.
    for (size_t i = 0; i < 3; ++i) {
        const Point &a = corners[i];
        const Point d{corners[(i + 1) % 3].x - a.x, corners[(i + 1) % 3].y - a.y};
        const Range range = box.clip(a, d);
        if (range.empty)
            continue;
        // On the edge, times unitX * unitY: q2 s^2 + q1 s + q0.
        const BigInt q2 = f.cxy * d.x * d.y;
        const BigInt q1 = ((f.cx * d.x) << shiftY_) + ((f.cy * d.y) << shiftX_) + f.cxy * (a.x * d.y + a.y * d.x);
        const BigInt q0 =
            ((f.c << shiftY_) << shiftX_) + ((f.cx * a.x) << shiftY_) + ((f.cy * a.y) << shiftX_) + f.cxy * a.x * a.y;
        for (const Rational &s : {range.from, range.to})
            add(((q2 * s.numerator + q1 * s.denominator) * s.numerator + q0 * s.denominator * s.denominator).sign());
        if (q2.sign() == 0)
            continue;
        const bool positive = q2.sign() > 0;
        const Rational turn{positive ? -q1 : q1, positive ? q2 << 1 : (-q2) << 1};
        if (range.from < turn && turn < range.to)
            add((((q2 * q0) << 2) - q1 * q1).sign() * q2.sign());
    }
    const float texels[] = {cell.f00, cell.f10, cell.f01, cell.f11};
    for (unsigned corner = 0; corner < 4 && !(opaque && transparent); ++corner) {
        const bool isOpaque = double{texels[corner]} >= cutoff_;
        if (isOpaque ? opaque : transparent)
            continue;
        const Box point{corner % 2 != 0 ? unitX : BigInt(0), corner / 2 != 0 ? unitY : BigInt(0),
                        corner % 2 != 0 ? unitX : BigInt(0), corner / 2 != 0 ? unitY : BigInt(0)};
        if (touches(corners, point, false, false))
            add(isOpaque ? 1 : -1);
    }
    return opaque && transparent;
}

int ExactTriangle::side(LatticePoint point, const CellMap &map) const
{
    const Point place = this->place(point);
    const Cell cell = map.cell(place.x.floorShift(shiftX_), place.y.floorShift(shiftY_));
    const BigInt x = place.x - (BigInt(cell.x) << shiftX_);
    const BigInt y = place.y - (BigInt(cell.y) << shiftY_);
    if (filter_ == Filter::Nearest) {
        const bool right = compare(x, BigInt(1) << (shiftX_ - 1)) >= 0;
        const bool bottom = compare(y, BigInt(1) << (shiftY_ - 1)) >= 0;
        const float texel = bottom ? (right ? cell.f11 : cell.f01) : (right ? cell.f10 : cell.f00);
        return !std::isfinite(texel) ? -1 : double{texel} >= cutoff_ ? 1 : 0;
    }
    if (!allFinite(cell))
        return -1;
    const Patch f = patch(cell);
    const BigInt value =
        ((f.c << shiftY_) << shiftX_) + ((f.cx * x) << shiftY_) + ((f.cy * y) << shiftX_) + f.cxy * x * y;
    return value.sign() >= 0 ? 1 : 0;
}

} // namespace vellum
