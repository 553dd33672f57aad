// SPDX-License-Identifier: Apache-2.0
#include "verify/exact.h"

#include <cmath>
#include <vector>

namespace vellum::verify
{
namespace
{

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

} // namespace

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

} // namespace vellum::verify
