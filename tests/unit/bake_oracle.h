// SPDX-License-Identifier: Apache-2.0
// The expected states of the baker, by an independent method: the filter's definition, evaluated at every possible
// extreme.
//
// Over a convex polygon a filtered value has its extremes on the polygon's sides or at texel centres inside. A side is
// cut where it passes from one set of texels to the next; between the cuts the value is a quadratic, known from three
// samples. With N = Rational all of that is exact; with long double its error is about 1e-12.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <vector>

#include "bake/texture/texture.h"

namespace vellum::test
{

// Fractions with 128-bit numbers. Throws where those do not suffice.
class Rational
{
public:
    __extension__ using Int = __int128;

    Rational(int64_t value = 0) : n_(value) {}
    Rational(Int n, Int d) : n_(d < 0 ? -n : n), d_(d < 0 ? -d : d)
    {
        Int a = n_ < 0 ? -n_ : n_;
        Int b = d_;
        while (b != 0) {
            const Int rest = a % b;
            a = b;
            b = rest;
        }
        n_ /= a;
        d_ /= a;
    }
    static Rational of(double value)
    {
        int bits = 0;
        while (value != std::floor(value)) {
            value *= 2;
            if (++bits > 60)
                throw std::overflow_error("not a short binary fraction");
        }
        return {static_cast<Int>(value), Int{1} << bits};
    }
    [[nodiscard]] int64_t floor() const
    {
        const Int q = n_ / d_;
        return static_cast<int64_t>(n_ % d_ < 0 ? q - 1 : q);
    }
    [[nodiscard]] explicit operator double() const { return static_cast<double>(n_) / static_cast<double>(d_); }

    friend Rational operator+(const Rational &a, const Rational &b)
    {
        return {add(times(a.n_, b.d_), times(b.n_, a.d_)), times(a.d_, b.d_)};
    }
    friend Rational operator-(const Rational &a, const Rational &b) { return a + Rational(-b.n_, b.d_); }
    friend Rational operator*(const Rational &a, const Rational &b) { return {times(a.n_, b.n_), times(a.d_, b.d_)}; }
    friend Rational operator/(const Rational &a, const Rational &b) { return {times(a.n_, b.d_), times(a.d_, b.n_)}; }
    friend bool operator<(const Rational &a, const Rational &b) { return times(a.n_, b.d_) < times(b.n_, a.d_); }
    friend bool operator==(const Rational &a, const Rational &b) { return a.n_ == b.n_ && a.d_ == b.d_; }

private:
    static Int times(Int a, Int b)
    {
        Int result = 0;
        if (__builtin_mul_overflow(a, b, &result))
            throw std::overflow_error("a fraction outgrew 128 bits");
        return result;
    }
    static Int add(Int a, Int b)
    {
        Int result = 0;
        if (__builtin_add_overflow(a, b, &result))
            throw std::overflow_error("a fraction outgrew 128 bits");
        return result;
    }

    Int n_ = 0;
    Int d_ = 1;
};

inline int64_t floorOf(const Rational &x)
{
    return x.floor();
}
inline int64_t floorOf(long double x)
{
    return static_cast<int64_t>(std::floor(x));
}
inline Rational numberOf(double x, Rational /*type*/)
{
    return Rational::of(x);
}
inline long double numberOf(double x, long double /*type*/)
{
    return x;
}

// "Wrapping Operation" of the specification (textures.adoc), written down once more.
inline int64_t specifiedTexel(int64_t i, int64_t size, Wrap wrap)
{
    const auto mirror = [](int64_t n) { return n >= 0 ? n : -(1 + n); };
    const auto mod = [](int64_t n, int64_t m) { return n - m * floorOf(Rational(n, m)); };
    switch (wrap) {
    case Wrap::Repeat: return mod(i, size);
    case Wrap::Mirror: return size - 1 - mirror(mod(i, 2 * size) - size);
    case Wrap::Clamp: return std::min(std::max<int64_t>(i, 0), size - 1);
    case Wrap::Border: return std::min(std::max<int64_t>(i, -1), size);
    case Wrap::MirrorOnce: return std::min(std::max<int64_t>(mirror(i), 0), size - 1);
    }
    throw std::logic_error("no such address mode");
}

template <typename N>
struct OraclePoint {
    N x; // in texels: u * width
    N y;
};

// The least and the largest filtered value over a convex polygon.
template <typename N>
class Oracle
{
public:
    explicit Oracle(const AlphaTexture &texture) : texture_(texture) {}

    [[nodiscard]] N sample(const N &x, const N &y) const
    {
        if (texture_.filter == Filter::Nearest)
            return texel(floorOf(x), floorOf(y));
        const N half = N(1) / N(2);
        const int64_t i = floorOf(x - half);
        const int64_t j = floorOf(y - half);
        const N a = x - half - N(i);
        const N b = y - half - N(j);
        return (N(1) - b) * ((N(1) - a) * texel(i, j) + a * texel(i + 1, j)) +
               b * ((N(1) - a) * texel(i, j + 1) + a * texel(i + 1, j + 1));
    }

