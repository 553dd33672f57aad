// SPDX-License-Identifier: Apache-2.0
// The application's objects that rules are about, as validation knows them.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <new>
#include <optional>
#include <set>
#include <string>
#include <unordered_map>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/base/handle_map.h"
#include "layer/validation/model/contents.h"
#include "layer/validation/model/descriptors.h"
#include "layer/validation/model/structure_records.h"
#include "vk/newer.h"

namespace vellum::layer
{

struct DeviceModel;
struct Submission;
struct ValidatedStructure;

// Objects that depend on another one. Entries of objects that are gone are removed now and then.
template <typename Object>
class WeakList
{
public:
    void add(const std::shared_ptr<Object> &object)
    {
        const std::lock_guard lock(mutex_);
        if (objects_.size() >= sweepAt_) {
            std::erase_if(objects_, [](const auto &known) { return known.expired(); });
            sweepAt_ = std::max<size_t>(64, 2 * objects_.size());
        }
        objects_.push_back(object);
    }
    template <typename Visit>
    void visit(Visit visit) const
    {
        const std::lock_guard lock(mutex_);
        for (const auto &known : objects_)
            if (const auto object = known.lock())
                visit(object);
    }
    // Returns whether no object was ever added.
    [[nodiscard]] bool empty() const
    {
        const std::lock_guard lock(mutex_);
        return objects_.empty();
    }

private:
    mutable std::mutex mutex_;
    std::vector<std::weak_ptr<Object>> objects_;
    size_t sweepAt_ = 64;
};

// The parts of a sparse buffer that are bound to memory, in the order of vkQueueBindSparse.
class BoundRanges
{
public:
    void set(VkDeviceSize begin, VkDeviceSize end, bool bound)
    {
        const std::lock_guard lock(mutex_);
        split(begin);
        split(end);
        ends_.erase(ends_.lower_bound(begin), ends_.lower_bound(end));
        if (bound && begin < end)
            ends_[begin] = end;
    }
    [[nodiscard]] bool contain(VkDeviceSize begin, VkDeviceSize end) const
    {
        const std::lock_guard lock(mutex_);
        while (begin < end) {
            auto part = ends_.upper_bound(begin);
            if (part == ends_.begin() || (--part)->second <= begin)
                return false;
            begin = part->second;
        }
        return true;
    }

private:
    // Makes a part end, and another begin, at `offset` if it is inside of one.
    void split(VkDeviceSize offset)
    {
        auto part = ends_.upper_bound(offset);
        if (part == ends_.begin() || (--part)->second <= offset || part->first == offset)
            return;
        ends_[offset] = part->second;
        part->second = offset;
    }

    mutable std::mutex mutex_;
    std::map<VkDeviceSize, VkDeviceSize> ends_; // of disjoint parts, by their beginnings
};

// A command that refers to an object, in a batch of a submission.
struct CommandUse {
    VkQueue queue = VK_NULL_HANDLE;
    uint64_t batch = 0; // Submission::batch
    const char *command = nullptr;
    const char *array = nullptr; // and element of it; null: the command has one subject
    uint32_t element = 0;
    const char *subject = nullptr; // what the object is to the command, such as "micromap"
    VkDeviceAddress address = 0;   // by which the command refers to a buffer; 0: it does so by a handle
};

// What commands refer to. It must not be destroyed before they are complete.
struct ReferredObject {
    ObjectHandle handle;
    uint64_t number = 0; // unique on the device
    // Other threads may ask for it while the application destroys what is idle.
    std::atomic<bool> destroyed = false;
    std::vector<CommandUse> uses; // of each queue, the last one. CommandLogs::submissions is held
};

struct ValidatedBuffer : ReferredObject {
    [[nodiscard]] VkBuffer buffer() const { return reinterpret_cast<VkBuffer>(handle.handle); }
    VkDeviceSize size = 0;
    VkFlags64 usage = 0; // as the application requested
    VkBufferCreateFlags flags = 0;
    bool exclusive = false; // it belongs to one queue family at a time
    // Other threads may read these while the application frees idle objects.
    std::atomic<bool> memoryFreed = false;
    std::atomic<VkDeviceMemory> memory = VK_NULL_HANDLE; // null until it is bound, and once the memory is freed
    VkDeviceSize memoryOffset = 0;
    VkDeviceAddress address = 0;             // 0: without one, or without memory
    BoundRanges bound;                       // of a sparse buffer
    WeakList<ValidatedStructure> structures; // structures created in it
};

// A VkAccelerationStructureKHR or a VkMicromapEXT.
struct ValidatedStructure : ReferredObject {
    VkAccelerationStructureTypeKHR type = VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR;
    VkFlags createFlags = 0;
    std::shared_ptr<ValidatedBuffer> buffer; // null if it is unknown: made by address, where no buffer is known
    VkDeviceSize offset = 0;                 // in the buffer
    VkDeviceSize size = 0;
    VkDeviceAddress memoryAddress = 0; // of its memory; 0: unknown
    bool byAddress = false;            // it was created with the address alone: the buffer is one of those there
    // Of CommandUse, for its buffer.
    [[nodiscard]] VkDeviceAddress bufferAddress() const { return byAddress ? memoryAddress : 0; }
    // From vkGetAccelerationStructureDeviceAddressKHR; 0 until the application calls it, or the structure is built.
    std::atomic<VkDeviceAddress> referenceAddress = 0;

