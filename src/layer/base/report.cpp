// SPDX-License-Identifier: Apache-2.0
#include "layer/base/report.h"

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <new>
#include <set>
#include <utility>

#include "layer/base/pnext.h"
#include "layer/base/system.h"

namespace vellum::layer
{
namespace
{

ReportLevel levelOf(VkDebugUtilsMessageSeverityFlagBitsEXT severity)
{
    if (severity == VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT)
        return ReportLevel::Error;
    return severity == VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT ? ReportLevel::Warning : ReportLevel::Info;
}

const char *severityName(ReportLevel level)
{
    return level == ReportLevel::Error ? "error" : level == ReportLevel::Warning ? "warning" : "info";
}

// The id that a message has: that of the specification after "VELLUM-", or one of Vellum.
std::string publicId(std::string_view id)
{
    return id.starts_with("VUID") ? std::string("VELLUM") + "-" + std::string(id) : std::string(id);
}

// Several processes may write to one stderr and to one file: the line ends with whose it is.
std::string lineOf(const std::string &id, const std::string &text)
{
    return id + ": " + text + " [" + processName() + "]";
}

// Messages are rare: the file is opened for each, and its readers may move or remove it at any time.
void append(const std::string &file, std::string line)
{
    std::ranges::replace(line, '\n', ' ');
    line += '\n';
    if (!appendToFile(file, line))
        std::fprintf(stderr, "vellum: %s cannot be written\n", file.c_str());
}

// Per thread. It has no destructor: at the end of a thread, mingw-w64 frees thread_local objects before it destroys
// them.
thread_local HeldMessages *held = nullptr;

std::string settingId()
{
    return std::string(kMessagePrefix) + "VELLUM-setting";
}

// Returns whether the process has not printed the text yet.
bool isNewFault(const std::string &text)
{
    static std::mutex mutex;
    static auto &printed = *new std::set<std::string>; // never destroyed: instances may be created by exit handlers
    std::lock_guard lock(mutex);
    return printed.insert(text).second;
}

// Reports variables that are options of `vellum run` where that, which sets `report_file`, did not start the program.
void warnOfOptionsOfRun(const Settings &settings)
{
    for (const char *key : {"FAIL_ON", "REQUIRE_CHECKS"}) {
        const std::string name = std::string(kVariablePrefix) + key;
        if (!settings.reportFile.empty() || environmentVariable(name).value_or("").empty())
            continue;
        const std::string text = name + " is set, which only vellum run reads, and it did not start this program";
        if (isNewFault(text))
            std::fprintf(stderr, "vellum: warning: %s [%s]\n", text.c_str(), processName().c_str());
    }
}

} // namespace

// A message as it is sent.
struct Reporter::Sent {
    VkDebugUtilsMessageSeverityFlagBitsEXT severity;
    std::string_view id, text; // null-terminated
    VkObjectType type = VK_OBJECT_TYPE_UNKNOWN;
    uint64_t object = 0;
    std::string_view objectName;
};

void Reporter::call(const Messenger &messenger, const Sent &message)
{
    VkDebugUtilsObjectNameInfoEXT name{VK_STRUCTURE_TYPE_DEBUG_UTILS_OBJECT_NAME_INFO_EXT, nullptr, message.type,
                                       message.object,
                                       message.objectName.empty() ? nullptr : message.objectName.data()};
    VkDebugUtilsMessengerCallbackDataEXT data{};
    data.sType = VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CALLBACK_DATA_EXT;
    data.pMessageIdName = message.id.data();
    data.pMessage = message.text.data();
    data.objectCount = message.object != 0 ? 1 : 0;
    data.pObjects = &name;
    const VkDebugUtilsMessageTypeFlagsEXT kind = message.severity == VK_DEBUG_UTILS_MESSAGE_SEVERITY_INFO_BIT_EXT
                                                     ? VK_DEBUG_UTILS_MESSAGE_TYPE_GENERAL_BIT_EXT
                                                     : VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT;
    if ((messenger.severities & VkDebugUtilsMessageSeverityFlagsEXT{message.severity}) != 0 &&
        (messenger.types & kind) != 0)
        messenger.callback(message.severity, kind, &data, messenger.userData);
}

void Reporter::apply(const Settings &settings, const void *instanceChain)
{
    level_ = settings.report;
    levelAlone_ = settings.reportFile.empty() ? settings.reportAlone() : settings.report;
    strict_ = settings.strict;
    file_ = settings.reportFile;
    limit_ = settings.messageLimit;
    breakOnError_ = settings.breakOnError;
    warnOfOptionsOfRun(settings);
    const std::string id = settingId();
    for (const std::string &text : settings.faults) {
        if (!isNewFault(text))
            continue;
        const std::string line = lineOf(id, text);
        std::fprintf(stderr, "vellum: %s\n", line.c_str());
        if (!file_.empty())
            append(file_, "error " + line);
    }
    const auto find = [](const void *from) {
        return findInChain<VkDebugUtilsMessengerCreateInfoEXT>(from,
                                                               VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT);
    };
    const auto *info = find(instanceChain);
    if (!info)
        settingFaults_ = settings.faults;
    for (; info; info = find(info->pNext))
        for (const std::string &text : settings.faults)
            call({VK_NULL_HANDLE, info->messageSeverity, info->messageType, info->pfnUserCallback, info->pUserData},
                 {VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT, id, text});
}

void Reporter::addMessenger(VkDebugUtilsMessengerEXT handle, const VkDebugUtilsMessengerCreateInfoEXT &info)
{
    const Messenger messenger{handle, info.messageSeverity, info.messageType, info.pfnUserCallback, info.pUserData};
    const std::string id = settingId(); // nothing fails once the messenger is known
    std::vector<std::string> faults;
    {
        std::lock_guard lock(mutex_);
        messengers_.push_back(messenger);
        if ((info.messageSeverity & VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT) != 0)
            faults.swap(settingFaults_);
    }
    for (const std::string &text : faults)
        call(messenger, {VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT, id, text});
}

void Reporter::removeMessenger(VkDebugUtilsMessengerEXT handle)
{
    std::lock_guard lock(mutex_);
    std::erase_if(messengers_, [handle](const Messenger &m) { return m.handle == handle; });
}

void Reporter::setName(uint64_t object, const std::string &name)
{
    if (name.empty() && !hasNames_)
        return;
    std::lock_guard lock(mutex_);
    const auto found = names_.find(object);
    if (found != names_.end() && found->second.ended) {
        if (name.empty())
            return;
        --endedNames_;
    }
    if (name.empty())
        names_.erase(object);
    else
        names_[object] = {name};
    hasNames_ = !names_.empty();
}

void Reporter::endName(uint64_t object)
{
    if (!hasNames_)
        return;
    std::lock_guard lock(mutex_);
    const auto found = names_.find(object);
    if (found == names_.end() || found->second.ended)
        return;
    found->second.ended = true;
    if (++endedNames_ <= kMostEnded)
        return;
    std::erase_if(names_, [](const auto &name) { return name.second.ended; });
    endedNames_ = 0;
}

void Reporter::beginName(uint64_t object)
{
    if (!hasNames_)
        return;
    std::lock_guard lock(mutex_);
    const auto found = names_.find(object);
    if (found == names_.end() || !found->second.ended)
        return;
    names_.erase(found);
    --endedNames_;
    hasNames_ = !names_.empty();
}

std::string Reporter::findName(uint64_t object) const
{
    const auto found = names_.find(object);
    return found == names_.end() ? std::string() : found->second.text;
}

std::string Reporter::nameOf(uint64_t object)
{
    std::lock_guard lock(mutex_);
    return findName(object);
}

HeldMessages::HeldMessages() : isInner_(held != nullptr)
{
    if (!isInner_)
        held = this;
}

HeldMessages::~HeldMessages()
{
    if (isInner_)
        return;
    held = nullptr;
    for (const auto &[reporter, m] : messages_)
        reporter.get().send(m.severity, m.id.c_str(), m.text, m.type, m.object);
}

bool Reporter::isWithinLimit(const std::string &id)
{
    if (limit_ == 0)
        return true;
    std::unique_lock lock(mutex_);
    const uint32_t count = ++sent_[id];
    lock.unlock();
    if (count == limit_ + 1)
        send(VK_DEBUG_UTILS_MESSAGE_SEVERITY_INFO_BIT_EXT, "VELLUM-message-limit",
             id + " was reported " + std::to_string(limit_) + " times; no more messages with this id are sent",
             VK_OBJECT_TYPE_UNKNOWN, 0, false);
    return count <= limit_;
}

void Reporter::send(VkDebugUtilsMessageSeverityFlagBitsEXT severity, const char *id, std::string_view text,
                    VkObjectType type, uint64_t object, bool isLimited) noexcept
try {
    if (held) {
        held->messages_.emplace_back(*this, Message{severity, id, std::string(text), type, object});
        return;
    }
    const Message message{severity, kMessagePrefix + publicId(id), std::string(text), type, object};
    if (isLimited && !isWithinLimit(message.id))
        return;
    std::vector<Messenger> messengers;
    std::string objectName;
    {
        // A callback may create or destroy messengers: it is called without the lock.
        std::lock_guard lock(mutex_);
        messengers = messengers_;
        objectName = findName(message.object);
    }
    const bool prints = levelOf(message.severity) <= (messengers.empty() ? levelAlone_ : level_);
    const std::string line = prints || !file_.empty() ? lineOf(message.id, message.text) : std::string();
    if (prints)
        std::fprintf(stderr, "vellum: %s\n", line.c_str());
    for (const Messenger &m : messengers)
        call(m, {message.severity, message.id, message.text, message.type, message.object, objectName});
    if (!file_.empty())
        append(file_, std::string(severityName(levelOf(message.severity))) + " " + line);
    if (breakOnError_ && message.severity == VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT)
        stopInDebugger();
} catch (const std::bad_alloc &) {
    std::fprintf(stderr, "vellum: %s%s: %.*s\n", kMessagePrefix, id, static_cast<int>(text.size()), text.data());
}

} // namespace vellum::layer
