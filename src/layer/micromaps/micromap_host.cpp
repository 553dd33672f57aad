// SPDX-License-Identifier: Apache-2.0
// The host commands of micromaps (feature micromapHostCommands). They write what the device would
// (core/micromap_memory.h). A deferred operation is carried out at once, and the commands return
// VK_OPERATION_NOT_DEFERRED_KHR.
#include <algorithm>
#include <cstring>
#include <optional>

#include "core/micromap_memory.h"
#include "layer/base/commands.h"
#include "layer/input/checked.h"
#include "layer/micromaps/device_micromaps.h"
#include "layer/rules/builds.h"
#include "layer/rules/copies.h"
#include "layer/rules/ids.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

// The result of a command that breaks a rule. Without the feature the layer does not track the application's mappings.
VkResult rejected(const DeviceMicromaps &device)
{
    return device.driver.enabled.hostCommands ? VK_ERROR_VALIDATION_FAILED_EXT : VK_ERROR_FEATURE_NOT_PRESENT;
}

VkResult done(VkDeferredOperationKHR operation)
{
    return operation ? VK_OPERATION_NOT_DEFERRED_KHR : VK_SUCCESS;
}

// Copies that cannot be carried out. As on the device, messages about them do not depend on the setting `validate`.
constexpr const char *kNotBuilt[] = {"VELLUM-micromap-not-constructed",
                                     "the micromap was not constructed before it is used"};
constexpr const char *kOverlap[] = {"VELLUM-micromap-copy-overlap",
                                    "src and dst of a copy overlap; the target is as it was"};
constexpr const char *kTooLarge[] = {"VELLUM-micromap-copy-size", "the target of a copy is too small"};
constexpr const char *kNotSerialized[] = {
    rules::ids::kMicromapCompatible,
    "the source is not a serialized micromap of this version of the layer, or is cut off"};
void reportCopy(const DeviceMicromaps &device, const char *const (&error)[2], VkMicromapEXT micromap)
{
    device.driver.report().error(error[0], error[1], VK_OBJECT_TYPE_MICROMAP_EXT, reinterpret_cast<uint64_t>(micromap));
}

constexpr uint64_t kHeaderBytes = kMicromapHeaderWords * 4;

// A micromap's memory in the host's address space: its first `most` bytes, since a handle may be far larger than the
// micromap, and the memory after it must not be accessed.
class View
{
public:
    View(DeviceMicromaps &device, VkMicromapEXT handle, uint64_t most, HostView::For use)
        : size_(handle ? std::min(micromapOf(handle)->size, most) : 0),
          view_(device.buffers, handle ? micromapOf(handle)->buffer : VK_NULL_HANDLE,
                handle ? micromapOf(handle)->offset : 0, size_, use)
    {
    }
    [[nodiscard]] uint8_t *bytes() const { return view_.bytes(); }
    // Clears the magic number. Memory that is smaller than a header never holds a micromap.
    void invalidate() const
    {
        if (size_ >= kHeaderBytes)
            std::memset(bytes() + kMicromapHeaderMagic * 4, 0, 4);
    }

private:
    uint64_t size_;
    HostView view_;
};

// Bytes in use; 0 if no micromap was constructed there, or the host cannot read the memory.
uint64_t usedBytes(DeviceMicromaps &device, VkMicromapEXT handle)
{
    const View header(device, handle, kHeaderBytes, HostView::For::Reading);
    if (!header.bytes() || micromapOf(handle)->size < kHeaderBytes)
        return 0;
    const uint64_t used = micromapMemoryInUse(header.bytes());
    return used <= micromapOf(handle)->size ? used : 0;
}

// The bytes that a compacted copy takes; 0 as above.
uint64_t compactedBytes(DeviceMicromaps &device, VkMicromapEXT handle)
{
    const uint64_t used = usedBytes(device, handle);
    const View source(device, handle, used, HostView::For::Reading);
    return used == 0 || !source.bytes() ? 0 : CompactedMicromap(source.bytes()).bytes();
}

// The bytes in use; the header if none are.
View viewOf(DeviceMicromaps &device, VkMicromapEXT handle, uint64_t used)
{
    return {device, handle, std::max(used, kHeaderBytes), HostView::For::Reading};
}

