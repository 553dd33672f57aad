// SPDX-License-Identifier: Apache-2.0
// Messages of the layer. They go to the application's debug-utils messengers, and by the settings `report` and
// `report_file` to stderr and to a file.
#pragma once

#include <atomic>
#include <functional>
#include <mutex>
#include <string>
#include <string_view>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/base/settings.h"

namespace vellum::layer
{

struct Message {
    VkDebugUtilsMessageSeverityFlagBitsEXT severity;
    std::string id, text;
    VkObjectType type;
    uint64_t object;
};

class Reporter
{
public:
    void apply(const Settings &settings)
    {
        level_ = settings.report;
        levelAlone_ = settings.reportFile.empty() ? settings.reportAlone() : settings.report;
        strict_ = settings.strict;
        file_ = settings.reportFile;
        limit_ = settings.messageLimit;
        breakOnError_ = settings.breakOnError;
    }
    void addMessenger(VkDebugUtilsMessengerEXT handle, const VkDebugUtilsMessengerCreateInfoEXT &info);
    void removeMessenger(VkDebugUtilsMessengerEXT handle);

    // Name of an object, for messages about it; empty: the object has none any more.
    void setName(uint64_t object, const std::string &name);
    [[nodiscard]] std::string nameOf(uint64_t object);

    // `id`: a short name ("VELLUM-micromap-build"), or the id of the violated rule ("VUID-..."), before which messages
    // have "VELLUM-".
    // `object`: the object concerned, or 0.
    // Reporting does not throw: a message for which there is no memory goes to stderr.
    void error(const char *id, std::string_view text, VkObjectType type = VK_OBJECT_TYPE_UNKNOWN, uint64_t object = 0)
    {
        send(VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT, id, text, type, object);
    }
    // Reports an error that validation found; its id is "VELLUM-" and `vuid`, or `vuid` if that is an id of Vellum.
    // While the command is carried out, the implementation of micromaps does not report the same id (CommandReports).
    void fault(const char *vuid, std::string_view text, VkObjectType type, uint64_t object);
    // Violations that do no harm are errors.
    [[nodiscard]] bool isStrict() const { return strict_; }
    // Reports a fault that does no harm: a warning, with the setting `strict` an error. Returns whether the layer goes
    // on, as drivers do; it does unless `strict` is set.
    [[nodiscard]] bool tolerates(const char *id, std::string_view text, VkObjectType type = VK_OBJECT_TYPE_UNKNOWN,
                                 uint64_t object = 0)
    {
        if (strict_)
            error(id, text, type, object);
        else
            warning(id, std::string(text) + "; the layer goes on", type, object);
        return !strict_;
    }
    // Reports a command that the layer rejects, because carrying it out in part would be silently wrong.
    void notAvailable(const std::string &what)
    {
        error("VELLUM-not-available", what + " is not available in this version of the layer");
    }
    void warning(const char *id, std::string_view text, VkObjectType type = VK_OBJECT_TYPE_UNKNOWN, uint64_t object = 0)
    {
        send(VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT, id, text, type, object);
    }
    void info(const char *id, std::string_view text)
    {
        send(VK_DEBUG_UTILS_MESSAGE_SEVERITY_INFO_BIT_EXT, id, text, VK_OBJECT_TYPE_UNKNOWN, 0);
    }

private:
    friend class CommandReports;
    friend class HeldMessages;
    struct Messenger {
        VkDebugUtilsMessengerEXT handle;
        VkDebugUtilsMessageSeverityFlagsEXT severities;
        VkDebugUtilsMessageTypeFlagsEXT types;
        PFN_vkDebugUtilsMessengerCallbackEXT callback;
        void *userData;
    };
    void send(VkDebugUtilsMessageSeverityFlagBitsEXT severity, const char *id, std::string_view text, VkObjectType type,
              uint64_t object) noexcept;
    // `isLimited`: not if it is one too many of its id.
    void deliver(const Message &message, bool isLimited = true);

    ReportLevel level_ = ReportLevel::None;      // on stderr
    ReportLevel levelAlone_ = ReportLevel::None; // the same while there is no messenger
    bool strict_ = false;
    std::string file_;   // that messages are appended to; empty: none
    uint32_t limit_ = 0; // of messages with the same id; 0: none
    bool breakOnError_ = false;
    std::mutex mutex_;
    std::vector<Messenger> messengers_;
    std::unordered_map<uint64_t, std::string> names_;
    std::unordered_map<std::string, uint32_t> sent_; // messages of each id
};

// Ids of faults that validation has reported and that the implementation may find as well, on the device. When the
// implementation reads what the device found, it does not report faults with these ids, and then removes the ids.
class CoveredIds
{
public:
    void add(const std::string &id);
    [[nodiscard]] std::unordered_set<std::string> take();

private:
    std::mutex mutex_;
    std::unordered_set<std::string> ids_;
    std::atomic<bool> any_ = false;
};

// The span of one command that validation checks, in its thread. The implementation below finds some of the faults
// again; it does not report those that validation has reported for the command.
class CommandReports
{
public:
    CommandReports();
    ~CommandReports();
    // The implementation does not report this id either: validation calls it in another way than the application.
    static void cover(const char *id);
    [[nodiscard]] static bool covers(std::string_view id);
    CommandReports(const CommandReports &) = delete;
    CommandReports &operator=(const CommandReports &) = delete;
};

// While it exists, messages of its thread are kept; its destructor sends them. It is created before a lock is taken
// that commands take: callbacks for messages may call commands.
class HeldMessages
{
public:
    HeldMessages();
    ~HeldMessages();
    HeldMessages(const HeldMessages &) = delete;
    HeldMessages &operator=(const HeldMessages &) = delete;

private:
    friend class Reporter;
    bool isInner_; // another one keeps the messages
    std::vector<std::pair<std::reference_wrapper<Reporter>, Message>> messages_;
};

} // namespace vellum::layer
