// SPDX-License-Identifier: Apache-2.0
#include "layer/rules/rule.h"

#include <algorithm>
#include <cinttypes>
#include <cstdio>

#include "layer/base/pnext.h"
#include "layer/rules/ids.h"
#include "vk/enum_names.h"

namespace vellum::layer
{
namespace
{

std::string nameIn(std::span<const EnumName> names, int64_t value)
{
    const auto found = std::ranges::find(names, value, &EnumName::value);
    return found == names.end() ? std::to_string(value) : found->name;
}

} // namespace

std::string hex(uint64_t number)
{
    char text[24];
    std::snprintf(text, sizeof text, "0x%" PRIx64, number);
    return text;
}

std::string nameOf(VkStructureType type)
{
    const char *name = structureName(type);
    return name ? name : std::to_string(type);
}

std::string nameOf(VkQueryType type)
{
    return nameIn(kQueryTypeNames, type);
}

std::string nameOf(VkIndexType type)
{
    return nameIn(kIndexTypeNames, type);
}

std::string nameOf(VkMicromapTypeEXT type)
{
    return nameIn(kMicromapTypeEXTNames, type);
}

std::string nameOfFormat(uint32_t format)
{
    return nameIn(kOpacityMicromapFormatEXTNames, format);
}

std::string RuleDevice::nameOf(ObjectHandle object) const
{
    const std::string name = driver.report().nameOf(object.handle);
    return name.empty() ? hex(object.handle) : "\"" + name + "\" (" + hex(object.handle) + ")";
}

Found lacksHostCommands(const RuleDevice &device)
{
    return when(!device.driver.enabled.hostCommands, "the feature micromapHostCommands is not enabled");
}

Found isUnbound(const ObjectFacts &object)
{
    return when(object.lacksMemory != nullptr, [&] { return object.lacksMemory; });
}

Found isInvalid(const RuleDevice &device, VkDeviceAddress address, Severity severity)
{
    if (address == 0)
        return {"the address is null", severity};
    return when(
        device.validating && device.lacksBuffer && device.lacksBuffer(address),
        [&] {
            return "no buffer with memory has the address " + hex(address) +
                   ": there was none, it was destroyed, or its memory was freed";
        },
        severity);
}

Found isUnknown(const ObjectFacts &object, const char *otherwise)
{
    return when(!object.exists, object.destroyed ? "it was destroyed" : otherwise);
}

bool lacksUsage(const RuleDevice &device, VkDeviceAddress address, VkFlags64 usage)
{
    return device.addresses.find(address).buffer && !device.addresses.covering(address, 1, usage).buffer;
}

Verdict InputCheck::report(const char *id, const char *member, const std::string &text, Severity severity) const
{
    if (severity == Severity::Report && !device_.validating)
        return {};
    Reporter &reporter = device_.driver.report();
    const bool tolerated = severity != Severity::Reject && !(severity == Severity::Tolerate && reporter.isStrict());
    const Verdict verdict{.accepted = tolerated, .kept = false};
    if (isReported_)
        return verdict;
    const std::string where = (member ? place_.member(member).text() : place_.text()) + ": ";
    id = rules::ids::idAt(where, id);
    const bool goesOn = tolerated && severity == Severity::Tolerate && device_.implements(object_);
    const std::string message = where + text + (goesOn ? "; the layer goes on" : "");
    if (goesOn && !device_.validating)
        reporter.warning(id, message, object_.type, object_.handle);
    else
        reporter.error(id, message, object_.type, object_.handle);
    return verdict;
}

} // namespace vellum::layer
