// SPDX-License-Identifier: Apache-2.0
#include "check/oracle/packed_scene.h"

#include <array>
#include <cstring>
#include <thread>

namespace vellum::check::oracle
{
namespace
{

constexpr size_t kThreads = 3;
constexpr VkBufferUsageFlags kSerializedUsage =
    VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;
constexpr VkDeviceSize kHeaderSize = 40; // where the header of serialized data tells the size to deserialize to

VkBuildAccelerationStructureFlagsKHR bottomFlags(const Device &gpu)
{
    return structureFlags(gpu) | VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR |
           VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR |
           VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_UPDATE_EXT;
}

// A command buffer of a thread's own.
class Recording
{
public:
    explicit Recording(Device &gpu) : gpu_(gpu)
    {
        const auto pool = vkInit<VkCommandPoolCreateInfo>({.queueFamilyIndex = gpu.family()});
        CHECK_VK(vkCreateCommandPool(gpu.device(), &pool, nullptr, &pool_));
        auto allocation = vkInit<VkCommandBufferAllocateInfo>(
            {.commandPool = pool_, .level = VK_COMMAND_BUFFER_LEVEL_PRIMARY, .commandBufferCount = 1});
        CHECK_VK(vkAllocateCommandBuffers(gpu.device(), &allocation, &commands_));
        auto info = vkInit<VkCommandBufferBeginInfo>({.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT});
        CHECK_VK(vkBeginCommandBuffer(commands_, &info));
    }
    Recording(const Recording &) = delete;
    Recording &operator=(const Recording &) = delete;
    ~Recording() { vkDestroyCommandPool(gpu_.device(), pool_, nullptr); }
    [[nodiscard]] VkCommandBuffer commands() const { return commands_; }
    void submit(VkQueue queue) const
    {
        auto submission = vkInit<VkSubmitInfo>({.commandBufferCount = 1, .pCommandBuffers = &commands_});
        CHECK_VK(vkQueueSubmit(queue, 1, &submission, VK_NULL_HANDLE));
    }

private:
    Device &gpu_;
    VkCommandPool pool_ = VK_NULL_HANDLE;
    VkCommandBuffer commands_ = VK_NULL_HANDLE;
};

// Every thread prepares and records its share of `count` builds, one after the other with the same scratch memory, in a
// command buffer of its own. They are then executed together, on as many queues as there are: nothing orders what one
// thread has recorded and another.
void buildOnThreads(Device &gpu, const std::string &what, size_t count,
                    const std::function<std::vector<Arena::Range>(size_t, VkCommandBuffer, SharedScratch &)> &record)
{
    std::vector<std::unique_ptr<Recording>> recordings(kThreads);
    std::array<std::vector<Arena::Range>, kThreads> written;
    std::array<std::thread, kThreads> threads;
    for (size_t t = 0; t < kThreads; ++t) {
        threads[t] = std::thread([&, t] {
            recordings[t] = std::make_unique<Recording>(gpu);
            SharedScratch scratch(gpu);
            for (size_t i = t; i < count; i += kThreads) {
                const auto writes = record(i, recordings[t]->commands(), scratch);
                written[t].insert(written[t].end(), writes.begin(), writes.end());
                barrier(recordings[t]->commands());
            }
            CHECK_VK(vkEndCommandBuffer(recordings[t]->commands()));
        });
    }
    for (std::thread &thread : threads)
        thread.join();
    std::vector<Arena::Range> writes;
    for (const auto &some : written)
        writes.insert(writes.end(), some.begin(), some.end());
    Arena::Snapshot before(*gpu.arena());
    for (size_t t = 0; t < kThreads; ++t)
        recordings[t]->submit(gpu.queues()[t % gpu.queues().size()]);
    CHECK_VK(vkDeviceWaitIdle(gpu.device()));
    before.expectOnlyChanged(writes, what);
}

} // namespace

PackedScene::PackedScene(Device &gpu, const Scene &scene, Random &random) : gpu_(gpu), scene_(scene), random_(random)
{
    buildEverything();
    buildTop();
}

void PackedScene::buildEverything()
{
    micromaps_.resize(scene_.micromaps.size());
    buildOnThreads(gpu_, "micromap builds", micromaps_.size(),
                   [&](size_t i, VkCommandBuffer commands, SharedScratch &scratch) {
                       const SceneMicromap &from = scene_.micromaps[i];
                       micromaps_[i] = std::make_unique<Micromap>(gpu_, inputOf(from), from.flags, &scratch);
                       micromaps_[i]->record(commands);
                       return Writes{micromaps_[i]->range(), micromaps_[i]->scratchRange()};
                   });
    for (const Object &object : scene_.objects)
        bottoms_.emplace_back().geometries = geometriesOf(object, micromaps_);
    // What micromaps were built from is garbage by now, and its room that of others.
    for (const auto &micromap : micromaps_)
        micromap->forgetInput();
    buildOnThreads(gpu_, "builds", bottoms_.size(), [&](size_t i, VkCommandBuffer commands, SharedScratch &scratch) {
        bottoms_[i].structure = std::make_unique<Blas>(gpu_);
        Blas &blas = *bottoms_[i].structure;
        blas.shareScratch(&scratch);
        blas.prepare(bottoms_[i].geometries, bottomFlags(gpu_));
        blas.shareScratch(nullptr);
        blas.record(commands);
        return Writes{blas.range(), blas.scratchRange()};
    });
    for (const Bottom &bottom : bottoms_)
        bottom.structure->forgetInput();
}

void PackedScene::run(const std::string &what, const Writes &writes, const Record &record)
{
    history_ += (history_.empty() ? "" : ", ") + what;
    Arena::Snapshot before(*gpu_.arena());
    gpu_.submit(record);
    before.expectOnlyChanged(writes, history_);
}

uint64_t PackedScene::asked(VkQueryType type, const std::function<void(VkCommandBuffer, VkQueryPool)> &ask)
{
    const QueryPool pool(gpu_, type);
    run("query", {}, [&](VkCommandBuffer commands) {
        vkCmdResetQueryPool(commands, pool, 0, 1);
        ask(commands, pool);
    });
    return pool.value();
}

VkDeviceSize PackedScene::sizeOf(const Structure &structure, VkQueryType type)
{
    const VkAccelerationStructureKHR handle = structure.handle();
    return asked(type, [&](VkCommandBuffer commands, VkQueryPool pool) {
        gpu_.vk().CmdWriteAccelerationStructuresPropertiesKHR(commands, 1, &handle, type, pool, 0);
    });
}

void PackedScene::change()
{
    for (size_t o = 0; o < bottoms_.size(); ++o)
        changeObject(o);
    buildTop();
    copyTop(below(4));
}

void PackedScene::changeObject(size_t object)
{
    Bottom &bottom = bottoms_[object];
    history_ += "; object " + std::to_string(object) + ":";
    switch (below(10)) {
    case 0: copyObject(bottom, VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR); break;
    case 1: copyObject(bottom, VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR); break;
    case 2:
        copyObject(bottom, VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR);
        buildObject(bottom, VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR);
        break;
    case 3: reloadObject(bottom); break;
    case 4: buildObject(bottom, VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR); break;
    case 5: buildObject(bottom, VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR); break;
    case 6: moveAndBuildOver(bottom, bottoms_[below(static_cast<uint32_t>(bottoms_.size()))]); break;
    case 7:
        renameObject(bottom);
        if (below(2) == 0)
            buildObject(bottom, VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR);
        else
            copyObject(bottom, VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR);
        break;
    default:
        changeMicromapOf(bottom, below(3));
        buildObject(bottom, below(2) == 0 ? VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR
                                          : VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR);
        break;
    }
}

// One micromap, if there are any, becomes a clone, a compacted one or a deserialized one. The old one is gone at once:
// nobody traces until the structure is built with the new one.
void PackedScene::changeMicromapOf(Bottom &bottom, uint32_t way)
{
    std::vector<Geometry *> with;
    for (Geometry &geometry : bottom.geometries) {
        if (geometry.micromap && geometry.micromap->micromap != nullptr)
            with.push_back(&geometry);
    }
    if (with.empty())
        return;
    const Attachment &attachment = *with[below(static_cast<uint32_t>(with.size()))]->micromap;
    size_t index = 0;
    while (micromaps_[index].get() != attachment.micromap)
        ++index;
    const Micromap &source = *micromaps_[index];
    const MicromapHandle handle = source.handle();
    const auto size = [&](VkQueryType type) {
        const VkQueryType own = micromapQueryType(gpu_, type);
        return asked(own, [&](VkCommandBuffer commands, VkQueryPool pool) {
            recordMicromapProperties(gpu_, commands, std::span(&handle, 1), own, pool, 0);
        });
    };
    std::unique_ptr<Micromap> target;
    if (way < 2) {
        const auto mode = way == 0 ? VK_COPY_MICROMAP_MODE_CLONE_EXT : VK_COPY_MICROMAP_MODE_COMPACT_EXT;
        target = std::make_unique<Micromap>(gpu_, source,
                                            way == 0 ? source.size() : size(VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT));
        run(way == 0 ? "micromap cloned" : "micromap compacted", {target->range()},
            [&](VkCommandBuffer commands) { recordMicromapCopy(gpu_, commands, handle, target->handle(), mode); });
    } else {
        const Guarded data(gpu_, size(VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT), 256, kSerializedUsage);
        run("micromap serialized", {data.range()},
            [&](VkCommandBuffer commands) { recordMicromapToMemory(gpu_, commands, handle, data.address()); });
        uint64_t bytes = 0;
        std::memcpy(&bytes, data.bytes() + kHeaderSize, sizeof bytes);
        target = std::make_unique<Micromap>(gpu_, source, bytes);
        run("micromap loaded", {target->range()}, [&](VkCommandBuffer commands) {
            recordMemoryToMicromap(gpu_, commands, data.address(), target->handle());
        });
    }
    for (Bottom &user : bottoms_) {
        for (Geometry &geometry : user.geometries) {
            if (geometry.micromap && geometry.micromap->micromap == micromaps_[index].get())
                geometry.micromap->micromap = target.get();
        }
    }
    micromaps_[index] = std::move(target);
    for (Bottom &user : bottoms_) {
        const bool uses = std::any_of(user.geometries.begin(), user.geometries.end(), [&](const Geometry &geometry) {
            return geometry.micromap && geometry.micromap->micromap == micromaps_[index].get();
        });
        if (uses && &user != &bottom)
            buildObject(user, VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR);
    }
}

void PackedScene::copyObject(Bottom &bottom, VkCopyAccelerationStructureModeKHR mode)
{
    const bool compact = mode == VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR;
    auto target = std::make_unique<Blas>(gpu_);
    target->create(sizeOf(*bottom.structure, compact ? VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR
                                                     : VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SIZE_KHR));
    run(compact ? "compacted" : "cloned", {target->range()}, [&](VkCommandBuffer commands) {
        recordCopy(gpu_, commands, bottom.structure->handle(), target->handle(), mode);
    });
    bottom.structure = std::move(target);
}

std::unique_ptr<Structure> PackedScene::reloaded(const Structure &source, std::unique_ptr<Structure> target)
{
    const Guarded data(gpu_, sizeOf(source, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR), 256,
                       kSerializedUsage);
    run("serialized", {data.range()},
        [&](VkCommandBuffer commands) { recordSerialize(gpu_, commands, source, data.address()); });
    uint64_t bytes = 0;
    std::memcpy(&bytes, data.bytes() + kHeaderSize, sizeof bytes);
    target->create(bytes);
    run("loaded", {target->range()}, [&](VkCommandBuffer commands) {
        auto info = vkInit<VkCopyMemoryToAccelerationStructureInfoKHR>();
        info.src.deviceAddress = data.address();
        info.dst = target->handle();
        info.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_DESERIALIZE_KHR;
        gpu_.vk().CmdCopyMemoryToAccelerationStructureKHR(commands, &info);
    });
    return target;
}

void PackedScene::reloadObject(Bottom &bottom)
{
    auto blas = std::make_unique<Blas>(gpu_);
    Blas *const loaded = blas.get();
    (void)reloaded(*bottom.structure, std::move(blas)).release();
    bottom.structure.reset(loaded);
}

void PackedScene::buildObject(Bottom &bottom, VkBuildAccelerationStructureModeKHR mode)
{
    const bool update = mode == VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR;
    bottom.structure->prepare(bottom.geometries, bottomFlags(gpu_), mode);
    run(update ? "updated" : "built", {bottom.structure->range(), bottom.structure->scratchRange()},
        [&](VkCommandBuffer commands) { bottom.structure->record(commands); });
    bottom.structure->forgetInput();
}

// One object is cloned, and in the same command buffer another one built in its room, if that is large enough: its
// handle is made while the first content is live, and the first one's destroyed when the second is.
void PackedScene::moveAndBuildOver(Bottom &moved, Bottom &built)
{
    auto clone = std::make_unique<Blas>(gpu_);
    clone->create(sizeOf(*moved.structure, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SIZE_KHR));
    auto over = std::make_unique<Blas>(gpu_);
    over->useRoomOf(*moved.structure);
    over->prepare(built.geometries, bottomFlags(gpu_));
    run("cloned and built over", {clone->range(), over->range(), over->scratchRange()}, [&](VkCommandBuffer commands) {
        recordCopy(gpu_, commands, moved.structure->handle(), clone->handle());
        barrier(commands);
        over->record(commands);
    });
    over->forgetInput();
    if (&moved != &built)
        moved.structure = std::move(clone);
    built.structure = std::move(over);
}

// A second handle for the same content, after which the first is destroyed.
void PackedScene::renameObject(Bottom &bottom)
{
    history_ += " renamed";
    auto second = std::make_unique<Blas>(gpu_);
    second->useRoomOf(*bottom.structure);
    second->create(bottom.structure->size());
    bottom.structure = std::move(second);
}

void PackedScene::buildTop()
{
    std::vector<const Structure *> objects;
    for (const Bottom &bottom : bottoms_)
        objects.push_back(bottom.structure.get());
    top_.reset();
    auto tlas = std::make_unique<Tlas>(gpu_);
    tlas->prepare(instancesOf(scene_, objects), VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR,
                  VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR,
                  below(2) == 0 ? Arrangement::Array : Arrangement::Pointers);
    run("; top level built", {tlas->range(), tlas->scratchRange()},
        [&](VkCommandBuffer commands) { tlas->record(commands); });
    tlas->forgetInput();
    top_ = std::move(tlas);
}

// Clone, compacted copy, serialized and loaded again, or none of these.
void PackedScene::copyTop(uint32_t way)
{
    if (way == 3)
        return;
    auto target = std::make_unique<Structure>(gpu_, VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR);
    if (way == 2) {
        top_ = reloaded(*top_, std::move(target));
        return;
    }
    target->create(sizeOf(*top_, way == 0 ? VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SIZE_KHR
                                          : VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR));
    run(way == 0 ? "cloned" : "compacted", {target->range()}, [&](VkCommandBuffer commands) {
        recordCopy(gpu_, commands, top_->handle(), target->handle(),
                   way == 0 ? VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR
                            : VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR);
    });
    top_ = std::move(target);
}

void PackedScene::traceBesideBuild(Tracer &tracer, std::span<const Ray> rays, uint32_t capacity)
{
    Bottom &bottom = bottoms_[below(static_cast<uint32_t>(bottoms_.size()))];
    auto beside = std::make_unique<Blas>(gpu_);
    beside->prepare(bottom.geometries, bottomFlags(gpu_));
    tracer.prepare(*top_, rays, capacity);
    const bool before = below(2) == 0;
    run("; traced, and built beside", {beside->range(), beside->scratchRange()}, [&](VkCommandBuffer commands) {
        barrier(commands);
        if (before)
            beside->record(commands);
        tracer.bind(commands);
        tracer.dispatch(commands);
        if (!before)
            beside->record(commands);
        barrier(commands);
    });
    beside->forgetInput();
    bottom.structure = std::move(beside);
    // The scene that names the old one is not traced again.
    buildTop();
}

} // namespace vellum::check::oracle
