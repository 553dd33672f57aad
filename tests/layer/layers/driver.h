// SPDX-License-Identifier: Apache-2.0
// The mock driver: a layer between Vellum and lavapipe that simulates other drivers. The differences of such a driver
// are a list of quirks (quirks.cpp). The environment variable VELLUM_TEST_MOCK_DRIVER selects them when an instance is
// created: names, separated by commas. The code of a quirk is a level: its own versions of some commands, which call
// those of the next level and finally lavapipe's.
//
// Each quirk enforces what it advertises: it validates the layer's calls and reports violations to the debug
// messengers, or breaks visibly.
#pragma once

#include <vulkan/vk_layer.h>

#include "vellum/vulkan_opacity_micromap.h"
#include "vk/vk_init.h"

#include <algorithm>
#include <cstdint>
#include <map>
#include <mutex>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace driver
{

// In order from the application to lavapipe.
enum class Level {
    // of the mock driver
    Deferral,
    Spy,
    Ext,
    Vendors,
    Heaps,
    Failures,
    Caches,
    Limits,
    Queues,
    Structures,
    Memory,
    Addresses,
    Replay,
    IndirectBuilds,
    Garbage,
    Unsupported,
    // of the faulty driver (faulty_driver/faults.h)
    Process,
    Shaders,
    Instances,
    Attachments,
    Copies,
    Generic,
    Boxes,
    Micromaps,
    Commands,
    State,
    Submissions,
    // of the recorder (recorder/recorder.cpp)
    Recorder
};

struct Row {
    // Without the suffix KHR.
    const char *name;
    PFN_vkVoidFunction function;
    enum class Where { LavapipeHasIt, Always } where = Where::LavapipeHasIt;
    bool (*when)() = nullptr; // called when a function is looked up; null: always present
};
#define DRIVER_FUNCTION(name) reinterpret_cast<PFN_vkVoidFunction>(name)

struct LevelRows {
    std::span<const Row> device;
    std::span<const Row> instance; // of instances and physical devices; vkCreateDevice is one of these
};
// The rows of each level, defined in the file of that name.
LevelRows spyRows();
LevelRows failureRows();
LevelRows cacheRows();
LevelRows deferralRows();
LevelRows extRows();
LevelRows vendorRows();
LevelRows heapRows();
LevelRows limitRows();
LevelRows queueRows();
LevelRows structureRows();
LevelRows memoryRows();
LevelRows addressRows();
LevelRows replayRows();
LevelRows indirectBuildRows();
LevelRows garbageRows();
LevelRows unsupportedRows();

struct Quirk {
    const char *name;
    Level level;
    const char *claim; // with what the specification says that allows it; of a fault, what is wrong
    // of faults
    const char *imitates = ""; // the driver, engine or tool that had it, or the mistake behind it
    const char *quirks = "";   // of the mock driver, without which it does not show
};
struct NamedLevel {
    Level level;
    LevelRows rows;
    bool always = false; // also where no chosen quirk belongs to it
};
// The quirks and levels of this layer: of the mock driver in quirks.cpp, of the faulty driver in
// faulty_driver/faults.cpp.
std::span<const Quirk> allQuirks();
std::span<const NamedLevel> allLevels();
// The environment variable with the names of the chosen quirks.
extern const char *const kQuirkVariable;

// The dispatch key.
template <class Handle>
void *keyOf(Handle handle)
{
    return *reinterpret_cast<void **>(handle);
}

// True if the device or instance has the quirk.
bool has(void *key, std::string_view quirk);
bool hasAny(void *key, Level level);
VkInstance instanceOf(void *key);
VkDevice deviceOf(void *key);

// The next level's command; null where neither it nor lavapipe has one.
PFN_vkVoidFunction nextFunction(Level level, void *key, const char *name);
template <class Function>
Function next(Level level, void *key, const char *name)
{
    return reinterpret_cast<Function>(nextFunction(level, key, name));
}
// For files with a constant kLevel and functions whose dispatchable object is `handle`.
#define DRIVER_NEXT(function) driver::next<PFN_##function>(kLevel, driver::keyOf(handle), #function)

// Reports to all debug messengers.
void report(const std::string &text, const char *id = "DRIVER");

template <class T = void>
const T *inChain(const void *chain, VkStructureType type)
{
    const auto *structure = static_cast<const VkBaseInStructure *>(chain);
    while (structure != nullptr && structure->sType != type)
        structure = structure->pNext;
    return static_cast<const T *>(static_cast<const void *>(structure));
}
// The structure of an output chain, or one of the test that this layer changes.
template <class T>
T *inChainOut(const void *chain, VkStructureType type)
{
    return const_cast<T *>(inChain<T>(chain, type));
}

// Implements a vkEnumerate* command.
template <class T>
VkResult list(std::span<const T> all, uint32_t *count, T *out)
{
    const auto size = static_cast<uint32_t>(all.size());
    if (out == nullptr) {
        *count = size;
        return VK_SUCCESS;
    }
    *count = std::min(*count, size);
    std::copy_n(all.begin(), *count, out);
    return *count < size ? VK_INCOMPLETE : VK_SUCCESS;
}

// Answers vkEnumerateDeviceExtensionProperties for the level by the next level's list, changed by `change`.
template <class Change>
VkResult listExtensions(Level level, VkPhysicalDevice handle, const char *layer, uint32_t *count,
                        VkExtensionProperties *properties, Change change)
{
    const auto next = driver::next<PFN_vkEnumerateDeviceExtensionProperties>(level, keyOf(handle),
                                                                             "vkEnumerateDeviceExtensionProperties");
    if (layer != nullptr)
        return next(handle, layer, count, properties);
    uint32_t below = 0;
    if (const VkResult result = next(handle, nullptr, &below, nullptr); result != VK_SUCCESS)
        return result;
    std::vector<VkExtensionProperties> all(below);
    if (const VkResult result = next(handle, nullptr, &below, all.data()); result != VK_SUCCESS)
        return result;
    change(all);
    return list<VkExtensionProperties>(all, count, properties);
}

// Buffers by address, for a quirk that writes where a command names an address.
class AddressedBuffers
{
public:
    struct Found {
        VkBuffer buffer = VK_NULL_HANDLE;
        VkDeviceSize offset = 0;
    };
    // Creates a buffer that transfers can write to, and remembers it.
    VkResult create(Level level, VkDevice handle, const VkBufferCreateInfo &info,
                    const VkAllocationCallbacks *allocator, VkBuffer *buffer)
    {
        VkBufferCreateInfo below = info;
        below.usage |= VK_BUFFER_USAGE_TRANSFER_DST_BIT;
        const VkResult result =
            next<PFN_vkCreateBuffer>(level, keyOf(handle), "vkCreateBuffer")(handle, &below, allocator, buffer);
        std::lock_guard lock(mutex_);
        if (result == VK_SUCCESS)
            sizes_[*buffer] = info.size;
        return result;
    }
    void forget(VkBuffer buffer)
    {
        std::lock_guard lock(mutex_);
        sizes_.erase(buffer);
        std::erase_if(addressed_, [buffer](const auto &entry) { return entry.second == buffer; });
    }
    [[nodiscard]] bool has(VkBuffer buffer) const
    {
        std::lock_guard lock(mutex_);
        return sizes_.contains(buffer);
    }
    // Of a buffer that it does not have it remembers nothing.
    void setAddress(VkDevice handle, VkBuffer buffer, VkDeviceAddress address)
    {
        std::lock_guard lock(mutex_);
        if (sizes_.contains(buffer))
            addressed_[{keyOf(handle), address}] = buffer;
    }
    // Buffers may share memory: any that holds all of it.
    [[nodiscard]] Found find(VkCommandBuffer handle, VkDeviceAddress address, VkDeviceSize bytes) const
    {
        std::lock_guard lock(mutex_);
        for (const auto &[at, buffer] : addressed_)
            if (at.first == keyOf(handle) && at.second <= address && address + bytes <= at.second + sizes_.at(buffer))
                return {buffer, address - at.second};
        return {};
    }

private:
    mutable std::mutex mutex_;
    std::map<VkBuffer, VkDeviceSize> sizes_;
    std::map<std::pair<void *, VkDeviceAddress>, VkBuffer> addressed_;
};

} // namespace driver
