// SPDX-License-Identifier: Apache-2.0
// A scene with everything that decides over a hit: every state of both formats, special indices, a geometry without
// micromap and boxes, in opaque and other geometries, under all instance flags; and what the specification says a
// pipeline does with a ray to each of them.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>

#include "check/oracle/outcome.h"
#include "gpu/pipeline_tracer.h"
#include "harness/harness.h"

namespace vt
{

// False: constant ray flags travel like others, by the layer's own environment variable VELLUM_CONSTANT_RAY_FLAGS.
inline bool constantRayFlags()
{
    const char *value = std::getenv("VELLUM_CONSTANT_RAY_FLAGS");
    return !value || std::strcmp(value, "off") != 0;
}

class PipelineScene
{
public:
    // The hit records of the tracer; boxes use record `boxRecord`, triangles record 0.
    struct View {
        bool triangleAnyHit = true, boxAnyHit = true;
        bool triangleClosestHit = true, boxClosestHit = true;
        std::optional<uint32_t> runTimeFlags; // else the ray's own
        bool skipTriangles = false, skipBoxes = false;
        bool miss = true;
        bool terminates = false; // any-hit shaders end the ray that they accept
        // False: what the miss shader reads is not looked at. Bare lavapipe (Mesa 25.0.7) gives some miss shaders
        // garbage for IncomingRayFlags where the pipeline has no hit group.
        bool missFlags = true;
        bool constantFlags = false; // of all rays of the pipeline: intersection shaders see them, whatever the driver
        uint32_t firstRecord = 0;   // added to the scene's record indices by the trace
        uint32_t firstData = 100;   // data of the table's record 0
    };
    struct Config {
        bool micromaps = true; // where they are enabled on the device
        uint32_t triangleRecord = 0;
        uint32_t boxRecord = kBoxRecord;
        VkBuildAccelerationStructureFlagsKHR flags = 0; // of the triangles' BLAS
    };

    static constexpr uint32_t kBoxRecord = 1;

