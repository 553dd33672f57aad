// SPDX-License-Identifier: Apache-2.0
// Random scenes, traced by ray queries through the layer and by the oracle, compared ray by ray: the candidates handed
// to the shader and the hit that stays.
#include <algorithm>
#include <cmath>

#include "compare.h"
#include "packed_scene.h"

namespace
{

using namespace oracle;

// What is wrong with the result; empty: nothing.
std::string fault(const vt::Ray &ray, const std::vector<Hit> &hits, const vt::Result &result)
{
    if (result.flags != ray.flags)
        return "ray flags read back as " + std::to_string(result.flags);
    if (result.tMin < ray.tMin || result.tMin > ray.tMin)
        return "tMin read back wrong";
    if (result.candidateCount > kCapacity)
        return "too many candidates";

    // Every candidate must be one that traversal may hand out.
    bool generated = false;
    for (const vt::Candidate &c : result.candidates) {
        const auto hit = std::find_if(hits.begin(), hits.end(), [&c](const Hit &h) {
            return names(h, c) && h.box == c.box() && (h.box || h.opacity == Opacity::NonOpaque);
        });
        if (hit == hits.end())
            return "a candidate that is none: instance " + std::to_string(c.instance) + " geometry " +
                   std::to_string(c.geometry) + " primitive " + std::to_string(c.primitive) + " custom index " +
                   std::to_string(c.customIndex);
        if (hit->box) {
            generated |= c.confirmed();
            if (c.boxOpaque() != (hit->opacity == Opacity::Opaque))
                return "candidateAABBOpaque";
        } else if (std::abs(double{c.u} - hit->u) > 1e-3 || std::abs(double{c.v} - hit->v) > 1e-3 ||
                   std::abs(double{c.t} - hit->t) > 1e-3 || c.frontFace() != hit->frontFace) {
            return "place of a candidate";
        }
    }

    // The hit that stays: the nearest accepted triangle, or what the shader generated for a box.
    const Hit *nearest = nullptr;
    for (const Hit &h : hits) {
        if (!h.box && (h.opacity == Opacity::Opaque || confirms(ray, h)) && (nearest == nullptr || h.t < nearest->t))
            nearest = &h;
    }
    const double limit = std::min(nearest != nullptr ? nearest->t : double{ray.tMax},
                                  generated ? double{ray.generate} : double{ray.tMax});
    if (result.committed == vt::kTriangle) {
        const auto hit = std::find_if(hits.begin(), hits.end(), [&](const Hit &h) {
            return !h.box && names(h, result) && (h.opacity == Opacity::Opaque || confirms(ray, h));
        });
        if (hit == hits.end())
            return "the committed triangle is none that may be";
        if (std::abs(double{result.u} - hit->u) > 1e-3 || std::abs(double{result.v} - hit->v) > 1e-3 ||
            std::abs(double{result.t} - hit->t) > 1e-3 || (result.frontFace != 0) != hit->frontFace)
            return "place of the committed triangle";
        if ((ray.flags & vt::kRayTerminateOnFirstHit) == 0 && hit->t > limit + 1e-3)
            return "the committed triangle is not the nearest";
    } else if (result.committed == vt::kGenerated) {
        if (!generated || (nearest != nullptr && double{ray.generate} > nearest->t + 1e-3 &&
                           (ray.flags & vt::kRayTerminateOnFirstHit) == 0))
            return "a generated hit that should not be";
        if (std::none_of(hits.begin(), hits.end(), [&](const Hit &h) { return h.box && names(h, result); }))
            return "the generated hit names no box";
    } else if (nearest != nullptr || generated) {
        return "nothing committed";
    }

    // Nearer than that hit, nothing may have been left out.
    if ((ray.flags & vt::kRayTerminateOnFirstHit) != 0 && result.committed != vt::kNone)
        return {};
    for (const Hit &h : hits) {
        if (!h.certain || h.t > limit - 1e-3 || (!h.box && h.opacity == Opacity::Opaque))
            continue;
        if (std::none_of(result.candidates.begin(), result.candidates.end(),
                         [&h](const vt::Candidate &c) { return names(h, c); }))
            return "a candidate was left out: instance " + std::to_string(h.instance) + " geometry " +
                   std::to_string(h.geometry) + " primitive " + std::to_string(h.primitive);
    }
    return {};
}

std::vector<Traced> judged(const Scene &scene, std::span<const Hits> hits, const std::vector<vt::Result> &results)
{
    std::vector<Traced> traced;
    for (size_t i = 0; i < results.size(); ++i)
        traced.push_back({fault(scene.rays[i], hits[i].hits, results[i]), results[i].candidateCount,
                          results[i].committed != vt::kNone});
    return traced;
}

void compare(vt::Gpu &gpu, const Limits &limits, uint32_t scenes, uint64_t minimum)
{
    vt::Tracer tracer(gpu);
    compareScenes(gpu, limits, scenes, minimum, [&](const Scene &scene, std::span<const Hits> hits) {
        const Built built = build(gpu, scene);
        return judged(scene, hits, tracer.trace(*built.scene, scene.rays, kCapacity));
    });
}

class Oracle : public vt::GpuTest
{
};

class OracleWithoutLayer : public vt::GpuTest
{
protected:
    OracleWithoutLayer() : GpuTest({.vellum = false, .validation = false, .micromaps = false}) {}
};

// The scenes in packed memory: traced while one of their objects is built beside it, changed in place, and traced
// again.
class PackedOracle : public vt::GpuTest
{
protected:
    explicit PackedOracle(vt::Memory memory = vt::Memory::Packed)
        : GpuTest({.validation = false, .maintenance = true, .memory = memory})
    {
    }

