// SPDX-License-Identifier: Apache-2.0
// Finds memory accesses that no synchronization orders. It gets accesses, barriers and waits in the order in which
// queues are given them, and knows for each byte of memory its last write and the reads since. It makes no Vulkan
// calls.
//
// A barrier for all memory is kept once for its queue and applied to an access when that access is compared with a
// later one; a barrier for a range is applied to what is in the range at once. An access is therefore compared with
// each barrier at most once. Where the order is unknown, accesses count as ordered.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <unordered_map>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/input/objects.h"

namespace vellum::layer::sync
{

using Range = MemoryRange; // in barriers, an unknown one is all memory

struct Scope {
    VkPipelineStageFlags2 stages = 0;
    VkAccessFlags2 accesses = 0;
    [[nodiscard]] bool overlaps(const Scope &other) const
    {
        return (stages & other.stages) != 0 && (accesses & other.accesses) != 0;
    }
};
// The scope in single stages and accesses, without those that stand for several.
Scope firstScope(VkPipelineStageFlags2 stages, VkAccessFlags2 accesses);
Scope secondScope(VkPipelineStageFlags2 stages, VkAccessFlags2 accesses);

// An access of a command. Where it has several stages or accesses, a barrier for any of them covers it.
struct Access {
    Range range;
    Scope scope;
    bool writes = false;
    bool transfer = false;  // of two transfers, neither is about micromaps or structures: they are not compared
    bool exclusive = false; // the buffer belongs to one queue family at a time
    // By which instances of a top-level structure may name the structure that is written; 0: none does.
    VkDeviceAddress reference = 0;
    // For messages
    const char *command = nullptr;
    const char *array = nullptr; // and element of it; null: the command has one subject
    uint32_t element = 0;
    const char *subject = nullptr; // such as "micromap"
    ObjectHandle object;           // the structure or the buffer
};

struct Barrier {
    Scope source;
    Scope target;
    std::vector<Range> ranges; // none: all memory
};

struct Transfer { // of a range to another queue family
    uint32_t to = 0;
    Range range;
};

// A semaphore operation of a submission.
struct SemaphoreUse {
    uint64_t semaphore = 0;
    std::optional<uint64_t> value; // of a timeline semaphore
    VkPipelineStageFlags2 stages = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT;
};

enum class HazardKind { ReadAfterWrite, WriteAfterRead, WriteAfterWrite, Ownership };

struct Hazard {
    HazardKind kind = HazardKind::ReadAfterWrite;
    Access earlier, later;
    bool sameBatch = false;
    bool sameQueue = false;
    bool executionOrdered = false; // a barrier orders the execution, but lacks the accesses
};

using QueueKey = uint64_t; // a VkQueue

class Tracker
{
public:
    // A batch of a submission: its waits, its commands, its signals. `ordered`: it is after the submissions of other
    // queues that are known by now, and before all later ones. Otherwise it is treated as ordered with all. Returns its
    // number on the queue, from 1 on.
    uint64_t beginBatch(QueueKey queue, uint32_t family, std::span<const SemaphoreUse> waits, bool ordered = true);
    // Accesses of one command, which are not compared with each other. At most one hazard for each access.
    std::vector<Hazard> access(QueueKey queue, std::span<const Access> accesses);
    // For the command whose accesses were the last: the writes of structures with a reference, by earlier commands of
    // its queue, that nothing orders before `read`, of which the range is ignored.
    std::vector<Hazard> unorderedStructures(QueueKey queue, const Access &read);
    void barriers(QueueKey queue, std::span<const Barrier> barriers);
    void transfers(QueueKey queue, std::span<const Transfer> transfers);
    void setEvent(QueueKey queue, uint64_t event);
    void resetEvent(uint64_t event);
    // The barriers have what was before the event in their first scope.
    void waitEvent(QueueKey queue, uint64_t event, std::span<const Barrier> barriers);
    void endBatch(QueueKey queue, std::span<const SemaphoreUse> signals, bool ordered = true);
    // The fence is signaled after all batches of the queue.
    void signalFence(QueueKey queue, uint64_t fence);

    // Results of waits on the host. Unknown fences and values count as signaled by everything.
    void fenceComplete(uint64_t fence);
    void forgetFence(uint64_t fence);
    void hostSignal(uint64_t semaphore, uint64_t value);
    void undoHostSignal(uint64_t semaphore, uint64_t value); // after the driver's command failed
    void semaphoreReached(uint64_t semaphore, uint64_t value);
    void forgetSemaphore(uint64_t semaphore);
    void queueIdle(QueueKey queue);
    void allIdle();