    void addPolygon(const std::vector<OraclePoint<N>> &polygon)
    {
        for (size_t i = 0; i < polygon.size(); ++i)
            addSide(polygon[i], polygon[(i + 1) % polygon.size()]);
        addCentres(polygon);
    }
    [[nodiscard]] const N &least() const { return least_; }
    [[nodiscard]] const N &most() const { return most_; }

private:
    [[nodiscard]] N texel(int64_t i, int64_t j) const
    {
        const int64_t x = specifiedTexel(i, texture_.width, texture_.wrapU);
        const int64_t y = specifiedTexel(j, texture_.height, texture_.wrapV);
        const bool inside = x >= 0 && x < texture_.width && y >= 0 && y < texture_.height;
        const float alpha =
            inside ? texture_.value(texture_.place(static_cast<size_t>(x), static_cast<size_t>(y))) : texture_.border;
        return numberOf(double{alpha}, N{});
    }

    void add(const N &value)
    {
        least_ = any_ && least_ < value ? least_ : value;
        most_ = any_ && value < most_ ? most_ : value;
        any_ = true;
    }

    void addSide(const OraclePoint<N> &from, const OraclePoint<N> &to)
    {
        std::vector<N> cuts = {N(0), N(1)};
        const N half = texture_.filter == Filter::Bilinear ? N(1) / N(2) : N(0);
        const auto cut = [&](const N &a, const N &b) {
            const N low = b < a ? b : a;
            const N high = b < a ? a : b;
            for (int64_t k = floorOf(low - half) + 1; N(k) + half < high; ++k)
                if (low < N(k) + half)
                    cuts.push_back((N(k) + half - a) / (b - a));
        };
        cut(from.x, to.x);
        cut(from.y, to.y);
        std::sort(cuts.begin(), cuts.end());
        const auto at = [&](const N &s) { return sample(from.x + s * (to.x - from.x), from.y + s * (to.y - from.y)); };
        // If N rounds, a cut of nearest filtering reads a texel next to the side.
        constexpr bool kExact = std::is_same_v<N, Rational>;
        const bool cutsCount = kExact || texture_.filter == Filter::Bilinear;
        add(at(N(0)));
        add(at(N(1)));
        for (size_t i = 0; i + 1 < cuts.size(); ++i) {
            const N length = cuts[i + 1] - cuts[i];
            if (!(numberOf(kExact ? 0 : 1e-12, N{}) < length))
                continue;
            const N middle = at(cuts[i] + length / N(2));
            add(middle);
            if (!cutsCount)
                continue;
            const N first = at(cuts[i]);
            const N last = at(cuts[i + 1]);
            add(first);
            add(last);
            if (texture_.filter == Filter::Nearest)
                continue;
            // first + q1 t + q2 t^2, t from 0 to 1
            const N q2 = N(2) * (first + last - N(2) * middle);
            const N q1 = last - first - q2;
            if (q2 == N(0))
                continue;
            const N turn = (N(0) - q1) / (N(2) * q2);
            if (N(0) < turn && turn < N(1))
                add(first + turn * (q1 + turn * q2));
        }
    }

    void addCentres(const std::vector<OraclePoint<N>> &polygon)
    {
        const auto turn = [](const OraclePoint<N> &a, const OraclePoint<N> &b, const OraclePoint<N> &p) {
            return (b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x);
        };
        N area(0);
        OraclePoint<N> low = polygon[0];
        OraclePoint<N> high = polygon[0];
        for (size_t i = 0; i < polygon.size(); ++i) {
            area = area + turn(polygon[0], polygon[i], polygon[(i + 1) % polygon.size()]);
            low = {std::min(low.x, polygon[i].x), std::min(low.y, polygon[i].y)};
            high = {std::max(high.x, polygon[i].x), std::max(high.y, polygon[i].y)};
        }
        if (area == N(0))
            return;
        const N half = N(1) / N(2);
        for (int64_t y = floorOf(low.y); N(y) < high.y; ++y) {
            for (int64_t x = floorOf(low.x); N(x) < high.x; ++x) {
                const OraclePoint<N> centre{N(x) + half, N(y) + half};
                bool inside = true;
                for (size_t i = 0; i < polygon.size() && inside; ++i)
                    inside = !(turn(polygon[i], polygon[(i + 1) % polygon.size()], centre) * area < N(0));
                if (inside)
                    add(texel(x, y));
            }
        }
    }

    const AlphaTexture &texture_;
    bool any_ = false;
    N least_{0};
    N most_{0};
};

} // namespace vellum::test
