// SPDX-License-Identifier: Apache-2.0
// Wrong copies of micromaps.
#include "recorded.h"

namespace vt
{
namespace
{

constexpr VkBuildMicromapFlagsEXT kAllow = VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT;
constexpr auto kClone = VK_COPY_MICROMAP_MODE_CLONE_EXT;
constexpr auto kCompact = VK_COPY_MICROMAP_MODE_COMPACT_EXT;
constexpr auto kSerialize = VK_COPY_MICROMAP_MODE_SERIALIZE_EXT;
constexpr auto kDeserialize = VK_COPY_MICROMAP_MODE_DESERIALIZE_EXT;

void mode(Gpu &gpu, bool wrong)
{
    const Twins twins(gpu);
    const Micromap target(gpu, twins.source, twins.source.size());
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) {
        recordMicromapCopy(gpu, commands, twins.built, target.handle(), wrong ? kSerialize : kClone);
    });
}

void notBuilt(Gpu &gpu, bool wrong)
{
    const Twins twins(gpu);
    const Micromap target(gpu, twins.source, twins.source.size());
    gpu.submit([&](VkCommandBuffer commands) {
        recordMicromapCopy(gpu, commands, wrong ? twins.other : twins.built, target.handle(), kClone);
    });
}

void compaction(Gpu &gpu, bool wrong)
{
    Micromap source(gpu, oneTriangle(), wrong ? 0 : kAllow);
    source.build();
    const Micromap target(gpu, source, source.size());
    gpu.submit([&](VkCommandBuffer commands) {
        recordMicromapCopy(gpu, commands, source.handle(), target.handle(), kCompact);
    });
}

void overlap(Gpu &gpu, bool wrong)
{
    const Twins twins(gpu);
    const Micromap target(gpu, twins.source, twins.source.size());
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) {
        recordMicromapCopy(gpu, commands, twins.built, wrong ? twins.other : target.handle(), kClone);
    });
}

// The members that a program with serialized data changes.
struct Serialized {
    VkDeviceAddress offset = 0;
    bool null = false;
    bool otherMode = false;
};

Buffer serializedMemory(Gpu &gpu)
{
    return {gpu, 65536, VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT};
}

VkDeviceAddress addressIn(const Buffer &buffer, const Serialized &change)
{
    return change.null ? 0 : (buffer.address() + 255) / 256 * 256 + change.offset;
}

template <Serialized change>
void serialize(Gpu &gpu, bool wrong)
{
    const Twins twins(gpu);
    const Buffer memory = serializedMemory(gpu);
    const Serialized used = wrong ? change : Serialized{};
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) {
        recordMicromapToMemory(gpu, commands, twins.built, addressIn(memory, used),
                               used.otherMode ? kClone : kSerialize);
    });
}

template <Serialized change>
void deserialize(Gpu &gpu, bool wrong)
{
    const Twins twins(gpu);
    const Micromap target(gpu, twins.source, twins.source.size());
    const Buffer memory = serializedMemory(gpu);
    gpu.submit(
        [&](VkCommandBuffer commands) { recordMicromapToMemory(gpu, commands, twins.built, addressIn(memory, {})); });
    const Serialized used = wrong ? change : Serialized{};
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) {
        recordMemoryToMicromap(gpu, commands, addressIn(memory, used), target.handle(),
                               used.otherMode ? kClone : kDeserialize);
    });
}

void serializeNotBuilt(Gpu &gpu, bool wrong)
{
    const Twins twins(gpu);
    const Buffer memory = serializedMemory(gpu);
    gpu.submit([&](VkCommandBuffer commands) {
        recordMicromapToMemory(gpu, commands, wrong ? twins.other : twins.built, addressIn(memory, {}));
    });
}

// A structure without micromaps, whose data needs an alignment of 256 bytes.
void serializeStructure(Gpu &gpu, bool wrong)
{
    const Blas blas(gpu, {Geometry{.vertices = triangleRow(1)}});
    const Buffer memory = serializedMemory(gpu);
    auto info = vkInit<VkCopyAccelerationStructureToMemoryInfoKHR>(
        {.src = blas.handle(), .mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_SERIALIZE_KHR});
    info.dst.deviceAddress = addressIn(memory, {.offset = wrong ? 64u : 0u});
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) {
        gpu.vk().CmdCopyAccelerationStructureToMemoryKHR(commands, &info);
    });
}

