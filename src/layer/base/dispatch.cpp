// SPDX-License-Identifier: Apache-2.0
#include "layer/base/dispatch.h"

#include <algorithm>
#include <string_view>

#include "layer/base/command_aliases.h"

namespace vellum::layer
{
namespace
{

// The first of a command's names that `get` returns a function for: its own, and those of its aliases.
template <typename Get>
PFN_vkVoidFunction findByAnyName(const char *name, bool aliasesFirst, Get get)
{
    PFN_vkVoidFunction found = aliasesFirst ? nullptr : get(name);
    const char *command = commandOf(name);
    for (const CommandAlias &alias : kCommandAliases) {
        if (!found && std::string_view(command) == alias.command)
            found = get(alias.alias);
    }
    return found ? found : get(command);
}

} // namespace

const char *commandOf(const char *name)
{
    const auto *alias = std::ranges::lower_bound(kCommandAliases, std::string_view(name), {},
                                                 [](const CommandAlias &a) { return std::string_view(a.alias); });
    return alias != std::end(kCommandAliases) && std::string_view(alias->alias) == name ? alias->command : name;
}

PFN_vkVoidFunction commandByAnyName(VkDevice device, PFN_vkGetDeviceProcAddr next, const char *name)
{
    return findByAnyName(name, false, [=](const char *any) { return next(device, any); });
}

void InstanceTable::load(VkInstance instance, PFN_vkGetInstanceProcAddr next, bool core)
{
    GetInstanceProcAddr = next;
    const auto get = [=](const char *name) { return next(instance, name); };
#define VELLUM_LOAD(name) name = reinterpret_cast<PFN_vk##name>(findByAnyName("vk" #name, !core, get));
    VELLUM_INSTANCE_COMMANDS(VELLUM_LOAD)
#undef VELLUM_LOAD
}

void DeviceTable::load(VkDevice device, PFN_vkGetDeviceProcAddr next)
{
    GetDeviceProcAddr = next;
    const auto get = [=](const char *name) { return commandByAnyName(device, next, name); };
#define VELLUM_LOAD(name) name = reinterpret_cast<PFN_vk##name>(get("vk" #name));
#define VELLUM_LOAD_NEWER(name, type) name = reinterpret_cast<newer::PFN_##type>(get("vk" #name));
    VELLUM_DEVICE_COMMANDS(VELLUM_LOAD)
    VELLUM_NEWER_DEVICE_COMMANDS(VELLUM_LOAD_NEWER)
#undef VELLUM_LOAD
#undef VELLUM_LOAD_NEWER
}

} // namespace vellum::layer
