// SPDX-License-Identifier: Apache-2.0
// A map from handles to state of the layer. It is sharded, so that threads that record different command buffers do not
// wait for each other.
#pragma once

#include <array>
#include <cstdint>
#include <mutex>
#include <new>
#include <shared_mutex>
#include <type_traits>
#include <unordered_map>
#include <utility>

namespace vellum::layer
{

template <typename Handle, typename Value>
class HandleMap
{
    using Values = std::unordered_map<Handle, Value>;

public:
    void set(Handle handle, Value value)
    {
        Shard &shard = shardOf(handle);
        std::unique_lock lock(shard.mutex);
        shard.grow();
        shard.values[handle] = std::move(value);
    }

    // A value whose handle is not known yet. Setting it does not fail: for objects that the driver creates later, when
    // nothing may fail any more.
    using Entry = typename Values::node_type;
    [[nodiscard]] static Entry entry(Value value)
    {
        Values one; // the standard library creates nodes only in containers
        one.max_load_factor(kNeverRehash);
        one.emplace(Handle{}, std::move(value));
        return one.extract(one.begin());
    }
    void set(Handle handle, Entry entry) noexcept
    {
        Shard &shard = shardOf(handle);
        std::unique_lock lock(shard.mutex);
        try {
            shard.grow();
        } catch (const std::bad_alloc &) { // look-ups take longer
        }
        entry.key() = handle;
        if (auto known = shard.values.insert(std::move(entry)); !known.inserted)
            known.position->second = std::move(known.node.mapped());
    }
    // A copy of the value; a default one if there is none.
    [[nodiscard]] Value get(Handle handle) const
    {
        const Shard &shard = shardOf(handle);
        std::shared_lock lock(shard.mutex);
        const auto it = shard.values.find(handle);
        return it == shard.values.end() ? Value{} : it->second;
    }
    // Removes the value, and returns it; a default one if there is none.
    Value take(Handle handle)
    {
        Shard &shard = shardOf(handle);
        std::unique_lock lock(shard.mutex);
        const auto it = shard.values.find(handle);
        if (it == shard.values.end())
            return Value{};
        Value value = std::move(it->second);
        shard.values.erase(it);
        return value;
    }

    // Calls visit(handle, value) for each.
    template <typename Visit>
    void visit(Visit visit) const
    {
        for (const Shard &shard : shards_) {
            std::shared_lock lock(shard.mutex);
            for (const auto &[handle, value] : shard.values)
                visit(handle, value);
        }
    }

private:
    static constexpr float kNeverRehash = 1e9f;
    struct Shard {
        // The map grows only in grow(), and not by itself, so that insertion of an entry cannot fail.
        Shard() { values.max_load_factor(kNeverRehash); }
        void grow()
        {
            if (values.size() >= values.bucket_count())
                values.rehash(values.size() * 2 + kFirstBuckets);
        }
        static constexpr size_t kFirstBuckets = 13;
        mutable std::shared_mutex mutex;
        Values values;
    };
    static size_t index(Handle handle)
    {
        uintptr_t bits = 0;
        if constexpr (std::is_pointer_v<Handle>)
            bits = reinterpret_cast<uintptr_t>(handle);
        else
            bits = static_cast<uintptr_t>(handle);
        return (bits >> 4 ^ bits >> 10) % kShards;
    }
    Shard &shardOf(Handle handle) { return shards_[index(handle)]; }
    const Shard &shardOf(Handle handle) const { return shards_[index(handle)]; }

    static constexpr size_t kShards = 16;
    std::array<Shard, kShards> shards_;
};

} // namespace vellum::layer
