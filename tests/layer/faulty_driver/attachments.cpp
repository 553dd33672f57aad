// SPDX-License-Identifier: Apache-2.0
// Faults in how bottom-level structures use micromaps: VkAccelerationStructureTrianglesOpacityMicromapEXT and -KHR.
#include "faulty_driver/faults.h"

#include <algorithm>
#include <deque>
#include <map>
#include <memory>
#include <optional>

#include "layer/base/pnext.h"

namespace faults
{
namespace
{

using vellum::layer::Chain;
constexpr Level kLevel = Level::Attachments;

constexpr uint32_t kOpaque = 0xfffffffe;
constexpr uint32_t kUnknownTransparent = 0xfffffffd;
constexpr uint32_t kUnknownOpaque = 0xfffffffc;
constexpr uint32_t kFirstSpecial = 0xfffffffc;

// The micromap indices of a geometry.
struct Indices {
    VkIndexType type = VK_INDEX_TYPE_NONE_KHR;
    VkDeviceAddress address = 0;
    VkDeviceSize stride = 0;

    template <class T>
    [[nodiscard]] T read(uint32_t triangle) const
    {
        T value;
        std::memcpy(&value, hostPointer<const void>(address + triangle * stride), sizeof value);
        return value;
    }
    // The index as it is stored; without an index buffer, the triangle's number.
    [[nodiscard]] uint32_t raw(uint32_t triangle) const
    {
        switch (type) {
        case VK_INDEX_TYPE_UINT32: return read<uint32_t>(triangle);
        case VK_INDEX_TYPE_UINT16: return read<uint16_t>(triangle);
        case VK_INDEX_TYPE_UINT8_EXT: return read<uint8_t>(triangle);
        default: return triangle;
        }
    }
    // Special indices as 32-bit ones.
    [[nodiscard]] uint32_t value(uint32_t triangle) const
    {
        const uint32_t found = raw(triangle);
        const uint32_t most = type == VK_INDEX_TYPE_UINT16      ? 0xffff
                              : type == VK_INDEX_TYPE_UINT8_EXT ? 0xff
                                                                : 0xffffffff;
        return type != VK_INDEX_TYPE_NONE_KHR && found >= most - 3 ? found | ~most : found;
    }
};

// The members that both APIs have for a geometry's micromap. Faults change them.
struct Attachment {
    Indices indices;
    uint32_t base = 0;
    uint64_t micromap = 0;
    bool dropped = false;
    // of the geometry
    uint32_t geometry = 0, triangles = 0, firstTriangle = 0;
    VkGeometryFlagsKHR flags = 0;
    VkAccelerationStructureGeometryTrianglesDataKHR data{};
    VkDeviceAddress vertexIndices = 0; // of the first triangle
};

struct Context {
    VkCommandBuffer commands;
    uint64_t target, source; // the structures that the build writes, and that an update reads
    bool update;
    VkBuildAccelerationStructureFlagsKHR flags;
    std::vector<Attachment> attachments; // of the geometries that have one
    std::vector<Attachment> given;       // before the changes
    std::vector<uint32_t> empty;         // geometries without triangles
};

using MakeIndex = std::function<uint32_t(const Indices &, uint32_t triangle)>;

// 32-bit indices that are made when the build is executed.
void replaceIndices(const Context &context, Attachment &attachment, MakeIndex make)
{
    const Indices given = attachment.indices;
    const uint32_t count = attachment.triangles;
    const Memory memory = memoryFor(context.commands, VkDeviceSize{count} * 4 + 4);
    beforeExecution(context.commands, [=, make = std::move(make)] {
        for (uint32_t t = 0; t < count; ++t) {
            const uint32_t index = make(given, t);
            std::memcpy(memory.bytes + size_t{t} * 4, &index, 4);
        }
    });
    attachment.indices = {VK_INDEX_TYPE_UINT32, memory.address, 4};
}

VkDeviceSize bytesOf(VkIndexType type)
{
    return type == VK_INDEX_TYPE_UINT32 ? 4 : type == VK_INDEX_TYPE_UINT8_EXT ? 1 : 2;
}

// --- what an update remembers of the build before it ---

struct Kept {
    std::shared_ptr<std::vector<uint32_t>> indices = std::make_shared<std::vector<uint32_t>>();
    uint32_t base = 0;
    uint64_t micromap = 0;
};
std::mutex mutex;
std::map<uint64_t, std::map<uint32_t, Kept>> keptOf; // by structure and geometry

void keep(Context &context)
{
    std::map<uint32_t, Kept> all;
    for (const Attachment &attachment : context.attachments) {
        Kept kept{.base = attachment.base, .micromap = attachment.micromap};
        beforeExecution(context.commands,
                        [indices = kept.indices, given = attachment.indices, count = attachment.triangles] {
                            indices->clear();
                            for (uint32_t t = 0; t < count; ++t)
                                indices->push_back(given.value(t));
                        });
        all.emplace(attachment.geometry, std::move(kept));
    }
    std::lock_guard lock(mutex);
    keptOf[context.target] = std::move(all);
}

std::optional<Kept> keptFor(const Context &context, const Attachment &attachment)
{
    std::lock_guard lock(mutex);
    const auto structure = keptOf.find(context.source);
    if (structure == keptOf.end())
        return std::nullopt;
    const auto kept = structure->second.find(attachment.geometry);
    return kept == structure->second.end() ? std::nullopt : std::optional(kept->second);
}

// --- the faults ---

void baseWithoutIndices(Context &, Attachment &attachment)
{
    if (attachment.indices.type == VK_INDEX_TYPE_NONE_KHR)
        attachment.base = 0;
}

void baseTwice(Context &, Attachment &attachment)
{
    if (attachment.indices.type != VK_INDEX_TYPE_NONE_KHR)
        attachment.base *= 2;
}

void baseOnSpecial(Context &context, Attachment &attachment)
{
    if (attachment.indices.type == VK_INDEX_TYPE_NONE_KHR)
        return;
    replaceIndices(context, attachment,
                   [base = attachment.base](const Indices &given, uint32_t t) { return given.value(t) + base; });
    attachment.base = 0;
}

void bytesAsShorts(Context &context, Attachment &attachment)
{
    if (attachment.indices.type == VK_INDEX_TYPE_UINT8_EXT)
        replaceIndices(context, attachment,
                       [](const Indices &given, uint32_t t) { return uint32_t{given.read<uint16_t>(t)}; });
}

void narrowSpecial(Context &context, Attachment &attachment)
{
    if (attachment.indices.type != VK_INDEX_TYPE_NONE_KHR)
        replaceIndices(context, attachment, [](const Indices &given, uint32_t t) { return given.raw(t); });
}

void lowByteSpecial(Context &context, Attachment &attachment)
{
    if (attachment.indices.type != VK_INDEX_TYPE_NONE_KHR)
        replaceIndices(context, attachment, [](const Indices &given, uint32_t t) {
            const uint32_t index = given.value(t);
            return (index & 0xff) >= 0xfc ? index | 0xffffff00 : index;
        });
}

void indexStride(Context &, Attachment &attachment)
{
    if (attachment.indices.type != VK_INDEX_TYPE_NONE_KHR)
        attachment.indices.stride = bytesOf(attachment.indices.type);
}

void nullMicromapOpaque(Context &context, Attachment &attachment)
{
    if (attachment.micromap == 0)
        replaceIndices(context, attachment, [](const Indices &, uint32_t) { return kOpaque; });
}

void geometryZero(Context &context, Attachment &attachment)
{
    attachment.micromap = context.attachments.front().micromap;
}

void opaqueGeometry(Context &, Attachment &attachment)
{
    attachment.dropped = (attachment.flags & VK_GEOMETRY_OPAQUE_BIT_KHR) != 0;
}

void indexedGeometry(Context &, Attachment &attachment)
{
    attachment.dropped = attachment.data.indexType != VK_INDEX_TYPE_NONE_KHR;
}

void transformedGeometry(Context &, Attachment &attachment)
{
    attachment.dropped = attachment.data.transformData.deviceAddress != 0;
}

void otherFormat(Context &, Attachment &attachment)
{
    attachment.dropped = attachment.data.vertexFormat != VK_FORMAT_R32G32B32_SFLOAT;
}

void noDuplicates(Context &, Attachment &attachment)
{
    attachment.dropped = (attachment.flags & VK_GEOMETRY_NO_DUPLICATE_ANY_HIT_INVOCATION_BIT_KHR) != 0;
}

void byVertexIndex(Context &context, Attachment &attachment)
{
    if (attachment.data.indexType == VK_INDEX_TYPE_NONE_KHR)
        return;
    const Indices vertices{attachment.data.indexType, attachment.vertexIndices, 3 * bytesOf(attachment.data.indexType)};
    replaceIndices(context, attachment, [vertices, count = attachment.triangles](const Indices &given, uint32_t t) {
        return given.value(std::min(vertices.raw(t) / 3, count - 1));
    });
}

// Geometries behind empty ones have the micromaps of those before them.
void emptyShifts(Context &context, Attachment &attachment)
{
    uint32_t empty = 0;
    for (const uint32_t number : context.empty)
        empty += number < attachment.geometry ? 1u : 0u;
    for (const Attachment &other : context.given)
        if (empty > 0 && other.geometry == attachment.geometry - empty)
            attachment.micromap = other.micromap;
}

void primitiveOffset(Context &, Attachment &attachment)
{
    if (attachment.indices.type != VK_INDEX_TYPE_NONE_KHR)
        attachment.indices.address += attachment.firstTriangle * attachment.indices.stride;
}

void specialUnknown(Context &context, Attachment &attachment)
{
    if (attachment.indices.type != VK_INDEX_TYPE_NONE_KHR)
        replaceIndices(context, attachment, [](const Indices &given, uint32_t t) {
            const uint32_t index = given.value(t);
            return index == kUnknownTransparent ? kUnknownOpaque
                   : index == kUnknownOpaque    ? kUnknownTransparent
                                                : index;
        });
}

void updateDrops(Context &context, Attachment &attachment)
{
    attachment.dropped = context.update;
}

void fastTrace(Context &context, Attachment &attachment)
{
    attachment.dropped = (context.flags & VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR) != 0;
}

void updateElsewhere(Context &context, Attachment &attachment)
{
    attachment.dropped = context.update && context.source != context.target;
}

void updateIndices(Context &context, Attachment &attachment)
{
    const auto kept = context.update ? keptFor(context, attachment) : std::nullopt;
    if (!kept)
        return;
    replaceIndices(context, attachment, [indices = kept->indices](const Indices &given, uint32_t t) {
        return t < indices->size() ? (*indices)[t] : given.value(t);
    });
    attachment.base = kept->base;
}

void updateMicromap(Context &context, Attachment &attachment)
{
    const auto kept = context.update ? keptFor(context, attachment) : std::nullopt;
    if (kept && kept->micromap != 0)
        attachment.micromap = kept->micromap;
}

void shallowClone(Context &, Attachment &attachment)
{
    attachment.micromap = originalOf(attachment.micromap);
}

void lostTriangle(Context &context, Attachment &attachment)
{
    const uint32_t lost = lostTriangleOf(attachment.micromap);
    if (lost != UINT32_MAX)
        replaceIndices(context, attachment, [lost, base = attachment.base](const Indices &given, uint32_t t) {
            const uint32_t index = given.value(t);
            return index < kFirstSpecial && index + base == lost ? kUnknownOpaque : index;
        });
}

void updateLosesMore(Context &context, Attachment &attachment)
{
    if (context.update && isLossy(attachment.micromap))
        replaceIndices(context, attachment, [base = attachment.base](const Indices &given, uint32_t t) {
            const uint32_t index = given.value(t);
            return index + base == 0 ? kUnknownOpaque : index;
        });
}

// --- fields with too few bits, and what begins at such a number ---

// The attachment of the geometry with the number that is left.
template <uint32_t mask>
void narrowGeometry(Context &context, Attachment &attachment)
{
    const auto other =
        std::ranges::lower_bound(context.attachments, attachment.geometry & mask, {}, &Attachment::geometry);
    attachment.dropped =
        other == context.attachments.end() || other->geometry != (attachment.geometry & mask) || other->triangles == 0;
    if (attachment.dropped || attachment.geometry <= mask)
        return;
    attachment.base = other->base;
    attachment.micromap = other->micromap;
    attachment.indices = other->indices;
    if (other->indices.type != VK_INDEX_TYPE_NONE_KHR)
        replaceIndices(context, attachment, [last = other->triangles - 1](const Indices &given, uint32_t t) {
            return given.value(std::min(t, last));
        });
}

template <uint32_t mask>
void narrowPrimitive(Context &context, Attachment &attachment)
{
    if (attachment.triangles > mask)
        replaceIndices(context, attachment, [](const Indices &given, uint32_t t) { return given.value(t & mask); });
}

template <uint32_t first>
void lostFrom(Context &context, Attachment &attachment)
{
    if (trianglesOf(attachment.micromap) <= first)
        return;
    replaceIndices(context, attachment, [base = attachment.base](const Indices &given, uint32_t t) {
        const uint32_t index = given.value(t);
        return index < kFirstSpecial && index + base >= first ? kUnknownOpaque : index;
    });
}

template <uint32_t mask>
void narrowBase(Context &, Attachment &attachment)
{
    attachment.base &= mask;
}

template <VkIndexType type, uint32_t sign>
void signExtended(Context &context, Attachment &attachment)
{
    if (attachment.indices.type == type)
        replaceIndices(context, attachment, [](const Indices &given, uint32_t t) {
            const uint32_t index = given.raw(t);
            return (index & sign) != 0 ? index | ~(2 * sign - 1) : index;
        });
}

struct Fault {
    const char *name;
    void (*apply)(Context &, Attachment &);
};
constexpr Fault kFaults[]{
    {"base-without-indices", baseWithoutIndices},
    {"base-twice", baseTwice},
    {"base-on-special-indices", baseOnSpecial},
    {"index-8-as-16", bytesAsShorts},
    {"special-index-not-extended", narrowSpecial},
    {"special-index-by-low-byte", lowByteSpecial},
    {"index-stride", indexStride},
    {"null-micromap-opaque", nullMicromapOpaque},
    {"micromap-of-first-geometry", geometryZero},
    {"opaque-geometry-without-micromap", opaqueGeometry},
    {"indexed-geometry-without-micromap", indexedGeometry},
    {"transformed-geometry-without-micromap", transformedGeometry},
    {"other-vertex-format-without-micromap", otherFormat},
    {"no-duplicates-without-micromap", noDuplicates},
    {"micromap-by-vertex-index", byVertexIndex},
    {"empty-geometry-shifts-micromaps", emptyShifts},
    {"primitive-offset-moves-indices", primitiveOffset},
    {"special-unknown-swapped", specialUnknown},
    {"update-drops-micromap", updateDrops},
    {"fast-trace-without-micromap", fastTrace},
    {"update-elsewhere-drops-micromap", updateElsewhere},
    {"update-keeps-indices", updateIndices},
    {"update-keeps-micromap", updateMicromap},
    {"clone-is-shallow", shallowClone},
    {"compaction-loses-last-triangle", lostTriangle},
    {"geometry-index-4-bits", narrowGeometry<0xf>},
    {"geometry-index-8-bits", narrowGeometry<0xff>},
    {"geometry-index-16-bits", narrowGeometry<0xffff>},
    {"primitive-index-10-bits", narrowPrimitive<0x3ff>},
    {"primitive-index-16-bits", narrowPrimitive<0xffff>},
    {"micromap-triangles-lost-from-1024", lostFrom<1024>},
    {"micromap-triangles-lost-from-65536", lostFrom<65536>},
    {"base-8-bits", narrowBase<0xff>},
    {"base-16-bits", narrowBase<0xffff>},
    {"index-8-sign-extended", signExtended<VK_INDEX_TYPE_UINT8_EXT, 0x80>},
    {"index-16-sign-extended", signExtended<VK_INDEX_TYPE_UINT16, 0x8000>},
    {"lossy-copy-loses-more", lostTriangle},
    {"lossy-once-more", updateLosesMore},
};

// --- builds ---

// Copies of the geometries of bottom-level builds, with the attachments that a fault makes of the application's.
class Builds
{
public:
    Builds(VkCommandBuffer commands, std::span<const BuildInfo> infos, const RangeInfo *const *ranges)
        : infos_(infos.begin(), infos.end())
    {
        for (uint32_t i = 0; i < infos.size(); ++i) {
            if (infos[i].type != VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR)
                apply(commands, infos_[i], ranges[i]);
        }
    }
    [[nodiscard]] const BuildInfo *infos() const { return infos_.data(); }

private:
    template <class Structure>
    static Attachment read(const Structure &structure, VkDeviceAddress indices, uint64_t micromap)
    {
        return {.indices = {structure.indexType, indices, structure.indexStride},
                .base = structure.baseTriangle,
                .micromap = micromap};
    }
    template <class Structure>
    static void write(Structure &structure, const Attachment &attachment)
    {
        structure.indexType = attachment.indices.type;
        structure.indexStride = attachment.indices.stride;
        structure.baseTriangle = attachment.base;
    }

