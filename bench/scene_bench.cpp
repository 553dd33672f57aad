// SPDX-License-Identifier: Apache-2.0
#include "scene_bench.h"

#include "base/statistics.h"

namespace vellum::bench
{
namespace
{

using render::Renderer;

using Micromaps = std::vector<const Micromap *>;

// A renderer, and the one without the layer that it is compared to.
struct Variant {
    Variant(std::unique_ptr<render::Renderer> own, render::Renderer &other, double &median)
        : renderer(std::move(own)), compared(&other), result(&median),
          times([&other] { return other.frame(); }, [r = renderer.get()] { return r->frame(); })
    {
    }
    std::unique_ptr<render::Renderer> renderer;
    render::Renderer *compared;
    double *result; // where the median goes
    PairedTiming times;
};

} // namespace

SceneResult measureScene(const cli::TimedDevices &devices, const render::RenderScene &scene,
                         render::RenderSettings settings, const std::vector<uint32_t> &levels, unsigned repetitions,
                         const std::function<void(size_t done, size_t total)> &progress)
{
    SceneResult result;
    result.levels.resize(levels.size());
    settings.heavy = false;
    render::Renderer plain(devices.bare, scene, {}, settings);
    settings.heavy = true;
    render::Renderer heavy(devices.bare, scene, {}, settings);
    result.candidatesPerRay = plain.count().perRay();

    std::vector<Variant> variants;
    const auto add = [&](const Micromaps &micromaps, bool isHeavy, double &ratio) -> render::Renderer & {
        settings.heavy = isHeavy;
        variants.emplace_back(std::make_unique<render::Renderer>(devices.layered, scene, micromaps, settings),
                              isHeavy ? heavy : plain, ratio);
        return *variants.back().renderer;
    };
    for (size_t i = 0; i < levels.size(); ++i) {
        LevelResult &level = result.levels[i];
        level.level = levels[i];
        BakeOptions options;
        options.level = levels[i];
        const render::BakedScene baked = render::bakeScene(scene.scene, options);
        const auto shares = baked.stateShares();
        level.unknown = shares[2] + shares[3];
        render::Renderer &omm = add(baked.micromaps(), false, level.plainRatio);
        level.candidatesPerRay = omm.count().perRay();
        level.bytes = omm.micromapBytes();
        add(baked.micromaps(), true, level.heavyRatio);
    }
    add({}, false, result.withoutMicromaps);

    for (Variant &v : variants)
        v.renderer->frame(); // warms up
    plain.frame();
    heavy.frame();
    size_t done = 0;
    for (unsigned r = 0; r < repetitions; ++r) {
        for (Variant &v : variants) {
            v.times.measure();
            progress(++done, repetitions * variants.size());
        }
    }
    for (const Variant &v : variants) {
        *v.result = v.times.ratio().middle;
        (v.compared == &heavy ? result.heavyMilliseconds : result.alphaMilliseconds) = v.times.a();
    }
    return result;
}

} // namespace vellum::bench
