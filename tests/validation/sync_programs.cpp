// SPDX-License-Identifier: Apache-2.0
// Programs without the synchronization that they need.
#include "programs.h"

#include <cstring>

#include "gpu/copies.h"

namespace vt
{
namespace
{

using Record = std::function<void(VkCommandBuffer)>;

MicromapInput oneTriangle()
{
    MicromapInput input;
    input.add(2, kFourState, std::vector<uint8_t>(16, 1));
    return input;
}

std::vector<Geometry> leaves(const Micromap &micromap)
{
    Geometry geometry;
    appendTriangle(geometry.vertices, {});
    geometry.micromap = Attachment{.micromap = &micromap};
    return {geometry};
}

VkPipelineStageFlags2 micromapStage(const Gpu &gpu)
{
    return gpu.khr() ? VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR
                     : VK_PIPELINE_STAGE_2_MICROMAP_BUILD_BIT_EXT;
}
VkAccessFlags2 micromapRead(const Gpu &gpu)
{
    return gpu.khr() ? VK_ACCESS_2_ACCELERATION_STRUCTURE_READ_BIT_KHR : VK_ACCESS_2_MICROMAP_READ_BIT_EXT;
}
VkAccessFlags2 micromapWrite(const Gpu &gpu)
{
    return gpu.khr() ? VK_ACCESS_2_ACCELERATION_STRUCTURE_WRITE_BIT_KHR : VK_ACCESS_2_MICROMAP_WRITE_BIT_EXT;
}

// A barrier from the build of a micromap to that of a structure.
VkMemoryBarrier2 exactBarrier(const Gpu &gpu)
{
    return vkInit<VkMemoryBarrier2>({.srcStageMask = micromapStage(gpu),
                                     .srcAccessMask = micromapWrite(gpu),
                                     .dstStageMask = VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
                                     .dstAccessMask = micromapRead(gpu)});
}

VkDependencyInfo dependencyOf(const VkMemoryBarrier2 &barrier)
{
    return vkInit<VkDependencyInfo>({.memoryBarrierCount = 1, .pMemoryBarriers = &barrier});
}

// A micromap, a structure that attaches it, and something between their builds.
void buildAndAttach(Gpu &gpu, const std::function<void(VkCommandBuffer, const Micromap &)> &between,
                    const Record &before = {})
{
    Micromap micromap(gpu, oneTriangle());
    Blas blas(gpu);
    blas.prepare(leaves(micromap));
    gpu.submit([&](VkCommandBuffer commands) {
        if (before)
            before(commands);
        micromap.record(commands);
        between(commands, micromap);
        blas.record(commands);
    });
}

// ------------------------------------------------------------------------------------------ forms of barriers

void noBarrier(Gpu &gpu, bool wrong)
{
    buildAndAttach(gpu, [wrong](VkCommandBuffer commands, const Micromap &) {
        if (!wrong)
            barrier(commands);
    });
}

// Stages and accesses of Vulkan 1.0 do not have those of VkMicromapEXT.
void oldBarrier(Gpu &gpu, bool wrong)
{
    buildAndAttach(gpu, [&](VkCommandBuffer commands, const Micromap &) {
        const auto memory = vkInit<VkMemoryBarrier>(
            {.srcAccessMask = VK_ACCESS_ACCELERATION_STRUCTURE_WRITE_BIT_KHR,
             .dstAccessMask =
                 VkAccessFlags(wrong ? VK_ACCESS_SHADER_READ_BIT : VK_ACCESS_ACCELERATION_STRUCTURE_READ_BIT_KHR)});
        constexpr auto stage = VK_PIPELINE_STAGE_ACCELERATION_STRUCTURE_BUILD_BIT_KHR;
        vkCmdPipelineBarrier(commands, stage, stage, 0, 1, &memory, 0, nullptr, 0, nullptr);
    });
}

template <VkAccessFlags2 VkMemoryBarrier2::*mask>
void wrongAccess(Gpu &gpu, bool wrong)
{
    buildAndAttach(gpu, [&](VkCommandBuffer commands, const Micromap &) {
        VkMemoryBarrier2 memory = exactBarrier(gpu);
        if (wrong)
            memory.*mask = VK_ACCESS_2_SHADER_READ_BIT;
        const VkDependencyInfo info = dependencyOf(memory);
        vkCmdPipelineBarrier2(commands, &info);
    });
}

template <VkPipelineStageFlags2 VkMemoryBarrier2::*mask>
void wrongStage(Gpu &gpu, bool wrong)
{
    buildAndAttach(gpu, [&](VkCommandBuffer commands, const Micromap &) {
        VkMemoryBarrier2 memory = exactBarrier(gpu);
        if (wrong) {
            memory.*mask = VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT;
            memory.srcAccessMask = memory.dstAccessMask = VK_ACCESS_2_MEMORY_READ_BIT | VK_ACCESS_2_MEMORY_WRITE_BIT;
        }
        const VkDependencyInfo info = dependencyOf(memory);
        vkCmdPipelineBarrier2(commands, &info);
    });
}

void bufferBarrier(Gpu &gpu, bool wrong)
{
    const Buffer other(gpu, 256, micromapStorageUsage(gpu));
    Micromap micromap(gpu, oneTriangle());
    const Buffer storage(gpu, micromap.size(), micromapStorageUsage(gpu));
    const MicromapHandle handle = createMicromap(gpu, storage.handle(), storage.address(), 0, micromap.size());
    const MicromapHandle copyTo = createMicromap(gpu, other.handle(), other.address(), 0, 256);
    destroyMicromap(gpu, copyTo);
    const VkMemoryBarrier2 memory = exactBarrier(gpu);
    const auto range = vkInit<VkBufferMemoryBarrier2>({.srcStageMask = memory.srcStageMask,
                                                       .srcAccessMask = memory.srcAccessMask,
                                                       .dstStageMask = micromapStage(gpu),
                                                       .dstAccessMask = micromapRead(gpu) | micromapWrite(gpu),
                                                       .srcQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED,
                                                       .dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED,
                                                       .buffer = wrong ? other.handle() : storage.handle(),
                                                       .size = VK_WHOLE_SIZE});
    const auto info = vkInit<VkDependencyInfo>({.bufferMemoryBarrierCount = 1, .pBufferMemoryBarriers = &range});
    gpu.submit([&](VkCommandBuffer commands) {
        recordMicromapBuilds(gpu, commands, std::array{MicromapBuild{micromap.buildInfo(), handle}});
        vkCmdPipelineBarrier2(commands, &info);
        recordMicromapCopy(gpu, commands, handle, micromap.handle(), VK_COPY_MICROMAP_MODE_CLONE_EXT);
    });
    destroyMicromap(gpu, handle);
}

void rangeBarrier(Gpu &gpu, bool wrong)
{
    const Buffer other(gpu, 256, micromapStorageUsage(gpu) | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    buildAndAttach(gpu, [&](VkCommandBuffer commands, const Micromap &micromap) {
        const VkMemoryBarrier2 memory = exactBarrier(gpu);
        VkMemoryRangeBarrierKHR range{VK_STRUCTURE_TYPE_MEMORY_RANGE_BARRIER_KHR,
                                      nullptr,
                                      memory.srcStageMask,
                                      memory.srcAccessMask,
                                      memory.dstStageMask,
                                      memory.dstAccessMask,
                                      VK_QUEUE_FAMILY_IGNORED,
                                      VK_QUEUE_FAMILY_IGNORED,
                                      {micromap.range().address, micromap.range().size},
                                      VK_ADDRESS_COMMAND_UNKNOWN_STORAGE_BUFFER_USAGE_BIT_KHR};
        if (wrong)
            range.addressRange = {other.address(), 256};
        const VkMemoryRangeBarriersInfoKHR ranges{VK_STRUCTURE_TYPE_MEMORY_RANGE_BARRIERS_INFO_KHR, nullptr, 1, &range};
        const auto info = vkInit<VkDependencyInfo>({.pNext = &ranges});
        vkCmdPipelineBarrier2(commands, &info);
    });
}

// The event is set before the build of the micromap, or after it.
template <bool old>
void eventBeforeTheWrite(Gpu &gpu, bool wrong)
{
    const auto eventInfo = vkInit<VkEventCreateInfo>();
    VkEvent event = VK_NULL_HANDLE;
    VT_CHECK(vkCreateEvent(gpu.device(), &eventInfo, nullptr, &event));
    const VkMemoryBarrier2 exact = exactBarrier(gpu);
    const VkDependencyInfo info = dependencyOf(exact);
    const auto memory = vkInit<VkMemoryBarrier>(
        {.srcAccessMask = VK_ACCESS_MEMORY_WRITE_BIT, .dstAccessMask = VK_ACCESS_MEMORY_READ_BIT});
    constexpr auto stage = VK_PIPELINE_STAGE_ALL_COMMANDS_BIT;
    const auto set = [&](VkCommandBuffer commands) {
        if (old)
            vkCmdSetEvent(commands, event, stage);
        else
            vkCmdSetEvent2(commands, event, &info);
    };
    buildAndAttach(
        gpu,
        [&](VkCommandBuffer commands, const Micromap &) {
            if (!wrong)
                set(commands);
            if (old)
                vkCmdWaitEvents(commands, 1, &event, stage, stage, 1, &memory, 0, nullptr, 0, nullptr);
            else
                vkCmdWaitEvents2(commands, 1, &event, &info);
        },
        [&](VkCommandBuffer commands) {
            if (wrong)
                set(commands);
        });
    vkDestroyEvent(gpu.device(), event, nullptr);
}

// ------------------------------------------------------------------------------------------ commands

void rebuiltWhileAttached(Gpu &gpu, bool wrong)
{
    Micromap micromap(gpu, oneTriangle());
    micromap.build();
    Blas blas(gpu);
    blas.prepare(leaves(micromap));
    gpu.submit([&](VkCommandBuffer commands) {
        blas.record(commands);
        if (!wrong)
            barrier(commands);
        micromap.record(commands);
    });
}

void sharedScratch(Gpu &gpu, bool wrong)
{
    Blas first(gpu), second(gpu);
    Micromap micromap(gpu, oneTriangle());
    micromap.build();
    SharedScratch scratch(gpu);
    first.shareScratch(&scratch);
    second.shareScratch(&scratch);
    first.prepare(leaves(micromap));
    second.prepare(leaves(micromap));
    gpu.submit([&](VkCommandBuffer commands) {
        first.record(commands);
        if (!wrong)
            barrier(commands);
        second.record(commands);
    });
}

void copyOfBuild(Gpu &gpu, bool wrong)
{
    Micromap micromap(gpu, oneTriangle());
    const Micromap copy(gpu, micromap, micromap.size());
    gpu.submit([&](VkCommandBuffer commands) {
        micromap.record(commands);
        if (!wrong)
            barrier(commands);
        recordMicromapCopy(gpu, commands, micromap.handle(), copy.handle(), VK_COPY_MICROMAP_MODE_CLONE_EXT);
    });
}

void copyOfStructure(Gpu &gpu, bool wrong)
{
    Micromap micromap(gpu, oneTriangle());
    micromap.build();
    Blas blas(gpu), copy(gpu);
    blas.prepare(leaves(micromap));
    copy.create(blas.size());
    gpu.submit([&](VkCommandBuffer commands) {
        blas.record(commands);
        if (!wrong)
            barrier(commands);
        recordCopy(gpu, commands, blas.handle(), copy.handle());
    });
}

void queryOfBuild(Gpu &gpu, bool wrong)
{
    Micromap micromap(gpu, oneTriangle(), VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT);
    const VkQueryType type = micromapQueryType(gpu, VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT);
    const QueryPool pool(gpu, type);
    gpu.submit([&](VkCommandBuffer commands) {
        vkCmdResetQueryPool(commands, pool, 0, 1);
        micromap.record(commands);
        if (!wrong)
            barrier(commands);
        recordMicromapProperties(gpu, commands, std::array{micromap.handle()}, type, pool, 0);
    });
}

// --- What the instances of a top-level structure name ---

// A bottom-level structure and others, of which none is built yet, and a top-level structure over some.
struct Levels {
    explicit Levels(Gpu &device) : gpu(device), blas(device), other(device), tlas(device)
    {
        for (Blas *one : {&blas, &other}) {
            Geometry geometry;
            appendTriangle(geometry.vertices, {});
            one->prepare({geometry}, VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR |
                                         VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR);
        }
    }
    void buildOther() const
    {
        gpu.submit([&](VkCommandBuffer commands) { other.record(commands); });
    }

    Gpu &gpu;
    Blas blas, other;
    Tlas tlas;
};

// Builds both levels, with something between.
void buildLevels(Gpu &gpu, const Record &between)
{
    Levels levels(gpu);
    levels.tlas.prepare(std::array{instance(levels.blas, {}, 0)});
    gpu.submit([&](VkCommandBuffer commands) {
        levels.blas.record(commands);
        between(commands);
        levels.tlas.record(commands);
    });
}

void topAfterBottom(Gpu &gpu, bool wrong)
{
    buildLevels(gpu, [wrong](VkCommandBuffer commands) {
        if (!wrong)
            barrier(commands);
    });
}

// The barrier has what a build reads of the structures, or what it reads of its instances.
void topAfterOtherAccess(Gpu &gpu, bool wrong)
{
    buildLevels(gpu, [wrong](VkCommandBuffer commands) {
        const auto memory = vkInit<VkMemoryBarrier>(
            {.srcAccessMask = VK_ACCESS_ACCELERATION_STRUCTURE_WRITE_BIT_KHR,
             .dstAccessMask =
                 VkAccessFlags(wrong ? VK_ACCESS_SHADER_READ_BIT : VK_ACCESS_ACCELERATION_STRUCTURE_READ_BIT_KHR)});
        constexpr auto stage = VK_PIPELINE_STAGE_ACCELERATION_STRUCTURE_BUILD_BIT_KHR;
        vkCmdPipelineBarrier(commands, stage, stage, 0, 1, &memory, 0, nullptr, 0, nullptr);
    });
}

// The barrier is before the build of the structure.
void topAfterEarlierBarrier(Gpu &gpu, bool wrong)
{
    Levels levels(gpu);
    levels.tlas.prepare(std::array{instance(levels.other, {}, 0), instance(levels.blas, {}, 1)});
    gpu.submit([&](VkCommandBuffer commands) {
        levels.other.record(commands);
        if (!wrong)
            levels.blas.record(commands);
        barrier(commands);
        if (wrong)
            levels.blas.record(commands);
        levels.tlas.record(commands);
    });
}

// Nothing orders the two builds; the right program's instances name another structure, or no ray meets the instance.
template <bool hasMask>
void topNamesBottom(Gpu &gpu, bool wrong)
{
    Levels levels(gpu);
    levels.buildOther();
    const Blas &named = wrong || hasMask ? levels.blas : levels.other;
    levels.tlas.prepare(
        std::array{instance(levels.other, {}, 0), instance(named, {}, 1, 0, wrong || !hasMask ? 0xff : 0)});
    gpu.submit([&](VkCommandBuffer commands) {
        levels.blas.record(commands);
        levels.tlas.record(commands);
    });
}

// An array of pointers, and two structures that nothing orders, which are reported once.
void topNamesTwo(Gpu &gpu, bool wrong)
{
    Levels levels(gpu);
    levels.tlas.prepare(std::array{instance(levels.blas, {}, 0), instance(levels.other, {}, 1)}, 0,
                        VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR, Arrangement::Pointers);
    gpu.submit([&](VkCommandBuffer commands) {
        levels.blas.record(commands);
        levels.other.record(commands);
        if (!wrong)
            barrier(commands);
        levels.tlas.record(commands);
    });
}

// Command buffers of one batch, or of two.
template <bool twoBatches>
void topInNextCommandBuffer(Gpu &gpu, bool wrong)
{
    Levels levels(gpu);
    levels.tlas.prepare(std::array{instance(levels.blas, {}, 0)});
    const std::array<VkCommandBuffer, 2> commands{gpu.begin(), gpu.begin()};
    levels.blas.record(commands[0]);
    if (!wrong)
        barrier(commands[1]);
    levels.tlas.record(commands[1]);
    for (VkCommandBuffer one : commands)
        gpu.end(one);
    const std::array submits{
        vkInit<VkSubmitInfo>({.commandBufferCount = twoBatches ? 1U : 2U, .pCommandBuffers = commands.data()}),
        vkInit<VkSubmitInfo>({.commandBufferCount = 1, .pCommandBuffers = &commands[1]})};
    VT_CHECK(vkQueueSubmit(gpu.queue(), twoBatches ? 2 : 1, submits.data(), VK_NULL_HANDLE));
    VT_CHECK(vkQueueWaitIdle(gpu.queue()));
    vkFreeCommandBuffers(gpu.device(), gpu.pool(), 2, commands.data());
}

// A command writes a structure that instances name.
void topAfterWrite(Gpu &gpu, bool wrong, const Structure &named, const std::function<void(VkCommandBuffer)> &write)
{
    Tlas tlas(gpu);
    tlas.prepare(std::array{instance(named, {}, 0)});
    gpu.submit([&](VkCommandBuffer commands) {
        write(commands);
        if (!wrong)
            barrier(commands);
        tlas.record(commands);
    });
}

void topAfterCopy(Gpu &gpu, bool wrong)
{
    Levels levels(gpu);
    levels.buildOther();
    Blas copy(gpu);
    copy.create(levels.other.size());
    topAfterWrite(gpu, wrong, copy,
                  [&](VkCommandBuffer commands) { recordCopy(gpu, commands, levels.other.handle(), copy.handle()); });
}

void topAfterCompaction(Gpu &gpu, bool wrong)
{
    Levels levels(gpu);
    levels.buildOther();
    Blas copy(gpu);
    copy.create(levels.other.size());
    topAfterWrite(gpu, wrong, copy, [&](VkCommandBuffer commands) {
        recordCopy(gpu, commands, levels.other.handle(), copy.handle(),
                   VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR);
    });
}

void topAfterDeserialization(Gpu &gpu, bool wrong)
{
    Levels levels(gpu);
    levels.buildOther();
    const Serialized data = serialize(gpu, levels.other);
    const Buffer memory(gpu, data.total() + 256, VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    const VkDeviceAddress begin = (memory.address() + 255) / 256 * 256;
    std::memcpy(memory.bytes() + (begin - memory.address()), data.bytes().data(), data.total());
    Blas copy(gpu);
    copy.create(data.deserializedSize());
    auto info = vkInit<VkCopyMemoryToAccelerationStructureInfoKHR>(
        {.dst = copy.handle(), .mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_DESERIALIZE_KHR});
    info.src.deviceAddress = begin;
    topAfterWrite(gpu, wrong, copy,
                  [&](VkCommandBuffer commands) { gpu.vk().CmdCopyMemoryToAccelerationStructureKHR(commands, &info); });
}

// The structure's memory held another one, which was written without a barrier and is no longer named.
void topOverReusedMemory(Gpu &gpu, bool wrong)
{
    Levels levels(gpu);
    Blas before(gpu);
    before.useMemoryOf(levels.blas);
    before.create(levels.blas.size());
    levels.buildOther();
    levels.tlas.prepare(std::array{instance(levels.blas, {}, 0)});
    gpu.submit([&](VkCommandBuffer commands) {
        recordCopy(gpu, commands, levels.other.handle(), before.handle());
        barrier(commands);
        levels.blas.record(commands);
        if (!wrong)
            barrier(commands);
        levels.tlas.record(commands);
    });
}

// The top-level structure was built before.
void topAfterUpdate(Gpu &gpu, bool wrong)
{
    Levels levels(gpu);
    Geometry geometry;
    appendTriangle(geometry.vertices, {});
    constexpr VkFlags kUpdatable = VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR;
    levels.blas.build({geometry}, kUpdatable);
    levels.tlas.build(std::array{instance(levels.blas, {}, 0)}, kUpdatable);
    levels.blas.prepare({geometry}, kUpdatable, VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR);
    levels.tlas.prepare(std::array{instance(levels.blas, {}, 0)}, kUpdatable,
                        VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR);
    gpu.submit([&](VkCommandBuffer commands) {
        levels.blas.record(commands);
        if (!wrong)
            barrier(commands);
        levels.tlas.record(commands);
    });
}

// `upload` writes the triangle of a micromap.
void uploadAndBuild(Gpu &gpu, bool wrong, const std::function<void(VkCommandBuffer, const Buffer &)> &upload)
{
    Micromap micromap(gpu, oneTriangle());
    const Buffer triangles = gpu.upload(std::span<const VkMicromapTriangleEXT>(micromap.input().triangles),
                                        micromapInputUsage(gpu) | VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    VkMicromapBuildInfoEXT info = micromap.buildInfo();
    info.triangleArray.deviceAddress = triangles.address();
    gpu.submit([&](VkCommandBuffer commands) {
        upload(commands, triangles);
        if (!wrong)
            barrier(commands);
        recordMicromapBuilds(gpu, commands, std::array{MicromapBuild{info, micromap.handle()}});
    });
}

void updatedInput(Gpu &gpu, bool wrong)
{
    const MicromapInput input = oneTriangle();
    uploadAndBuild(gpu, wrong, [&](VkCommandBuffer commands, const Buffer &triangles) {
        vkCmdUpdateBuffer(commands, triangles.handle(), 0, sizeof(VkMicromapTriangleEXT), input.triangles.data());
    });
}

void copiedInput(Gpu &gpu, bool wrong)
{
    const MicromapInput input = oneTriangle();
    const Buffer staging =
        gpu.upload(std::span<const VkMicromapTriangleEXT>(input.triangles), VK_BUFFER_USAGE_TRANSFER_SRC_BIT);
    uploadAndBuild(gpu, wrong, [&](VkCommandBuffer commands, const Buffer &triangles) {
        const VkBufferCopy region{0, 0, sizeof(VkMicromapTriangleEXT)};
        vkCmdCopyBuffer(commands, staging.handle(), triangles.handle(), 1, &region);
    });
}

// ------------------------------------------------------------------------------------------ submissions

// Builds of a micromap and of a structure that attaches it, in two batches.
template <bool sync2>
void twoBatches(Gpu &gpu, bool wrong)
{
    Micromap micromap(gpu, oneTriangle());
    Blas blas(gpu);
    blas.prepare(leaves(micromap));
    const auto semaphoreInfo = vkInit<VkSemaphoreCreateInfo>();
    VkSemaphore semaphore = VK_NULL_HANDLE;
    VT_CHECK(vkCreateSemaphore(gpu.device(), &semaphoreInfo, nullptr, &semaphore));
    const std::array<VkCommandBuffer, 2> commands{gpu.begin(), gpu.begin()};
    micromap.record(commands[0]);
    blas.record(commands[1]);
    for (VkCommandBuffer one : commands)
        gpu.end(one);
    if (sync2) {
        const auto use =
            vkInit<VkSemaphoreSubmitInfo>({.semaphore = semaphore, .stageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT});
        const std::array infos{vkInit<VkCommandBufferSubmitInfo>({.commandBuffer = commands[0]}),
                               vkInit<VkCommandBufferSubmitInfo>({.commandBuffer = commands[1]})};
        const std::array submits{vkInit<VkSubmitInfo2>({.commandBufferInfoCount = 1,
                                                        .pCommandBufferInfos = &infos[0],
                                                        .signalSemaphoreInfoCount = wrong ? 0U : 1U,
                                                        .pSignalSemaphoreInfos = &use}),
                                 vkInit<VkSubmitInfo2>({.waitSemaphoreInfoCount = wrong ? 0U : 1U,
                                                        .pWaitSemaphoreInfos = &use,
                                                        .commandBufferInfoCount = 1,
                                                        .pCommandBufferInfos = &infos[1]})};
        VT_CHECK(vkQueueSubmit2(gpu.queue(), 2, submits.data(), VK_NULL_HANDLE));
    } else {
        const VkPipelineStageFlags stages = VK_PIPELINE_STAGE_ALL_COMMANDS_BIT;
        const std::array submits{vkInit<VkSubmitInfo>({.commandBufferCount = 1,
                                                       .pCommandBuffers = &commands[0],
                                                       .signalSemaphoreCount = wrong ? 0U : 1U,
                                                       .pSignalSemaphores = &semaphore}),
                                 vkInit<VkSubmitInfo>({.waitSemaphoreCount = wrong ? 0U : 1U,
                                                       .pWaitSemaphores = &semaphore,
                                                       .pWaitDstStageMask = &stages,
                                                       .commandBufferCount = 1,
                                                       .pCommandBuffers = &commands[1]})};
        VT_CHECK(vkQueueSubmit(gpu.queue(), 2, submits.data(), VK_NULL_HANDLE));
    }
    VT_CHECK(vkQueueWaitIdle(gpu.queue()));
    vkFreeCommandBuffers(gpu.device(), gpu.pool(), 2, commands.data());
    vkDestroySemaphore(gpu.device(), semaphore, nullptr);
}

constexpr auto kRaw = "sync-read-after-write";
constexpr auto kWar = "sync-write-after-read";
constexpr auto kWaw = "sync-write-after-write";

#define BOTH_APIS(rule, needs, run, variant)                                                                           \
    {rule, Api::Khr, needs, run, variant "Khr"},                                                                       \
    {                                                                                                                  \
        rule, Api::Ext, needs, run, variant "Ext"                                                                      \
    }
constexpr WrongProgram kPrograms[] = {
    BOTH_APIS(kRaw, kNeedsNothing, noBarrier, "NoBarrier"),
    {kRaw, Api::Khr, kNeedsNothing, oldBarrier, "OldBarrier"},
    BOTH_APIS(kRaw, kNeedsNothing, wrongAccess<&VkMemoryBarrier2::srcAccessMask>, "FirstAccess"),
    BOTH_APIS(kRaw, kNeedsNothing, wrongAccess<&VkMemoryBarrier2::dstAccessMask>, "SecondAccess"),
    BOTH_APIS(kRaw, kNeedsNothing, wrongStage<&VkMemoryBarrier2::srcStageMask>, "FirstStage"),
    BOTH_APIS(kRaw, kNeedsNothing, wrongStage<&VkMemoryBarrier2::dstStageMask>, "SecondStage"),
    BOTH_APIS(kRaw, kNeedsNothing, bufferBarrier, "BufferBarrier"),
    BOTH_APIS(kRaw, kNeedsAddressCommands, rangeBarrier, "RangeBarrier"),
    BOTH_APIS(kRaw, kNeedsNothing, eventBeforeTheWrite<true>, "OldEvent"),
    BOTH_APIS(kRaw, kNeedsNothing, eventBeforeTheWrite<false>, "Event"),
    BOTH_APIS(kWar, kNeedsNothing, rebuiltWhileAttached, "Rebuilt"),
    BOTH_APIS(kWaw, kNeedsNothing, sharedScratch, "Scratch"),
    BOTH_APIS(kRaw, kNeedsNothing, copyOfBuild, "Copy"),
    BOTH_APIS(kRaw, kNeedsNothing, copyOfStructure, "CopyOfStructure"),
    BOTH_APIS(kRaw, kNeedsNothing, queryOfBuild, "Query"),
    BOTH_APIS(kRaw, kNeedsNothing, topAfterBottom, "Top"),
    {kRaw, Api::Khr, kNeedsNothing, topAfterOtherAccess, "TopOtherAccess"},
    {kRaw, Api::Khr, kNeedsNothing, topAfterEarlierBarrier, "TopEarlierBarrier"},
    {kRaw, Api::Khr, kNeedsNothing, topNamesBottom<false>, "TopNames"},
    {kRaw, Api::Khr, kNeedsNothing, topNamesBottom<true>, "TopMask"},
    {kRaw, Api::Ext, kNeedsNothing, topNamesTwo, "TopNamesTwo"},
    {kRaw, Api::Khr, kNeedsNothing, topInNextCommandBuffer<false>, "TopNextCommandBuffer"},
    {kRaw, Api::Ext, kNeedsNothing, topInNextCommandBuffer<true>, "TopNextBatch"},
    BOTH_APIS(kRaw, kNeedsNothing, topAfterCopy, "TopCopy"),
    {kRaw, Api::Khr, kNeedsNothing, topAfterCompaction, "TopCompaction"},
    {kRaw, Api::Khr, kNeedsNothing, topAfterDeserialization, "TopDeserialization"},
    {kRaw, Api::Khr, kNeedsNothing, topOverReusedMemory, "TopReusedMemory"},
    {kRaw, Api::Ext, kNeedsNothing, topAfterUpdate, "TopUpdate"},
    BOTH_APIS(kRaw, kNeedsNothing, updatedInput, "Update"),
    BOTH_APIS(kRaw, kNeedsNothing, copiedInput, "CopiedInput"),
    BOTH_APIS(kRaw, kNeedsNothing, twoBatches<false>, "Batches"),
    BOTH_APIS(kRaw, kNeedsNothing, twoBatches<true>, "Batches2"),
};

} // namespace

std::span<const WrongProgram> syncPrograms()
{
    return kPrograms;
}

} // namespace vt
