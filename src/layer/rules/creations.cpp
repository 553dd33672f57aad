// SPDX-License-Identifier: Apache-2.0
#include "layer/rules/creations.h"

#include <algorithm>

#include "layer/base/pipeline_info.h"

namespace vellum::layer::rules
{
namespace
{

using enum Severity;

// ------------------------------------------------------------------------------------------ micromaps and structures

struct Created {
    const input::Creation &creation;
    const RuleDevice &device;
    VkDeviceSize bufferSize = UINT64_MAX;

    // Bytes of the buffer from the offset.
    [[nodiscard]] VkDeviceSize capacity() const { return bufferSize - std::min(creation.offset, bufferSize); }
    // The layer can place a micromap there.
    [[nodiscard]] bool canBePlaced(VkBuffer buffer, VkDeviceSize offset) const
    {
        return creation.isMicromap && device.placesMicromap && device.placesMicromap(buffer, offset, creation.address);
    }
};

constexpr VkFlags64 kStorage = VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR;

Found notMultipleOf256(uint64_t number, Severity severity)
{
    return when(
        number % 256 != 0, [&] { return hex(number) + " is not a multiple of 256"; }, severity);
}

constexpr Rule<Created> kExtMicromap[] = {
    // The type of the build decides.
    {"VUID-VkMicromapCreateInfoEXT-type-parameter", Tolerate, "type",
     [](const Created &c) {
         return when(c.device.ext && !c.creation.rightType, "it is not VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT");
     }},
    {"VUID-VkMicromapCreateInfoEXT-createFlags-parameter", Report, "createFlags",
     [](const Created &c) {
         return when(c.creation.unknownFlags != 0, [&] { return hex(c.creation.unknownFlags) + " are unknown bits"; });
     }},
    {"VUID-VkMicromapCreateInfoEXT-micromapCaptureReplay-11616", Tolerate, "createFlags",
     [](const Created &c) {
         return when(c.creation.replays && !c.device.driver.enabled.captureReplay,
                     "it has DEVICE_ADDRESS_CAPTURE_REPLAY; the feature micromapCaptureReplay is not enabled");
     }},
    // Drivers ignore the address in this case, and NVRHI always sets one.
    {"VUID-VkMicromapCreateInfoEXT-deviceAddress-07433", Tolerate, "deviceAddress",
     [](const Created &c) {
         return when(c.creation.replayed != 0 && !c.creation.replays,
                     "it is not 0, but createFlags lacks DEVICE_ADDRESS_CAPTURE_REPLAY");
     }},
    // The part inside the buffer may be large enough for the build.
    {"VUID-VkMicromapCreateInfoEXT-offset-07437", Depends, "offset",
     [](const Created &c) {
         return when(
             c.creation.size > c.capacity(),
             [&] {
                 return std::to_string(c.creation.offset) + " and size " + std::to_string(c.creation.size) +
                        " are more than the buffer has, " + std::to_string(c.bufferSize);
             },
             c.capacity() > 0 ? Tolerate : Reject);
     }},
    // Shaders read and write 16 bytes at once.
    {"VUID-VkMicromapCreateInfoEXT-offset-07438", Depends, "offset",
     [](const Created &c) {
         return notMultipleOf256(c.creation.offset, c.creation.offset % 16 == 0 ? Tolerate : Reject);
     }},
};
constexpr Rule<Created> kInBuffer[] = {
    {"VUID-VkAccelerationStructureCreateInfoKHR-type-11600", Depends, "type",
     [](const Created &c) {
         const bool possible = c.capacity() > 0 && c.canBePlaced(c.creation.buffer, c.creation.offset);
         return when(c.creation.isMicromap, "micromaps are created by vkCreateAccelerationStructure2KHR",
                     possible ? Tolerate : Reject);
     }},
};
constexpr Rule<Created> kInRange[] = {
    {"VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11608", Reject, "addressRange",
     [](const Created &c) { return when(c.creation.size == 0, "the size is 0"); }},
    {"VUID-VkAccelerationStructureCreateInfo2KHR-micromap-11609", Depends, "type",
     [](const Created &c) {
         return when(c.creation.isMicromap && !c.device.driver.enabled.khrFeature,
                     "it is OPACITY_MICROMAP; the feature micromap of VK_KHR_opacity_micromap is not enabled",
                     c.device.khr && !c.device.khr->exists ? Reject : Tolerate);
     }},
    {"VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11602", Reject, "addressRange",
     [](const Created &c) {
         return when(c.creation.size != 0 && !c.device.addresses.find(c.creation.address).buffer,
                     [&] { return "there is no buffer at " + hex(c.creation.address); });
     }},
    // Drivers do not depend on the usage, and the part in the buffer may be large enough for the build.
    {"VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11603", Depends, "addressRange",
     [](const Created &c) {
         const auto any = c.device.addresses.find(c.creation.address);
         const bool needsUsage = c.creation.isMicromap && c.device.khr && c.device.khr->needsUsage &&
                                 lacksUsage(c.device, c.creation.address, kStorage);
         return when(
             any.buffer && !c.device.addresses.covering(c.creation.address, c.creation.size, kStorage).buffer,
             [&] {
                 return "no buffer with VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR has the " +
                        std::to_string(c.creation.size) + " bytes at " + hex(c.creation.address);
             },
             needsUsage ? Reject : Tolerate);
     }},
    // The alignment that drivers need for other structures is unknown.
    {"VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11605", Depends, "addressRange",
     [](const Created &c) {
         const auto at = c.device.addresses.find(c.creation.address);
         return notMultipleOf256(c.creation.address, c.canBePlaced(at.buffer, at.offset) ? Tolerate : Reject);
     }},
};

input::Creation checked(const InputCheck &check, input::Creation creation, std::span<const Rule<Created>> rules,
                        VkDeviceSize bufferSize)
{
    creation.accepted = check.check<Created>(rules, {creation, check.device(), bufferSize}).accepted;
    return creation;
}

// ------------------------------------------------------------------------------------------ pipelines

struct PipelineFlags {
    VkFlags64 flags;
    const RuleDevice &device;
    bool hasLibraryWith = false;   // a library of the pipeline has the micromap bit
    std::optional<bool> library{}; // has the bit

