// SPDX-License-Identifier: Apache-2.0
#include "layer/micromaps/micromap_host.h"

#include <algorithm>
#include <cstring>
#include <optional>

#include "core/micromap_memory.h"
#include "layer/micromaps/device_micromaps.h"
#include "layer/micromaps/micromap_input.h"
#include "layer/micromaps/micromap_serialized.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

VkResult done(VkDeferredOperationKHR operation)
{
    return operation ? VK_OPERATION_NOT_DEFERRED_KHR : VK_SUCCESS;
}

InputCheck hostCheck(const DeviceMicromaps &device, const char *command, VkMicromapEXT micromap,
                     std::optional<uint32_t> element = std::nullopt)
{
    return {device.driver.report(), command, VK_OBJECT_TYPE_MICROMAP_EXT, reinterpret_cast<uint64_t>(micromap),
            element};
}

VkResult reject(const InputCheck &check, const char *id, const std::string &text)
{
    check.reject(id, text);
    return VK_ERROR_VALIDATION_FAILED_EXT;
}

// Without the feature the layer does not track the application's mappings.
bool enabled(const DeviceMicromaps &device, const InputCheck &check, const char *id)
{
    return device.driver.enabled.hostCommands || check.reject(id, "the feature micromapHostCommands is not enabled");
}

// Copies that cannot be carried out. As on the device, messages about them do not depend on the setting `validate`.
constexpr const char *kNotBuilt[] = {"VELLUM-micromap-not-constructed",
                                     "the micromap was not constructed before it is used"};
constexpr const char *kOverlap[] = {"VELLUM-micromap-copy-overlap",
                                    "src and dst of a copy overlap; the target is as it was"};
constexpr const char *kTooLarge[] = {"VELLUM-micromap-copy-size", "the target of a copy is too small"};
constexpr const char *kNotSerialized[] = {
    "VELLUM-VUID-VkCopyMemoryToMicromapInfoEXT-src-07549",
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

// Bytes in use; 0 if no micromap was constructed there; nullopt if the host cannot read the memory.
std::optional<uint64_t> readUsedBytes(DeviceMicromaps &device, VkMicromapEXT handle)
{
    const View header(device, handle, kHeaderBytes, HostView::For::Reading);
    if (!header.bytes())
        return std::nullopt;
    if (micromapOf(handle)->size < kHeaderBytes)
        return 0;
    const uint64_t used = micromapMemoryInUse(header.bytes());
    return used <= micromapOf(handle)->size ? used : 0;
}
uint64_t usedBytes(DeviceMicromaps &device, VkMicromapEXT handle)
{
    return readUsedBytes(device, handle).value_or(0);
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
    input.share = build.extent.share;
    writeMicromapMemory(input, out);
}

VkResult buildOne(DeviceMicromaps &device, const InputCheck &check, const VkMicromapBuildInfoEXT &info)
{
    auto build = parseMicromapBuild(check, info);
    if (!build || !checkMicromapBuild(check, kHostBuildRules, info, *build))
        return VK_ERROR_VALIDATION_FAILED_EXT;
    const View view(device, info.dstMicromap, build->extent.bytes(), HostView::For::Writing);
    if (!view.bytes())
        return reject(check, "VELLUM-VUID-vkBuildMicromapsEXT-pInfos-07552",
                      "dstMicromap is not bound to host-visible memory");
    if (build->extent.triangles > 0 && (!build->data.hostAddress || !build->triangles.hostAddress))
        return reject(check,
                      build->data.hostAddress ? "VELLUM-VUID-vkBuildMicromapsEXT-pInfos-07554"
                                              : "VELLUM-VUID-vkBuildMicromapsEXT-pInfos-07553",
                      "data or triangleArray is null");
    write(*build, view.bytes());
    return VK_SUCCESS;
}

} // namespace

