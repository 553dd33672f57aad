// SPDX-License-Identifier: Apache-2.0
#include "check/case/built_case.h"

#include <array>
#include <cstring>
#include <future>
#include <thread>
#include <utility>

#include "check/case/case.h"
#include "check/case/names.h"
#include "check/oracle/scene_build.h"

namespace vellum::check
{
namespace
{

using Kind = Step::Kind;

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

// Compares the memory that an operation may write to, where the device has an arena.
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

bool isIndirect(const Case &c)
{
    return c.build.structures == BuildCommand::Indirect;
}

bool queriesCompactedSize(const Case &c, const QueryTarget &target)
{
    return std::ranges::any_of(c.queries, [&](const QueryPlan &plan) {
        return plan.property == QueryPlan::Property::CompactedSize &&
               std::ranges::any_of(plan.commands, [&](const QueryCommand &command) {
                   return std::ranges::find(command.targets, target) != command.targets.end();
               });
    });
}

} // namespace

BuiltCase::BuiltCase(Device &gpu, const Case &c)
    : gpu_(gpu), case_(c), scene_(c.scene),
      inputs_(gpu, {.shared = c.build.sharedInputs, .aliased = c.build.aliasedInputs, .late = c.build.lateInputs})
{
    if (c.build.conditional != Conditional::None) {
        predicate_ = Buffer(gpu, 2 * sizeof(uint32_t),
                            VK_BUFFER_USAGE_CONDITIONAL_RENDERING_BIT_EXT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
        predicate_.as<uint32_t>()[0] = 1; // the other one is used
        discarded_ = std::make_unique<Marker>(gpu);
    }
    if (c.build.single)
        parts_.emplace_back([this] { prepareAll(); });
    else
        addParts();
}

void BuiltCase::addParts()
{
    parts_.emplace_back([this] { buildMicromaps(); });
    parts_.emplace_back([this] { copyAtAddresses(); });
    parts_.emplace_back([this] { buildObjects(); });
    for (const Step &step : case_.steps) {
        if (targetOf(step.kind) != Target::Top)
            parts_.emplace_back([this, &step] { apply(step); });
    }
    parts_.emplace_back([this] { buildTop(); });
    for (const Step &step : case_.steps) {
        if (targetOf(step.kind) == Target::Top)
            parts_.emplace_back([this, &step] { applyToTop(step); });
    }
    parts_.emplace_back([this] { runQueries(); });
}

bool BuiltCase::advance()
{
    if (done_ < parts_.size())
        parts_[done_++]();
    return done_ < parts_.size();
}

std::unique_ptr<Micromap> BuiltCase::newMicromap(const oracle::SceneMicromap &from, SharedScratch *scratch)
{
    return std::make_unique<Micromap>(gpu_, oracle::inputOf(from), from.flags, scratch, &inputs_);
}

void BuiltCase::recordUnder(VkCommandBuffer commands, const Record &record, bool last)
{
    const auto recordBetween = [&] {
        if (case_.build.anotherThread)
            std::async(std::launch::async, record, commands).get();
        else
            record(commands);
        if (between_)
            between_();
        if (last)
            inputs_.write();
    };
    if (case_.build.conditional == Conditional::None)
        return recordBetween();
    const bool inverted = isInverted(case_.build.conditional); // the true one discards
    const VkDeviceSize offset = inverted ? 0 : sizeof(uint32_t);
    const VkConditionalRenderingFlagsEXT flags =
        inverted ? VkConditionalRenderingFlagsEXT{VK_CONDITIONAL_RENDERING_INVERTED_BIT_EXT} : 0u;
    if (isAtAddress(case_.build.conditional)) {
        const auto begin = vkInit<VkConditionalRenderingBeginInfo2EXT>(
            {.addressRange = {predicate_.address() + offset, sizeof(uint32_t)},
             .addressFlags = kUnknownUsage,
             .flags = flags});
        gpu_.vk().CmdBeginConditionalRendering2EXT(commands, &begin);
        recordBetween();
        return gpu_.vk().CmdEndConditionalRenderingEXT(commands);
    }
    const auto begin =
        vkInit<VkConditionalRenderingBeginInfoEXT>({.buffer = predicate_.handle(), .offset = offset, .flags = flags});
    gpu_.vk().CmdBeginConditionalRenderingEXT(commands, &begin);
    recordBetween();
    gpu_.vk().CmdEndConditionalRenderingEXT(commands);
}

void BuiltCase::recordDiscarding(VkCommandBuffer commands, const Record &record)
{
    recordUnder(commands, [&](VkCommandBuffer to) {
        record(to);
        if (discarded_)
            discarded_->record(to);
    });
}

void BuiltCase::checkDiscarded(const std::string &what)
{
    if (discarded_ && discarded_->take())
        gpu_.fault("a dispatch that conditional rendering discards is executed (after: " + what + ")");
}

void BuiltCase::execute(const std::string &what, const Writes &writes, const Record &record, bool repeatable)
{
    Watch watch(gpu_);
    gpu_.submit(
        [&](VkCommandBuffer commands) {
            barrier(commands); // after submissions before, which may have been to other queues
            recordDiscarding(commands, record);
            // "Signaling a fence and waiting on the host does not guarantee that the results of memory accesses will be
            // visible to the host" (Waiting for Fences)
            barrier(commands);
        },
        {.secondary = case_.build.secondary,
         .times = case_.build.twice && repeatable ? 2u : 1u,
         .rerecorded = case_.build.rerecorded && repeatable});
    watch.expectOnlyChanged(writes, what);
    checkDiscarded(what);
}

void BuiltCase::executeOnHost(const std::string &what, const Writes &writes, const std::function<void()> &command)
{
    inputs_.write();
    Watch watch(gpu_);
    command();
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
            barrier(recordings[t]->commands());
            for (size_t i = t; i < work.count; i += count) {
                const VkCommandBuffer commands = recordings[t]->commands();
                recordDiscarding(commands, [&](VkCommandBuffer to) {
                    const Writes writes = work.record(i, to, scratch);
                    written[t].insert(written[t].end(), writes.begin(), writes.end());
                });
                barrier(commands);
            }
            CHECK_VK(vkEndCommandBuffer(recordings[t]->commands()));
        } catch (...) {
            errors[t] = std::current_exception();
        }
    };
    {
        std::vector<std::jthread> threads;
        for (size_t t = 1; t < count; ++t)
            threads.emplace_back(share, t);
        share(0);
    }
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
    checkDiscarded(work.name);
}

