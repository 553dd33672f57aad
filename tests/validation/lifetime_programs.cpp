// SPDX-License-Identifier: Apache-2.0
// Addresses that lie in no buffer, and objects that were destroyed.
#include "recorded.h"

#include <optional>

#include "gpu/tracer.h"

#include "shaders/tracer_mask_1.h"

namespace vt
{
namespace
{

constexpr VkDeviceAddress kWild = 0x7654'3210'0000;

// --- Addresses ---

// An address of a buffer that was destroyed.
VkDeviceAddress freedAddress(Gpu &gpu)
{
    const Buffer buffer(gpu, 65536, micromapInputUsage(gpu) | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    return (buffer.address() + 255) / 256 * 256;
}

enum class Memory { Wild, Freed };
template <Memory memory>
VkDeviceAddress invalidAddress(Gpu &gpu)
{
    return memory == Memory::Wild ? kWild : freedAddress(gpu);
}

// A build of a micromap, of which one address has been changed.
template <auto member, Memory memory>
void micromapInput(Gpu &gpu, bool wrong)
{
    const Micromap micromap(gpu, oneTriangle());
    VkMicromapBuildInfoEXT info = micromap.buildInfo();
    if (wrong)
        (info.*member).deviceAddress = invalidAddress<memory>(gpu);
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) {
        recordMicromapBuilds(gpu, commands, std::array{MicromapBuild{info, micromap.handle()}});
    });
}

Geometry indexedTriangle()
{
    return {.vertices = triangleRow(1),
            .indices = {0, 1, 2},
            .indexType = VK_INDEX_TYPE_UINT32,
            .transform = VkTransformMatrixKHR{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}}};
}

template <auto change, By by, Memory memory = Memory::Wild>
void triangles(Gpu &gpu, bool wrong)
{
    const Blas blas(gpu, {indexedTriangle()});
    Build build(gpu, blas);
    if (wrong)
        change(build) = invalidAddress<memory>(gpu);
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) { build.record(commands, by); });
}

template <By by>
void boxes(Gpu &gpu, bool wrong)
{
    const Blas blas(gpu, {Geometry{.boxes = {{0, 0, 0, 1, 1, 1}}}});
    Build build(gpu, blas);
    if (wrong)
        build.geometry.geometry.aabbs.data.deviceAddress = kWild;
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) { build.record(commands, by); });
}

template <By by>
void updateScratch(Gpu &gpu, bool wrong)
{
    constexpr auto kFlags = VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR;
    Blas blas(gpu, {indexedTriangle()}, kFlags);
    blas.prepare({indexedTriangle()}, kFlags, VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR);
    Build build(gpu, blas);
    if (wrong)
        build.info.scratchData.deviceAddress = kWild;
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) { build.record(commands, by); });
}

template <By by>
void instances(Gpu &gpu, bool wrong)
{
    const Blas blas(gpu, {indexedTriangle()});
    const Tlas tlas(gpu, {instance(blas, {}, 0)});
    Build build(gpu, tlas);
    if (wrong)
        build.geometry.geometry.instances.data.deviceAddress = kWild;
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) { build.record(commands, by); });
}

template <typename Attached, By by>
void attachedIndices(Gpu &gpu, bool wrong)
{
    Micromap micromap(gpu, oneTriangle());
    micromap.build();
    const Blas blas(
        gpu,
        {Geometry{.vertices = triangleRow(1),
                  .micromap = Attachment{.micromap = &micromap, .indexType = VK_INDEX_TYPE_UINT32, .indices = {0}}}});
    Build build(gpu, blas);
    auto attached = *static_cast<const Attached *>(build.geometry.geometry.triangles.pNext);
    build.geometry.geometry.triangles.pNext = &attached;
    if (wrong) {
        if constexpr (requires { attached.indexBuffer.deviceAddress; })
            attached.indexBuffer.deviceAddress = kWild;
        else
            attached.indexBuffer = kWild;
    }
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) { build.record(commands, by); });
}

// The buffer of the data is destroyed before the build is executed; its memory is not.
void dataIsDestroyed(Gpu &gpu, bool wrong)
{
    const Micromap micromap(gpu, oneTriangle());
    VkMicromapBuildInfoEXT info = micromap.buildInfo();
    const auto creation = vkInit<VkBufferCreateInfo>({.size = 4096, .usage = micromapInputUsage(gpu)});
    VkBuffer buffer = VK_NULL_HANDLE;
    VT_CHECK(vkCreateBuffer(gpu.device(), &creation, nullptr, &buffer));
    const VkDeviceMemory memory = gpu.bindMemory(buffer, VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT);
    const auto addressInfo = vkInit<VkBufferDeviceAddressInfo>({.buffer = buffer});
    info.data.deviceAddress = (vkGetBufferDeviceAddress(gpu.device(), &addressInfo) + 255) / 256 * 256;
    const VkCommandBuffer commands = gpu.begin();
    recordMicromapBuilds(gpu, commands, std::array{MicromapBuild{info, micromap.handle()}});
    gpu.end(commands);
    if (wrong)
        vkDestroyBuffer(gpu.device(), buffer, nullptr);
    gpu.execute(commands);
    vkFreeCommandBuffers(gpu.device(), gpu.pool(), 1, &commands);
    if (!wrong)
        vkDestroyBuffer(gpu.device(), buffer, nullptr);
    vkFreeMemory(gpu.device(), memory, nullptr);
}

