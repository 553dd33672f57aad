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

// Executes commands until they have written to memory that the host reads, and destroys something: the wrong program
// before Vulkan reports that the commands are complete, which is harmless.
template <typename Record, typename Destroy>
void destroyPending(Gpu &gpu, bool wrong, const Record &record, const Destroy &destroy)
{
    const Buffer done(gpu, 16, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    volatile uint32_t *flag = done.as<uint32_t>().data();
    *flag = 0;
    VkCommandBuffer commands = gpu.begin();
    record(commands);
    barrier(commands);
    vkCmdFillBuffer(commands, done.handle(), 0, 16, 1);
    barrier(commands);
    gpu.end(commands);
    const auto submit = vkInit<VkSubmitInfo>({.commandBufferCount = 1, .pCommandBuffers = &commands});
    VT_CHECK(vkQueueSubmit(gpu.queue(), 1, &submit, VK_NULL_HANDLE));
    while (*flag == 0)
        std::this_thread::yield();
    if (wrong)
        destroy();
    VT_CHECK(vkQueueWaitIdle(gpu.queue()));
    if (!wrong)
        destroy();
    vkFreeCommandBuffers(gpu.device(), gpu.pool(), 1, &commands);
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
    BOTH_APIS("VUID-vkDestroyQueryPool-queryPool-00793", queried, ""),
    {"VUID-vkQueueSubmit-pCommandBuffers-00070", Api::Khr, kNeedsNothing, resetLater, "QueryPool"},
};

} // namespace

std::span<const WrongProgram> pendingPrograms()
{
    return kPrograms;
}

} // namespace vt
