// SPDX-License-Identifier: Apache-2.0
// Faults in instances: builds of top-level structures read changed copies of them.
#include "faulty_driver/faults.h"

#include <deque>
#include <map>
#include <memory>

namespace faults
{
namespace
{

constexpr Level kLevel = Level::Instances;
using Instance = VkAccelerationStructureInstanceKHR;

constexpr uint32_t kForceTwoState = VK_GEOMETRY_INSTANCE_FORCE_OPACITY_MICROMAP_2_STATE_EXT;
constexpr uint32_t kDisable = VK_GEOMETRY_INSTANCE_DISABLE_OPACITY_MICROMAPS_EXT;

// The flags of the instances as they were built first.
using Flags = std::vector<uint32_t>;

void disableInFirstOnly(std::span<Instance> instances, const Flags *)
{
    for (size_t i = 1; i < instances.size(); ++i)
        instances[i].flags = instances[i].flags & ~kDisable & 0xff;
}

void noTwoStateOverride(std::span<Instance> instances, const Flags *)
{
    for (Instance &instance : instances)
        instance.flags = instance.flags & ~kForceTwoState & 0xff;
}

void shortCustomIndex(std::span<Instance> instances, const Flags *)
{
    for (Instance &instance : instances)
        instance.instanceCustomIndex = instance.instanceCustomIndex & 0xffff;
}

void shortMask(std::span<Instance> instances, const Flags *)
{
    for (Instance &instance : instances)
        instance.mask = instance.mask & 0x7f;
}

float determinant(const VkTransformMatrixKHR &transform)
{
    const auto &m = transform.matrix;
    return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
           m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
}

void mirroredFacing(std::span<Instance> instances, const Flags *)
{
    for (Instance &instance : instances) {
        if (determinant(instance.transform) < 0)
            instance.flags = (instance.flags ^ VK_GEOMETRY_INSTANCE_TRIANGLE_FLIP_FACING_BIT_KHR) & 0xff;
    }
}

void forcedOpaqueWithoutMicromaps(std::span<Instance> instances, const Flags *)
{
    for (Instance &instance : instances) {
        if ((instance.flags & VK_GEOMETRY_INSTANCE_FORCE_OPAQUE_BIT_KHR) != 0)
            instance.flags = (instance.flags | kDisable) & 0xff;
    }
}

void updateKeepsFlags(std::span<Instance> instances, const Flags *first)
{
    for (size_t i = 0; first != nullptr && i < std::min(instances.size(), first->size()); ++i)
        instances[i].flags = (*first)[i] & 0xff;
}

// A value between -1 and 1, the same for the same instance of a structure.
float noise(size_t i)
{
    return static_cast<float>(i * 0x9e3779b9u % 2001) / 1000.0f - 1;
}

// Moves instances by a few units in the last place of world coordinates, like less precise arithmetic.
void rounded(std::span<Instance> instances, const Flags *)
{
    for (size_t i = 0; i < instances.size(); ++i)
        for (size_t r = 0; r < 3; ++r)
            instances[i].transform.matrix[r][3] += 2e-6f * noise(7 * i + r + 1);
}

void displaced(std::span<Instance> instances, const Flags *)
{
    for (Instance &instance : instances)
        instance.transform.matrix[0][3] += 0.01f;
}

template <size_t first>
void noFlagsFrom(std::span<Instance> instances, const Flags *)
{
    for (size_t i = first; i < instances.size(); ++i)
        instances[i].flags = 0;
}

struct Fault {
    const char *name;
    void (*apply)(std::span<Instance>, const Flags *first); // first: null for builds that are no updates
};
constexpr Fault kFaults[]{
    {"disable-in-first-instance-only", disableInFirstOnly},
    {"instance-2-state-ignored", noTwoStateOverride},
    {"custom-index-16-bits", shortCustomIndex},
    {"instance-mask-7-bits", shortMask},
    {"mirrored-instance-faces-away", mirroredFacing},
    {"force-opaque-disables-micromaps", forcedOpaqueWithoutMicromaps},
    {"update-keeps-instance-flags", updateKeepsFlags},
    {"instance-flags-lost-from-64", noFlagsFrom<64>},
    {"instance-flags-lost-from-256", noFlagsFrom<256>},
    {"instance-flags-lost-from-65536", noFlagsFrom<65536>},
    {"coarse-arithmetic", rounded},
    {"instances-displaced", displaced},
};

// The latest build of a structure, for updates and copies.
struct Built {
    VkBuildAccelerationStructureFlagsKHR flags = 0;
    uint32_t count = 0;
    std::shared_ptr<std::vector<Instance>> instances = std::make_shared<std::vector<Instance>>();
};
std::mutex mutex;
std::map<uint64_t, Built> builtOf;

bool chosen(void *key)
{
    return has(key, "copy-loses-instance-flags") || has(key, "instance-offsets-by-16") ||
           std::any_of(std::begin(kFaults), std::end(kFaults),
                       [key](const Fault &fault) { return has(key, fault.name); });
}

std::vector<Instance> readInstances(const VkAccelerationStructureGeometryInstancesDataKHR &data, uint32_t count)
{
    std::vector<Instance> instances(count);
    for (uint32_t i = 0; i < count; ++i) {
        VkDeviceAddress address = data.data.deviceAddress + i * sizeof(Instance);
        if (data.arrayOfPointers != VK_FALSE)
            std::memcpy(&address, hostPointer<const void>(data.data.deviceAddress + i * sizeof address),
                        sizeof address);
        std::memcpy(static_cast<void *>(&instances[i]), hostPointer<const void>(address), sizeof(Instance));
    }
    return instances;
}

// Builds of top-level structures that read copies of their instances.
class Builds
{
public:
    Builds(VkCommandBuffer commands, std::span<const BuildInfo> infos, const RangeInfo *const *ranges)
        : infos_(infos.begin(), infos.end()), ranges_(ranges, ranges + infos.size())
    {
        for (size_t i = 0; i < infos.size(); ++i) {
            if (infos[i].geometryCount == 1 && infos[i].type != VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR &&
                geometryOf(infos[i], 0).geometryType == VK_GEOMETRY_TYPE_INSTANCES_KHR)
                apply(commands, infos_[i], ranges_[i]);
        }
    }
    [[nodiscard]] const BuildInfo *infos() const { return infos_.data(); }
    [[nodiscard]] const RangeInfo *const *ranges() const { return ranges_.data(); }

private:
    void apply(VkCommandBuffer commands, BuildInfo &info, const RangeInfo *&range)
    {
        auto &geometry = geometries_.emplace_back(geometryOf(info, 0));
        auto &own = ownRanges_.emplace_back(*range);
        auto &data = geometry.geometry.instances;
        const bool update = info.mode == VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR;
        auto given = data;
        constexpr uint32_t kMultiple = 16;
        given.data.deviceAddress += has(keyOf(commands), "instance-offsets-by-16")
                                        ? own.primitiveOffset / kMultiple * kMultiple
                                        : own.primitiveOffset;
        const uint32_t count = own.primitiveCount;
        const Memory memory = memoryFor(commands, count * sizeof(Instance));
        std::lock_guard lock(mutex);
        const Built source = builtOf[numberOf(info.srcAccelerationStructure)];
        Built &built = builtOf[numberOf(info.dstAccelerationStructure)];
        built = {.flags = info.flags, .count = count};
        beforeExecution(commands, [=, target = built.instances, key = keyOf(commands)] {
            *target = readInstances(given, count);
            std::vector<Instance> instances = *target;
            Flags first;
            for (const Instance &instance : *source.instances)
                first.push_back(instance.flags);
            for (const Fault &fault : kFaults) {
                if (has(key, fault.name))
                    fault.apply(instances, update ? &first : nullptr);
            }
            std::memcpy(memory.bytes, instances.data(), instances.size() * sizeof(Instance));
        });
        data.arrayOfPointers = VK_FALSE;
        data.data.deviceAddress = memory.address;
        own.primitiveOffset = 0;
        info.pGeometries = &geometry;
        info.ppGeometries = nullptr;
        range = &own;
    }

