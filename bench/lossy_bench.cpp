// SPDX-License-Identifier: Apache-2.0
// vellum-lossy-bench: the share of bytes of compacted micromaps that lossy ones save, and the factor by which rays call
// the shader more often. The scenes' micromaps are coarsened by core/lossy.h, whose result equals a lossy build's bit
// for bit.
#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "cli/render_command.h"
#include "core/curve.h"
#include "core/lossy.h"
#include "core/micromap_memory.h"
#include "gpu/instance.h"
#include "scene_bench.h"

namespace
{

using namespace vellum;

// A micromap's bytes after compaction.
uint64_t compactedBytes(const Micromap &micromap)
{
    if (micromap.triangles.empty())
        return 0;
    MicromapBuildInput input;
    input.triangles = reinterpret_cast<const uint8_t *>(micromap.triangles.data());
    input.triangleCount = static_cast<uint32_t>(micromap.triangles.size());
    input.data = micromap.data.data();
    input.dataBytes = micromap.data.size();
    input.maxLevel = shared::kMaxSubdivisionLevel;
    input.buildFlags = VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT;
    for (const MicromapTriangle &t : micromap.triangles)
        if (t.subdivisionLevel > shared::kCoarseLevel)
            input.capacityUnits += (packedBytes(t.subdivisionLevel, t.format) + 15) / 16;
    std::vector<uint8_t> memory(micromapMemoryBytes(input.triangleCount, input.capacityUnits));
    writeMicromapMemory(input, memory.data());
    return CompactedMicromap(memory.data()).bytes();
}

// Cuts every triangle of masked geometry into n * n: more distinct triangles, each with less in it.
void cut(Scene &scene, uint32_t n)
{
    for (Geometry &g : scene.geometries) {
        if (!scene.materials[g.material].masked() || n < 2)
            continue;
        Geometry out{.material = g.material};
        for (size_t t = 0; t + 2 < g.indices.size(); t += 3) {
            const uint32_t *corner = &g.indices[t];
            const auto first = static_cast<uint32_t>(out.positions.size());
            const auto at = [&](uint32_t i, uint32_t j) { return first + i * (2 * n + 3 - i) / 2 + j; };
            for (uint32_t i = 0; i <= n; ++i) {
                for (uint32_t j = 0; i + j <= n; ++j) {
                    const float b = static_cast<float>(i) / static_cast<float>(n);
                    const float c = static_cast<float>(j) / static_cast<float>(n);
                    const auto mix = [&](float x, float y, float z) { return x + b * (y - x) + c * (z - x); };
                    Vec3 position;
                    for (size_t k = 0; k < 3; ++k)
                        position[k] =
                            mix(g.positions[corner[0]][k], g.positions[corner[1]][k], g.positions[corner[2]][k]);
                    const TexCoord &p = g.uvs[corner[0]];
                    const TexCoord &q = g.uvs[corner[1]];
                    const TexCoord &r = g.uvs[corner[2]];
                    out.positions.push_back(position);
                    out.uvs.push_back({mix(p.u, q.u, r.u), mix(p.v, q.v, r.v)});
                }
            }
            for (uint32_t i = 0; i < n; ++i) {
                for (uint32_t j = 0; i + j < n; ++j) {
                    out.indices.insert(out.indices.end(), {at(i, j), at(i + 1, j), at(i, j + 1)});
                    if (i + j + 1 < n)
                        out.indices.insert(out.indices.end(), {at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
                }
            }
        }
        g = std::move(out);
    }
}

struct Options {
    std::vector<std::filesystem::path> files;
    std::string size = "640x360";
    std::vector<uint32_t> levels = {4, 5, 6, 7, 8};
    std::vector<uint32_t> cuts = {1, 4};
    std::vector<uint32_t> prices = {shared::kLossyPriceLog2};
    uint32_t instances = 1;
};

struct Measured {
    uint64_t bytes = 0;
    double perRay = 0;
};

Measured measure(gpu::Device &device, const render::RenderScene &scene, const std::vector<Micromap> &micromaps,
                 const render::RenderSettings &settings)
{
    Measured result;
    std::vector<const Micromap *> pointers;
    for (const Micromap &m : micromaps) {
        result.bytes += compactedBytes(m);
        pointers.push_back(m.indices.empty() ? nullptr : &m);
    }
    result.perRay = render::Renderer(device, scene, pointers, settings).count().perRay();
    return result;
}

void run(const Options &options)
{
    render::RenderSettings settings;
    cli::parseSize(options.size, settings);
    gpu::offerLayer(std::nullopt);
    const gpu::Instance instance(true);
    gpu::Device device(gpu::DeviceSelection().from(instance), gpu::Api::Khr);
    fmt::print("| scene | cut | level | price | bytes lossless | bytes lossy | lossy/lossless | calls/ray lossless | "
               "calls/ray lossy | more calls |\n|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n");
    for (const std::filesystem::path &file : options.files) {
        for (const uint32_t pieces : options.cuts) {
            Scene loaded = cli::loadScene(file);
            cut(loaded, pieces);
            const render::RenderScene scene = render::prepareScene(std::move(loaded), options.instances);
            for (const uint32_t level : options.levels) {
                BakeOptions bake;
                bake.level = level;
                const render::BakedScene baked = render::bakeScene(scene.scene, bake);
                std::vector<Micromap> lossless;
                for (const std::optional<Micromap> &r : baked.results)
                    lossless.push_back(r.value_or(Micromap{}));
                const Measured before = measure(device, scene, lossless, settings);
                for (const uint32_t price : options.prices) {
                    std::vector<Micromap> lossy;
                    for (const Micromap &m : lossless)
                        lossy.push_back(lossyMicromap(m, price));
                    const Measured after = measure(device, scene, lossy, settings);
                    fmt::print("| {} | {} | {} | {} | {} | {} | {:.2f} | {:.4f} | {:.4f} | {:+.1f} % |\n",
                               file.stem().string(), pieces, level, 1u << price, before.bytes, after.bytes,
                               static_cast<double>(after.bytes) / static_cast<double>(before.bytes), before.perRay,
                               after.perRay, 100 * (after.perRay / before.perRay - 1));
                    std::fflush(stdout);
                }
            }
        }
    }
}

} // namespace

int main(int argc, char **argv)
{
    try {
        Options options;
        CLI::App app("Bytes and shader calls of lossy micromaps against lossless ones; prints Markdown.",
                     "vellum-lossy-bench");
        app.add_option("files", options.files, "GLB files; without: the shared trees");
        app.add_option("-s,--size", options.size, "Width and height in pixels")->capture_default_str();
        app.add_option("-l,--levels", options.levels, "Subdivision levels")
            ->capture_default_str()
            ->check(CLI::Range(0, 12));
        app.add_option("-c,--cuts", options.cuts, "Cut every masked triangle into n * n")
            ->capture_default_str()
            ->check(CLI::Range(1, 32));
        app.add_option("--prices", options.prices, "A micro-triangle that becomes unknown must save the states of 2^n")
            ->capture_default_str()
            ->check(CLI::Range(0, 7));
        app.add_option("-n,--instances", options.instances, "Copies")
            ->capture_default_str()
            ->check(CLI::Range(1, 1000));
        CLI11_PARSE(app, argc, argv);
        if (options.files.empty())
            for (const char *name : {"ash_medium.glb", "aspen_medium.glb", "bush_1.glb"})
                options.files.push_back(std::filesystem::path(VELLUM_ASSETS) / name);
        run(options);
        return 0;
    } catch (const std::exception &error) {
        std::fprintf(stderr, "vellum-lossy-bench: %s\n", error.what());
        return 1;
    }
}