void write(const MicromapBuild &build, uint8_t *out)
{
    MicromapBuildInput input;
    input.triangles = static_cast<const uint8_t *>(build.triangles.hostAddress);
    input.stride = build.triangleStride;
    input.triangleCount = static_cast<uint32_t>(build.extent.triangles);
    input.data = static_cast<const uint8_t *>(build.data.hostAddress);
    input.capacityUnits = static_cast<uint32_t>(build.extent.units);
    input.maxLevel = build.extent.maxLevel;
    input.buildFlags = build.flags;
    writeMicromapMemory(input, out);
}

// A micromap, as the rules of host commands see it.
ObjectFacts hostFacts(DeviceMicromaps &device, ObjectHandle handle)
{
    ObjectFacts facts = micromapFacts(handle);
    if (facts.exists)
        facts.hostVisible =
            View(device, reinterpret_cast<VkMicromapEXT>(handle.handle), kHeaderBytes, HostView::For::Writing)
                .bytes() != nullptr;
    return facts;
}

template <typename Info>
auto copyOf(DeviceMicromaps &device, const char *command, const Info &info)
{
    return rules::takeCopy(device.objects.rules, command, info, input::Executor::Host,
                           [&device](ObjectHandle object) { return hostFacts(device, object); });
}

} // namespace

VkResult buildMicromaps(DeviceMicromaps &device, VkDevice, VkDeferredOperationKHR operation, uint32_t count,
                        const VkMicromapBuildInfoEXT *infos)
{
    constexpr const char *kCommand = "vkBuildMicromapsEXT";
    const auto builds = input::Checked<input::Builds>::take(infos, [&] {
        input::Builds parsed = input::parse(count, infos, true);
        rules::checkBuilds(device.objects.rules, Place(kCommand), parsed,
                           [&device](ObjectHandle handle) { return hostFacts(device, handle); });
        return parsed;
    });
    VkResult result = device.driver.enabled.hostCommands ? VK_SUCCESS : VK_ERROR_FEATURE_NOT_PRESENT;
    for (const input::MicromapBuild &given : builds.micromaps) {
        if (!given.accepted) {
            result = rejected(device);
            continue;
        }
        const MicromapBuild build = micromapBuildOf(given);
        const View view(device, infos[given.element].dstMicromap, build.extent.bytes(), HostView::For::Writing);
        recordMicromapBound(device, *micromapOf(infos[given.element].dstMicromap),
                            {build.extent.triangles, build.extent.bytes()});
        if (view.bytes())
            write(build, view.bytes());
        else
            result = VK_ERROR_OUT_OF_HOST_MEMORY;
    }
    return result == VK_SUCCESS ? done(operation) : result;
}

VkResult copyMicromap(DeviceMicromaps &device, VkDevice, VkDeferredOperationKHR operation,
                      const VkCopyMicromapInfoEXT *info)
{
    if (!copyOf(device, "vkCopyMicromapEXT", *info).accepted)
        return rejected(device);
    const uint64_t used = usedBytes(device, info->src);
    const uint64_t capacity = micromapOf(info->dst)->size;
    const View source = viewOf(device, info->src, used);
    if (!source.bytes())
        return VK_ERROR_OUT_OF_HOST_MEMORY;
    std::optional<CompactedMicromap> compacted;
    if (info->mode == VK_COPY_MICROMAP_MODE_COMPACT_EXT && used != 0)
        compacted.emplace(source.bytes());
    const uint64_t needed = compacted ? compacted->bytes() : used;
    const View target(device, info->dst, std::max(needed, kHeaderBytes), HostView::For::Writing);
    if (!target.bytes())
        return VK_ERROR_OUT_OF_HOST_MEMORY;
    // Same rule as on the device (shaders/micromaps/micromap_move.comp, micromap_compact_place.comp).
    if (target.bytes() < source.bytes() + used && source.bytes() < target.bytes() + std::min(needed, capacity)) {
        reportCopy(device, kOverlap, info->dst);
    } else if (needed == 0 || needed > capacity) {
        target.invalidate();
        reportCopy(device, needed == 0 ? kNotBuilt : kTooLarge, info->dst);
    } else {
        recordMicromapBound(device, *micromapOf(info->dst), boundOf(needed));
        if (compacted)
            compacted->write(target.bytes());
        else
            std::memcpy(target.bytes(), source.bytes(), used);
    }
    return done(operation);
}

