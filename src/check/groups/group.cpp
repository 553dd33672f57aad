// SPDX-License-Identifier: Apache-2.0
#include "check/groups/group.h"

#include <chrono>
#include <map>

#include "check/case/case.h"
#include "check/case/shrink/shrink.h"
#include "check/groups/random_case.h"
#include "check/groups/session.h"

namespace vellum::check
{

std::span<const Group> groups()
{
    static const std::vector<Group> all = [] {
        std::vector<Group> list;
        for (const std::span<const Group> some : {resolutionGroups(), pipelineGroups(), buildGroups(), objectGroups(),
                                                  queryGroups(), addressGroups(), combinationGroups(), scaleGroups()})
            list.insert(list.end(), some.begin(), some.end());
        return list;
    }();
    return all;
}

namespace
{

Outcome skipped(const std::string &why)
{
    return {.status = Status::Skip, .cause = why};
}

// A run whose failed calls of Vulkan are verdicts, except for a lost device.
Verdict verdictOf(Session &session, const Case &c)
{
    (void)session.takeErrors();
    Verdict verdict;
    try {
        verdict = run(session.device(c.memory), c);
    } catch (const VulkanError &error) {
        if (error.result() == VK_ERROR_DEVICE_LOST)
            throw;
        verdict.cause = verdict.detail = error.what();
    }
    if (verdict.skipped)
        return verdict;
    // An error that a layer reports about a valid program is a failure as well, whether the driver or the layer is
    // wrong.
    for (const std::string &error : session.takeErrors()) {
        verdict.detail += (verdict.detail.empty() ? "" : "\n") + error;
        if (verdict.cause.empty())
            verdict.cause = "a layer reports " + error.substr(0, error.find(':'));
    }
    return verdict;
}

// Makes the case smaller, if there is time for it, and says what is wrong with it. Only the first failures of a cause
// are made smaller: those that follow say no more.
void explain(Session &session, const Case &c, const Verdict &verdict, double seconds, Outcome &outcome)
{
    using Clock = std::chrono::steady_clock;
    static std::map<std::string, int> shrunk;
    constexpr int kMostOfACause = 3;
    const Api api = session.limits().api;
    outcome.detail = verdict.detail;
    outcome.reproducer = toJson(c);
    outcome.files = {{"txt", accountOf(c, verdict, api)}};
    if (seconds <= 0 || shrunk[verdict.cause]++ >= kMostOfACause)
        return;
    const auto stillFails = [&](const Case &smaller) { return verdictOf(session, smaller).cause == verdict.cause; };
    // The first run also made the device and its pipelines.
    const auto begin = Clock::now();
    (void)stillFails(c);
    const double ofARun = std::chrono::duration<double>(Clock::now() - begin).count();
    const double left = secondsForAttempts(seconds, ofARun);
    if (left <= 0)
        return;
    const Shrunk result = shrink(c, stillFails, {.seconds = left, .ray = verdict.ray});
    outcome.reproducer = toJson(result.smallest);
    const Verdict last = verdictOf(session, result.smallest);
    if (last.failed()) {
        outcome.detail = last.detail;
        outcome.files = {{"txt", accountOf(result.smallest, last, api)}};
        const auto runs = [&](const Case &other) { return verdictOf(session, other); };
        if (std::string picture = pictureOf(result.smallest, last, runs); !picture.empty())
            outcome.files.push_back({"svg", std::move(picture)});
    }
    if (result.failures < result.confirmations)
        outcome.detail +=
            "\nfails " + std::to_string(result.failures) + " times of " + std::to_string(result.confirmations);
}

} // namespace

Outcome runAndShrink(Session &session, const Case &c, double seconds)
{
    Outcome outcome;
    try {
        const Verdict verdict = verdictOf(session, c);
        if (verdict.skipped)
            return skipped(verdict.cause);
        outcome.rays = verdict.rays;
        if (verdict.failed()) {
            outcome.status = Status::Fail;
            outcome.cause = verdict.cause;
            explain(session, c, verdict, seconds, outcome);
        }
    } catch (const VulkanError &error) {
        outcome.status = Status::DeviceLost;
        outcome.cause = outcome.detail = error.what();
        outcome.reproducer = toJson(c);
    }
    return outcome;
}

Outcome replay(Session &session, const std::string &reproducer)
{
    return runAndShrink(session, caseFromJson(reproducer), 0);
}

std::string makeCase(Session &session, const Group &group, uint64_t seed)
{
    session.onlyMakesCases = true;
    std::string reproducer = group.run(session, group.name, seed).reproducer;
    session.onlyMakesCases = false;
    return reproducer;
}

Session::Session(const SessionOptions &options) : options_(options)
{
    limits_ = limitsOf(device(Memory::Apart));
}

Device &Session::device(Memory memory)
{
    std::unique_ptr<Device> &device = devices_[memory];
    if (!device) {
        InstanceOptions instance;
        if (options_.layer)
            instance.layers.emplace_back(kLayerName);
        instance.onMessage = [this](const Message &message) {
            if (message.severity < VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT)
                return;
            const std::lock_guard lock(mutex_);
            errors_.push_back(message.id + ": " + message.text);
        };
        device = std::make_unique<Device>(
            std::move(instance),
            DeviceOptions{
                .physicalDevice = options_.device,
                .api = options_.api,
                .privateData = true,
                .extensions = {VK_KHR_RAY_TRACING_MAINTENANCE_1_EXTENSION_NAME, VK_EXT_MESH_SHADER_EXTENSION_NAME,
                               "VK_KHR_maintenance5", "VK_KHR_maintenance6", "VK_EXT_shader_object",
                               "VK_KHR_ray_tracing_position_fetch", VK_EXT_PIPELINE_CREATION_FEEDBACK_EXTENSION_NAME,
                               VK_EXT_PIPELINE_ROBUSTNESS_EXTENSION_NAME},
                .memory = memory});
    }
    return *device;
}

std::vector<std::string> Session::takeErrors()
{
    const std::lock_guard lock(mutex_);
    return std::exchange(errors_, {});
}

std::shared_ptr<Session> openSession(const SessionOptions &options)
{
    return std::make_shared<Session>(options);
}

} // namespace vellum::check
