// How fast the baker is: a card with a painted twig, by level, on one thread.
#include <benchmark/benchmark.h>

#include "bake/bake.h"
#include "cli/scene/leaf_texture.h"

namespace
{

using namespace vellum;

const AlphaTexture &leafTexture(std::uint32_t size)
{
    static const auto make = [](std::uint32_t texels) {
        const Image image = cli::paintTwig({}, texels);
        return AlphaTexture::fromUnorm8(image.width, image.height, image.rgba.data() + 3, 4);
    };
    static const AlphaTexture small = make(256);
    static const AlphaTexture large = make(1024);
    return size == 256 ? small : large;
}

void bakeCard(benchmark::State &state)
{
    const AlphaTexture &texture = leafTexture(static_cast<std::uint32_t>(state.range(0)));
    const TriangleUvs card[] = {{{{0, 1}, {1, 1}, {1, 0}}}, {{{0, 1}, {1, 0}, {0, 0}}}};
    BakeOptions options;
    options.level = static_cast<std::uint32_t>(state.range(1));
    options.threads = 1;
    BakeResult result;
    for (auto _ : state) {
        result = bake(texture, card, options);
        benchmark::DoNotOptimize(result.micromap.data.data());
    }
    const auto &s = result.statistics.states;
    const auto all = static_cast<double>(s[0] + s[1] + s[2] + s[3]);
    state.counters["unknown"] = static_cast<double>(s[2] + s[3]) / all;
    state.counters["micro-triangles/s"] =
        benchmark::Counter(all, benchmark::Counter::kIsIterationInvariantRate, benchmark::Counter::kIs1000);
}

BENCHMARK(bakeCard)->ArgsProduct({{256, 1024}, {3, 5, 7, 9}})->Unit(benchmark::kMillisecond);

} // namespace
