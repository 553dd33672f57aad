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
    : m_filter(filter), m_margins(placement.marginX != 0 || placement.marginY != 0), m_clip(2 * placement.slack), m_lineSlack(placement.lineSlack),
      m_opaqueSurely(thresholds.opaque + placement.valueSlack),
      m_opaquePerhaps(thresholds.transparent + placement.valueSlack),
      m_transparentSurely(thresholds.transparent - placement.valueSlack),
      m_transparentPerhaps(thresholds.opaque - placement.valueSlack), m_thresholds(thresholds)
{
    for (std::size_t which = 0; which < 2; ++which) {
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
        Shape &shape = m_shapes[which];
        for (std::size_t k = 0; k < 3; ++k) {
            const Point support = supportCorner(outward[k], placement.marginX, placement.marginY);
            shape.edges[k] = {{starts[k].x + support.x, starts[k].y + support.y},
                              deltas[k],
                              {inverse(deltas[k].x), inverse(deltas[k].y)}};
            shape.lines[k] = {times(outward[k], -1),
                              constants[k] + outward[k].x * support.x + outward[k].y * support.y};
        }
        const double reachX = placement.marginX + m_clip;
        const double reachY = placement.marginY + m_clip;
        shape.low = {(s > 0 ? placement.low.x : -placement.high.x) - reachX,
                     (s > 0 ? placement.low.y : -placement.high.y) - reachY};
        shape.high = {(s > 0 ? placement.high.x : -placement.low.x) + reachX,
                      (s > 0 ? placement.high.y : -placement.low.y) + reachY};
    }
}

// The extremes of a bilinear function over a convex polygon are at its corners, or where it turns along a slanted side.
// The polygon is the cell, cut by the box around the micro-triangle and by its three moved edges. Each of its corners is
// the end of a clipped edge, or a corner of the cell cut by the box.
//
// Everything is clipped a little late, so that each true extreme is within what is looked at; and what is looked at is
// near enough to the micro-triangle for its value to count, but for corners that are just about inside.
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
    const auto crosses = [&] { return surely.low < m_transparentPerhaps && surely.high >= m_opaquePerhaps; };
    for (const Edge &edge : shape.edges) {
        const double ax = corner.x + edge.start.x;
        const double ay = corner.y + edge.start.y;
        double from = 0;
        double to = 1;
        clip(ax, edge.inverse.x, -m_clip, 1 + m_clip, from, to);
        clip(ay, edge.inverse.y, -m_clip, 1 + m_clip, from, to);
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
            if (!m_margins && ((x != 0 && x != 1) || (y != 0 && y != 1)))
                continue;
            double inside = std::numeric_limits<double>::infinity();
            for (const Line &line : shape.lines)
                inside = std::min(inside, (x - corner.x) * line.gradient.x + (y - corner.y) * line.gradient.y +
                                              line.constant);
            if (inside < -m_lineSlack)
                continue;
            (inside > m_lineSlack ? surely : perhaps).add(value(x, y));
        }
    }
    if (crosses())
        return Crossing::Yes;
    // A texel that is not finite makes values that are not, and those leave it open here.
    const double least = std::min(surely.low, perhaps.low);
    const double most = std::max(surely.high, perhaps.high);
    const bool finite = std::isfinite(c) && std::isfinite(cx) && std::isfinite(cy) && std::isfinite(cxy);
    if (finite && (least >= m_opaqueSurely || most < m_transparentSurely || least > most))
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
        // How far the two overlap, less the slack that the box of the shape already has.
        double overlap = std::min({x + kHalf - shape.low.x, shape.high.x - x + kHalf, y + kHalf - shape.low.y,
                                   shape.high.y - y + kHalf}) -
                         m_clip;
        bool surely = overlap > m_clip;
        bool perhaps = overlap >= -m_clip;
        for (const Line &line : shape.lines) {
            const double reach = kHalf * (std::abs(line.gradient.x) + std::abs(line.gradient.y));
            const double depth = x * line.gradient.x + y * line.gradient.y + line.constant + reach;
            surely = surely && depth > m_lineSlack;
            perhaps = perhaps && depth >= -m_lineSlack;
        }
        const double texel = double{texels[quarter]};
        const bool mayBeOpaque = !std::isfinite(texel) || texel >= m_thresholds.transparent;
        const bool mayBeTransparent = !std::isfinite(texel) || texel < m_thresholds.opaque;
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