void BuiltCase::buildMicromaps()
{
    const auto make = [this](size_t i, SharedScratch *scratch) {
        const oracle::SceneMicromap &from = scene_.micromaps[i];
        micromaps_[i] = newMicromap(from, scratch);
    };
    micromaps_.resize(scene_.micromaps.size());
    // "infoCount must be greater than 0" (VUID-vkCmdBuildMicromapsEXT-infoCount-arraylength and its like)
    if (micromaps_.empty())
        return;
    if (case_.build.micromaps == BuildCommand::Host) {
        std::vector<VkMicromapBuildInfoEXT> infos;
        Writes writes;
        for (size_t i = 0; i < micromaps_.size(); ++i) {
            make(i, nullptr);
            infos.push_back(micromaps_[i]->hostBuildInfo());
            writes.push_back(micromaps_[i]->range());
        }
        const size_t some = case_.build.together ? infos.size() : 1;
        executeOnHost("micromap builds on the host", writes, [&] {
            for (size_t i = 0; i < infos.size(); i += some)
                HostCommands(gpu_, case_.build.deferred).build(std::span(infos).subspan(i, some));
        });
    } else if (case_.build.together) {
        for (size_t i = 0; i < micromaps_.size(); ++i)
            make(i, nullptr);
        buildMicromapsTogether();
    } else {
        runOnThreads(
            {"micromap builds", micromaps_.size(), [&](size_t i, VkCommandBuffer commands, SharedScratch &scratch) {
                 make(i, &scratch);
                 micromaps_[i]->record(commands);
                 return Writes{micromaps_[i]->range(), micromaps_[i]->scratchRange()};
             }});
    }
    // From now on, the input of the micromaps' builds is garbage, and its memory is free.
    for (const auto &micromap : micromaps_)
        micromap->forgetInput();
}

