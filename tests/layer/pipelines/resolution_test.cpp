// SPDX-License-Identifier: Apache-2.0
// The whole resolution table through real ray queries: states x formats x levels x special indices x geometry flag x
// instance flags x ray flags, ray flags at run time, constant and specialized, compared with expected.h.
#include <random>

#include "check/oracle/outcome.h"
#include "harness/harness.h"

#include "harness/program/labels.h"
#include "shaders/tracer_constant_000.h"
#include "shaders/tracer_constant_001.h"
#include "shaders/tracer_constant_002.h"
#include "shaders/tracer_constant_040.h"
#include "shaders/tracer_constant_080.h"
#include "shaders/tracer_constant_400.h"
#include "shaders/tracer_constant_401.h"
#include "shaders/tracer_constant_402.h"
#include "shaders/tracer_constant_440.h"
#include "shaders/tracer_constant_480.h"
#include "shaders/tracer_specialized.h"

namespace
{

const vt::Labels kResolutionLabels{{"Resolution.*", "slow translated forcing"}, {"Resolution.Constant*", "constants"}};

using namespace vt;

constexpr uint32_t kMaxLevel = 12;
constexpr uint32_t kSamples = 20; // micro-triangles tried at the levels with too many
constexpr std::array<uint32_t, 10> kRayFlags{0,     kRayOpaque, kRayNoOpaque, kRayCullOpaque, kRayCullNoOpaque,
                                             0x400, 0x401,      0x402,        0x440,          0x480};

struct Target { // a place on a triangle of the BLAS, and what is there
    uint32_t geometry, primitive;
    std::array<double, 2> at; // in the BLAS
    int state;
    std::string what;
};

struct Placed {
    uint32_t flags;
    bool geometryOpaque;
    Vec3 place;
};

class Resolution : public GpuTest
{
protected:
    Resolution() : GpuTest({.shared = true}) {}

    void SetUp() override
    {
        std::mt19937 random(20260519);
        MicromapInput input;
        Geometry mapped;
        Attachment attachment;
        attachment.indexType = VK_INDEX_TYPE_UINT32;
        uint32_t column = 0;
        const auto origin = [&column] { return 1.5f * static_cast<float>(column); };
        for (const uint16_t format : {kTwoState, kFourState}) {
            for (uint32_t level = 0; level <= kMaxLevel; ++level, ++column) {
                const uint32_t count = 1u << (2 * level);
                // One random number for 16 states. Below level 2, triangles that are added further down cover every
                // state.
                std::vector<uint8_t> states(count);
                for (uint32_t i = 0; i < count; i += 16) {
                    const uint32_t bits = static_cast<uint32_t>(random());
                    for (uint32_t k = 0; k < std::min(16u, count - i); ++k)
                        states[i + k] = static_cast<uint8_t>(bits >> (2 * k) & (format == kTwoState ? 1u : 3u));
                }
                addTriangle(mapped, origin());
                attachment.indices.push_back(static_cast<int32_t>(input.add(level, format, states)));
                for (uint32_t n = 0; n < (level <= 3 ? count : kSamples); ++n) {
                    const uint32_t i = level <= 3 ? n : static_cast<uint32_t>(random() % count);
                    addTarget(0, column, microTriangleCentre(i, level), origin(), states[i],
                              "level " + std::to_string(level) + " format " + std::to_string(format) +
                                  " micro-triangle " + std::to_string(i));
                }
            }
        }
        for (const uint16_t format : {kTwoState, kFourState}) {
            for (uint8_t state = 0; state < (format == kTwoState ? 2 : 4); ++state, ++column) {
                const std::array<uint8_t, 1> one{state};
                addTriangle(mapped, origin());
                attachment.indices.push_back(static_cast<int32_t>(input.add(0, format, one)));
                addTarget(0, column, {0.3, 0.3}, origin(), state, "level 0");
            }
        }
        for (int32_t special = -1; special >= -4; --special, ++column) {
            addTriangle(mapped, origin());
            attachment.indices.push_back(special);
            addTarget(0, column, {0.3, 0.3}, origin(), -1 - special, "special index " + std::to_string(special));
        }
        Geometry plain;
        addTriangle(plain, origin());
        addTarget(1, 0, {0.3, 0.3}, origin(), kNoMicromap, "no micromap");

        micromap_ = std::make_unique<Micromap>(gpu(), std::move(input));
        micromap_->build();
        attachment.micromap = micromap_.get();
        mapped.micromap = attachment;

        std::vector<VkAccelerationStructureInstanceKHR> instances;
        for (const bool opaque : {false, true}) {
            mapped.flags = plain.flags = opaque ? VK_GEOMETRY_OPAQUE_BIT_KHR : 0;
            blas_.push_back(
                std::make_unique<Blas>(gpu(), std::vector{mapped, plain},
                                       VkBuildAccelerationStructureFlagsKHR{
                                           VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_DISABLE_OPACITY_MICROMAPS_EXT}));
            for (const uint32_t force : {0u, 4u, 8u}) {
                for (const uint32_t twoState : {0u, kFlagTwoState}) {
                    for (const uint32_t disable : {0u, kFlagDisable}) {
                        const Vec3 place{0, 2.0f * static_cast<float>(instances.size()), 0};
                        const uint32_t flags = force | twoState | disable;
                        placed_.push_back({flags, opaque, place});
                        instances.push_back(
                            instance(*blas_.back(), place, static_cast<uint32_t>(instances.size()) * 12345, flags));
                    }
                }
            }
        }
        tlas_ = std::make_unique<Tlas>(gpu(), instances);
        rays_.reserve(placed_.size() * targets_.size());
        for (const Placed &p : placed_) {
            for (const Target &t : targets_) {
                Ray ray;
                ray.origin = {static_cast<float>(t.at[0]), static_cast<float>(t.at[1] + double{p.place[1]}), 1};
                ray.rule = rays_.size() % 3 == 0 ? kNever : kAlways;
                rays_.push_back(ray);
            }
        }
    }