    explicit PipelineScene(Gpu &gpu) : PipelineScene(gpu, Config{}) {}
    PipelineScene(Gpu &gpu, const Config &config) : config_(config)
    {
        const bool mapped = gpu.options().micromaps && config.micromaps;
        VkBuildAccelerationStructureFlagsKHR flags = config.flags;
        if (mapped)
            flags |= VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_DISABLE_OPACITY_MICROMAPS_EXT;
        MicromapInput input;
        Geometry withMicromap, plain;
        Attachment attachment;
        attachment.indexType = VK_INDEX_TYPE_UINT32;
        const auto addTriangle = [&](int32_t index, std::array<double, 2> at, int state) {
            const auto primitive = static_cast<uint32_t>(attachment.indices.size());
            const float x = 1.5f * static_cast<float>(primitive);
            appendTriangle(withMicromap.vertices, {x, 0, 0});
            attachment.indices.push_back(index);
            targets_.push_back({0,
                                primitive,
                                {x + static_cast<float>(at[0]), static_cast<float>(at[1])},
                                at,
                                mapped ? state : kNoMicromap});
        };
        for (const uint16_t format : {kTwoState, kFourState}) {
            const uint8_t states = format == kTwoState ? 2 : 4;
            for (uint8_t state = 0; state < states; ++state) {
                addTriangle(static_cast<int32_t>(input.add(0, format, std::array{state})), {0.3, 0.3}, state);
                // With other states in the same micromap, so that the lookup must read the data.
                std::vector<uint8_t> mixed(256);
                for (size_t i = 0; i < mixed.size(); ++i)
                    mixed[i] = static_cast<uint8_t>((i * 7 + i / 5 + state) % states);
                const uint32_t micro = 37u * (state + 1u);
                addTriangle(static_cast<int32_t>(input.add(4, format, mixed)), microTriangleCentre(micro, 4),
                            mixed[micro]);
            }
        }
        for (int32_t special = -1; special >= -4; --special)
            addTriangle(special, {0.25, 0.4}, -1 - special);
        appendTriangle(plain.vertices, {-3, 0, 0});
        targets_.push_back({1, 0, {-2.75f, 0.5f}, {0.25, 0.5}, kNoMicromap});

        if (mapped) {
            micromap_ = std::make_unique<Micromap>(gpu, std::move(input));
            micromap_->build();
            attachment.micromap = micromap_.get();
            withMicromap.micromap = attachment;
        }
        std::vector<VkAccelerationStructureInstanceKHR> instances;
        const auto place = [&](const Blas &blas, uint32_t instanceFlags, bool opaque, bool box) {
            const Vec3 at{0, 2.0f * static_cast<float>(instances.size()), 0};
            placed_.push_back({instanceFlags, opaque, box, at});
            instances.push_back(
                instance(blas, at, customIndex(static_cast<uint32_t>(instances.size())), instanceFlags));
            instances.back().instanceShaderBindingTableRecordOffset =
                (box ? config.boxRecord : config.triangleRecord) & 0xffffffu;
        };
        for (const bool opaque : {false, true}) {
            withMicromap.flags = plain.flags = opaque ? VK_GEOMETRY_OPAQUE_BIT_KHR : 0;
            blas_.push_back(std::make_unique<Blas>(gpu, std::vector{withMicromap, plain}, flags));
            for (const uint32_t force : {0u, 4u, 8u}) {
                for (const uint32_t twoState : {0u, kFlagTwoState}) {
                    for (const uint32_t disable : {0u, kFlagDisable}) {
                        if (mapped || (twoState | disable) == 0)
                            place(*blas_.back(), force | twoState | disable, opaque, false);
                    }
                }
            }
            Geometry boxes;
            boxes.flags = plain.flags;
            boxes.boxes = {{0, 0, -0.1f, 1, 1, 0.1f}, {2, 0, -0.1f, 3, 1, 0.1f}};
            blas_.push_back(std::make_unique<Blas>(gpu, std::vector{boxes}));
            for (const uint32_t force : {0u, 4u, 8u})
                place(*blas_.back(), force, opaque, true);
        }
        tlas_ = std::make_unique<Tlas>(gpu, instances);

        for (uint32_t i = 0; i < placed_.size(); ++i) {
            const Placed &p = placed_[i];
            const auto add = [&](Target target, uint32_t rule, float generate) {
                Ray ray;
                ray.origin = {target.at[0], target.at[1] + p.place[1], 1};
                ray.rule = rule;
                ray.generate = generate;
                aims_.push_back({i, target});
                rays_.push_back(ray);
            };
            if (p.box) {
                for (uint32_t primitive = 0; primitive < 2; ++primitive) {
                    const Target target{0, primitive, {0.5f + 2 * static_cast<float>(primitive), 0.5f}, {}, kBox};
                    for (const uint32_t rule : {kNever, kAlways}) {
                        add(target, rule, 0);
                        add(target, rule, 1);
                    }
                }
            } else {
                for (const Target &target : targets_) {
                    add(target, kNever, 0);
                    add(target, kAlways, 0);
                }
            }
        }
    }

    [[nodiscard]] const Tlas &tlas() const { return *tlas_; }
    [[nodiscard]] std::vector<Ray> rays(uint32_t flags) const
    {
        std::vector<Ray> rays = rays_;
        for (Ray &ray : rays)
            ray.flags = flags;
        return rays;
    }

