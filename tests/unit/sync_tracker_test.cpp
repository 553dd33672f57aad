// SPDX-License-Identifier: Apache-2.0
// The tracker of accesses: sequences on queues, and the hazards that each must have.
#include <functional>
#include <set>

#include <gtest/gtest.h>

#include "layer/validation/sync/sync_tracker.h"

namespace vellum::layer::sync
{
namespace
{

constexpr auto kBuild = VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR;
constexpr auto kMicromapBuild = VK_PIPELINE_STAGE_2_MICROMAP_BUILD_BIT_EXT;
constexpr auto kCopy = VK_PIPELINE_STAGE_2_COPY_BIT;
constexpr auto kTransfer = VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT;
constexpr auto kCompute = VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT;
constexpr auto kAll = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT;
constexpr auto kRead = VK_ACCESS_2_ACCELERATION_STRUCTURE_READ_BIT_KHR;
constexpr auto kWrite = VK_ACCESS_2_ACCELERATION_STRUCTURE_WRITE_BIT_KHR;
constexpr auto kMicromapRead = VK_ACCESS_2_MICROMAP_READ_BIT_EXT;
constexpr auto kMicromapWrite = VK_ACCESS_2_MICROMAP_WRITE_BIT_EXT;
constexpr auto kTransferWrite = VK_ACCESS_2_TRANSFER_WRITE_BIT;
constexpr auto kShaderRead = VK_ACCESS_2_SHADER_READ_BIT;
constexpr auto kMemory = VK_ACCESS_2_MEMORY_READ_BIT | VK_ACCESS_2_MEMORY_WRITE_BIT;
constexpr Range kA{1, 0, 256}, kB{1, 256, 512}, kBoth{1, 0, 512}, kElsewhere{2, 0, 256}, kAllMemory{};

// The effect of a sequence on a tracker.
struct Execution {
    Tracker tracker;
    std::vector<HazardKind> hazards;
};
using Step = std::function<void(Execution &)>;

Step access(QueueKey queue, Range range, VkPipelineStageFlags2 stages, VkAccessFlags2 accesses, bool writes,
            bool transfer = false)
{
    return [=](Execution &run) {
        Access one;
        one.range = range;
        one.scope = {stages, accesses};
        one.writes = writes;
        one.transfer = transfer;
        one.exclusive = true;
        one.object = {VK_OBJECT_TYPE_BUFFER, 7};
        for (const Hazard &hazard : run.tracker.access(queue, {&one, 1}))
            run.hazards.push_back(hazard.kind);
    };
}
Step build(Range range, QueueKey queue = 1)
{
    return access(queue, range, kBuild, kWrite, true);
}
Step read(Range range, QueueKey queue = 1)
{
    return access(queue, range, kBuild, kRead, false);
}
Step micromapBuild(Range range)
{
    return access(1, range, kMicromapBuild, kMicromapWrite, true);
}
Step micromapRead(Range range)
{
    return access(1, range, kBuild, kMicromapRead, false);
}
Step upload(Range range)
{
    return access(1, range, kCopy, kTransferWrite, true, true);
}
Step input(Range range)
{
    return access(1, range, kBuild, kShaderRead, false);
}

Barrier barrierOf(VkPipelineStageFlags2 from, VkAccessFlags2 fromAccess, VkPipelineStageFlags2 to,
                  VkAccessFlags2 toAccess, Range range)
{
    const std::vector<Range> ranges(range == kAllMemory ? 0 : 1, range);
    return {firstScope(from, fromAccess), secondScope(to, toAccess), ranges};
}
Step barrier(VkPipelineStageFlags2 from, VkAccessFlags2 fromAccess, VkPipelineStageFlags2 to, VkAccessFlags2 toAccess,
             Range range = kAllMemory, QueueKey queue = 1)
{
    return [=](Execution &run) {
        const Barrier one = barrierOf(from, fromAccess, to, toAccess, range);
        run.tracker.barriers(queue, {&one, 1});
    };
}
Step set(uint64_t event)
{
    return [=](Execution &run) { run.tracker.setEvent(1, event); };
}
Step reset(uint64_t event)
{
    return [=](Execution &run) { run.tracker.resetEvent(event); };
}
Step await(uint64_t event)
{
    return [=](Execution &run) {
        const Barrier one = barrierOf(kBuild, kWrite, kBuild, kRead | kWrite, kAllMemory);
        run.tracker.waitEvent(1, event, {&one, 1});
    };
}
Step begin(QueueKey queue, std::vector<SemaphoreUse> waits = {})
{
    return [=](Execution &run) { run.tracker.beginBatch(queue, uint32_t(queue), waits); };
}
Step end(QueueKey queue, std::vector<SemaphoreUse> signals = {})
{
    return [=](Execution &run) { run.tracker.endBatch(queue, signals); };
}
Step acquire(Range range)
{
    return [=](Execution &run) {
        const Transfer transfer{2, range};
        run.tracker.transfers(2, {&transfer, 1});
    };
}
Step host(void (*learn)(Tracker &))
{
    return [=](Execution &run) { learn(run.tracker); };
}
Step fence(QueueKey queue)
{
    return [=](Execution &run) { run.tracker.signalFence(queue, 5); };
}

const Step kWaitFence = host([](Tracker &tracker) { tracker.fenceComplete(5); });
const Step kFull = barrier(kAll, kMemory, kAll, kMemory);
const SemaphoreUse kBinary{10, std::nullopt};
SemaphoreUse timeline(uint64_t value)
{
    return {11, value};
}

constexpr auto kRaw = HazardKind::ReadAfterWrite;
constexpr auto kWar = HazardKind::WriteAfterRead;
constexpr auto kWaw = HazardKind::WriteAfterWrite;
constexpr auto kOwnership = HazardKind::Ownership;

struct Sequence {
    const char *name;
    std::vector<Step> steps;
    std::vector<HazardKind> hazards = {};
};

std::vector<Sequence> barrierSequences()
{
    return {
        {"ReadAfterWrite", {build(kA), read(kA)}, {kRaw}},
        {"WriteAfterWrite", {build(kA), build(kA)}, {kWaw}},
        {"WriteAfterRead", {read(kA), build(kA)}, {kWar}},
        {"ReadAfterRead", {read(kA), read(kA)}},
        {"OtherBytes", {build(kA), read(kB)}},
        {"OtherMemory", {build(kA), read(kElsewhere)}},
        {"PartOfBytes", {build(kBoth), read(kB)}, {kRaw}},
        {"OneOfTwoParts", {build(kB), read(kBoth)}, {kRaw}},
        {"Barrier", {build(kA), barrier(kBuild, kWrite, kBuild, kRead), read(kA)}},
        {"FullBarrier", {build(kA), kFull, read(kA), kFull, build(kA)}},
        {"BarrierBefore", {barrier(kBuild, kWrite, kBuild, kRead), build(kA), read(kA)}, {kRaw}},
        {"BarrierBetweenOthers", {build(kA), barrier(kBuild, kWrite, kBuild, kRead), build(kB), read(kA)}},
        {"OnlyExecution", {build(kA), barrier(kBuild, 0, kBuild, 0), read(kA)}, {kRaw}},
        {"ExecutionIsEnoughAfterRead", {read(kA), barrier(kBuild, 0, kBuild, 0), build(kA)}},
        {"FirstAccessMissing", {build(kA), barrier(kBuild, kRead, kBuild, kRead), read(kA)}, {kRaw}},
        {"SecondAccessMissing", {build(kA), barrier(kBuild, kWrite, kBuild, kWrite), read(kA)}, {kRaw}},
        {"FirstStageMissing", {build(kA), barrier(kTransfer, kMemory, kBuild, kRead), read(kA)}, {kRaw}},
        {"SecondStageMissing", {build(kA), barrier(kBuild, kWrite, kCompute, kRead), read(kA)}, {kRaw}},
        {"Chain", {build(kA), barrier(kBuild, kWrite, kCompute, 0), barrier(kCompute, 0, kBuild, kRead), read(kA)}},
        {"BrokenChain",
         {build(kA), barrier(kBuild, kWrite, kCompute, 0), barrier(kCopy, 0, kBuild, kRead), read(kA)},
         {kRaw}},
        {"TopOfPipeSecond",
         {build(kA), barrier(kBuild, kWrite, VK_PIPELINE_STAGE_2_TOP_OF_PIPE_BIT, 0), read(kA)},
         {kRaw}},
        {"TopOfPipeOrdersExecution", {read(kA), barrier(kBuild, 0, VK_PIPELINE_STAGE_2_TOP_OF_PIPE_BIT, 0), build(kA)}},
        {"BottomOfPipeFirst", {read(kA), barrier(VK_PIPELINE_STAGE_2_BOTTOM_OF_PIPE_BIT, 0, kBuild, 0), build(kA)}},
        {"ReadsOfTwoStages",
         {read(kA), access(1, kA, kCopy, VK_ACCESS_2_TRANSFER_READ_BIT, false), barrier(kBuild, 0, kBuild, 0),
          build(kA)},
         {kWar}},
        {"LastReadCounts", {read(kA), barrier(kBuild, 0, kBuild, 0), read(kA), build(kA)}, {kWar}},
        {"WriteAfterOrderedRead",
         {build(kA), barrier(kBuild, kWrite, kBuild, kRead), read(kA), barrier(kBuild, 0, kBuild, 0), build(kA)}},
        {"RangeBarrier", {build(kA), barrier(kBuild, kWrite, kBuild, kRead, kA), read(kA)}},
        {"OtherRangeBarrier", {build(kA), barrier(kBuild, kWrite, kBuild, kRead, kB), read(kA)}, {kRaw}},
        {"OtherRangeOrdersExecution", {read(kA), barrier(kBuild, kWrite, kBuild, kRead, kB), build(kA)}},
        {"RangeAfterMemoryBarrier",
         {build(kA), barrier(kBuild, kWrite, kCompute, 0), barrier(kCompute, 0, kBuild, kRead, kA), read(kA)}},
        {"Micromap",
         {micromapBuild(kA), barrier(kMicromapBuild, kMicromapWrite, kBuild, kMicromapRead), micromapRead(kA)}},
        {"MicromapByAccessesOfStructures",
         {micromapBuild(kA), barrier(kMicromapBuild, kMicromapWrite, kBuild, kRead), micromapRead(kA)},
         {kRaw}},
        {"MicromapByStageOfStructures",
         {micromapBuild(kA), barrier(kBuild, kWrite, kBuild, kMicromapRead), micromapRead(kA)},
         {kRaw}},
        {"Upload", {upload(kA), input(kA)}, {kRaw}},
        {"UploadWithBarrier", {upload(kA), barrier(kTransfer, kTransferWrite, kBuild, kShaderRead), input(kA)}},
        {"UploadOverInput", {input(kA), upload(kA)}, {kWar}},
        {"TransfersAreNotCompared", {upload(kA), upload(kA)}},
        {"CopyOfStructure",
         {access(1, kA, VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_COPY_BIT_KHR | kBuild, kWrite, true),
          barrier(VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_COPY_BIT_KHR, kWrite, kBuild, kRead), read(kA)}},
        {"Event", {build(kA), set(3), await(3), read(kA)}},
        {"EventBeforeTheWrite", {set(3), build(kA), await(3), read(kA)}, {kRaw}},
        {"EventThatIsReset", {set(3), build(kA), reset(3), set(3), await(3), read(kA)}},
        {"UnknownEvent", {build(kA), await(4), read(kA)}},
    };
}

std::vector<Sequence> queueSequences()
{
    return {
        {"BatchesAreNotOrdered", {build(kA), end(1), begin(1), read(kA)}, {kRaw}},
        {"BarrierInNextBatch", {build(kA), end(1), begin(1), barrier(kBuild, kWrite, kBuild, kRead), read(kA)}},
        {"Fence", {build(kA), end(1), fence(1), kWaitFence, begin(1), read(kA)}},
        {"FenceBefore", {end(1), fence(1), begin(1), build(kA), end(1), kWaitFence, begin(1), read(kA)}, {kRaw}},
        {"FenceOfOtherQueue", {build(kA), end(1), begin(2), end(2), fence(2), kWaitFence, begin(1), read(kA)}, {kRaw}},
        {"UnknownFence", {build(kA), end(1), kWaitFence, begin(1), read(kA)}},
        {"QueueIdle", {build(kA), end(1), host([](Tracker &t) { t.queueIdle(1); }), begin(1), read(kA)}},
        {"AllIdle", {build(kA), end(1), host([](Tracker &t) { t.allIdle(); }), begin(2), build(kA, 2)}},
        {"TwoQueues", {build(kA), end(1), begin(2), build(kA, 2)}, {kWaw}},
        {"Semaphore", {build(kA), end(1, {kBinary}), begin(2, {kBinary}), build(kA, 2)}},
        {"SemaphoreOfTheSameQueue", {build(kA), end(1, {kBinary}), begin(1, {kBinary}), read(kA)}},
        {"SemaphoreForOtherStage",
         {build(kA), end(1, {kBinary}), begin(1, {{10, std::nullopt, kCompute}}), read(kA)},
         {kRaw}},
        {"SemaphoreBefore",
         {end(1, {kBinary}), begin(1), build(kA), end(1), begin(2, {kBinary}), build(kA, 2)},
         {kWaw}},
        {"UnknownSemaphore", {build(kA), end(1), begin(2, {kBinary}), build(kA, 2)}},
        {"ThroughAThirdQueue",
         {build(kA), end(1, {kBinary}), begin(3, {kBinary}), end(3, {timeline(1)}), begin(2, {timeline(1)}),
          build(kA, 2)}},
        {"Timeline", {build(kA), end(1, {timeline(4)}), begin(2, {timeline(3)}), build(kA, 2)}},
        {"EarlierValue",
         {end(1, {timeline(1)}), begin(1), build(kA), end(1, {timeline(2)}), begin(2, {timeline(1)}), build(kA, 2)},
         {kWaw}},
        {"WaitBeforeSignal",
         {end(1), begin(2, {timeline(1)}), build(kA, 2), end(2), begin(1), build(kA), end(1, {timeline(1)}), begin(2),
          build(kA, 2)}},
        {"HostReachesValue",
         {build(kA), end(1, {timeline(2)}), host([](Tracker &t) { t.semaphoreReached(11, 2); }), begin(2),
          build(kA, 2)}},
        {"HostReachesEarlierValue",
         {end(1, {timeline(1)}), begin(1), build(kA), end(1, {timeline(2)}),
          host([](Tracker &t) { t.semaphoreReached(11, 1); }), begin(2), build(kA, 2)},
         {kWaw}},
        {"FailedHostSignal", // the target of the wait is unknown again
         {build(kA), host([](Tracker &t) {
              t.hostSignal(11, 1);
              t.undoHostSignal(11, 1);
          }),
          begin(2, {timeline(1)}), build(kA, 2)}},
        {"HostSignal",
         {build(kA), host([](Tracker &t) { t.hostSignal(11, 1); }), begin(2, {timeline(1)}), build(kA, 2)},
         {kWaw}},
        {"Ownership", {build(kA), end(1, {kBinary}), begin(2, {kBinary}), read(kA, 2)}, {kOwnership}},
        {"OwnershipIsAcquired", {build(kA), end(1, {kBinary}), begin(2, {kBinary}), acquire(kA), read(kA, 2)}},
        {"OwnershipWithoutContents",
         {build(kA), end(1, {kBinary}), begin(2, {kBinary}), build(kA, 2), read(kA, 2)},
         {kRaw}},
        {"FreedMemory", {build(kA), host([](Tracker &t) { t.freeMemory(1); }), read(kA)}},
    };
}

class SyncTracker : public testing::TestWithParam<Sequence>
{
};

TEST_P(SyncTracker, FindsTheHazards)
{
    Execution run;
    run.tracker.beginBatch(1, 1, {});
    for (const Step &step : GetParam().steps)
        step(run);
    EXPECT_EQ(run.hazards, GetParam().hazards);
}

const auto kNameOf = [](const auto &info) { return std::string(info.param.name); };
INSTANTIATE_TEST_SUITE_P(Barriers, SyncTracker, testing::ValuesIn(barrierSequences()), kNameOf);
INSTANTIATE_TEST_SUITE_P(Queues, SyncTracker, testing::ValuesIn(queueSequences()), kNameOf);

// --- structures that instances name

Step buildNamed(Range range, VkDeviceAddress reference, QueueKey queue = 1)
{
    return [=](Execution &run) {
        Access one;
        one.range = range;
        one.scope = {kBuild, kWrite};
        one.writes = true;
        one.reference = reference;
        run.tracker.access(queue, {&one, 1});
    };
}
// The build of a top-level structure on a queue, and the references that were written unordered before.
struct Unordered {
    QueueKey queue = 1;
    std::set<VkDeviceAddress> references = {};
};
struct References {
    const char *name;
    std::vector<Step> steps;
    Unordered unordered = {};
};

class SyncTrackerReferences : public testing::TestWithParam<References>
{
};

TEST_P(SyncTrackerReferences, AreUnordered)
{
    const auto &[name, steps, unordered] = GetParam();
    Execution run;
    run.tracker.beginBatch(1, 1, {});
    for (const Step &step : steps)
        step(run);
    build({3, 0, 256}, unordered.queue)(run); // the top-level structure
    Access one;
    one.scope = {kBuild, kRead};
    for (int times = 0; times < 2; ++times) { // those that are not ordered are found again
        std::set<VkDeviceAddress> found;
        for (const Hazard &hazard : run.tracker.unorderedStructures(unordered.queue, one)) {
            EXPECT_EQ(hazard.kind, HazardKind::ReadAfterWrite);
            found.insert(hazard.earlier.reference);
        }
        EXPECT_EQ(found, unordered.references);
    }
}

const Step kBuildBarrier = barrier(kBuild, kWrite, kBuild, kRead);
const Step kReferencesAgain = [](Execution &run) {
    Access one;
    one.scope = {kBuild, kRead};
    run.tracker.unorderedStructures(1, one);
};
std::vector<References> referenceSequences()
{
    return {
        {"NoBarrier", {buildNamed(kA, 5), buildNamed(kB, 6)}, {1, {5, 6}}},
        {"Barrier", {buildNamed(kA, 5), kBuildBarrier}},
        {"BarrierBetween", {buildNamed(kA, 5), kBuildBarrier, buildNamed(kB, 6)}, {1, {6}}},
        {"WithoutReference", {buildNamed(kA, 0)}},
        {"OtherStage", {buildNamed(kA, 5), barrier(kBuild, kWrite, kCompute, kRead)}, {1, {5}}},
        {"OtherAccess", {buildNamed(kA, 5), barrier(kBuild, kWrite, kBuild, kShaderRead)}, {1, {5}}},
        {"RangeBarrier", {buildNamed(kA, 5), buildNamed(kB, 6), barrier(kBuild, kWrite, kBuild, kRead, kA)}, {1, {6}}},
        {"WrittenAgain", {buildNamed(kA, 5), kBuildBarrier, kReferencesAgain, buildNamed(kA, 5)}, {1, {5}}},
        {"OtherStructureThere", {buildNamed(kA, 5), buildNamed(kA, 7)}, {1, {7}}},
        {"OverwrittenByOther", {buildNamed(kA, 5), build(kA)}},
        {"FreedMemory", {buildNamed(kA, 5), host([](Tracker &t) { t.freeMemory(1); })}},
        {"NextBatch", {buildNamed(kA, 5), end(1), begin(1)}, {1, {5}}},
        {"CompleteBatch", {buildNamed(kA, 5), end(1), host([](Tracker &t) { t.queueIdle(1); }), begin(1)}},
        {"OtherQueue", {buildNamed(kA, 5), end(1), begin(2)}, {2}},
        {"UnknownEvent", {buildNamed(kA, 5), await(4)}},
    };
}
INSTANTIATE_TEST_SUITE_P(All, SyncTrackerReferences, testing::ValuesIn(referenceSequences()), kNameOf);

// The structures of the command itself are neither reported nor forgotten.
TEST(SyncTrackerCommand, KeepsWhatItWrites)
{
    Execution run;
    run.tracker.beginBatch(1, 1, {});
    buildNamed(kA, 5)(run);
    Access one;
    one.scope = {kBuild, kRead};
    EXPECT_TRUE(run.tracker.unorderedStructures(1, one).empty());
    build(kB)(run);
    EXPECT_EQ(run.tracker.unorderedStructures(1, one).size(), 1u);
}

TEST(SyncTrackerBatch, IsPendingUntilTheHostKnows)
{
    Execution run;
    const uint64_t first = run.tracker.beginBatch(1, 1, {});
    run.tracker.endBatch(1, {});
    run.tracker.signalFence(1, 5);
    const uint64_t second = run.tracker.beginBatch(1, 1, {});
    run.tracker.endBatch(1, {});
    EXPECT_TRUE(run.tracker.isPending(1, first));
    EXPECT_FALSE(run.tracker.isPending(2, first));
    run.tracker.fenceComplete(5);
    EXPECT_FALSE(run.tracker.isPending(1, first));
    EXPECT_TRUE(run.tracker.isPending(1, second));
}

TEST(SyncTrackerBatch, IsCompleteWithOneThatWaitedForIt)
{
    for (const std::optional<uint64_t> value : {std::optional<uint64_t>(), std::optional<uint64_t>(3)}) {
        Execution run;
        const SemaphoreUse use{.semaphore = 9, .value = value};
        const uint64_t first = run.tracker.beginBatch(1, 1, {});
        run.tracker.endBatch(1, std::array{use});
        const uint64_t second = run.tracker.beginBatch(2, 1, std::array{use});
        run.tracker.endBatch(2, {});
        run.tracker.signalFence(2, 5);
        EXPECT_TRUE(run.tracker.isPending(1, first));
        run.tracker.fenceComplete(5);
        EXPECT_FALSE(run.tracker.isPending(1, first));
        EXPECT_FALSE(run.tracker.isPending(2, second));
    }
}

// A fence of a batch that waits for a later submission is signaled after that one, too.
TEST(SyncTrackerBatch, IsCompleteWithOneThatWaitedForItEarly)
{
    Execution run;
    const auto use = [](uint64_t value) { return std::array{SemaphoreUse{.semaphore = 9, .value = value}}; };
    run.tracker.beginBatch(1, 1, use(5));
    run.tracker.endBatch(1, {});
    run.tracker.signalFence(1, 7);
    run.tracker.beginBatch(3, 1, use(10));
    run.tracker.endBatch(3, {});
    const uint64_t first = run.tracker.beginBatch(2, 1, {});
    run.tracker.endBatch(2, use(5));
    const uint64_t second = run.tracker.beginBatch(2, 1, {});
    run.tracker.endBatch(2, use(10));
    EXPECT_TRUE(run.tracker.isPending(2, first));
    run.tracker.fenceComplete(7);
    EXPECT_FALSE(run.tracker.isPending(2, first));
    run.tracker.queueIdle(3);
    EXPECT_FALSE(run.tracker.isPending(2, second));
}

TEST(SyncTrackerBatch, IsCompleteAtValueBeforeItsSignal)
{
    Execution run;
    run.tracker.hostSignal(9, 0);
    const uint64_t batch = run.tracker.beginBatch(1, 1, {});
    run.tracker.endBatch(1, std::array{SemaphoreUse{.semaphore = 9, .value = 5}});
    run.tracker.semaphoreReached(9, 0);
    EXPECT_TRUE(run.tracker.isPending(1, batch));
    run.tracker.semaphoreReached(9, 3); // only the signal of 5 can have reached it
    EXPECT_FALSE(run.tracker.isPending(1, batch));
}

// The application may learn by other means what is complete.
TEST(SyncTrackerBatch, IsCompleteAfterVeryManyOthers)
{
    Execution run;
    const uint64_t first = run.tracker.beginBatch(1, 1, {});
    run.tracker.endBatch(1, {});
    uint64_t last = first;
    for (uint32_t b = 0; b < (1u << 17) && run.tracker.isPending(1, first); ++b) {
        last = run.tracker.beginBatch(1, 1, {});
        run.tracker.endBatch(1, {});
    }
    EXPECT_FALSE(run.tracker.isPending(1, first));
    EXPECT_TRUE(run.tracker.isPending(1, last));
}

// Ten thousand builds with a barrier after each, and one command that reads all that they wrote.
TEST(SyncTrackerUse, ComparesWithFewBarriers)
{
    Execution run;
    run.tracker.beginBatch(1, 1, {});
    constexpr uint64_t kBuilds = 10'000;
    for (uint64_t b = 0; b < kBuilds; ++b) {
        const Range range{1, b * 256, b * 256 + 256};
        build(range)(run);
        barrier(kBuild, kWrite, kBuild, kRead, b % 2 ? range : kAllMemory)(run);
    }
    read({1, 0, kBuilds * 256})(run);
    EXPECT_TRUE(run.hazards.empty());
    build({1, 0, kBuilds * 256})(run);
    EXPECT_EQ(run.hazards, std::vector{kWar});
}

} // namespace
} // namespace vellum::layer::sync