void deserializeStructure(Gpu &gpu, bool wrong)
{
    const Blas blas(gpu, {Geometry{.vertices = triangleRow(1)}});
    const Blas target(gpu, {Geometry{.vertices = triangleRow(1)}});
    const Buffer memory = serializedMemory(gpu);
    auto save = vkInit<VkCopyAccelerationStructureToMemoryInfoKHR>(
        {.src = blas.handle(), .mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_SERIALIZE_KHR});
    save.dst.deviceAddress = addressIn(memory, {});
    gpu.submit([&](VkCommandBuffer commands) { gpu.vk().CmdCopyAccelerationStructureToMemoryKHR(commands, &save); });
    auto load = vkInit<VkCopyMemoryToAccelerationStructureInfoKHR>(
        {.dst = target.handle(), .mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_DESERIALIZE_KHR});
    load.src.deviceAddress = addressIn(memory, {.offset = wrong ? 64u : 0u});
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) {
        gpu.vk().CmdCopyMemoryToAccelerationStructureKHR(commands, &load);
    });
}

// `reads`: the command reads from the object without memory; the right one from a micromap that was built.
template <auto record, bool reads>
void unbound(Gpu &gpu, bool wrong)
{
    const Twins twins(gpu);
    const PerhapsUnbound other(gpu, wrong);
    const Buffer memory = serializedMemory(gpu);
    recordUnlessWrong(gpu, true, [&](VkCommandBuffer commands) {
        record(gpu, commands, twins, reads && !wrong ? twins.built : other.object, addressIn(memory, {}));
    });
}

void build(Gpu &gpu, VkCommandBuffer commands, const Twins &twins, MicromapHandle other, VkDeviceAddress)
{
    recordMicromapBuilds(gpu, commands, std::array{MicromapBuild{twins.source.buildInfo(), other}});
}
void copyFrom(Gpu &gpu, VkCommandBuffer commands, const Twins &twins, MicromapHandle other, VkDeviceAddress)
{
    recordMicromapCopy(gpu, commands, other, twins.source.handle(), kClone);
}
void copyTo(Gpu &gpu, VkCommandBuffer commands, const Twins &twins, MicromapHandle other, VkDeviceAddress)
{
    recordMicromapCopy(gpu, commands, twins.built, other, kClone);
}
void save(Gpu &gpu, VkCommandBuffer commands, const Twins &, MicromapHandle other, VkDeviceAddress address)
{
    recordMicromapToMemory(gpu, commands, other, address);
}
void load(Gpu &gpu, VkCommandBuffer commands, const Twins &, MicromapHandle other, VkDeviceAddress address)
{
    recordMemoryToMicromap(gpu, commands, address, other);
}