    // Everything that the results of rays(flags) must be.
    void expect(std::span<const PipelineResult> results, uint32_t flags, const View &view) const
    {
        ASSERT_EQ(results.size(), aims_.size());
        int failures = 0;
        for (size_t i = 0; i < aims_.size(); ++i) {
            const std::string what = fault(i, results[i], flags, view);
            if (what.empty() || ++failures > 3)
                continue;
            const Placed &p = placed_[aims_[i].instance];
            ADD_FAILURE() << what << "\nstate " << aims_[i].target.state << (p.box ? ", box" : "") << ", geometry "
                          << aims_[i].target.geometry << (p.opaque ? " opaque" : "") << ", primitive "
                          << aims_[i].target.primitive << std::hex << ", instance flags 0x" << p.flags
                          << ", ray flags 0x" << flags << ", rule " << rays_[i].rule << ", generate "
                          << rays_[i].generate << std::dec << ": any-hit invocations " << results[i].candidateCount
                          << ", intersection " << results[i].visitCount << ", committed "
                          << static_cast<int>(results[i].committed) << std::hex << ", flags read 0x" << results[i].flags
                          << std::dec << ", custom index " << results[i].customIndex;
        }
        EXPECT_EQ(failures, 0) << "of " << results.size();
    }
    void expect(std::span<const PipelineResult> results, uint32_t flags) const { expect(results, flags, View{}); }
    // Traces and compares.
    void expect(PipelineTracer &tracer, uint32_t flags, const View &view) const
    {
        const std::vector<Ray> list = rays(view.runTimeFlags.value_or(flags));
        expect(tracer.trace(*tlas_, list, 4), flags, view);
    }
    void expect(PipelineTracer &tracer, uint32_t flags) const { expect(tracer, flags, View{}); }

private:
    struct Target {
        uint32_t geometry, primitive;
        std::array<float, 2> at; // in the BLAS
        std::array<double, 2> uv;
        int state;
    };
    struct Placed {
        uint32_t flags;
        bool opaque, box;
        Vec3 place;
    };
    struct Aim {
        uint32_t instance;
        Target target;
    };

    static uint32_t customIndex(uint32_t instance) { return (0xabcdefu - instance * 54321u) & 0xffffffu; }

    [[nodiscard]] std::string fault(size_t i, const PipelineResult &r, uint32_t flags, const View &view) const
    {
        const Aim &aim = aims_[i];
        const Placed &p = placed_[aim.instance];
        const Outcome outcome = outcomeOf(aim.target.state, p.opaque, p.flags, flags);
        bool met = outcome == Outcome::Opaque || outcome == Outcome::NonOpaque;
        if (p.box ? (flags & kRaySkipBoxes) != 0 || view.skipBoxes
                  : (flags & (kRaySkipTriangles | kRayCullFront)) != 0 || view.skipTriangles)
            met = false;
        const bool culled = p.box && outcome == Outcome::Culled && (flags & kRaySkipBoxes) == 0 && !view.skipBoxes;
        if (r.visitCount > 0 && !(p.box && met) && !(culled && !view.constantFlags && intersectionMayRunCulled(flags)))
            return "an intersection shader ran";
        if (p.box && met && r.visitCount == 0)
            return "no intersection shader ran";
        const bool reported = met && (!p.box || rays_[i].generate > 0);
        const bool anyHit = p.box ? view.boxAnyHit : view.triangleAnyHit;
        const bool closestHit = p.box ? view.boxClosestHit : view.triangleClosestHit;
        const bool isCandidate = reported && outcome == Outcome::NonOpaque && anyHit;
        const bool hit = reported && (!isCandidate || rays_[i].rule == kAlways);
        const float u = p.box ? static_cast<float>(aim.target.primitive) + 0.25f : static_cast<float>(aim.target.uv[0]);
        const float v = p.box ? static_cast<float>(aim.target.geometry) + 0.5f : static_cast<float>(aim.target.uv[1]);
        const uint32_t kind = p.box ? hitKindOfBox(aim.target.primitive, aim.target.geometry) : kHitKindFront;
        const uint32_t record =
            view.firstData + view.firstRecord + (p.box ? config_.boxRecord : config_.triangleRecord);
        const auto named = [&](const auto &x) {
            return x.customIndex == customIndex(aim.instance) && x.instance == aim.instance &&
                   x.geometry == aim.target.geometry && x.primitive == aim.target.primitive;
        };
        const auto placed = [&](const auto &x) {
            return std::abs(x.t - 1) < 1e-4f && std::abs(x.u - u) < 1e-4f && std::abs(x.v - v) < 1e-4f;
        };
        for (const BoxVisit &visit : r.visits) {
            if (!named(visit))
                return "the intersection shader's identity";
            if (!(view.constantFlags ? visit.flags == flags : intersectionMaySee(visit.flags, flags)) ||
                visit.record != record || visit.tMin != 0)
                return "what the intersection shader reads: flags " + std::to_string(visit.flags);
            const bool returns = hit && !(view.terminates && isCandidate);
            if (visit.reported != (rays_[i].generate > 0 ? returns ? 3u : 1u : 0u))
                return "reportIntersectionEXT gave " + std::to_string(visit.reported);
        }
        if ((r.candidateCount > 0) != isCandidate)
            return isCandidate ? "the any-hit shader did not run" : "the any-hit shader ran";
        for (size_t k = 0; k < r.candidates.size(); ++k) {
            if (!named(r.candidates[k]))
                return "the any-hit shader's identity";
            if (!placed(r.candidates[k]))
                return "the any-hit shader's place";
            if (r.notes[k].flags != flags || r.notes[k].hitKind != kind || r.notes[k].record != record ||
                r.notes[k].intact != 1)
                return "what the any-hit shader reads: flags " + std::to_string(r.notes[k].flags) + " hit kind " +
                       std::to_string(r.notes[k].hitKind) + " record " + std::to_string(r.notes[k].record);
        }
        if (!r.intact)
            return "payload changed";
        if (!hit) {
            if (!view.miss)
                return r.committed == kUnknownResult && r.invocations == 0 ? "" : "expected nothing";
            return r.committed == kNone && r.invocations == 1 && r.record == 50 && (r.flags == flags || !view.missFlags)
                       ? ""
                       : "expected the miss shader";
        }
        if (!closestHit || (flags & kRaySkipClosestHit) != 0)
            return r.committed == kUnknownResult && r.invocations == 0 ? ""
                                                                       : "expected a hit and no closest-hit shader";
        if (r.committed != (p.box ? kGenerated : kTriangle) || r.invocations != 1)
            return "expected the closest-hit shader";
        if (!named(r))
            return "the closest-hit shader's identity";
        if (!placed(r) || r.hitKind != kind)
            return "the closest-hit shader's place";
        if (r.flags != flags || r.record != record)
            return "what the closest-hit shader reads";
        return {};
    }

