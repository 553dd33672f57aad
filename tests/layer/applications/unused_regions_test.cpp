// SPDX-License-Identifier: Apache-2.0
// Regions of shader binding tables that no ray reads: programs leave them empty, pass an address without a size, or
// pass one table for all of them.
#include <array>
#include <functional>
#include <string>

#include <gtest/gtest.h>

#include "gpu/pipeline_tracer.h"
#include "gpu/scene.h"
#include "harness/harness.h"

using namespace vt;

namespace
{

struct Regions {
    VkStridedDeviceAddressRegionKHR raygen, miss, hit, callable;
};

struct Case {
    const char *name;
    std::function<void(Regions &)> change;
};

const Case kCases[]{
    {"no miss region", [](Regions &r) { r.miss = {}; }},
    {"a miss region of no size", [](Regions &r) { r.miss.size = 0; }},
    {"no miss region but a stride",
     [](Regions &r) {
         r.miss = {0, r.miss.stride, 0};
     }},
    {"a callable region of no size",
     [](Regions &r) {
         r.callable = {r.miss.deviceAddress, r.miss.stride, 0};
     }},
    {"the miss region for callable shaders", [](Regions &r) { r.callable = r.miss; }},
    {"the hit region for all", [](Regions &r) { r.miss = r.callable = r.hit; }},
    {"a hit region without a stride", [](Regions &r) { r.hit.stride = 0; }},
};

class UnusedRegions : public PipelineTest
{
protected:
    UnusedRegions() : PipelineTest({.validation = false, .maintenance = true}) {}
};

TEST_F(UnusedRegions, AreNotRead)
{
    // One micro-triangle of each state. Behind it is a triangle without a micromap, which every ray reaches.
    MicromapInput input;
    for (uint8_t state = 0; state < 4; ++state)
        input.add(0, kFourState, std::vector<uint8_t>{state});
    Micromap micromap(gpu(), std::move(input));
    micromap.build();
    Geometry front{.vertices = triangleRow(4)};
    front.micromap = Attachment{&micromap};
    Geometry behind{.vertices = triangleRow(4, {0, 0, -1})};
    behind.flags = VK_GEOMETRY_OPAQUE_BIT_KHR;
    const Blas first(gpu(), {front}), second(gpu(), {behind});
    const Tlas tlas(gpu(), {instance(first, {}, 1), instance(second, {}, 2)});
    std::vector<Ray> rays(4);
    for (size_t i = 0; i < rays.size(); ++i) {
        rays[i].origin = {1.5f * static_cast<float>(i) + 0.3f, 0.3f, 1};
        rays[i].rule = i == 2 ? kNever : kAlways;
    }
    PipelineTracer tracer(gpu(), {.groups = {{}}});
    const auto expectRight = [&] {
        const std::vector<PipelineResult> results = tracer.results();
        for (size_t i = 0; i < results.size(); ++i) {
            EXPECT_EQ(results[i].committed, kTriangle) << i;
            EXPECT_EQ(results[i].customIndex, i == 0 || i == 2 ? 2u : 1u) << i; // ignored: the one behind
            EXPECT_EQ(results[i].candidateCount, i < 2 ? 0u : 1u) << i;
        }
    };
    const auto command =
        reinterpret_cast<PFN_vkCmdTraceRaysKHR>(vkGetDeviceProcAddr(gpu().device(), "vkCmdTraceRaysKHR"));
    const auto indirect = reinterpret_cast<PFN_vkCmdTraceRaysIndirectKHR>(
        vkGetDeviceProcAddr(gpu().device(), "vkCmdTraceRaysIndirectKHR"));
    const std::array size{static_cast<uint32_t>(rays.size()), 1u, 1u};
    const Buffer arguments = gpu().upload(std::span<const uint32_t>(size), VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT);
    for (const Case &test : kCases) {
        for (const bool fromBuffer : {false, true}) {
            SCOPED_TRACE(std::string(test.name) + (fromBuffer ? ", indirect" : ""));
            const BindingTable &table = tracer.table();
            Regions regions{table.raygen, table.miss, table.hit, table.callable};
            test.change(regions);
            tracer.prepare(tlas, rays);
            gpu().submit([&](VkCommandBuffer commands) {
                barrier(commands);
                tracer.bind(commands);
                if (fromBuffer)
                    indirect(commands, &regions.raygen, &regions.miss, &regions.hit, &regions.callable,
                             arguments.address());
                else
                    command(commands, &regions.raygen, &regions.miss, &regions.hit, &regions.callable, size[0], 1, 1);
                barrier(commands);
            });
            expectRight();
        }
    }
}

} // namespace