// The memory of the data is freed before the build is recorded; the buffer is not.
void memoryIsFreed(Gpu &gpu, bool wrong)
{
    const Micromap micromap(gpu, oneTriangle());
    VkMicromapBuildInfoEXT info = micromap.buildInfo();
    const auto creation = vkInit<VkBufferCreateInfo>({.size = 4096, .usage = micromapInputUsage(gpu)});
    VkBuffer buffer = VK_NULL_HANDLE;
    VT_CHECK(vkCreateBuffer(gpu.device(), &creation, nullptr, &buffer));
    const VkDeviceMemory memory = gpu.bindMemory(buffer, VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT);
    const auto addressInfo = vkInit<VkBufferDeviceAddressInfo>({.buffer = buffer});
    info.data.deviceAddress = (vkGetBufferDeviceAddress(gpu.device(), &addressInfo) + 255) / 256 * 256;
    if (wrong)
        vkFreeMemory(gpu.device(), memory, nullptr);
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) {
        recordMicromapBuilds(gpu, commands, std::array{MicromapBuild{info, micromap.handle()}});
    });
    vkDestroyBuffer(gpu.device(), buffer, nullptr);
    if (!wrong)
        vkFreeMemory(gpu.device(), memory, nullptr);
}

// --- Objects ---

// A micromap, and its neighbour that was destroyed.
struct Destroyed {
    explicit Destroyed(Gpu &gpu) : micromap(gpu, oneTriangle()), memory(gpu), handle(memory.create(0, micromap.size()))
    {
        micromap.build();
        memory.destroy(handle);
    }
    [[nodiscard]] MicromapHandle of(bool wrong) const { return wrong ? handle : micromap.handle(); }
    Micromap micromap;
    SharedMemory memory;
    MicromapHandle handle;
};

void target(Gpu &gpu, bool wrong)
{
    const Destroyed destroyed(gpu);
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) {
        recordMicromapBuilds(gpu, commands,
                             std::array{MicromapBuild{destroyed.micromap.buildInfo(), destroyed.of(wrong)}});
    });
}

// The copy's target is made first: another object may get the handle of the one that is destroyed.
void source(Gpu &gpu, bool wrong)
{
    const Micromap like(gpu, oneTriangle());
    const Micromap copy(gpu, like, like.size());
    const Destroyed destroyed(gpu);
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) {
        recordMicromapCopy(gpu, commands, destroyed.of(wrong), copy.handle(), VK_COPY_MICROMAP_MODE_CLONE_EXT);
    });
}

void targetOfCopy(Gpu &gpu, bool wrong)
{
    Micromap original(gpu, oneTriangle());
    original.build();
    const Destroyed destroyed(gpu);
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) {
        recordMicromapCopy(gpu, commands, original.handle(), destroyed.of(wrong), VK_COPY_MICROMAP_MODE_CLONE_EXT);
    });
}

// A structure of another type is built.
void buildAt(Gpu &gpu, const Structure &structure, VkAccelerationStructureKHR target, bool wrong, By by)
{
    Build build(gpu, structure, by);
    if (wrong)
        build.info.dstAccelerationStructure = target;
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) { build.record(commands); });
}

template <By by>
void bottomAtDestroyed(Gpu &gpu, bool wrong)
{
    const Blas blas(gpu, {indexedTriangle()});
    const Destroyed destroyed(gpu);
    buildAt(gpu, blas, destroyed.handle.khr, wrong, by);
}

template <By by>
void bottomAtMicromap(Gpu &gpu, bool wrong)
{
    const Blas blas(gpu, {indexedTriangle()});
    const Micromap micromap(gpu, oneTriangle());
    buildAt(gpu, blas, micromap.handle().khr, wrong, by);
}

template <By by>
void topAtMicromap(Gpu &gpu, bool wrong)
{
    const Blas blas(gpu, {indexedTriangle()});
    const Tlas tlas(gpu, {instance(blas, {}, 0)});
    const Micromap micromap(gpu, oneTriangle());
    buildAt(gpu, tlas, micromap.handle().khr, wrong, by);
}

template <typename Attached>
void attached(Gpu &gpu, bool wrong)
{
    const Destroyed destroyed(gpu);
    const Blas blas(
        gpu, {Geometry{.vertices = triangleRow(1),
                       .micromap = Attachment{
                           .micromap = &destroyed.micromap, .indexType = VK_INDEX_TYPE_UINT32, .indices = {0}}}});
    Build build(gpu, blas);
    auto given = *static_cast<const Attached *>(build.geometry.geometry.triangles.pNext);
    build.geometry.geometry.triangles.pNext = &given;
    if constexpr (std::is_same_v<decltype(given.micromap), VkMicromapEXT>)
        given.micromap = destroyed.of(wrong).ext;
    else
        given.micromap = destroyed.of(wrong).khr;
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) { build.record(commands); });
}

