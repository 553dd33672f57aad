#include "layer/structures/fallback_structure.h"

#include <cstring>

#include "core/records.h"
#include "layer/structures/device_structures.h"
#include "layer/structures/probe_structure.h"
#include "layer/structures/structure_layout.h"

namespace vellum::layer
{
namespace
{

constexpr VkDeviceSize kSpareBytes = 4096;

// One triangle, in a structure that is larger than it needs: does the driver copy all of it?
class SerializationProbe : public Probe
{
public:
    explicit SerializationProbe(DeviceStructures &device) : device_(device), triangle_(device.buffers.gpu) {}

    bool record(VkCommandBuffer commands) override
    {
        if (!triangle_.buildTriangle(commands, 0, kSpareBytes) ||
            serialized_.create(device_.buffers.gpu, triangle_.size() + 2 * kSpareBytes) != VK_SUCCESS ||
            // Now, while there may be another trial.
            device_.fallback.memory.create(device_.buffers.gpu, alignUp(triangle_.size() + kSpareBytes, 16)) !=
                VK_SUCCESS)
            return false;
        VkCopyAccelerationStructureToMemoryInfoKHR info{
            VK_STRUCTURE_TYPE_COPY_ACCELERATION_STRUCTURE_TO_MEMORY_INFO_KHR};
        info.src = triangle_.handle();
        info.dst.deviceAddress = alignUp(serialized_.address(), kPartAlignment);
        info.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_SERIALIZE_KHR;
        device_.driver.next.CmdCopyAccelerationStructureToMemoryKHR(commands, &info);
        return true;
    }

    void read() override
    {
        const VkDeviceSize skipped = alignUp(serialized_.address(), kPartAlignment) - serialized_.address();
        const uint32_t *words = serialized_.words() + skipped / 4;
        // The header that the specification gives.
        uint64_t bytes = words[8] | uint64_t{words[9]} << 32;
        uint64_t size = words[10] | uint64_t{words[11]} << 32;
        FallbackStructure &fallback = device_.fallback;
        if (bytes < shared::kSerializedHeaderWords * 4 || bytes > triangle_.size() + kSpareBytes)
            return;
        fallback.wholeCopies = bytes >= triangle_.size();
        if (fallback.wholeCopies) {
            bytes -= kSpareBytes;
            size -= kSpareBytes;
        }
        uint32_t *kept = fallback.memory.words();
        std::memcpy(kept, words, bytes);
        kept[8] = static_cast<uint32_t>(bytes);
        kept[10] = static_cast<uint32_t>(size);
        fallback.units = static_cast<uint32_t>(alignUp(bytes, 16) / 16);
        fallback.structureBytes = alignUp(size, kPartAlignment);
    }

private:
    DeviceStructures &device_;
    ProbeStructure triangle_;
    GpuBuffer serialized_;
};

} // namespace

FallbackFacts fallbackStructure(DeviceStructures &device)
{
    FallbackStructure &fallback = device.fallback;
    std::lock_guard lock(fallback.mutex);
    // After a trial that was not carried out, the next one who asks tries again.
    if (!fallback.tried)
        fallback.tried = !device.driver.enabled.structures || !device.commands.probes.exists() ||
                         device.commands.probes.run(std::make_unique<SerializationProbe>(device));
    if (fallback.units == 0)
        return {.wholeCopies = fallback.wholeCopies};
    return {fallback.memory.address(), fallback.memory.words(), fallback.units, fallback.structureBytes,
            fallback.wholeCopies};
}

} // namespace vellum::layer