    Config config_;
    std::vector<Target> targets_;
    std::vector<Placed> placed_;
    std::vector<Aim> aims_;
    std::vector<Ray> rays_;
    std::unique_ptr<Micromap> micromap_;
    std::vector<std::unique_ptr<Blas>> blas_;
    std::unique_ptr<Tlas> tlas_;
};

// The ray flags that decide over opacity, and combinations with one other each.
inline std::vector<uint32_t> opacityRayFlags(bool micromaps = true)
{
    std::vector<uint32_t> flags;
    for (const uint32_t force : {0u, kRayForceTwoState}) {
        for (const uint32_t opacity : {0u, kRayOpaque, kRayNoOpaque, kRayCullOpaque, kRayCullNoOpaque}) {
            if (micromaps || force == 0)
                flags.push_back(force | opacity);
        }
    }
    return flags;
}

inline std::vector<uint32_t> allRayFlags(bool micromaps = true)
{
    std::vector<uint32_t> flags;
    for (const uint32_t other : {0u, kRayTerminateOnFirstHit, kRaySkipClosestHit, kRayCullBack, kRayCullFront,
                                 kRaySkipTriangles, kRaySkipBoxes, kRayTerminateOnFirstHit | kRaySkipClosestHit}) {
        for (const uint32_t opacity : opacityRayFlags(micromaps))
            flags.push_back(opacity | other);
    }
    return flags;
}

// A test with that scene.
class PipelineSceneTest : public PipelineTest
{
protected:
    explicit PipelineSceneTest(const Options &options = {}) : PipelineTest(options) {}
    void SetUp() override
    {
        PipelineTest::SetUp();
        if (!IsSkipped())
            scene_ = std::make_unique<PipelineScene>(gpu());
    }
    void TearDown() override
    {
        scene_.reset();
        PipelineTest::TearDown();
    }

    std::unique_ptr<PipelineScene> scene_;
};

} // namespace vt
