// What the layer refuses of micromaps as acceleration structures, each by the rule's name.
#include "micromaps/micromap_structures.h"

namespace
{

using namespace vt;

class MicromapStructureRefused : public MicromapStructure
{
protected:
    MicromapStructureRefused() : micromap_(gpu(), eightStates(), kAllow) { micromap_.build(); }
    void TearDown() override
    {
        // Nothing was harmed.
        expectNoMessages();
        EXPECT_EQ(tracedMicromap(micromap_), kForwards);
        MicromapStructure::TearDown();
    }
    // A build, changed, into a target that must stay as it is. `sizes`: they are refused by the same rule, too.
    void expectBuildRefused(const std::string &rule, const std::function<void(StructureBuild &)> &change,
                            bool sizes = false)
    {
        SCOPED_TRACE(rule);
        const Micromap target(gpu(), micromap_, micromap_.size());
        const std::vector<std::uint8_t> before(target.memory(), target.memory() + target.size());
        StructureBuild bad(micromap_.buildInfo(), target.handle().khr);
        change(bad);
        if (sizes) {
            EXPECT_EQ(sizesOf(bad.info).accelerationStructureSize, 0u);
            expectRefused(rule);
        }
        build(bad.info);
        expectRefused(rule);
        EXPECT_EQ(std::vector<std::uint8_t>(target.memory(), target.memory() + target.size()), before);
    }

