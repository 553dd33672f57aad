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
    // Also reports the faults of the settings: on stderr and to the file, which get each text once in the life of the
    // process, and to messengers, those of `instanceChain` or the first that the application creates.
    void apply(const Settings &settings, const void *instanceChain);
    void addMessenger(VkDebugUtilsMessengerEXT handle, const VkDebugUtilsMessengerCreateInfoEXT &info);
    void removeMessenger(VkDebugUtilsMessengerEXT handle);

    // Name of an object, for messages about it; empty: the object has none any more.
    void setName(uint64_t object, const std::string &name);
    [[nodiscard]] std::string nameOf(uint64_t object);
    // The object is destroyed: messages use its name until another one has the handle.
    void endName(uint64_t object);
    // Another object has the handle, and no name yet.
    void beginName(uint64_t object);

    // `id`: a short name ("VELLUM-micromap-build"), or the id of the violated rule ("VUID-..."), before which messages
    // have "VELLUM-".
    // `object`: the object concerned, or 0.
    // Reporting does not throw: a message for which there is no memory goes to stderr.
    void error(const char *id, std::string_view text, VkObjectType type = VK_OBJECT_TYPE_UNKNOWN, uint64_t object = 0)
    {
        send(VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT, id, text, type, object);
    }
    // Violations that do no harm are errors, and the command is rejected.
    [[nodiscard]] bool isStrict() const { return strict_; }
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
    friend class HeldMessages;
    struct Messenger {
        VkDebugUtilsMessengerEXT handle;
        VkDebugUtilsMessageSeverityFlagsEXT severities;
        VkDebugUtilsMessageTypeFlagsEXT types;
        PFN_vkDebugUtilsMessengerCallbackEXT callback;
        void *userData;
    };
    // `isLimited`: not if it is one too many of its id.
    void send(VkDebugUtilsMessageSeverityFlagBitsEXT severity, const char *id, std::string_view text, VkObjectType type,
              uint64_t object, bool isLimited = true) noexcept;
    struct Sent;
    static void call(const Messenger &messenger, const Sent &message);
    // Counts a message of an id. Returns whether it is sent.
    bool isWithinLimit(const std::string &id);
    // With the mutex.
    [[nodiscard]] std::string findName(uint64_t object) const;
    struct Name {
        std::string text;
        bool ended = false; // the object was destroyed
    };
    static constexpr uint32_t kMostEnded = 1u << 16; // beyond it, all are forgotten

    ReportLevel level_ = ReportLevel::None;      // on stderr
    ReportLevel levelAlone_ = ReportLevel::None; // as above, without a messenger
    bool strict_ = false;
    std::string file_;   // the file for messages; empty: none
    uint32_t limit_ = 0; // of messages with the same id; 0: none
    bool breakOnError_ = false;
    std::mutex mutex_;
    std::vector<Messenger> messengers_;
    std::vector<std::string> settingFaults_; // faults that no messenger has received
    std::unordered_map<uint64_t, Name> names_;
    std::atomic<bool> hasNames_ = false; // read without the mutex
    uint32_t endedNames_ = 0;
    std::unordered_map<std::string, uint32_t> sent_; // messages of each id
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