    // Returns whether a batch, numbered as beginBatch() returned, may still be executed.
    [[nodiscard]] bool isPending(QueueKey queue, uint64_t batch) const;
    void freeMemory(uint64_t memory);

private:
    using Clock = std::vector<uint64_t>; // for each queue, the last of its batches that is complete

    // The stages and accesses that barriers since an access have reached.
    struct Reach {
        uint64_t next = 0; // position of the first barrier that was not applied yet
        VkPipelineStageFlags2 stages = 0;
        bool available = false;
        std::vector<Scope> visible;
    };
    struct Seen {
        Access access;
        size_t queue = 0;
        uint64_t batch = 0, position = 0;
        Reach reach;
    };
    struct Entry { // of equal bytes
        uint64_t end = 0;
        std::optional<Seen> write;
        std::vector<Seen> reads; // since the write; of each queue and scope, the last
        uint32_t owner = VK_QUEUE_FAMILY_IGNORED;
    };
    using Entries = std::map<uint64_t, Entry>; // by their first byte
    struct QueuedBarrier {
        uint64_t position = 0; // of the command
        uint64_t before = 0;   // accesses at earlier positions are in the first scope
        Scope source, target;
    };
    struct Queue {
        uint32_t family = 0;
        uint64_t batch = 0, position = 0;
        Clock before; // its commands
        std::deque<QueuedBarrier> barriers;
        std::deque<std::pair<uint64_t, uint64_t>> ends; // of batches: number, position
        uint64_t forgotten = 0;                         // barriers before that position
        // First bytes, each with its memory, of structures with a reference that the queue wrote and that are not known
        // to be ordered before all later builds.
        std::set<std::pair<uint64_t, uint64_t>> structures;
    };
    struct EventSet {
        size_t queue = 0;
        uint64_t position = 0;
    };
    // A batch waits for a value of a timeline semaphore whose signal was not known when the batch was submitted.
    struct LateWait {
        size_t queue = 0;
        uint64_t batch = 0;
        uint64_t semaphore = 0;
        uint64_t value = 0;
        std::optional<Clock> signal; // what is complete once it is signaled; nothing: it is not known yet
    };

    size_t indexOf(QueueKey queue);
    [[nodiscard]] Clock everything() const;
    [[nodiscard]] Clock clockOf(size_t queue) const; // once its batches are complete
    void wait(size_t queue, const SemaphoreUse &use);
    [[nodiscard]] std::optional<Clock> signalOf(const SemaphoreUse &use);
    void signal(uint64_t semaphore, uint64_t value, const Clock &clock);
    // Returns whether a batch waits for a signal that is not known.
    [[nodiscard]] bool waitsForUnknown() const;
    void complete(const Clock &clock);
    // Completes what late waits of complete batches waited for.
    void completeWaits();
    void sweep();
    void addBarrier(Queue &queue, const Scope &source, const Scope &target, uint64_t before);
    void applyBarriers(size_t queue, std::span<const Barrier> barriers, uint64_t before);
    static void apply(const QueuedBarrier &barrier, Seen &seen);
    // Applies barriers until one orders the access before `later`. False: none does.
    bool advance(Seen &seen, const Scope &later, bool memory);
    [[nodiscard]] bool isComplete(const Seen &seen) const;
    std::optional<Hazard> compare(Seen &earlier, const Access &later, size_t queue);
    std::optional<Hazard> access(Entry &entry, const Access &access, size_t queue);
    // Every entry that overlaps a range.
    template <typename Visit>
    void visitOverlapping(const Range &range, Visit visit);
    // Visits every part of a range as an entry, which is added if missing.
    template <typename Visit>
    void visitParts(const Range &range, Visit visit);

    mutable std::mutex mutex_;
    std::unordered_map<QueueKey, size_t> indices_;
    std::vector<Queue> queues_;
    Clock complete_; // known to the host
    std::unordered_map<uint64_t, Entries> memory_;
    size_t entries_ = 0, sweepAt_ = 4096;
    std::unordered_map<uint64_t, Clock> binary_;                       // signaled semaphores
    std::unordered_map<uint64_t, std::map<uint64_t, Clock>> timeline_; // values
    std::vector<LateWait> late_;                                       // of batches that are not complete
    std::unordered_map<uint64_t, Clock> fences_;
    std::unordered_map<uint64_t, EventSet> events_;
};

} // namespace vellum::layer::sync
