// SPDX-License-Identifier: Apache-2.0
// Instances and devices by their dispatch keys.
//
// A registry owns nothing, and does nothing when the process ends or the layer is unloaded: objects that the
// application has not destroyed by then stay, since the driver and the layers in between may be gone. It does not
// allocate either, so adding an object that the driver has created cannot fail.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <mutex>
#include <new>
#include <shared_mutex>

namespace vellum::layer
{

// Base of the objects in a registry: the key, and the next object of the list.
template <typename Object>
struct Registered {
    void *key = nullptr;
    Object *nextRegistered = nullptr;
};

template <typename Object>
class Registry
{
public:
    // Null if there is none. Every intercepted command calls this, on any thread, and each thread would write to a
    // shared lock, even to one for readers. So the first objects, which most processes do not exceed, are in slots that
    // are read without a lock. A slot changes only while its object is created or destroyed, when no command may name
    // it; other threads then find a key that is not theirs.
    [[nodiscard]] Object *find(void *key) const
    {
        for (const Slot &slot : slots_) {
            if (slot.key.load(std::memory_order_acquire) == key)
                return slot.object.load(std::memory_order_relaxed);
        }
        std::shared_lock lock(mutex_);
        Object *object = first_;
        while (object && object->key != key)
            object = object->nextRegistered;
        return object;
    }

    void add(Object &object, void *key)
    {
        std::unique_lock lock(mutex_);
        object.key = key;
        object.nextRegistered = first_;
        first_ = &object;
        setSlot(nullptr, key, &object);
    }

    // Removes an object for which the predicate is true, and returns it; null if there is none.
    template <typename Predicate>
    Object *take(Predicate predicate)
    {
        std::unique_lock lock(mutex_);
        for (Object **link = &first_; *link; link = &(*link)->nextRegistered) {
            Object *const object = *link;
            if (!predicate(*object))
                continue;
            *link = object->nextRegistered;
            setSlot(object->key, nullptr, nullptr);
            return object;
        }
        return nullptr;
    }
    Object *take(void *key)
    {
        return take([key](const Object &object) { return object.key == key; });
    }

    template <typename Predicate>
    [[nodiscard]] bool any(Predicate predicate) const
    {
        std::shared_lock lock(mutex_);
        for (const Object *object = first_; object; object = object->nextRegistered) {
            if (predicate(*object))
                return true;
        }
        return false;
    }

private:
    struct Slot {
        std::atomic<void *> key = nullptr;
        std::atomic<Object *> object = nullptr;
    };
    void setSlot(void *oldKey, void *key, Object *object)
    {
        for (Slot &slot : slots_) {
            if (slot.key.load(std::memory_order_relaxed) != oldKey)
                continue;
            slot.object.store(object, std::memory_order_relaxed);
            slot.key.store(key, std::memory_order_release);
            return;
        }
    }

    std::array<Slot, 16> slots_;
    mutable std::shared_mutex mutex_;
    Object *first_ = nullptr;
};

// A registry that is made when the layer is loaded and never destroyed, whatever the C++ library's mutexes do at the
// end of the process.
template <typename Object>
class PermanentRegistry
{
public:
    PermanentRegistry() { new (storage_) Registry<Object>; }
    Registry<Object> *operator->() { return std::launder(reinterpret_cast<Registry<Object> *>(storage_)); }

private:
    alignas(Registry<Object>) std::byte storage_[sizeof(Registry<Object>)];
};

} // namespace vellum::layer