    std::shared_ptr<StructureRecords::Owner> record; // null without the check `gpu`

    // The rest changes when commands are executed, as far as the host can know: see CommandLog.
    std::shared_ptr<const StructureContents> contents; // null: not constructed, or overwritten
    ObjectHandle overwrittenBy;                        // constructed later in its memory; none: nothing
    uint64_t since = 0;                                // DeviceModel::numbers when it got them
    uint64_t built = 0;                                // `built` of the structure that they were copied from
    uint64_t losses = 0;        // 1 + LostStructures::count() when instances were last checked; 0: they were not
    uint32_t checkedMask = 0;   // those that rays with these bits in their cull mask may meet were checked then
    bool ownAllocator = false;  // it was created with allocation callbacks
    bool mayBeAttached = false; // to a structure whose build has no known order

    [[nodiscard]] bool isMicromap() const
    {
        return handle.type == VK_OBJECT_TYPE_MICROMAP_EXT ||
               type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR;
    }
};

struct ValidatedMemory {
    bool hostVisible = true;
    std::shared_ptr<WeakList<ValidatedBuffer>> buffers{}; // buffers bound to it
};

// Handles of destroyed micromaps and structures that no new object has. Beyond kMost, all are forgotten.
class DestroyedHandles
{
public:
    void add(ObjectHandle object)
    {
        const std::lock_guard lock(mutex_);
        if (handles_.size() == kMost)
            handles_.clear();
        handles_.insert(object.handle);
    }
    void remove(ObjectHandle object)
    {
        const std::lock_guard lock(mutex_);
        handles_.erase(object.handle);
    }
    [[nodiscard]] bool contains(ObjectHandle object) const
    {
        const std::lock_guard lock(mutex_);
        return handles_.contains(object.handle);
    }

private:
    static constexpr size_t kMost = size_t{1} << 16;
    mutable std::mutex mutex_;
    std::set<uint64_t> handles_;
};

// Structures that were destroyed, overwritten, or lost their memory, and that others may still refer to: a top-level
// structure names them by their reference, and a bottom-level structure has micromaps. Beyond kMost, all are forgotten.
class LostStructures
{
public:
    struct Loss {
        uint64_t number = 0; // DeviceModel::numbers at that time
        ObjectHandle handle;
        const char *how = nullptr; // a clause
        std::string name{};        // for messages: another object may have the handle since
    };
    // A loss after which the structure was not constructed again stays the one that is found.
    void add(const ValidatedStructure &structure, const Loss &loss);
    [[nodiscard]] std::optional<Loss> byReference(VkDeviceAddress reference) const
    {
        return find(references_, reference);
    }
    [[nodiscard]] std::optional<Loss> byNumber(uint64_t number) const { return find(numbers_, number); }
    // The number of losses so far, including those that are no longer kept.
    [[nodiscard]] uint64_t count() const { return count_; }

private:
    using Losses = std::unordered_map<uint64_t, Loss>;
    [[nodiscard]] std::optional<Loss> find(const Losses &losses, uint64_t key) const
    {
        const std::lock_guard lock(mutex_);
        const auto found = losses.find(key);
        return found == losses.end() ? std::nullopt : std::optional(found->second);
    }
    static constexpr size_t kMost = size_t{1} << 16;
    mutable std::mutex mutex_;
    Losses references_, numbers_; // by ValidatedStructure::referenceAddress and ::number
    std::atomic<uint64_t> count_ = 0;
};

// A query pool. Its states are of sizes of structures or micromaps.
struct ValidatedQueryPool : ReferredObject {
    enum class State : uint8_t { Unknown, Unavailable, Available };
    VkQueryType type = VK_QUERY_TYPE_MAX_ENUM;
    std::vector<State> states; // of its queries, which change when commands are executed
};

// Structures by an address. Entries of destroyed structures are removed now and then, so that they are at most half of
// all entries.
class StructuresByAddress
{
public:
    void add(VkDeviceAddress address, const std::shared_ptr<ValidatedStructure> &structure);
    // Calls visit(structure) for each at the address.
    template <typename Visit>
    void visit(VkDeviceAddress address, Visit visit) const
    {
        const auto range = structures_.equal_range(address);
        for (auto known = range.first; known != range.second; ++known)
            if (const auto structure = known->second.lock())
                visit(structure);
    }
    [[nodiscard]] size_t entries() const { return structures_.size(); }

private:
    std::multimap<VkDeviceAddress, std::weak_ptr<ValidatedStructure>> structures_;
    size_t sweepAt_ = 64;
};

// The structures that instances name, by vkGetAccelerationStructureDeviceAddressKHR.
class StructuresByReference
{
public:
    void add(VkDeviceAddress reference, const std::shared_ptr<ValidatedStructure> &structure);
    // The last one that got the reference, of those that are constructed if there are any; null if all are gone.
    // CommandLogs::submissions is held.
    [[nodiscard]] std::shared_ptr<ValidatedStructure> at(VkDeviceAddress reference) const;
    // The one that got the reference and was not destroyed; null if there are several.
    [[nodiscard]] std::shared_ptr<ValidatedStructure> onlyAt(VkDeviceAddress reference) const;

private:
    mutable std::mutex mutex_;
    StructuresByAddress structures_;
};

// The structure that was constructed last at each location of memory. CommandLogs::submissions is held.
class ConstructedStructures
{
public:
    // Returns the one that was there before, if it is another one and still exists.
    std::shared_ptr<ValidatedStructure> set(const std::shared_ptr<ValidatedStructure> &structure);
    // Returns whether anything was ever constructed at the structure's location; true if that is not known.
    [[nodiscard]] bool wasAt(const ValidatedStructure &structure) const;
    void forget(VkDeviceMemory memory);

private:
    using Location = std::pair<VkDeviceMemory, VkDeviceSize>;
    [[nodiscard]] static Location locationOf(const ValidatedStructure &structure);

