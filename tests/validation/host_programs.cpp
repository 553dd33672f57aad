// SPDX-License-Identifier: Apache-2.0
// Wrong host commands of VK_EXT_opacity_micromap.
#include "recorded.h"

namespace vt
{
namespace
{

constexpr VkBuildMicromapFlagsEXT kAllow = VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT;
constexpr VkQueryType kCompacted = VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT;
constexpr VkQueryType kSerialized = VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT;

template <auto change>
void build(Gpu &gpu, bool wrong)
{
    const Micromap micromap(gpu, oneTriangle());
    VkMicromapBuildInfoEXT info = micromap.hostBuildInfo();
    if (wrong)
        change(info);
    gpu.vk().BuildMicromapsEXT(gpu.device(), VK_NULL_HANDLE, 1, &info);
}

// The second triangle is outside the application's memory, which validation must not read.
void buildWithHugeStride(Gpu &gpu, bool wrong)
{
    MicromapInput input = oneTriangle();
    input.add(2, kFourState, std::vector<uint8_t>(16, 1));
    const Micromap micromap(gpu, std::move(input));
    VkMicromapBuildInfoEXT info = micromap.hostBuildInfo();
    if (wrong)
        info.triangleArrayStride = VkDeviceSize{1} << 40;
    gpu.vk().BuildMicromapsEXT(gpu.device(), VK_NULL_HANDLE, 1, &info);
}

void buildTooSmall(Gpu &gpu, bool wrong)
{
    const Micromap micromap(gpu, oneTriangle());
    SharedMemory memory(gpu);
    VkMicromapBuildInfoEXT info = micromap.hostBuildInfo();
    info.dstMicromap = memory.create(0, wrong ? 16 : micromap.size()).ext;
    gpu.vk().BuildMicromapsEXT(gpu.device(), VK_NULL_HANDLE, 1, &info);
}

void buildOverlap(Gpu &gpu, bool wrong)
{
    const Micromap micromap(gpu, oneTriangle());
    SharedMemory memory(gpu);
    VkMicromapBuildInfoEXT infos[] = {micromap.hostBuildInfo(), micromap.hostBuildInfo()};
    infos[0].dstMicromap = memory.create(0, micromap.size()).ext;
    infos[1].dstMicromap = memory.create(wrong ? 0 : 4096, micromap.size()).ext;
    gpu.vk().BuildMicromapsEXT(gpu.device(), VK_NULL_HANDLE, 2, infos);
}

// Two micromaps built on the host, and another handle to the memory of the first.
struct HostMicromaps {
    explicit HostMicromaps(Gpu &gpu, VkBuildMicromapFlagsEXT flags = 0)
        : input(gpu, oneTriangle(), flags), memory(gpu), built(memory.create(0, input.size())),
          neverBuilt(memory.create(0, input.size())), target(memory.create(4096, input.size()))
    {
        for (const MicromapHandle &handle : {built, target}) {
            VkMicromapBuildInfoEXT info = input.hostBuildInfo();
            info.dstMicromap = handle.ext;
            VT_CHECK(gpu.vk().BuildMicromapsEXT(gpu.device(), VK_NULL_HANDLE, 1, &info));
        }
    }
    Micromap input;
    SharedMemory memory;
    MicromapHandle built, neverBuilt, target;
};

template <auto change, VkBuildMicromapFlagsEXT flags = 0>
void copy(Gpu &gpu, bool wrong)
{
    const HostMicromaps micromaps(gpu, flags);
    auto info = vkInit<VkCopyMicromapInfoEXT>(
        {.src = micromaps.built.ext, .dst = micromaps.target.ext, .mode = VK_COPY_MICROMAP_MODE_CLONE_EXT});
    if (wrong)
        change(info, micromaps);
    gpu.vk().CopyMicromapEXT(gpu.device(), VK_NULL_HANDLE, &info);
}

void compaction(Gpu &gpu, bool wrong)
{
    const HostMicromaps micromaps(gpu, wrong ? 0 : kAllow);
    const auto info = vkInit<VkCopyMicromapInfoEXT>(
        {.src = micromaps.built.ext, .dst = micromaps.target.ext, .mode = VK_COPY_MICROMAP_MODE_COMPACT_EXT});
    gpu.vk().CopyMicromapEXT(gpu.device(), VK_NULL_HANDLE, &info);
}

struct alignas(64) Bytes {
    std::array<uint8_t, 4096> bytes{};
};

template <auto change>
void serialize(Gpu &gpu, bool wrong)
{
    const HostMicromaps micromaps(gpu);
    const auto memory = std::make_unique<Bytes>();
    auto info = vkInit<VkCopyMicromapToMemoryInfoEXT>(
        {.src = micromaps.built.ext, .mode = VK_COPY_MICROMAP_MODE_SERIALIZE_EXT});
    info.dst.hostAddress = memory->bytes.data();
    if (wrong)
        change(info, micromaps);
    gpu.vk().CopyMicromapToMemoryEXT(gpu.device(), VK_NULL_HANDLE, &info);
}

template <auto change>
void deserialize(Gpu &gpu, bool wrong)
{
    const HostMicromaps micromaps(gpu);
    const auto memory = std::make_unique<Bytes>();
    auto out = vkInit<VkCopyMicromapToMemoryInfoEXT>(
        {.src = micromaps.built.ext, .mode = VK_COPY_MICROMAP_MODE_SERIALIZE_EXT});
    out.dst.hostAddress = memory->bytes.data();
    gpu.vk().CopyMicromapToMemoryEXT(gpu.device(), VK_NULL_HANDLE, &out);
    auto info = vkInit<VkCopyMemoryToMicromapInfoEXT>(
        {.dst = micromaps.target.ext, .mode = VK_COPY_MICROMAP_MODE_DESERIALIZE_EXT});
    info.src.hostAddress = memory->bytes.data();
    if (wrong)
        change(info, memory->bytes);
    gpu.vk().CopyMemoryToMicromapEXT(gpu.device(), VK_NULL_HANDLE, &info);
}

// The arguments of vkWriteMicromapsPropertiesEXT for one micromap.
struct Properties {
    VkQueryType type = kSerialized;
    size_t size = 8;
    size_t stride = 8;
    size_t offset = 0;
    bool neverBuilt = false;
    bool allowsCompaction = true;
};

template <Properties change, Properties right = Properties{}>
void write(Gpu &gpu, bool wrong)
{
    const Properties used = wrong ? change : right;
    const HostMicromaps micromaps(gpu, used.allowsCompaction ? kAllow : 0);
    const VkMicromapEXT micromap = (used.neverBuilt ? micromaps.neverBuilt : micromaps.built).ext;
    std::array<uint64_t, 4> results{};
    gpu.vk().WriteMicromapsPropertiesEXT(gpu.device(), 1, &micromap, used.type, used.size,
                                         reinterpret_cast<uint8_t *>(results.data()) + used.offset, used.stride);
}

// The first of the two micromaps has no memory.
template <auto command>
void unbound(Gpu &gpu, bool wrong)
{
    const HostMicromaps micromaps(gpu);
    const PerhapsUnbound object(gpu, wrong);
    const auto memory = std::make_unique<Bytes>();
    VkMicromapBuildInfoEXT info = micromaps.input.hostBuildInfo();
    info.dstMicromap = object.object.ext;
    if (!wrong)
        VT_CHECK(gpu.vk().BuildMicromapsEXT(gpu.device(), VK_NULL_HANDLE, 1, &info));
    command(gpu, object.object.ext, micromaps, memory->bytes.data());
}

void buildUnbound(Gpu &gpu, VkMicromapEXT object, const HostMicromaps &micromaps, void *)
{
    VkMicromapBuildInfoEXT info = micromaps.input.hostBuildInfo();
    info.dstMicromap = object;
    gpu.vk().BuildMicromapsEXT(gpu.device(), VK_NULL_HANDLE, 1, &info);
}
void buildFreed(Gpu &gpu, bool wrong)
{
    const HostMicromaps micromaps(gpu);
    Storage storage(gpu);
    const MicromapHandle micromap = createMicromap(gpu, storage.buffer(), storage.address(), 0, micromaps.input.size());
    if (wrong) {
        storage.destroyBuffer();
        storage.freeMemory();
    }
    buildUnbound(gpu, micromap.ext, micromaps, nullptr);
    destroyMicromap(gpu, micromap);
}
void copyToUnbound(Gpu &gpu, VkMicromapEXT object, const HostMicromaps &micromaps, void *)
{
    const auto info = vkInit<VkCopyMicromapInfoEXT>(
        {.src = micromaps.built.ext, .dst = object, .mode = VK_COPY_MICROMAP_MODE_CLONE_EXT});
    gpu.vk().CopyMicromapEXT(gpu.device(), VK_NULL_HANDLE, &info);
}
void copyFromUnbound(Gpu &gpu, VkMicromapEXT object, const HostMicromaps &micromaps, void *)
{
    const auto info = vkInit<VkCopyMicromapInfoEXT>(
        {.src = object, .dst = micromaps.target.ext, .mode = VK_COPY_MICROMAP_MODE_CLONE_EXT});
    gpu.vk().CopyMicromapEXT(gpu.device(), VK_NULL_HANDLE, &info);
}
void saveUnbound(Gpu &gpu, VkMicromapEXT object, const HostMicromaps &, void *memory)
{
    auto info = vkInit<VkCopyMicromapToMemoryInfoEXT>({.src = object, .mode = VK_COPY_MICROMAP_MODE_SERIALIZE_EXT});
    info.dst.hostAddress = memory;
    gpu.vk().CopyMicromapToMemoryEXT(gpu.device(), VK_NULL_HANDLE, &info);
}
void writeUnbound(Gpu &gpu, VkMicromapEXT object, const HostMicromaps &, void *memory)
{
    gpu.vk().WriteMicromapsPropertiesEXT(gpu.device(), 1, &object, kSerialized, 8, memory, 8);
}
void loadUnbound(Gpu &gpu, VkMicromapEXT object, const HostMicromaps &micromaps, void *memory)
{
    auto out = vkInit<VkCopyMicromapToMemoryInfoEXT>(
        {.src = micromaps.built.ext, .mode = VK_COPY_MICROMAP_MODE_SERIALIZE_EXT});
    out.dst.hostAddress = memory;
    gpu.vk().CopyMicromapToMemoryEXT(gpu.device(), VK_NULL_HANDLE, &out);
    auto info = vkInit<VkCopyMemoryToMicromapInfoEXT>({.dst = object, .mode = VK_COPY_MICROMAP_MODE_DESERIALIZE_EXT});
    info.src.hostAddress = memory;
    gpu.vk().CopyMemoryToMicromapEXT(gpu.device(), VK_NULL_HANDLE, &info);
}

// Without the feature there is no valid program.
void buildWithoutFeature(Gpu &gpu, bool wrong)
{
    if (wrong)
        gpu.vk().BuildMicromapsEXT(gpu.device(), VK_NULL_HANDLE, 0, nullptr);
}

template <auto command>
void withoutFeature(Gpu &gpu, bool wrong)
{
    Micromap source(gpu, oneTriangle());
    source.build();
    const Micromap target(gpu, source, source.size());
    const auto memory = std::make_unique<Bytes>();
    if (wrong)
        command(gpu, source.handle().ext, target.handle().ext, memory->bytes.data());
}

constexpr Properties kOtherType{.type = VK_QUERY_TYPE_OCCLUSION};
constexpr Properties kTooSmall{.size = 4};
constexpr Properties kOddStride{.size = 32, .stride = 12};
constexpr Properties kOddPointer{.offset = 4};
constexpr Properties kNeverBuilt{.neverBuilt = true};
constexpr Properties kNotAllowed{.type = kCompacted, .allowsCompaction = false};
constexpr Properties kCompactedSize{.type = kCompacted};

const WrongProgram kPrograms[] = {
    {"micromap-stride", Api::Ext, kNeedsHostCommands | kNeedsEmulation, buildWithHugeStride, "Host"},
    {"VUID-vkBuildMicromapsEXT-pInfos-07461", Api::Ext, kNeedsHostCommands, buildTooSmall},
    {"VUID-vkBuildMicromapsEXT-mode-07462", Api::Ext, kNeedsHostCommands,
     build<[](VkMicromapBuildInfoEXT &info) { info.mode = static_cast<VkBuildMicromapModeEXT>(3); }>},
    {"VUID-vkBuildMicromapsEXT-dstMicromap-07463", Api::Ext, kNeedsHostCommands,
     build<[](VkMicromapBuildInfoEXT &info) { info.dstMicromap = VK_NULL_HANDLE; }>},
    {"VUID-vkBuildMicromapsEXT-pInfos-07553", Api::Ext, kNeedsHostCommands,
     build<[](VkMicromapBuildInfoEXT &info) { info.data.hostAddress = nullptr; }>},
    {"VUID-vkBuildMicromapsEXT-pInfos-07554", Api::Ext, kNeedsHostCommands,
     build<[](VkMicromapBuildInfoEXT &info) { info.triangleArray.hostAddress = nullptr; }>},
    {"VUID-vkBuildMicromapsEXT-pInfos-07552", Api::Ext, kNeedsHostCommands, unbound<buildUnbound>},
    {"VUID-vkBuildMicromapsEXT-pInfos-07552", Api::Ext, kNeedsHostCommands, buildFreed, "Freed"},
    {"VUID-vkCopyMicromapEXT-buffer-07558", Api::Ext, kNeedsHostCommands, unbound<copyFromUnbound>, "",
     "VUID-vkCopyMicromapEXT-src-11670"},
    {"VUID-vkCopyMicromapToMemoryEXT-buffer-07568", Api::Ext, kNeedsHostCommands, unbound<saveUnbound>, "",
     "VUID-VkCopyMicromapToMemoryInfoEXT-src-07540"},
    {"VUID-vkWriteMicromapsPropertiesEXT-buffer-07577", Api::Ext, kNeedsHostCommands, unbound<writeUnbound>, "",
     "VUID-vkWriteMicromapsPropertiesEXT-pMicromaps-11671"},
    {"VUID-vkCopyMicromapEXT-buffer-07559", Api::Ext, kNeedsHostCommands, unbound<copyToUnbound>},
    {"VUID-vkCopyMemoryToMicromapEXT-buffer-07565", Api::Ext, kNeedsHostCommands, unbound<loadUnbound>},
    {"VUID-vkBuildMicromapsEXT-dstMicromap-11667", Api::Ext, kNeedsHostCommands, buildOverlap},
    {"VUID-VkCopyMicromapInfoEXT-mode-07531", Api::Ext, kNeedsHostCommands,
     copy<[](VkCopyMicromapInfoEXT &info, const HostMicromaps &) { info.mode = VK_COPY_MICROMAP_MODE_SERIALIZE_EXT; }>,
     "Host"},
    {"VUID-VkCopyMicromapInfoEXT-mode-07533", Api::Ext, kNeedsHostCommands, compaction, "Host"},
    {"VUID-vkCopyMicromapEXT-src-11670", Api::Ext, kNeedsHostCommands,
     copy<[](VkCopyMicromapInfoEXT &info, const HostMicromaps &all) { info.src = all.neverBuilt.ext; }>},
    {"VUID-vkCopyMicromapToMemoryEXT-pInfo-07569", Api::Ext, kNeedsHostCommands,
     serialize<[](VkCopyMicromapToMemoryInfoEXT &info, const HostMicromaps &) { info.dst.hostAddress = nullptr; }>},
    {"VUID-vkCopyMicromapToMemoryEXT-pInfo-07570", Api::Ext, kNeedsHostCommands,
     serialize<[](VkCopyMicromapToMemoryInfoEXT &info, const HostMicromaps &) {
         info.dst.hostAddress = static_cast<uint8_t *>(info.dst.hostAddress) + 8;
     }>},
    {"VUID-VkCopyMicromapToMemoryInfoEXT-mode-07542", Api::Ext, kNeedsHostCommands,
     serialize<[](VkCopyMicromapToMemoryInfoEXT &info, const HostMicromaps &) {
         info.mode = VK_COPY_MICROMAP_MODE_CLONE_EXT;
     }>,
     "Host"},
    {"VUID-VkCopyMicromapToMemoryInfoEXT-src-07540", Api::Ext, kNeedsHostCommands,
     serialize<[](VkCopyMicromapToMemoryInfoEXT &info, const HostMicromaps &all) { info.src = all.neverBuilt.ext; }>,
     "Host"},
    {"VUID-vkCopyMemoryToMicromapEXT-pInfo-07563", Api::Ext, kNeedsHostCommands,
     deserialize<[](VkCopyMemoryToMicromapInfoEXT &info, auto &) { info.src.hostAddress = nullptr; }>},
    {"VUID-vkCopyMemoryToMicromapEXT-pInfo-07564", Api::Ext, kNeedsHostCommands,
     deserialize<[](VkCopyMemoryToMicromapInfoEXT &info, auto &bytes) {
         std::memmove(bytes.data() + 8, bytes.data(), bytes.size() - 8);
         info.src.hostAddress = bytes.data() + 8;
     }>},
    {"VUID-VkCopyMemoryToMicromapInfoEXT-mode-07548", Api::Ext, kNeedsHostCommands,
     deserialize<[](VkCopyMemoryToMicromapInfoEXT &info, auto &) { info.mode = VK_COPY_MICROMAP_MODE_CLONE_EXT; }>,
     "Host"},
    {"VUID-vkWriteMicromapsPropertiesEXT-queryType-07503", Api::Ext, kNeedsHostCommands, write<kOtherType>},
    {"VUID-vkWriteMicromapsPropertiesEXT-dataSize-07576", Api::Ext, kNeedsHostCommands, write<kTooSmall>},
    {"VUID-vkWriteMicromapsPropertiesEXT-queryType-10071", Api::Ext, kNeedsHostCommands, write<kOddStride>},
    {"VUID-vkWriteMicromapsPropertiesEXT-queryType-10072", Api::Ext, kNeedsHostCommands, write<kOddPointer>},
    {"VUID-vkWriteMicromapsPropertiesEXT-pMicromaps-11671", Api::Ext, kNeedsHostCommands, write<kNeverBuilt>},
    {"VUID-vkWriteMicromapsPropertiesEXT-pMicromaps-07502", Api::Ext, kNeedsHostCommands,
     write<kNotAllowed, kCompactedSize>},

    {"VUID-vkBuildMicromapsEXT-micromapHostCommands-07555", Api::Ext, kNeedsNothing, buildWithoutFeature, "",
     "VUID-vkBuildMicromapsEXT-infoCount-arraylength"},
    {"VUID-vkCopyMicromapEXT-micromapHostCommands-07560", Api::Ext, kNeedsNothing,
     withoutFeature<[](Gpu &gpu, VkMicromapEXT from, VkMicromapEXT to, void *) {
         const auto info =
             vkInit<VkCopyMicromapInfoEXT>({.src = from, .dst = to, .mode = VK_COPY_MICROMAP_MODE_CLONE_EXT});
         gpu.vk().CopyMicromapEXT(gpu.device(), VK_NULL_HANDLE, &info);
     }>},
    {"VUID-vkCopyMicromapToMemoryEXT-micromapHostCommands-07571", Api::Ext, kNeedsNothing,
     withoutFeature<[](Gpu &gpu, VkMicromapEXT from, VkMicromapEXT, void *memory) {
         auto info = vkInit<VkCopyMicromapToMemoryInfoEXT>({.src = from, .mode = VK_COPY_MICROMAP_MODE_SERIALIZE_EXT});
         info.dst.hostAddress = memory;
         gpu.vk().CopyMicromapToMemoryEXT(gpu.device(), VK_NULL_HANDLE, &info);
     }>},
    {"VUID-vkCopyMemoryToMicromapEXT-micromapHostCommands-07566", Api::Ext, kNeedsNothing,
     withoutFeature<[](Gpu &gpu, VkMicromapEXT, VkMicromapEXT to, void *memory) {
         auto info = vkInit<VkCopyMemoryToMicromapInfoEXT>({.dst = to, .mode = VK_COPY_MICROMAP_MODE_DESERIALIZE_EXT});
         info.src.hostAddress = memory;
         gpu.vk().CopyMemoryToMicromapEXT(gpu.device(), VK_NULL_HANDLE, &info);
     }>,
     "", "VUID-VkCopyMemoryToMicromapInfoEXT-src-07549"},
    {"VUID-vkWriteMicromapsPropertiesEXT-micromapHostCommands-07578", Api::Ext, kNeedsNothing,
     withoutFeature<[](Gpu &gpu, VkMicromapEXT from, VkMicromapEXT, void *memory) {
         gpu.vk().WriteMicromapsPropertiesEXT(gpu.device(), 1, &from, kSerialized, 8, memory, 8);
     }>},
};

} // namespace

std::span<const WrongProgram> hostPrograms()
{
    return kPrograms;
}

} // namespace vt
