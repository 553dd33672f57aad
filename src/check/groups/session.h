// SPDX-License-Identifier: Apache-2.0
// The devices of a process: one for each way to lay out memory, made when it is first needed.
#pragma once

#include <map>
#include <utility>

#include "check/groups/group.h"
#include "check/groups/random_case.h"
#include "gpu/device.h"

namespace vellum::check
{

class Session
{
public:
    explicit Session(const SessionOptions &options);

    [[nodiscard]] Device &device(Memory memory);
    [[nodiscard]] const DeviceLimits &limits() const { return limits_; }
    // The errors that layers reported since the last call.
    [[nodiscard]] std::vector<std::string> takeErrors();

    bool onlyMakesCases = false; // instead of running them: a group's outcome is Pass, with the reproducer

private:
    SessionOptions options_;
    DeviceLimits limits_;
    std::mutex mutex_;
    std::vector<std::string> errors_; // outlives the devices, which write to it
    std::map<Memory, std::unique_ptr<Device>> devices_;
};

} // namespace vellum::check
