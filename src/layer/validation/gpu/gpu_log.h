// SPDX-License-Identifier: Apache-2.0
// The log of the check `gpu`: validation's shaders write their findings to host-visible memory. Commands that submit
// work or learn that work is complete report them.
#pragma once

#include <atomic>
#include <mutex>
#include <optional>

#include <vulkan/vulkan.h>

#include "core/findings.h"
#include "layer/input/builds.h"
#include "layer/memory/gpu_memory.h"

namespace vellum::layer
{

struct GpuChecks;

// One finding, as the device logs it (core/findings.h).
struct Finding {
    uint32_t what, site, geometry, element, value0, value1;
    uint64_t object;
};
constexpr uint32_t siteOf(input::BuildCommand command, uint32_t info)
{
    return static_cast<uint32_t>(command) << shared::kSiteCommandShift | (info & shared::kSiteInfoMask);
}
void reportFinding(GpuChecks &gpu, const Finding &finding);

class GpuLog
{
public:
    VkResult create(const GpuContext &context);
    // The address for push constants.
    [[nodiscard]] VkDeviceAddress address() const { return log_.address(); }
    // Reports the findings since the last call.
    void drain(GpuChecks &gpu);
    // Reports them and clears the log. The device must be idle until the call returns: in vkDeviceWaitIdle all queues
    // are externally synchronized.
    void drainIdle(GpuChecks &gpu);

private:
    // Returns whether the log has grown. Takes no lock, because every poll of a fence calls it.
    [[nodiscard]] bool hasNew() const;
    // The next entry to report, if it is complete.
    std::optional<Finding> take();

    GpuBuffer log_;
    std::mutex mutex_;              // guards the members below; not held while messages are sent
    uint32_t reported_ = 0;         // entries
    std::atomic<uint32_t> seen_{0}; // logged findings, including those beyond the capacity; read without the mutex
    bool reportedOverflow_ = false;
};

} // namespace vellum::layer
