// SPDX-License-Identifier: Apache-2.0
// Draws docs/pictures: what states, the curve, levels and 2 states look like, as SVG. The states are those of
// libvellum.
//
// usage: vellum_draw_pictures FOLDER           writes the pictures
//        vellum_draw_pictures FOLDER --check   fails if one differs from what would be written
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <iterator>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

#include "core/curve.h"
#include "vellum/bake.h"

namespace
{

// Indexed by vellum::State; the colours of `vellum inspect` and `vellum render --mode states`.
constexpr std::array<const char *, 4> kColors = {"#56b4e9", "#0072b2", "#f0e442", "#d55e00"};
constexpr std::array<const char *, 4> kNames = {"transparent", "opaque", "unknown-transparent", "unknown-opaque"};
constexpr uint32_t kTexels = 128;
constexpr int kTile = 256; // a card, in units of the picture: micro-triangles up to level 8 have integer corners

// Half the width of the leaf at x, both in 0..1: a lens with teeth.
double leafWidth(double x)
{
    return 0.33 * std::pow(std::sin(std::numbers::pi * x), 0.75) * (1 + 0.16 * std::sin(14 * std::numbers::pi * x));
}

std::vector<float> paintLeaf()
{
    std::vector<float> alpha;
    for (uint32_t y = 0; y < kTexels; ++y)
        for (uint32_t x = 0; x < kTexels; ++x) {
            const double inside = leafWidth((x + 0.5) / kTexels) - std::abs((y + 0.5) / kTexels - 0.5);
            alpha.push_back(static_cast<float>(std::clamp(0.5 + inside * kTexels / 2, 0.0, 1.0)));
        }
    return alpha;
}

// A card of two triangles with the leaf on it.
vellum::Micromap bakeCard(const vellum::BakeOptions &options)
{
    const std::vector<float> alpha = paintLeaf();
    const vellum::Texture texture{.texels = std::as_bytes(std::span(alpha)),
                                  .width = kTexels,
                                  .height = kTexels,
                                  .format = vellum::AlphaFormat::R32Sfloat,
                                  .addressModeU = vellum::AddressMode::ClampToEdge,
                                  .addressModeV = vellum::AddressMode::ClampToEdge};
    const std::array<float, 12> uvs = {0, 0, 1, 0, 0, 1, 1, 1, 0, 1, 1, 0};
    return vellum::bake(vellum::BakeInput{.textures = {&texture, 1}, .uvs = std::as_bytes(std::span(uvs))}, options);
}

class Svg
{
public:
    Svg(int width, int height)
    {
        out_ << "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 " << width << ' ' << height
             << "\" font-family=\"sans-serif\" font-size=\"15\">\n<rect width=\"" << width << "\" height=\"" << height
             << "\" fill=\"#fff\"/>\n";
    }
    void text(double x, double y, const std::string &words, const char *more = "")
    {
        out_ << "<text x=\"" << x << "\" y=\"" << y << "\" " << more << '>' << words << "</text>\n";
    }
    void path(const std::string &data, const std::string &more)
    {
        if (!data.empty())
            out_ << "<path d=\"" << data << "\" " << more << "/>\n";
    }
    void box(double x, double y, const char *color)
    {
        out_ << "<rect x=\"" << x << "\" y=\"" << y << "\" width=\"16\" height=\"16\" fill=\"" << color << "\"/>\n";
    }
    [[nodiscard]] std::string finish() const { return out_.str() + "</svg>\n"; }

private:
    std::ostringstream out_;
};

// The outline of the leaf on a card at (left, top).
std::string leafOutline(int left, int top)
{
    std::ostringstream data;
    constexpr int kSteps = 96;
    const auto point = [&](int step, double side) {
        const double x = static_cast<double>(step) / kSteps;
        data << (step == 0 && side < 0 ? 'M' : 'L') << std::lround(left + x * kTile) << ' '
             << std::lround(top + (0.5 + side * leafWidth(x)) * kTile);
    };
    for (int step = 0; step <= kSteps; ++step)
        point(step, -1);
    for (int step = kSteps; step > 0; --step)
        point(step, 1);
    return data.str() + "Z";
}

// Calls `use` with the first cell corner of each micro-triangle of a card's half, its direction (1, or -1 for the far
// half of a cell) and its barycentrics.
void forEachMicroTriangle(uint32_t level, const std::function<void(int, int, int, float, float)> &use)
{
    const int count = 1 << level;
    for (int j = 0; j < count; ++j)
        for (int i = 0; i + j < count; ++i) {
            const auto at = [&](double cell) { return static_cast<float>(cell / count); };
            use(i, j, 1, at(i + 1.0 / 3), at(j + 1.0 / 3));
            if (i + j + 1 < count)
                use(i + 1, j + 1, -1, at(i + 2.0 / 3), at(j + 2.0 / 3));
        }
}

// The states of a card at (left, top), a path for each state.
void drawStates(Svg &svg, int left, int top, const vellum::Micromap &micromap, uint32_t level)
{
    std::array<std::ostringstream, 4> data;
    const int step = kTile >> level;
    for (int half = 0; half < 2; ++half)
        forEachMicroTriangle(level, [&](int i, int j, int direction, float u, float v) {
            const auto state = static_cast<size_t>(micromap.state(static_cast<size_t>(half), u, v));
            const int sign = half == 0 ? 1 : -1;
            const int x = half == 0 ? left + i * step : left + kTile - i * step;
            const int y = half == 0 ? top + j * step : top + kTile - j * step;
            const int side = sign * direction * step;
            data[state] << 'M' << x << ' ' << y << 'h' << side << 'l' << -side << ' ' << side << 'z';
        });
    for (size_t state = 0; state < data.size(); ++state)
        svg.path(data[state].str(),
                 std::string("fill=\"") + kColors[state] + "\" stroke=\"#fff\" stroke-width=\"0.6\"");
    svg.path(leafOutline(left, top), "fill=\"none\" stroke=\"#000\" stroke-width=\"1.2\"");
}

void drawLegend(Svg &svg, double left, double top, bool twoStates)
{
    for (size_t state = 0; state < (twoStates ? 2 : 4); ++state) {
        svg.box(left, top - 13, kColors[state]);
        svg.text(left + 22, top, kNames[state]);
        left += 54 + 8.2 * static_cast<double>(std::strlen(kNames[state]));
    }
}

std::string percent(uint64_t part, uint64_t whole)
{
    std::ostringstream out;
    out.precision(1);
    out << std::fixed << 100 * static_cast<double>(part) / static_cast<double>(whole) << " %";
    return out.str();
}

std::string unknownShare(const vellum::Micromap &micromap, uint32_t level)
{
    return percent(micromap.stateCount(vellum::State::UnknownTransparent) +
                       micromap.stateCount(vellum::State::UnknownOpaque),
                   uint64_t{2} << 2 * level);
}

std::string drawStatesPicture()
{
    Svg svg(640, 340);
    svg.text(20, 26, "alpha texture on a card of two triangles");
    svg.path("M20 40h256v256h-256z", "fill=\"#eee\"");
    svg.path(leafOutline(20, 40), "fill=\"#4a8a3c\"");
    svg.path("M276 40l-256 256", "stroke=\"#000\" stroke-dasharray=\"4 4\" fill=\"none\"");
    svg.text(340, 26, "its micromap at level 4");
    drawStates(svg, 340, 40, bakeCard({.level = 4}), 4);
    drawLegend(svg, 20, 326, false);
    return svg.finish();
}

std::string drawLevelsPicture()
{
    Svg svg(1160, 340);
    for (uint32_t level = 2; level <= 5; ++level) {
        const int left = 20 + static_cast<int>(level - 2) * (kTile + 32);
        const vellum::Micromap micromap = bakeCard({.level = level});
        svg.text(left, 26,
                 "level " + std::to_string(level) + ": " + unknownShare(micromap, level) + " unknown, " +
                     std::to_string(micromap.data().size()) + " bytes");
        drawStates(svg, left, 40, micromap, level);
    }
    drawLegend(svg, 20, 326, false);
    return svg.finish();
}

std::string drawTwoStatesPicture()
{
    Svg svg(872, 340);
    const auto card = [&](int left, const char *title, const vellum::BakeOptions &options) {
        svg.text(left, 26, title);
        drawStates(svg, left, 40, bakeCard(options), 4);
    };
    card(20, "4 states", {.level = 4});
    card(308, "2 states, the nearer one",
         {.format = vellum::MicromapFormat::TwoState, .twoStateRule = vellum::TwoStateRule::Nearest, .level = 4});
    card(596, "2 states, unknown is opaque",
         {.format = vellum::MicromapFormat::TwoState,
          .twoStateRule = vellum::TwoStateRule::UnknownIsOpaque,
          .level = 4});
    drawLegend(svg, 20, 326, false);
    return svg.finish();
}

// The order of micro-triangles in memory.
std::string drawCurvePicture()
{
    Svg svg(1000, 340);
    constexpr double kSide = 290;
    for (uint32_t level = 1; level <= 3; ++level) {
        const double left = 20 + (level - 1) * (kSide + 35);
        const double bottom = 310;
        svg.text(left, 26,
                 "level " + std::to_string(level) + ": " + std::to_string(1 << 2 * level) + " micro-triangles");
        // Vertex 0 at the lower left, 1 at the lower right, 2 at the top.
        const auto place = [&](double u, double v) {
            std::ostringstream out;
            out << std::lround(left + (u + v / 2) * kSide) << ' ' << std::lround(bottom - v * kSide * 0.866);
            return out.str();
        };
        std::string grid;
        std::vector<std::array<double, 2>> order(size_t{1} << 2 * level);
        const double step = 1.0 / (1 << level);
        forEachMicroTriangle(level, [&](int i, int j, int direction, float u, float v) {
            const double x = i * step;
            const double y = j * step;
            grid +=
                'M' + place(x, y) + 'L' + place(x + direction * step, y) + 'L' + place(x, y + direction * step) + 'Z';
            order[vellum::shared::curveIndex(u, v, level)] = {u, v};
        });
        svg.path(grid, "fill=\"#eef4fb\" stroke=\"#8aa\"");
        std::string curve;
        for (const auto &[u, v] : order)
            curve += (curve.empty() ? 'M' : 'L') + place(u, v);
        svg.path(curve, "fill=\"none\" stroke=\"#d55e00\" stroke-width=\"2\"");
        for (size_t i = 0; i < order.size(); ++i) {
            std::istringstream at(place(order[i][0], order[i][1]));
            double x = 0;
            double y = 0;
            at >> x >> y;
            svg.text(x, y + 4, std::to_string(i),
                     level < 3 ? "text-anchor=\"middle\" font-weight=\"bold\""
                               : "text-anchor=\"middle\" font-size=\"10\"");
        }
        svg.text(left - 12, bottom + 16, "0");
        svg.text(left + kSide + 4, bottom + 16, "1");
        svg.text(left + kSide / 2 + 12, bottom - kSide * 0.866 + 4, "2");
    }
    return svg.finish();
}

std::string read(const std::filesystem::path &path)
{
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

} // namespace

int main(int argc, char **argv)
{
    if (argc < 2 || argc > 3 || (argc == 3 && std::string(argv[2]) != "--check")) {
        std::cerr << "usage: vellum_draw_pictures FOLDER [--check]\n";
        return 2;
    }
    int stale = 0;
    const std::array<std::pair<const char *, std::string>, 4> pictures{{{"states.svg", drawStatesPicture()},
                                                                        {"levels.svg", drawLevelsPicture()},
                                                                        {"two-states.svg", drawTwoStatesPicture()},
                                                                        {"curve.svg", drawCurvePicture()}}};
    for (const auto &[name, content] : pictures) {
        const std::filesystem::path path = std::filesystem::path(argv[1]) / name;
        if (argc == 2)
            std::ofstream(path, std::ios::binary) << content;
        else if (read(path) != content) {
            std::cerr << path << " is not what this program draws\n";
            ++stale;
        }
    }
    return stale == 0 ? 0 : 1;
}
