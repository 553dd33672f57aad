#include "layer/pipelines/module_identifiers.h"

#include <algorithm>
#include <cstring>
#include <new>
#include <span>

#include "core/hash.h"
#include "layer/pipelines/device_pipelines.h"
#include "layer/pipelines/driver_stages.h"
#include "layer/pipelines/shader_binary.h"

namespace vellum::layer
{

const std::array<uint8_t, VK_UUID_SIZE> kIdentifierUuid{0x7e, 0x11, 0x0c, 0x5b, 0x2f, 0xd3, 0x4a, 0x96,
                                                        0x8d, 0x41, 0xb7, 0x3c, 0xe9, 0x50, 0x1a, 0xc4};

namespace
{

constexpr size_t kMostOpen = 5; // there are no graphics pipelines with more stages

// Of modules that are as the application gave them: the same in every run.
const Mask &layerMask()
{
    static const Mask mask = maskOf(std::as_bytes(std::span(kIdentifierUuid)));
    return mask;
}

// Of modules that trace rays and are as the application gave them all the same.
const Mask &untouchedMask()
{
    static const Mask mask = [] {
        std::array<uint8_t, VK_UUID_SIZE + 1> other{};
        std::ranges::copy(kIdentifierUuid, other.begin());
        return maskOf(std::as_bytes(std::span(other)));
    }();
    return mask;
}

// A driver with VK_EXT_opacity_micromap gets shaders that hold nothing of one device or process.
bool mixesIdentifiers(const DevicePipelines &device)
{
    return !device.driver.translated();
}

// Gives the application an identifier that is the driver's.
void give(DevicePipelines &device, VkShaderModuleIdentifierEXT &identifier, bool tracing)
{
    if (!mixesIdentifiers(device))
        return;
    mix(identifier.identifier, identifier.identifierSize, tracing ? tracingMask(device) : layerMask());
    if (tracing)
        device.givenIdentifiers.add(
            std::span(identifier.identifier)
                .first(std::min<size_t>(identifier.identifierSize, sizeof identifier.identifier)));
}

} // namespace

// 64 bits for each place, from the hash of the bytes and the mixing of SplitMix64.
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
    const bool assumes = settings.assumeMicromaps && device.driver.enabled.anyFeature();
    return uint64_t{settings.constantRayFlags} | uint64_t{assumes} << 1;
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

void GivenIdentifiers::add(std::span<const uint8_t> identifier)
{
    std::lock_guard lock(mutex_);
    known_.emplace(identifier.begin(), identifier.end());
}

bool GivenIdentifiers::contains(const VkPipelineShaderStageModuleIdentifierCreateInfoEXT &identifier) const
{
    std::lock_guard lock(mutex_);
    return known_.contains(std::string(identifier.pIdentifier, identifier.pIdentifier + identifier.identifierSize));
}

void DriverIdentifiers::take(const VkPipelineShaderStageCreateInfo *&stages, uint32_t count, bool tracing)
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
        const bool traces = tracing || device_.givenIdentifiers.contains(*own);
        if (!traces && device_.driver.enabled.rayQueries && open_.size() < kMostOpen)
            open_.push_back({&bytes, bytes});
        mix(bytes.data(), own->identifierSize, traces ? tracingMask(device_) : layerMask());
        own->pIdentifier = bytes.data();
        stages_[i].pNext = chain.head();
    }
    if (!stages_.empty())
        stages = stages_.data();
}

void DriverIdentifiers::choose(uint32_t way)
{
    for (size_t i = 0; i < open_.size(); ++i) {
        // In place: the driver's structures point there.
        std::ranges::copy(open_[i].application, open_[i].bytes->begin());
        mix(open_[i].bytes->data(), static_cast<uint32_t>(open_[i].bytes->size()),
            (way >> i & 1) != 0 ? tracingMask(device_) : layerMask());
    }
}

void DriverIdentifiers::remember(uint32_t way) noexcept
{
    try {
        for (size_t i = 0; i < open_.size(); ++i) {
            if ((way >> i & 1) != 0)
                device_.givenIdentifiers.add(open_[i].application);
        }
    } catch (const std::bad_alloc &) { // then the next time begins with way 0 again
    }
}

void getShaderModuleIdentifier(DevicePipelines &device, VkDevice handle, VkShaderModule module,
                               VkShaderModuleIdentifierEXT *identifier)
{
    device.driver.next.GetShaderModuleIdentifierEXT(handle, module, identifier);
    give(device, *identifier, device.tracingModules.get(module));
}

void getShaderModuleCreateInfoIdentifier(DevicePipelines &device, VkDevice handle, const VkShaderModuleCreateInfo *info,
                                         VkShaderModuleIdentifierEXT *identifier)
{
    VkShaderModuleCreateInfo driverInfo = *info;
    std::vector<uint32_t> storage;
    const bool known = rewriteShader(device, driverInfo.pCode, driverInfo.codeSize, storage);
    device.driver.next.GetShaderModuleCreateInfoIdentifierEXT(handle, &driverInfo, identifier);
    if (known)
        give(device, *identifier, spirv::scan({info->pCode, info->codeSize / 4}).tracesRays);
    else // there is no such module on this device, and its identifier is mixed as none of this device's is
        mix(identifier->identifier, identifier->identifierSize, untouchedMask());
}

} // namespace vellum::layer
