// SPDX-License-Identifier: Apache-2.0
#include "bake/piece.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vellum
{
namespace
{

// The box that is Minkowski-added to a triangle touches an edge's outward side with this corner.
Point supportCorner(const Point &outward, double marginX, double marginY)
{
    return {outward.x < 0 ? -marginX : marginX, outward.y < 0 ? -marginY : marginY};
}

// 1 / delta, and 0 for what is so short that a clip need not know its direction.
double inverse(double delta)
{
    return std::abs(delta) > 1e-200 ? 1 / delta : 0;
}

// Keeps of [from, to] where low <= start + s * delta <= high.
void clip(double start, double inverseDelta, double low, double high, double &from, double &to)
{
    if (inverseDelta == 0) {
        if (!(start >= low && start <= high))
            to = -1;
        return;
    }
    const double a = (low - start) * inverseDelta;
    const double b = (high - start) * inverseDelta;
    from = std::max(from, std::min(a, b));
    to = std::min(to, std::max(a, b));
}

// The least and the largest of some values.
struct Extent {
    double low = std::numeric_limits<double>::infinity();
    double high = -std::numeric_limits<double>::infinity();

    void add(double value)
    {
        low = std::min(low, value);
        high = std::max(high, value);
    }
};

} // namespace

PieceTest::PieceTest(const Placement &placement, Filter filter, const Thresholds &thresholds)
    : filter_(filter), margins_(placement.marginX != 0 || placement.marginY != 0), clip_(2 * placement.slack),
      lineSlack_(placement.lineSlack), opaqueSurely_(thresholds.opaque + placement.valueSlack),
      opaquePerhaps_(thresholds.transparent + placement.valueSlack),
      transparentSurely_(thresholds.transparent - placement.valueSlack),
      transparentPerhaps_(thresholds.opaque - placement.valueSlack), thresholds_(thresholds)
{
    for (size_t which = 0; which < 2; ++which) {
        const double s = which == 0 ? 1 : -1;
        const auto times = [](const Point &p, double factor) { return Point{p.x * factor, p.y * factor}; };
        const Point i = times(placement.stepI, s);
        const Point j = times(placement.stepJ, s);
        // Outwards, the function of an edge's parallels falls: that of j for the edge along i, and so on.
        const Point outward[] = {times(placement.gradientJ, -s), times(placement.gradientSum, s),
                                 times(placement.gradientI, -s)};
        const Point starts[] = {{0, 0}, i, j};
        const Point deltas[] = {i, {j.x - i.x, j.y - i.y}, times(j, -1)};
        const double constants[] = {0, placement.area, 0};
        Shape &shape = shapes_[which];
        for (size_t k = 0; k < 3; ++k) {
            const Point support = supportCorner(outward[k], placement.marginX, placement.marginY);
            shape.edges[k] = {{starts[k].x + support.x, starts[k].y + support.y},
                              deltas[k],
                              {inverse(deltas[k].x), inverse(deltas[k].y)}};
            shape.lines[k] = {times(outward[k], -1),
                              constants[k] + outward[k].x * support.x + outward[k].y * support.y};
        }
        const double reachX = placement.marginX + clip_;
        const double reachY = placement.marginY + clip_;
        shape.low = {(s > 0 ? placement.low.x : -placement.high.x) - reachX,
                     (s > 0 ? placement.low.y : -placement.high.y) - reachY};
        shape.high = {(s > 0 ? placement.high.x : -placement.low.x) + reachX,
                      (s > 0 ? placement.high.y : -placement.low.y) + reachY};
    }
    makeQuick(placement);
}

void PieceTest::makeQuick(const Placement &placement)
{
    // Coordinates that a micro-triangle and a cell which it touches have, seen from either: single precision is off by
    // 2^-24 of them for each rounding. The values and the three functions follow as in Placement.
    const double extent = placement.high.x - placement.low.x + placement.high.y - placement.low.y +
                          2 * (placement.marginX + placement.marginY) + 4;
    const double slack = 2 * placement.slack + 0x1p-21 * extent;
    const double gradients = std::abs(placement.gradientI.x) + std::abs(placement.gradientI.y) +
                             std::abs(placement.gradientJ.x) + std::abs(placement.gradientJ.y);
    const double largest =
        std::max({std::abs(thresholds_.transparent), std::abs(thresholds_.opaque), placement.largestValue});
    const double valueSlack = placement.valueSlack + 64 * slack * placement.largestValue + 0x1p-18 * largest;
    tame_ = largest > 1e-12 && largest < 1e12;
    const auto toFloat = [](double x) { return static_cast<float>(x); };
    quickClip_ = toFloat(2 * slack);
    quickLineSlack_ = toFloat(2 * lineSlack_ + 8 * slack * gradients);
    quickOpaqueSurely_ = toFloat(thresholds_.opaque + valueSlack);
    quickOpaquePerhaps_ = toFloat(thresholds_.transparent + valueSlack);
    quickTransparentSurely_ = toFloat(thresholds_.transparent - valueSlack);
    quickTransparentPerhaps_ = toFloat(thresholds_.opaque - valueSlack);
    for (size_t which = 0; which < 2; ++which) {
        const Shape &from = shapes_[which];
        QuickShape &to = quick_[which];
        const auto lanes = [&](Point Edge::*member, double Point::*axis) {
            const auto at = [&](size_t k) { return toFloat(from.edges[k].*member.*axis); };
            return Float4(at(0), at(1), at(2), at(2));
        };
        // A delta of almost 0 leaves all of an edge, or nothing.
        const auto inverses = [&](double Point::*axis) {
            const auto at = [&](size_t k) {
                constexpr float kLargest = 1e30f;
                const float delta = toFloat(from.edges[k].delta.*axis);
                return std::abs(delta) > 1 / kLargest ? 1 / delta : kLargest;
            };
            return Float4(at(0), at(1), at(2), at(2));
        };
        to.startX = lanes(&Edge::start, &Point::x);
        to.startY = lanes(&Edge::start, &Point::y);
        to.deltaX = lanes(&Edge::delta, &Point::x);
        to.deltaY = lanes(&Edge::delta, &Point::y);
        to.inverseX = inverses(&Point::x);
        to.inverseY = inverses(&Point::y);
        for (size_t k = 0; k < 3; ++k) {
            to.lineX[k] = toFloat(from.lines[k].gradient.x);
            to.lineY[k] = toFloat(from.lines[k].gradient.y);
            to.lineConstant[k] = toFloat(from.lines[k].constant);
        }
        to.lowX = toFloat(from.low.x - 2 * slack);
        to.lowY = toFloat(from.low.y - 2 * slack);
        to.highX = toFloat(from.high.x + 2 * slack);
        to.highY = toFloat(from.high.y + 2 * slack);
    }
}

void PieceTest::setValues(NearCell &near, const Cell &cell) const
{
    const float all = cell.f00 + cell.f10 + cell.f01 + cell.f11;
    near.f00 = tame_ && std::isfinite(all) ? cell.f00 : std::numeric_limits<float>::quiet_NaN();
    near.cx = cell.f10 - near.f00;
    near.cy = cell.f01 - near.f00;
    near.cxy = cell.f11 - cell.f10 - cell.f01 + near.f00;
}

// Tests like bilinear(), for three edges and then for four corners at once.
Crossing PieceTest::quick(Point cornerInCell, bool inverted, const NearCell &cell) const
{
    if (std::isnan(cell.f00))
        return Crossing::Open;
    const QuickShape &shape = quick_[inverted ? 1 : 0];
    const auto cornerX = static_cast<float>(cornerInCell.x);
    const auto cornerY = static_cast<float>(cornerInCell.y);
    const float x0 = std::max(0.0f, cornerX + shape.lowX);
    const float x1 = std::min(1.0f, cornerX + shape.highX);
    const float y0 = std::max(0.0f, cornerY + shape.lowY);
    const float y1 = std::min(1.0f, cornerY + shape.highY);
    if (x0 > x1 || y0 > y1)
        return Crossing::No;
    const Float4 zero(0.0f);
    const Float4 one(1.0f);
    const Float4 f00(cell.f00);
    const Float4 cx(cell.cx);
    const Float4 cy(cell.cy);
    const Float4 cxy(cell.cxy);
    const auto value = [&](Float4 x, Float4 y) { return f00 + cx * x + (cy + cxy * x) * y; };

    const Float4 low(-quickClip_);
    const Float4 high(1 + quickClip_);
    const Float4 ax = Float4(cornerX) + shape.startX;
    const Float4 ay = Float4(cornerY) + shape.startY;
    const Float4 sx0 = (low - ax) * shape.inverseX;
    const Float4 sx1 = (high - ax) * shape.inverseX;
    const Float4 sy0 = (low - ay) * shape.inverseY;
    const Float4 sy1 = (high - ay) * shape.inverseY;
    const Float4 from = max(zero, max(min(sx0, sx1), min(sy0, sy1)));
    const Float4 to = min(one, min(max(sx0, sx1), max(sy0, sy1)));
    const auto along = [&](Float4 s) { return value(ax + s * shape.deltaX, ay + s * shape.deltaY); };
    const Float4 first = along(from);
    const Float4 last = along(to);
    const Float4 twiceQ2 = (cxy + cxy) * shape.deltaX * shape.deltaY;
    const Float4 q1 = cx * shape.deltaX + cy * shape.deltaY + cxy * (ax * shape.deltaY + ay * shape.deltaX);
    const Float4 slopes = (q1 + twiceQ2 * from) * (q1 + twiceQ2 * to);
    const Float4 turn = max(from, min(to, (zero - q1) / twiceQ2));
    const Float4 middle = selectBelow(slopes, zero, along(turn), first);
    // Edges next to the cell, for which `to` is below `from`, have no effect.
    constexpr float kNothing = std::numeric_limits<float>::infinity();
    const Float4 least = selectBelow(to, from, Float4(kNothing), min(min(first, last), middle));
    const Float4 most = selectBelow(to, from, Float4(-kNothing), max(max(first, last), middle));
    float surelyLow = least.least();
    float surelyHigh = most.most();
    const auto crosses = [&] { return surelyLow < quickTransparentPerhaps_ && surelyHigh >= quickOpaquePerhaps_; };
    if (crosses())
        return Crossing::Yes;

    const Float4 cornersX(x0, x1, x0, x1);
    const Float4 cornersY(y0, y0, y1, y1);
    const Float4 fromX = cornersX - Float4(cornerX);
    const Float4 fromY = cornersY - Float4(cornerY);
    Float4 inside(kNothing);
    for (size_t k = 0; k < 3; ++k)
        inside = min(inside,
                     fromX * Float4(shape.lineX[k]) + fromY * Float4(shape.lineY[k]) + Float4(shape.lineConstant[k]));
    const Float4 corners = value(cornersX, cornersY);
    const Float4 slack(quickLineSlack_);
    const Float4 below = zero - slack;
    const float perhapsLow = selectBelow(inside, below, Float4(kNothing), corners).least();
    const float perhapsHigh = selectBelow(inside, below, Float4(-kNothing), corners).most();
    surelyLow = std::min(surelyLow, selectBelow(slack, inside, corners, Float4(kNothing)).least());
    surelyHigh = std::max(surelyHigh, selectBelow(slack, inside, corners, Float4(-kNothing)).most());
    if (crosses())
        return Crossing::Yes;
    const float all = std::min(surelyLow, perhapsLow);
    const float none = std::max(surelyHigh, perhapsHigh);
    if (all >= quickOpaqueSurely_ || none < quickTransparentSurely_)
        return Crossing::No;
    return Crossing::Open;
}

// The extremes of a bilinear function over a convex polygon are at its corners, or where it turns along a slanted side.
// The polygon is the cell, cut by the box around the micro-triangle and by its three moved edges. Each of its corners
// is the end of a clipped edge, or a corner of the cell cut by the box.
//
// Everything is clipped a little late, so that each true extreme is within what is looked at; and what is looked at is
// near enough to the micro-triangle for its value to count, except for corners that are just about inside.
Crossing PieceTest::bilinear(Point corner, const Shape &shape, const Cell &cell) const
{
    const double x0 = std::max(0.0, corner.x + shape.low.x);
    const double x1 = std::min(1.0, corner.x + shape.high.x);
    const double y0 = std::max(0.0, corner.y + shape.low.y);
    const double y1 = std::min(1.0, corner.y + shape.high.y);
    if (x0 > x1 || y0 > y1)
        return Crossing::No;
    const double c = double{cell.f00};
    const double cx = double{cell.f10} - c;
    const double cy = double{cell.f01} - c;
    const double cxy = double{cell.f11} - double{cell.f01} - cx;
    const auto value = [&](double x, double y) { return c + cx * x + (cy + cxy * x) * y; };

    Extent surely;
    Extent perhaps;
    const auto crosses = [&] { return surely.low < transparentPerhaps_ && surely.high >= opaquePerhaps_; };
    for (const Edge &edge : shape.edges) {
        const double ax = corner.x + edge.start.x;
        const double ay = corner.y + edge.start.y;
        double from = 0;
        double to = 1;
        clip(ax, edge.inverse.x, -clip_, 1 + clip_, from, to);
        clip(ay, edge.inverse.y, -clip_, 1 + clip_, from, to);
        if (!(from <= to))
            continue;
        const auto along = [&](double s) { return value(ax + s * edge.delta.x, ay + s * edge.delta.y); };
        surely.add(along(from));
        surely.add(along(to));
        const double q2 = cxy * edge.delta.x * edge.delta.y;
        const double q1 = cx * edge.delta.x + cy * edge.delta.y + cxy * (ax * edge.delta.y + ay * edge.delta.x);
        // It turns where its slope changes sign. Where rounding hides that, it turns at an end.
        if ((q1 + 2 * q2 * from) * (q1 + 2 * q2 * to) < 0)
            surely.add(along(std::clamp(-q1 / (2 * q2), from, to)));
        if (crosses())
            return Crossing::Yes;
    }
    for (const double x : {x0, x1}) {
        for (const double y : {y0, y1}) {
            // Without margins the box has no sides of its own.
            if (!margins_ && ((x != 0 && x != 1) || (y != 0 && y != 1)))
                continue;
            double inside = std::numeric_limits<double>::infinity();
            for (const Line &line : shape.lines)
                inside = std::min(inside,
                                  (x - corner.x) * line.gradient.x + (y - corner.y) * line.gradient.y + line.constant);
            if (inside < -lineSlack_)
                continue;
            (inside > lineSlack_ ? surely : perhaps).add(value(x, y));
        }
    }
    if (crosses())
        return Crossing::Yes;
    // A texel that is not finite makes values that are not, and those leave it open here.
    const double least = std::min(surely.low, perhaps.low);
    const double most = std::max(surely.high, perhaps.high);
    const bool finite = std::isfinite(c) && std::isfinite(cx) && std::isfinite(cy) && std::isfinite(cxy);
    if (finite && (least >= opaqueSurely_ || most < transparentSurely_ || least > most))
        return Crossing::No;
    return Crossing::Open;
}

// Nearest filtering reads one texel in each quarter of a cell. A triangle and a box are apart if and only if they are
// along x, along y, or across one of the triangle's edges.
Crossing PieceTest::nearest(Point corner, const Shape &shape, const Cell &cell) const
{
    bool opaque = false;
    bool transparent = false;
    bool perhapsOpaque = false;
    bool perhapsTransparent = false;
    const float texels[] = {cell.f00, cell.f10, cell.f01, cell.f11};
    for (unsigned quarter = 0; quarter < 4; ++quarter) {
        constexpr double kHalf = 0.25;
        const double x = kHalf + (quarter % 2 != 0 ? 0.5 : 0.0) - corner.x; // the quarter's middle
        const double y = kHalf + (quarter / 2 != 0 ? 0.5 : 0.0) - corner.y;
        // The overlap of the two, less the slack that the box of the shape already includes.
        double overlap = std::min({x + kHalf - shape.low.x, shape.high.x - x + kHalf, y + kHalf - shape.low.y,
                                   shape.high.y - y + kHalf}) -
                         clip_;
        bool surely = overlap > clip_;
        bool perhaps = overlap >= -clip_;
        for (const Line &line : shape.lines) {
            const double reach = kHalf * (std::abs(line.gradient.x) + std::abs(line.gradient.y));
            const double depth = x * line.gradient.x + y * line.gradient.y + line.constant + reach;
            surely = surely && depth > lineSlack_;
            perhaps = perhaps && depth >= -lineSlack_;
        }
        const double texel = double{texels[quarter]};
        const bool mayBeOpaque = !std::isfinite(texel) || texel >= thresholds_.transparent;
        const bool mayBeTransparent = !std::isfinite(texel) || texel < thresholds_.opaque;
        opaque = opaque || (surely && mayBeOpaque);
        transparent = transparent || (surely && mayBeTransparent);
        perhapsOpaque = perhapsOpaque || (perhaps && mayBeOpaque);
        perhapsTransparent = perhapsTransparent || (perhaps && mayBeTransparent);
    }
    if (opaque && transparent)
        return Crossing::Yes;
    return perhapsOpaque && perhapsTransparent ? Crossing::Open : Crossing::No;
}

} // namespace vellum