    std::vector<BuildInfo> infos_;
    std::vector<const RangeInfo *> ranges_;
    std::deque<VkAccelerationStructureGeometryKHR> geometries_;
    std::deque<RangeInfo> ownRanges_;
};

VKAPI_ATTR void VKAPI_CALL cmdBuild(VkCommandBuffer handle, uint32_t count, const BuildInfo *infos,
                                    const RangeInfo *const *ranges)
{
    const auto build = DRIVER_NEXT(vkCmdBuildAccelerationStructuresKHR);
    if (!chosen(keyOf(handle)))
        return build(handle, count, infos, ranges);
    const Builds builds(handle, {infos, count}, ranges);
    build(handle, count, builds.infos(), builds.ranges());
}

// Builds the target from the source's instances instead, without their flags.
void buildWithoutFlags(VkCommandBuffer handle, VkAccelerationStructureKHR target, const Built &source)
{
    const Memory memory = memoryFor(handle, source.count * sizeof(Instance));
    beforeExecution(handle, [memory, all = source.instances] {
        std::vector<Instance> instances = *all;
        for (Instance &instance : instances)
            instance.flags = 0;
        std::memcpy(memory.bytes, instances.data(), instances.size() * sizeof(Instance));
    });
    auto geometry = vkInit<VkAccelerationStructureGeometryKHR>({.geometryType = VK_GEOMETRY_TYPE_INSTANCES_KHR});
    geometry.geometry.instances = vkInit<VkAccelerationStructureGeometryInstancesDataKHR>();
    geometry.geometry.instances.data.deviceAddress = memory.address;
    auto info = vkInit<BuildInfo>({.type = VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR,
                                   .flags = source.flags,
                                   .dstAccelerationStructure = target,
                                   .geometryCount = 1,
                                   .pGeometries = &geometry});
    auto sizes = vkInit<VkAccelerationStructureBuildSizesInfoKHR>();
    DRIVER_NEXT(vkGetAccelerationStructureBuildSizesKHR)
    (deviceOf(keyOf(handle)), VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &info, &source.count, &sizes);
    info.scratchData.deviceAddress = memoryFor(handle, sizes.buildScratchSize).address;
    const RangeInfo range{source.count, 0, 0, 0};
    const RangeInfo *ranges = &range;
    DRIVER_NEXT(vkCmdBuildAccelerationStructuresKHR)(handle, 1, &info, &ranges);
}

VKAPI_ATTR void VKAPI_CALL cmdCopy(VkCommandBuffer handle, const VkCopyAccelerationStructureInfoKHR *info)
{
    Built source;
    if (has(keyOf(handle), "copy-loses-instance-flags")) {
        std::lock_guard lock(mutex);
        const auto found = builtOf.find(numberOf(info->src));
        source = found == builtOf.end() ? Built{} : found->second;
    }
    if (source.count > 0 && info->mode == VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR)
        return buildWithoutFlags(handle, info->dst, source);
    DRIVER_NEXT(vkCmdCopyAccelerationStructureKHR)(handle, info);
}

VKAPI_ATTR void VKAPI_CALL destroy(VkDevice handle, VkAccelerationStructureKHR structure,
                                   const VkAllocationCallbacks *allocator)
{
    {
        std::lock_guard lock(mutex);
        builtOf.erase(numberOf(structure));
    }
    DRIVER_NEXT(vkDestroyAccelerationStructureKHR)(handle, structure, allocator);
}

} // namespace

LevelRows instanceRows()
{
    static const Row device[]{
        {"vkCmdBuildAccelerationStructuresKHR", DRIVER_FUNCTION(cmdBuild)},
        {"vkCmdCopyAccelerationStructureKHR", DRIVER_FUNCTION(cmdCopy)},
        {"vkDestroyAccelerationStructureKHR", DRIVER_FUNCTION(destroy)},
    };
    return {device, {}};
}

} // namespace faults