// Builds all micromaps by one command, with the structures that BuildPlan::mixed adds.
void BuiltCase::buildMicromapsTogether()
{
    std::vector<MicromapBuild> builds;
    OtherBuilds others;
    Writes writes;
    for (const auto &micromap : micromaps_) {
        builds.push_back({micromap->buildInfo(), micromap->handle()});
        writes.insert(writes.end(), {micromap->range(), micromap->scratchRange()});
    }
    if (case_.build.mixed && gpu_.khr()) {
        describeObjects();
        for (uint32_t o = 0; o < bottoms_.size(); ++o) {
            if (std::ranges::any_of(scene_.objects[o].meshes,
                                    [](const auto &mesh) { return mesh.micromap.has_value(); }))
                continue;
            const Writes own = prepareNew(o, nullptr);
            writes.insert(writes.end(), own.begin(), own.end());
            others.infos.push_back(bottoms_[o].structure->buildInfo());
            others.ranges.push_back(bottoms_[o].structure->ranges());
        }
    }
    std::vector<const Structure *> structures;
    const std::unique_ptr<Tlas> unrelated = gpu_.khr() ? unrelatedTop(writes, structures) : nullptr;
    for (const Structure *structure : structures) {
        others.infos.insert(others.infos.begin(), structure->buildInfo());
        others.ranges.insert(others.ranges.begin(), structure->ranges());
    }
    execute("micromap builds", writes,
            [&](VkCommandBuffer commands) { recordMicromapBuilds(gpu_, commands, builds, others); });
}

// Triangles of each mesh that are not built.
uint32_t BuiltCase::spareTriangles() const
{
    return isIndirect(case_) ? case_.build.spareTriangles : 0;
}

void BuiltCase::describeObjects()
{
    bottoms_.resize(scene_.objects.size());
    for (uint32_t o = 0; o < scene_.objects.size(); ++o) {
        if (bottoms_[o].structure)
            continue;
        bottoms_[o].flags = buildFlagsOf(case_, o);
        bottoms_[o].geometries = oracle::geometriesOf(scene_.objects[o], micromaps_, spareTriangles());
    }
}

// Prepares the first build of an object. Returns what that writes to.
BuiltCase::Writes BuiltCase::prepareNew(uint32_t object, SharedScratch *scratch)
{
    Bottom &bottom = bottoms_[object];
    bottom.structure = newStructure<Blas>();
    bottom.structure->shareScratch(scratch);
    bottom.structure->prepare(bottom.geometries, bottom.flags);
    bottom.structure->shareScratch(nullptr);
    return {bottom.structure->range(), bottom.structure->scratchRange()};
}

VkBuildAccelerationStructureFlagsKHR buildFlagsOf(const Case &c, uint32_t object)
{
    VkBuildAccelerationStructureFlagsKHR flags = c.scene.objects[object].flags;
    // "specifies the acceleration structure can be referenced by an instance with the
    // VK_GEOMETRY_INSTANCE_DISABLE_OPACITY_MICROMAPS_BIT_KHR flag set" (VkBuildAccelerationStructureFlagBitsKHR)
    const auto allowDisabling = [&](const std::vector<oracle::Instance> &instances) {
        for (const oracle::Instance &instance : instances)
            if (instance.object == object && (instance.flags & kFlagDisable) != 0)
                flags |= VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_DISABLE_OPACITY_MICROMAPS_EXT;
    };
    allowDisabling(c.scene.instances);
    oracle::Scene scene = c.scene;
    bool deserialized = false;
    for (const Step &step : c.steps) {
        applyTo(scene, step);
        allowDisabling(step.instances);
        const bool updated = isUpdated(step, object, scene);
        if (updated)
            flags |= VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR;
        // Without the flag, an update needs the original micromap, or after deserialization a deserialized one:
        // VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11628, -micromap-11629.
        const bool sameMicromap = step.kind == Kind::UpdateObject || step.kind == Kind::RebuildObjects;
        if (updated && (!sameMicromap || deserialized) && (flags & kAllowDataUpdate) == 0)
            flags |= kAllowMicromapUpdate;
        if (step.kind == Kind::CompactObject && step.target == object)
            flags |= VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR;
        deserialized |= step.kind == Kind::ReloadObject && step.target == object;
    }
    if (queriesCompactedSize(c, {QueryTarget::Of::Object, object}))
        flags |= VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR;
    return flags;
}

