// SPDX-License-Identifier: Apache-2.0
#include "check/case/built_case.h"

#include <array>
#include <cstring>
#include <thread>

#include "check/case/step.h"
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

// scene: after the step
bool isUpdated(const Step &step, uint32_t object, const oracle::Scene &scene)
{
    switch (step.kind) {
    case Kind::UpdateObject: return step.target == object;
    case Kind::SetIndices: return step.update && step.target == object;
    case Kind::CloneMicromap:
    case Kind::CompactMicromap:
    case Kind::ReloadMicromap:
    case Kind::SetStates: return step.update && scene.objects[object].uses(step.target);
    default: return false;
    }
}

bool isIndirect(const Case &c)
{
    return c.build.structures == BuildCommand::Indirect;
}

} // namespace

BuiltCase::BuiltCase(Device &gpu, const Case &c) : gpu_(gpu), case_(c), scene_(c.scene)
{
    if (c.build.conditional)
        predicate_ = Buffer(gpu, sizeof(uint32_t), VK_BUFFER_USAGE_CONDITIONAL_RENDERING_BIT_EXT);
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
        if (targetOf(step.kind) != Target::Top)
            apply(step);
    }
    buildTop();
    for (const Step &step : case_.steps) {
        if (targetOf(step.kind) == Target::Top)
            applyToTop(step);
    }
}

void BuiltCase::recordUnder(VkCommandBuffer commands, const Record &record) const
{
    if (!case_.build.conditional)
        return record(commands);
    const auto begin = vkInit<VkConditionalRenderingBeginInfoEXT>({.buffer = predicate_.handle()});
    gpu_.vk().CmdBeginConditionalRenderingEXT(commands, &begin);
    record(commands);
    gpu_.vk().CmdEndConditionalRenderingEXT(commands);
}

void BuiltCase::execute(const std::string &what, const Writes &writes, const Record &record)
{
    Watch watch(gpu_);
    gpu_.submit([&](VkCommandBuffer commands) { recordUnder(commands, record); });
    watch.expectOnlyChanged(writes, what);
}

void BuiltCase::executeOnHost(const std::string &what, const Writes &writes, const std::function<void()> &command)
{
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
    for (const Step &step : c.steps) {
        applyTo(scene, step);
        allowDisabling(step.instances);
        const bool updated = isUpdated(step, object, scene);
        if (updated)
            flags |= VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR;
        if (updated && step.kind != Kind::UpdateObject)
            flags |= VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_UPDATE_EXT;
        if (step.kind == Kind::CompactObject && step.target == object)
            flags |= VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR;
    }
    return flags;
}

void BuiltCase::buildObjects()
{
    const bool indirect = isIndirect(case_);
    const uint32_t spare = indirect ? case_.build.spareTriangles : 0;
    for (uint32_t o = 0; o < scene_.objects.size(); ++o)
        bottoms_.push_back({buildFlagsOf(case_, o), oracle::geometriesOf(scene_.objects[o], micromaps_, spare), nullptr});
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
    const Structure *const structure = tlas.get();
    const StructureBuilds build(gpu_, std::span(&structure, 1), isIndirect(case_));
    execute("top level built", {tlas->range(), tlas->scratchRange()},
            [&](VkCommandBuffer commands) { build.record(commands); });
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
    tlas.usePointers(case_.build.geometryPointers);
    tlas.prepare(
        oracle::instancesOf(scene_, objects),
        VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR |
            (updated ? VkBuildAccelerationStructureFlagsKHR{VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR} : 0u),
        mode, case_.build.instancePointers ? Arrangement::Pointers : Arrangement::Array, 0,
        isIndirect(case_) ? case_.build.spareInstances : 0);
}

std::unique_ptr<Tlas> BuiltCase::plainTop() const
{
    oracle::Scene scene = scene_;
    for (oracle::Instance &instance : scene.instances) {
        instance.flags = 0;
        instance.mask = 0xff;
    }
    std::vector<const Structure *> objects;
    for (const Bottom &bottom : bottoms_)
        objects.push_back(bottom.structure.get());
    return std::make_unique<Tlas>(gpu_, oracle::instancesOf(scene, objects));
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
        bottom.flags = buildFlagsOf(case_, o);
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

void BuiltCase::recordWithRays(VkCommandBuffer commands)
{
    if (case_.build.single)
        recordUnder(commands, [this](VkCommandBuffer to) { recordAll(to); });
    if (!case_.trace.besideBuild)
        return;
    Bottom &bottom = bottoms_[0];
    beside_ = std::make_unique<Blas>(gpu_);
    beside_->prepare(bottom.geometries, bottom.flags);
    recordUnder(commands, [this](VkCommandBuffer to) { beside_->record(to); });
}

} // namespace vellum::check
