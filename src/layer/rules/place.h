// SPDX-License-Identifier: Apache-2.0
// The location of a fault: a command, and the path from its parameters to a member.
#pragma once

#include <cstdint>
#include <string>

namespace vellum::layer
{

// A place refers to the one around it, which must outlive it. Its text is made only for a fault.
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

} // namespace vellum::layer