const WrongProgram kPrograms[] = {
    {"VUID-VkCopyMicromapInfoEXT-mode-07531", Api::Ext, kNeedsNothing, mode},
    {"VUID-vkCmdCopyMicromapEXT-src-07532", Api::Ext, kNeedsNothing, notBuilt},
    {"VUID-VkCopyMicromapInfoEXT-mode-07533", Api::Ext, kNeedsNothing, compaction},
    {"VUID-vkCmdCopyMicromapToMemoryEXT-pInfo-07536", Api::Ext, kNeedsNothing, serialize<Serialized{.null = true}>},
    {"VUID-vkCmdCopyMicromapToMemoryEXT-pInfo-07537", Api::Ext, kNeedsNothing, serialize<Serialized{.offset = 128}>},
    {"VUID-VkCopyMicromapToMemoryInfoEXT-mode-07542", Api::Ext, kNeedsNothing,
     serialize<Serialized{.otherMode = true}>},
    {"VUID-VkCopyMicromapToMemoryInfoEXT-src-07540", Api::Ext, kNeedsNothing, serializeNotBuilt},
    {"VUID-vkCmdCopyMemoryToMicromapEXT-pInfo-07543", Api::Ext, kNeedsNothing, deserialize<Serialized{.null = true}>},
    {"VUID-vkCmdCopyMemoryToMicromapEXT-pInfo-07544", Api::Ext, kNeedsNothing, deserialize<Serialized{.offset = 128}>},
    {"VUID-VkCopyMemoryToMicromapInfoEXT-mode-07548", Api::Ext, kNeedsNothing,
     deserialize<Serialized{.otherMode = true}>},
    {"VUID-vkCmdBuildMicromapsEXT-pInfos-07508", Api::Ext, kNeedsNothing, unbound<build, false>},
    {"VUID-vkCmdCopyMicromapEXT-buffer-07529", Api::Ext, kNeedsNothing, unbound<copyFrom, true>},
    {"VUID-vkCmdCopyMicromapEXT-buffer-07530", Api::Ext, kNeedsNothing, unbound<copyTo, false>},
    {"VUID-vkCmdCopyMicromapToMemoryEXT-buffer-07539", Api::Ext, kNeedsNothing, unbound<save, true>},
    {"VUID-vkCmdCopyMemoryToMicromapEXT-buffer-07546", Api::Ext, kNeedsNothing, unbound<load, false>},

    {"VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03707", Api::Khr, kNeedsNothing, unbound<build, false>},
    {"VUID-VkCopyAccelerationStructureInfoKHR-buffer-03718", Api::Khr, kNeedsNothing, unbound<copyFrom, true>, "", "",
     false, nullptr, "VELLUM-VUID-VkCopyAccelerationStructureInfoKHR-mode-12418"},
    {"VUID-VkCopyAccelerationStructureInfoKHR-buffer-03719", Api::Khr, kNeedsNothing, unbound<copyTo, false>},
    {"VUID-VkCopyAccelerationStructureToMemoryInfoKHR-mode-11714", Api::Khr, kNeedsNothing, unbound<save, true>, "", "",
     true},
    {"VUID-VkCopyMemoryToAccelerationStructureInfoKHR-dst-11717", Api::Khr, kNeedsNothing, unbound<load, false>},
    {"VUID-VkCopyAccelerationStructureInfoKHR-mode-03410", Api::Khr, kNeedsNothing, mode},
    {"VUID-vkCmdCopyAccelerationStructureKHR-src-11633", Api::Khr, kNeedsNothing, notBuilt},
    {"VUID-VkCopyAccelerationStructureInfoKHR-src-03411", Api::Khr, kNeedsNothing, compaction},
    {"VUID-VkCopyAccelerationStructureInfoKHR-dst-07791", Api::Khr, kNeedsNothing, overlap},
    {"VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-03739", Api::Khr, kNeedsNothing,
     serialize<Serialized{.null = true}>},
    {"VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-11699", Api::Khr, kNeedsNothing,
     serialize<Serialized{.offset = 64}>, "", "", true},
    {"VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-03740", Api::Ext, kNeedsNothing, serializeStructure},
    {"VUID-vkCmdCopyMemoryToAccelerationStructureKHR-pInfo-03743", Api::Ext, kNeedsNothing, deserializeStructure},
    {"VUID-VkCopyAccelerationStructureToMemoryInfoKHR-mode-03412", Api::Khr, kNeedsNothing,
     serialize<Serialized{.otherMode = true}>},
    {"VUID-VkCopyAccelerationStructureToMemoryInfoKHR-src-04959", Api::Khr, kNeedsNothing, serializeNotBuilt},
    {"VUID-vkCmdCopyMemoryToAccelerationStructureKHR-pInfo-03742", Api::Khr, kNeedsNothing,
     deserialize<Serialized{.null = true}>},
    {"VUID-VkCopyMemoryToAccelerationStructureInfoKHR-mode-03413", Api::Khr, kNeedsNothing,
     deserialize<Serialized{.otherMode = true}>},
    {"VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-11700", Api::Khr, kNeedsNothing,
     deserialize<Serialized{.offset = 64}>, "", "", true},
};

} // namespace

std::span<const WrongProgram> copyPrograms()
{
    return kPrograms;
}

} // namespace vt
