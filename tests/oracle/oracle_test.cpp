// Random scenes, traced through the layer and by the oracle, compared ray by ray: the candidates handed to the shader
// and the hit that stays.
//   VELLUM_ORACLE_SEED    seed of the first scene (each scene has its own: this plus its number)
//   VELLUM_ORACLE_SCENES  number of scenes
#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "cpu_trace.h"

namespace
{

using namespace oracle;

constexpr std::uint32_t kCapacity = 64; // candidates of a ray

std::uint32_t setting(const char *name, std::uint32_t otherwise)
{
    const char *value = std::getenv(name);
    return value != nullptr ? static_cast<std::uint32_t>(std::strtoul(value, nullptr, 0)) : otherwise;
}

// The scene on the device.
struct Built {
    std::vector<std::unique_ptr<vt::Micromap>> micromaps;
    std::vector<std::unique_ptr<vt::Blas>> objects;
    std::unique_ptr<vt::Tlas> scene;
};

Built build(vt::Gpu &gpu, const Scene &scene)
{
    Built built;
    for (const Object &object : scene.objects) {
        std::vector<vt::Geometry> geometries;
        for (const Mesh &mesh : object.meshes) {
            vt::Geometry geometry;
            geometry.vertices = mesh.vertices;
            geometry.boxes = mesh.boxes;
            geometry.flags = mesh.opaque ? VK_GEOMETRY_OPAQUE_BIT_KHR : 0;
            if (mesh.micromap) {
                const MeshMicromap &from = *mesh.micromap;
                vt::Attachment attachment;
                attachment.indexType = from.indexType;
                attachment.indices = from.indices;
                attachment.base = from.base;
                if (!from.null) {
                    vt::MicromapInput input;
                    for (const MicromapTriangle &triangle : from.triangles)
                        input.add(triangle.level, triangle.format, triangle.states);
                    built.micromaps.push_back(std::make_unique<vt::Micromap>(gpu, std::move(input)));
                    built.micromaps.back()->build();
                    attachment.micromap = built.micromaps.back().get();
                }
                geometry.micromap = std::move(attachment);
            }
            geometries.push_back(std::move(geometry));
        }
        built.objects.push_back(std::make_unique<vt::Blas>(
            gpu, std::move(geometries),
            gpu.options().micromaps
                ? VkBuildAccelerationStructureFlagsKHR{VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_DISABLE_OPACITY_MICROMAPS_EXT}
                : 0));
    }
    std::vector<VkAccelerationStructureInstanceKHR> instances;
    for (const Instance &from : scene.instances) {
        auto instance = vt::instance(*built.objects[from.object], {}, from.customIndex, from.flags, from.mask);
        instance.transform = from.transform;
        if (from.inactive)
            instance.accelerationStructureReference = 0;
        instances.push_back(instance);
    }
    built.scene = std::make_unique<vt::Tlas>(gpu, instances);
    return built;
}

bool confirms(const vt::Ray &ray, const Hit &hit)
{
    return ray.rule == vt::kAlways ||
           (ray.rule == vt::kHash && vt::hashConfirms(hit.customIndex, hit.instance, hit.geometry, hit.primitive));
}

template <class T>
bool names(const Hit &hit, const T &other)
{
    return hit.instance == other.instance && hit.geometry == other.geometry && hit.primitive == other.primitive &&
           hit.customIndex == other.customIndex;
}

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

void compare(vt::Gpu &gpu, const Limits &limits, std::uint32_t scenes, std::uint64_t minimum)
{
    const std::uint32_t seed = setting("VELLUM_ORACLE_SEED", 20260519);
    scenes = setting("VELLUM_ORACLE_SCENES", scenes);
    std::printf("seed %u, %u scenes\n", seed, scenes);
    vt::Tracer tracer(gpu);
    std::uint64_t compared = 0, unsure = 0, handed = 0, hit = 0;
    int faults = 0;
    for (std::uint32_t s = 0; s < scenes; ++s) {
        Random random(seed + s);
        const Scene scene = randomScene(random, limits);
        const Built built = build(gpu, scene);
        const std::vector<vt::Result> results = tracer.trace(*built.scene, scene.rays, kCapacity);
        for (std::size_t i = 0; i < results.size(); ++i) {
            const Hits hits = allHits(scene, scene.rays[i]);
            if (hits.unsure) {
                ++unsure;
                continue;
            }
            ++compared;
            handed += results[i].candidateCount;
            hit += results[i].committed != vt::kNone ? 1u : 0u;
            const std::string what = fault(scene.rays[i], hits.hits, results[i]);
            if (!what.empty() && ++faults <= 10)
                ADD_FAILURE() << "scene seed " << seed + s << " ray " << i << std::hex << " flags 0x"
                              << scene.rays[i].flags << std::dec << ": " << what;
        }
    }
    std::printf("%llu rays compared, %llu too close to call, %llu candidates, %llu hits\n",
                static_cast<unsigned long long>(compared), static_cast<unsigned long long>(unsure),
                static_cast<unsigned long long>(handed), static_cast<unsigned long long>(hit));
    EXPECT_EQ(faults, 0);
    EXPECT_LT(static_cast<double>(unsure), 0.05 * static_cast<double>(compared + unsure));
    if (std::getenv("VELLUM_ORACLE_SCENES") == nullptr) {
        EXPECT_GE(compared, minimum);
    }
}

class Oracle : public vt::GpuTest
{
};

class OracleWithoutLayer : public vt::GpuTest
{
protected:
    OracleWithoutLayer() : GpuTest({.vellum = false, .validation = false, .micromaps = false}) {}
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

} // namespace