// --- References of instances ---

void buildWith(Gpu &gpu, VkAccelerationStructureInstanceKHR one, By by)
{
    Tlas tlas(gpu);
    tlas.prepare(std::array{one});
    const Build build(gpu, tlas);
    gpu.submit([&](VkCommandBuffer commands) { build.record(commands, by); });
}

template <By by>
void referencesMicromap(Gpu &gpu, bool wrong)
{
    Micromap micromap(gpu, oneTriangle());
    micromap.build();
    const Blas blas(gpu, {indexedTriangle()});
    VkAccelerationStructureInstanceKHR one = instance(blas, {}, 0);
    const auto info =
        vkInit<VkAccelerationStructureDeviceAddressInfoKHR>({.accelerationStructure = micromap.handle().khr});
    const VkDeviceAddress reference = gpu.vk().GetAccelerationStructureDeviceAddressKHR(gpu.device(), &info);
    if (wrong)
        one.accelerationStructureReference = reference;
    buildWith(gpu, one, by);
}

void referencesTopLevel(Gpu &gpu, bool wrong)
{
    const Blas blas(gpu, {indexedTriangle()});
    const Tlas tlas(gpu, {instance(blas, {}, 0)});
    buildWith(gpu, instance(wrong ? static_cast<const Structure &>(tlas) : blas, {}, 0), By::Host);
}

void referencesDestroyed(Gpu &gpu, bool wrong)
{
    const Blas kept(gpu, {indexedTriangle()});
    std::optional<Blas> blas;
    blas.emplace(gpu, std::vector{indexedTriangle()});
    const VkAccelerationStructureInstanceKHR one = instance(wrong ? *blas : kept, {}, 0);
    blas.reset();
    buildWith(gpu, one, By::Host);
}

// Memory of zeros, which contains no structure.
void referencesNothing(Gpu &gpu, bool wrong)
{
    const Blas blas(gpu, {indexedTriangle()});
    const Buffer zeros(gpu, 65536, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    VkAccelerationStructureInstanceKHR one = instance(blas, {}, 0);
    if (wrong)
        one.accelerationStructureReference = zeros.address();
    buildWith(gpu, one, By::Host);
}

// --- Memory that is freed, and objects that are destroyed before rays are traced ---

// With VK_KHR_opacity_micromap the micromap is created by its address, without its buffer.
enum class Loss { Buffer, Memory };
template <Loss loss>
void targetLosesMemory(Gpu &gpu, bool wrong)
{
    const Micromap like(gpu, oneTriangle());
    Storage storage(gpu);
    const MicromapHandle micromap = createMicromap(gpu, storage.buffer(), storage.address(), 0, like.size());
    if (wrong)
        loss == Loss::Buffer ? storage.destroyBuffer() : storage.freeMemory();
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) {
        recordMicromapBuilds(gpu, commands, std::array{MicromapBuild{like.buildInfo(), micromap}});
    });
    destroyMicromap(gpu, micromap);
}

// A command by address, whose buffer is destroyed before it is executed. Its memory is not.
template <auto record>
void destroyedData(Gpu &gpu, bool wrong)
{
    Micromap micromap(gpu, oneTriangle());
    micromap.build();
    Storage storage(gpu);
    const VkDeviceAddress address = (storage.address() + 255) / 256 * 256;
    const VkCommandBuffer commands = gpu.begin();
    record(gpu, commands, address, micromap.handle());
    gpu.end(commands);
    if (wrong)
        storage.destroyBuffer();
    gpu.execute(commands);
    vkFreeCommandBuffers(gpu.device(), gpu.pool(), 1, &commands);
}
void fill(Gpu &gpu, VkCommandBuffer commands, VkDeviceAddress address, const MicromapHandle &)
{
    const VkDeviceAddressRangeKHR range{address, 64};
    gpu.vk().CmdFillMemoryKHR(commands, &range, VK_ADDRESS_COMMAND_UNKNOWN_STORAGE_BUFFER_USAGE_BIT_KHR, 0);
}
void save(Gpu &gpu, VkCommandBuffer commands, VkDeviceAddress address, const MicromapHandle &micromap)
{
    recordMicromapToMemory(gpu, commands, micromap, address);
}

std::vector<Ray> oneRay()
{
    return {Ray{.origin = {0.3f, 0.3f, 1}}};
}