VkResult buildMicromaps(DeviceMicromaps &device, VkDevice, VkDeferredOperationKHR operation, uint32_t count,
                        const VkMicromapBuildInfoEXT *infos)
{
    if (!enabled(device, hostCheck(device, "vkBuildMicromapsEXT", VK_NULL_HANDLE),
                 "VELLUM-VUID-vkBuildMicromapsEXT-micromapHostCommands-07555"))
        return VK_ERROR_FEATURE_NOT_PRESENT;
    VkResult result = VK_SUCCESS;
    for (uint32_t i = 0; i < count; ++i) {
        const InputCheck check = hostCheck(device, "vkBuildMicromapsEXT", infos[i].dstMicromap, i);
        if (const VkResult built = buildOne(device, check, infos[i]); built != VK_SUCCESS)
            result = built;
    }
    return result == VK_SUCCESS ? done(operation) : result;
}

VkResult copyMicromap(DeviceMicromaps &device, VkDevice, VkDeferredOperationKHR operation,
                      const VkCopyMicromapInfoEXT *info)
{
    const InputCheck check = hostCheck(device, "vkCopyMicromapEXT", info->dst);
    if (!enabled(device, check, "VELLUM-VUID-vkCopyMicromapEXT-micromapHostCommands-07560"))
        return VK_ERROR_FEATURE_NOT_PRESENT;
    if (info->mode != VK_COPY_MICROMAP_MODE_CLONE_EXT && info->mode != VK_COPY_MICROMAP_MODE_COMPACT_EXT &&
        !check.tolerate("VELLUM-VUID-VkCopyMicromapInfoEXT-mode-07531", "mode is neither CLONE nor COMPACT"))
        return VK_ERROR_VALIDATION_FAILED_EXT;
    const uint64_t used = usedBytes(device, info->src);
    const uint64_t capacity = info->dst ? micromapOf(info->dst)->size : 0;
    const View source = viewOf(device, info->src, used);
    const View target(device, info->dst, std::max(used, kHeaderBytes), HostView::For::Writing);
    if (!source.bytes() || !target.bytes())
        return reject(check,
                      source.bytes() ? "VELLUM-VUID-vkCopyMicromapEXT-buffer-07559"
                                     : "VELLUM-VUID-vkCopyMicromapEXT-buffer-07558",
                      "src or dst is not bound to host-visible memory");
    // As the device does it (shaders/micromaps/micromap_move.comp).
    const uint64_t written = std::min(used, capacity);
    if (target.bytes() < source.bytes() + written && source.bytes() < target.bytes() + written) {
        reportCopy(device, kOverlap, info->dst);
    } else if (used == 0 || used > capacity) {
        target.invalidate();
        reportCopy(device, used == 0 ? kNotBuilt : kTooLarge, info->dst);
    } else {
        std::memcpy(target.bytes(), source.bytes(), used);
    }
    return done(operation);
}

