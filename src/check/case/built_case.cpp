// SPDX-License-Identifier: Apache-2.0
#include "check/case/built_case.h"

#include <array>
#include <cstring>
#include <thread>

#include "check/oracle/scene_build.h"

namespace vellum::check
{
namespace
{

constexpr VkBufferUsageFlags kSerializedUsage =
    VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;
// Where the header of serialized data has these, after the version of 32 bytes.
constexpr size_t kHeaderSerializedSize = 32;
constexpr size_t kHeaderDeserializedSize = 40;

using Kind = Step::Kind;

uint64_t numberAt(const uint8_t *bytes, size_t offset)
{
    uint64_t number = 0;
    std::memcpy(&number, bytes + offset, sizeof number);
    return number;
}

bool compatible(const Device &gpu, const uint8_t *version)
{
    const auto info = vkInit<VkAccelerationStructureVersionInfoKHR>({.pVersionData = version});
    auto result = VK_ACCELERATION_STRUCTURE_COMPATIBILITY_INCOMPATIBLE_KHR;
    gpu.vk().GetDeviceAccelerationStructureCompatibilityKHR(gpu.device(), &info, &result);
    return result == VK_ACCELERATION_STRUCTURE_COMPATIBILITY_COMPATIBLE_KHR;
}

// A command buffer of a thread of its own.
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

// What an operation may write to is compared, where the device has an arena.
class Watch
{
public:
    explicit Watch(const Device &gpu)
    {
        if (gpu.arena() != nullptr)
            before_.emplace(*gpu.arena());
    }
    void expectOnlyChanged(std::span<const Arena::Range> writes, const std::string &what)
    {
        if (before_)
            before_->expectOnlyChanged(writes, what);
    }

private:
    std::optional<Arena::Snapshot> before_;
};

bool isUpdated(const Step &step, uint32_t object, const oracle::Scene &scene)
{
    switch (step.kind) {
    case Kind::UpdateObject: return step.target == object;
    case Kind::SetIndices: return step.update && step.target == object;
    case Kind::CloneMicromap:
    case Kind::CompactMicromap:
    case Kind::ReloadMicromap:
    case Kind::SetStates:
        return step.update && std::ranges::any_of(scene.objects[object].meshes,
                                                  [&](const oracle::Mesh &mesh) { return mesh.micromap.has_value(); });
    default: return false;
    }
}

} // namespace

BuiltCase::BuiltCase(Device &gpu, const Case &c) : gpu_(gpu), case_(c), scene_(c.scene)
{
    if (c.build.single)
        prepareAll();
    else
        buildAll();
}

void BuiltCase::buildAll()
{
    buildMicromaps();
    buildObjects();
    for (const Step &step : case_.steps) {
        if (step.kind < Kind::CloneTop)
            apply(step);
    }
    buildTop();
    for (const Step &step : case_.steps) {
        if (step.kind >= Kind::CloneTop)
            applyToTop(step);
    }
}

void BuiltCase::execute(const std::string &what, const Writes &writes, const Record &record)
{
    Watch watch(gpu_);
    gpu_.submit(record);
    watch.expectOnlyChanged(writes, what);
}

// Each thread prepares and records its share of the builds, one after the other with the same scratch memory, in a
// command buffer of its own. They are then executed together, on as many queues as there are: nothing orders what one
// thread has recorded and another.
void BuiltCase::runOnThreads(const Work &work)
{
    const size_t count = std::max(case_.build.threads, 1u);
    std::vector<std::unique_ptr<Recording>> recordings(count);
    std::vector<Writes> written(count);
    std::vector<std::exception_ptr> errors(count);
    const auto share = [&](size_t t) {
        try {
            recordings[t] = std::make_unique<Recording>(gpu_);
            SharedScratch scratch(gpu_);
            for (size_t i = t; i < work.count; i += count) {
                const Writes writes = work.record(i, recordings[t]->commands(), scratch);
                written[t].insert(written[t].end(), writes.begin(), writes.end());
                barrier(recordings[t]->commands());
            }
            CHECK_VK(vkEndCommandBuffer(recordings[t]->commands()));
        } catch (...) {
            errors[t] = std::current_exception();
        }
    };
    std::vector<std::thread> threads;
    for (size_t t = 1; t < count; ++t)
        threads.emplace_back(share, t);
    share(0);
    for (std::thread &thread : threads)
        thread.join();
    for (const std::exception_ptr &error : errors) {
        if (error)
            std::rethrow_exception(error);
    }
    Writes writes;
    for (const Writes &some : written)
        writes.insert(writes.end(), some.begin(), some.end());
    Watch watch(gpu_);
    for (size_t t = 0; t < count; ++t)
        recordings[t]->submit(gpu_.queues()[t % gpu_.queues().size()]);
    CHECK_VK(vkDeviceWaitIdle(gpu_.device()));
    watch.expectOnlyChanged(writes, work.name);
}

void BuiltCase::buildMicromaps()
{
    const auto make = [this](size_t i, SharedScratch *scratch) {
        const oracle::SceneMicromap &from = scene_.micromaps[i];
        micromaps_[i] = std::make_unique<Micromap>(gpu_, oracle::inputOf(from), from.flags, scratch);
    };
    micromaps_.resize(scene_.micromaps.size());
    if (case_.build.micromaps == BuildCommand::Host) {
        for (size_t i = 0; i < micromaps_.size(); ++i) {
            make(i, nullptr);
            micromaps_[i]->buildOnHost();
        }
    } else if (case_.build.together) {
        std::vector<MicromapBuild> builds;
        Writes writes;
        for (size_t i = 0; i < micromaps_.size(); ++i) {
            make(i, nullptr);
            builds.push_back({micromaps_[i]->buildInfo(), micromaps_[i]->handle()});
            writes.insert(writes.end(), {micromaps_[i]->range(), micromaps_[i]->scratchRange()});
        }
        if (!builds.empty())
            execute("micromap builds", writes,
                    [&](VkCommandBuffer commands) { recordMicromapBuilds(gpu_, commands, builds); });
    } else {
        runOnThreads(
            {"micromap builds", micromaps_.size(), [&](size_t i, VkCommandBuffer commands, SharedScratch &scratch) {
                 make(i, &scratch);
                 micromaps_[i]->record(commands);
                 return Writes{micromaps_[i]->range(), micromaps_[i]->scratchRange()};
             }});
    }
    // What micromaps were built from is garbage from now on, and its memory is free.
    for (const auto &micromap : micromaps_)
        micromap->forgetInput();
}

VkBuildAccelerationStructureFlagsKHR BuiltCase::flagsOf(uint32_t object) const
{
    VkBuildAccelerationStructureFlagsKHR flags = case_.scene.objects[object].flags;
    // VUID-VkAccelerationStructureInstanceKHR-flags-..., by its words: instances that disable micromaps need the flag
    // on the structure.
    const auto allowDisabling = [&](const std::vector<oracle::Instance> &instances) {
        for (const oracle::Instance &instance : instances)
            if (instance.object == object && (instance.flags & kFlagDisable) != 0)
                flags |= VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_DISABLE_OPACITY_MICROMAPS_EXT;
    };
    allowDisabling(case_.scene.instances);
    for (const Step &step : case_.steps) {
        allowDisabling(step.instances);
        if (isUpdated(step, object, case_.scene))
            flags |= VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR;
        if (isUpdated(step, object, case_.scene) && step.kind != Kind::UpdateObject)
            flags |= VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_UPDATE_EXT;
        if (step.kind == Kind::CompactObject && step.target == object)
            flags |= VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR;
    }
    return flags;
}

void BuiltCase::buildObjects()
{
    const bool indirect = case_.build.structures == BuildCommand::Indirect;
    const uint32_t spare = indirect ? case_.build.spareTriangles : 0;
    for (uint32_t o = 0; o < scene_.objects.size(); ++o)
        bottoms_.push_back({flagsOf(o), oracle::geometriesOf(scene_.objects[o], micromaps_, spare), nullptr});
    const auto prepare = [this](size_t i, SharedScratch *scratch) {
        Bottom &bottom = bottoms_[i];
        bottom.structure = std::make_unique<Blas>(gpu_);
        bottom.structure->shareScratch(scratch);
        bottom.structure->prepare(bottom.geometries, bottom.flags);
        bottom.structure->shareScratch(nullptr);
        return Writes{bottom.structure->range(), bottom.structure->scratchRange()};
    };
    if (case_.build.together) {
        std::vector<const Structure *> structures;
        Writes writes;
        for (size_t i = 0; i < bottoms_.size(); ++i) {
            const Writes own = prepare(i, nullptr);
            writes.insert(writes.end(), own.begin(), own.end());
            structures.push_back(bottoms_[i].structure.get());
        }
        const StructureBuilds builds(gpu_, structures, indirect);
        execute("builds", writes, [&](VkCommandBuffer commands) { builds.record(commands); });
    } else {
        std::vector<std::unique_ptr<StructureBuilds>> builds(bottoms_.size());
        runOnThreads({"builds", bottoms_.size(), [&](size_t i, VkCommandBuffer commands, SharedScratch &scratch) {
                          const Writes writes = prepare(i, &scratch);
                          const Structure *const structure = bottoms_[i].structure.get();
                          builds[i] = std::make_unique<StructureBuilds>(gpu_, std::span(&structure, 1), indirect);
                          builds[i]->record(commands);
                          return writes;
                      }});
    }
    for (const Bottom &bottom : bottoms_)
        bottom.structure->forgetInput();
}

void BuiltCase::buildTop()
{
    auto tlas = std::make_unique<Tlas>(gpu_);
    prepareTop(*tlas, VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR);
    execute("top level built", {tlas->range(), tlas->scratchRange()},
            [&](VkCommandBuffer commands) { tlas->record(commands); });
    tlas->forgetInput();
    top_ = std::move(tlas);
}

void BuiltCase::prepareTop(Tlas &tlas, VkBuildAccelerationStructureModeKHR mode) const
{
    std::vector<const Structure *> objects;
    for (const Bottom &bottom : bottoms_)
        objects.push_back(bottom.structure.get());
    const bool updated =
        std::ranges::any_of(case_.steps, [](const Step &step) { return step.kind == Kind::UpdateTop; });
    tlas.prepare(
        oracle::instancesOf(scene_, objects),
        VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR |
            (updated ? VkBuildAccelerationStructureFlagsKHR{VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR} : 0u),
        mode, case_.build.instancePointers ? Arrangement::Pointers : Arrangement::Array);
}

void BuiltCase::updateTop()
{
    auto &tlas = static_cast<Tlas &>(*top_);
    prepareTop(tlas, VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR);
    execute("top level updated", {tlas.range(), tlas.scratchRange()},
            [&](VkCommandBuffer commands) { tlas.record(commands); });
    tlas.forgetInput();
}

// For BuildPlan::single: everything but recording.
void BuiltCase::prepareAll()
{
    for (const oracle::SceneMicromap &from : scene_.micromaps)
        micromaps_.push_back(std::make_unique<Micromap>(gpu_, oracle::inputOf(from), from.flags));
    for (uint32_t o = 0; o < scene_.objects.size(); ++o) {
        Bottom &bottom = bottoms_.emplace_back();
        bottom.flags = flagsOf(o);
        bottom.geometries = oracle::geometriesOf(scene_.objects[o], micromaps_);
        bottom.structure = std::make_unique<Blas>(gpu_);
        bottom.structure->prepare(bottom.geometries, bottom.flags);
    }
    auto tlas = std::make_unique<Tlas>(gpu_);
    prepareTop(*tlas, VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR);
    top_ = std::move(tlas);
}

void BuiltCase::recordAll(VkCommandBuffer commands) const
{
    std::vector<MicromapBuild> builds;
    for (const auto &micromap : micromaps_)
        builds.push_back({micromap->buildInfo(), micromap->handle()});
    if (!builds.empty())
        recordMicromapBuilds(gpu_, commands, builds);
    barrier(commands);
    std::vector<const Structure *> structures;
    for (const Bottom &bottom : bottoms_)
        structures.push_back(bottom.structure.get());
    StructureBuilds(gpu_, structures).record(commands);
    barrier(commands);
    top_->record(commands);
    barrier(commands);
}

void BuiltCase::buildObject(uint32_t object, bool update)
{
    Bottom &bottom = bottoms_[object];
    bottom.geometries = oracle::geometriesOf(scene_.objects[object], micromaps_);
    bottom.structure->prepare(bottom.geometries, bottom.flags,
                              update ? VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR
                                     : VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR);
    execute(update ? "updated" : "built", {bottom.structure->range(), bottom.structure->scratchRange()},
            [&](VkCommandBuffer commands) { bottom.structure->record(commands); });
    bottom.structure->forgetInput();
}

void BuiltCase::buildMicromapUsers(uint32_t micromap, bool update)
{
    for (uint32_t o = 0; o < scene_.objects.size(); ++o) {
        if (std::ranges::any_of(scene_.objects[o].meshes, [&](const oracle::Mesh &mesh) {
                return mesh.micromap && mesh.micromap->micromap == micromap;
            }))
            buildObject(o, update);
    }
}

void BuiltCase::apply(const Step &step)
{
    switch (step.kind) {
    case Kind::CloneMicromap:
    case Kind::CompactMicromap:
    case Kind::ReloadMicromap: {
        const std::unique_ptr<Micromap> original = std::move(micromaps_[step.target]);
        micromaps_[step.target] = copyOfMicromap(*original, step.kind);
        if (!step.states.empty()) {
            oracle::SceneMicromap other = scene_.micromaps[step.target];
            other.triangles = step.states;
            if (original->setInput(oracle::inputOf(other)))
                buildMicromap(*original);
        }
        // What the original's memory has is nothing that the copy depends on.
        original->forget();
        return buildMicromapUsers(step.target, step.update);
    }
    case Kind::SetStates: {
        scene_.micromaps[step.target].triangles = step.states;
        const oracle::SceneMicromap &from = scene_.micromaps[step.target];
        // A compacted one may be too small to be built in.
        std::unique_ptr<Micromap> micromap = std::move(micromaps_[step.target]);
        if (!step.inPlace || !micromap->setInput(oracle::inputOf(from)))
            micromap = std::make_unique<Micromap>(gpu_, oracle::inputOf(from), from.flags);
        buildMicromap(*micromap);
        micromaps_[step.target] = std::move(micromap);
        return buildMicromapUsers(step.target, step.update);
    }
    default: return applyToObject(step);
    }
}

void BuiltCase::applyToObject(const Step &step)
{
    Bottom &bottom = bottoms_[step.target];
    switch (step.kind) {
    case Kind::CloneObject: return copyObject(bottom, VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR);
    case Kind::CompactObject: return copyObject(bottom, VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR);
    case Kind::ReloadObject: return reloadObject(bottom);
    case Kind::UpdateObject: return buildObject(step.target, true);
    case Kind::RebuildObject: return buildObject(step.target, false);
    case Kind::MoveObject: return moveObject(bottom, step.other);
    case Kind::RenameObject: {
        auto second = std::make_unique<Blas>(gpu_);
        second->useRoomOf(*bottom.structure);
        second->create(bottom.structure->size());
        bottom.structure = std::move(second);
        return;
    }
    case Kind::SetIndices:
        scene_.objects[step.target].meshes[step.other].micromap = step.micromapUse;
        return buildObject(step.target, step.update);
    default: return;
    }
}

void BuiltCase::buildMicromap(Micromap &micromap)
{
    execute("micromap built", {micromap.range(), micromap.scratchRange()},
            [&](VkCommandBuffer commands) { micromap.record(commands); });
    micromap.forgetInput();
}

// The old one is destroyed at once: no ray is traced until the structures that use it are built with the new one.
std::unique_ptr<Micromap> BuiltCase::copyOfMicromap(const Micromap &source, Step::Kind kind)
{
    const MicromapHandle handle = source.handle();
    if (kind != Kind::ReloadMicromap) {
        const bool clone = kind == Kind::CloneMicromap;
        auto target = std::make_unique<Micromap>(
            gpu_, source, clone ? source.size() : sizeOf(source, VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT));
        execute(clone ? "micromap cloned" : "micromap compacted", {target->range()}, [&](VkCommandBuffer commands) {
            recordMicromapCopy(gpu_, commands, handle, target->handle(),
                               clone ? VK_COPY_MICROMAP_MODE_CLONE_EXT : VK_COPY_MICROMAP_MODE_COMPACT_EXT);
        });
        return target;
    }
    const Guarded data(gpu_, sizeOf(source, VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT), 256, kSerializedUsage);
    execute("micromap serialized", {data.range()},
            [&](VkCommandBuffer commands) { recordMicromapToMemory(gpu_, commands, handle, data.address()); });
    if (!micromapIsCompatible(gpu_, data.bytes()))
        gpu_.fault("the device does not accept the version of a micromap that it serialized");
    const uint64_t bytes = numberAt(data.bytes(), kHeaderDeserializedSize);
    if (numberAt(data.bytes(), kHeaderSerializedSize) > data.size())
        gpu_.fault("the header of a serialized micromap has a size above that of the query");
    auto target = std::make_unique<Micromap>(gpu_, source, bytes);
    execute("micromap deserialized", {target->range()}, [&](VkCommandBuffer commands) {
        recordMemoryToMicromap(gpu_, commands, data.address(), target->handle());
    });
    return target;
}

void BuiltCase::copyObject(Bottom &bottom, VkCopyAccelerationStructureModeKHR mode)
{
    const bool compact = mode == VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR;
    auto target = std::make_unique<Blas>(gpu_);
    target->create(compact ? sizeOf(*bottom.structure, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR)
                           : bottom.structure->size());
    execute(compact ? "compacted" : "cloned", {target->range()}, [&](VkCommandBuffer commands) {
        recordCopy(gpu_, commands, bottom.structure->handle(), target->handle(), mode);
    });
    bottom.structure = std::move(target);
}

void BuiltCase::reload(const Structure &source, Structure &target)
{
    const Guarded data(gpu_, sizeOf(source, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR), 256,
                       kSerializedUsage);
    execute("serialized", {data.range()},
            [&](VkCommandBuffer commands) { recordSerialize(gpu_, commands, source, data.address()); });
    if (!compatible(gpu_, data.bytes()))
        gpu_.fault("the device does not accept the version of a structure that it serialized");
    const uint64_t bytes = numberAt(data.bytes(), kHeaderDeserializedSize);
    if (numberAt(data.bytes(), kHeaderSerializedSize) > data.size())
        gpu_.fault("the header of a serialized structure has a size above that of the query");
    target.create(bytes);
    execute("deserialized", {target.range()}, [&](VkCommandBuffer commands) {
        auto info = vkInit<VkCopyMemoryToAccelerationStructureInfoKHR>();
        info.src.deviceAddress = data.address();
        info.dst = target.handle();
        info.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_DESERIALIZE_KHR;
        gpu_.vk().CmdCopyMemoryToAccelerationStructureKHR(commands, &info);
    });
}

void BuiltCase::reloadObject(Bottom &bottom)
{
    auto target = std::make_unique<Blas>(gpu_);
    reload(*bottom.structure, *target);
    bottom.structure = std::move(target);
}

// One object is cloned, and another one built in its memory by the same submission, if that is large enough: its handle
// is made while the first content is live, and the first one's destroyed when the second is.
void BuiltCase::moveObject(Bottom &moved, uint32_t other)
{
    Bottom &built = bottoms_[other];
    auto clone = std::make_unique<Blas>(gpu_);
    clone->create(moved.structure->size());
    auto over = std::make_unique<Blas>(gpu_);
    over->useRoomOf(*moved.structure);
    over->prepare(built.geometries, built.flags);
    execute("cloned and built over", {clone->range(), over->range(), over->scratchRange()},
            [&](VkCommandBuffer commands) {
                recordCopy(gpu_, commands, moved.structure->handle(), clone->handle());
                barrier(commands);
                over->record(commands);
            });
    over->forgetInput();
    if (&moved != &built)
        moved.structure = std::move(clone);
    built.structure = std::move(over);
}

void BuiltCase::applyToTop(const Step &step)
{
    const Kind kind = step.kind;
    if (kind == Kind::UpdateTop) {
        scene_.instances = step.instances;
        return updateTop();
    }
    auto target = std::make_unique<Tlas>(gpu_);
    if (kind == Kind::ReloadTop) {
        reload(*top_, *target);
    } else {
        const bool clone = kind == Kind::CloneTop;
        target->create(clone ? top_->size() : sizeOf(*top_, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR));
        execute(clone ? "top level cloned" : "top level compacted", {target->range()}, [&](VkCommandBuffer commands) {
            recordCopy(gpu_, commands, top_->handle(), target->handle(),
                       clone ? VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR
                             : VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR);
        });
    }
    top_ = std::move(target);
}

void BuiltCase::recordWithRays(VkCommandBuffer commands)
{
    if (case_.build.single)
        recordAll(commands);
    if (!case_.trace.besideBuild)
        return;
    Bottom &bottom = bottoms_[0];
    beside_ = std::make_unique<Blas>(gpu_);
    beside_->prepare(bottom.geometries, bottom.flags);
    beside_->record(commands);
}

// The last of the queries that are recorded.
uint64_t BuiltCase::query(VkQueryType type, uint32_t count,
                          const std::function<void(VkCommandBuffer, VkQueryPool)> &record)
{
    const QueryPool pool(gpu_, type, count);
    execute("query", {}, [&](VkCommandBuffer commands) {
        vkCmdResetQueryPool(commands, pool, 0, count);
        record(commands, pool);
    });
    return pool.value(count - 1);
}

// A query of one, and one of it behind all others that can be asked: both must say the same.
VkDeviceSize BuiltCase::sizeOf(const Structure &structure, VkQueryType type)
{
    std::vector<VkAccelerationStructureKHR> all;
    for (const Bottom &bottom : bottoms_) {
        if (bottom.structure && (type != VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR ||
                                 (bottom.flags & VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR) != 0))
            all.push_back(bottom.structure->handle());
    }
    all.push_back(structure.handle());
    const auto ask = [&](std::span<const VkAccelerationStructureKHR> of) {
        return query(type, static_cast<uint32_t>(of.size()), [&](VkCommandBuffer commands, VkQueryPool pool) {
            gpu_.vk().CmdWriteAccelerationStructuresPropertiesKHR(commands, static_cast<uint32_t>(of.size()), of.data(),
                                                                  type, pool, 0);
        });
    };
    const VkDeviceSize one = ask(std::span(&all.back(), 1));
    if (ask(all) != one)
        gpu_.fault("a query of several sizes of acceleration structures differs from a query of one");
    return one;
}

VkDeviceSize BuiltCase::sizeOf(const Micromap &micromap, VkQueryType of)
{
    const VkQueryType type = micromapQueryType(gpu_, of);
    std::vector<MicromapHandle> all;
    for (size_t i = 0; i < micromaps_.size(); ++i) {
        if (micromaps_[i] && (of != VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT ||
                              (scene_.micromaps[i].flags & VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT) != 0))
            all.push_back(micromaps_[i]->handle());
    }
    all.push_back(micromap.handle());
    const auto ask = [&](std::span<const MicromapHandle> some) {
        return query(type, static_cast<uint32_t>(some.size()), [&](VkCommandBuffer commands, VkQueryPool pool) {
            recordMicromapProperties(gpu_, commands, some, type, pool, 0);
        });
    };
    const VkDeviceSize one = ask(std::span(&all.back(), 1));
    if (ask(all) != one)
        gpu_.fault("a query of several sizes of micromaps differs from a query of one");
    return one;
}

} // namespace vellum::check