    [[nodiscard]] bool usesMicromaps() const
    {
        return (flags & VK_PIPELINE_CREATE_RAY_TRACING_OPACITY_MICROMAP_BIT_EXT) != 0;
    }
    [[nodiscard]] bool isMixed() const
    {
        return (flags & VK_PIPELINE_CREATE_2_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_KHR) != 0;
    }
};
Found mixed(const PipelineFlags &c)
{
    return when(c.isMixed() && !c.device.driver.enabled.khrFeature,
                "OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX; micromap of "
                "VkPhysicalDeviceOpacityMicromapFeaturesKHR is not enabled");
}
constexpr Rule<PipelineFlags> kCompute[] = {
    {"VUID-VkComputePipelineCreateInfo-flags-11593", Tolerate, "flags", mixed},
};
constexpr Rule<PipelineFlags> kGraphics[] = {
    {"VUID-VkGraphicsPipelineCreateInfo-flags-11595", Tolerate, "flags", mixed},
};
constexpr Rule<PipelineFlags> kShaders[] = {
    {"VUID-VkShaderCreateInfoEXT-micromap-11623", Tolerate, "flags", mixed},
};
constexpr Rule<PipelineFlags> kRayTracing[] = {
    {"VUID-VkRayTracingPipelineCreateInfoKHR-flags-11597", Tolerate, "flags",
     [](const PipelineFlags &c) {
         return when(c.usesMicromaps() && !c.device.driver.enabled.anyFeature(),
                     "RAY_TRACING_OPACITY_MICROMAP; the feature micromap is not enabled");
     }},
    {"VUID-VkRayTracingPipelineCreateInfoKHR-flags-11599", Tolerate, "flags",
     [](const PipelineFlags &c) {
         return when(c.isMixed() && (!c.usesMicromaps() || !c.device.driver.enabled.khrFeature), [&] {
             return std::string("OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX, without ") +
                    (c.usesMicromaps() ? "the feature micromap of VK_KHR_opacity_micromap"
                                       : "RAY_TRACING_OPACITY_MICROMAP");
         });
     }},
};
// If no library has the bit, emulation creates the pipeline without micromaps.
constexpr Rule<PipelineFlags> kLibrary[] = {
    {"VUID-VkRayTracingPipelineCreateInfoKHR-pLibraries-11598", Depends, nullptr,
     [](const PipelineFlags &c) {
         return when(c.usesMicromaps() && c.library == false,
                     "the library was created without RAY_TRACING_OPACITY_MICROMAP, which the pipeline has",
                     !c.device.ext      ? Report
                     : c.hasLibraryWith ? Reject
                                        : Tolerate);
     }},
};

template <typename Info>
input::Pipelines checkFlags(const RuleDevice &device, const char *name, uint32_t count, const Info *infos,
                            std::span<const Rule<PipelineFlags>> rules)
{
    input::Pipelines pipelines;
    const Place command(name);
    for (uint32_t i = 0; i < count; ++i) {
        const Place place = command.element("pCreateInfos", i);
        const PipelineFlags c{pipelineFlags(infos[i].pNext, infos[i].flags), device};
        pipelines.accepted.push_back(InputCheck(device, place).check<PipelineFlags>(rules, c).accepted);
    }
    return pipelines;
}

} // namespace

input::Creation checkCreation(const InputCheck &check, const VkMicromapCreateInfoEXT &info, VkDeviceSize bufferSize)
{
    return checked(check, input::parse(info), kExtMicromap, bufferSize);
}

input::Creation checkCreation(const InputCheck &check, const VkAccelerationStructureCreateInfoKHR &info,
                              VkDeviceSize bufferSize)
{
    return checked(check, input::parse(info), kInBuffer, bufferSize);
}

input::Creation checkCreation(const InputCheck &check, const VkAccelerationStructureCreateInfo2KHR &info)
{
    return checked(check, input::parse(info), kInRange, UINT64_MAX);
}

input::Pipelines checkPipelines(const RuleDevice &device, uint32_t count, const VkComputePipelineCreateInfo *infos)
{
    return checkFlags(device, "vkCreateComputePipelines", count, infos, kCompute);
}

input::Pipelines checkPipelines(const RuleDevice &device, uint32_t count, const VkGraphicsPipelineCreateInfo *infos)
{
    return checkFlags(device, "vkCreateGraphicsPipelines", count, infos, kGraphics);
}

input::Pipelines checkPipelines(const RuleDevice &device, uint32_t count,
                                const VkRayTracingPipelineCreateInfoKHR *infos, const UsesMicromaps &libraries)
{
    constexpr const char *kCommand = "vkCreateRayTracingPipelinesKHR";
    input::Pipelines pipelines = checkFlags(device, kCommand, count, infos, kRayTracing);
    const Place command(kCommand);
    for (uint32_t i = 0; i < count; ++i) {
        const auto *info = infos[i].pLibraryInfo;
        PipelineFlags c{pipelineFlags(infos[i].pNext, infos[i].flags), device};
        if (!info || !c.usesMicromaps())
            continue;
        const std::span<const VkPipeline> given(info->pLibraries, info->libraryCount);
        c.hasLibraryWith = std::ranges::any_of(given, [&](VkPipeline one) { return libraries(one) == true; });
        const Place element = command.element("pCreateInfos", i);
        const Place place = element.member("pLibraryInfo");
        for (uint32_t l = 0; l < given.size(); ++l) {
            c.library = libraries(given[l]);
            const Place part = place.element("pLibraries", l);
            const ObjectHandle object(VK_OBJECT_TYPE_PIPELINE, reinterpret_cast<uint64_t>(given[l]));
            if (!InputCheck(device, part, object).check<PipelineFlags>(kLibrary, c).accepted)
                pipelines.accepted[i] = false;
        }
    }
    return pipelines;
}

input::Pipelines checkShaders(const RuleDevice &device, uint32_t count, const VkShaderCreateInfoEXT *infos)
{
    input::Pipelines shaders;
    const Place command("vkCreateShadersEXT");
    constexpr auto kMixed =
        static_cast<VkFlags>(VK_SHADER_CREATE_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_EXT);
    for (uint32_t i = 0; i < count; ++i) {
        const Place place = command.element("pCreateInfos", i);
        const VkFlags64 flags = (infos[i].flags & kMixed) != 0
                                    ? VK_PIPELINE_CREATE_2_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_KHR
                                    : VkFlags64{0};
        shaders.accepted.push_back(InputCheck(device, place).check<PipelineFlags>(kShaders, {flags, device}).accepted);
    }
    return shaders;
}

} // namespace vellum::layer::rules
