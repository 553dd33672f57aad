// SPDX-License-Identifier: Apache-2.0
// The entry of the mock driver and of the faulty driver: instances, devices, and which level's function is called.
#include "layers/driver.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <memory>
#include <set>
#include <unordered_map>
#include <vector>

namespace driver
{
namespace
{

std::mutex mutex;

struct Messenger {
    VkDebugUtilsMessengerEXT handle;
    PFN_vkDebugUtilsMessengerCallbackEXT callback;
    void *user;
};
std::vector<Messenger> messengers;

// A second row of a name would never be called.
void expectOnce(std::span<const Row> rows)
{
    std::set<std::string_view> names;
    for (const Row &row : rows) {
        if (row.when != nullptr || names.insert(row.name).second)
            continue;
        std::fprintf(stderr, "mock driver: a level has two rows for %s\n", row.name);
        std::abort();
    }
}

std::span<const NamedLevel> levels()
{
    static const std::span<const NamedLevel> all = [] {
        for (const NamedLevel &level : allLevels()) {
            expectOnce(level.rows.device);
            expectOnce(level.rows.instance);
        }
        return allLevels();
    }();
    return all;
}

struct Quirks {
    std::set<std::string, std::less<>> names;
    std::set<Level> levels;
};

struct Instance {
    VkInstance handle = VK_NULL_HANDLE;
    PFN_vkGetInstanceProcAddr get = nullptr;
    std::shared_ptr<const Quirks> quirks;
    // Looked up at creation: later, the loader's end of the chain may answer with the chain's beginning.
    std::map<std::string, PFN_vkVoidFunction, std::less<>> below;
};
struct Device {
    VkDevice handle = VK_NULL_HANDLE;
    PFN_vkGetDeviceProcAddr get = nullptr;
    VkInstance instance = VK_NULL_HANDLE;
    std::shared_ptr<const Quirks> quirks;
    // Keyed by level and name; names are string literals.
    std::map<std::pair<Level, const char *>, PFN_vkVoidFunction> found;
};
// By dispatch key. Entries are never erased; a later handle with the same key replaces them.
std::unordered_map<void *, Instance> instances;
std::unordered_map<void *, Device> devices;

// Returns null and prints a message if a name is not that of a quirk.
std::shared_ptr<const Quirks> chosenQuirks(const char *list)
{
    auto chosen = std::make_shared<Quirks>();
    for (std::string_view rest = list == nullptr ? "" : list; !rest.empty();) {
        const std::string_view name = rest.substr(0, rest.find(','));
        rest.remove_prefix(std::min(name.size() + 1, rest.size()));
        const auto all = allQuirks();
        const auto quirk = std::find_if(all.begin(), all.end(), [name](const Quirk &t) { return t.name == name; });
        if (name.empty())
            continue;
        if (quirk == all.end()) {
            std::fprintf(stderr, "%s: there is no '%.*s'\n", kQuirkVariable, static_cast<int>(name.size()),
                         name.data());
            return nullptr;
        }
        chosen->names.emplace(name);
        chosen->levels.insert(quirk->level);
    }
    return chosen;
}

bool isName(std::string_view name, std::string_view row)
{
    return name.starts_with(row) && (name.size() == row.size() || name.substr(row.size()) == "KHR");
}

const Row *rowOf(std::span<const Row> rows, std::string_view name)
{
    const auto found =
        std::find_if(rows.begin(), rows.end(), [name](const Row &row) { return isName(name, row.name); });
    return found == rows.end() ? nullptr : &*found;
}

// The first of the levels behind `after` that has the command; of all levels where there is no `after`.
const Row *rowBehind(const Quirks &quirks, const Level *after, std::span<const Row> LevelRows::*rows,
                     std::string_view name, bool always = false)
{
    for (const NamedLevel &level : levels()) {
        if ((after != nullptr && level.level <= *after) || !(level.always || quirks.levels.contains(level.level)))
            continue;
        const Row *row = rowOf(level.rows.*rows, name);
        if (row != nullptr && (row->when == nullptr || row->when()) && (!always || row->where == Row::Where::Always))
            return row;
    }
    return nullptr;
}

// A command of a device behind `after`, where lavapipe has it, or one of the levels by itself.
PFN_vkVoidFunction commandBehind(const Quirks &quirks, const Level *after, const char *name, PFN_vkVoidFunction below)
{
    const Row *row = rowBehind(quirks, after, &LevelRows::device, name);
    const bool there =
        below != nullptr || rowBehind(quirks, after, &LevelRows::device, name, /* always */ true) != nullptr;
    return row != nullptr && there ? row->function : below;
}

// --- what every mock driver has ---

// The loader's link to the layer below, which is moved on for that layer's own use.
template <class Link>
Link *linkOf(const void *chain, VkStructureType type)
{
    auto *structure = static_cast<Link *>(const_cast<void *>(chain));
    while (structure != nullptr && !(structure->sType == type && structure->function == VK_LAYER_LINK_INFO))
        structure = static_cast<Link *>(const_cast<void *>(structure->pNext));
    return structure;
}

constexpr const char *kAlwaysWanted[]{"vkCreateDebugUtilsMessengerEXT", "vkDestroyDebugUtilsMessengerEXT",
                                      "vkGetPhysicalDeviceQueueFamilyProperties",
                                      "vkGetPhysicalDeviceMemoryProperties"};

VKAPI_ATTR VkResult VKAPI_CALL createInstance(const VkInstanceCreateInfo *info, const VkAllocationCallbacks *allocator,
                                              VkInstance *instance)
{
    const auto quirks = chosenQuirks(std::getenv(kQuirkVariable));
    if (quirks == nullptr)
        return VK_ERROR_LAYER_NOT_PRESENT;
    auto *link = linkOf<VkLayerInstanceCreateInfo>(info->pNext, VK_STRUCTURE_TYPE_LOADER_INSTANCE_CREATE_INFO);
    const PFN_vkGetInstanceProcAddr get = link->u.pLayerInfo->pfnNextGetInstanceProcAddr;
    link->u.pLayerInfo = link->u.pLayerInfo->pNext;
    const auto create = reinterpret_cast<PFN_vkCreateInstance>(get(VK_NULL_HANDLE, "vkCreateInstance"));
    const VkResult result = create(info, allocator, instance);
    if (result != VK_SUCCESS)
        return result;
    Instance made{*instance, get, quirks, {}};
    for (const char *name : kAlwaysWanted)
        made.below[name] = get(*instance, name);
    for (const NamedLevel &level : levels()) {
        for (const Row &row : level.rows.instance)
            made.below[row.name] = get(*instance, row.name);
    }
    std::lock_guard lock(mutex);
    devices.erase(keyOf(*instance)); // one that is gone
    instances[keyOf(*instance)] = std::move(made);
    return result;
}

// The last level calls this.
VKAPI_ATTR VkResult VKAPI_CALL createDriversDevice(VkPhysicalDevice physical, const VkDeviceCreateInfo *info,
                                                   const VkAllocationCallbacks *allocator, VkDevice *device)
{
    auto *link = linkOf<VkLayerDeviceCreateInfo>(info->pNext, VK_STRUCTURE_TYPE_LOADER_DEVICE_CREATE_INFO);
    const PFN_vkGetInstanceProcAddr getInstance = link->u.pLayerInfo->pfnNextGetInstanceProcAddr;
    const PFN_vkGetDeviceProcAddr get = link->u.pLayerInfo->pfnNextGetDeviceProcAddr;
    link->u.pLayerInfo = link->u.pLayerInfo->pNext;
    const VkInstance instance = instanceOf(keyOf(physical));
    const auto create = reinterpret_cast<PFN_vkCreateDevice>(getInstance(instance, "vkCreateDevice"));
    const VkResult result = create(physical, info, allocator, device);
    if (result == VK_SUCCESS) {
        std::lock_guard lock(mutex);
        devices[keyOf(*device)] = {*device, get, instance, instances.at(keyOf(physical)).quirks, {}};
    }
    return result;
}

VKAPI_ATTR VkResult VKAPI_CALL createDevice(VkPhysicalDevice physical, const VkDeviceCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkDevice *device)
{
    std::shared_ptr<const Quirks> quirks;
    {
        std::lock_guard lock(mutex);
        quirks = instances.at(keyOf(physical)).quirks;
    }
    const Row *row = rowBehind(*quirks, nullptr, &LevelRows::instance, "vkCreateDevice");
    const auto create = row != nullptr ? reinterpret_cast<PFN_vkCreateDevice>(row->function) : createDriversDevice;
    return create(physical, info, allocator, device);
}

template <class Function>
Function belowOfInstance(VkInstance instance, const char *name)
{
    std::lock_guard lock(mutex);
    return reinterpret_cast<Function>(instances.at(keyOf(instance)).below.at(name));
}

VKAPI_ATTR VkResult VKAPI_CALL createMessenger(VkInstance instance, const VkDebugUtilsMessengerCreateInfoEXT *info,
                                               const VkAllocationCallbacks *allocator, VkDebugUtilsMessengerEXT *out)
{
    const auto create = belowOfInstance<PFN_vkCreateDebugUtilsMessengerEXT>(instance, "vkCreateDebugUtilsMessengerEXT");
    const VkResult result = create(instance, info, allocator, out);
    if (result == VK_SUCCESS) {
        std::lock_guard lock(mutex);
        messengers.push_back({*out, info->pfnUserCallback, info->pUserData});
    }
    return result;
}

VKAPI_ATTR void VKAPI_CALL destroyMessenger(VkInstance instance, VkDebugUtilsMessengerEXT messenger,
                                            const VkAllocationCallbacks *allocator)
{
    {
        std::lock_guard lock(mutex);
        std::erase_if(messengers, [messenger](const Messenger &m) { return m.handle == messenger; });
    }
    belowOfInstance<PFN_vkDestroyDebugUtilsMessengerEXT>(instance, "vkDestroyDebugUtilsMessengerEXT")(
        instance, messenger, allocator);
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getDeviceProcAddr(VkDevice device, const char *name)
{
    if (std::strcmp(name, "vkGetDeviceProcAddr") == 0)
        return DRIVER_FUNCTION(getDeviceProcAddr);
    PFN_vkGetDeviceProcAddr get = nullptr;
    std::shared_ptr<const Quirks> quirks;
    {
        std::lock_guard lock(mutex);
        const Device &known = devices.at(keyOf(device));
        get = known.get;
        quirks = known.quirks;
    }
    return commandBehind(*quirks, nullptr, name, get(device, name));
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getInstanceProcAddr(VkInstance instance, const char *name)
{
    static constexpr std::pair<std::string_view, PFN_vkVoidFunction (*)()> kOwn[]{
        {"vkGetInstanceProcAddr", [] { return DRIVER_FUNCTION(getInstanceProcAddr); }},
        {"vkCreateInstance", [] { return DRIVER_FUNCTION(createInstance); }},
        {"vkGetDeviceProcAddr", [] { return DRIVER_FUNCTION(getDeviceProcAddr); }},
        {"vkCreateDevice", [] { return DRIVER_FUNCTION(createDevice); }},
        {"vkCreateDebugUtilsMessengerEXT", [] { return DRIVER_FUNCTION(createMessenger); }},
        {"vkDestroyDebugUtilsMessengerEXT", [] { return DRIVER_FUNCTION(destroyMessenger); }},
    };
    for (const auto &[own, function] : kOwn) {
        if (name == own)
            return function();
    }
    if (instance == VK_NULL_HANDLE)
        return nullptr;
    PFN_vkGetInstanceProcAddr get = nullptr;
    std::shared_ptr<const Quirks> quirks;
    {
        std::lock_guard lock(mutex);
        const Instance &known = instances.at(keyOf(instance));
        get = known.get;
        quirks = known.quirks;
    }
    for (const auto rows : {&LevelRows::instance, &LevelRows::device}) {
        if (const Row *row = rowBehind(*quirks, nullptr, rows, name))
            return row->function;
    }
    return get(instance, name);
}

} // namespace

namespace
{

const Quirks &quirksOf(void *key) // under the lock
{
    const auto device = devices.find(key);
    return device != devices.end() ? *device->second.quirks : *instances.at(key).quirks;
}

} // namespace

bool has(void *key, std::string_view quirk)
{
    std::lock_guard lock(mutex);
    return quirksOf(key).names.contains(quirk);
}

bool hasAny(void *key, Level level)
{
    std::lock_guard lock(mutex);
    return quirksOf(key).levels.contains(level);
}

VkInstance instanceOf(void *key)
{
    std::lock_guard lock(mutex);
    const auto device = devices.find(key);
    return device != devices.end() ? device->second.instance : instances.at(key).handle;
}

VkDevice deviceOf(void *key)
{
    std::lock_guard lock(mutex);
    return devices.at(key).handle;
}

PFN_vkVoidFunction nextFunction(Level level, void *key, const char *name)
{
    std::lock_guard lock(mutex);
    const auto found = devices.find(key);
    if (found == devices.end()) {
        const Instance &instance = instances.at(key);
        if (const Row *row = rowBehind(*instance.quirks, &level, &LevelRows::instance, name))
            return row->function;
        return std::strcmp(name, "vkCreateDevice") == 0 ? DRIVER_FUNCTION(createDriversDevice)
                                                        : instance.below.at(name);
    }
    Device &device = found->second;
    const auto [known, isNew] = device.found.try_emplace({level, name}, nullptr);
    if (isNew) {
        PFN_vkVoidFunction below = device.get(device.handle, name);
        if (below == nullptr) // in an older version of Vulkan, that of the extension
            below = device.get(device.handle, (std::string(name) + "KHR").c_str());
        known->second = commandBehind(*device.quirks, &level, name, below);
    }
    return known->second;
}

void report(const std::string &text, const char *id)
{
    std::vector<Messenger> all;
    {
        std::lock_guard lock(mutex);
        all = messengers;
    }
    auto data = vkInit<VkDebugUtilsMessengerCallbackDataEXT>({.pMessageIdName = id, .pMessage = text.c_str()});
    for (const Messenger &m : all)
        m.callback(VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT, VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT, &data,
                   m.user);
}

} // namespace driver

extern "C" __attribute__((visibility("default"))) VKAPI_ATTR VkResult VKAPI_CALL
vkNegotiateLoaderLayerInterfaceVersion(VkNegotiateLayerInterface *version)
{
    version->loaderLayerInterfaceVersion = 2;
    version->pfnGetInstanceProcAddr = driver::getInstanceProcAddr;
    version->pfnGetDeviceProcAddr = driver::getDeviceProcAddr;
    version->pfnGetPhysicalDeviceProcAddr = nullptr;
    return VK_SUCCESS;
}