    void comparePacked(uint32_t scenes, uint64_t minimum)
    {
        vt::Tracer tracer(gpu());
        Random random(setting("VELLUM_ORACLE_SEED", 20260519));
        uint64_t traces = 0;
        compareScenes(gpu(), {.rays = 160}, scenes, minimum, [&](const Scene &scene, std::span<const Hits> hits) {
            PackedScene packed(gpu(), scene, random);
            std::vector<Traced> all;
            for (int round = 0; round < 4; ++round, ++traces) {
                packed.traceBesideBuild(tracer, scene.rays, kCapacity);
                std::vector<Traced> traced = judged(scene, hits, tracer.results());
                for (size_t i = 0; i < traced.size(); ++i) {
                    if (all.size() < traced.size() || all[i].fault.empty())
                        traced[i].fault += traced[i].fault.empty() ? "" : " after: " + packed.history();
                    else
                        traced[i].fault = all[i].fault;
                }
                all = std::move(traced);
                if (round < 3)
                    packed.change();
            }
            return all;
        });
        const vt::Arena::Counts counts = gpu().arena()->counts();
        std::printf("%llu traces; arena: %llu buffers, %llu pieces, %llu operations, %llu bytes compared that they may "
                    "not write to\n",
                    static_cast<unsigned long long>(traces), static_cast<unsigned long long>(counts.buffers),
                    static_cast<unsigned long long>(counts.pieces), static_cast<unsigned long long>(counts.operations),
                    static_cast<unsigned long long>(counts.otherBytes));
    }
};

class PackedToTheEndOracle : public PackedOracle
{
protected:
    PackedToTheEndOracle() : PackedOracle(vt::Memory::PackedToTheEnd) {}
};

// Whether oracle and driver agree where Vellum has no part.
TEST_F(OracleWithoutLayer, PlainScenes)
{
    compare(gpu(), {.micromaps = false}, 40, 20000);
}

TEST_F(Oracle, RandomScenes)
{
    compare(gpu(), {}, 400, 200000);
}

// Fewer and finer: micromaps up to level 9.
TEST_F(Oracle, FineMicromaps)
{
    compare(gpu(), {.maxLevel = 9, .rays = 400}, 20, 1000);
}

TEST_F(Oracle, PlainScenes)
{
    compare(gpu(), {.micromaps = false}, 40, 20000);
}

TEST_F(PackedOracle, RandomScenes)
{
    comparePacked(100, 14000);
}

TEST_F(PackedToTheEndOracle, RandomScenes)
{
    comparePacked(100, 14000);
}

} // namespace
