// SPDX-License-Identifier: Apache-2.0
// Programs that destroy what a command uses before the command is complete.
#include "recorded.h"

#include <optional>
#include <thread>

#include "gpu/tracer.h"

namespace vt
{
namespace
{

// Commands that write to memory when they have been executed. The host reads it, and Vulkan does not know of that.
class Commands
{
public:
    template <typename Record>
    Commands(Gpu &gpu, const Record &record) : gpu_(gpu), done_(gpu, 16, VK_BUFFER_USAGE_TRANSFER_DST_BIT)
    {
        commands_ = gpu.begin();
        record(commands_);
        barrier(commands_);
        vkCmdFillBuffer(commands_, done_.handle(), 0, 16, 1);
        barrier(commands_);
        gpu.end(commands_);
    }
    Commands(const Commands &) = delete;
    Commands &operator=(const Commands &) = delete;
    ~Commands() { vkFreeCommandBuffers(gpu_.device(), gpu_.pool(), 1, &commands_); }

    void submit(VkFence fence = VK_NULL_HANDLE, VkSubmitInfo info = vkInit<VkSubmitInfo>({}))
    {
        *flag() = 0;
        info.commandBufferCount = 1;
        info.pCommandBuffers = &commands_;
        VT_CHECK(vkQueueSubmit(gpu_.queue(), 1, &info, fence));
    }
    // Waits for what they write.
    void await()
    {
        while (*flag() == 0)
            std::this_thread::yield();
    }

private:
    volatile uint32_t *flag() { return done_.as<uint32_t>().data(); }
    Gpu &gpu_;
    Buffer done_;
    VkCommandBuffer commands_ = VK_NULL_HANDLE;
};

// Executes commands, and destroys something: the wrong program before Vulkan reports that the commands are complete,
// which is harmless.
template <typename Record, typename Destroy>
void destroyPending(Gpu &gpu, bool wrong, const Record &record, const Destroy &destroy)
{
    Commands commands(gpu, record);
    commands.submit();
    commands.await();
    if (wrong)
        destroy();
    VT_CHECK(vkQueueWaitIdle(gpu.queue()));
    if (!wrong)
        destroy();
}

enum class What { Micromap, MicromapStorage, Triangles, TriangleMemory, Bottom, BottomStorage, Vertices, Top };

// A micromap is built.
template <What what>
void built(Gpu &gpu, bool wrong)
{
    Micromap micromap(gpu, oneTriangle());
    Storage storage(gpu), triangles(gpu, micromapInputUsage(gpu));
    const MicromapHandle handle = createMicromap(gpu, storage.buffer(), storage.address(), 0, micromap.size());
    VkMicromapBuildInfoEXT info = micromap.buildInfo();
    info.triangleArray.deviceAddress = triangles.address();
    destroyPending(
        gpu, wrong,
        [&](VkCommandBuffer commands) {
            vkCmdUpdateBuffer(commands, triangles.buffer(), 0, sizeof(VkMicromapTriangleEXT),
                              micromap.input().triangles.data());
            barrier(commands);
            recordMicromapBuilds(gpu, commands, std::array{MicromapBuild{info, handle}});
        },
        [&] {
            if (what == What::Micromap)
                destroyMicromap(gpu, handle);
            else if (what == What::MicromapStorage)
                storage.destroyBuffer();
            else if (what == What::Triangles)
                triangles.destroyBuffer();
            else
                triangles.freeMemory();
        });
    if (what != What::Micromap)
        destroyMicromap(gpu, handle);
}

// Structures and their micromap, each in a buffer of its own.
struct Scene {
    explicit Scene(Gpu &g)
        : gpu(g), like(g, oneTriangle()), micromapStorage(g), bottomStorage(g), topStorage(g),
          vertices(g, VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR),
          micromap(createMicromap(g, micromapStorage.buffer(), micromapStorage.address(), 0, like.size()))
    {
        like.build();
        const Geometry geometry{.vertices = triangleRow(1),
                                .micromap =
                                    Attachment{.micromap = &like, .indexType = VK_INDEX_TYPE_UINT32, .indices = {0}}};
        bottom.emplace(gpu);
        bottom->placeIn(bottomStorage.buffer(), 0);
        bottom->build({geometry});
        build.emplace(gpu, *bottom);
        auto &triangles = build->geometry.geometry.triangles;
        triangles.vertexData.deviceAddress = vertices.address();
        if (gpu.khr()) {
            khr = *static_cast<const KhrAttached *>(triangles.pNext);
            khr.micromap = micromap.khr;
            triangles.pNext = &khr;
        } else {
            ext = *static_cast<const ExtAttached *>(triangles.pNext);
            ext.micromap = micromap.ext;
            triangles.pNext = &ext;
        }
        gpu.submit([&](VkCommandBuffer commands) {
            vkCmdUpdateBuffer(commands, vertices.buffer(), 0, geometry.vertices.size() * sizeof geometry.vertices[0],
                              geometry.vertices.data());
            recordMicromapBuilds(gpu, commands, std::array{MicromapBuild{like.buildInfo(), micromap}});
            barrier(commands);
            build->record(commands);
        });
        top.emplace(gpu);
        top->placeIn(topStorage.buffer(), 0);
        top->build(std::array{instance(*bottom, {}, 0)});
    }
    Scene(const Scene &) = delete;
    Scene &operator=(const Scene &) = delete;
    ~Scene() { destroy(What::Micromap); }
    void destroy(What what)
    {
        switch (what) {
        case What::Micromap: destroyMicromap(gpu, std::exchange(micromap, {})); break;
        case What::MicromapStorage: micromapStorage.destroyBuffer(); break;
        case What::Bottom: bottom.reset(); break;
        case What::BottomStorage: bottomStorage.destroyBuffer(); break;
        case What::Vertices: vertices.destroyBuffer(); break;
        default: top.reset(); break;
        }
    }
    Gpu &gpu;
    Micromap like;
    Storage micromapStorage, bottomStorage, topStorage, vertices;
    MicromapHandle micromap;
    ExtAttached ext{};
    KhrAttached khr{};
    std::optional<Build> build; // of the bottom-level structure
    std::optional<Blas> bottom;
    std::optional<Tlas> top;
};

// A structure with a micromap is built.
template <What what>
void attached(Gpu &gpu, bool wrong)
{
    Scene scene(gpu);
    destroyPending(
        gpu, wrong, [&](VkCommandBuffer commands) { scene.build->record(commands); }, [&] { scene.destroy(what); });
}

// Rays are traced.
template <What what>
void traced(Gpu &gpu, bool wrong)
{
    Scene scene(gpu);
    Tracer tracer(gpu);
    tracer.prepare(*scene.top, std::array{Ray{.origin = {0.3f, 0.3f, 1}}});
    destroyPending(
        gpu, wrong,
        [&](VkCommandBuffer commands) {
            tracer.bind(commands);
            tracer.dispatch(commands);
        },
        [&] { scene.destroy(what); });
}

// Rays are traced twice by the same command buffer, which builds the top-level structure of what the host writes. The
// second time it names the structure that the wrong program destroys.
void tracedAgain(Gpu &gpu, bool wrong)
{
    const std::vector<Geometry> geometries{Geometry{.vertices = triangleRow(1)}};
    std::optional<Blas> one(std::in_place, gpu, geometries), other(std::in_place, gpu, geometries);
    Tlas top(gpu);
    top.prepare(std::array{instance(*one, {}, 0)});
    const Buffer instances(gpu, 256,
                           VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT |
                               VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR);
    const auto write = [&](const Blas &bottom) {
        const VkAccelerationStructureInstanceKHR only = instance(bottom, {}, 0);
        std::memcpy(instances.bytes(), &only, sizeof only);
    };
    Build build(gpu, top);
    build.geometry.geometry.instances.data.deviceAddress = instances.address();
    Tracer tracer(gpu);
    tracer.prepare(top, std::array{Ray{.origin = {0.3f, 0.3f, 1}}});
    Commands commands(gpu, [&](VkCommandBuffer c) {
        build.record(c);
        barrier(c);
        tracer.bind(c);
        tracer.dispatch(c);
    });
    write(*one);
    commands.submit();
    VT_CHECK(vkQueueWaitIdle(gpu.queue()));
    write(*other);
    commands.submit();
    commands.await();
    (wrong ? other : one).reset();
    VT_CHECK(vkQueueWaitIdle(gpu.queue()));
}

// Vertices in two buffers on the same memory: the wrong program destroys both, the right one keeps one until the build
// is complete.
void aliased(Gpu &gpu, bool wrong)
{
    Scene scene(gpu);
    const auto info = vkInit<VkBufferCreateInfo>(
        {.size = 256,
         .usage = VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT |
                  VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR});
    std::array<VkBuffer, 2> buffers{};
    for (VkBuffer &buffer : buffers)
        VT_CHECK(vkCreateBuffer(gpu.device(), &info, nullptr, &buffer));
    const VkDeviceMemory memory = gpu.bindMemory(buffers[0]);
    VT_CHECK(vkBindBufferMemory(gpu.device(), buffers[1], memory, 0));
    scene.build->geometry.geometry.triangles.vertexData.deviceAddress = gpu.address(buffers[0]);
    const std::vector<Vec3> vertices = triangleRow(1);
    gpu.submit([&](VkCommandBuffer commands) {
        vkCmdUpdateBuffer(commands, buffers[0], 0, vertices.size() * sizeof vertices[0], vertices.data());
    });
    const auto destroy = [&](VkBuffer &buffer) {
        vkDestroyBuffer(gpu.device(), std::exchange(buffer, VK_NULL_HANDLE), nullptr);
    };
    destroyPending(
        gpu, true, [&](VkCommandBuffer commands) { scene.build->record(commands); },
        [&] {
            destroy(buffers[1]);
            if (wrong)
                destroy(buffers[0]);
        });
    destroy(buffers[0]);
    vkFreeMemory(gpu.device(), memory, nullptr);
}

VkSemaphore newSemaphore(Gpu &gpu, VkSemaphoreType type)
{
    const auto kind = vkInit<VkSemaphoreTypeCreateInfo>({.semaphoreType = type});
    const auto info = vkInit<VkSemaphoreCreateInfo>({.pNext = &kind});
    VkSemaphore semaphore = VK_NULL_HANDLE;
    VT_CHECK(vkCreateSemaphore(gpu.device(), &info, nullptr, &semaphore));
    return semaphore;
}

void awaitValue(Gpu &gpu, VkSemaphore semaphore, uint64_t value)
{
    const auto wait = vkInit<VkSemaphoreWaitInfo>({.semaphoreCount = 1, .pSemaphores = &semaphore, .pValues = &value});
    VT_CHECK(vkWaitSemaphores(gpu.device(), &wait, UINT64_MAX));
}

// The host waits for a value before the one that the submission signals, which only that can have reached.
void reachedBetween(Gpu &gpu, bool wrong)
{
    Scene scene(gpu);
    const VkSemaphore semaphore = newSemaphore(gpu, VK_SEMAPHORE_TYPE_TIMELINE);
    const uint64_t five = 5;
    const auto values =
        vkInit<VkTimelineSemaphoreSubmitInfo>({.signalSemaphoreValueCount = 1, .pSignalSemaphoreValues = &five});
    Commands commands(gpu, [&](VkCommandBuffer c) { scene.build->record(c); });
    commands.submit(
        VK_NULL_HANDLE,
        vkInit<VkSubmitInfo>({.pNext = &values, .signalSemaphoreCount = 1, .pSignalSemaphores = &semaphore}));
    commands.await();
    if (!wrong)
        awaitValue(gpu, semaphore, 3);
    scene.destroy(What::Vertices);
    VT_CHECK(vkQueueWaitIdle(gpu.queue()));
    vkDestroySemaphore(gpu.device(), semaphore, nullptr);
}

// The submission waits for a value that the host signals later, and the semaphore is destroyed before the next one.
void waitedForHost(Gpu &gpu, bool wrong)
{
    Scene scene(gpu);
    const VkSemaphore semaphore = newSemaphore(gpu, VK_SEMAPHORE_TYPE_TIMELINE);
    const uint64_t one = 1;
    const VkPipelineStageFlags stages = VK_PIPELINE_STAGE_ALL_COMMANDS_BIT;
    const auto values =
        vkInit<VkTimelineSemaphoreSubmitInfo>({.waitSemaphoreValueCount = 1, .pWaitSemaphoreValues = &one});
    Commands commands(gpu, [&](VkCommandBuffer c) { scene.build->record(c); });
    commands.submit(
        VK_NULL_HANDLE,
        vkInit<VkSubmitInfo>(
            {.pNext = &values, .waitSemaphoreCount = 1, .pWaitSemaphores = &semaphore, .pWaitDstStageMask = &stages}));
    const auto signal = vkInit<VkSemaphoreSignalInfo>({.semaphore = semaphore, .value = one});
    VT_CHECK(vkSignalSemaphore(gpu.device(), &signal));
    commands.await();
    VT_CHECK(vkQueueWaitIdle(gpu.queue()));
    vkDestroySemaphore(gpu.device(), semaphore, nullptr);
    commands.submit();
    commands.await();
    if (!wrong)
        VT_CHECK(vkQueueWaitIdle(gpu.queue()));
    scene.destroy(What::Vertices);
    VT_CHECK(vkQueueWaitIdle(gpu.queue()));
}

// A sparse binding waits for the submission, and the right program for the sparse binding.
void waitedForByBinding(Gpu &gpu, bool wrong)
{
    Scene scene(gpu);
    const VkSemaphore built = newSemaphore(gpu, VK_SEMAPHORE_TYPE_BINARY);
    const VkSemaphore bound = newSemaphore(gpu, VK_SEMAPHORE_TYPE_TIMELINE);
    Commands commands(gpu, [&](VkCommandBuffer c) { scene.build->record(c); });
    commands.submit(VK_NULL_HANDLE, vkInit<VkSubmitInfo>({.signalSemaphoreCount = 1, .pSignalSemaphores = &built}));
    const uint64_t one = 1, none = 0;
    const auto values = vkInit<VkTimelineSemaphoreSubmitInfo>({.waitSemaphoreValueCount = 1,
                                                               .pWaitSemaphoreValues = &none,
                                                               .signalSemaphoreValueCount = 1,
                                                               .pSignalSemaphoreValues = &one});
    const auto binding = vkInit<VkBindSparseInfo>({.pNext = &values,
                                                   .waitSemaphoreCount = 1,
                                                   .pWaitSemaphores = &built,
                                                   .signalSemaphoreCount = 1,
                                                   .pSignalSemaphores = &bound});
    VT_CHECK(vkQueueBindSparse(gpu.queue(), 1, &binding, VK_NULL_HANDLE));
    commands.await();
    if (!wrong)
        awaitValue(gpu, bound, 1);
    scene.destroy(What::Vertices);
    VT_CHECK(vkQueueWaitIdle(gpu.queue()));
    vkDestroySemaphore(gpu.device(), built, nullptr);
    vkDestroySemaphore(gpu.device(), bound, nullptr);
}

VkQueryPool newPool(Gpu &gpu, VkQueryType type)
{
    const auto info = vkInit<VkQueryPoolCreateInfo>({.queryType = type, .queryCount = 1});
    VkQueryPool pool = VK_NULL_HANDLE;
    VT_CHECK(vkCreateQueryPool(gpu.device(), &info, nullptr, &pool));
    vkResetQueryPool(gpu.device(), pool, 0, 1);
    return pool;
}

void queried(Gpu &gpu, bool wrong)
{
    const Twins twins(gpu);
    const VkQueryType type = micromapQueryType(gpu, VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT);
    const VkQueryPool pool = newPool(gpu, type);
    destroyPending(
        gpu, wrong,
        [&](VkCommandBuffer commands) {
            recordMicromapProperties(gpu, commands, std::span(&twins.built, 1), type, pool, 0);
        },
        [&] { vkDestroyQueryPool(gpu.device(), pool, nullptr); });
}

void copied(Gpu &gpu, bool wrong)
{
    const Twins twins(gpu);
    const VkQueryType type = micromapQueryType(gpu, VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT);
    const VkQueryPool pool = newPool(gpu, type);
    const Buffer results(gpu, 16, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    gpu.submit([&](VkCommandBuffer commands) {
        recordMicromapProperties(gpu, commands, std::span(&twins.built, 1), type, pool, 0);
    });
    destroyPending(
        gpu, wrong,
        [&](VkCommandBuffer commands) {
            vkCmdCopyQueryPoolResults(commands, pool, 0, 1, results.handle(), 0, 8, VK_QUERY_RESULT_64_BIT);
        },
        [&] { vkDestroyQueryPool(gpu.device(), pool, nullptr); });
}

// The pool is destroyed after the command was recorded.
void resetLater(Gpu &gpu, bool wrong)
{
    const VkQueryPool pool = newPool(gpu, micromapQueryType(gpu, VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT));
    const VkCommandBuffer commands = gpu.begin();
    vkCmdResetQueryPool(commands, pool, 0, 1);
    gpu.end(commands);
    if (wrong)
        vkDestroyQueryPool(gpu.device(), pool, nullptr);
    gpu.execute(commands);
    if (!wrong)
        vkDestroyQueryPool(gpu.device(), pool, nullptr);
    vkFreeCommandBuffers(gpu.device(), gpu.pool(), 1, &commands);
}

constexpr auto kMicromap = "VUID-vkDestroyMicromapEXT-micromap-07441";
constexpr auto kStructure = "VUID-vkDestroyAccelerationStructureKHR-accelerationStructure-02442";
constexpr auto kBuffer = "VUID-vkDestroyBuffer-buffer-00922";

#define BOTH_APIS(rule, run, variant)                                                                                  \
    {rule, Api::Khr, kNeedsNothing, run, variant "Khr"},                                                               \
    {                                                                                                                  \
        rule, Api::Ext, kNeedsNothing, run, variant "Ext"                                                              \
    }
constexpr WrongProgram kPrograms[] = {
    {kMicromap, Api::Ext, kNeedsNothing, built<What::Micromap>},
    {kStructure, Api::Khr, kNeedsNothing, built<What::Micromap>},
    BOTH_APIS(kBuffer, built<What::Triangles>, ""),
    BOTH_APIS(kBuffer, built<What::MicromapStorage>, "Storage"),
    BOTH_APIS("VUID-vkFreeMemory-memory-00677", built<What::TriangleMemory>, ""),
    BOTH_APIS(kBuffer, attached<What::MicromapStorage>, "AttachedStorage"),
    BOTH_APIS(kBuffer, attached<What::Vertices>, "Vertices"),
    {kBuffer, Api::Khr, kNeedsNothing, aliased, "Aliased"},
    {kStructure, Api::Khr, kNeedsNothing, traced<What::Top>, "TracedTop"},
    {kStructure, Api::Ext, kNeedsNothing, traced<What::Bottom>, "TracedBottom"},
    {kBuffer, Api::Ext, kNeedsNothing, traced<What::BottomStorage>, "TracedStorage"},
    {kStructure, Api::Khr, kNeedsNothing, traced<What::Micromap>, "TracedMicromap"},
    // Others may copy what a structure needs of it: VkMicromapBuildSizesInfoEXT::discardable.
    {kMicromap, Api::Ext, kNeedsEmulation, traced<What::Micromap>, "TracedMicromap"},
    {kStructure, Api::Khr, kNeedsNothing, tracedAgain, "TracedAgain", kBuffer},
    {kBuffer, Api::Khr, kNeedsNothing, reachedBetween, "ReachedBetween"},
    {kBuffer, Api::Khr, kNeedsNothing, waitedForHost, "WaitedForHost"},
    {kBuffer, Api::Khr, kNeedsNothing, waitedForByBinding, "WaitedForByBinding"},
    BOTH_APIS("VUID-vkDestroyQueryPool-queryPool-00793", queried, ""),
    BOTH_APIS("VUID-vkDestroyQueryPool-queryPool-00793", copied, "Copied"),
    {"VUID-vkQueueSubmit-pCommandBuffers-00070", Api::Khr, kNeedsNothing, resetLater, "QueryPool"},
};

} // namespace

std::span<const WrongProgram> pendingPrograms()
{
    return kPrograms;
}

} // namespace vt
