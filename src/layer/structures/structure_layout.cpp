// SPDX-License-Identifier: Apache-2.0
#include "layer/structures/structure_layout.h"

#include <algorithm>
#include <bit>
#include <initializer_list>

#include "core/opacity.h"
#include "core/records.h"
#include "layer/structures/device_structures.h"

namespace vellum::layer
{

using namespace shared;

namespace
{

// The flags of a top-level build for the driver, which neither updates nor copies the structure. It may be queried for
// its compacted size.
VkBuildAccelerationStructureFlagsKHR topLevelFlags(VkBuildAccelerationStructureFlagsKHR application)
{
    return application & (VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR |
                          VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR |
                          VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_BUILD_BIT_KHR |
                          VK_BUILD_ACCELERATION_STRUCTURE_LOW_MEMORY_BIT_KHR);
}

} // namespace

void hideMicromaps(StructureBuild &build)
{
    const VkBuildAccelerationStructureFlagsKHR micromapFlags =
        VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_UPDATE_EXT |
        VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_DISABLE_OPACITY_MICROMAPS_EXT |
        VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_DATA_UPDATE_EXT |
        VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR;
    build.info.flags &= ~micromapFlags;
    for (uint32_t g = 0; g < build.geometryCount(); ++g) {
        if (build.inputs[g].micromap)
            build.geometries[g].flags &= ~static_cast<VkGeometryFlagsKHR>(VK_GEOMETRY_OPAQUE_BIT_KHR);
    }
    if (!build.topLevel)
        return;
    // An update is carried out as a build, since a copy may have additional, inactive instances that the application
    // does not know. Copies of top-level structures are also builds.
    build.info.flags = topLevelFlags(build.info.flags);
    build.info.mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR;
    build.info.srcAccelerationStructure = VK_NULL_HANDLE;
}

VkDeviceSize bottomLevelTailBytes(const StructureBuild &build, const uint32_t *primitives)
{
    if (!build.hasMicromaps)
        return 0;
    VkDeviceSize bytes = build.geometryCount() * VkDeviceSize{kGeometryRecordWords + kMicromapNameWords} * 4;
    for (uint32_t i = 0; i < build.geometryCount(); ++i) {
        if (build.inputs[i].micromap)
            bytes += alignUp(primitives[i] * VkDeviceSize{kTriangleRecordWords} * 4, 16);
    }
    return alignUp(bytes, kPartAlignment);
}

TopLevelBuild::TopLevelBuild(VkBuildAccelerationStructureFlagsKHR flags, VkDeviceAddress instances)
    : geometry{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR},
      info{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_GEOMETRY_INFO_KHR}
{
    geometry.geometryType = VK_GEOMETRY_TYPE_INSTANCES_KHR;
    geometry.geometry.instances = {VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_INSTANCES_DATA_KHR};
    geometry.geometry.instances.data.deviceAddress = instances;
    info.type = VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR;
    info.flags = topLevelFlags(flags);
    info.mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR;
    info.geometryCount = 1;
    info.pGeometries = &geometry;
}

TopLevelLayout::TopLevelLayout(const Driver &driver, VkBuildAccelerationStructureFlagsKHR flags, uint32_t instances)
    : count(instances)
{
    VkDeviceSize driverBytes = 0;
    const auto measure = [&](VkBuildAccelerationStructureFlagsKHR buildFlags) {
        const TopLevelBuild build(buildFlags, 0);
        VkAccelerationStructureBuildSizesInfoKHR sizes{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR};
        driver.next.GetAccelerationStructureBuildSizesKHR(
            driver.handle, VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &build.info, &count, &sizes);
        driverBytes = std::max(driverBytes, sizes.accelerationStructureSize);
        scratchBytes = std::max(scratchBytes, sizes.buildScratchSize);
    };
    measure(kTopLevelCopyFlags);
    if (topLevelFlags(flags) != kTopLevelCopyFlags)
        measure(flags);
    // A driver that clears whole handles has one for each offset, which lives as long as the structure: at most 32 for
    // each power of two.
    const VkDeviceSize step = driver.clearsWholeHandles ? std::bit_floor(driverBytes) / 32 : 0;
    tailOffset = alignUp(driverBytes, std::max(step, kPartAlignment));
}

uint32_t topLevelCapacity(const Driver &driver, VkDeviceSize size)
{
    uint32_t fits = 0;
    // VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03801 and the number of slots are further limits.
    auto tooMany = static_cast<uint32_t>(std::min<VkDeviceSize>(size / sizeof(VkAccelerationStructureInstanceKHR) + 1,
                                                                VkDeviceSize{kDirectoryPages} << kSlotsPerPageLog2));
    while (tooMany - fits > 1) {
        const uint32_t middle = fits + (tooMany - fits) / 2;
        (TopLevelLayout(driver, kTopLevelCopyFlags, middle).bytes() <= size ? fits : tooMany) = middle;
    }
    return fits;
}

namespace
{

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
