// SPDX-License-Identifier: Apache-2.0
// Rules of the input of commands. A rule is a row of a table: its id, what the layer does if it is broken, the member
// that it is about, and a function that finds the violation in a parsed value. Who validates evaluates all rows, and
// the layer's implementation of micromaps below takes the result (input/checked.h); without validation the
// implementation evaluates those rows that it depends on. Where micromaps are the driver's own, commands are passed on
// whatever is found.
#pragma once

#include <concepts>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>

#include "layer/base/driver.h"
#include "layer/input/builds.h"
#include "layer/memory/address_map.h"

namespace vellum::layer
{

// The location of a fault: a command, and the path from its parameters to a member. A place refers to the one around
// it, which must outlive it. Its text is made only for a fault.
class Place
{
public:
    explicit Place(const char *command) : name_(command) {}
    // The text of a place, which was kept, and which must outlive this one.
    explicit Place(const std::string &text) : name_(text.c_str()) {}

    [[nodiscard]] Place member(const char *name) const & { return {name, this, kNoIndex}; }
    [[nodiscard]] Place element(const char *array, uint32_t index) const & { return {array, this, index}; }
    Place member(const char *) && = delete;
    Place element(const char *, uint32_t) && = delete;

    [[nodiscard]] const char *command() const { return outer_ ? outer_->command() : name_; }
    // Such as "vkCmdBuildMicromapsEXT: pInfos[2].pUsageCounts[1]".
    [[nodiscard]] std::string text() const
    {
        if (!outer_)
            return name_;
        std::string text = outer_->text() + (outer_->outer_ ? "." : ": ") + name_;
        if (index_ != kNoIndex)
            text += "[" + std::to_string(index_) + "]";
        return text;
    }

private:
    static constexpr uint32_t kNoIndex = UINT32_MAX;
    Place(const char *name, const Place *outer, uint32_t index) : name_(name), outer_(outer), index_(index) {}

    const char *name_;
    const Place *outer_ = nullptr;
    uint32_t index_ = kNoIndex;
};

// The severity of a violation: the layer's implementation carries the command out or not.
enum class Severity : uint8_t {
    Report,   // it does not matter: the rule is checked by validation only
    Tolerate, // the command does no harm, and is carried out, as drivers do; with the setting `strict` it is rejected
    Reject,   // it would damage memory, read wild addresses or has no meaning
    Depends,  // the finding states which
};

// A violation: the text states what was found and what is expected. No violation: the text is empty.
struct Found {
    std::string text;
    Severity severity = Severity::Depends;
    explicit operator bool() const { return !text.empty(); }
};
template <typename Text>
Found when(bool broken, const Text &text, Severity severity = Severity::Depends)
{
    if (!broken)
        return {};
    if constexpr (std::invocable<Text>)
        return {text(), severity};
    else
        return {text, severity};
}

// A rule of a value of type Case.
template <typename Case>
struct Rule {
    const char *id; // id in the specification, or of Vellum
    Severity severity;
    const char *member; // null: the place of the check
    Found (*find)(const Case &);
};

// The limits of micromaps.
struct MicromapLimits {
    uint32_t twoStateLevel = 0;
    uint32_t fourStateLevel = 0;
    uint32_t lossyLevel = 0;    // VK_KHR_opacity_micromap
    uint64_t mostTriangles = 0; // VK_KHR_opacity_micromap
};
// The micromaps that the layer's implementation can build.
struct MicromapSupport {
    MicromapLimits limits;
    bool takesUnknownFormats = false;
    bool exists = true;      // false: the device has no micromaps, and uses the layer for addresses alone
    bool needsUsage = false; // buffers of micromaps need the usage of acceleration structures
};

// A device, as rules see it.
struct RuleDevice {
    const Driver &driver;
    const AddressMap &addresses;
    // Null where micromaps of that extension are the driver's own.
    std::optional<MicromapSupport> ext{}, khr{};
    // Returns the sizes that a build of a micromap needs; nullopt: they cannot be counted.
    std::function<std::optional<input::BuildNeeds>(const input::MicromapBuild &)> needs{};
    // The content of an acceleration structure, as the layer's implementation knows it; GENERIC: unknown.
    std::function<VkAccelerationStructureTypeKHR(ObjectHandle)> content{};

    // Returns whether the layer can place a micromap in the buffer at the offset. The address is 0 where it is not
    // known.
    std::function<bool(VkBuffer, VkDeviceSize offset, VkDeviceAddress)> placesMicromap{};

