// SPDX-License-Identifier: Apache-2.0
// Wrong serialized data, memory and objects that are too small for copies, and deserialized structures without their
// micromaps.
#include "gpu/copies.h"
#include "recorded.h"

namespace vt
{
namespace
{

constexpr auto kBottomLevel = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR;

// Findings of the device are reported once, and not again with the next commands.
void finish(Gpu &gpu)
{
    VT_CHECK(vkDeviceWaitIdle(gpu.device()));
    gpu.submit([](VkCommandBuffer) {});
}

void add32(Serialized &data, size_t byte, uint32_t added)
{
    uint32_t value = 0;
    std::memcpy(&value, data.bytes().data() + byte, sizeof value);
    value += added;
    std::memcpy(data.bytes().data() + byte, &value, sizeof value);
}

// --- structures ---

// A geometry of two triangles, with or without a micromap.
struct BottomLevel {
    explicit BottomLevel(Gpu &gpu, bool attaches = true, VkBuildAccelerationStructureFlagsKHR flags = 0) : blas(gpu)
    {
        Geometry geometry{.vertices = triangleRow(attaches ? 1 : 16)};
        if (attaches) {
            micromap = std::make_unique<Micromap>(gpu, oneTriangle());
            micromap->build();
            geometry.micromap = Attachment{.micromap = micromap.get()};
        }
        blas.build({geometry}, flags);
    }
    std::unique_ptr<Micromap> micromap;
    Blas blas;
};

// Deserializes a structure once `change` has changed the data, or the target.
template <auto change, bool attaches = false>
void structureFrom(Gpu &gpu, bool wrong)
{
    const BottomLevel source(gpu, attaches);
    Serialized data = serialize(gpu, source.blas);
    VkDeviceSize size = data.deserializedSize();
    if (wrong)
        change(data, size);
    Structure target(gpu, kBottomLevel);
    target.create(size);
    deserialize(gpu, data, target);
    finish(gpu);
}

// A block with no addresses in front of the others.
void addBlock(Serialized &data, uint32_t type)
{
    constexpr size_t kFirstBlock = 56;
    const std::array<uint32_t, 4> block{type, 0, 0, 0};
    const auto *bytes = reinterpret_cast<const uint8_t *>(block.data());
    data.bytes().insert(data.bytes().begin() + kFirstBlock, bytes, bytes + sizeof block);
    add32(data, 48, 1);
    std::memset(data.bytes().data() + 52, 0xff, 4); // blocks, and not handles
    add32(data, 32, sizeof block);
}

// The buffer ends before the data does.
void serializeStructure(Gpu &gpu, bool wrong)
{
    const BottomLevel source(gpu, false);
    const Buffer memory(gpu, 1 << 18, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    const VkDeviceAddress begin = (memory.address() + 255) / 256 * 256;
    const VkDeviceAddress end = (memory.address() + memory.size()) / 256 * 256;
    gpu.submit(
        [&](VkCommandBuffer commands) { recordSerialize(gpu, commands, source.blas, wrong ? end - 256 : begin); });
    finish(gpu);
}

void compactStructure(Gpu &gpu, bool wrong)
{
    const BottomLevel source(gpu, true, VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR);
    const VkDeviceSize size = queried(gpu, source.blas, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR);
    Structure target(gpu, kBottomLevel);
    target.create(wrong ? size - 64 : size);
    copy(gpu, source.blas, target, VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR);
    finish(gpu);
}

// --- micromaps ---

struct SerializedMicromap {
    explicit SerializedMicromap(Gpu &gpu, MicromapInput input = oneTriangle())
        : source(gpu, std::move(input)),
          memory(gpu, 65536, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT),
          begin((memory.address() + 255) / 256 * 256)
    {
        source.build();
        gpu.submit([&](VkCommandBuffer commands) { recordMicromapToMemory(gpu, commands, source.handle(), begin); });
        VT_CHECK(vkDeviceWaitIdle(gpu.device()));
    }
    [[nodiscard]] uint8_t *bytes() const { return memory.bytes() + (begin - memory.address()); }
    // The size that the header states for the target.
    [[nodiscard]] VkDeviceSize size() const
    {
        VkDeviceSize size = 0;
        std::memcpy(&size, bytes() + 40, sizeof size);
        return size;
    }
    // The address before the end of the buffer.
    [[nodiscard]] VkDeviceAddress last() const { return (memory.address() + memory.size()) / 256 * 256 - 256; }
    Micromap source;
    Buffer memory;
    VkDeviceAddress begin;
};

template <size_t byte, uint8_t change, bool small = false>
void micromapFrom(Gpu &gpu, bool wrong)
{
    const SerializedMicromap data(gpu);
    if (wrong)
        data.bytes()[byte] ^= change;
    SharedMemory memory(gpu);
    const MicromapHandle target = memory.create(0, wrong && small ? data.size() - 16 : data.source.size());
    gpu.submit([&](VkCommandBuffer commands) { recordMemoryToMicromap(gpu, commands, data.begin, target); });
    finish(gpu);
}

template <size_t byte, uint8_t change, bool small = false>
void micromapFromHost(Gpu &gpu, bool wrong)
{
    const SerializedMicromap data(gpu);
    alignas(64) std::array<uint8_t, 4096> bytes{};
    std::memcpy(bytes.data(), data.bytes(), bytes.size());
    if (wrong)
        bytes[byte] ^= change;
    SharedMemory memory(gpu);
    auto info = vkInit<VkCopyMemoryToMicromapInfoEXT>(
        {.dst = memory.create(0, wrong && small ? data.size() - 16 : data.source.size()).ext,
         .mode = VK_COPY_MICROMAP_MODE_DESERIALIZE_EXT});
    info.src.hostAddress = bytes.data();
    gpu.vk().CopyMemoryToMicromapEXT(gpu.device(), VK_NULL_HANDLE, &info);
    finish(gpu);
}

void serializeMicromap(Gpu &gpu, bool wrong)
{
    MicromapInput input;
    input.add(5, kFourState, std::vector<uint8_t>(1024, 1));
    const SerializedMicromap data(gpu, std::move(input));
    gpu.submit([&](VkCommandBuffer commands) {
        recordMicromapToMemory(gpu, commands, data.source.handle(), wrong ? data.last() : data.begin);
    });
    finish(gpu);
}

void compactMicromap(Gpu &gpu, bool wrong)
{
    Micromap source(gpu, oneTriangle(), VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT);
    source.build();
    SharedMemory memory(gpu);
    const MicromapHandle target = memory.create(0, wrong ? 64 : source.size());
    gpu.submit([&](VkCommandBuffer commands) {
        recordMicromapCopy(gpu, commands, source.handle(), target, VK_COPY_MICROMAP_MODE_COMPACT_EXT);
    });
    finish(gpu);
}

// --- the micromaps of deserialized structures ---

// A structure that was deserialized with another micromap.
class Deserialized
{
public:
    // What happens to the micromap after the structure was deserialized, or before.
    enum class Then { Deserialize, Build, BuildBefore, Nothing };

    Deserialized(Gpu &gpu, Then then)
        : gpu_(gpu), source_(gpu), micromap_(gpu), memory_(gpu), target_(gpu, kBottomLevel)
    {
        const MicromapHandle other = memory_.create(0, micromap_.source.size());
        Serialized data = serialize(gpu, source_.blas);
        data.setHandle(2, memory_.address());
        target_.create(data.deserializedSize());
        const auto build = [&](VkCommandBuffer commands) {
            recordMicromapBuilds(gpu, commands, std::array{MicromapBuild{micromap_.source.buildInfo(), other}});
        };
        if (then == Then::BuildBefore)
            gpu.submit(build);
        deserialize(gpu, data, target_);
        gpu.submit([&](VkCommandBuffer commands) {
            if (then == Then::Deserialize)
                recordMemoryToMicromap(gpu, commands, micromap_.begin, other);
            else if (then == Then::Build)
                build(commands);
        });
    }
    [[nodiscard]] const Structure &structure() const { return target_; }

private:
    Gpu &gpu_;
    BottomLevel source_;
    SerializedMicromap micromap_;
    SharedMemory memory_;
    Structure target_;
};
using Then = Deserialized::Then;

template <Then then>
void copyDeserialized(Gpu &gpu, bool wrong)
{
    const Deserialized source(gpu, wrong ? then : Then::Deserialize);
    Structure target(gpu, kBottomLevel);
    target.create(source.structure().size());
    copy(gpu, source.structure(), target);
    finish(gpu);
}

template <Then then>
void serializeDeserialized(Gpu &gpu, bool wrong)
{
    const Deserialized source(gpu, wrong ? then : Then::Deserialize);
    serialize(gpu, source.structure());
    finish(gpu);
}

void copyDeserializedOnHost(Gpu &gpu, bool wrong)
{
    const Deserialized source(gpu, wrong ? Then::Build : Then::Deserialize);
    Structure target(gpu, kBottomLevel);
    target.create(source.structure().size());
    const auto info =
        vkInit<VkCopyAccelerationStructureInfoKHR>({.src = source.structure().handle(),
                                                    .dst = target.handle(),
                                                    .mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR});
    const auto copy = reinterpret_cast<PFN_vkCopyAccelerationStructureKHR>(
        vkGetDeviceProcAddr(gpu.device(), "vkCopyAccelerationStructureKHR"));
    copy(gpu.device(), VK_NULL_HANDLE, &info);
    finish(gpu);
}

template <Then then>
void traceDeserialized(Gpu &gpu, bool wrong)
{
    const Deserialized source(gpu, wrong ? then : Then::Deserialize);
    const Tlas tlas(gpu, {instance(source.structure(), {}, 0)});
    Tracer(gpu).trace(tlas, std::vector{Ray{.origin = {0.3f, 0.3f, 1}}});
    finish(gpu);
}

using Size = VkDeviceSize;
// If structures are translated, those with micromaps are not serialized.
const WrongProgram kPrograms[] = {
    {"VUID-VkCopyMemoryToAccelerationStructureInfoKHR-pInfo-03414", Api::Khr, kNeedsNothing,
     structureFrom<[](Serialized &data, Size &) { data.bytes()[3] ^= 1; }>},
    {"VUID-VkCopyMemoryToAccelerationStructureInfoKHR-src-04960", Api::Khr, kNeedsNothing,
     structureFrom<[](Serialized &data, Size &) { data.bytes()[36] ^= 1; }>},
    {"VUID-VkCopyMemoryToAccelerationStructureInfoKHR-dst-03746", Api::Khr, kNeedsNothing,
     structureFrom<[](Serialized &, Size &size) { size -= 64; }>},
    {"VUID-VkCopyMemoryToAccelerationStructureInfoKHR-pInfo-03414", Api::Ext, kNeedsNothing,
     structureFrom<[](Serialized &data, Size &) { data.bytes()[3] ^= 1; }>, "Ext"},
    {"VUID-VkCopyMemoryToAccelerationStructureInfoKHR-dst-03746", Api::Ext, kNeedsNothing,
     structureFrom<[](Serialized &, Size &size) { size -= 64; }>, "Ext"},
    {"VUID-VkCopyMemoryToAccelerationStructureInfoKHR-src-11583", Api::Khr, kNeedsNothing,
     structureFrom<[](Serialized &data, Size &) { addBlock(data, 7); }>},
    {"VUID-VkCopyMemoryToAccelerationStructureInfoKHR-dst-11584", Api::Khr, kNeedsNoFeature,
     structureFrom<[](Serialized &data, Size &) { addBlock(data, 0); }>},
    {"VUID-VkCopyMemoryToAccelerationStructureInfoKHR-dst-11585", Api::Khr, kNeedsNothing,
     structureFrom<[](Serialized &data, Size &) { data.setHandle(2, 4096); }, true>, "", "", false, "ext"},
    {"VUID-VkCopyAccelerationStructureToMemoryInfoKHR-dst-03561", Api::Khr, kNeedsNothing, serializeStructure},
    {"VUID-VkCopyAccelerationStructureToMemoryInfoKHR-dst-03561", Api::Ext, kNeedsNothing, serializeStructure, "Ext"},
    {"VUID-VkCopyAccelerationStructureInfoKHR-mode-12419", Api::Khr, kNeedsNothing, compactStructure},

    {"VUID-VkCopyMemoryToAccelerationStructureInfoKHR-pInfo-03414", Api::Khr, kNeedsNothing, micromapFrom<3, 1>,
     "Micromap"},
    {"VUID-VkCopyMemoryToAccelerationStructureInfoKHR-src-04960", Api::Khr, kNeedsEmulation, micromapFrom<36, 1>,
     "Micromap"},
    {"VUID-VkCopyAccelerationStructureToMemoryInfoKHR-dst-03561", Api::Khr, kNeedsNothing, serializeMicromap,
     "Micromap"},
    {"VUID-VkCopyMemoryToMicromapInfoEXT-src-07549", Api::Ext, kNeedsNothing, micromapFrom<3, 1>},
    {"VUID-VkCopyMemoryToMicromapInfoEXT-src-07547", Api::Ext, kNeedsEmulation, micromapFrom<36, 1>},
    {"VUID-VkCopyMemoryToMicromapInfoEXT-dst-07550", Api::Ext, kNeedsEmulation, micromapFrom<3, 0, true>},
    {"VUID-VkCopyMemoryToMicromapInfoEXT-src-07549", Api::Ext, kNeedsHostCommands, micromapFromHost<3, 1>, "Host"},
    {"VUID-VkCopyMemoryToMicromapInfoEXT-dst-07550", Api::Ext, kNeedsHostCommands | kNeedsEmulation,
     micromapFromHost<3, 0, true>, "Host"},
    {"micromap-copy-size", Api::Ext, kNeedsNothing, compactMicromap},
    {"VUID-VkCopyMicromapToMemoryInfoEXT-dst-07541", Api::Ext, kNeedsNothing, serializeMicromap},

    {"VUID-vkCmdCopyAccelerationStructureKHR-src-11634", Api::Khr, kNeedsNothing, copyDeserialized<Then::Build>, "", "",
     false, "ext"},
    {"VUID-vkCmdCopyAccelerationStructureKHR-src-11634", Api::Khr, kNeedsNothing, copyDeserialized<Then::Nothing>,
     "Nothing", "", false, "ext"},
    {"VUID-vkCmdCopyAccelerationStructureKHR-src-11634", Api::Khr, kNeedsNothing, copyDeserialized<Then::BuildBefore>,
     "BuiltBefore", "", false, "ext"},
    {"VUID-VkCopyAccelerationStructureToMemoryInfoKHR-src-11582", Api::Khr, kNeedsNothing,
     serializeDeserialized<Then::Build>, "", "", false, "ext"},
    {"VUID-VkCopyAccelerationStructureToMemoryInfoKHR-src-11582", Api::Khr, kNeedsNothing,
     serializeDeserialized<Then::BuildBefore>, "BuiltBefore", "", false, "ext"},
    {"VUID-vkCopyAccelerationStructureKHR-src-11587", Api::Khr, kNeedsNothing, copyDeserializedOnHost, "", "", true,
     "ext"},
    {"VUID-vkCmdDispatch-micromap-11637", Api::Khr, kNeedsNothing, traceDeserialized<Then::Build>, "", "", false,
     "ext"},
    {"VUID-vkCmdDispatch-micromap-11637", Api::Khr, kNeedsNothing, traceDeserialized<Then::BuildBefore>, "BuiltBefore",
     "", false, "ext"},
};

} // namespace

std::span<const WrongProgram> serializedPrograms()
{
    return kPrograms;
}

} // namespace vt
