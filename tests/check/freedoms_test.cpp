// SPDX-License-Identifier: Apache-2.0
// What the specification leaves to a driver is no failure, and calls keep to valid usage that lavapipe does not need.
#include "check/case/case.h"
#include "check/case/trace_pipelines.h"
#include "check/groups/random_case.h"
#include "check/oracle/pipeline_fault.h"
#include "check/oracle/query_fault.h"
#include "random_case.h"

#include <algorithm>
#include <gtest/gtest.h>
#include <limits>
#include <utility>

namespace
{

using namespace vellum::check;

// One triangle in one instance, and a ray that meets its middle, and confirms nothing.
oracle::Scene oneTriangle(bool opaque)
{
    oracle::Scene scene;
    scene.objects.resize(1);
    oracle::Mesh &mesh = scene.objects[0].meshes.emplace_back();
    mesh.opaque = opaque;
    appendTriangle(mesh.vertices, {});
    oracle::Instance &instance = scene.instances.emplace_back();
    for (size_t i = 0; i < 3; ++i)
        instance.transform.matrix[i][i] = 1;
    scene.rays.push_back({.origin = {0.25f, 0.25f, 3}});
    return scene;
}

// The candidate of its ray.
Candidate candidateOf(const oracle::Hit &hit)
{
    return {.customIndex = hit.customIndex,
            .instance = hit.instance,
            .geometry = hit.geometry,
            .primitive = hit.primitive,
            .bits = (hit.frontFace ? 4u : 0u) | hit.record << 8,
            .t = static_cast<float>(hit.t),
            .u = static_cast<float>(hit.u),
            .v = static_cast<float>(hit.v)};
}

TEST(Freedoms, CandidatesComeAnyNumberOfTimes)
{
    const oracle::Scene scene = oneTriangle(false);
    const Ray &ray = scene.rays[0];
    const oracle::Hits hits = oracle::allHits(scene, ray);
    ASSERT_FALSE(hits.unsure);
    ASSERT_EQ(hits.hits.size(), 1u);
    const Candidate candidate = candidateOf(hits.hits[0]);
    for (const uint32_t times : {0u, 1u, 2u, oracle::kCapacity, oracle::kCapacity + 1, 1000u}) {
        Result result{};
        result.candidateCount = times;
        result.flags = ray.flags;
        result.tMin = ray.tMin;
        result.candidates.assign(std::min(times, oracle::kCapacity), candidate);
        EXPECT_EQ(oracle::queryFault(scene, ray, hits.hits, result) == "", times > 0) << times;
        if (times > 0) {
            result.candidates.back().u += 0.5f; // elsewhere
            EXPECT_NE(oracle::queryFault(scene, ray, hits.hits, result), "") << times;
        }
    }
}

TEST(Freedoms, ShadersRunAnyNumberOfTimes)
{
    const oracle::Scene scene = oneTriangle(false);
    const Ray &ray = scene.rays[0];
    const oracle::Hits hits = oracle::allHits(scene, ray);
    PipelineResult result{};
    result.flags = ray.flags;
    result.intact = true;
    result.invocations = 1;
    result.record = 50;
    const auto fault = [&] { return oracle::pipelineFault(scene, ray, hits.hits, result, {}); };
    EXPECT_NE(fault(), "") << "no candidate";
    result.candidateCount = oracle::kCapacity + 1;
    EXPECT_EQ(fault(), "");
    result.candidateCount = 0;
    result.visitCount = oracle::kCapacity + 1;
    EXPECT_EQ(fault(), "");
    result.visitCount = kDecoyVisit;
    EXPECT_NE(fault(), "");
}

// A candidate that ends the ray may be behind an opaque hit that was found before.
TEST(Freedoms, RaysEndAtCandidatesBehindOpaqueHits)
{
    oracle::Scene scene = oneTriangle(false);
    scene.objects[0].meshes.push_back(oneTriangle(true).objects[0].meshes[0]);
    for (Vec3 &vertex : scene.objects[0].meshes[1].vertices)
        vertex[2] = 1; // opaque, and nearer
    Ray &ray = scene.rays[0];
    ray.rule = kTerminate;
    const oracle::Hits hits = oracle::allHits(scene, ray);
    ASSERT_EQ(hits.hits.size(), 2u);
    Candidate end = candidateOf(hits.hits[0]);
    end.bits |= 8;
    const Candidate other = candidateOf(hits.hits[1]);
    for (const Candidate &committed : {end, other}) {
        PipelineResult result{};
        result.flags = ray.flags;
        result.committed = kTriangle;
        result.geometry = committed.geometry;
        result.t = committed.t;
        result.u = committed.u;
        result.v = committed.v;
        result.frontFace = committed.frontFace() ? 1 : 0;
        result.candidateCount = 1;
        result.candidates = {end};
        EXPECT_EQ(oracle::queryFault(scene, ray, hits.hits, result), "") << committed.geometry;
        result.intact = true;
        result.invocations = 1;
        result.hitKind = committed.frontFace() ? kHitKindFront : kHitKindBack;
        result.record = 100 + committed.geometry;
        result.notes = {{.flags = ray.flags, .hitKind = result.hitKind, .record = 100, .intact = 1}};
        const oracle::TracedBy by{.table = {.records = {oracle::HitRecord::Full}}};
        EXPECT_EQ(oracle::pipelineFault(scene, ray, hits.hits, result, {}, by), "") << committed.geometry;
        result.t -= 0.5f;
        EXPECT_NE(oracle::queryFault(scene, ray, hits.hits, result), "") << committed.geometry;
        EXPECT_NE(oracle::pipelineFault(scene, ray, hits.hits, result, {}, by), "") << committed.geometry;
    }
}

// Distances along a ray with a short direction that grazes a triangle are mostly rounding.
TEST(Freedoms, DistancesOfShortDirectionsAreUnsure)
{
    oracle::Scene scene = oneTriangle(false);
    Ray &ray = scene.rays[0];
    for (const float length : {1.0f, 0.1f}) {
        ray.direction = {length, 0, -0.03f * length};
        ray.origin = {0.25f - 3 * ray.direction[0], 0.25f, -3 * ray.direction[2]};
        EXPECT_EQ(oracle::allHits(scene, ray).unsure, length < 1) << length;
    }
}

TEST(Freedoms, SerializedTopLevelsMayLackWhatNoRayMeets)
{
    constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
    oracle::Scene scene = oneTriangle(false);
    oracle::Instance &instance = scene.instances[0];
    std::vector<Vec3> &vertices = scene.objects[0].meshes[0].vertices;
    const auto met = [&] { return oracle::canBeMet(scene, instance); };
    EXPECT_TRUE(met());
    instance.mask = 0;
    EXPECT_FALSE(met());
    instance.mask = 1;
    instance.inactive = true;
    EXPECT_FALSE(met());
    instance.inactive = false;
    const Vec3 before = std::exchange(vertices[1], vertices[0]);
    EXPECT_FALSE(met());
    vertices[1] = {kNan, before[1], before[2]};
    EXPECT_FALSE(met());
    vertices.clear();
    EXPECT_FALSE(met());
    scene.objects[0].meshes[0].boxes = {{kNan, 0, 0, 1, 1, 1}, {0, 0, 0, 0, 0, 0}};
    EXPECT_FALSE(met());
    scene.objects[0].meshes[0].boxes.push_back({0, 0, 0, 1, 1, 1});
    EXPECT_TRUE(met());
}

// VUID-vkCmdBuildAccelerationStructuresKHR-indexBuffer-11577
TEST(ValidUsage, IndicesOfMicromapsHaveTheirWholeStride)
{
    for (const VkIndexType type : {VK_INDEX_TYPE_UINT8_EXT, VK_INDEX_TYPE_UINT16, VK_INDEX_TYPE_UINT32})
        for (const uint32_t stride : {0u, 4u, 20u})
            for (const uint32_t offset : {0u, 8u})
                EXPECT_GE(packIndices({.indexType = type, .indices = {1, 2, 3}, .indexOffset = offset}, stride).size(),
                          offset + size_t{3} * stride);
    EXPECT_GE(packIndices({.indexType = VK_INDEX_TYPE_UINT16, .indices = {1}}, 0).size(), 2u);
    EXPECT_GE(packIndices({.indexType = VK_INDEX_TYPE_UINT32}, 4).size(), 4u);
}

// "Ray Primitive Culling"
TEST(ValidUsage, RaysSkipNothingWhereDevicesCannot)
{
    uint32_t changed = 0;
    for (uint32_t seed = 0; seed < 40; ++seed) {
        Case c = randomCase(seed, 40);
        const auto skips = [&] {
            return std::ranges::any_of(
                c.scene.rays, [](const Ray &ray) { return (ray.flags & (kRaySkipTriangles | kRaySkipBoxes)) != 0; });
        };
        const bool before = skips();
        ASSERT_EQ(invalid(c), "");
        skipNothing(c);
        EXPECT_EQ(invalid(c), "");
        changed += before && !skips() ? 1u : 0u;
    }
    EXPECT_GT(changed, 20u);
}

TEST(ValidUsage, ModulesDeclareThatRaysSkipPrimitives)
{
    const std::vector<uint32_t> words = withPrimitiveCulling(queryModule(VK_SHADER_STAGE_COMPUTE_BIT, false, false));
    ASSERT_GT(words.size(), 7u);
    EXPECT_EQ(words[5], 2u << 16 | 17u);
    EXPECT_EQ(words[6], 4478u);
}

} // namespace
