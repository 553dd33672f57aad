// SPDX-License-Identifier: Apache-2.0
#include "verify/region.h"

#include <algorithm>
#include <array>
#include <boost/multiprecision/cpp_int.hpp>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

namespace vellum::verify
{
namespace
{

// At distances of more than this many texels, single precision does not distinguish texels; the baker leaves that
// unknown.
constexpr double kFar = 0x1p24;
constexpr double kImmeasurable = 0x1p40;
// Parts of at most so many texels are looked at cell by cell.
constexpr double kSmall = 2;
// If the factor varies within a triangle, small parts are divided this many more times.
constexpr unsigned kFiner = 6;
// Cells of one micro-triangle that are decided exactly, and what one is worth in parts.
constexpr size_t kMostOpenCells = 1 << 16;
constexpr uint64_t kExactWork = 100;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr Range kNothing{kInfinity, -kInfinity};
constexpr Range kAnything{-kInfinity, kInfinity};

using Fraction =
    boost::multiprecision::number<boost::multiprecision::cpp_rational_backend, boost::multiprecision::et_off>;

// The possible outcomes of the alpha test.
struct Outcomes {
    bool opaque = false;
    bool transparent = false;
};

// Decides in exact arithmetic what double precision leaves open: values that equal the cutoff, outlines that run along
// an edge. Fractions of integers of any size; slow, and seldom needed.
class ExactPart
{
public:
    // A micro-triangle: corners of the lattice with 2^level steps along the edges of `triangle`, whose coordinates are
    // finite.
    ExactPart(const AlphaTexture &texture, const TriangleCorners &triangle, const MicroCorners &corners,
              uint32_t level);