// A structure is destroyed, or its buffer is, while a top-level structure names it. In the right program that is built
// again.
enum class Lost { Structure, Buffer };
template <Lost what>
void tracesDestroyed(Gpu &gpu, bool wrong)
{
    Storage storage(gpu);
    const Blas kept(gpu, {indexedTriangle()});
    std::optional<Blas> blas;
    blas.emplace(gpu);
    blas->placeIn(storage.buffer(), 0);
    blas->build({indexedTriangle()});
    Tlas tlas(gpu, {instance(kept, {}, 0), instance(*blas, {2, 0, 0}, 0)});
    if (what == Lost::Structure)
        blas.reset();
    else
        storage.destroyBuffer();
    if (!wrong)
        tlas.build(std::array{instance(kept, {}, 0), instance(kept, {2, 0, 0}, 0)});
    Tracer(gpu).trace(tlas, oneRay());
}

// Rays can meet the instance of a destroyed structure, unless their cull mask excludes it. `before`: rays that cannot
// have been traced before.
template <bool before>
void tracesWithMask(Gpu &gpu, bool wrong)
{
    const Storage storage(gpu);
    const Blas kept(gpu, {indexedTriangle()});
    std::optional<Blas> blas;
    blas.emplace(gpu);
    blas->placeIn(storage.buffer(), 0);
    blas->build({indexedTriangle()});
    const uint32_t mask = wrong && !before ? 0x3 : 0xfe;
    const Tlas tlas(gpu, {instance(kept, {}, 0), instance(*blas, {2, 0, 0}, 0, 0, mask)});
    blas.reset();
    std::vector<Ray> rays = oneRay();
    rays[0].cullMask = 1;
    Tracer(gpu, tracer_mask_1).trace(tlas, rays);
    if (wrong && before)
        Tracer(gpu).trace(tlas, oneRay());
}

// The structure in the descriptor is destroyed after the command was recorded.
void tracesInDestroyed(Gpu &gpu, bool wrong)
{
    const Storage storage(gpu);
    const Blas blas(gpu, {indexedTriangle()});
    std::optional<Tlas> tlas;
    tlas.emplace(gpu);
    tlas->placeIn(storage.buffer(), 0);
    tlas->build(std::array{instance(blas, {}, 0)});
    Tracer tracer(gpu);
    tracer.prepare(*tlas, oneRay());
    const VkCommandBuffer commands = gpu.begin();
    tracer.bind(commands);
    tracer.dispatch(commands);
    gpu.end(commands);
    if (wrong)
        tlas.reset();
    gpu.execute(commands);
    vkFreeCommandBuffers(gpu.device(), gpu.pool(), 1, &commands);
}

// The micromap of a geometry is destroyed, which "the application must not" do "until ray traversal has concluded"
// (VkMicromapBuildSizesInfoEXT::discardable).
template <typename Attached>
void tracesWithDestroyedMicromap(Gpu &gpu, bool wrong)
{
    Micromap like(gpu, oneTriangle());
    like.build();
    SharedMemory memory(gpu);
    const MicromapHandle micromap = memory.create(0, like.size());
    const Blas blas(
        gpu, {Geometry{.vertices = triangleRow(1),
                       .micromap = Attachment{.micromap = &like, .indexType = VK_INDEX_TYPE_UINT32, .indices = {0}}}});
    Build build(gpu, blas);
    auto given = *static_cast<const Attached *>(build.geometry.geometry.triangles.pNext);
    build.geometry.geometry.triangles.pNext = &given;
    if constexpr (std::is_same_v<decltype(given.micromap), VkMicromapEXT>)
        given.micromap = micromap.ext;
    else
        given.micromap = micromap.khr;
    gpu.submit([&](VkCommandBuffer commands) {
        recordMicromapBuilds(gpu, commands, std::array{MicromapBuild{like.buildInfo(), micromap}});
    });
    gpu.submit([&](VkCommandBuffer commands) { build.record(commands); });
    const Tlas tlas(gpu, {instance(blas, {}, 0)});
    if (wrong)
        memory.destroy(micromap);
    Tracer(gpu).trace(tlas, oneRay());
}

// Another micromap is built in the memory of one that a geometry uses.
void tracesOverwrittenMicromap(Gpu &gpu, bool wrong)
{
    const Twins twins(gpu);
    Micromap like(gpu, oneTriangle());
    like.build();
    const Blas blas(
        gpu, {Geometry{.vertices = triangleRow(1),
                       .micromap = Attachment{.micromap = &like, .indexType = VK_INDEX_TYPE_UINT32, .indices = {0}}}});
    Build build(gpu, blas);
    auto given = *static_cast<const KhrAttached *>(build.geometry.geometry.triangles.pNext);
    build.geometry.geometry.triangles.pNext = &given;
    given.micromap = twins.built.khr;
    gpu.submit([&](VkCommandBuffer commands) { build.record(commands); });
    const Tlas tlas(gpu, {instance(blas, {}, 0)});
    const auto rebuild = [&](const MicromapHandle &target) {
        gpu.submit([&](VkCommandBuffer commands) {
            recordMicromapBuilds(gpu, commands, std::array{MicromapBuild{like.buildInfo(), target}});
        });
    };
    rebuild(twins.other);
    if (!wrong) {
        rebuild(twins.built);
        gpu.submit([&](VkCommandBuffer commands) { build.record(commands); });
    }
    Tracer(gpu).trace(tlas, oneRay());
}