VkBuildAccelerationStructureFlagsKHR BuiltCase::topFlags() const
{
    VkBuildAccelerationStructureFlagsKHR flags = case_.scene.topFlags;
    for (const Step &step : case_.steps) {
        if (step.kind == Kind::UpdateTop)
            flags |= VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR;
        if (step.kind == Kind::CompactTop)
            flags |= VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR;
    }
    if (queriesCompactedSize(case_, {.of = QueryTarget::Of::Top}))
        flags |= VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR;
    return flags;
}

std::unique_ptr<Tlas> BuiltCase::unrelatedTop(Writes &writes, std::vector<const Structure *> &structures) const
{
    if (!case_.build.unrelated)
        return nullptr;
    auto top = std::make_unique<Tlas>(gpu_);
    VkAccelerationStructureInstanceKHR inactive{};
    for (size_t i = 0; i < 3; ++i)
        inactive.transform.matrix[i][i] = 1;
    top->prepare(std::vector(3, inactive));
    writes.insert(writes.end(), {top->range(), top->scratchRange()});
    structures.insert(structures.begin(), top.get());
    return top;
}

void BuiltCase::buildObjects()
{
    const bool indirect = isIndirect(case_);
    describeObjects();
    std::vector<uint32_t> objects; // objects not built yet
    for (uint32_t o = 0; o < bottoms_.size(); ++o) {
        if (!bottoms_[o].structure)
            objects.push_back(o);
    }
    if (case_.build.together) {
        std::vector<const Structure *> structures;
        Writes writes;
        for (const uint32_t o : objects) {
            const Writes own = prepareNew(o, nullptr);
            writes.insert(writes.end(), own.begin(), own.end());
            structures.push_back(bottoms_[o].structure.get());
        }
        const std::unique_ptr<Tlas> unrelated = unrelatedTop(writes, structures);
        const StructureBuilds builds(gpu_, structures, indirect);
        execute("builds", writes, [&](VkCommandBuffer commands) { builds.record(commands); });
    } else {
        std::vector<std::unique_ptr<StructureBuilds>> builds(objects.size());
        runOnThreads({"builds", objects.size(), [&](size_t i, VkCommandBuffer commands, SharedScratch &scratch) {
                          const Writes writes = prepareNew(objects[i], &scratch);
                          const Structure *const structure = bottoms_[objects[i]].structure.get();
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
    auto tlas = newStructure<Tlas>();
    prepareTop(*tlas, VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR);
    std::vector<const Structure *> structures{tlas.get()};
    Writes writes{tlas->range(), tlas->scratchRange()};
    Blas unrelated(gpu_);
    unrelated.useInputs(&inputs_);
    if (case_.build.unrelated) {
        unrelated.prepare(bottoms_[0].geometries, bottoms_[0].flags);
        structures.insert(structures.begin(), &unrelated);
        writes.insert(writes.end(), {unrelated.range(), unrelated.scratchRange()});
    }
    Tlas other(gpu_);
    other.useInputs(&inputs_);
    if (case_.build.otherTop) {
        std::vector<VkAccelerationStructureInstanceKHR> reversed = instances(true);
        std::ranges::reverse(reversed);
        other.prepare(reversed);
        structures.push_back(&other);
        writes.insert(writes.end(), {other.range(), other.scratchRange()});
    }
    const StructureBuilds build(gpu_, structures, isIndirect(case_));
    execute("top level built", writes, [&](VkCommandBuffer commands) { build.record(commands); });
    tlas->forgetInput();
    top_ = std::move(tlas);
}

void BuiltCase::prepareTop(Tlas &tlas, VkBuildAccelerationStructureModeKHR mode) const
{
    tlas.usePointers(case_.build.geometryPointers);
    tlas.prepare(instances(), topFlags(), mode,
                 case_.build.instancePointers ? Arrangement::Pointers : Arrangement::Array,
                 case_.build.skippedInstances, isIndirect(case_) ? case_.build.spareInstances : 0);
}

std::vector<VkAccelerationStructureInstanceKHR> BuiltCase::instances(bool plain) const
{
    oracle::Scene scene = scene_;
    for (oracle::Instance &instance : scene.instances) {
        instance.flags = plain ? 0 : instance.flags;
        instance.mask = plain ? 0xff : instance.mask;
    }
    std::vector<const Structure *> objects;
    for (const Bottom &bottom : bottoms_)
        objects.push_back(bottom.structure.get());
    return oracle::instancesOf(scene, objects);
}

std::unique_ptr<Tlas> BuiltCase::plainTop() const
{
    return std::make_unique<Tlas>(gpu_, instances(true));
}

void BuiltCase::buildTopAgain(const Step &step)
{
    const bool update = step.kind == Kind::UpdateTop;
    std::unique_ptr<Structure> source;
    if (step.outOfPlace) {
        auto target = newStructure<Tlas>();
        target->updateFrom(top_.get(), step.exact);
        source = std::exchange(top_, std::move(target));
    }
    auto &tlas = static_cast<Tlas &>(*top_);
    prepareTop(tlas, update ? VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR
                            : VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR);
    execute(update ? "top level updated" : "top level built again", {tlas.range(), tlas.scratchRange()},
            [&](VkCommandBuffer commands) { tlas.record(commands); });
    tlas.forgetInput();
}

// For BuildPlan::single: everything but the recording.
void BuiltCase::prepareAll()
{
    for (const oracle::SceneMicromap &from : scene_.micromaps)
        micromaps_.push_back(newMicromap(from));
    describeObjects();
    for (uint32_t o = 0; o < bottoms_.size(); ++o)
        prepareNew(o, nullptr);
    auto tlas = newStructure<Tlas>();
    prepareTop(*tlas, VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR);
    top_ = std::move(tlas);
}

void BuiltCase::recordMicromaps(VkCommandBuffer commands) const
{
    std::vector<MicromapBuild> builds;
    for (const auto &micromap : micromaps_)
        builds.push_back({micromap->buildInfo(), micromap->handle()});
    if (!builds.empty())
        recordMicromapBuilds(gpu_, commands, builds);
    barrier(commands);
}

void BuiltCase::recordObjects(VkCommandBuffer commands) const
{
    std::vector<const Structure *> structures;
    for (const Bottom &bottom : bottoms_)
        structures.push_back(bottom.structure.get());
    StructureBuilds(gpu_, structures).record(commands);
    barrier(commands);
}

void BuiltCase::recordTop(VkCommandBuffer commands) const
{
    top_->record(commands);
    barrier(commands);
}

void BuiltCase::recordAll(VkCommandBuffer commands)
{
    if (!case_.build.backwards) {
        return recordUnder(commands, [this](VkCommandBuffer to) {
            recordMicromaps(to);
            recordObjects(to);
            recordTop(to);
        });
    }
    recordUnder(
        commands, [this](VkCommandBuffer to) { recordTop(to); }, false);
    const VkCommandBuffer objects = gpu_.begin();
    recordUnder(
        objects, [this](VkCommandBuffer to) { recordObjects(to); }, false);
    gpu_.end(objects);
    const VkCommandBuffer micromaps = gpu_.begin();
    recordUnder(micromaps, [this](VkCommandBuffer to) { recordMicromaps(to); });
    gpu_.end(micromaps);
    gpu_.executeBefore(std::array{micromaps, objects});
}

void BuiltCase::recordWithRays(VkCommandBuffer commands)
{
    if (case_.build.single)
        recordAll(commands);
    if (!case_.trace.besideBuild)
        return;
    Bottom &bottom = bottoms_[0];
    beside_ = newStructure<Blas>();
    beside_->prepare(bottom.geometries, bottom.flags);
    recordUnder(commands, [this](VkCommandBuffer to) { beside_->record(to); });
}

} // namespace vellum::check
