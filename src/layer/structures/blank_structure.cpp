#include "layer/structures/blank_structure.h"

#include <cstring>

#include "core/records.h"
#include "layer/structures/device_structures.h"
#include "layer/structures/structure_layout.h"
#include "layer/structures/trial_structure.h"

namespace vellum::layer
{
namespace
{

constexpr VkDeviceSize kSpareBytes = 4096;

// One triangle, in a structure that is larger than it needs: does the driver copy all of it?
class SerializationTrial : public Trial
{
public:
    explicit SerializationTrial(DeviceStructures &device) : device_(device), triangle_(device.buffers.gpu) {}

    bool record(VkCommandBuffer commands) override
    {
        if (!triangle_.buildTriangle(commands, 0, kSpareBytes) ||
            serialized_.create(device_.buffers.gpu, triangle_.size() + 2 * kSpareBytes) != VK_SUCCESS ||
            // Now, while there may be another trial.
            device_.blank.memory.create(device_.buffers.gpu, alignUp(triangle_.size() + kSpareBytes, 16)) != VK_SUCCESS)
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
        BlankStructure &blank = device_.blank;
        if (bytes < shared::kSerializedHeaderWords * 4 || bytes > triangle_.size() + kSpareBytes)
            return;
        blank.wholeCopies = bytes >= triangle_.size();
        if (blank.wholeCopies) {
            bytes -= kSpareBytes;
            size -= kSpareBytes;
        }
        uint32_t *kept = blank.memory.words();
        std::memcpy(kept, words, bytes);
        kept[8] = static_cast<uint32_t>(bytes);
        kept[10] = static_cast<uint32_t>(size);
        blank.units = static_cast<uint32_t>(alignUp(bytes, 16) / 16);
        blank.structureBytes = alignUp(size, kPartAlignment);
    }

private:
    DeviceStructures &device_;
    TrialStructure triangle_;
    GpuBuffer serialized_;
};

} // namespace

BlankFacts blankStructure(DeviceStructures &device)
{
    BlankStructure &blank = device.blank;
    std::lock_guard lock(blank.mutex);
    // After a trial that was not carried out, the next one who asks tries again.
    if (!blank.tried)
        blank.tried = !device.driver.asked.structures || !device.commands.trials.exists() ||
                      device.commands.trials.run(std::make_unique<SerializationTrial>(device));
    if (blank.units == 0)
        return {.wholeCopies = blank.wholeCopies};
    return {blank.memory.address(), blank.memory.words(), blank.units, blank.structureBytes, blank.wholeCopies};
}

} // namespace vellum::layer
