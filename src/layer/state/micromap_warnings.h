// SPDX-License-Identifier: Apache-2.0
// Warnings of shaders and pipelines that do not declare their use of micromaps. They are wrong only where rays meet
// micromaps, and many programs enable every feature and never build a micromap: a warning is kept until a bottom-level
// structure with micromaps is built on the device.
#pragma once

#include <atomic>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "layer/base/driver.h"

namespace vellum::layer
{

class MicromapWarnings
{
public:
    explicit MicromapWarnings(const Driver &driver) : driver_(driver) {}

    // Sends the warning, now or when micromaps are used. `id` is a literal.
    void warn(const char *id, const std::string &text);
    // A build of a bottom-level structure with micromaps was recorded.
    void micromapsAreUsed();

private:
    const Driver &driver_;
    std::atomic<bool> used_ = false;
    std::mutex mutex_; // guards the next member, and used_ while it changes
    std::vector<std::pair<const char *, std::string>> kept_;
};

} // namespace vellum::layer
