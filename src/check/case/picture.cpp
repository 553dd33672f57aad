// SPDX-License-Identifier: Apache-2.0
#include "check/case/case.h"

#include <algorithm>
#include <fmt/format.h>

#include "check/oracle/cpu_trace.h"

namespace vellum::check
{
namespace
{

using oracle::Scene;

constexpr uint32_t kMostLevel = 6;
constexpr double kSide = 260, kGap = 40, kTop = 50;
// The colours of transparent, opaque, unknown-transparent, unknown-opaque.
constexpr std::array kColors{"#ffffff", "#20639b", "#f6d55c", "#ed8b2f"};
constexpr std::string_view kWrong = "#d62828", kRight = "#cfe8cf";
constexpr std::array kAdvances{105.0, 85.0, 165.0, 0.0}; // of the legend
constexpr std::array kNames{"transparent", "opaque", "unknown-transparent", "unknown-opaque"};

struct States {
    uint32_t level = 0;
    std::vector<uint8_t> states;
};

std::optional<States> statesOf(const Scene &scene, const oracle::Hit &hit)
{
    const oracle::Mesh &mesh = scene.objects[scene.instances[hit.instance].object].meshes[hit.geometry];
    if (!mesh.micromap)
        return {};
    const int32_t index = mesh.micromap->indexOf(hit.primitive);
    if (index < 0)
        return States{0, {static_cast<uint8_t>(-1 - index)}};
    const auto &triangles = scene.micromaps[*mesh.micromap->micromap].triangles;
    const oracle::MicromapTriangle &triangle = triangles[static_cast<uint32_t>(index) + mesh.micromap->base];
    return States{triangle.level, triangle.states};
}

std::string polygon(const std::array<std::array<double, 2>, 3> &corners, double left, std::string_view color)
{
    std::string points;
    for (const auto &[u, v] : corners)
        points += fmt::format("{:.2f},{:.2f} ", left + u * kSide, kTop + (1 - v) * kSide);
    return fmt::format("<polygon points=\"{}\" fill=\"{}\" stroke=\"#888\" stroke-width=\"0.5\"/>\n", points, color);
}

std::string text(double x, double y, std::string_view words)
{
    return fmt::format("<text x=\"{}\" y=\"{}\">{}</text>\n", x, y, words);
}

} // namespace

std::string pictureOf(const Case &c, const Verdict &verdict, const std::function<Verdict(const Case &)> &runs)
{
    const Scene scene = sceneAfter(c);
    if (!verdict.ray)
        return {};
    const Ray &wrong = scene.rays[*verdict.ray];
    const std::optional<oracle::Hit> hit = oracle::nearestTriangle(scene, wrong);
    const std::optional<States> states = hit ? statesOf(scene, *hit) : std::nullopt;
    if (!states || states->level > kMostLevel)
        return {};
    Case probes = c;
    probes.scene.rays.clear();
    for (uint32_t i = 0; i < states->states.size(); ++i)
        probes.scene.rays.push_back(oracle::aimedAt(scene, *hit, wrong, microTriangleCentre(i, states->level)));
    const std::vector<uint32_t> bad = runs(probes).wrongRays;

    const double right = 20 + kSide + kGap;
    std::string svg = fmt::format(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} {1}\" "
        "font-family=\"sans-serif\" font-size=\"13\">\n<rect width=\"100%\" height=\"100%\" fill=\"#f4f4f4\"/>\n",
        right + kSide + 20, kTop + kSide + 90);
    svg += text(20, 20,
                fmt::format("instance {}, geometry {}, triangle {}, level {}", hit->instance, hit->geometry,
                            hit->primitive, states->level));
    svg += text(20, 42, "expected");
    svg += text(right, 42, "found");
    for (uint32_t i = 0; i < states->states.size(); ++i) {
        const auto corners = cornersOfMicroTriangle(i, states->level);
        const bool isBad = std::ranges::find(bad, i) != bad.end();
        svg += polygon(corners, 20, kColors[states->states[i] & 3]);
        svg += polygon(corners, right, isBad ? kWrong : kRight);
    }
    for (const double left : {20.0, right})
        svg += fmt::format("<circle cx=\"{:.2f}\" cy=\"{:.2f}\" r=\"4\" fill=\"none\" stroke=\"#000\" "
                           "stroke-width=\"1.5\"/>\n",
                           left + hit->u * kSide, kTop + (1 - hit->v) * kSide);
    const auto legend = [&](double x, double y, std::string_view color, std::string_view words) {
        svg += fmt::format("<rect x=\"{}\" y=\"{}\" width=\"12\" height=\"12\" fill=\"{}\" stroke=\"#888\"/>\n", x,
                           kTop + kSide + y, color);
        svg += text(x + 17, kTop + kSide + y + 11, words);
    };
    double x = 20;
    for (size_t s = 0; s < kNames.size(); x += kAdvances[s], ++s)
        legend(x, 22, kColors[s], kNames[s]);
    legend(20, 50, kWrong, "rays here are wrong");
    legend(175, 50, kRight, "rays here are right");
    svg += text(325, kTop + kSide + 61, "circle: where the failing ray hits");
    return svg + "</svg>\n";
}

} // namespace vellum::check
