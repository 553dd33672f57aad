// SPDX-License-Identifier: Apache-2.0
#include "layer/rules/copies.h"

#include <algorithm>

namespace vellum::layer::rules
{
namespace
{

using enum Severity;
using input::Executor;

constexpr const char *kNullHandle = "it is VK_NULL_HANDLE";
constexpr const char *kUnknown = "it is not an acceleration structure of this device";
constexpr const char *kChain = "it is not null; nothing extends this structure";
constexpr const char *kNotHostVisible = "its buffer is not bound to host-visible memory";

Found isUnknownMicromap(const ObjectFacts &facts, ObjectHandle handle)
{
    return isUnknown(facts, handle ? "it is not a micromap of this device" : kNullHandle);
}

// ------------------------------------------------------------------------------------------ clones and compactions

struct Copied {
    const input::Copy &copy;
    const RuleDevice &device;
    const CopyFacts &facts;
};
// Other modes are clones, as in drivers.
Found wrongMode(const Copied &c)
{
    return when(!c.copy.isClone && !c.copy.isCompaction, "it is neither CLONE nor COMPACT");
}
Found unboundSource(const Copied &c)
{
    return isUnbound(c.facts.source);
}
Found unboundTarget(const Copied &c)
{
    return isUnbound(c.facts.target);
}

constexpr Rule<Copied> kExtCopy[] = {
    {"VUID-VkCopyMicromapInfoEXT-sType-sType", Report, "sType",
     [](const Copied &c) { return when(!c.copy.rightType, "it is not VK_STRUCTURE_TYPE_COPY_MICROMAP_INFO_EXT"); }},
    {"VUID-VkCopyMicromapInfoEXT-pNext-pNext", Report, "pNext",
     [](const Copied &c) { return when(c.copy.hasChain, kChain); }},
    {"VUID-VkCopyMicromapInfoEXT-src-parameter", Reject, "src",
     [](const Copied &c) { return isUnknownMicromap(c.facts.source, c.copy.source); }},
    {"VUID-VkCopyMicromapInfoEXT-dst-parameter", Reject, "dst",
     [](const Copied &c) { return isUnknownMicromap(c.facts.target, c.copy.target); }},
    {"VUID-VkCopyMicromapInfoEXT-mode-07531", Tolerate, "mode", wrongMode},
};
constexpr Rule<Copied> kExtDeviceCopy[] = {
    {"VUID-vkCmdCopyMicromapEXT-buffer-07529", Reject, "src", unboundSource},
    {"VUID-vkCmdCopyMicromapEXT-buffer-07530", Reject, "dst", unboundTarget},
};
constexpr Rule<Copied> kExtHostCopy[] = {
    {"VUID-vkCopyMicromapEXT-micromapHostCommands-07560", Reject, nullptr,
     [](const Copied &c) { return lacksHostCommands(c.device); }},
    {"VUID-vkCopyMicromapEXT-buffer-07558", Reject, "src",
     [](const Copied &c) { return when(!c.facts.source.hostVisible, kNotHostVisible); }},
    {"VUID-vkCopyMicromapEXT-buffer-07559", Reject, "dst",
     [](const Copied &c) { return when(!c.facts.target.hostVisible, kNotHostVisible); }},
};
constexpr Rule<Copied> kKhrCopy[] = {
    {"VUID-VkCopyAccelerationStructureInfoKHR-src-parameter", Reject, "src",
     [](const Copied &c) { return isUnknown(c.facts.source, kUnknown); }},
    {"VUID-VkCopyAccelerationStructureInfoKHR-dst-parameter", Reject, "dst",
     [](const Copied &c) { return isUnknown(c.facts.target, kUnknown); }},
    {"VUID-VkCopyAccelerationStructureInfoKHR-buffer-03718", Reject, "src", unboundSource},
    {"VUID-VkCopyAccelerationStructureInfoKHR-buffer-03719", Reject, "dst", unboundTarget},
    {"VUID-VkCopyAccelerationStructureInfoKHR-dst-07791", Reject, "dst",
     [](const Copied &c) { return when(c.facts.sameMemory, "it overlaps src in memory"); }},
    {"VUID-VkCopyAccelerationStructureInfoKHR-mode-03410", Tolerate, "mode", wrongMode},
};

// ------------------------------------------------------------------------------------------ serialized data

struct Serialized {
    const input::SerializedCopy &copy;
    const RuleDevice &device;
    const ObjectFacts &object;
};

Found unknownObject(const Serialized &c)
{
    return isUnknown(c.object, kUnknown);
}
Found nullObject(const Serialized &c)
{
    return isUnknownMicromap(c.object, c.copy.object);
}
Found unboundObject(const Serialized &c)
{
    return isUnbound(c.object);
}
Found notHostVisible(const Serialized &c)
{
    return when(!c.object.hostVisible, kNotHostVisible);
}
Found noData(const Serialized &c)
{
    return c.copy.executor == Executor::Host ? when(c.copy.data.deviceAddress == 0, "the address is null")
                                             : isInvalid(c.device, c.copy.data.deviceAddress, Reject);
}
Found noHostCommands(const Serialized &c)
{
    return lacksHostCommands(c.device);
}
// The layer's shaders read and write 16 bytes at once.
Found misaligned(const Serialized &c, uint64_t alignment)
{
    const VkDeviceAddress data = c.copy.data.deviceAddress;
    return when(
        data % alignment != 0, [&] { return hex(data) + " is not a multiple of " + std::to_string(alignment); },
        data % 16 == 0 ? Tolerate : Reject);
}
Found misalignedBy256(const Serialized &c)
{
    return misaligned(c, 256);
}
Found misalignedBy16(const Serialized &c)
{
    return misaligned(c, 16);
}

constexpr Rule<Serialized> kExtSave[] = {
    {"VUID-VkCopyMicromapToMemoryInfoEXT-sType-sType", Report, "sType",
     [](const Serialized &c) {
         return when(!c.copy.rightType, "it is not VK_STRUCTURE_TYPE_COPY_MICROMAP_TO_MEMORY_INFO_EXT");
     }},
    {"VUID-VkCopyMicromapToMemoryInfoEXT-pNext-pNext", Report, "pNext",
     [](const Serialized &c) { return when(c.copy.hasChain, kChain); }},
    {"VUID-VkCopyMicromapToMemoryInfoEXT-src-parameter", Reject, "src", nullObject},
    {"VUID-VkCopyMicromapToMemoryInfoEXT-mode-07542", Tolerate, "mode",
     [](const Serialized &c) { return when(!c.copy.rightMode, "it is not SERIALIZE"); }},
};
constexpr Rule<Serialized> kExtDeviceSave[] = {
    {kExtSavedDataId, Reject, "dst", noData},
    {"VUID-vkCmdCopyMicromapToMemoryEXT-pInfo-07537", Depends, "dst", misalignedBy256},
    {"VUID-vkCmdCopyMicromapToMemoryEXT-buffer-07539", Reject, "src", unboundObject},
};
constexpr Rule<Serialized> kExtHostSave[] = {
    {"VUID-vkCopyMicromapToMemoryEXT-micromapHostCommands-07571", Reject, nullptr, noHostCommands},
    {"VUID-vkCopyMicromapToMemoryEXT-buffer-07568", Reject, "src", notHostVisible},
    {"VUID-vkCopyMicromapToMemoryEXT-pInfo-07569", Reject, "dst", noData},
    {"VUID-vkCopyMicromapToMemoryEXT-pInfo-07570", Report, "dst", misalignedBy16},
};
constexpr Rule<Serialized> kExtRestore[] = {
    {"VUID-VkCopyMemoryToMicromapInfoEXT-sType-sType", Report, "sType",
     [](const Serialized &c) {
         return when(!c.copy.rightType, "it is not VK_STRUCTURE_TYPE_COPY_MEMORY_TO_MICROMAP_INFO_EXT");
     }},
    {"VUID-VkCopyMemoryToMicromapInfoEXT-pNext-pNext", Report, "pNext",
     [](const Serialized &c) { return when(c.copy.hasChain, kChain); }},
    {"VUID-VkCopyMemoryToMicromapInfoEXT-dst-parameter", Reject, "dst", nullObject},
    {"VUID-VkCopyMemoryToMicromapInfoEXT-mode-07548", Tolerate, "mode",
     [](const Serialized &c) { return when(!c.copy.rightMode, "it is not DESERIALIZE"); }},
};
constexpr Rule<Serialized> kExtDeviceRestore[] = {
    {kExtRestoredDataId, Reject, "src", noData},
    {"VUID-vkCmdCopyMemoryToMicromapEXT-pInfo-07544", Depends, "src", misalignedBy256},
    {"VUID-vkCmdCopyMemoryToMicromapEXT-buffer-07546", Reject, "dst", unboundObject},
};
constexpr Rule<Serialized> kExtHostRestore[] = {
    {"VUID-vkCopyMemoryToMicromapEXT-micromapHostCommands-07566", Reject, nullptr, noHostCommands},
    {"VUID-vkCopyMemoryToMicromapEXT-buffer-07565", Reject, "dst", notHostVisible},
    {"VUID-vkCopyMemoryToMicromapEXT-pInfo-07563", Reject, "src", noData},
    {"VUID-vkCopyMemoryToMicromapEXT-pInfo-07564", Report, "src", misalignedBy16},
};
constexpr Rule<Serialized> kKhrSave[] = {
    {"VUID-VkCopyAccelerationStructureToMemoryInfoKHR-src-parameter", Reject, "src", unknownObject},
    {"VUID-VkCopyAccelerationStructureToMemoryInfoKHR-mode-03412", Tolerate, "mode",
     [](const Serialized &c) { return when(!c.copy.rightMode, "it is not SERIALIZE"); }},
    {"VUID-VkCopyAccelerationStructureToMemoryInfoKHR-mode-11714", Reject, "src", unboundObject},
    {kKhrSavedDataId, Reject, "dst", noData},
    {"VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-11699", Depends, "dst",
     [](const Serialized &c) { return c.object.holdsMicromap() ? misaligned(c, 128) : Found{}; }},
    {"VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-03740", Depends, "dst",
     [](const Serialized &c) { return c.object.holdsMicromap() ? Found{} : misaligned(c, 256); }},
};
constexpr Rule<Serialized> kKhrRestore[] = {
    {"VUID-VkCopyMemoryToAccelerationStructureInfoKHR-dst-parameter", Reject, "dst", unknownObject},
    {"VUID-VkCopyMemoryToAccelerationStructureInfoKHR-mode-03413", Tolerate, "mode",
     [](const Serialized &c) { return when(!c.copy.rightMode, "it is not DESERIALIZE"); }},
    {"VUID-VkCopyMemoryToAccelerationStructureInfoKHR-dst-11717", Reject, "dst", unboundObject},
    {kKhrRestoredDataId, Reject, "src", noData},
    // The specification names 11700, a rule of this command, after the other one.
    {"VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-11700", Depends, "src",
     [](const Serialized &c) { return c.object.isMicromap() ? misaligned(c, 128) : Found{}; }},
    {"VUID-vkCmdCopyMemoryToAccelerationStructureKHR-pInfo-03743", Depends, "src",
     [](const Serialized &c) {
         const bool mayBeMicromap = c.device.driver.enabled.khr && c.object.canHoldMicromap();
         return c.object.isMicromap() ? Found{} : misaligned(c, mayBeMicromap ? 128 : 256);
     }},
};

// ------------------------------------------------------------------------------------------ properties

struct Query {
    const input::PropertyQuery &query;
    const RuleDevice &device;
    const PoolFacts &pool;
    [[nodiscard]] uint64_t count() const { return query.objects.size(); }
    [[nodiscard]] bool isPoolKnown() const { return pool.kind == PoolFacts::Kind::Known; }
};

Found wrongType(const Query &c)
{
    return when(!(c.query.khr ? isStructureQuery(c.query.type) : isMicromapQuery(c.query.type)),
                [&] { return nameOf(c.query.type) + " is not a type that this command writes"; });
}
Found noPool(const Query &c)
{
    return when(c.pool.kind == PoolFacts::Kind::None, "it is no query pool, or was destroyed");
}
// Pools of both types of micromaps work in the same way.
Found wrongPool(const Query &c)
{
    return when(
        c.isPoolKnown() && c.pool.type != c.query.type,
        [&] {
            const bool isKept = c.pool.type != VK_QUERY_TYPE_MAX_ENUM;
            return "it was created with " + (isKept ? "type " + nameOf(c.pool.type) : "another type") + ", not " +
                   nameOf(c.query.type);
        },
        !c.query.khr && isMicromapQuery(c.pool.type) ? Tolerate : Reject);
}
Found outsidePool(const Query &c)
{
    const bool right = c.isPoolKnown() && (c.pool.type == c.query.type || isMicromapQuery(c.pool.type));
    return when(right && c.query.first + c.count() > c.pool.count, [&] {
        return std::to_string(c.query.first) + " and " + std::to_string(c.count()) + " queries; the pool has " +
               std::to_string(c.pool.count);
    });
}
Found noObjects(const Query &c)
{
    return when(c.count() == 0, "it is 0");
}

constexpr Rule<Query> kExtQuery[] = {
    {"VUID-vkCmdWriteMicromapsPropertiesEXT-micromapCount-arraylength", Report, "micromapCount", noObjects},
    {"VUID-vkCmdWriteMicromapsPropertiesEXT-queryType-07503", Reject, "queryType", wrongType},
    {"VUID-vkCmdWriteMicromapsPropertiesEXT-queryPool-parameter", Reject, "queryPool", noPool},
    {"VUID-vkCmdWriteMicromapsPropertiesEXT-queryPool-07525", Depends, "queryPool", wrongPool},
    {"VUID-vkCmdWriteMicromapsPropertiesEXT-query-07528", Reject, "firstQuery", outsidePool},
};
constexpr Rule<Query> kKhrQuery[] = {
    {"VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-accelerationStructureCount-arraylength", Report,
     "accelerationStructureCount", noObjects},
    {"VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-queryType-06742", Reject, "queryType", wrongType},
    {"VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-queryPool-parameter", Reject, "queryPool", noPool},
    {"VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-queryPool-02493", Depends, "queryPool", wrongPool},
    {"VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-query-04880", Reject, "firstQuery", outsidePool},
};

struct Queried {
    VkQueryType type;
    const RuleDevice &device;
    ObjectFacts object;
};
Found unboundQueried(const Queried &c)
{
    return isUnbound(c.object);
}
constexpr Rule<Queried> kExtQueried[] = {
    {"VUID-vkCmdWriteMicromapsPropertiesEXT-pMicromaps-parameter", Reject, nullptr,
     [](const Queried &c) { return isUnknown(c.object, kNullHandle); }},
    {"VUID-vkCmdWriteMicromapsPropertiesEXT-buffer-07527", Report, nullptr, unboundQueried},
};
constexpr Rule<Queried> kKhrQueried[] = {
    {"VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-pAccelerationStructures-parameter", Reject, nullptr,
     [](const Queried &c) { return isUnknown(c.object, kUnknown); }},
    {"VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-buffer-03736", Report, nullptr, unboundQueried},
    {kTopLevelOnlyId, Tolerate, nullptr,
     [](const Queried &c) {
         const bool pointers = c.type == VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_BOTTOM_LEVEL_POINTERS_KHR;
         return when(pointers &&
                         (c.object.holdsMicromap() ||
                          (c.device.validating && c.object.type == VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR)),
                     "the structure was not created as a top-level one");
     }},
};

constexpr Rule<Query> kHostQuery[] = {
    {"VUID-vkWriteMicromapsPropertiesEXT-micromapHostCommands-07578", Reject, nullptr,
     [](const Query &c) { return lacksHostCommands(c.device); }},
    {"VUID-vkWriteMicromapsPropertiesEXT-queryType-07503", Reject, "queryType", wrongType},
    {"VUID-vkWriteMicromapsPropertiesEXT-dataSize-07576", Depends, "dataSize",
     [](const Query &c) {
         const size_t needed = c.count() * c.query.stride;
         const size_t written = c.count() == 0 ? 0 : (c.count() - 1) * c.query.stride + sizeof(VkDeviceSize);
         return when(
             c.query.bytes < std::max(needed, written),
             [&] {
                 return std::to_string(c.query.bytes) + " is less than micromapCount * stride, " +
                        std::to_string(needed);
             },
             c.query.bytes < written ? Reject : Report);
     }},
    {"VUID-vkWriteMicromapsPropertiesEXT-queryType-10071", Report, "stride",
     [](const Query &c) {
         return when(c.query.stride % sizeof(VkDeviceSize) != 0 && !wrongType(c),
                     [&] { return std::to_string(c.query.stride) + " is not a multiple of 8"; });
     }},
    {"VUID-vkWriteMicromapsPropertiesEXT-queryType-10072", Report, "pData",
     [](const Query &c) {
         return when(reinterpret_cast<uintptr_t>(c.query.memory) % alignof(VkDeviceSize) != 0 && !wrongType(c),
                     [&] { return hex(reinterpret_cast<uintptr_t>(c.query.memory)) + " is not a multiple of 8"; });
     }},
};
constexpr Rule<Queried> kHostQueried[] = {
    {"VUID-vkWriteMicromapsPropertiesEXT-buffer-07577", Reject, nullptr,
     [](const Queried &c) { return when(!c.object.exists || !c.object.hostVisible, kNotHostVisible); }},
};

Verdict checkObjects(const InputCheck &check, std::span<const Rule<Queried>> rules, const input::PropertyQuery &query,
                     const Facts &facts)
{
    Verdict verdict;
    for (uint32_t i = 0; i < query.objects.size() && (verdict.accepted || check.device().validating); ++i) {
        const Place place = check.place().element(query.khr ? "pAccelerationStructures" : "pMicromaps", i);
        verdict &= InputCheck(check.device(), place, query.objects[i])
                       .check(rules, Queried{query.type, check.device(), facts(query.objects[i])});
    }
    return verdict;
}

// Checks two tables, the second only if the command may go on.
template <typename Case>
Verdict checkBoth(const InputCheck &check, std::span<const Rule<Case>> first, std::span<const Rule<Case>> second,
                  const Case &c)
{
    Verdict verdict = check.check<Case>(first, c);
    if (verdict.accepted || check.device().validating)
        verdict &= check.check<Case>(second, c);
    return verdict;
}

} // namespace

void checkCopy(const InputCheck &check, input::Copy &copy, const CopyFacts &facts)
{
    const Copied c{copy, check.device(), facts};
    const Verdict verdict =
        copy.khr()
            ? check.check<Copied>(kKhrCopy, c)
            : checkBoth<Copied>(
                  check, kExtCopy,
                  copy.executor == Executor::Host ? std::span<const Rule<Copied>>(kExtHostCopy) : kExtDeviceCopy, c);
    copy.accepted = verdict.accepted;
}

void checkCopy(const InputCheck &check, input::SerializedCopy &copy, const ObjectFacts &object)
{
    using Rules = std::span<const Rule<Serialized>>;
    const Serialized c{copy, check.device(), object};
    Verdict verdict;
    if (copy.khr())
        verdict = check.check<Serialized>(copy.saves ? Rules(kKhrSave) : kKhrRestore, c);
    else if (copy.executor == Executor::Host)
        verdict = checkBoth<Serialized>(check, copy.saves ? Rules(kExtSave) : kExtRestore,
                                        copy.saves ? Rules(kExtHostSave) : kExtHostRestore, c);
    else
        verdict = checkBoth<Serialized>(check, copy.saves ? Rules(kExtSave) : kExtRestore,
                                        copy.saves ? Rules(kExtDeviceSave) : kExtDeviceRestore, c);
    copy.accepted = verdict.accepted;
}

void checkQuery(const InputCheck &check, input::PropertyQuery &query, const PoolFacts &pool, const Facts &facts)
{
    Verdict verdict = check.check<Query>(query.khr ? std::span<const Rule<Query>>(kKhrQuery) : kExtQuery,
                                         {query, check.device(), pool});
    if (verdict.accepted || check.device().validating)
        verdict &=
            checkObjects(check, query.khr ? std::span<const Rule<Queried>>(kKhrQueried) : kExtQueried, query, facts);
    query.accepted = verdict.accepted;
}

void checkHostQuery(const InputCheck &check, input::PropertyQuery &query, const Facts &facts)
{
    const PoolFacts none;
    Verdict verdict = check.check<Query>(kHostQuery, {query, check.device(), none});
    if (verdict.accepted || check.device().validating)
        verdict &= checkObjects(check, kHostQueried, query, facts);
    query.accepted = verdict.accepted;
}

bool isMicromapQuery(VkQueryType type)
{
    return type == VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT || type == VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT;
}

bool isStructureQuery(VkQueryType type)
{
    return type == VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR ||
           type == VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR ||
           type == VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SIZE_KHR ||
           type == VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_BOTTOM_LEVEL_POINTERS_KHR;
}

} // namespace vellum::layer::rules
