// SPDX-License-Identifier: Apache-2.0
// Widened triangles against the convex hull of the sums of corners.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "bake_cases.h"
#include "verify/polygon.h"

using namespace vellum::test;
using vellum::verify::Point;
using vellum::verify::Polygon;

namespace
{

std::vector<OraclePoint<long double>> oraclePoints(const Polygon &polygon)
{
    std::vector<OraclePoint<long double>> corners;
    for (unsigned i = 0; i < polygon.count(); ++i)
        corners.push_back({polygon[i].x, polygon[i].y});
    return corners;
}

// Twice the area; negative clockwise.
long double areaOf(const std::vector<OraclePoint<long double>> &p)
{
    long double area = 0;
    for (size_t i = 0; i < p.size(); ++i) {
        const auto &q = p[(i + 1) % p.size()];
        area += (p[i].x - p[0].x) * (q.y - p[0].y) - (q.x - p[0].x) * (p[i].y - p[0].y);
    }
    return area;
}

} // namespace

TEST(VerifyPolygon, WidenedIsTheHullOfAllSums)
{
    TestRandom random(41);
    for (unsigned round = 0; round < 20000; ++round) {
        // Both on a small grid, where edges are vertical, horizontal, equal and of length 0, and at random positions.
        const bool grid = round % 2 == 0;
        std::array<Point, 3> triangle;
        for (Point &p : triangle)
            p = grid ? Point{static_cast<double>(random() % 4), static_cast<double>(random() % 4)}
                     : Point{random.uniform(-5, 5), random.uniform(-5, 5)};
        const double x = random.uniform(0.01, 3);
        const double y = random.uniform(0.01, 3);
        const auto sum = oraclePoints(vellum::verify::widened(triangle, x, y));
        ASSERT_LE(sum.size(), 7u);
        const auto hull = widened(
            {{triangle[0].x, triangle[0].y}, {triangle[1].x, triangle[1].y}, {triangle[2].x, triangle[2].y}}, x, y);
        const long double area = areaOf(sum);
        ASSERT_GT(area, 0);
        ASSERT_NEAR(static_cast<double>(area), static_cast<double>(areaOf(hull)), 1e-9);
        // The polygon contains the hull; with the same area, they are equal.
        for (const auto &p : hull) {
            for (size_t i = 0; i < sum.size(); ++i) {
                const auto &a = sum[i];
                const auto &b = sum[(i + 1) % sum.size()];
                ASSERT_GT((b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x), -1e-9L);
            }
        }
    }
}

TEST(VerifyPolygon, CutIsWhatLiesInTheBox)
{
    TestRandom random(42);
    for (unsigned round = 0; round < 2000; ++round) {
        const auto number = [&] { return static_cast<double>(random() % 33) / 4 - 4; };
        const std::array<Point, 3> triangle{{{number(), number()}, {number(), number()}, {number(), number()}}};
        Polygon part = vellum::verify::widened(triangle, 0, 0);
        const long double whole = std::abs(areaOf(oraclePoints(part)));
        part.cut(-1, 1, -1, 1);
        for (unsigned i = 0; i < part.count(); ++i) {
            ASSERT_LE(std::abs(part[i].x), 1);
            ASSERT_LE(std::abs(part[i].y), 1);
        }
        // The four sides of the box, and what is beyond each.
        long double beyond = 0;
        const double far = 100;
        const double boxes[][4] = {{-far, far, -far, -1}, {-far, far, 1, far}, {-far, -1, -1, 1}, {1, far, -1, 1}};
        for (const auto &box : boxes) {
            Polygon other = vellum::verify::widened(triangle, 0, 0);
            other.cut(box[0], box[1], box[2], box[3]);
            beyond += std::abs(areaOf(oraclePoints(other)));
        }
        ASSERT_NEAR(static_cast<double>(std::abs(areaOf(oraclePoints(part))) + beyond), static_cast<double>(whole),
                    1e-9);
    }
}
