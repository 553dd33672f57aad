// SPDX-License-Identifier: Apache-2.0
#include "layer/structures/top_level_instances.h"

#include <algorithm>
#include <initializer_list>

#include "core/opacity.h"
#include "core/records.h"
#include "layer/structures/device_structures.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

constexpr uint32_t kinds(std::initializer_list<uint32_t> list)
{
    uint32_t bits = 0;
    for (const uint32_t kind : list)
        bits |= 1u << kind;
    return bits;
}

// That a bottom-level structure is built before a build references it is the application's part. Those of a copy may
// have been destroyed, or come from another process.
constexpr uint32_t kBuilt = kinds({kDescriptorBottom, kDescriptorPlain, kDescriptorBoxes});
constexpr uint32_t kBottom = kBuilt | kinds({kDescriptorUnbuilt});
constexpr uint32_t kKinds = kBottom | kinds({kDescriptorTop, kDescriptorBroken, kDescriptorMicromap});

constexpr uint32_t hitTables(uint32_t four)
{
    uint32_t tables = 0;
    for (uint32_t i = 0; i < 4; ++i)
        tables |= hitTable((four * 4 + i) << kInstanceFlagsShift) >> kHitTableShift << i * 8;
    return tables;
}

} // namespace

bool patchInstances(InjectedWork &work, const DeviceStructures &device, const SlotRange &slots, uint32_t count,
                    VkDeviceAddress source, VkDeviceAddress tail, InstanceSource from)
{
    const bool copy = from == InstanceSource::Copy;
    TlasInstancesPush push{};
    push.root = device.objects.root.address();
    push.counters = device.objects.root.gpuErrorsAddress();
    push.hitTables[0] = hitTables(0);
    push.hitTables[1] = hitTables(1);
    push.usableKinds = copy ? kBuilt : kBottom;
    push.wrongKinds = kKinds & ~push.usableKinds & ~kinds({kDescriptorBroken}); // what broke it was reported
    push.unknownError = copy                                    ? kGpuErrorUnknownReference
                        : from == InstanceSource::IndirectBuild ? kGpuErrorNoBottomLevelIndirect
                                                                : kGpuErrorNoBottomLevel;
    push.unbuiltError = kGpuErrorUnbuiltReference;
    // A dispatch for each page of records.
    for (uint32_t done = 0; done < count; done += push.count) {
        const VkDeviceSize offset = done * sizeof(VkAccelerationStructureInstanceKHR);
        push.source = source + offset;
        push.tail = tail + offset;
        push.firstSlot = slots.first() + done;
        push.records = slots.recordAddress(push.firstSlot);
        push.count = std::min(count - done, kSlotsPerPage - push.firstSlot % kSlotsPerPage);
        if (!work.dispatch(InjectedShader::TlasInstances, push, push.count, 64))
            return false;
    }
    return true;
}

} // namespace vellum::layer
