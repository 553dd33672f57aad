// SPDX-License-Identifier: Apache-2.0
// Copies of hit tables, which the traces of one command buffer read in place of the application's
// (pipelines/hit_records.cpp). A copy serves further traces for as long as no recorded command can have made a change
// of the table visible to them.
#pragma once

#include <vector>

#include "layer/memory/memory_pool.h"

namespace vellum::layer
{

class HitTableCopies
{
public:
    // All that the content of a copy depends on, apart from the table's.
    struct Table {
        VkDeviceAddress source = 0;
        VkDeviceSize size = 0;
        VkDeviceSize stride = 0;
        VkDeviceAddress standIn = 0; // in place of null records; of one pipeline
        uint32_t reach = 0;
        bool operator==(const Table &) const = default;
    };
    struct Copy {
        VkDeviceAddress address = 0; // 0: there is no memory
        VkDeviceSize bytes = 0;
        VkBuffer buffer = VK_NULL_HANDLE;
        VkDeviceSize offset = 0; // in the buffer
        bool isCurrent = false;  // its content need not be written again
    };

    explicit HitTableCopies(MemoryPool &pool) : pool_(pool) {}

    // A copy of the table with at least this capacity. If it is not current, it has to be written before the next
    // trace, between full barriers: traces before may have read other content there.
    Copy get(const Table &table, VkDeviceSize bytes);
    // Tables may have changed: the copies serve no further traces.
    void forget();
    // The recorded commands are gone. `shared`: as in ScratchMemory::setShared.
    void reset();
    void setShared(bool shared) { shared_ = shared; }
    [[nodiscard]] bool isShared() const { return shared_; }

private:
    struct Entry {
        [[nodiscard]] Copy copy(bool current) const
        {
            return {memory.address(), bytes, memory.buffer(), memory.offset(), current};
        }
        Table table;
        VkDeviceSize bytes = 0; // bytes written
        PooledMemory memory;
        bool isCurrent = false;
    };
    // The memory of a copy that no further trace needs, or of the oldest if there are many; null if there is none.
    Entry *reusable(VkDeviceSize bytes);

    MemoryPool &pool_;
    std::vector<Entry> entries_; // in the order in which they were written last
    VkDeviceSize total_ = 0;
    bool anyCurrent_ = false;
    bool shared_ = true;
};

} // namespace vellum::layer
