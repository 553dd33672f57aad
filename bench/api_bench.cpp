// SPDX-License-Identifier: Apache-2.0
#include "api_bench.h"

#include "base/statistics.h"
#include "render/baked_scene.h"

namespace vellum::bench
{
namespace
{

using render::Renderer;

// Two renderers of the same frames.
struct Pair {
    render::Renderer khr;
    render::Renderer ext;
    ApiResult result;
    PairedTiming times{[this] { return ext.frame(); }, [this] { return khr.frame(); }};

    Pair(const ApiDevices &devices, const render::RenderScene &scene, const render::BakedScene &baked,
         const render::RenderSettings &settings)
        : khr(devices.khr, scene, baked.micromaps(), settings), ext(devices.ext, scene, baked.micromaps(), settings)
    {
    }
};

} // namespace

std::vector<ApiResult> compareApis(const ApiDevices &devices, const render::RenderScene &scene,
                                   render::RenderSettings settings, const std::vector<uint32_t> &levels,
                                   unsigned repetitions, const std::function<void(size_t done, size_t total)> &progress)
{
    std::vector<std::unique_ptr<Pair>> pairs;
    for (const uint32_t level : levels) {
        BakeOptions options;
        options.level = level;
        const render::BakedScene baked = render::bakeScene(scene.scene, options);
        for (const bool heavy : {false, true}) {
            settings.heavy = heavy;
            Pair &pair = *pairs.emplace_back(std::make_unique<Pair>(devices, scene, baked, settings));
            pair.result.level = level;
            pair.result.heavy = heavy;
        }
    }
    for (const auto &pair : pairs) { // warms up, too
        ApiResult &result = pair->result;
        render::Renderer *const renderers[] = {&pair->khr, &pair->ext};
        Picture pictures[2];
        for (const size_t i : {size_t{0}, size_t{1}}) {
            renderers[i]->frame();
            pictures[i] = renderers[i]->picture();
            result.candidatesPerRay[i] = renderers[i]->count().perRay();
            result.bytes[i] = renderers[i]->micromapBytes();
        }
        result.differingPixels = vellum::compare(pictures[0], pictures[1]).pixels;
    }
    size_t done = 0;
    for (unsigned r = 0; r < repetitions; ++r) {
        for (const auto &pair : pairs) {
            pair->times.measure();
            progress(++done, repetitions * pairs.size());
        }
    }
    std::vector<ApiResult> results;
    for (const auto &pair : pairs) {
        pair->result.milliseconds[0] = pair->times.b();
        pair->result.milliseconds[1] = pair->times.a();
        pair->result.ratio = pair->times.ratio().middle;
        results.push_back(pair->result);
    }
    return results;
}

} // namespace vellum::bench