    static std::optional<Attachment> attachmentOf(const VkAccelerationStructureGeometryTrianglesDataKHR &triangles)
    {
        using Ext = VkAccelerationStructureTrianglesOpacityMicromapEXT;
        using Khr = VkAccelerationStructureTrianglesOpacityMicromapKHR;
        if (const auto *ext = driver::inChain<Ext>(
                triangles.pNext, VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_EXT))
            return read(*ext, ext->indexBuffer.deviceAddress, numberOf(ext->micromap));
        if (const auto *khr = driver::inChain<Khr>(
                triangles.pNext, VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_KHR))
            return read(*khr, khr->indexBuffer, numberOf(khr->micromap));
        return std::nullopt;
    }

    void replace(VkAccelerationStructureGeometryTrianglesDataKHR &triangles, const Attachment &attachment)
    {
        using Ext = VkAccelerationStructureTrianglesOpacityMicromapEXT;
        using Khr = VkAccelerationStructureTrianglesOpacityMicromapKHR;
        constexpr auto kExt = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_EXT;
        constexpr auto kKhr = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_KHR;
        Chain &chain = chains_.emplace_back(triangles.pNext);
        if (attachment.dropped) {
            chain.remove(kExt);
            chain.remove(kKhr);
        } else if (auto *ext = chain.edit<Ext>(kExt)) {
            write(*ext, attachment);
            ext->indexBuffer.deviceAddress = attachment.indices.address;
            ext->micromap = handleOf<VkMicromapEXT>(attachment.micromap);
        } else if (auto *khr = chain.edit<Khr>(kKhr)) {
            write(*khr, attachment);
            khr->indexBuffer = attachment.indices.address;
            khr->micromap = handleOf<VkAccelerationStructureKHR>(attachment.micromap);
        }
        triangles.pNext = chain.head();
    }