VkResult copyMicromapToMemory(DeviceMicromaps &device, VkDevice, VkDeferredOperationKHR operation,
                              const VkCopyMicromapToMemoryInfoEXT *info)
{
    if (!copyOf(device, "vkCopyMicromapToMemoryEXT", *info).accepted)
        return rejected(device);
    const uint64_t used = usedBytes(device, info->src);
    const View source = viewOf(device, info->src, used);
    if (!source.bytes())
        return VK_ERROR_OUT_OF_HOST_MEMORY;
    if (used == 0) {
        reportCopy(device, kNotBuilt, info->src);
        return done(operation);
    }
    const SerializedMicromapHeader header = serializedHeader(device.driver.driverUuid, used);
    auto *out = static_cast<uint8_t *>(info->dst.hostAddress);
    std::memcpy(out, &header, sizeof header);
    std::memcpy(out + sizeof header, source.bytes(), used);
    return done(operation);
}

VkResult copyMemoryToMicromap(DeviceMicromaps &device, VkDevice, VkDeferredOperationKHR operation,
                              const VkCopyMemoryToMicromapInfoEXT *info)
{
    const input::SerializedCopy copy = copyOf(device, "vkCopyMemoryToMicromapEXT", *info);
    if (!copy.accepted)
        return rejected(device);
    const auto *in = static_cast<const uint8_t *>(info->src.hostAddress);
    SerializedMicromapHeader header{};
    std::memcpy(&header, in, sizeof header);
    const SerializedMicromapHeader own = serializedHeader(device.driver.driverUuid, header.micromapBytes);
    const bool known = header.layoutUuid == own.layoutUuid && header.bytes == own.bytes &&
                       header.bytes >= sizeof header + kHeaderBytes &&
                       micromapMemoryInUse(in + sizeof header) == header.micromapBytes;
    const uint64_t capacity = micromapOf(info->dst)->size;
    const View target(device, info->dst,
                      known && header.micromapBytes <= capacity ? header.micromapBytes : kHeaderBytes,
                      HostView::For::Writing);
    if (!target.bytes())
        return VK_ERROR_OUT_OF_HOST_MEMORY;
    if (!known || header.micromapBytes > capacity) {
        target.invalidate();
        if (!copy.isReported)
            reportCopy(device, known ? kTooLarge : kNotSerialized, info->dst);
        return done(operation);
    }
    recordMicromapBound(device, *micromapOf(info->dst), boundOf(header.micromapBytes));
    std::memcpy(target.bytes(), in + sizeof header, header.micromapBytes);
    distrustMicromapRecords(target.bytes());
    return done(operation);
}

VkResult writeMicromapsProperties(DeviceMicromaps &device, VkDevice, uint32_t count, const VkMicromapEXT *micromaps,
                                  VkQueryType type, size_t size, void *data, size_t stride)
{
    const auto query = input::Checked<input::PropertyQuery>::take(micromaps, [&] {
        input::PropertyQuery parsed = input::parseQuery(count, micromaps, type, 0);
        parsed.bytes = size;
        parsed.stride = stride;
        parsed.memory = data;
        const Place place("vkWriteMicromapsPropertiesEXT");
        rules::checkHostQuery(InputCheck(device.objects.rules, place), parsed,
                              [&device](ObjectHandle handle) { return hostFacts(device, handle); });
        return parsed;
    });
    if (!query.accepted)
        return rejected(device);
    for (uint32_t i = 0; i < count; ++i) {
        VkDeviceSize value =
            std::max(type == VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT ? compactedBytes(device, micromaps[i])
                                                                       : usedBytes(device, micromaps[i]),
                     kHeaderBytes);
        if (type == VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT)
            value += sizeof(SerializedMicromapHeader);
        std::memcpy(static_cast<uint8_t *>(data) + i * stride, &value, sizeof value);
    }
    return VK_SUCCESS;
}

} // namespace vellum::layer
