// SPDX-License-Identifier: Apache-2.0
// Faults of shaders.cpp, commands.cpp, state.cpp and process.cpp.
#include "faulty_driver/cases/cases.h"

#include "gpu/execution_mode.h"
#include "gpu/programs/pipeline_libraries.h"
#include "shaders/tracer_comp.h"

namespace faults
{
namespace
{

using namespace vt;

std::string rays(Gpu &gpu, uint32_t flags)
{
    const auto micromap = built(gpu, uniform({0, 1, 2, 3}));
    const RowScene scene(gpu, micromap.get(), 4);
    return hitsOf(gpu, scene.tlas(), 4, flags);
}

std::string twoStateRays(Gpu &gpu)
{
    return rays(gpu, kRayForceTwoState);
}

std::string cullOpaqueRays(Gpu &gpu)
{
    return rays(gpu, kRayCullOpaque);
}

std::string terminatingRays(Gpu &gpu)
{
    return rays(gpu, kRayForceTwoState | kRayTerminateOnFirstHit);
}

std::string specializedMode(Gpu &gpu)
{
    const auto micromap = built(gpu, uniform({1}));
    const RowScene scene(gpu, micromap.get(), 1);
    const Ray ray{.origin = {0.3f, 0.3f, 1}};
    Tracer tracer(gpu, withMode(tracer_comp, Mode::Specialized), {.inlineModule = true});
    return tracer.trace(scene.tlas(), std::span(&ray, 1))[0].committed == kTriangle ? "micromap" : "no micromap";
}

std::string nullRecord(Gpu &gpu)
{
    const auto micromap = built(gpu, uniform({3}));
    const RowScene scene(gpu, micromap.get(), 1);
    const Ray ray{.origin = {0.3f, 0.3f, 1}};
    PipelineTracer tracer(gpu, {.records = {0, std::nullopt}});
    return std::to_string(tracer.trace(scene.tlas(), std::span(&ray, 1))[0].candidateCount) + " any-hit";
}

std::string otherQueue(Gpu &gpu)
{
    const uint32_t family = gpu.family() + 1;
    auto poolInfo = vkInit<VkCommandPoolCreateInfo>({.queueFamilyIndex = family});
    VkCommandPool pool = VK_NULL_HANDLE;
    VT_CHECK(vkCreateCommandPool(gpu.device(), &poolInfo, nullptr, &pool));
    auto allocation = vkInit<VkCommandBufferAllocateInfo>({.commandPool = pool, .commandBufferCount = 1});
    VkCommandBuffer commands = VK_NULL_HANDLE;
    VT_CHECK(vkAllocateCommandBuffers(gpu.device(), &allocation, &commands));
    const auto first = built(gpu, uniform({0})), other = built(gpu, uniform({1}));
    auto begin = vkInit<VkCommandBufferBeginInfo>();
    VT_CHECK(vkBeginCommandBuffer(commands, &begin));
    recordMicromapBuilds(gpu, commands, std::array{MicromapBuild{other->buildInfo(), first->handle()}});
    VT_CHECK(vkEndCommandBuffer(commands));
    auto submission = vkInit<VkSubmitInfo>({.commandBufferCount = 1, .pCommandBuffers = &commands});
    VT_CHECK(vkQueueSubmit(gpu.queueOf(family), 1, &submission, VK_NULL_HANDLE));
    VT_CHECK(vkQueueWaitIdle(gpu.queueOf(family)));
    vkDestroyCommandPool(gpu.device(), pool, nullptr);
    return statesOfMicromap(gpu, *first);
}

std::string indirect(Gpu &gpu)
{
    const auto micromap = built(gpu, uniform({1, 1}));
    Geometry geometry{.vertices = triangleRow(2)};
    geometry.micromap = Attachment{micromap.get()};
    Blas blas(gpu);
    blas.prepare({geometry});
    const VkAccelerationStructureBuildRangeInfoKHR range{1, 0, 0, 0};
    const Buffer buffer = gpu.upload(std::span(&range, 1), VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT);
    const VkDeviceAddress address = buffer.address();
    const uint32_t stride = sizeof range, most = 2;
    const uint32_t *counts = &most;
    gpu.submit([&](VkCommandBuffer commands) {
        gpu.vk().CmdBuildAccelerationStructuresIndirectKHR(commands, 1, &blas.buildInfo(), &address, &stride, &counts);
    });
    return hitsOf(gpu, Tlas(gpu, {instance(blas, {}, 1)}), 2, 0);
}

std::string tracedAfterBuild(Gpu &gpu)
{
    const auto micromap = built(gpu, uniform({1}));
    const RowScene scene(gpu, micromap.get(), 1);
    const Ray ray{.origin = {0.3f, 0.3f, 1}};
    Tracer tracer(gpu);
    tracer.prepare(scene.tlas(), std::span(&ray, 1));
    tracer.clearResults();
    Blas other(gpu);
    other.prepare({Geometry{.vertices = triangleRow(1)}});
    gpu.submit([&](VkCommandBuffer commands) {
        tracer.bind(commands);
        other.record(commands);
        tracer.dispatch(commands);
        barrier(commands);
    });
    return tracer.results()[0].committed == kTriangle ? "traced" : "not traced";
}

std::string builtUnderPredicate(Gpu &gpu)
{
    const auto first = built(gpu, uniform({0})), other = built(gpu, uniform({1}));
    const Buffer predicate(gpu, 4, VK_BUFFER_USAGE_CONDITIONAL_RENDERING_BIT_EXT);
    const auto begin = vkInit<VkConditionalRenderingBeginInfoEXT>({.buffer = predicate.handle()});
    gpu.submit([&](VkCommandBuffer commands) {
        gpu.vk().CmdBeginConditionalRenderingEXT(commands, &begin);
        recordMicromapBuilds(gpu, commands, std::array{MicromapBuild{other->buildInfo(), first->handle()}});
        gpu.vk().CmdEndConditionalRenderingEXT(commands);
    });
    return statesOfMicromap(gpu, *first);
}

std::string tracedIndirectly(Gpu &gpu)
{
    const auto micromap = built(gpu, uniform({1}));
    const RowScene scene(gpu, micromap.get(), 1);
    const Ray ray{.origin = {0.3f, 0.3f, 1}};
    PipelineTracer tracer(gpu, {.records = {0, 0}, .sbtOffset = 1});
    tracer.setTable({.hit = {0, 0}, .layout = {.hitPadding = 1}});
    tracer.setLaunch({.command = Launch::Indirect2});
    return "record " + std::to_string(tracer.trace(scene.tlas(), std::span(&ray, 1))[0].record);
}

std::string recordOf(const PipelineResult &result)
{
    return "record " + std::to_string(result.record);
}

std::string tracedWithPadding(Gpu &gpu)
{
    const auto micromap = built(gpu, uniform({1}));
    const RowScene scene(gpu, micromap.get(), 1);
    const Ray ray{.origin = {0.3f, 0.3f, 1}};
    PipelineTracer tracer(gpu, {.records = {0, 0}, .sbtOffset = 1});
    tracer.setTable({.hit = {0, 0}, .layout = {.hitPadding = 1}});
    return recordOf(tracer.trace(scene.tlas(), std::span(&ray, 1))[0]);
}

std::string tracedWithTwoTables(Gpu &gpu)
{
    const auto micromap = built(gpu, uniform({1}));
    const RowScene scene(gpu, micromap.get(), 1);
    const Ray ray{.origin = {0.3f, 0.3f, 1}};
    PipelineTracer tracer(gpu), other(tracer, {});
    other.setTable({.hit = {0, 1}, .data = 1000});
    for (PipelineTracer *const each : {&tracer, &other})
        each->prepare(scene.tlas(), std::span(&ray, 1));
    gpu.submit([&](VkCommandBuffer commands) {
        barrier(commands);
        for (PipelineTracer *const each : {&tracer, &other}) {
            each->bind(commands);
            each->dispatch(commands);
        }
        barrier(commands);
    });
    return recordOf(tracer.results()[0]) + ", " + recordOf(other.results()[0]);
}

std::string tracedByLibraryStage(Gpu &gpu)
{
    const auto micromap = built(gpu, uniform({1}));
    const RowScene scene(gpu, micromap.get(), 1);
    const Ray ray{.origin = {0.3f, 0.3f, 1}};
    const std::vector<PipelinePart> parts{{{2}, {}}, {{0, 1, 3, 4}, {0, 1, 2, 3}, {0}}};
    PipelineTracer tracer(
        gpu, {.make = [&](Device &device, const PipelineSetup &setup) { return linked(device, setup, parts); }});
    return recordOf(tracer.trace(scene.tlas(), std::span(&ray, 1))[0]);
}

std::string copiedDeferred(Gpu &gpu)
{
    const auto first = built(gpu, uniform({0})), other = built(gpu, uniform({1}));
    HostCommands(gpu, true).copy(other->handle().ext, first->handle().ext, VK_COPY_MICROMAP_MODE_CLONE_EXT);
    return statesOfMicromap(gpu, *first);
}

std::string unknownVersion(Gpu &gpu)
{
    const std::array<uint8_t, 2 * VK_UUID_SIZE> version{};
    return micromapIsCompatible(gpu, version.data()) ? "compatible" : "incompatible";
}

// The results of submissions, of which the first 20 are allowed.
std::string submissions(Gpu &gpu)
{
    const Buffer buffer(gpu, 4, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    std::string results;
    for (uint32_t i = 1; i <= 22; ++i) {
        VkCommandBuffer commands = gpu.begin();
        vkCmdFillBuffer(commands, buffer.handle(), 0, 4, i);
        gpu.end(commands);
        auto submission = vkInit<VkSubmitInfo>({.commandBufferCount = 1, .pCommandBuffers = &commands});
        const VkResult result = vkQueueSubmit(gpu.queue(), 1, &submission, VK_NULL_HANDLE);
        vkQueueWaitIdle(gpu.queue());
        if (i >= 20)
            results += std::to_string(buffer.as<uint32_t>()[0]) + (result == VK_SUCCESS ? "; " : " lost; ");
        vkFreeCommandBuffers(gpu.device(), gpu.pool(), 1, &commands);
    }
    return results;
}

} // namespace

std::span<const Case> commandCases()
{
    static const std::array cases{
        Case{"mode-constant-true", specializedMode, "no micromap", "micromap", Api::Khr},
        Case{"ray-2-state-ignored", twoStateRays, ".O.O", ".Onn"},
        Case{"cull-opaque-ignored", cullOpaqueRays, "..nn", ".Onn"},
        Case{"terminating-rays-ignore-2-state", terminatingRays, ".O.O", ".Onn"},
        Case{"null-record-skips-any-hit", nullRecord, "1 any-hit", "0 any-hit"},
        Case{"hit-stride-of-misses", tracedWithPadding, "record 101", "record 4294967295"},
        Case{"record-data-lost", tracedWithPadding, "record 101", "record 0"},
        Case{"first-hit-table-stays", tracedWithTwoTables, "record 100, record 1100", "record 100, record 100"},
        Case{"library-stages-unused", tracedByLibraryStage, "record 100", "record 4294967295"},
        Case{"second-queue-loses-micromaps", otherQueue, "1", "0", {}, "queues"},
        Case{"indirect-build-with-host-counts", indirect, "O.", "OO", {}, "capable"},
        Case{"build-clears-push-constants", tracedAfterBuild, "traced", "not traced"},
        Case{"build-under-predicate", builtUnderPredicate, "1", "0"},
        Case{"indirect-trace-hit-stride", tracedIndirectly, "record 101", "record 100"},
        Case{"deferred-copies-forgotten", copiedDeferred, "1", "0", Api::Ext},
        Case{"every-version-accepted", unknownVersion, "incompatible", "compatible"},
        Case{"loses-device", submissions, "20; 21; 22; ", "20; 20 lost; 20 lost; "},
        Case{"does-nothing", submissions, "20; 21; 22; ", "20; 20; 20; "},
    };
    return cases;
}

} // namespace faults
