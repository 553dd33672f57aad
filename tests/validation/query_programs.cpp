// SPDX-License-Identifier: Apache-2.0
// Wrong queries of sizes of micromaps.
#include "recorded.h"

namespace vt
{
namespace
{

constexpr VkBuildMicromapFlagsEXT kAllow = VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT;
constexpr VkQueryType kCompacted = VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT;
constexpr VkQueryType kSerialized = VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT;

// A query of one micromap.
struct Query {
    VkQueryType type = kSerialized;
    VkQueryType poolType = kSerialized;
    uint32_t first = 0;
    bool reset = true;
    bool neverBuilt = false;
    bool allowsCompaction = true;
    bool destroyed = false; // the pool
    bool execute = false;   // the wrong one as well: it does no harm
};

template <Query change, Query right = Query{}>
void query(Gpu &gpu, bool wrong)
{
    const Query used = wrong ? change : right;
    const Twins twins(gpu, used.allowsCompaction ? kAllow : 0);
    const MicromapHandle micromap = used.neverBuilt ? twins.other : twins.built;
    QueryPool pool(gpu, micromapQueryType(gpu, used.poolType), 2);
    vkResetQueryPool(gpu.device(), pool, 0, 2);
    const VkQueryPool handle = pool;
    if (used.destroyed)
        pool = QueryPool();
    const auto write = [&](VkCommandBuffer commands) {
        recordMicromapProperties(gpu, commands, std::span(&micromap, 1), micromapQueryType(gpu, used.type), handle,
                                 used.first);
    };
    if (!used.reset) {
        gpu.submit(write);
    }
    recordUnlessWrong(gpu, wrong && !used.execute, write);
}

// The first use of a query that was reset when its pool was created (VK_KHR_maintenance9), or never.
void neverReset(Gpu &gpu, bool wrong)
{
    constexpr VkQueryPoolCreateFlags kResetAtCreation = 1;
    const Twins twins(gpu);
    const auto info = vkInit<VkQueryPoolCreateInfo>(
        {.flags = wrong ? 0 : kResetAtCreation, .queryType = micromapQueryType(gpu, kSerialized), .queryCount = 1});
    VkQueryPool pool = VK_NULL_HANDLE;
    VT_CHECK(vkCreateQueryPool(gpu.device(), &info, nullptr, &pool));
    gpu.submit([&](VkCommandBuffer commands) {
        recordMicromapProperties(gpu, commands, std::span(&twins.built, 1), info.queryType, pool, 0);
    });
    vkDestroyQueryPool(gpu.device(), pool, nullptr);
}

void unbound(Gpu &gpu, bool wrong)
{
    const Twins twins(gpu);
    const PerhapsUnbound unbound(gpu, wrong);
    const MicromapHandle object = wrong ? unbound.object : twins.built;
    const VkQueryType type = micromapQueryType(gpu, kSerialized);
    const QueryPool pool(gpu, type);
    recordUnlessWrong(gpu, true, [&](VkCommandBuffer commands) {
        recordMicromapProperties(gpu, commands, std::span(&object, 1), type, pool, 0);
    });
}

// The pointers of a structure, which only a top-level one has.
void pointers(Gpu &gpu, bool wrong)
{
    const Blas blas(gpu, {Geometry{.vertices = triangleRow(1)}});
    const Tlas tlas(gpu, {instance(blas, {}, 0)});
    constexpr auto kType = VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_BOTTOM_LEVEL_POINTERS_KHR;
    const QueryPool pool(gpu, kType);
    vkResetQueryPool(gpu.device(), pool, 0, 1);
    const VkAccelerationStructureKHR structure = wrong ? blas.handle() : tlas.handle();
    recordUnlessWrong(gpu, true, [&](VkCommandBuffer commands) {
        gpu.vk().CmdWriteAccelerationStructuresPropertiesKHR(commands, 1, &structure, kType, pool, 0);
    });
}

void begin(Gpu &gpu, bool wrong)
{
    const QueryPool sizes(gpu, kCompacted, 1), occlusion(gpu, VK_QUERY_TYPE_OCCLUSION, 1);
    vkResetQueryPool(gpu.device(), occlusion, 0, 1);
    recordUnlessWrong(gpu, wrong, [&](VkCommandBuffer commands) {
        const VkQueryPool pool = wrong ? sizes : occlusion;
        vkCmdBeginQuery(commands, pool, 0, 0);
        vkCmdEndQuery(commands, pool, 0);
    });
}

void beginIndexed(Gpu &gpu, bool wrong)
{
    const QueryPool sizes(gpu, kCompacted, 1), occlusion(gpu, VK_QUERY_TYPE_OCCLUSION, 1);
    const auto beginQuery =
        reinterpret_cast<PFN_vkCmdBeginQueryIndexedEXT>(vkGetDeviceProcAddr(gpu.device(), "vkCmdBeginQueryIndexedEXT"));
    recordUnlessWrong(gpu, true, [&](VkCommandBuffer commands) {
        const VkQueryPool pool = wrong ? sizes : occlusion;
        beginQuery(commands, pool, 0, 0, 0);
        vkCmdEndQuery(commands, pool, 0);
    });
}

constexpr Query kWrongType{.type = VK_QUERY_TYPE_OCCLUSION, .poolType = VK_QUERY_TYPE_OCCLUSION};
constexpr Query kWrongPool{.poolType = kCompacted};
constexpr Query kNoPool{.destroyed = true};
constexpr Query kPastThePool{.first = 2};
constexpr Query kAvailable{.reset = false, .execute = true};
constexpr Query kNeverBuilt{.neverBuilt = true, .execute = true};
constexpr Query kCompactedSize{.type = kCompacted, .poolType = kCompacted};
constexpr Query kNotAllowed{.type = kCompacted, .poolType = kCompacted, .allowsCompaction = false, .execute = true};

const WrongProgram kPrograms[] = {
    {"VUID-vkCmdWriteMicromapsPropertiesEXT-queryType-07503", Api::Ext, kNeedsNothing, query<kWrongType>},
    {"VUID-vkCmdWriteMicromapsPropertiesEXT-queryPool-07525", Api::Ext, kNeedsNothing, query<kWrongPool>},
    {"VUID-vkCmdWriteMicromapsPropertiesEXT-queryPool-parameter", Api::Ext, kNeedsNothing, query<kNoPool>},
    {"VUID-vkCmdWriteMicromapsPropertiesEXT-query-07528", Api::Ext, kNeedsNothing, query<kPastThePool>},
    {"VUID-vkCmdWriteMicromapsPropertiesEXT-None-12417", Api::Ext, kNeedsNothing, query<kAvailable>},
    {"VUID-vkCmdWriteMicromapsPropertiesEXT-None-12417", Api::Ext, kNeedsNothing, neverReset, "NeverReset"},
    {"VUID-vkCmdWriteMicromapsPropertiesEXT-pMicromaps-11662", Api::Ext, kNeedsNothing, query<kNeverBuilt>},
    {"VUID-vkCmdWriteMicromapsPropertiesEXT-pMicromaps-07502", Api::Ext, kNeedsNothing,
     query<kNotAllowed, kCompactedSize>},
    {"VUID-vkCmdWriteMicromapsPropertiesEXT-buffer-07527", Api::Ext, kNeedsNothing, unbound},
    {"VUID-vkCmdBeginQuery-queryType-08972", Api::Ext, kNeedsNothing, begin},
    {"VUID-vkCmdBeginQueryIndexedEXT-queryType-08972", Api::Ext, kNeedsAddressCommands, beginIndexed},

    {"VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-queryType-06742", Api::Khr, kNeedsNothing, query<kWrongType>},
    {"VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-queryPool-02493", Api::Khr, kNeedsNothing, query<kWrongPool>},
    {"VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-queryPool-parameter", Api::Khr, kNeedsNothing, query<kNoPool>},
    {"VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-query-04880", Api::Khr, kNeedsNothing, query<kPastThePool>},
    {"VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-queryPool-02494", Api::Khr, kNeedsNothing, query<kAvailable>},
    {"VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-queryPool-02494", Api::Khr, kNeedsNothing, neverReset,
     "NeverReset"},
    {"VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-pAccelerationStructures-11684", Api::Khr, kNeedsNothing,
     query<kNeverBuilt>},
    {"VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-buffer-03736", Api::Khr, kNeedsNothing, unbound, "", "", false,
     nullptr, "VELLUM-unknown-content"},
    {"VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-pAccelerationStructures-12425", Api::Khr, kNeedsNothing,
     pointers},
    {"VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-accelerationStructures-03431", Api::Khr, kNeedsNothing,
     query<kNotAllowed, kCompactedSize>},
};

} // namespace

std::span<const WrongProgram> queryPrograms()
{
    return kPrograms;
}

} // namespace vt
