// vellum-bake-bench: how fast the baker is and how much it leaves unknown, by level; beside meshoptimizer's, if its
// shared library is given. Times are user seconds of the process, preparation of the texture included.
#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <random>

#include "bake/bake.h"
#include "opacity_map_rival.h"

namespace
{

using namespace vellum;

double userSeconds()
{
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return static_cast<double>(usage.ru_utime.tv_sec) + static_cast<double>(usage.ru_utime.tv_usec) * 1e-6;
}

class Random
{
public:
    explicit Random(std::uint32_t seed) : m_engine(seed) {}
    double operator()(double low, double high)
    {
        return low + (high - low) * static_cast<double>(m_engine()) / 4294967296.0;
    }

private:
    std::mt19937 m_engine;
};

// Toothed leaves with soft borders at random places of a texture that repeats, until 40 % of it is covered.
std::vector<std::uint8_t> paintLeaves(std::uint32_t size)
{
    std::vector<std::uint8_t> alpha(std::size_t{size} * size);
    Random random(7);
    std::size_t covered = 0;
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
                    return static_cast<std::size_t>(std::fmod(std::floor(c) + size, size));
                };
                std::uint8_t &texel = alpha[wrap(y + dy) * size + wrap(x + dx)];
                const auto byte = static_cast<std::uint8_t>(std::lround(value * 255));
                covered += texel < 128 && byte >= 128 ? 1u : 0u;
                texel = std::max(texel, byte);
            }
        }
    }
    return alpha;
}

// Triangles with edges of 60 to 100 texels at random places, turned at random.
std::vector<TriangleUvs> scatter(std::size_t count, std::uint32_t size)
{
    Random random(11);
    std::vector<TriangleUvs> triangles(count);
    for (TriangleUvs &uvs : triangles) {
        // Two edges of such lengths, at an angle that gives the third one such a length.
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

struct Run {
    double seconds = 1e300; // the best of all rounds
    BakeResult result;
};

void bakeOnce(Run &run, const std::vector<std::uint8_t> &alpha, std::uint32_t size,
              const std::vector<TriangleUvs> &triangles, const BakeOptions &options)
{
    const double before = userSeconds();
    const AlphaTexture texture = AlphaTexture::fromUnorm8(size, size, alpha.data(), 1);
    run.result = bake(texture, triangles, options);
    run.seconds = std::min(run.seconds, userSeconds() - before);
}

double unknownShare(const BakeStatistics &s)
{
    const auto unknown = static_cast<double>(s.states[2] + s.states[3]);
    return unknown / (unknown + static_cast<double>(s.states[0] + s.states[1]));
}

struct Settings {
    std::size_t triangles = 10000;
    std::uint32_t size = 1024;
    unsigned threads = 1;
    unsigned rounds = 3;
    std::vector<std::string> levels = {"3", "5", "auto", "7"};
    std::string rival;
};

void measure(const Settings &settings, const std::string &level, const std::vector<std::uint8_t> &alpha,
             const std::vector<TriangleUvs> &triangles, const bench::OpacityMapRival *rival)
{
    BakeOptions options;
    options.threads = settings.threads;
    if (level != "auto")
        options.level = static_cast<std::uint32_t>(std::stoul(level));
    BakeOptions exact = options;
    exact.valueTolerance = exact.subtexelTolerance = exact.barycentricTolerance = exact.interpolationTolerance = 0;

    Run own;
    Run tolerant;
    double theirs = 1e300;
    bench::RivalResult theirResult;
    for (unsigned round = 0; round < settings.rounds; ++round) {
        bakeOnce(own, alpha, settings.size, triangles, exact);
        bakeOnce(tolerant, alpha, settings.size, triangles, options);
        if (rival != nullptr) {
            const double before = userSeconds();
            theirResult = rival->bake(alpha, settings.size, triangles, own.result.micromap);
            theirs = std::min(theirs, userSeconds() - before);
        }
    }
    std::uint64_t all = 0;
    for (const std::uint64_t count : own.result.statistics.states)
        all += count;
    fmt::print("{:>5} {:>10.3f} s {:>8.1f} M/s {:>8.3f} % {:>10.3f} s {:>8.3f} %", level, own.seconds,
               static_cast<double>(all) / own.seconds * 1e-6, 100 * unknownShare(own.result.statistics),
               tolerant.seconds, 100 * unknownShare(tolerant.result.statistics));
    if (rival != nullptr) {
        const bench::RivalScore score = bench::score(theirResult, own.result.micromap);
        fmt::print(" {:>10.3f} s {:>8.3f} % {:>8.1f} {:>8.2f} {:>8.2f}", theirs, 100 * score.unknown,
                   score.wrongPerMillion, theirs / own.seconds, theirs / tolerant.seconds);
    }
    fmt::print("\n");
    std::fflush(stdout);
}

} // namespace

int main(int argc, char **argv)
{
    Settings settings;
    CLI::App app("Measures the baker over a texture of toothed leaves that repeats.");
    app.add_option("--triangles", settings.triangles, "Triangles, with edges of 60 to 100 texels [10000]");
    app.add_option("--texture", settings.size, "Texels along a side of the texture [1024]");
    app.add_option("--threads", settings.threads, "Worker threads of the baker [1]");
    app.add_option("--rounds", settings.rounds, "Runs of each, of which the best counts [3]");
    app.add_option("--levels", settings.levels, "Levels, 0 to 12 or auto [3,5,auto,7]")->delimiter(',');
    app.add_option("--meshoptimizer", settings.rival,
                   "A shared library of meshoptimizer with its opacityMap functions, to run on\n"
                   "the same triangles, texture and levels in between");
    CLI11_PARSE(app, argc, argv);

    std::unique_ptr<bench::OpacityMapRival> rival;
    if (!settings.rival.empty())
        rival = std::make_unique<bench::OpacityMapRival>(settings.rival);
    const std::vector<std::uint8_t> alpha = paintLeaves(settings.size);
    const std::vector<TriangleUvs> triangles = scatter(settings.triangles, settings.size);
    fmt::print("{:>5} {:>12} {:>12} {:>10} {:>12} {:>10}", "level", "exact", "exact", "unknown", "tolerant", "unknown");
    if (rival)
        fmt::print(" {:>12} {:>10} {:>8} {:>8} {:>8}", "meshoptimizer", "unknown", "wrong/M", "/ exact", "/ tolerant");
    fmt::print("\n");
    for (const std::string &level : settings.levels)
        measure(settings, level, alpha, triangles, rival.get());
    return 0;
}
