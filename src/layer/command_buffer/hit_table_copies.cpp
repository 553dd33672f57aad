// SPDX-License-Identifier: Apache-2.0
#include "layer/command_buffer/hit_table_copies.h"

#include <algorithm>

namespace vellum::layer
{
namespace
{

// Current copies beyond these limits give way to new ones.
constexpr VkDeviceSize kMostBytes = VkDeviceSize{64} << 20;
constexpr size_t kMostCopies = 64;

} // namespace

HitTableCopies::Copy HitTableCopies::get(const Table &table, VkDeviceSize bytes)
{
    for (const Entry &entry : entries_)
        if (entry.isCurrent && entry.table == table && entry.bytes >= bytes)
            return entry.copy(true);
    if (Entry *const old = shared_ ? reusable(bytes) : nullptr) {
        *old = {table, bytes, std::move(old->memory), true};
        std::rotate(old, old + 1, entries_.data() + entries_.size());
    } else {
        PooledMemory memory(pool_, bytes);
        if (!memory.address())
            return {};
        total_ += memory.bytes();
        entries_.push_back({table, bytes, std::move(memory), true});
    }
    anyCurrent_ = true;
    return entries_.back().copy(false);
}

HitTableCopies::Entry *HitTableCopies::reusable(VkDeviceSize bytes)
{
    const bool full = total_ + bytes > kMostBytes || entries_.size() >= kMostCopies;
    Entry *found = nullptr;
    for (Entry &entry : entries_) {
        if (entry.memory.bytes() < bytes || (entry.isCurrent && !full))
            continue;
        // Outdated ones first; of these the smallest.
        if (!found || (!entry.isCurrent && (found->isCurrent || entry.memory.bytes() < found->memory.bytes())))
            found = &entry;
    }
    return found;
}

void HitTableCopies::forget()
{
    if (!anyCurrent_)
        return;
    for (Entry &entry : entries_)
        entry.isCurrent = false;
    anyCurrent_ = false;
}

void HitTableCopies::reset()
{
    entries_.clear();
    total_ = 0;
    anyCurrent_ = false;
}

} // namespace vellum::layer
