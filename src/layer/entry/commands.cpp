// SPDX-License-Identifier: Apache-2.0
// The intercepted commands: which there are on an instance and on a device, as the functions that Vulkan calls.
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdio>
#include <exception>
#include <string_view>
#include <type_traits>

#include "layer/base/commands.h"
#include "layer/entry/device.h"
#include "layer/validation/commands.h"
#include "layer/validation/rules/rule_check.h"

namespace vellum::layer
{
namespace
{

// No exception crosses the Vulkan ABI. The layer throws none; the standard library does when memory runs out.
template <typename Result, typename Function>
Result guarded(Function function) noexcept
{
    try {
        return function();
    } catch (const std::exception &) {
        std::fputs("vellum: VELLUM-out-of-memory: out of host memory; the command was not carried out\n", stderr);
    }
    if constexpr (std::is_same_v<Result, VkResult>)
        return VK_ERROR_OUT_OF_HOST_MEMORY;
    else if constexpr (!std::is_void_v<Result>)
        return Result{};
}

// A function with the signature that Vulkan calls.
template <auto function>
struct Command;

template <typename Result, typename First, typename... Others, Result(VKAPI_PTR *function)(First, Others...)>
requires(!std::is_reference_v<First>) struct Command<function> {
    static VKAPI_ATTR Result VKAPI_CALL call(First first, Others... others) noexcept
    {
        return guarded<Result>([&] { return function(first, others...); });
    }
};

// A command of a subsystem. It gets the subsystem's part of the device.
template <typename Result, typename Subsystem, typename Handle, typename... Arguments,
          Result (*function)(Subsystem &, Handle, Arguments...)>
struct Command<function> {
    static VKAPI_ATTR Result VKAPI_CALL call(Handle handle, Arguments... arguments) noexcept
    {
        return guarded<Result>(
            [&] { return function(subsystemOf<Subsystem>(deviceOf(handle)), handle, arguments...); });
    }
};

// The name of a command, as an argument of a template.
struct CommandName {
    char text[64]{};
    template <size_t size>
    consteval CommandName(const char (&name)[size])
    {
        std::copy_n(name, size, text);
    }
};

// A command as Vulkan calls it. It gets the validation of the device.
template <CommandName name, auto function>
struct Validated;

template <CommandName name, typename Result, typename Handle, typename... Arguments,
          Result (*function)(DeviceValidation &, Handle, Arguments...)>
struct Validated<name, function> {
    static VKAPI_ATTR Result VKAPI_CALL call(Handle handle, Arguments... arguments) noexcept
    {
        return guarded<Result>([&] {
            DeviceValidation &device = *deviceOf(handle).validation;
            constexpr VkQueueFlags kQueues = queuesOf(name.text);
            if constexpr (kQueues != 0)
                checkCommand(device, handle, name.text, kQueues);
            return function(device, handle, arguments...);
        });
    }
};

// A command without function.
constexpr std::nullptr_t none = nullptr;
template <>
struct Command<none> {
};

template <typename Called>
PFN_vkVoidFunction functionOf()
{
    if constexpr (requires { &Called::call; })
        return reinterpret_cast<PFN_vkVoidFunction>(&Called::call);
    else
        return nullptr;
}

// The instances or devices on which the layer intercepts a command.
enum class Scope {
    Never,          // only validated, or called by the layer
    Global,         // before there is an instance
    Instance,       // if the next layer has the command
    Device,         // every device
    Debug,          // every device, if the next layer has it; loaders call it through the chain of the instance
    Emulated,       // emulated devices, if the next layer has it
    Provided,       // emulated and translated devices, if the next layer has it
    Shaders,        // these, devices of Mode::Identifiers, and those on which assume_micromaps counts
    Heaps,          // as Provided, with VK_EXT_descriptor_heap
    Ext,            // emulated devices with VK_EXT_opacity_micromap
    Address,        // devices with the layer's VK_KHR_device_address_commands
    AddressEnabled, // emulated and translated devices with VK_KHR_device_address_commands, of the layer or the driver
};

// A command of base/commands.inc.
struct Row {
    const char *command; // name in the registry
    Scope scope;
    PFN_vkVoidFunction function;             // of the implementation; may be null
    PFN_vkVoidFunction validation = nullptr; // validates the command and calls the implementation; may be null
    std::string_view required = {};          // the function is there only if the driver has this command
};

// Sorted by command.
const auto kRows = [] {
    auto rows = std::to_array<Row>({
#define VELLUM_GLOBAL(command, function) {"vk" #command, Scope::Global, functionOf<Command<function>>()},
#define VELLUM_INSTANCE(command, scope, function)                                                                      \
    {commandOf("vk" #command), Scope::scope, functionOf<Command<function>>()},
#define VELLUM_VALIDATION(command, validator, ...)                                                                     \
    functionOf<Validated<"vk" #command, validation::validator>>() __VA_OPT__(, "vk" #__VA_ARGS__)
#define VELLUM_DEVICE(command, scope, function, ...)                                                                   \
    {commandOf("vk" #command), Scope::scope,                                                                           \
     functionOf<Command<function>>() __VA_OPT__(, VELLUM_VALIDATION(command, __VA_ARGS__))},
#include "layer/base/commands.inc"
#undef VELLUM_VALIDATION
    });
    std::ranges::sort(rows, {}, [](const Row &row) { return std::string_view(row.command); });
    return rows;
}();

// The row of a command, by any of its names.
const Row *find(const char *name)
{
    const std::string_view command = commandOf(name);
    const auto *row =
        std::ranges::lower_bound(kRows, command, {}, [](const Row &r) { return std::string_view(r.command); });
    return row != kRows.end() && row->command == command ? row : nullptr;
}

// Returns whether the layer intercepts a command on a device; `next` is the command of the next layer.
bool applies(Scope scope, const Driver &driver, PFN_vkVoidFunction next)
{
    const bool provided = driver.providesMicromaps();
    switch (scope) {
    case Scope::Never:
    case Scope::Global:
    case Scope::Instance: return false;
    case Scope::Device: return true;
    case Scope::Debug: return next;
    case Scope::Emulated: return next && driver.emulated();
    case Scope::Shaders: return next && (driver.mode != Mode::PassThrough || driver.assumesMicromaps());
    case Scope::Provided: return next && provided;
    case Scope::Heaps: return next && provided && driver.enabled.descriptorHeaps;
    case Scope::Ext: return driver.emulated() && driver.enabled.ext;
    case Scope::Address: return provided && driver.ownAddressCommands;
    case Scope::AddressEnabled: return provided && driver.enabled.addressCommands;
    }
    return false;
}

} // namespace

// A device command that is queried by instance has to serve all devices of the instance, emulated or not. So the layer
// returns those of the next layer, except vkDestroyDevice and vkGetDeviceProcAddr, which every device has. The loader
// queries the others for each device, by vkGetDeviceProcAddr.
VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getInstanceProcAddr(VkInstance handle, const char *name)
{
    const Row *r = find(name);
    if (r && r->scope == Scope::Global)
        return r->function;
    // Layers above may query instance commands without an instance, as MangoHud 0.6.8 and vkBasalt 0.3.2 do for
    // vkCreateDevice.
    if (!handle)
        return r && (r->scope == Scope::Instance || r->scope == Scope::Device) ? r->function : nullptr;
    Instance &instance = instanceOf(handle);
    const PFN_vkVoidFunction next = instance.next.GetInstanceProcAddr(handle, name);
    const bool isLayerCommand =
        r && (r->scope == Scope::Instance || r->scope == Scope::Device || r->scope == Scope::Debug);
    if (isLayerCommand && next)
        return r->function;
    return next;
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL implementationProcAddr(VkDevice handle, const char *name)
{
    const Row *row = find(name);
    if (row && row->scope == Scope::Device)
        return row->function;
    Device *device = deviceOfKey(dispatchKey(handle));
    if (!device)
        return nullptr;
    const Driver &driver = device->driver;
    const PFN_vkVoidFunction next = driver.next.GetDeviceProcAddr(handle, name);
    if (!row)
        return next;
    if (!row->required.empty() && driver.providesMicromaps() &&
        !driver.next.GetDeviceProcAddr(handle, row->required.data()))
        return nullptr;
    // On translated devices the layer has enabled VK_EXT_opacity_micromap, and not the application.
    if (row->scope == Scope::Ext && driver.translated() && !driver.enabled.ext)
        return nullptr;
    return applies(row->scope, driver, next) ? row->function : next;
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getDeviceProcAddr(VkDevice handle, const char *name)
{
    const PFN_vkVoidFunction function = implementationProcAddr(handle, name);
    const Device *device = deviceOfKey(dispatchKey(handle));
    if (!function || !device || !device->validation)
        return function;
    const Row *row = find(name);
    return row && row->validation ? row->validation : function;
}

} // namespace vellum::layer