    // The rest is for validation: all rules are evaluated.
    bool validating = false;
    std::function<bool(VkDeviceAddress)> lacksBuffer{}; // no buffer has the address, as far as all are known
    MicromapLimits extLimits{}, khrLimits{};            // as the application sees them
    uint32_t scratchAlignment = 0;                      // 0: unknown

    [[nodiscard]] const std::optional<MicromapSupport> &support(bool isKhr) const { return isKhr ? khr : ext; }
    [[nodiscard]] const MicromapLimits &limits(bool isKhr) const { return isKhr ? khrLimits : extLimits; }
    // Returns whether the layer, and not the driver, carries out commands about the object.
    [[nodiscard]] bool implements(ObjectHandle object) const
    {
        return ext || (khr && object.type != VK_OBJECT_TYPE_MICROMAP_EXT);
    }
    // Names an object for messages: its name in quotes, if it has one, and its handle.
    [[nodiscard]] std::string nameOf(ObjectHandle object) const;
};

std::string hex(uint64_t number);
// The name of a value, or its number; of an sType the name of the structure.
std::string nameOf(VkStructureType type);
std::string nameOf(VkQueryType type);
std::string nameOf(VkIndexType type);
std::string nameOf(VkMicromapTypeEXT type);
std::string nameOfFormat(uint32_t format); // VkOpacityMicromapFormatEXT, as usage counts have it

// --- violations of rules that several commands have ---
Found lacksHostCommands(const RuleDevice &device);
Found isUnbound(const ObjectFacts &object);
// An address must be valid. Without validation only null is known not to be.
Found isInvalid(const RuleDevice &device, VkDeviceAddress address, Severity severity);
// An object must exist: the text is that it was destroyed, or `otherwise`.
Found isUnknown(const ObjectFacts &object, const char *otherwise);
// The buffers at the address have no such usage. Unknown addresses are not checked.
bool lacksUsage(const RuleDevice &device, VkDeviceAddress address, VkFlags64 usage);

namespace rules
{
// The facts of an object that a command names.
using Facts = std::function<ObjectFacts(ObjectHandle)>;
} // namespace rules

// The result of a check.
struct Verdict {
    bool accepted = true; // the layer's implementation carries the command out
    bool kept = true;     // no rule is broken

    void operator&=(const Verdict &other)
    {
        accepted = accepted && other.accepted;
        kept = kept && other.kept;
    }
};

// Checks the input at one place of a command.
class InputCheck
{
public:
    // `object`: the object that messages are about. `isReported`: violations were reported before.
    InputCheck(const RuleDevice &device, const Place &place, ObjectHandle object = {}, bool isReported = false)
        : device_(device), place_(place), object_(object), isReported_(isReported)
    {
    }
    [[nodiscard]] const RuleDevice &device() const { return device_; }
    [[nodiscard]] const Place &place() const { return place_; }
    [[nodiscard]] ObjectHandle object() const { return object_; }
    // The check of a part, whose place must outlive it.
    [[nodiscard]] InputCheck at(const Place &place) const { return {device_, place, object_, isReported_}; }

    // Evaluates rows: with validation all, and otherwise those of commands that the layer carries out, up to the first
    // that rejects.
    template <typename Case>
    Verdict check(std::span<const Rule<std::type_identity_t<Case>>> rules, const Case &input) const
    {
        Verdict verdict;
        if (!device_.validating && !device_.implements(object_))
            return verdict;
        for (const Rule<Case> &rule : rules) {
            if (rule.severity == Severity::Report && !device_.validating)
                continue;
            if (const Found found = rule.find(input))
                verdict &= report(rule.id, rule.member, found.text,
                                  rule.severity == Severity::Depends ? found.severity : rule.severity);
            if (!verdict.accepted && !device_.validating)
                break;
        }
        return verdict;
    }
    // Reports a violation. All violations are reported here: a warning if the layer carries the command out all the
    // same and nothing validates, and otherwise an error. `id`: as the specification names the rule; for one that it
    // lacks, an id of Vellum. `member`: null: the place of the check. `text`: what was found, what is expected.
    Verdict report(const char *id, const char *member, const std::string &text,
                   Severity severity = Severity::Reject) const;

private:
    const RuleDevice &device_;
    const Place &place_;
    ObjectHandle object_;
    bool isReported_;
};

} // namespace vellum::layer