    static constexpr size_t kMost = size_t{1} << 18;
    std::map<Location, std::weak_ptr<ValidatedStructure>> structures_; // also those that are destroyed
    bool forgot_ = false;
};

// The structures that may hold micromaps, by the address of their memory.
class StructuresByMemory
{
public:
    // Before it, the address of the structure is set.
    void add(const std::shared_ptr<ValidatedStructure> &structure);
    // The micromaps that may be at the address now. CommandLogs::submissions is held.
    [[nodiscard]] std::vector<std::shared_ptr<ValidatedStructure>> at(VkDeviceAddress address) const;
    // Returns whether a micromap begins there or ever did; true if that is not known.
    [[nodiscard]] bool everAt(VkDeviceAddress address) const;
    // Returns whether the addresses of all are known.
    [[nodiscard]] bool isComplete() const;

private:
    mutable std::mutex mutex_;
    StructuresByAddress structures_;      // 0: the address is unknown
    std::set<VkDeviceAddress> addresses_; // of all, also those destroyed, up to a limit
    bool isFull_ = false;                 // more addresses are not known
};

struct ValidatedImage {
    VkFormat format = VK_FORMAT_UNDEFINED;
    VkImageCreateFlags flags = 0;
    uint32_t arrayLayers = 0;
};

struct ValidatedCommandPool {
    uint32_t family = 0;
    bool isProtected = false;
};

struct ValidatedObjects {
    std::atomic<bool> anyUnknown = false; // something could not be kept
    StructuresByMemory byMemory;
    StructuresByReference byReference;
    DestroyedHandles destroyed;
    LostStructures lost;
    ConstructedStructures constructed;
    uint64_t constructions = 0; // how often a structure got contents. CommandLogs::submissions is held
    HandleMap<VkDeviceMemory, ValidatedMemory> memories;
    HandleMap<VkQueryPool, std::shared_ptr<ValidatedQueryPool>> queryPools;
    HandleMap<VkBuffer, std::shared_ptr<ValidatedBuffer>> buffers;
    std::atomic<bool> hasProtectedBuffers = false;
    std::atomic<uint64_t> bufferLosses = 0; // buffers that were destroyed or whose memory was freed
    HandleMap<VkAccelerationStructureKHR, std::shared_ptr<ValidatedStructure>> structures;
    HandleMap<VkMicromapEXT, std::shared_ptr<ValidatedStructure>> micromaps;
    HandleMap<VkImage, std::shared_ptr<const ValidatedImage>> images;
    // Words of modules that trace rays, or have an entry point with the execution mode OpacityMicromapIdKHR.
    HandleMap<VkShaderModule, std::shared_ptr<const std::vector<uint32_t>>> modules;
    HandleMap<VkPipeline, std::optional<VkFlags64>> libraries; // flags of pipeline libraries
    DescriptorTracker descriptors;
    HandleMap<VkQueue, uint32_t> queueFamilies;
    HandleMap<VkCommandPool, ValidatedCommandPool> commandPools;

