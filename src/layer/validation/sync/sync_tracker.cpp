// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/sync/sync_tracker.h"

#include <algorithm>

namespace vellum::layer::sync
{
namespace
{

// Barriers that a queue keeps. Accesses before those that it drops count as ordered.
constexpr size_t kMostBarriers = size_t{1} << 20;
// Batches of a queue that are not known to be complete. Where there are more, the older half counts as complete: the
// application learns of it by other means.
constexpr size_t kMostBatches = size_t{1} << 16;
// Structures that a queue has written. Where there are more, they count as ordered.
constexpr size_t kMostStructures = size_t{1} << 16;

constexpr VkPipelineStageFlags2 kAllStages = ~VkPipelineStageFlags2{VK_PIPELINE_STAGE_2_HOST_BIT};
constexpr VkPipelineStageFlags2 kGraphicsStages =
    VK_PIPELINE_STAGE_2_DRAW_INDIRECT_BIT | VK_PIPELINE_STAGE_2_VERTEX_INPUT_BIT | VK_PIPELINE_STAGE_2_INDEX_INPUT_BIT |
    VK_PIPELINE_STAGE_2_VERTEX_ATTRIBUTE_INPUT_BIT | VK_PIPELINE_STAGE_2_VERTEX_SHADER_BIT |
    VK_PIPELINE_STAGE_2_TESSELLATION_CONTROL_SHADER_BIT | VK_PIPELINE_STAGE_2_TESSELLATION_EVALUATION_SHADER_BIT |
    VK_PIPELINE_STAGE_2_GEOMETRY_SHADER_BIT | VK_PIPELINE_STAGE_2_PRE_RASTERIZATION_SHADERS_BIT |
    VK_PIPELINE_STAGE_2_TASK_SHADER_BIT_EXT | VK_PIPELINE_STAGE_2_MESH_SHADER_BIT_EXT |
    VK_PIPELINE_STAGE_2_FRAGMENT_SHADER_BIT | VK_PIPELINE_STAGE_2_EARLY_FRAGMENT_TESTS_BIT |
    VK_PIPELINE_STAGE_2_LATE_FRAGMENT_TESTS_BIT | VK_PIPELINE_STAGE_2_COLOR_ATTACHMENT_OUTPUT_BIT |
    VK_PIPELINE_STAGE_2_ALL_GRAPHICS_BIT;
constexpr VkPipelineStageFlags2 kTransferStages = VK_PIPELINE_STAGE_2_COPY_BIT | VK_PIPELINE_STAGE_2_BLIT_BIT |
                                                  VK_PIPELINE_STAGE_2_RESOLVE_BIT | VK_PIPELINE_STAGE_2_CLEAR_BIT |
                                                  VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_COPY_BIT_KHR;
constexpr VkAccessFlags2 kAllAccesses = ~VkAccessFlags2{0};

// Graphics stages are in logical order: a scope that has one has later or earlier ones, too. All of them is the most
// that this may be.
VkPipelineStageFlags2 expanded(VkPipelineStageFlags2 stages)
{
    if (stages & VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT)
        return kAllStages;
    if (stages & kGraphicsStages)
        stages |= kGraphicsStages;
    if (stages & VK_PIPELINE_STAGE_2_DRAW_INDIRECT_BIT)
        stages |= VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT | VK_PIPELINE_STAGE_2_RAY_TRACING_SHADER_BIT_KHR;
    if (stages & VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT)
        stages |= kTransferStages;
    return stages;
}

VkAccessFlags2 expandedAccesses(VkAccessFlags2 accesses)
{
    if (accesses & VK_ACCESS_2_MEMORY_READ_BIT)
        accesses |= VK_ACCESS_2_INDIRECT_COMMAND_READ_BIT | VK_ACCESS_2_SHADER_READ_BIT |
                    VK_ACCESS_2_TRANSFER_READ_BIT | VK_ACCESS_2_ACCELERATION_STRUCTURE_READ_BIT_KHR |
                    VK_ACCESS_2_MICROMAP_READ_BIT_EXT;
    if (accesses & VK_ACCESS_2_MEMORY_WRITE_BIT)
        accesses |= VK_ACCESS_2_TRANSFER_WRITE_BIT | VK_ACCESS_2_ACCELERATION_STRUCTURE_WRITE_BIT_KHR |
                    VK_ACCESS_2_MICROMAP_WRITE_BIT_EXT;
    return accesses;
}

void merge(std::vector<uint64_t> &clock, const std::vector<uint64_t> &other)
{
    clock.resize(std::max(clock.size(), other.size()));
    for (size_t q = 0; q < other.size(); ++q)
        clock[q] = std::max(clock[q], other[q]);
}

uint64_t at(const std::vector<uint64_t> &clock, size_t queue)
{
    return queue < clock.size() ? clock[queue] : 0;
}

} // namespace

Scope firstScope(VkPipelineStageFlags2 stages, VkAccessFlags2 accesses)
{
    if (stages & VK_PIPELINE_STAGE_2_BOTTOM_OF_PIPE_BIT)
        stages |= VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT;
    return {expanded(stages & ~VK_PIPELINE_STAGE_2_TOP_OF_PIPE_BIT), expandedAccesses(accesses)};
}

Scope secondScope(VkPipelineStageFlags2 stages, VkAccessFlags2 accesses)
{
    if (stages & VK_PIPELINE_STAGE_2_TOP_OF_PIPE_BIT)
        stages |= VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT;
    return {expanded(stages & ~VK_PIPELINE_STAGE_2_BOTTOM_OF_PIPE_BIT), expandedAccesses(accesses)};
}

// ------------------------------------------------------------------------------------------ queues and semaphores

size_t Tracker::indexOf(QueueKey queue)
{
    const auto [found, added] = indices_.try_emplace(queue, queues_.size());
    if (added)
        queues_.emplace_back();
    return found->second;
}

Tracker::Clock Tracker::everything() const
{
    Clock clock;
    for (const Queue &queue : queues_)
        clock.push_back(queue.batch);
    return clock;
}

Tracker::Clock Tracker::clockOf(size_t queue) const
{
    Clock clock = queues_[queue].before;
    clock.resize(std::max(clock.size(), queue + 1));
    clock[queue] = queues_[queue].batch;
    return clock;
}

// nullopt: what signals it is unknown.
std::optional<Tracker::Clock> Tracker::signalOf(const SemaphoreUse &use)
{
    if (!use.value) {
        auto signaled = binary_.extract(use.semaphore); // a wait makes it unsignaled
        return signaled ? std::optional(std::move(signaled.mapped())) : std::nullopt;
    }
    const auto values = timeline_.find(use.semaphore);
    if (values == timeline_.end())
        return std::nullopt;
    const auto signaled = values->second.lower_bound(*use.value);
    return signaled == values->second.end() ? std::nullopt : std::optional(signaled->second);
}

void Tracker::wait(size_t index, const SemaphoreUse &use)
{
    std::optional<Clock> clock = signalOf(use);
    if (!clock && use.value)
        late_.push_back({index, queues_[index].batch + 1, use.semaphore, *use.value, {}});
    if (!clock)
        clock = everything();
    Queue &queue = queues_[index];
    merge(queue.before, *clock);
    const uint64_t own = at(*clock, index);
    const auto end = std::ranges::lower_bound(queue.ends, own, {}, &std::pair<uint64_t, uint64_t>::first);
    const uint64_t before = end == queue.ends.end() ? queue.position + 1 : end->second + 1;
    addBarrier(queue, {kAllStages, kAllAccesses}, {secondScope(use.stages, 0).stages, kAllAccesses}, before);
}

uint64_t Tracker::beginBatch(QueueKey key, uint32_t family, std::span<const SemaphoreUse> waits, bool ordered)
{
    std::lock_guard lock(mutex_);
    const size_t index = indexOf(key);
    for (const SemaphoreUse &use : waits)
        wait(index, use);
    Queue &queue = queues_[index];
    queue.family = family;
    merge(queue.before, ordered && !waitsForUnknown() ? complete_ : everything());
    ++queue.position;
    return ++queue.batch;
}

void Tracker::signal(uint64_t semaphore, uint64_t value, const Clock &clock)
{
    auto &values = timeline_[semaphore];
    values[value] = clock;
    // Of all complete submissions, the last is enough. A wait for a smaller value gets a later clock.
    const auto isComplete = [this](const Clock &other) {
        for (size_t q = 0; q < queues_.size(); ++q) {
            if (at(other, q) > at(complete_, q))
                return false;
        }
        return true;
    };
    while (values.size() > 64 && isComplete(std::next(values.begin())->second))
        values.erase(values.begin());
    bool resolves = false;
    for (LateWait &wait : late_) {
        if (wait.signal || wait.semaphore != semaphore || wait.value > value)
            continue;
        wait.signal = clock;
        resolves = true;
    }
    for (Queue &queue : queues_)
        if (resolves)
            merge(queue.before, everything());
}

bool Tracker::waitsForUnknown() const
{
    return std::ranges::any_of(late_, [](const LateWait &wait) { return !wait.signal; });
}

void Tracker::endBatch(QueueKey key, std::span<const SemaphoreUse> signals, bool ordered)
{
    std::lock_guard lock(mutex_);
    const size_t index = indexOf(key);
    Queue &queue = queues_[index];
    queue.ends.emplace_back(queue.batch, queue.position);
    if (queue.ends.size() > kMostBatches) {
        Clock oldest(index + 1);
        oldest[index] = queue.ends[kMostBatches / 2].first;
        complete(oldest);
    }
    for (const SemaphoreUse &use : signals) {
        if (use.value)
            signal(use.semaphore, *use.value, clockOf(index));
        else
            binary_[use.semaphore] = clockOf(index);
    }
    if (!ordered)
        complete(clockOf(index));
}

void Tracker::signalFence(QueueKey queue, uint64_t fence)
{
    std::lock_guard lock(mutex_);
    fences_[fence] = clockOf(indexOf(queue));
}

// ------------------------------------------------------------------------------------------ the host

void Tracker::completeWaits()
{
    for (bool merged = true; merged;) {
        merged = false;
        std::erase_if(late_, [&](const LateWait &wait) {
            if (wait.batch > at(complete_, wait.queue))
                return false;
            merge(complete_, wait.signal ? *wait.signal : everything());
            return merged = true;
        });
    }
}

void Tracker::complete(const Clock &clock)
{
    merge(complete_, clock);
    completeWaits();
    for (size_t q = 0; q < queues_.size(); ++q) {
        Queue &queue = queues_[q];
        while (!queue.ends.empty() && queue.ends.front().first <= at(complete_, q)) {
            queue.forgotten = queue.ends.front().second + 1;
            queue.ends.pop_front();
        }
        while (!queue.barriers.empty() && queue.barriers.front().position < queue.forgotten)
            queue.barriers.pop_front();
    }
    if (entries_ >= sweepAt_)
        sweep();
}

void Tracker::sweep()
{
    entries_ = 0;
    for (auto &[memory, entries] : memory_) {
        std::erase_if(entries, [this](const auto &item) {
            const Entry &entry = item.second;
            return (!entry.write || isComplete(*entry.write)) &&
                   std::ranges::all_of(entry.reads, [this](const Seen &read) { return isComplete(read); });
        });
        entries_ += entries.size();
    }
    sweepAt_ = std::max<size_t>(4096, 2 * entries_);
}

void Tracker::fenceComplete(uint64_t fence)
{
    std::lock_guard lock(mutex_);
    const auto found = fences_.find(fence);
    complete(found == fences_.end() ? everything() : Clock(found->second));
}

void Tracker::forgetFence(uint64_t fence)
{
    std::lock_guard lock(mutex_);
    fences_.erase(fence);
}

void Tracker::hostSignal(uint64_t semaphore, uint64_t value)
{
    std::lock_guard lock(mutex_);
    signal(semaphore, value, complete_);
}

void Tracker::undoHostSignal(uint64_t semaphore, uint64_t value)
{
    std::lock_guard lock(mutex_);
    if (const auto values = timeline_.find(semaphore); values != timeline_.end())
        values->second.erase(value);
}

void Tracker::semaphoreReached(uint64_t semaphore, uint64_t value)
{
    std::lock_guard lock(mutex_);
    const auto values = timeline_.find(semaphore);
    if (values == timeline_.end())
        return value == 0 ? void() : complete(everything());
    // Values increase: the first signal that reaches the value has happened, and so have those before it.
    const auto signaled = values->second.lower_bound(value);
    if (signaled != values->second.end())
        complete(Clock(signaled->second));
    else if (signaled != values->second.begin())
        complete(Clock(std::prev(signaled)->second));
}

void Tracker::forgetSemaphore(uint64_t semaphore)
{
    std::lock_guard lock(mutex_);
    binary_.erase(semaphore);
    timeline_.erase(semaphore);
    for (LateWait &wait : late_) // the batches are complete, as far as the application knows
        if (wait.semaphore == semaphore && !wait.signal)
            wait.signal = everything();
}

void Tracker::queueIdle(QueueKey queue)
{
    std::lock_guard lock(mutex_);
    complete(clockOf(indexOf(queue)));
}

void Tracker::allIdle()
{
    std::lock_guard lock(mutex_);
    complete(everything());
}

// ------------------------------------------------------------------------------------------ barriers

void Tracker::addBarrier(Queue &queue, const Scope &source, const Scope &target, uint64_t before)
{
    queue.barriers.push_back({++queue.position, before, source, target});
    if (queue.barriers.size() > kMostBarriers) {
        queue.forgotten = queue.barriers.front().position + 1;
        queue.barriers.pop_front();
    }
}

void Tracker::applyBarriers(size_t index, std::span<const Barrier> barriers, uint64_t before)
{
    Queue &queue = queues_[index];
    for (const Barrier &barrier : barriers) {
        if (barrier.ranges.empty()) {
            addBarrier(queue, barrier.source, barrier.target, before);
            continue;
        }
        const auto applyTo = [&](Seen &seen) {
            if (seen.queue != index || isComplete(seen))
                return;
            advance(seen, {}, true);
            apply({queue.position, before, barrier.source, barrier.target}, seen);
        };
        for (const Range &range : barrier.ranges) {
            visitOverlapping(range, [&](Entry &entry) {
                if (entry.write)
                    applyTo(*entry.write);
                std::ranges::for_each(entry.reads, applyTo);
            });
        }
        // It orders the execution of all commands in its stages.
        addBarrier(queue, {barrier.source.stages, 0}, {barrier.target.stages, 0}, before);
    }
}

void Tracker::barriers(QueueKey queue, std::span<const Barrier> barriers)
{
    std::lock_guard lock(mutex_);
    const size_t index = indexOf(queue);
    applyBarriers(index, barriers, queues_[index].position + 1);
}

void Tracker::transfers(QueueKey key, std::span<const Transfer> transfers)
{
    std::lock_guard lock(mutex_);
    const uint32_t family = queues_[indexOf(key)].family;
    for (const Transfer &transfer : transfers) {
        if (transfer.to == family) // the acquire operation
            visitOverlapping(transfer.range, [family](Entry &entry) { entry.owner = family; });
    }
}

void Tracker::setEvent(QueueKey queue, uint64_t event)
{
    std::lock_guard lock(mutex_);
    const size_t index = indexOf(queue);
    events_[event] = {index, ++queues_[index].position};
}

void Tracker::resetEvent(uint64_t event)
{
    std::lock_guard lock(mutex_);
    events_.erase(event);
}

void Tracker::waitEvent(QueueKey queue, uint64_t event, std::span<const Barrier> barriers)
{
    std::lock_guard lock(mutex_);
    const size_t index = indexOf(queue);
    const auto set = events_.find(event);
    const bool known = set != events_.end() && set->second.queue == index;
    applyBarriers(index, barriers, known ? set->second.position : queues_[index].position + 1);
}

// ------------------------------------------------------------------------------------------ accesses

void Tracker::apply(const QueuedBarrier &barrier, Seen &seen)
{
    const Scope &own = seen.access.scope;
    const bool first = seen.position < barrier.before && (barrier.source.stages & own.stages) != 0;
    const bool chained = (barrier.source.stages & seen.reach.stages) != 0;
    if (!first && !chained)
        return;
    seen.reach.stages |= barrier.target.stages;
    if (first && barrier.source.overlaps(own))
        seen.reach.available = true;
    const auto covers = [&barrier](const Scope &scope) {
        return (barrier.target.stages & ~scope.stages) == 0 && (barrier.target.accesses & ~scope.accesses) == 0;
    };
    if (seen.reach.available && barrier.target.accesses != 0 && std::ranges::none_of(seen.reach.visible, covers))
        seen.reach.visible.push_back(barrier.target);
}

bool Tracker::advance(Seen &seen, const Scope &later, bool memory)
{
    const auto &barriers = queues_[seen.queue].barriers;
    const auto ordered = [&] {
        if (!memory)
            return (seen.reach.stages & later.stages) != 0;
        return std::ranges::any_of(seen.reach.visible, [&](const Scope &scope) { return scope.overlaps(later); });
    };
    auto next = std::ranges::lower_bound(barriers, seen.reach.next, {}, &QueuedBarrier::position);
    for (; !ordered(); ++next) {
        if (next == barriers.end())
            return false;
        apply(*next, seen);
        seen.reach.next = next->position + 1;
    }
    return true;
}

bool Tracker::isComplete(const Seen &seen) const
{
    return seen.batch <= at(complete_, seen.queue) || seen.reach.next < queues_[seen.queue].forgotten;
}

std::optional<Hazard> Tracker::compare(Seen &earlier, const Access &later, size_t index)
{
    const Queue &queue = queues_[index];
    const bool sameQueue = earlier.queue == index;
    if ((earlier.access.transfer && later.transfer) || isComplete(earlier) ||
        (sameQueue && earlier.position == queue.position))
        return std::nullopt;
    const bool memory = earlier.access.writes;
    if (sameQueue ? advance(earlier, later.scope, memory) : earlier.batch <= at(queue.before, earlier.queue))
        return std::nullopt;
    Hazard hazard;
    hazard.kind = !memory        ? HazardKind::WriteAfterRead
                  : later.writes ? HazardKind::WriteAfterWrite
                                 : HazardKind::ReadAfterWrite;
    hazard.earlier = earlier.access;
    hazard.later = later;
    hazard.sameQueue = sameQueue;
    hazard.sameBatch = sameQueue && earlier.batch == queue.batch;
    hazard.executionOrdered = sameQueue && (earlier.reach.stages & later.scope.stages) != 0;
    return hazard;
}

std::optional<Hazard> Tracker::access(Entry &entry, const Access &access, size_t index)
{
    const Queue &queue = queues_[index];
    std::optional<Hazard> hazard;
    // A write after reads is ordered after the write that they were ordered after.
    if (entry.write && (!access.writes || entry.reads.empty()))
        hazard = compare(*entry.write, access, index);
    for (size_t r = 0; access.writes && !hazard && r < entry.reads.size(); ++r)
        hazard = compare(entry.reads[r], access, index);
    const bool foreign = access.exclusive && entry.owner != VK_QUEUE_FAMILY_IGNORED && entry.owner != queue.family;
    if (!hazard && !access.writes && foreign && entry.write && entry.write->access.object.handle != 0)
        hazard = Hazard{HazardKind::Ownership, entry.write->access, access};

    Seen seen{access, index, queue.batch, queue.position, {queue.position + 1, 0, false, {}}};
    if (access.writes) {
        entry.write = std::move(seen);
        entry.reads.clear();
    } else {
        // A barrier with the last read of these stages in its first scope has the earlier ones there, too.
        std::erase_if(entry.reads, [&](const Seen &read) {
            return read.queue == index && read.access.scope.stages == access.scope.stages &&
                   read.access.transfer == access.transfer;
        });
        entry.reads.push_back(std::move(seen));
    }
    if (access.exclusive && (access.writes || foreign))
        entry.owner = queue.family;
    return hazard;
}

template <typename Visit>
void Tracker::visitOverlapping(const Range &range, Visit visit)
{
    const auto found = memory_.find(range.memory);
    if (found == memory_.end() || range.empty())
        return;
    Entries &entries = found->second;
    auto entry = entries.upper_bound(range.begin);
    if (entry != entries.begin() && std::prev(entry)->second.end > range.begin)
        --entry;
    for (; entry != entries.end() && entry->first < range.end; ++entry)
        visit(entry->second);
}

template <typename Visit>
void Tracker::visitParts(const Range &range, Visit visit)
{
    Entries &entries = memory_[range.memory];
    const auto split = [&](uint64_t position) {
        const auto after = entries.lower_bound(position);
        if (after == entries.begin())
            return;
        Entry &before = std::prev(after)->second;
        if (before.end <= position)
            return;
        Entry rest = before;
        before.end = position;
        entries.emplace_hint(after, position, std::move(rest));
        ++entries_;
    };
    split(range.begin);
    split(range.end);
    for (uint64_t position = range.begin; position < range.end;) {
        auto entry = entries.lower_bound(position);
        if (entry == entries.end() || entry->first > position) {
            Entry added;
            added.end = entry == entries.end() ? range.end : std::min(range.end, entry->first);
            entry = entries.emplace_hint(entry, position, std::move(added));
            ++entries_;
        }
        visit(entry->second);
        position = entry->second.end;
    }
}

std::vector<Hazard> Tracker::access(QueueKey key, std::span<const Access> accesses)
{
    std::lock_guard lock(mutex_);
    const size_t index = indexOf(key);
    ++queues_[index].position;
    std::vector<Hazard> hazards;
    for (const Access &one : accesses) {
        if (one.range.empty())
            continue;
        std::optional<Hazard> first;
        visitParts(one.range, [&](Entry &entry) {
            auto hazard = access(entry, one, index);
            if (!first)
                first = std::move(hazard);
        });
        if (first)
            hazards.push_back(std::move(*first));
        auto &structures = queues_[index].structures;
        if (one.reference == 0)
            continue;
        if (structures.size() == kMostStructures)
            structures.clear();
        structures.emplace(one.range.memory, one.range.begin);
    }
    return hazards;
}

std::vector<Hazard> Tracker::unorderedStructures(QueueKey key, const Access &read)
{
    std::lock_guard lock(mutex_);
    const size_t index = indexOf(key);
    Queue &queue = queues_[index];
    std::vector<Hazard> hazards;
    std::erase_if(queue.structures, [&](const std::pair<uint64_t, uint64_t> &first) {
        bool isUnordered = false; // what is ordered once is ordered before all later reads
        visitOverlapping({first.first, first.second, first.second + 1}, [&](Entry &entry) {
            if (!entry.write || entry.write->access.reference == 0 || entry.write->queue != index)
                return; // something else was written there since
            auto hazard = compare(*entry.write, read, index);
            isUnordered = hazard || entry.write->position == queue.position;
            if (hazard)
                hazards.push_back(std::move(*hazard));
        });
        return !isUnordered;
    });
    return hazards;
}

bool Tracker::isPending(QueueKey queue, uint64_t batch) const
{
    std::lock_guard lock(mutex_);
    const auto index = indices_.find(queue);
    return index != indices_.end() && batch > at(complete_, index->second);
}

void Tracker::freeMemory(uint64_t memory)
{
    std::lock_guard lock(mutex_);
    if (const auto freed = memory_.extract(memory))
        entries_ -= std::min(entries_, freed.mapped().size());
}

} // namespace vellum::layer::sync
