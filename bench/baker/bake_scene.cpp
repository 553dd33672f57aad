// SPDX-License-Identifier: Apache-2.0
#include "bake_scene.h"

#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace vellum::bench
{
namespace
{

class Random
{
public:
    explicit Random(uint32_t seed) : engine_(seed) {}
    double operator()(double low, double high)
    {
        return low + (high - low) * static_cast<double>(engine_()) / 4294967296.0;
    }

private:
    std::mt19937 engine_;
};

} // namespace

double userSeconds()
{
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return static_cast<double>(usage.ru_utime.tv_sec) + static_cast<double>(usage.ru_utime.tv_usec) * 1e-6;
}

std::vector<uint8_t> paintLeaves(uint32_t size)
{
    std::vector<uint8_t> alpha(size_t{size} * size);
    Random random(7);
    size_t covered = 0;
    while (covered * 10 < alpha.size() * 4) {
        const double x = random(0, size);
        const double y = random(0, size);
        const double turn = random(0, 2 * std::numbers::pi);
        const double length = random(55, 95);
        const double slender = random(0.35, 0.6);
        const double teeth = std::floor(random(9, 17));
        const auto reach = static_cast<int>(length) + 4;
        for (int dy = -reach; dy <= reach; ++dy) {
            for (int dx = -reach; dx <= reach; ++dx) {
                const double px = std::cos(turn) * dx + std::sin(turn) * dy;
                const double py = (std::cos(turn) * dy - std::sin(turn) * dx) / slender;
                const double angle = std::atan2(py, px);
                const double tooth = angle * teeth / (2 * std::numbers::pi);
                const double radius = length * (0.86 + 0.14 * (tooth - std::floor(tooth)));
                const double value = std::clamp(0.5 + (radius - std::hypot(px, py)) * slender / 2, 0.0, 1.0);
                const auto wrap = [size](double c) {
                    return static_cast<size_t>(std::fmod(std::floor(c) + size, size));
                };
                uint8_t &texel = alpha[wrap(y + dy) * size + wrap(x + dx)];
                const auto byte = static_cast<uint8_t>(std::lround(value * 255));
                covered += texel < 128 && byte >= 128 ? 1u : 0u;
                texel = std::max(texel, byte);
            }
        }
    }
    return alpha;
}

std::vector<TriangleUvs> scatter(size_t count, uint32_t size)
{
    Random random(11);
    std::vector<TriangleUvs> triangles(count);
    for (TriangleUvs &uvs : triangles) {
        // Two edges with lengths in this range, at an angle that puts the third in it, too.
        double a = 0;
        double b = 0;
        double angle = 0;
        double c = 0;
        do {
            a = random(60, 100);
            b = random(60, 100);
            angle = random(0.3, 2);
            c = std::sqrt(a * a + b * b - 2 * a * b * std::cos(angle));
        } while (c < 60 || c > 100);
        const double turn = random(0, 2 * std::numbers::pi);
        const double x = random(0, size);
        const double y = random(0, size);
        const auto at = [&](double px, double py) {
            return TexCoord{static_cast<float>((x + px) / size), static_cast<float>((y + py) / size)};
        };
        uvs = {at(0, 0), at(a * std::cos(turn), a * std::sin(turn)),
               at(b * std::cos(turn + angle), b * std::sin(turn + angle))};
    }
    return triangles;
}

} // namespace vellum::bench
