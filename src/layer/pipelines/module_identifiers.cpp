// SPDX-License-Identifier: Apache-2.0
#include "layer/pipelines/module_identifiers.h"

#include <algorithm>
#include <cstring>
#include <new>
#include <span>

#include "core/hash.h"
#include "layer/base/commands.h"
#include "layer/pipelines/binaries.h"
#include "layer/pipelines/device_pipelines.h"
#include "layer/pipelines/driver_stages.h"

namespace vellum::layer
{

const std::array<uint8_t, VK_UUID_SIZE> kIdentifierUuid{0x7e, 0x11, 0x0c, 0x5b, 0x2f, 0xd3, 0x4a, 0x96,
                                                        0x8d, 0x41, 0xb7, 0x3c, 0xe9, 0x50, 0x1a, 0xc4};

namespace
{

constexpr size_t kMaxUnknown = 5; // the most stages of a graphics pipeline

// The mask for modules that trace no rays, whose code is unchanged: the same in every run.
const Mask &layerMask()
{
    static const Mask mask = maskOf(std::as_bytes(std::span(kIdentifierUuid)));
    return mask;
}

// The mask for modules that trace rays and whose code is unchanged.
const Mask &untouchedMask()
{
    static const Mask mask = [] {
        std::array<uint8_t, VK_UUID_SIZE + 1> other{};
        std::ranges::copy(kIdentifierUuid, other.begin());
        return maskOf(std::as_bytes(std::span(other)));
    }();
    return mask;
}

// Shaders for a driver's own micromaps hold no addresses, so its identifiers are valid for the application.
bool mixesIdentifiers(const DevicePipelines &device)
{
    return device.driver.emulated() || device.driver.mode == Mode::Identifiers;
}

// Changes an identifier of the driver into the application's.
void toApplication(DevicePipelines &device, VkShaderModuleIdentifierEXT &identifier, bool tracing)
{
    if (!mixesIdentifiers(device))
        return;
    mix(identifier.identifier, identifier.identifierSize, tracing ? tracingMask(device) : layerMask());
    if (tracing)
        device.tracingIdentifiers.add(
            std::span(identifier.identifier)
                .first(std::min<size_t>(identifier.identifierSize, sizeof identifier.identifier)));
}

} // namespace

// A sequence of 64-bit numbers by SplitMix64, whose seed is a hash of the bytes.
Mask maskOf(std::span<const std::byte> bytes)
{
    uint64_t state = Hash::of(bytes);
    Mask mask{};
    for (size_t at = 0; at < mask.size(); at += sizeof(uint64_t)) {
        state += 0x9e3779b97f4a7c15u;
        uint64_t word = state;
        word = (word ^ word >> 30) * 0xbf58476d1ce4e5b9u;
        word = (word ^ word >> 27) * 0x94d049bb133111ebu;
        word ^= word >> 31;
        std::memcpy(&mask[at], &word, sizeof word);
    }
    return mask;
}

uint64_t rewriteSettings(const DevicePipelines &device)
{
    const Settings &settings = *device.driver.settings;
    return uint64_t{settings.constantRayFlags} | uint64_t{device.driver.assumesMicromaps()} << 1;
}

Mask deviceMask(DevicePipelines &device)
{
    const struct {
        ShaderBinaryHeader header;
        uint64_t settings;
    } facts{shaderBinaryHeader(device), rewriteSettings(device)};
    static_assert(sizeof facts == sizeof facts.header + sizeof facts.settings);
    return maskOf(std::as_bytes(std::span(&facts, 1)));
}

Mask tracingMask(DevicePipelines &device)
{
    return device.driver.emulated() ? deviceMask(device) : untouchedMask();
}

void mix(uint8_t *bytes, uint32_t count, const Mask &mask)
{
    for (size_t i = 0; i < std::min<size_t>(count, mask.size()); ++i)
        bytes[i] ^= mask[i];
}

void TracingIdentifiers::add(std::span<const uint8_t> identifier)
{
    std::lock_guard lock(mutex_);
    known_.emplace(identifier.begin(), identifier.end());
}

bool TracingIdentifiers::contains(const VkPipelineShaderStageModuleIdentifierCreateInfoEXT &identifier) const
{
    std::lock_guard lock(mutex_);
    return known_.contains(std::string(identifier.pIdentifier, identifier.pIdentifier + identifier.identifierSize));
}

void DriverIdentifiers::replace(const VkPipelineShaderStageCreateInfo *&stages, uint32_t count, bool tracing)
{
    constexpr VkStructureType type = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_MODULE_IDENTIFIER_CREATE_INFO_EXT;
    for (uint32_t i = 0; mixesIdentifiers(device_) && i < count; ++i) {
        const auto *identifier = findInChain<VkPipelineShaderStageModuleIdentifierCreateInfoEXT>(stages[i].pNext, type);
        if (stages[i].module || !identifier || identifier->identifierSize == 0)
            continue;
        if (stages_.empty())
            stages_.assign(stages, stages + count);
        Chain &chain = chains_.emplace_back(stages[i].pNext);
        auto *own = chain.edit<VkPipelineShaderStageModuleIdentifierCreateInfoEXT>(type);
        if (!own) {
            hidden_ = true;
            continue;
        }
        std::vector<uint8_t> &bytes = bytes_.emplace_back(own->pIdentifier, own->pIdentifier + own->identifierSize);
        const bool traces = tracing || device_.tracingIdentifiers.contains(*own);
        if (!traces && device_.driver.enabled.rayQueries && unknown_.size() < kMaxUnknown)
            unknown_.push_back({&bytes, bytes});
        mix(bytes.data(), own->identifierSize, traces ? tracingMask(device_) : layerMask());
        own->pIdentifier = bytes.data();
        stages_[i].pNext = chain.head();
    }
    if (!stages_.empty())
        stages = stages_.data();
}

void DriverIdentifiers::choose(uint32_t variant)
{
    for (size_t i = 0; i < unknown_.size(); ++i) {
        // In place, because the driver's structures point to the bytes.
        std::ranges::copy(unknown_[i].application, unknown_[i].driver->begin());
        mix(unknown_[i].driver->data(), static_cast<uint32_t>(unknown_[i].driver->size()),
            (variant >> i & 1) != 0 ? tracingMask(device_) : layerMask());
    }
}

void DriverIdentifiers::remember(uint32_t variant) noexcept
{
    try {
        for (size_t i = 0; i < unknown_.size(); ++i) {
            if ((variant >> i & 1) != 0)
                device_.tracingIdentifiers.add(unknown_[i].application);
        }
    } catch (const std::bad_alloc &) { // the next pipeline begins with variant 0 again
    }
}

void getShaderModuleIdentifier(DevicePipelines &device, VkDevice handle, VkShaderModule module,
                               VkShaderModuleIdentifierEXT *identifier)
{
    device.driver.next.GetShaderModuleIdentifierEXT(handle, module, identifier);
    toApplication(device, *identifier, device.tracingModules.get(module));
}

void getShaderModuleCreateInfoIdentifier(DevicePipelines &device, VkDevice handle, const VkShaderModuleCreateInfo *info,
                                         VkShaderModuleIdentifierEXT *identifier)
{
    VkShaderModuleCreateInfo driverInfo = *info;
    SharedWords storage;
    const bool known = rewriteShader(device, driverInfo.pCode, driverInfo.codeSize, storage);
    device.driver.next.GetShaderModuleCreateInfoIdentifierEXT(handle, &driverInfo, identifier);
    if (known)
        toApplication(device, *identifier, spirv::scan({info->pCode, info->codeSize / 4}).tracesRays);
    else // there is no such module on this device; mixed with a mask that no identifier of this device has
        mix(identifier->identifier, identifier->identifierSize, untouchedMask());
}

} // namespace vellum::layer