    static uint32_t triangleBytes(const VkAccelerationStructureGeometryTrianglesDataKHR &triangles)
    {
        return triangles.indexType == VK_INDEX_TYPE_NONE_KHR ? 3 * static_cast<uint32_t>(triangles.vertexStride)
                                                             : 3 * static_cast<uint32_t>(bytesOf(triangles.indexType));
    }

    void apply(VkCommandBuffer commands, BuildInfo &info, const RangeInfo *ranges)
    {
        auto &geometries = geometries_.emplace_back();
        Context context{.commands = commands,
                        .target = numberOf(info.dstAccelerationStructure),
                        .source = numberOf(info.srcAccelerationStructure),
                        .update = info.mode == VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR,
                        .flags = info.flags};
        for (uint32_t g = 0; g < info.geometryCount; ++g) {
            const auto &geometry = geometries.emplace_back(geometryOf(info, g));
            const auto &triangles = geometry.geometry.triangles;
            if (ranges[g].primitiveCount == 0)
                context.empty.push_back(g);
            const bool first = info.ppGeometries != nullptr && has(keyOf(commands), "geometry-pointers-as-first");
            auto attachment = geometry.geometryType == VK_GEOMETRY_TYPE_TRIANGLES_KHR
                                  ? attachmentOf(first ? geometries[0].geometry.triangles : triangles)
                                  : std::nullopt;
            if (!attachment || !attachmentOf(triangles))
                continue;
            attachment->data = triangles;
            attachment->vertexIndices = triangles.indexData.deviceAddress + ranges[g].primitiveOffset;
            attachment->geometry = g;
            attachment->flags = geometry.flags;
            attachment->triangles = ranges[g].primitiveCount;
            attachment->firstTriangle = ranges[g].primitiveOffset / std::max(triangleBytes(triangles), 1u);
            context.attachments.push_back(*attachment);
        }
        if (context.attachments.empty())
            return;
        if (!context.update)
            keep(context);
        context.given = context.attachments;
        for (const Fault &fault : kFaults) {
            if (!has(keyOf(commands), fault.name))
                continue;
            for (Attachment &attachment : context.attachments)
                fault.apply(context, attachment);
        }
        for (const Attachment &attachment : context.attachments)
            replace(geometries[attachment.geometry].geometry.triangles, attachment);
        info.pGeometries = geometries.data();
        info.ppGeometries = nullptr;
    }