    // The micromap or acceleration structure of a handle; null: unknown.
    [[nodiscard]] std::shared_ptr<ValidatedStructure> structureOf(ObjectHandle handle) const;
};

// Keeps what validation knows of an object or a submission after the implementation has made it, when nothing may fail
// any more: without memory, it stays unknown.
template <typename Keep>
bool remember(ValidatedObjects &objects, Keep keep) noexcept
{
    try {
        keep();
        return true;
    } catch (const std::bad_alloc &) {
        objects.anyUnknown = true;
        return false;
    }
}

// A command that is executed refers to an object. CommandLogs::submissions is held.
void addUse(ReferredObject &object, const Submission &submission, CommandUse use);
// Gives a structure new contents. CommandLogs::submissions is held: in steps it is.
void setContents(DeviceModel &device, const std::shared_ptr<ValidatedStructure> &structure,
                 std::shared_ptr<const StructureContents> contents);
// A structure is built with the micromap. CommandLogs::submissions is held.
void setAttached(ValidatedStructure &micromap, bool isOrdered);
// Instances name the structure by that address.
void setReference(DeviceModel &device, const std::shared_ptr<ValidatedStructure> &structure, VkDeviceAddress address);
// As above, for a structure that is about to be constructed: the application may know the address from an earlier one
// that was there. `structure`: null if it is unknown.
void findReference(DeviceModel &device, const std::shared_ptr<ValidatedStructure> &structure);
// Returns whether structures may keep a copy of a micromap that they attach. CommandLogs::submissions is held.
bool mayBeDiscardable(const DeviceModel &device, const ValidatedStructure &micromap);
// Why a structure is not constructed, as a clause; empty: it is, or that is not known.
std::string isNotConstructed(const DeviceModel &device, const ValidatedStructure &structure);
// Why a structure has no memory, as a clause; null: it has memory, or that is not known.
const char *lacksMemory(const DeviceModel &device, const ValidatedStructure &structure);
// The contents of a structure whose build or copy does not show them.
std::shared_ptr<StructureContents> unknownContents(VkAccelerationStructureTypeKHR type);
// A part of a buffer, up to its end; unknown without a buffer or its memory.
MemoryRange memoryIn(const ValidatedBuffer *buffer, VkDeviceSize offset, VkDeviceSize size);
// The buffer at an address; null if there is none or it is unknown.
std::shared_ptr<ValidatedBuffer> bufferAt(const DeviceModel &device, VkDeviceAddress address);

} // namespace vellum::layer