// Structures that were not built.
void tracesInUnbuilt(Gpu &gpu, bool wrong)
{
    const Blas blas(gpu, {indexedTriangle()});
    const Tlas built(gpu, {instance(blas, {}, 0)});
    Tlas other(gpu);
    other.create(built.size());
    Tracer(gpu).trace(wrong ? other : built, oneRay());
}
void tracesUnbuiltInstance(Gpu &gpu, bool wrong)
{
    const Blas built(gpu, {indexedTriangle()});
    Blas other(gpu);
    other.create(built.size());
    const Tlas tlas(gpu, {instance(wrong ? other : built, {}, 0)});
    Tracer(gpu).trace(tlas, oneRay());
}
void copiesUnbuilt(Gpu &gpu, bool wrong)
{
    const Blas built(gpu, {indexedTriangle()});
    // Zeros: lavapipe 26 copies as many bytes as the source says that it has.
    const Buffer zeros(gpu, built.size(), gpu.structureUsage());
    Blas other(gpu), target(gpu);
    other.placeIn(zeros.handle(), 0);
    other.create(built.size());
    target.create(built.size());
    const auto info =
        vkInit<VkCopyAccelerationStructureInfoKHR>({.src = (wrong ? other : built).handle(),
                                                    .dst = target.handle(),
                                                    .mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR});
    gpu.submit([&](VkCommandBuffer commands) { gpu.vk().CmdCopyAccelerationStructureKHR(commands, &info); });
}

// A micromap is destroyed after its build was recorded.
template <bool submit2>
void targetIsDestroyed(Gpu &gpu, bool wrong)
{
    const Micromap like(gpu, oneTriangle());
    SharedMemory memory(gpu);
    const MicromapHandle micromap = memory.create(0, like.size());
    const VkCommandBuffer commands = gpu.begin();
    recordMicromapBuilds(gpu, commands, std::array{MicromapBuild{like.buildInfo(), micromap}});
    gpu.end(commands);
    if (wrong)
        memory.destroy(micromap);
    if (submit2) {
        const auto info = vkInit<VkCommandBufferSubmitInfo>({.commandBuffer = commands});
        const auto submit = vkInit<VkSubmitInfo2>({.commandBufferInfoCount = 1, .pCommandBufferInfos = &info});
        VT_CHECK(vkQueueSubmit2(gpu.queue(), 1, &submit, VK_NULL_HANDLE));
        VT_CHECK(vkQueueWaitIdle(gpu.queue()));
    } else {
        gpu.execute(commands);
    }
    vkFreeCommandBuffers(gpu.device(), gpu.pool(), 1, &commands);
}

// --- Usage and alignment of addresses ---

template <By by>
void withoutUsage(Gpu &gpu, bool wrong)
{
    const Blas blas(gpu, {indexedTriangle()});
    Build build(gpu, blas);
    const Buffer vertices(gpu, 65536,
                          VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT |
                              (wrong ? VK_BUFFER_USAGE_STORAGE_BUFFER_BIT
                                     : VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR));
    build.geometry.geometry.triangles.vertexData.deviceAddress = vertices.address();
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) { build.record(commands, by); });
}

template <By by, Arrangement arrangement>
void misalignedInstances(Gpu &gpu, bool wrong)
{
    const Blas blas(gpu, {indexedTriangle()});
    Tlas tlas(gpu);
    tlas.build(std::array{instance(blas, {}, 0), instance(blas, {}, 0)}, 0,
               VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR, arrangement);
    Build build(gpu, tlas);
    if (wrong)
        build.geometry.geometry.instances.data.deviceAddress += arrangement == Arrangement::Array ? 8 : 4;
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) { build.record(commands, by); });
}

template <By by>
void misalignedPointer(Gpu &gpu, bool wrong)
{
    const Blas blas(gpu, {indexedTriangle()});
    const std::array instances{instance(blas, {}, 0), instance(blas, {}, 1)};
    Tlas tlas(gpu);
    tlas.build(instances, 0, VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR, Arrangement::Pointers);
    constexpr VkBufferUsageFlags kInput = VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR;
    const size_t second = sizeof instances[0] + (wrong ? 8 : 16);
    std::vector<std::byte> bytes(second + sizeof instances[1]);
    std::memcpy(bytes.data(), &instances[0], sizeof instances[0]);
    std::memcpy(bytes.data() + second, &instances[1], sizeof instances[1]);
    const Buffer data = gpu.upload(std::span<const std::byte>(bytes), kInput);
    const std::array pointers{data.address(), data.address() + second};
    const Buffer array = gpu.upload(std::span<const VkDeviceAddress>(pointers), kInput);
    Build build(gpu, tlas);
    build.geometry.geometry.instances.data.deviceAddress = array.address();
    gpu.submit([&](VkCommandBuffer commands) { build.record(commands, by); });
}