    Micromap micromap_;
};

TEST_F(MicromapStructureRefused, GeometriesAndUsageCounts)
{
    const std::string info = "VUID-VkAccelerationStructureBuildGeometryInfoKHR-";
    const std::string data = "VUID-VkAccelerationStructureGeometryMicromapDataKHR-";
    const auto refused = [this](const std::string &rule, const std::function<void(StructureBuild &)> &change) {
        expectBuildRefused(rule, change, true);
    };
    refused(info + "geometryCount-11560", [](StructureBuild &b) { b.info.geometryCount = 0; });
    refused("VUID-VkAccelerationStructureGeometryKHR-micromap-11568",
            [](StructureBuild &b) { b.geometry.pNext = nullptr; });
    // A validation layer above reads what is not there (1.4.363 crashes), and hands on a copy with one of two arrays.
    const VkAccelerationStructureGeometryKHR *pointer = nullptr;
    if (validationOfTests() == Validation::Below) {
        refused(info + "geometryCount-11560", [](StructureBuild &b) { b.info.geometryCount = 2; });
        refused(info + "pGeometries-03788", [](StructureBuild &b) { b.info.pGeometries = nullptr; });
        refused(info + "pGeometries-03788", [&pointer](StructureBuild &b) {
            pointer = &b.geometry;
            b.info.ppGeometries = &pointer;
        });
        refused(info + "geometryType-11561",
                [](StructureBuild &b) { b.geometry.geometryType = VK_GEOMETRY_TYPE_TRIANGLES_KHR; });
        refused(data + "pUsageCounts-11642", [](StructureBuild &b) { b.data.pUsageCounts = nullptr; });
    }
    for (const VkBuildAccelerationStructureFlagsKHR flag :
         {VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR, VK_BUILD_ACCELERATION_STRUCTURE_LOW_MEMORY_BIT_KHR})
        refused(info + "flags-11562", [flag](StructureBuild &b) { b.info.flags |= flag; });
    refused(data + "pUsageCounts-11642", [](StructureBuild &b) { b.data.ppUsageCounts = b.usagePointers.data(); });
    refused("VUID-VkMicromapUsageKHR-format-parameter",
            [](StructureBuild &b) { b.usages[0].format = static_cast<VkOpacityMicromapFormatKHR>(3); });
    refused(info + "subdivisionLevel-11564", [](StructureBuild &b) { b.usages[0].subdivisionLevel = 13; });
    refused(data + "subdivisionLevel-11645", [](StructureBuild &b) {
        b.usages[0] = {1, 13, VK_OPACITY_MICROMAP_FORMAT_2_STATE_KHR};
    });
    const VkBuildAccelerationStructureFlagsKHR lossy = VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR;
    refused(info + "format-11712", [lossy](StructureBuild &b) {
        b.info.flags |= lossy;
        b.usages[0].format = VK_OPACITY_MICROMAP_FORMAT_2_STATE_KHR;
    });
    refused(info + "subdivisionLevel-11565", [lossy](StructureBuild &b) {
        b.info.flags |= lossy;
        b.usages[0].subdivisionLevel = 13;
    });
    refused(data + "count-11643", [](StructureBuild &b) { b.usages[0].count = (1u << 27) + 1; });
}

TEST_F(MicromapStructureRefused, BuildsAndTheirMemory)
{
    const std::string command = "VUID-vkCmdBuildAccelerationStructuresKHR-";
    const auto refused = [&](const std::string &rule, const std::function<void(StructureBuild &)> &change) {
        expectBuildRefused(rule, change);
    };
    refused(command + "mode-11545",
            [](StructureBuild &b) { b.info.mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR; });
    const Blas blas(gpu(), {mapped(&micromap_)});
    refused(command + "dstAccelerationStructure-11547",
            [&](StructureBuild &b) { b.info.dstAccelerationStructure = blas.handle(); });
    refused(command + "dstAccelerationStructure-11547",
            [](StructureBuild &b) { b.info.dstAccelerationStructure = VK_NULL_HANDLE; });
    EXPECT_EQ(tracedBottom(blas.address()), kForwards);
    const Placed small(gpu(), kMicromapType, 128);
    refused(command + "pInfos-10126", [&](StructureBuild &b) { b.info.dstAccelerationStructure = small.handle(); });
    refused(command + "micromap-11550", [](StructureBuild &b) { b.data.data = 0; });
    refused(command + "micromap-11550", [](StructureBuild &b) { b.data.triangleArray = 0; });
    refused(command + "micromap-11552", [](StructureBuild &b) { b.data.data += 64; });
    refused(command + "micromap-11552", [](StructureBuild &b) { b.data.triangleArray += 64; });
    refused(command + "pInfos-12261", [](StructureBuild &b) { b.info.scratchData.deviceAddress = 0; });
    refused(command + "pInfos-03710", [](StructureBuild &b) { b.info.scratchData.deviceAddress += 2; });
    const Buffer little(gpu(), 16, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    refused(command + "pInfos-12258", [&](StructureBuild &b) { b.info.scratchData.deviceAddress = little.address(); });
    refused("VUID-VkAccelerationStructureGeometryMicromapDataKHR-triangleArrayStride-11646",
            [](StructureBuild &b) { b.data.triangleArrayStride = 4; });
}

// A build that is refused, beside ones that are done.
TEST_F(MicromapStructureRefused, OneOfSeveral)
{
    Micromap good(gpu(), eightStates(true));
    const Micromap target(gpu(), micromap_, micromap_.size());
    Blas blas(gpu());
    blas.prepare({mapped(&micromap_)});
    StructureBuild bad(micromap_.buildInfo(), target.handle().khr);
    bad.info.mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR;
    const StructureBuild done(good.buildInfo(), good.handle().khr);
    const std::array infos{bad.info, blas.buildInfo(), done.info};
    const std::array<const RangeInfo *, 3> ranges{nullptr, blas.ranges(), nullptr};
    gpu().submit([&](VkCommandBuffer commands) {
        gpu().vk().CmdBuildAccelerationStructuresKHR(commands, 3, infos.data(), ranges.data());
    });
    expectRefused("VUID-vkCmdBuildAccelerationStructuresKHR-mode-11545");
    EXPECT_EQ(tracedBottom(blas.address()), kForwards);
    EXPECT_EQ(tracedMicromap(good), kBackwards);
}

TEST_F(MicromapStructureRefused, GeometriesThatNameThem)
{
    // Built by the same command.
    Micromap fresh(gpu(), eightStates());
    Blas blas(gpu());
    blas.prepare({mapped(&fresh)});
    const StructureBuild translated(fresh.buildInfo(), fresh.handle().khr);
    const std::array infos{translated.info, blas.buildInfo()};
    const std::array<const RangeInfo *, 2> ranges{nullptr, blas.ranges()};
    gpu().submit([&](VkCommandBuffer commands) {
        gpu().vk().CmdBuildAccelerationStructuresKHR(commands, 2, infos.data(), ranges.data());
    });
    expectRefused("VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-11548");
    EXPECT_EQ(tracedMicromap(fresh), kForwards);
    // No micromap.
    const Blas other(gpu(), {mapped(nullptr)});
    tracedMicromap(other.handle());
    expectRefused("VUID-VkAccelerationStructureTrianglesOpacityMicromapKHR-micromap-parameter");
    // A bottom-level build with a micromap for target, or with a micromap's geometry.
    BuildInfo info = blas.buildInfo();
    info.dstAccelerationStructure = micromap_.handle().khr;
    build(info, blas.ranges());
    expectRefused("VUID-VkAccelerationStructureBuildGeometryInfoKHR-dstAccelerationStructure-parameter");
    info = blas.buildInfo();
    info.pGeometries = &translated.geometry;
    build(info, blas.ranges());
    expectRefused("VUID-VkAccelerationStructureBuildGeometryInfoKHR-geometryType-11707");
    EXPECT_EQ(sizesOf(info).accelerationStructureSize, 0u);
    expectRefused("VUID-VkAccelerationStructureBuildGeometryInfoKHR-geometryType-11707");
    // An indirect one.
    const auto indirect = reinterpret_cast<PFN_vkCmdBuildAccelerationStructuresIndirectKHR>(
        vkGetDeviceProcAddr(gpu().device(), "vkCmdBuildAccelerationStructuresIndirectKHR"));
    const Micromap target(gpu(), micromap_, micromap_.size());
    const StructureBuild again(micromap_.buildInfo(), target.handle().khr);
    const VkDeviceAddress address = 0;
    const std::uint32_t stride = 16, most = 1, *counts = &most;
    gpu().submit([&](VkCommandBuffer commands) { indirect(commands, 1, &again.info, &address, &stride, &counts); });
    expectRefused("VUID-vkCmdBuildAccelerationStructuresIndirectKHR-type-11557");
}

TEST_F(MicromapStructureRefused, Copies)
{
    const Blas blas(gpu(), {mapped(&micromap_)});
    const Micromap target(gpu(), micromap_, micromap_.size());
    copy(micromap_.handle().khr, blas.handle());
    expectRefused("copy-type");
    copy(blas.handle(), target.handle().khr);
    expectRefused("copy-type");
    EXPECT_EQ(tracedBottom(blas.address()), kForwards);
    copy(micromap_.handle().khr, target.handle().khr, VK_COPY_ACCELERATION_STRUCTURE_MODE_SERIALIZE_KHR);
    expectRefused("VUID-VkCopyAccelerationStructureInfoKHR-mode-03410");
    const Buffer memory(gpu(), 8192, VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    const auto out = [&](VkDeviceAddress address, VkCopyMicromapModeEXT mode, const char *rule) {
        gpu().submit([&](VkCommandBuffer commands) {
            recordMicromapToMemory(gpu(), commands, micromap_.handle(), address, mode);
        });
        expectRefused(rule);
    };
    const auto in = [&](VkDeviceAddress address, VkCopyMicromapModeEXT mode, const char *rule) {
        gpu().submit(
            [&](VkCommandBuffer commands) { recordMemoryToMicromap(gpu(), commands, address, target.handle(), mode); });
        expectRefused(rule);
    };
    constexpr auto kOut = VK_COPY_MICROMAP_MODE_SERIALIZE_EXT;
    constexpr auto kIn = VK_COPY_MICROMAP_MODE_DESERIALIZE_EXT;
    out(memory.address(), VK_COPY_MICROMAP_MODE_CLONE_EXT,
        "VUID-VkCopyAccelerationStructureToMemoryInfoKHR-mode-03412");
    out(0, kOut, "VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-03739");
    out(memory.address() + 64, kOut, "VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-11699");
    in(memory.address(), VK_COPY_MICROMAP_MODE_CLONE_EXT, "VUID-VkCopyMemoryToAccelerationStructureInfoKHR-mode-03413");
    in(0, kIn, "VUID-vkCmdCopyMemoryToAccelerationStructureKHR-pInfo-03742");
    in(memory.address() + 64, kIn, "VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-11700");
    for (const std::uint8_t byte : memory.as<std::uint8_t>())
        ASSERT_EQ(byte, 0);
    // 128 is enough, where other structures need 256. By 11699 and 11700, that is; 03740 and 03743 except nothing from
    // their 256.
    gpu().breaks("VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-03740");
    gpu().breaks("VUID-vkCmdCopyMemoryToAccelerationStructureKHR-pInfo-03743");
    gpu().submit([&](VkCommandBuffer commands) {
        recordMicromapToMemory(gpu(), commands, micromap_.handle(), memory.address() + 128);
        barrier(commands);
        recordMemoryToMicromap(gpu(), commands, memory.address() + 128, target.handle());
    });
    EXPECT_EQ(tracedMicromap(target), kForwards);
}

TEST_F(MicromapStructureRefused, Creation)
{
    const Buffer memory(gpu(), 4096, kStorage);
    const auto create = [&](VkDeviceAddress address, VkDeviceSize size, const char *rule) {
        for (const VkAccelerationStructureTypeKHR type : {kMicromapType, kGeneric, kBottom, kTop})
            expectCreationRefused(type, {address, size}, rule);
    };
    create(memory.address(), 4097, "VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11603");
    create(memory.address() + 256, ~VkDeviceSize{0}, "VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11603");
    create(memory.address() + 128, 256, "VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11605");
    create(256, 256, "VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11602");
    create(memory.address(), 0, "VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11608");
    const Buffer other(gpu(), 4096, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    create(other.address(), 1024, "VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11603");
    VkAccelerationStructureCreateInfoKHR info{};
    info.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_KHR;
    info.buffer = memory.handle();
    info.size = 1024;
    info.type = kMicromapType;
    VkAccelerationStructureKHR handle = VK_NULL_HANDLE;
    EXPECT_NE(gpu().vk().CreateAccelerationStructureKHR(gpu().device(), &info, nullptr, &handle), VK_SUCCESS);
    EXPECT_EQ(handle, VkAccelerationStructureKHR{});
    expectRefused("VUID-VkAccelerationStructureCreateInfoKHR-type-11600");
}

TEST_F(MicromapStructureRefused, Queries)
{
    constexpr auto kSize = VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR;
    const QueryPool pool(gpu(), kSize, 2);
    vkResetQueryPool(gpu().device(), pool, 0, 2);
    const auto refused = [&](VkAccelerationStructureKHR second, VkQueryType type, const char *rule) {
        const std::array structures{micromap_.handle().khr, second};
        gpu().submit([&](VkCommandBuffer commands) {
            gpu().vk().CmdWriteAccelerationStructuresPropertiesKHR(commands, 2, structures.data(), type, pool, 0);
        });
        expectRefused(rule);
    };
    refused(micromap_.handle().khr, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR,
            "VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-queryPool-02493");
    refused(VK_NULL_HANDLE, kSize,
            "VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-pAccelerationStructures-parameter");
    std::uint64_t value = 0;
    EXPECT_EQ(vkGetQueryPoolResults(gpu().device(), pool, 0, 1, 8, &value, 8, VK_QUERY_RESULT_64_BIT), VK_NOT_READY);
}

// Refused, not handed to the driver, to which micromaps and query types of the layer's mean nothing.
TEST_F(MicromapStructureRefused, QueryPoolsOfOtherTypes)
{
    const auto write = [&](VkQueryType poolType, VkQueryType type) {
        const QueryPool pool(gpu(), poolType, 2);
        const Blas blas(gpu(), {mapped(nullptr)});
        const std::array structures{micromap_.handle().khr, blas.handle()};
        gpu().submit([&](VkCommandBuffer commands) {
            vkCmdResetQueryPool(commands, pool, 0, 2);
            gpu().vk().CmdWriteAccelerationStructuresPropertiesKHR(commands, 2, structures.data(), type, pool, 0);
        });
    };
    constexpr auto kSize = VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR;
    write(VK_QUERY_TYPE_OCCLUSION, kSize);
    expectRefused("VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-queryPool-02493");
    for (const VkQueryType type : {VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT, VK_QUERY_TYPE_OCCLUSION}) {
        write(type, type);
        expectRefused("VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-queryType-06742");
    }
}

// What only a micromap's build may leave out: VUID-vkCmdBuildAccelerationStructuresKHR-ppBuildRangeInfos-11543.
TEST_F(MicromapStructureRefused, NoRangesOfABottomLevelStructure)
{
    if (validationOfTests() == Validation::Above)
        GTEST_SKIP() << "validation 1.4.363 reads the ranges";
    Blas blas(gpu());
    blas.prepare({mapped(&micromap_)});
    build(blas.buildInfo(), nullptr);
    expectRefused("VUID-vkCmdBuildAccelerationStructuresKHR-ppBuildRangeInfos-11543");
}

// As the structure that is updated; a build ignores it.
TEST_F(MicromapStructureRefused, SourceOfAnUpdate)
{
    Blas blas(gpu());
    blas.prepare({mapped(&micromap_)}, VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR);
    BuildInfo info = blas.buildInfo();
    info.srcAccelerationStructure = micromap_.handle().khr;
    build(info, blas.ranges());
    expectNoMessages();
    info.mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR;
    build(info, blas.ranges());
    expectRefused("VUID-vkCmdBuildAccelerationStructuresKHR-srcAccelerationStructure-04629");
    info.srcAccelerationStructure = VK_NULL_HANDLE;
    build(info, blas.ranges());
    expectRefused("VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-04630");
    EXPECT_EQ(tracedBottom(blas.address()), kForwards);
}

// A loader that does not know the extensions gives their commands by instance only where the manifest names them.
TEST_F(MicromapStructure, CommandsOfTheInstance)
{
    for (const char *name :
         {"vkCreateMicromapEXT", "vkCreateAccelerationStructure2KHR", "vkCmdCopyMemoryKHR", "vkCmdBindIndexBuffer3KHR",
          "vkCmdCopyQueryPoolResultsToMemoryKHR", "vkCmdDrawMeshTasksIndirect2EXT", "vkCmdWriteMarkerToMemoryAMD"})
        EXPECT_NE(vkGetInstanceProcAddr(gpu().instance(), name), nullptr) << name;
    const auto create = reinterpret_cast<PFN_vkCreateAccelerationStructure2KHR>(
        vkGetInstanceProcAddr(gpu().instance(), "vkCreateAccelerationStructure2KHR"));
    ASSERT_NE(create, nullptr);
    const Buffer memory(gpu(), 4096, kStorage);
    VkAccelerationStructureCreateInfo2KHR info{};
    info.sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_2_KHR;
    info.addressRange = {memory.address(), 4096};
    info.type = kMicromapType;
    VkAccelerationStructureKHR structure = VK_NULL_HANDLE;
    EXPECT_EQ(create(gpu().device(), &info, nullptr, &structure), VK_SUCCESS);
    gpu().vk().DestroyAccelerationStructureKHR(gpu().device(), structure, nullptr);
}

} // namespace