VkResult copyMicromapToMemory(DeviceMicromaps &device, VkDevice, VkDeferredOperationKHR operation,
                              const VkCopyMicromapToMemoryInfoEXT *info)
{
    const InputCheck check = hostCheck(device, "vkCopyMicromapToMemoryEXT", info->src);
    if (!enabled(device, check, "VELLUM-VUID-vkCopyMicromapToMemoryEXT-micromapHostCommands-07571"))
        return VK_ERROR_FEATURE_NOT_PRESENT;
    if (info->mode != VK_COPY_MICROMAP_MODE_SERIALIZE_EXT &&
        !check.tolerate("VELLUM-VUID-VkCopyMicromapToMemoryInfoEXT-mode-07542", "mode is not SERIALIZE"))
        return VK_ERROR_VALIDATION_FAILED_EXT;
    const uint64_t used = usedBytes(device, info->src);
    const View source = viewOf(device, info->src, used);
    if (!source.bytes() || !info->dst.hostAddress)
        return reject(check,
                      source.bytes() ? "VELLUM-VUID-vkCopyMicromapToMemoryEXT-pInfo-07569"
                                     : "VELLUM-VUID-vkCopyMicromapToMemoryEXT-buffer-07568",
                      "src is not bound to host-visible memory, or dst is null");
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
    const InputCheck check = hostCheck(device, "vkCopyMemoryToMicromapEXT", info->dst);
    if (!enabled(device, check, "VELLUM-VUID-vkCopyMemoryToMicromapEXT-micromapHostCommands-07566"))
        return VK_ERROR_FEATURE_NOT_PRESENT;
    if (info->mode != VK_COPY_MICROMAP_MODE_DESERIALIZE_EXT &&
        !check.tolerate("VELLUM-VUID-VkCopyMemoryToMicromapInfoEXT-mode-07548", "mode is not DESERIALIZE"))
        return VK_ERROR_VALIDATION_FAILED_EXT;
    const auto *in = static_cast<const uint8_t *>(info->src.hostAddress);
    SerializedMicromapHeader header{};
    if (in)
        std::memcpy(&header, in, sizeof header);
    const SerializedMicromapHeader own = serializedHeader(device.driver.driverUuid, header.micromapBytes);
    const bool known = in && header.layoutUuid == own.layoutUuid && header.bytes == own.bytes &&
                       header.bytes >= sizeof header + kHeaderBytes &&
                       micromapMemoryInUse(in + sizeof header) == header.micromapBytes;
    const uint64_t capacity = info->dst ? micromapOf(info->dst)->size : 0;
    const View target(device, info->dst,
                      known && header.micromapBytes <= capacity ? header.micromapBytes : kHeaderBytes,
                      HostView::For::Writing);
    if (!target.bytes() || !in)
        return reject(check,
                      target.bytes() ? "VELLUM-VUID-vkCopyMemoryToMicromapEXT-pInfo-07563"
                                     : "VELLUM-VUID-vkCopyMemoryToMicromapEXT-buffer-07565",
                      "dst is not bound to host-visible memory, or src is null");
    if (!known || header.micromapBytes > capacity) {
        target.invalidate();
        reportCopy(device, known ? kTooLarge : kNotSerialized, info->dst);
        return done(operation);
    }
    std::memcpy(target.bytes(), in + sizeof header, header.micromapBytes);
    distrustMicromapRecords(target.bytes());
    return done(operation);
}

VkResult writeMicromapsProperties(DeviceMicromaps &device, VkDevice, uint32_t count, const VkMicromapEXT *micromaps,
                                  VkQueryType type, size_t size, void *data, size_t stride)
{
    constexpr const char *kCommand = "vkWriteMicromapsPropertiesEXT";
    if (!enabled(device, hostCheck(device, kCommand, VK_NULL_HANDLE),
                 "VELLUM-VUID-vkWriteMicromapsPropertiesEXT-micromapHostCommands-07578"))
        return VK_ERROR_FEATURE_NOT_PRESENT;
    const bool serialized = type == VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT;
    if (!serialized && type != VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT)
        return reject(hostCheck(device, kCommand, VK_NULL_HANDLE),
                      "VELLUM-VUID-vkWriteMicromapsPropertiesEXT-queryType-07503",
                      "queryType is not a type of micromap queries");
    for (uint32_t i = 0; i < count; ++i) {
        const InputCheck check = hostCheck(device, kCommand, micromaps[i]);
        if (i * stride + sizeof(VkDeviceSize) > size)
            return reject(check, "VELLUM-VUID-vkWriteMicromapsPropertiesEXT-dataSize-07576", "dataSize is too small");
        const std::optional<uint64_t> used = readUsedBytes(device, micromaps[i]);
        if (!used)
            return reject(check, "VELLUM-VUID-vkWriteMicromapsPropertiesEXT-buffer-07577",
                          "a micromap is not bound to host-visible memory");
        VkDeviceSize value = std::max(*used, kHeaderBytes);
        if (serialized)
            value += sizeof(SerializedMicromapHeader);
        std::memcpy(static_cast<uint8_t *>(data) + i * stride, &value, sizeof value);
    }
    return VK_SUCCESS;
}

} // namespace vellum::layer