    // The outcomes in what the closed micro-triangle and a cell of the filter have in common; both where a texel of the
    // cell is not finite. For Filter::Nearest the cell is the texel itself, without its right and lower side; else the
    // closed square from the centre of that texel to the next. A value times `scale` is opaque from `cutoff` on.
    [[nodiscard]] Outcomes outcomesIn(const Texels &texels, int64_t x, int64_t y, double scale, double cutoff) const;

private:
    struct Corner {
        Fraction x;
        Fraction y;
    };
    std::array<Corner, 3> corners_;
};

// The part on one side of a line along an axis, the line included: coordinate * sign <= bound * sign.
template <typename Corner>
std::vector<Corner> cut(const std::vector<Corner> &polygon, Fraction Corner::*axis, const Fraction &bound, int sign)
{
    std::vector<Corner> rest;
    for (size_t i = 0; i < polygon.size(); ++i) {
        const Corner &from = polygon[i];
        const Corner &to = polygon[(i + 1) % polygon.size()];
        const int over = (from.*axis).compare(bound) * sign;
        const int overNext = (to.*axis).compare(bound) * sign;
        if (over <= 0)
            rest.push_back(from);
        if ((over < 0 && overNext > 0) || (over > 0 && overNext < 0)) {
            const Fraction t = (bound - from.*axis) / (to.*axis - from.*axis);
            rest.push_back({from.x + t * (to.x - from.x), from.y + t * (to.y - from.y)});
        }
    }
    return rest;
}

ExactPart::ExactPart(const AlphaTexture &texture, const TriangleCorners &triangle, const MicroCorners &corners,
                     uint32_t level)
{
    const Fraction steps(1u << level);
    const auto along = [&](const std::array<float, 3> &values, const LatticePoint &p, uint32_t size) {
        const Fraction first(values[0]);
        const Fraction second(values[1]);
        const Fraction third(values[2]);
        return size * (first + ((second - first) * p.i + (third - first) * p.j) / steps);
    };
    for (size_t i = 0; i < 3; ++i)
        corners_[i] = {along(triangle.u, corners[i], texture.width), along(triangle.v, corners[i], texture.height)};
}

Outcomes ExactPart::outcomesIn(const Texels &texels, int64_t x, int64_t y, double scale, double cutoff) const
{
    const bool nearest = texels.texture().filter == Filter::Nearest;
    const Fraction half(nearest ? 0 : 0.5);
    const Fraction left = Fraction(static_cast<double>(x)) + half;
    const Fraction top = Fraction(static_cast<double>(y)) + half;
    std::vector<Corner> part(corners_.begin(), corners_.end());
    part = cut(part, &Corner::x, left, -1);
    part = cut(part, &Corner::x, left + 1, 1);
    part = cut(part, &Corner::y, top, -1);
    part = cut(part, &Corner::y, top + 1, 1);
    if (part.empty())
        return {};
    for (Corner &corner : part)
        corner = {corner.x - left, corner.y - top};

    if (nearest) {
        // The part is convex: with one point left of the right side and one above the lower side there is one for both.
        bool beforeRight = false;
        bool beforeBottom = false;
        for (const Corner &corner : part) {
            beforeRight = beforeRight || corner.x < 1;
            beforeBottom = beforeBottom || corner.y < 1;
        }
        if (!beforeRight || !beforeBottom)
            return {};
        const float value = texels.at(x, y);
        if (!std::isfinite(value))
            return {true, true};
        const bool opaque = Fraction(value) * Fraction(scale) >= Fraction(cutoff);
        return {opaque, !opaque};
    }

    const std::array<float, 4> values{texels.at(x, y), texels.at(x + 1, y), texels.at(x, y + 1),
                                      texels.at(x + 1, y + 1)};
    std::array<Fraction, 4> f;
    for (size_t i = 0; i < 4; ++i) {
        if (!std::isfinite(values[i]))
            return {true, true};
        f[i] = Fraction(values[i]) * Fraction(scale) - Fraction(cutoff);
    }
    // This follows polygon.h, except that the sign of a quadratic with the Bernstein coefficients p, q, r needs no
    // turn: with p and r of one sign and q of the other, it has both if and only if q^2 > p r, and touches 0 where they
    // are equal.
    const Fraction a = f[1] - f[0];
    const Fraction b = f[2] - f[0];
    const Fraction c = f[3] - f[2] - a;
    const auto polar = [&](const Corner &p, const Corner &q) {
        return f[0] + (a * (p.x + q.x) + b * (p.y + q.y) + c * (p.x * q.y + q.x * p.y)) / 2;
    };
    Outcomes outcomes;
    for (size_t i = 0; i < part.size() && !(outcomes.opaque && outcomes.transparent); ++i) {
        const Corner &to = part[(i + 1) % part.size()];
        const Fraction first = polar(part[i], part[i]);
        const Fraction inner = polar(part[i], to);
        const Fraction last = polar(to, to);
        (first.sign() >= 0 ? outcomes.opaque : outcomes.transparent) = true;
        if (first.sign() >= 0 && last.sign() >= 0 && inner.sign() < 0 && inner * inner > first * last)
            outcomes.transparent = true;
        if (first.sign() < 0 && last.sign() < 0 && inner.sign() > 0 && inner * inner >= first * last)
            outcomes.opaque = true;
    }
    return outcomes;
}

void include(Range &range, const Range &other)
{
    range.low = std::min(range.low, other.low);
    range.high = std::max(range.high, other.high);
}

Range times(const Range &values, const Range &factors)
{
    if (factors.low == 1 && factors.high == 1)
        return values;
    if (!std::isfinite(values.low) || !std::isfinite(values.high))
        return values;
    const auto [low, high] = std::minmax(
        {values.low * factors.low, values.low * factors.high, values.high * factors.low, values.high * factors.high});
    return {low - 0x1p-52 * std::abs(low), high + 0x1p-52 * std::abs(high)};
}

Point centre(const std::array<Point, 3> &corners)
{
    return {(corners[0].x + corners[1].x + corners[2].x) / 3, (corners[0].y + corners[1].y + corners[2].y) / 3};
}

double extent(const std::array<Point, 3> &corners)
{
    const auto [left, right] = std::minmax({corners[0].x, corners[1].x, corners[2].x});
    const auto [top, bottom] = std::minmax({corners[0].y, corners[1].y, corners[2].y});
    return std::max(right - left, bottom - top);
}

int64_t floorOf(double x)
{
    return static_cast<int64_t>(std::floor(x));
}

// The filtered value at a place; not a number where a texel is not finite.
double filtered(const Texels &texels, const Point &at)
{
    if (texels.texture().filter == Filter::Nearest) {
        const float value = texels.at(floorOf(at.x), floorOf(at.y));
        return std::isfinite(value) ? double{value} : std::nan("");
    }
    const int64_t x = floorOf(at.x - 0.5);
    const int64_t y = floorOf(at.y - 0.5);
    const double s = at.x - 0.5 - static_cast<double>(x);
    const double t = at.y - 0.5 - static_cast<double>(y);
    const double top = texels.at(x, y) * (1 - s) + texels.at(x + 1, y) * s;
    const double bottom = texels.at(x, y + 1) * (1 - s) + texels.at(x + 1, y + 1) * s;
    const double value = top * (1 - t) + bottom * t;
    return std::isfinite(value) ? value : std::nan("");
}

} // namespace

Region::Region(const Texels &texels, const TriangleCorners &triangle, const Tolerances &tolerances,
               const AlphaRule &rule)
    : texels_(texels), triangle_(triangle), rule_(rule),
      even_(triangle.alpha[0] == triangle.alpha[1] && triangle.alpha[0] == triangle.alpha[2])
{
    const AlphaTexture &texture = texels.texture();
    // A coordinate times the size is exact: 24 and at most 29 bits.
    for (size_t i = 0; i < 3; ++i)
        corners_[i] = {double{triangle.u[i]} * texture.width, double{triangle.v[i]} * texture.height};
    // The change that interpolation and the barycentrics of a hit may make to an interpolated number of these three.
    const auto moved = [&](const std::array<float, 3> &values, float terms) {
        const double largest = std::max({std::abs(values[0]), std::abs(values[1]), std::abs(values[2]), terms});
        const double slope = std::abs(double{values[1]} - values[0]) + std::abs(double{values[2]} - values[0]);
        return largest * tolerances.interpolation + slope * tolerances.barycentric;
    };
    marginX_ = tolerances.subtexel + texture.width * moved(triangle.u, triangle.terms);
    marginY_ = tolerances.subtexel + texture.height * moved(triangle.v, triangle.terms);
    exact_ = tolerances.value == 0 && marginX_ == 0 && marginY_ == 0;
    factorMargin_ = even_ ? 0 : moved(triangle.alpha, 0);

    double furthest = 0;
    double largestFactor = 0;
    for (size_t i = 0; i < 3; ++i) {
        const Point &p = corners_[i];
        measurable_ = measurable_ && std::abs(p.x) < kImmeasurable && std::abs(p.y) < kImmeasurable &&
                      std::isfinite(triangle.alpha[i]);
        furthest = std::max({furthest, std::abs(p.x), std::abs(p.y)});
        largestFactor = std::max(largestFactor, std::abs(double{triangle.alpha[i]}));
    }
    far_ = !(furthest < kFar);
    // It is the filtered value that is not exact.
    low_ = rule.transparentBelow - tolerances.value * largestFactor;
    high_ = rule.opaqueFrom + tolerances.value * largestFactor;
    // With u = 2^-53 and m the furthest corner: a corner of a micro-triangle is off by 12 u m, that of a part by u m
    // more for each of fewer than 60 divisions, that of a widened polygon by 64 u m more.
    slack_ = 0x1p-45 * std::max(furthest + marginX_ + marginY_, 1.0);
    // Neighbouring texels differ by no more than twice the largest, so that over a cell a value changes by less than 4
    // times that for each texel of distance. Polygons reach 3 times the slack out of a cell along both axes, and the
    // next cell has another function: less than 64 in all. The values themselves have fewer than 32 roundings.
    const double largest = texels.largest() * largestFactor;
    valueSlack_ = 64 * slack_ * largest + 0x1p-46 * (largest + std::max(std::abs(low_), std::abs(high_)));
}

Region::Part Region::part(const MicroCorners &corners, uint32_t level) const
{
    const double step = 1.0 / (1u << level);
    Part part;
    for (size_t n = 0; n < 3; ++n) {
        const double i = corners[n].i * step;
        const double j = corners[n].j * step;
        const auto along = [&](double first, double second, double third) {
            return first + (second - first) * i + (third - first) * j;
        };
        part.corners[n] = {along(corners_[0].x, corners_[1].x, corners_[2].x),
                           along(corners_[0].y, corners_[1].y, corners_[2].y)};
        part.factors[n] = along(triangle_.alpha[0], triangle_.alpha[1], triangle_.alpha[2]);
    }
    return part;
}

Range Region::factorsOf(const Part &part) const
{
    if (even_)
        return {part.factors[0], part.factors[0]};
    const auto [low, high] = std::minmax({part.factors[0], part.factors[1], part.factors[2]});
    const double margin = factorMargin_ + 0x1p-45 * std::max(std::abs(low), std::abs(high));
    return {low - margin, high + margin};
}

TexelBox Region::boxOf(const Part &part) const
{
    const auto [left, right] = std::minmax({part.corners[0].x, part.corners[1].x, part.corners[2].x});
    const auto [top, bottom] = std::minmax({part.corners[0].y, part.corners[1].y, part.corners[2].y});
    const bool nearest = texels_.texture().filter == Filter::Nearest;
    const double shift = nearest ? 0 : 0.5;
    const int64_t next = nearest ? 0 : 1;
    const double reachX = marginX_ + slack_;
    const double reachY = marginY_ + slack_;
    return {floorOf(left - reachX - shift), floorOf(right + reachX - shift) + next, floorOf(top - reachY - shift),
            floorOf(bottom + reachY - shift) + next};
}

Range Region::bounds(const Part &part) const
{
    return times(texels_.range(boxOf(part)), factorsOf(part));
}

Witness Region::valueAt(const Part &part) const
{
    const Point at = centre(part.corners);
    return {at, filtered(texels_, at) * (part.factors[0] + part.factors[1] + part.factors[2]) / 3};
}

Verdict Region::operator()(const MicroCorners &corners, uint32_t level, Ask ask)
{
    Search search{.wantsOpaque = ask != Ask::NotTransparent, .wantsTransparent = ask != Ask::NotOpaque};
    visit(search, part(corners, level), 0, 0);
    if (!search.cells.empty())
        decideExactly(search, corners, level);
    return search.verdict;
}

bool Region::matters(const Search &search, const Range &values) const
{
    return (search.wantsOpaque && search.verdict.notOpaque != Answer::Yes && values.low < high_) ||
           (search.wantsTransparent && search.verdict.notTransparent != Answer::Yes && values.high >= low_);
}

// Takes values that occur, give or take `slack`.
void Region::found(Search &search, const Witness &least, const Witness &most, double slack) const
{
    Verdict &verdict = search.verdict;
    if (verdict.notOpaque != Answer::Yes && least.value < high_ - slack) {
        verdict.notOpaque = Answer::Yes;
        verdict.belowOpaque = least;
    }
    if (verdict.notTransparent != Answer::Yes && most.value >= low_ + slack) {
        verdict.notTransparent = Answer::Yes;
        verdict.aboveTransparent = most;
    }
}

void Region::leaveOpen(Search &search, const Range &values) const
{
    Verdict &verdict = search.verdict;
    if (verdict.notOpaque == Answer::No && values.low < high_)
        verdict.notOpaque = Answer::Open;
    if (verdict.notTransparent == Answer::No && values.high >= low_)
        verdict.notTransparent = Answer::Open;
}

void Region::visit(Search &search, const Part &part, unsigned depth, unsigned small)
{
    const TexelBox box = boxOf(part);
    const Range factors = factorsOf(part);
    Range values = times(texels_.range(box), factors);
    if (!matters(search, values))
        return;
    if (work == 0) {
        leaveOpen(search, values);
        return;
    }
    --work;
    // All on one side: then so is the middle. Where a texel is not finite there are no bounds.
    if (values.high < high_ || values.low >= low_) {
        const Witness some = valueAt(part);
        found(search, {some.at, std::clamp(some.value, values.low, values.high)},
              {some.at, std::clamp(some.value, values.low, values.high)}, 0);
    }
    if (depth == 0 || !even_) {
        for (size_t i = 0; i < 3; ++i)
            sample(search, part.corners[i], part.factors[i]);
        sample(search, centre(part.corners), (part.factors[0] + part.factors[1] + part.factors[2]) / 3);
    }
    if (!matters(search, values))
        return;
    if (extent(part.corners) > std::max({kSmall, marginX_, marginY_})) {
        divide(search, part, depth, 0);
        return;
    }
    const Range filteredValues = lookAtCells(search, part, box, factors);
    if (even_)
        return;
    values = times(filteredValues, factors);
    if (!matters(search, values))
        return;
    if (small < kFiner)
        divide(search, part, depth, small + 1);
    else
        leaveOpen(search, values);
}

void Region::divide(Search &search, const Part &part, unsigned depth, unsigned small)
{
    const auto &c = part.corners;
    const auto &f = part.factors;
    const std::array<Point, 3> m{middle(c[0], c[1]), middle(c[1], c[2]), middle(c[2], c[0])};
    const std::array<double, 3> g{(f[0] + f[1]) / 2, (f[1] + f[2]) / 2, (f[2] + f[0]) / 2};
    visit(search, {{m[0], m[1], m[2]}, {g[0], g[1], g[2]}}, depth + 1, small);
    visit(search, {{c[0], m[0], m[2]}, {f[0], g[0], g[2]}}, depth + 1, small);
    visit(search, {{m[0], c[1], m[1]}, {g[0], f[1], g[1]}}, depth + 1, small);
    visit(search, {{m[2], m[1], c[2]}, {g[2], g[1], f[2]}}, depth + 1, small);
}

// The value at a place of the part: of what is near, if rounding could have moved it to the next texel, nothing.
void Region::sample(Search &search, const Point &at, double factor) const
{
    if (texels_.texture().filter == Filter::Nearest) {
        const auto near = [&](double x) { return std::abs(x - std::round(x)) <= slack_; };
        if (near(at.x) || near(at.y))
            return;
    }
    const double value = filtered(texels_, at) * factor;
    if (!std::isnan(value))
        found(search, {at, value}, {at, value}, valueSlack_);
}

// The range of the filtered values, where the factor changes; where it does not, what they say is noted at once.
Range Region::lookAtCells(Search &search, const Part &part, const TexelBox &box, const Range &factors)
{
    const bool isNearest = texels_.texture().filter == Filter::Nearest;
    const int64_t next = isNearest ? 0 : 1;
    const Polygon polygon = widened(part.corners, marginX_, marginY_);
    Range range = kNothing;
    for (int64_t y = box.top; y <= box.bottom - next; ++y) {
        for (int64_t x = box.left; x <= box.right - next; ++x) {
            const Range values = times(texels_.range({x, x + next, y, y + next}), factors);
            if (!matters(search, values)) {
                // The caller only needs the side.
                continue;
            }
            if (work == 0) {
                leaveOpen(search, values);
                return kAnything;
            }
            --work;
            include(range,
                    isNearest ? nearest(search, polygon, x, y, factors) : bilinear(search, polygon, x, y, factors));
        }
    }
    return range;
}

Range Region::bilinear(Search &search, Polygon polygon, int64_t x, int64_t y, const Range &factors) const
{
    const double left = static_cast<double>(x) + 0.5;
    const double top = static_cast<double>(y) + 0.5;
    const double reach = 2 * slack_;
    polygon.cut(left - reach, left + 1 + reach, top - reach, top + 1 + reach);
    if (polygon.count() == 0)
        return kNothing;
    const double factor = even_ ? factors.low : 1;
    const CellTexels texels{texels_.at(x, y) * factor, texels_.at(x + 1, y) * factor, texels_.at(x, y + 1) * factor,
                            texels_.at(x + 1, y + 1) * factor};
    if (!std::isfinite(texels.f00 + texels.f10 + texels.f01 + texels.f11)) {
        const Witness none{polygon[0], std::nan("")};
        polygon.cut(left + reach, left + 1 - reach, top + reach, top + 1 - reach);
        if (polygon.count() == 0) {
            leaveCell(search, {x, y, none, none}, kAnything);
        } else {
            search.verdict.notOpaque = search.verdict.notTransparent = Answer::Yes;
            search.verdict.belowOpaque = search.verdict.aboveTransparent = none;
        }
        return kAnything;
    }
    const Extremes extremes = extremesOver(polygon, texels, left, top);
    const Range range{extremes.floor - valueSlack_, extremes.ceiling + valueSlack_};
    if (even_) {
        found(search, extremes.least, extremes.most, valueSlack_);
        if (matters(search, range))
            leaveCell(search, {x, y, extremes.least, extremes.most}, range);
    }
    return range;
}

Range Region::nearest(Search &search, const Polygon &polygon, int64_t x, int64_t y, const Range &factors) const
{
    const auto left = static_cast<double>(x);
    const auto top = static_cast<double>(y);
    const double reach = 2 * slack_;
    Polygon part = polygon;
    part.cut(left - reach, left + 1 + reach, top - reach, top + 1 + reach);
    if (part.count() == 0)
        return kNothing;
    const double texel = texels_.at(x, y);
    const Range range = std::isfinite(texel) ? Range{texel, texel} : kAnything;
    if (!even_)
        return range;
    Witness witness{part[0], texel * factors.low};
    part.cut(left + reach, left + 1 - reach, top + reach, top + 1 - reach);
    if (part.count() == 0) {
        leaveCell(search, {x, y, witness, witness}, times(range, factors));
        return range;
    }
    witness.at = part[0];
    if (std::isfinite(texel)) {
        found(search, witness, witness, 0);
    } else {
        search.verdict.notOpaque = search.verdict.notTransparent = Answer::Yes;
        search.verdict.belowOpaque = search.verdict.aboveTransparent = {part[0], std::nan("")};
    }
    return range;
}

void Region::leaveCell(Search &search, const OpenCell &cell, const Range &values) const
{
    if (exact_ && even_ && search.cells.size() < kMostOpenCells)
        search.cells.push_back(cell);
    else
        leaveOpen(search, values);
}

void Region::decideExactly(Search &search, const MicroCorners &corners, uint32_t level)
{
    std::sort(search.cells.begin(), search.cells.end(),
              [](const OpenCell &a, const OpenCell &b) { return a.y != b.y ? a.y < b.y : a.x < b.x; });
    const auto same = [](const OpenCell &a, const OpenCell &b) { return a.x == b.x && a.y == b.y; };
    search.cells.erase(std::unique(search.cells.begin(), search.cells.end(), same), search.cells.end());
    if (!matters(search, kAnything))
        return;
    const ExactPart part(texels_.texture(), triangle_, corners, level);
    Verdict &verdict = search.verdict;
    for (const OpenCell &cell : search.cells) {
        if (!matters(search, kAnything))
            return;
        if (work < kExactWork) {
            leaveOpen(search, kAnything);
            return;
        }
        work -= kExactWork;
        const auto outcomesBy = [&](double cutoff) {
            return part.outcomesIn(texels_, cell.x, cell.y, triangle_.alpha[0], cutoff);
        };
        const Outcomes outcomes = outcomesBy(rule_.opaqueFrom);
        const bool twoThresholds = rule_.transparentBelow != rule_.opaqueFrom;
        const bool notTransparent = twoThresholds ? outcomesBy(rule_.transparentBelow).opaque : outcomes.opaque;
        if (outcomes.transparent && verdict.notOpaque != Answer::Yes) {
            verdict.notOpaque = Answer::Yes;
            verdict.belowOpaque = cell.least;
        }
        if (notTransparent && verdict.notTransparent != Answer::Yes) {
            verdict.notTransparent = Answer::Yes;
            verdict.aboveTransparent = cell.most;
        }
    }
}

} // namespace vellum::verify
