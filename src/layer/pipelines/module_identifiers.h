// Identifiers of shader modules (VK_EXT_shader_module_identifier): names of code that a driver's cache may have, which
// applications keep from run to run. The code of a shader that traces rays holds addresses of the layer's tables, and a
// cache may also have pipelines that were made without the layer. So the application sees the driver's identifiers of
// what the driver gets, mixed with a mask: that of the layer, or where the code was rewritten that of the device's
// tables. An identifier that came from anywhere else is none that the driver knows, and the answer to it is
// VK_PIPELINE_COMPILE_REQUIRED.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <mutex>
#include <set>
#include <span>
#include <string>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/base/pnext.h"
#include "layer/base/vulkan_newer.h"

namespace vellum::layer
{

struct DevicePipelines;

using Mask = std::array<uint8_t, VK_MAX_SHADER_MODULE_IDENTIFIER_SIZE_EXT>;
// Others for other bytes.
Mask maskOf(std::span<const std::byte> bytes);
// Settings with which shaders are rewritten, or pipelines made, in another way.
uint64_t rewriteSettings(const DevicePipelines &device);
// Another one where rewritten code would be other code.
Mask deviceMask(DevicePipelines &device);
// What identifiers of modules that trace rays are mixed with: the mask of the device, or where the driver gets their
// code as it is, since no micromaps are emulated there, one that is the same in every run.
Mask tracingMask(DevicePipelines &device);
// Twice is not at all.
void mix(uint8_t *bytes, uint32_t count, const Mask &mask);

// Tells identifiers that the layer has mixed from those of the driver: to be mixed with the driver's UUID.
extern const std::array<uint8_t, VK_UUID_SIZE> kIdentifierUuid;

// Identifiers of modules that trace rays, which this device gave to the application, or which turned out to be some.
class GivenIdentifiers
{
public:
    void add(std::span<const uint8_t> identifier);
    [[nodiscard]] bool contains(const VkPipelineShaderStageModuleIdentifierCreateInfoEXT &identifier) const;

private:
    mutable std::mutex mutex_;
    std::set<std::string> known_;
};

// Stages of a pipeline with the driver's identifiers in the place of the application's. Of an identifier that the
// application has kept from another run, nobody knows whether it names a rewritten module: then there are several ways
// to read the stages, to be tried one after the other.
class DriverIdentifiers
{
public:
    explicit DriverIdentifiers(DevicePipelines &device) : device_(device) {}
    DriverIdentifiers(const DriverIdentifiers &) = delete;
    DriverIdentifiers &operator=(const DriverIdentifiers &) = delete;

    // Replaces `stages` where one of them has an identifier and no code. `tracing`: all name modules that trace rays,
    // as in ray tracing pipelines. The stages are as way 0 reads them: what is not known to trace rays does not.
    void take(const VkPipelineShaderStageCreateInfo *&stages, uint32_t count, bool tracing = false);
    [[nodiscard]] bool any() const { return hidden_ || !bytes_.empty(); }
    // 0: an identifier lies where the layer cannot replace it, and the driver must not see the application's.
    [[nodiscard]] uint32_t ways() const { return hidden_ ? 0 : 1u << open_.size(); }
    // Calls `use` with the stages read in each way until the driver knows them in one, and returns its last result;
    // VK_PIPELINE_COMPILE_REQUIRED where there is no way.
    template <typename Use>
    VkResult useUntilKnown(Use use)
    {
        VkResult result = VK_PIPELINE_COMPILE_REQUIRED;
        for (uint32_t way = 0;
             way < ways() && (result == VK_PIPELINE_COMPILE_REQUIRED || result == newer::kPipelineBinaryMissing);
             ++way) {
            choose(way);
            result = use();
            if (result == VK_SUCCESS || result == VK_INCOMPLETE)
                remember(way);
        }
        return result;
    }

private:
    void choose(uint32_t way);
    // The driver knew them in this way: so it will be the next time, and so keys of such pipelines are made.
    void remember(uint32_t way) noexcept;
    struct Open {
        std::vector<uint8_t> *bytes; // for the driver
        std::vector<uint8_t> application;
    };
    DevicePipelines &device_;
    std::vector<VkPipelineShaderStageCreateInfo> stages_;
    std::deque<Chain> chains_;
    std::deque<std::vector<uint8_t>> bytes_;
    std::vector<Open> open_;
    bool hidden_ = false; // behind a structure of unknown size
};

void getShaderModuleIdentifier(DevicePipelines &, VkDevice, VkShaderModule, VkShaderModuleIdentifierEXT *);
void getShaderModuleCreateInfoIdentifier(DevicePipelines &, VkDevice, const VkShaderModuleCreateInfo *,
                                         VkShaderModuleIdentifierEXT *);

} // namespace vellum::layer