    std::vector<BuildInfo> infos_;
    std::deque<std::vector<VkAccelerationStructureGeometryKHR>> geometries_;
    std::deque<Chain> chains_;
};

VKAPI_ATTR void VKAPI_CALL cmdBuild(VkCommandBuffer handle, uint32_t count, const BuildInfo *infos,
                                    const RangeInfo *const *ranges)
{
    const auto build = DRIVER_NEXT(vkCmdBuildAccelerationStructuresKHR);
    if (!hasAny(keyOf(handle), kLevel))
        return build(handle, count, infos, ranges);
    const Builds builds(handle, {infos, count}, ranges);
    build(handle, count, builds.infos(), ranges);
}

void forgetAttachments(uint64_t micromap)
{
    std::lock_guard lock(mutex);
    keptOf.erase(micromap);
    for (auto &[structure, geometries] : keptOf) {
        for (auto &[geometry, kept] : geometries)
            kept.micromap = kept.micromap == micromap ? 0 : kept.micromap;
    }
}

void forget(uint64_t micromap)
{
    forgetAttachments(micromap);
    forgetCopies(micromap);
    forgetBuild(micromap);
}

VKAPI_ATTR void VKAPI_CALL destroyMicromap(VkDevice handle, VkMicromapEXT micromap,
                                           const VkAllocationCallbacks *allocator)
{
    forget(numberOf(micromap));
    DRIVER_NEXT(vkDestroyMicromapEXT)(handle, micromap, allocator);
}

VKAPI_ATTR void VKAPI_CALL destroyStructure(VkDevice handle, VkAccelerationStructureKHR structure,
                                            const VkAllocationCallbacks *allocator)
{
    forget(numberOf(structure));
    DRIVER_NEXT(vkDestroyAccelerationStructureKHR)(handle, structure, allocator);
}

} // namespace

LevelRows attachmentRows()
{
    static const Row device[]{
        {"vkCmdBuildAccelerationStructuresKHR", DRIVER_FUNCTION(cmdBuild)},
        {"vkDestroyMicromapEXT", DRIVER_FUNCTION(destroyMicromap)},
        {"vkDestroyAccelerationStructureKHR", DRIVER_FUNCTION(destroyStructure)},
    };
    return {device, {}};
}

} // namespace faults