    void expect(std::span<const Result> results, uint32_t rayFlags)
    {
        size_t next = 0;
        int failures = 0;
        for (uint32_t i = 0; i < placed_.size(); ++i) {
            for (const Target &t : targets_) {
                const Result &r = results[next];
                const bool confirms = rays_[next++].rule == kAlways;
                const Outcome outcome = outcomeOf(t.state, placed_[i].geometryOpaque, placed_[i].flags, rayFlags);
                const bool isCandidate = outcome == Outcome::NonOpaque;
                const bool hit = outcome == Outcome::Opaque || (isCandidate && confirms);
                bool right = r.candidateCount == (isCandidate ? 1u : 0u) && r.committed == (hit ? kTriangle : kNone) &&
                             r.flags == rayFlags;
                if (isCandidate && right)
                    right = r.candidates[0].customIndex == i * 12345 && r.candidates[0].instance == i &&
                            r.candidates[0].geometry == t.geometry && r.candidates[0].primitive == t.primitive &&
                            !r.candidates[0].box();
                if (hit && right)
                    right = r.customIndex == i * 12345 && r.instance == i && r.geometry == t.geometry &&
                            r.primitive == t.primitive && std::abs(r.t - 1) < 1e-5f;
                if (!right && ++failures < 10)
                    ADD_FAILURE() << t.what << ", state " << t.state << ", geometry "
                                  << (placed_[i].geometryOpaque ? "opaque" : "not opaque") << ", instance flags 0x"
                                  << std::hex << placed_[i].flags << ", ray flags 0x" << rayFlags << std::dec
                                  << ": expected " << (isCandidate ? "a candidate, " : "") << (hit ? "hit" : "no hit")
                                  << "; got " << r.candidateCount << " candidates, committed " << r.committed
                                  << ", flags " << r.flags << ", custom index " << r.customIndex << ", primitive "
                                  << r.primitive;
            }
        }
        EXPECT_EQ(failures, 0) << "of " << next;
    }

    std::vector<Ray> rays_;
    std::unique_ptr<Tlas> tlas_;

private:
    static void addTriangle(Geometry &geometry, float x) { appendTriangle(geometry.vertices, {x, 0, 0}); }
    void addTarget(uint32_t geometry, uint32_t primitive, std::array<double, 2> uv, float x, int state,
                   std::string what)
    {
        targets_.push_back({geometry, primitive, {double{x} + uv[0], uv[1]}, state, std::move(what)});
    }

    std::vector<Target> targets_;
    std::vector<Placed> placed_;
    std::unique_ptr<Micromap> micromap_;
    std::vector<std::unique_ptr<Blas>> blas_;
};

TEST_F(Resolution, RayFlagsAtRunTime)
{
    Tracer tracer(gpu());
    for (const uint32_t flags : kRayFlags) {
        for (Ray &ray : rays_)
            ray.flags = flags;
        expect(tracer.trace(*tlas_, rays_, 2), flags);
    }
}

TEST_F(Resolution, ConstantRayFlags)
{
    const std::array<std::span<const uint32_t>, kRayFlags.size()> variants{
        tracer_constant_000, tracer_constant_001, tracer_constant_002, tracer_constant_040, tracer_constant_080,
        tracer_constant_400, tracer_constant_401, tracer_constant_402, tracer_constant_440, tracer_constant_480};
    for (size_t i = 0; i < kRayFlags.size(); ++i) {
        Tracer tracer(gpu(), variants[i]);
        expect(tracer.trace(*tlas_, rays_, 2), kRayFlags[i]);
    }
}

TEST_F(Resolution, SpecializedRayFlags)
{
    for (const uint32_t flags : kRayFlags) {
        Tracer tracer(gpu(), tracer_specialized, {.specializedFlags = flags});
        expect(tracer.trace(*tlas_, rays_, 2), flags);
    }
}

} // namespace
