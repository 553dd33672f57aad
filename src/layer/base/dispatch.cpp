// SPDX-License-Identifier: Apache-2.0
#include "layer/base/dispatch.h"

#include <algorithm>
#include <string_view>

#include "vk/command_aliases.h"

namespace vellum::layer
{
namespace
{

// The function of a command by the first of its names that `get` has: its own, those of its aliases, the one promoted
// to.
template <typename Get>
PFN_vkVoidFunction findByAnyName(const char *name, bool aliasesFirst, Get get)
{
    PFN_vkVoidFunction found = aliasesFirst ? nullptr : get(name);
    if (found)
        return found;
    const std::string_view command = commandOf(name);
    for (const CommandAlias &alias : kCommandAliases) {
        if (!found && command == alias.command)
            found = get(alias.alias);
    }
    return found ? found : get(command.data());
}

} // namespace

const char *commandOf(const char *name)
{
    const auto *alias = std::ranges::lower_bound(kCommandAliases, std::string_view(name), {},
                                                 [](const CommandAlias &a) { return std::string_view(a.alias); });
    return alias != std::end(kCommandAliases) && std::string_view(alias->alias) == name ? alias->command : name;
}

void InstanceTable::load(VkInstance instance, PFN_vkGetInstanceProcAddr next, bool core)
{
    GetInstanceProcAddr = next;
    const auto get = [=](const char *name) { return next(instance, name); };
#define VELLUM_INSTANCE(command, ...)                                                                                  \
    command = reinterpret_cast<PFN_vk##command>(findByAnyName("vk" #command, !core, get));
#include "layer/base/commands.inc"
}

void DeviceTable::load(VkDevice device, PFN_vkGetDeviceProcAddr next)
{
    const auto get = [=](const char *name) { return next(device, name); };
#define VELLUM_DEVICE(command, ...)                                                                                    \
    command = reinterpret_cast<PFN_vk##command>(findByAnyName("vk" #command, false, get));
#include "layer/base/commands.inc"
    GetDeviceProcAddr = next;
}

} // namespace vellum::layer
