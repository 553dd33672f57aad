// SPDX-License-Identifier: Apache-2.0
#include "verify/patch.h"

#include <algorithm>
#include <limits>

namespace vellum::verify
{

Extremes extremesOver(const Polygon &polygon, const CellTexels &texels, double x, double y)
{
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    const double a = texels.f10 - texels.f00;
    const double b = texels.f01 - texels.f00;
    const double c = (texels.f11 - texels.f01) - a;
    const auto polar = [&](const Point &p, const Point &q) {
        return texels.f00 + a * (p.x + q.x) / 2 + b * (p.y + q.y) / 2 + c * (p.x * q.y + q.x * p.y) / 2;
    };
    const auto local = [&](const Point &p) { return Point{p.x - x, p.y - y}; };

    Extremes extremes{kInfinity, {{}, kInfinity}, {{}, -kInfinity}, -kInfinity};
    const auto found = [&](const Point &at, double value) {
        if (value < extremes.least.value)
            extremes.least = {at, value};
        if (value > extremes.most.value)
            extremes.most = {at, value};
    };
    const auto bounded = [&](double value) {
        extremes.floor = std::min(extremes.floor, value);
        extremes.ceiling = std::max(extremes.ceiling, value);
    };
    Point p = local(polygon[polygon.count() - 1]);
    double first = polar(p, p);
    for (unsigned i = 0; i < polygon.count(); ++i) {
        const Point q = local(polygon[i]);
        const double inner = polar(p, q);
        const double last = polar(q, q);
        found(polygon[i], last);
        bounded(last);
        const bool below = inner < first && inner < last;
        const bool above = inner > first && inner > last;
        if (below || above) {
            const double t = (first - inner) / ((first - inner) + (last - inner));
            const double before = first + t * (inner - first);
            const double after = inner + t * (last - inner);
            const double turn = before + t * (after - before);
            bounded(before);
            bounded(turn);
            bounded(after);
            found({p.x + t * (q.x - p.x) + x, p.y + t * (q.y - p.y) + y}, turn);
        }
        p = q;
        first = last;
    }
    return extremes;
}

} // namespace vellum::verify