// Pointers to instances with motion have their type in the low bits (VK_NV_ray_tracing_motion_blur). The instance is
// all zeros, which names no structure.
void motionInstance(Gpu &gpu, bool wrong)
{
    constexpr VkBufferUsageFlags kInput = VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR;
    const Blas blas(gpu, {indexedTriangle()});
    Tlas tlas(gpu);
    tlas.build(std::array{instance(blas, {}, 0)}, 0, VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR,
               Arrangement::Pointers);
    const std::array<std::byte, 256> zeros{};
    const Buffer data = gpu.upload(std::span<const std::byte>(zeros), kInput);
    const std::array pointers{data.address() | VK_ACCELERATION_STRUCTURE_MOTION_INSTANCE_TYPE_MATRIX_MOTION_NV};
    const Buffer array = gpu.upload(std::span<const VkDeviceAddress>(pointers), kInput);
    Build build(gpu, tlas);
    build.info.flags |= wrong ? 0 : VK_BUILD_ACCELERATION_STRUCTURE_MOTION_BIT_NV;
    build.geometry.geometry.instances.data.deviceAddress = array.address();
    gpu.submit([&](VkCommandBuffer commands) { build.record(commands); });
}

// --- Updates of structures that were built otherwise ---

enum class Other { Flags, Geometries, Primitives, Allowed, Built };
template <Other other, By by = By::Host>
void updatesOther(Gpu &gpu, bool wrong)
{
    constexpr VkFlags kUpdatable = VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR;
    const Geometry two{.vertices = triangleRow(2)};
    const std::vector<Geometry> geometries{two, two};
    Blas blas(gpu), unbuilt(gpu);
    blas.build(geometries, wrong && other == Other::Allowed ? 0 : kUpdatable);
    blas.prepare(geometries, kUpdatable, VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR);
    unbuilt.create(blas.size());
    VkAccelerationStructureBuildGeometryInfoKHR info = blas.buildInfo();
    std::vector<VkAccelerationStructureBuildRangeInfoKHR> ranges(blas.ranges(), blas.ranges() + 2);
    if (wrong && other == Other::Flags)
        info.flags |= VK_BUILD_ACCELERATION_STRUCTURE_LOW_MEMORY_BIT_KHR;
    if (wrong && other == Other::Geometries)
        info.geometryCount = 1;
    if (wrong && other == Other::Primitives)
        ranges[1].primitiveCount = 1;
    if (wrong && other == Other::Built)
        info.srcAccelerationStructure = info.dstAccelerationStructure = unbuilt.handle();
    const Buffer memory(gpu, sizeof(ranges[0]) * 2,
                        VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    std::memcpy(memory.bytes(), ranges.data(), sizeof(ranges[0]) * 2);
    gpu.submit([&](VkCommandBuffer commands) {
        const VkAccelerationStructureBuildRangeInfoKHR *direct = ranges.data();
        const VkDeviceAddress address = memory.address();
        const uint32_t stride = sizeof(ranges[0]), most[] = {2, 2}, *counts = most;
        if (by == By::Host)
            gpu.vk().CmdBuildAccelerationStructuresKHR(commands, 1, &info, &direct);
        else
            gpu.vk().CmdBuildAccelerationStructuresIndirectKHR(commands, 1, &info, &address, &stride, &counts);
    });
}

#define ADDRESS(member) [](Build &build) -> VkDeviceAddress & { return build.member.deviceAddress; }
#define VERTICES ADDRESS(geometry.geometry.triangles.vertexData)
#define INDICES ADDRESS(geometry.geometry.triangles.indexData)
#define TRANSFORM ADDRESS(geometry.geometry.triangles.transformData)
#define SCRATCH ADDRESS(info.scratchData)

constexpr auto kData = &VkMicromapBuildInfoEXT::data;
constexpr auto kTriangles = &VkMicromapBuildInfoEXT::triangleArray;
constexpr auto kScratch = &VkMicromapBuildInfoEXT::scratchData;

const WrongProgram kPrograms[] = {
    {"VUID-vkCmdBuildMicromapsEXT-pInfos-10896", Api::Ext, kNeedsNothing, micromapInput<kData, Memory::Wild>, "Wild"},
    {"VUID-vkCmdBuildMicromapsEXT-pInfos-10896", Api::Ext, kNeedsNothing, micromapInput<kData, Memory::Freed>, "Freed"},
    {"VUID-vkCmdBuildMicromapsEXT-pInfos-10896", Api::Ext, kNeedsNothing, dataIsDestroyed, "Destroyed"},
    {"VUID-vkCmdBuildMicromapsEXT-pInfos-10896", Api::Ext, kNeedsNothing, memoryIsFreed, "MemoryFreed"},
    {"VUID-vkCmdBuildMicromapsEXT-pInfos-10897", Api::Ext, kNeedsNothing, micromapInput<kTriangles, Memory::Wild>,
     "Wild"},
    {"VUID-vkCmdBuildMicromapsEXT-pInfos-07512", Api::Ext, kNeedsNothing, micromapInput<kScratch, Memory::Wild>,
     "Wild"},
    {"VUID-vkCmdBuildMicromapsEXT-pInfos-07512", Api::Ext, kNeedsNothing, micromapInput<kScratch, Memory::Freed>,
     "Freed"},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11550", Api::Khr, kNeedsNothing,
     micromapInput<kData, Memory::Wild>, "Wild"},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11550", Api::Khr, kNeedsNothing,
     micromapInput<kTriangles, Memory::Freed>, "Freed"},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11550", Api::Khr, kNeedsNothing, dataIsDestroyed, "Destroyed"},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-12261", Api::Khr, kNeedsNothing,
     micromapInput<kScratch, Memory::Wild>, "Wild"},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03804", Api::Khr, kNeedsNothing, triangles<VERTICES, By::Host>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03804", Api::Khr, kNeedsNothing,
     triangles<VERTICES, By::Host, Memory::Freed>, "Freed"},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03804", Api::Ext, kNeedsNothing, triangles<VERTICES, By::Host>,
     "Ext"},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03806", Api::Khr, kNeedsNothing, triangles<INDICES, By::Host>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03808", Api::Khr, kNeedsNothing, triangles<TRANSFORM, By::Host>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-12261", Api::Khr, kNeedsNothing, triangles<SCRATCH, By::Host>,
     "Bottom"},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-12260", Api::Khr, kNeedsNothing, updateScratch<By::Host>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03811", Api::Khr, kNeedsNothing, boxes<By::Host>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03813", Api::Khr, kNeedsNothing, instances<By::Host>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-03804", Api::Khr, kNeedsNothing,
     triangles<VERTICES, By::Indirect>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-03806", Api::Khr, kNeedsNothing,
     triangles<INDICES, By::Indirect>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-03808", Api::Khr, kNeedsNothing,
     triangles<TRANSFORM, By::Indirect>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-12261", Api::Khr, kNeedsNothing,
     triangles<SCRATCH, By::Indirect>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-12260", Api::Khr, kNeedsNothing,
     updateScratch<By::Indirect>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-03811", Api::Khr, kNeedsNothing, boxes<By::Indirect>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-03813", Api::Khr, kNeedsNothing, instances<By::Indirect>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-10905", Api::Ext, kNeedsNothing,
     attachedIndices<ExtAttached, By::Host>, "Wild"},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-10905", Api::Ext, kNeedsNothing,
     attachedIndices<ExtAttached, By::Indirect>, "Wild"},
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapKHR-indexBuffer-11572", Api::Khr, kNeedsNothing,
     attachedIndices<KhrAttached, By::Host>, "Wild"},

    // Drivers do not know the handles any more.
    {"VUID-vkCmdBuildMicromapsEXT-dstMicromap-07463", Api::Ext, kNeedsEmulation, target, "Destroyed"},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-03800", Api::Khr, kNeedsNothing, target,
     "Destroyed"},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-03800", Api::Khr, kNeedsEmulation,
     bottomAtDestroyed<By::Host>, "Bottom"},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-dstAccelerationStructure-03800", Api::Khr, kNeedsEmulation,
     bottomAtDestroyed<By::Indirect>, "Bottom"},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03699", Api::Khr, kNeedsEmulation, topAtMicromap<By::Host>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-03699", Api::Khr, kNeedsEmulation,
     topAtMicromap<By::Indirect>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03700", Api::Khr, kNeedsEmulation, bottomAtMicromap<By::Host>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-03700", Api::Khr, kNeedsEmulation,
     bottomAtMicromap<By::Indirect>},
    {"VUID-VkCopyMicromapInfoEXT-src-parameter", Api::Ext, kNeedsEmulation, source, "Destroyed"},
    {"VUID-VkCopyMicromapInfoEXT-dst-parameter", Api::Ext, kNeedsEmulation, targetOfCopy, "Destroyed"},
    {"VUID-VkCopyAccelerationStructureInfoKHR-src-parameter", Api::Khr, kNeedsNothing, source, "Destroyed"},
    {"VUID-VkCopyAccelerationStructureInfoKHR-dst-parameter", Api::Khr, kNeedsNothing, targetOfCopy, "Destroyed"},
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapEXT-micromap-parameter", Api::Ext, kNeedsEmulation,
     attached<ExtAttached>, "Destroyed"},
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapKHR-micromap-parameter", Api::Khr, kNeedsNothing,
     attached<KhrAttached>, "Destroyed"},

    {"VUID-vkCmdBuildAccelerationStructuresKHR-geometry-03673", Api::Khr, kNeedsNothing, withoutUsage<By::Host>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-geometry-03673", Api::Khr, kNeedsNothing,
     withoutUsage<By::Indirect>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03715", Api::Khr, kNeedsNothing,
     misalignedInstances<By::Host, Arrangement::Array>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03716", Api::Khr, kNeedsNothing,
     misalignedInstances<By::Host, Arrangement::Pointers>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03717", Api::Khr, kNeedsNothing, misalignedPointer<By::Host>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03717", Api::Ext, kNeedsNothing, motionInstance, "Motion"},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-03717", Api::Khr, kNeedsNothing,
     misalignedPointer<By::Indirect>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-03715", Api::Khr, kNeedsNothing,
     misalignedInstances<By::Indirect, Arrangement::Array>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-03716", Api::Khr, kNeedsNothing,
     misalignedInstances<By::Indirect, Arrangement::Pointers>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03667", Api::Khr, kNeedsNothing, updatesOther<Other::Allowed>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03667", Api::Ext, kNeedsNothing, updatesOther<Other::Built>,
     "Unbuilt"},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03758", Api::Khr, kNeedsNothing, updatesOther<Other::Geometries>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03759", Api::Khr, kNeedsNothing, updatesOther<Other::Flags>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-primitiveCount-03769", Api::Khr, kNeedsNothing,
     updatesOther<Other::Primitives>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-03667", Api::Khr, kNeedsNothing,
     updatesOther<Other::Allowed, By::Indirect>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-03758", Api::Khr, kNeedsNothing,
     updatesOther<Other::Geometries, By::Indirect>},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-03759", Api::Khr, kNeedsNothing,
     updatesOther<Other::Flags, By::Indirect>},

    // A driver would read wild memory.
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-12281", Api::Khr, kNeedsEmulation, referencesMicromap<By::Host>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-12281", Api::Khr, kNeedsEmulation, referencesTopLevel,
     "TopLevel"},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-12281", Api::Ext, kNeedsEmulation, referencesDestroyed,
     "Destroyed"},
    {"VUID-vkCmdBuildAccelerationStructuresIndirectKHR-pInfos-12281", Api::Khr, kNeedsEmulation,
     referencesMicromap<By::Indirect>},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-12281", Api::Ext, kNeedsEmulation, referencesNothing, "Nothing"},

    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03707", Api::Khr, kNeedsNothing, targetLosesMemory<Loss::Buffer>,
     "BufferDestroyed"},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03707", Api::Khr, kNeedsNothing, targetLosesMemory<Loss::Memory>,
     "MemoryFreed"},
    {"VUID-vkCmdBuildMicromapsEXT-pInfos-07508", Api::Ext, kNeedsNothing, targetLosesMemory<Loss::Memory>,
     "MemoryFreed"},
    {"VUID-VkDeviceAddressRangeKHR-address-11365", Api::Khr, kNeedsAddressCommands, destroyedData<fill>,
     "DestroyedLater"},
    // With "ext" the mock driver writes into the buffer by its handle.
    {"VUID-vkCmdCopyMicromapToMemoryEXT-pInfo-07536", Api::Ext, kNeedsNothing, destroyedData<save>, "Destroyed", "",
     false, "ext"},
    {"VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-03739", Api::Khr, kNeedsNothing, destroyedData<save>,
     "Destroyed", "", false, "ext"},
    {"trace-invalid-structure", Api::Ext, kNeedsNothing, tracesDestroyed<Lost::Structure>, "Structure"},
    {"trace-invalid-structure", Api::Khr, kNeedsNothing, tracesDestroyed<Lost::Buffer>, "Buffer"},
    {"trace-invalid-structure", Api::Ext, kNeedsNothing, tracesWithMask<false>, "Mask"},
    {"trace-invalid-structure", Api::Ext, kNeedsNothing, tracesWithMask<true>, "MaskBefore"},
    {"trace-invalid-structure", Api::Khr, kNeedsNothing, tracesInDestroyed, "TopLevel"},
    {"trace-invalid-structure", Api::Khr, kNeedsNothing, tracesOverwrittenMicromap, "Overwritten"},
    {"trace-invalid-structure", Api::Khr, kNeedsNothing, tracesInUnbuilt, "Unbuilt"},
    {"trace-invalid-structure", Api::Ext, kNeedsNothing, tracesUnbuiltInstance, "UnbuiltInstance"},
    {"VUID-vkCmdCopyAccelerationStructureKHR-src-11633", Api::Ext, kNeedsNothing, copiesUnbuilt, "Bottom"},
    {"VUID-vkQueueSubmit-pCommandBuffers-00070", Api::Khr, kNeedsNothing, targetIsDestroyed<false>},
    {"VUID-vkQueueSubmit2-commandBuffer-03874", Api::Khr, kNeedsNothing, targetIsDestroyed<true>},
    {"trace-invalid-structure", Api::Ext, kNeedsEmulation, tracesWithDestroyedMicromap<ExtAttached>, "MicromapExt"},
    {"trace-invalid-structure", Api::Khr, kNeedsNothing, tracesWithDestroyedMicromap<KhrAttached>, "Micromap"},
};

#undef ADDRESS
#undef VERTICES
#undef INDICES
#undef TRANSFORM
#undef SCRATCH

} // namespace

std::span<const WrongProgram> lifetimePrograms()
{
    return kPrograms;
}

} // namespace vt
