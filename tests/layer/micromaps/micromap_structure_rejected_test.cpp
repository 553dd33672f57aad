// SPDX-License-Identifier: Apache-2.0
// Rules for micromaps as acceleration structures: the layer names each rule, and rejects the command or, unless
// VELLUM_STRICT is set, tolerates the violation.
#include "harness/program/labels.h"
#include "micromaps/micromap_structures.h"

namespace
{

const vt::Labels kMicromapStructureRejectedLabels{{"MicromapStructureRejected.*", "one_api stacked strict_ext"},
                                                  {"MicromapStructureRejected.Copies", "lenient"},
                                                  {"MicromapStructureRejected.Creation", "lenient"},
                                                  {"MicromapStructureRejected.GeometriesAndUsageCounts", "lenient"}};

using namespace vt;

class MicromapStructureRejected : public MicromapStructure
{
protected:
    MicromapStructureRejected() : micromap_(gpu(), eightStates(), kAllow) { micromap_.build(); }
    void TearDown() override
    {
        // The memory is unchanged.
        expectNoMessages();
        EXPECT_EQ(tracedMicromap(micromap_), kForwards);
        MicromapStructure::TearDown();
    }
    // A build, changed, into a target that must stay as it is. `sizes`: they are rejected by the same rule, too.
    void expectBuildRejected(const std::string &rule, const std::function<void(StructureBuild &)> &change,
                             bool sizes = false)
    {
        SCOPED_TRACE(rule);
        const Micromap target(gpu(), micromap_, micromap_.size());
        const std::vector<uint8_t> before(target.memory(), target.memory() + target.size());
        StructureBuild bad(micromap_.buildInfo(), target.handle().khr);
        change(bad);
        if (sizes) {
            EXPECT_EQ(sizesOf(bad.info).accelerationStructureSize, 0u);
            expectRejected(rule);
        }
        build(bad.info);
        expectRejected(rule);
        EXPECT_EQ(std::vector<uint8_t>(target.memory(), target.memory() + target.size()), before);
    }

    // A structure that a strict layer does not create.
    void expectUsable(VkAccelerationStructureKHR handle)
    {
        EXPECT_EQ(handle == VK_NULL_HANDLE, strictTests());
        if (handle == VK_NULL_HANDLE)
            return;
        buildInto(micromap_, handle);
        EXPECT_EQ(tracedMicromap(handle), kForwards);
        expectNoMessages();
        gpu().vk().DestroyAccelerationStructureKHR(gpu().device(), handle, nullptr);
    }
    // A tolerated vkCreateAccelerationStructure2KHR, which a strict layer rejects.
    void expectCreationDone(VkAccelerationStructureTypeKHR type, const VkDeviceAddressRangeKHR &range,
                            const std::string &rule)
    {
        if (strictTests())
            return expectCreationRejected(type, range, rule);
        auto info = vkInit<VkAccelerationStructureCreateInfo2KHR>(
            {.addressRange = range, .addressFlags = kUnknownUsage, .type = type});
        VkAccelerationStructureKHR handle = VK_NULL_HANDLE;
        EXPECT_EQ(gpu().vk().CreateAccelerationStructure2KHR(gpu().device(), &info, nullptr, &handle), VK_SUCCESS);
        expectRejected(rule);
        if (type == kMicromapType)
            expectUsable(handle);
        else
            gpu().vk().DestroyAccelerationStructureKHR(gpu().device(), handle, nullptr);
    }
    // A build, changed, that does no harm: rejected by a strict layer, otherwise reported once and done. `expected`: of
    // the first triangles.
    void expectBuildDone(const std::string &rule, const std::function<void(StructureBuild &)> &change,
                         bool sizes = false, const std::vector<int> &expected = kForwards)
    {
        if (strictTests())
            return expectBuildRejected(rule, change, sizes);
        SCOPED_TRACE(rule);
        const Micromap target(gpu(), micromap_, micromap_.size() + 4096);
        StructureBuild odd(micromap_.buildInfo(), target.handle().khr);
        const VkDeviceSize size = sizesOf(odd.info).accelerationStructureSize;
        change(odd);
        if (sizes) {
            EXPECT_GE(sizesOf(odd.info).accelerationStructureSize, size);
            expectRejected(rule);
        }
        build(odd.info);
        expectRejected(rule); // reported
        std::vector<int> seen = tracedMicromap(target);
        seen.resize(expected.size());
        EXPECT_EQ(seen, expected);
        expectNoMessages();
    }

    Micromap micromap_;
};

TEST_F(MicromapStructureRejected, GeometriesAndUsageCounts)
{
    const std::string info = "VUID-VkAccelerationStructureBuildGeometryInfoKHR-";
    const std::string data = "VUID-VkAccelerationStructureGeometryMicromapDataKHR-";
    const auto rejected = [this](const std::string &rule, const std::function<void(StructureBuild &)> &change) {
        expectBuildRejected(rule, change, true);
    };
    const auto done = [this](const std::string &rule, const std::function<void(StructureBuild &)> &change) {
        expectBuildDone(rule, change, true);
    };
    rejected(info + "geometryCount-11560", [](StructureBuild &b) { b.info.geometryCount = 0; });
    rejected("VUID-VkAccelerationStructureGeometryKHR-micromap-11568",
             [](StructureBuild &b) { b.geometry.pNext = nullptr; });
    // A validation layer above reads what is not there (1.4.363 crashes), and hands on a copy with one of two arrays.
    const VkAccelerationStructureGeometryKHR *pointer = nullptr;
    if (validationOfTests() == Validation::Below) {
        done(info + "geometryCount-11560", [](StructureBuild &b) { b.info.geometryCount = 2; });
        rejected(info + "pGeometries-03788", [](StructureBuild &b) { b.info.pGeometries = nullptr; });
        done(info + "pGeometries-03788", [&pointer](StructureBuild &b) {
            pointer = &b.geometry;
            b.info.ppGeometries = &pointer;
        });
        done(info + "geometryType-11561",
             [](StructureBuild &b) { b.geometry.geometryType = VK_GEOMETRY_TYPE_TRIANGLES_KHR; });
        rejected(data + "pUsageCounts-11642", [](StructureBuild &b) { b.data.pUsageCounts = nullptr; });
    }
    for (const VkBuildAccelerationStructureFlagsKHR flag :
         {VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR, VK_BUILD_ACCELERATION_STRUCTURE_LOW_MEMORY_BIT_KHR})
        done(info + "flags-11562", [flag](StructureBuild &b) { b.info.flags |= flag; });
    done(data + "pUsageCounts-11642", [](StructureBuild &b) { b.data.ppUsageCounts = b.usagePointers.data(); });
    done("VUID-VkMicromapUsageKHR-format-parameter",
         [](StructureBuild &b) { b.usages[0].format = static_cast<VkOpacityMicromapFormatKHR>(3); });
    rejected(info + "subdivisionLevel-11564", [](StructureBuild &b) { b.usages[0].subdivisionLevel = 13; });
    rejected(data + "subdivisionLevel-11645", [](StructureBuild &b) {
        b.usages[0] = {1, 13, VK_OPACITY_MICROMAP_FORMAT_2_STATE_KHR};
    });
    const VkBuildAccelerationStructureFlagsKHR lossy = VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR;
    // A count of no triangles, at a level that does not exist.
    done(info + "subdivisionLevel-11564", [](StructureBuild &b) {
        b.usages.push_back({0, 1u << 31, VK_OPACITY_MICROMAP_FORMAT_4_STATE_KHR});
        b.data.pUsageCounts = b.usages.data();
        b.data.usageCountsCount = 2;
    });
    rejected(info + "subdivisionLevel-11565", [lossy](StructureBuild &b) {
        b.info.flags |= lossy;
        b.usages[0].subdivisionLevel = 13;
    });
    // More than the limit, but not more than can be built.
    const Micromap target(gpu(), micromap_, micromap_.size());
    StructureBuild large(micromap_.buildInfo(), target.handle().khr);
    large.usages[0].count = (1u << 27) + 1;
    EXPECT_EQ(sizesOf(large.info).accelerationStructureSize == 0, strictTests());
    expectRejected(data + "count-11643");
    large.usages[0].count = 1u << 31;
    EXPECT_EQ(sizesOf(large.info).accelerationStructureSize, 0u);
    EXPECT_EQ(gpu().takeUnexpectedMessages().back().id,
              strictTests() ? "VELLUM-" + data + "count-11643" : "VELLUM-micromap-too-large");
}

// 2-state triangles stay as they are in a lossy build.
TEST_F(MicromapStructureRejected, LossyOfTwoStates)
{
    MicromapInput input;
    for (uint8_t i = 0; i < 8; ++i)
        input.add(4, kTwoState, std::vector<uint8_t>(256, i % 2));
    const Micromap ordinary(gpu(), input);
    const Micromap target(gpu(), ordinary, ordinary.size());
    StructureBuild lossy(ordinary.buildInfo(), target.handle().khr);
    lossy.info.flags |= VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR;
    const VkAccelerationStructureBuildSizesInfoKHR sizes = sizesOf(lossy.info);
    expectRejected("VUID-VkAccelerationStructureBuildGeometryInfoKHR-format-11712");
    const Buffer scratch(gpu(), sizes.buildScratchSize + 256,
                         VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    lossy.info.scratchData.deviceAddress = (scratch.address() + 255) / 256 * 256;
    build(lossy.info);
    expectRejected("VUID-VkAccelerationStructureBuildGeometryInfoKHR-format-11712");
    if (!strictTests()) {
        EXPECT_EQ(tracedMicromap(target), (std::vector{0, 1, 0, 1, 0, 1, 0, 1}));
    }
}

TEST_F(MicromapStructureRejected, BuildsAndTheirMemory)
{
    const std::string command = "VUID-vkCmdBuildAccelerationStructuresKHR-";
    const auto rejected = [&](const std::string &rule, const std::function<void(StructureBuild &)> &change) {
        expectBuildRejected(rule, change);
    };
    const auto done = [&](const std::string &rule, const std::function<void(StructureBuild &)> &change,
                          const std::vector<int> &expected = kForwards) {
        expectBuildDone(rule, change, false, expected);
    };
    done(command + "mode-11545",
         [](StructureBuild &b) { b.info.mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR; });
    const Blas blas(gpu(), {mapped(&micromap_)});
    rejected(command + "dstAccelerationStructure-11547",
             [&](StructureBuild &b) { b.info.dstAccelerationStructure = blas.handle(); });
    rejected(command + "dstAccelerationStructure-03800",
             [](StructureBuild &b) { b.info.dstAccelerationStructure = VK_NULL_HANDLE; });
    EXPECT_EQ(tracedBottom(blas.address()), kForwards);
    const Placed small(gpu(), kMicromapType, 128);
    rejected(command + "pInfos-10126", [&](StructureBuild &b) { b.info.dstAccelerationStructure = small.handle(); });
    rejected(command + "micromap-11550", [](StructureBuild &b) { b.data.data = 0; });
    rejected(command + "micromap-11550", [](StructureBuild &b) { b.data.triangleArray = 0; });
    // Each triangle has the data of the next one.
    done(command + "micromap-11552", [](StructureBuild &b) { b.data.data += 64; }, {1, 2, 2, 0, 1, 2, 2});
    done(command + "micromap-11552", [](StructureBuild &b) { b.data.triangleArray += 8; }, {1, 2, 2, 0, 1, 2, 2});
    rejected(command + "pInfos-12261", [](StructureBuild &b) { b.info.scratchData.deviceAddress = 0; });
    rejected(command + "pInfos-03710", [](StructureBuild &b) { b.info.scratchData.deviceAddress += 2; });
    const Buffer little(gpu(), 16, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    rejected(command + "pInfos-12258", [&](StructureBuild &b) { b.info.scratchData.deviceAddress = little.address(); });
    // The stride is too small: every other record is invalid.
    done("VUID-VkAccelerationStructureGeometryMicromapDataKHR-triangleArrayStride-11646",
         [](StructureBuild &b) { b.data.triangleArrayStride = 4; }, {0, 2, 1, 2, 2, 2, 2, 2});
}

// One rejected build among valid ones.
TEST_F(MicromapStructureRejected, OneOfSeveral)
{
    Micromap good(gpu(), eightStates(true));
    const Micromap target(gpu(), micromap_, micromap_.size());
    Blas blas(gpu());
    blas.prepare({mapped(&micromap_)});
    StructureBuild bad(micromap_.buildInfo(), target.handle().khr);
    bad.info.geometryCount = 0;
    const StructureBuild done(good.buildInfo(), good.handle().khr);
    const std::array infos{bad.info, blas.buildInfo(), done.info};
    const std::array<const RangeInfo *, 3> ranges{nullptr, blas.ranges(), nullptr};
    gpu().submit([&](VkCommandBuffer commands) {
        gpu().vk().CmdBuildAccelerationStructuresKHR(commands, 3, infos.data(), ranges.data());
    });
    expectRejected("VUID-VkAccelerationStructureBuildGeometryInfoKHR-geometryCount-11560");
    EXPECT_EQ(tracedBottom(blas.address()), kForwards);
    EXPECT_EQ(tracedMicromap(good), kBackwards);
}

TEST_F(MicromapStructureRejected, GeometriesThatNameThem)
{
    // Built by the same command: here, before the structure.
    Micromap fresh(gpu(), eightStates());
    Blas blas(gpu());
    blas.prepare({mapped(&fresh)});
    const StructureBuild translated(fresh.buildInfo(), fresh.handle().khr);
    const std::array infos{translated.info, blas.buildInfo()};
    const std::array<const RangeInfo *, 2> ranges{nullptr, blas.ranges()};
    gpu().submit([&](VkCommandBuffer commands) {
        gpu().vk().CmdBuildAccelerationStructuresKHR(commands, 2, infos.data(), ranges.data());
    });
    expectRejected("VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-11548");
    if (!strictTests()) {
        EXPECT_EQ(tracedBottom(blas.address()), kForwards);
    }
    EXPECT_EQ(tracedMicromap(fresh), kForwards);
    // A geometry with a null micromap.
    const Blas other(gpu(), {mapped(nullptr)});
    tracedMicromap(other.handle());
    expectRejected("VUID-VkAccelerationStructureTrianglesOpacityMicromapKHR-micromap-parameter");
    // A bottom-level build with a micromap for target, or with a micromap's geometry.
    BuildInfo info = blas.buildInfo();
    info.dstAccelerationStructure = micromap_.handle().khr;
    build(info, blas.ranges());
    expectRejected("VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03700");
    info = blas.buildInfo();
    info.pGeometries = &translated.geometry;
    build(info, blas.ranges());
    expectRejected("VUID-VkAccelerationStructureBuildGeometryInfoKHR-geometryType-11707");
    EXPECT_EQ(sizesOf(info).accelerationStructureSize, 0u);
    expectRejected("VUID-VkAccelerationStructureBuildGeometryInfoKHR-geometryType-11707");
    // An indirect one.
    const auto indirect = reinterpret_cast<PFN_vkCmdBuildAccelerationStructuresIndirectKHR>(
        vkGetDeviceProcAddr(gpu().device(), "vkCmdBuildAccelerationStructuresIndirectKHR"));
    const Micromap target(gpu(), micromap_, micromap_.size());
    const StructureBuild again(micromap_.buildInfo(), target.handle().khr);
    const VkDeviceAddress address = 0;
    const uint32_t stride = 16, most = 1, *counts = &most;
    gpu().submit([&](VkCommandBuffer commands) { indirect(commands, 1, &again.info, &address, &stride, &counts); });
    expectRejected("VUID-vkCmdBuildAccelerationStructuresIndirectKHR-type-11557");
    EXPECT_EQ(tracedMicromap(target), strictTests() ? kPlain : kForwards);
}

TEST_F(MicromapStructureRejected, Copies)
{
    const Blas blas(gpu(), {mapped(&micromap_)});
    const Micromap target(gpu(), micromap_, micromap_.size());
    copy(micromap_.handle().khr, blas.handle());
    expectRejected("copy-type");
    copy(blas.handle(), target.handle().khr);
    expectRejected("copy-type");
    EXPECT_EQ(tracedBottom(blas.address()), kForwards);
    copy(micromap_.handle().khr, target.handle().khr, VK_COPY_ACCELERATION_STRUCTURE_MODE_SERIALIZE_KHR);
    expectRejected("VUID-VkCopyAccelerationStructureInfoKHR-mode-03410");
    EXPECT_EQ(tracedMicromap(target), strictTests() ? kPlain : kForwards);
    const Buffer memory(gpu(), 8192, VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    const auto out = [&](VkDeviceAddress address, VkCopyMicromapModeEXT mode, const char *rule) {
        gpu().submit([&](VkCommandBuffer commands) {
            recordMicromapToMemory(gpu(), commands, micromap_.handle(), address, mode);
        });
        expectRejected(rule);
    };
    const auto in = [&](VkDeviceAddress address, VkCopyMicromapModeEXT mode, const char *rule) {
        gpu().submit(
            [&](VkCommandBuffer commands) { recordMemoryToMicromap(gpu(), commands, address, target.handle(), mode); });
        expectRejected(rule);
    };
    constexpr auto kOut = VK_COPY_MICROMAP_MODE_SERIALIZE_EXT;
    constexpr auto kIn = VK_COPY_MICROMAP_MODE_DESERIALIZE_EXT;
    out(0, kOut, "VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-03739");
    out(memory.address() + 8, kOut, "VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-11699");
    in(0, kIn, "VUID-vkCmdCopyMemoryToAccelerationStructureKHR-pInfo-03742");
    in(memory.address() + 8, kIn, "VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-11700");
    for (const uint8_t byte : memory.as<uint8_t>())
        ASSERT_EQ(byte, 0);
    // Modes that these commands do not have, and addresses that are aligned enough for the layer.
    const auto outAndIn = [&](VkDeviceAddress address, VkCopyMicromapModeEXT save, VkCopyMicromapModeEXT load,
                              const char *outRule, const char *inRule) {
        std::memset(memory.bytes(), 0, static_cast<size_t>(memory.size()));
        target.forget();
        out(address, save, outRule);
        in(address, load, inRule);
        EXPECT_EQ(tracedMicromap(target), strictTests() ? kPlain : kForwards);
    };
    outAndIn(memory.address(), VK_COPY_MICROMAP_MODE_CLONE_EXT, VK_COPY_MICROMAP_MODE_CLONE_EXT,
             "VUID-VkCopyAccelerationStructureToMemoryInfoKHR-mode-03412",
             "VUID-VkCopyMemoryToAccelerationStructureInfoKHR-mode-03413");
    outAndIn(memory.address() + 16, kOut, kIn, "VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-11699",
             "VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-11700");
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

TEST_F(MicromapStructureRejected, Creation)
{
    const Buffer memory(gpu(), 4096, kStorage);
    constexpr std::array kTypes{kMicromapType, kGeneric, kBottom, kTop};
    const auto create = [&](VkDeviceAddress address, VkDeviceSize size, const char *rule) {
        for (const VkAccelerationStructureTypeKHR type : kTypes)
            expectCreationRejected(type, {address, size}, rule);
    };
    // The part in the buffer may be enough, and drivers ignore the buffer's usage.
    constexpr const char *kInBuffer = "VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11603";
    for (const VkAccelerationStructureTypeKHR type : kTypes) {
        expectCreationDone(type, {memory.address(), 4097}, kInBuffer);
        expectCreationDone(type, {memory.address() + 256, ~VkDeviceSize{0}}, kInBuffer);
    }
    constexpr const char *kAligned = "VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11605";
    for (const VkAccelerationStructureTypeKHR type : {kGeneric, kBottom, kTop})
        expectCreationRejected(type, {memory.address() + 128, 256}, kAligned);
    expectCreationRejected(kMicromapType, {memory.address() + 8, 256}, kAligned);
    expectCreationDone(kMicromapType, {memory.address() + 16, 1024}, kAligned);
    create(256, 256, "VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11602");
    create(memory.address(), 0, "VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11608");
    const Buffer other(gpu(), 4096, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    expectCreationDone(kMicromapType, {other.address(), 1024}, kInBuffer);
    auto info =
        vkInit<VkAccelerationStructureCreateInfoKHR>({.buffer = memory.handle(), .size = 1024, .type = kMicromapType});
    VkAccelerationStructureKHR handle = VK_NULL_HANDLE;
    constexpr const char *kOtherCommand = "VUID-VkAccelerationStructureCreateInfoKHR-type-11600";
    EXPECT_EQ(gpu().vk().CreateAccelerationStructureKHR(gpu().device(), &info, nullptr, &handle) == VK_SUCCESS,
              !strictTests());
    expectRejected(kOtherCommand);
    expectUsable(handle);
    handle = VK_NULL_HANDLE;
    info.offset = 4096;
    EXPECT_NE(gpu().vk().CreateAccelerationStructureKHR(gpu().device(), &info, nullptr, &handle), VK_SUCCESS);
    EXPECT_EQ(handle, VkAccelerationStructureKHR{});
    expectRejected(kOtherCommand);
}

TEST_F(MicromapStructureRejected, Queries)
{
    constexpr auto kSize = VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR;
    const QueryPool pool(gpu(), kSize, 2);
    vkResetQueryPool(gpu().device(), pool, 0, 2);
    const auto rejected = [&](VkAccelerationStructureKHR second, VkQueryType type, const char *rule) {
        const std::array structures{micromap_.handle().khr, second};
        gpu().submit([&](VkCommandBuffer commands) {
            gpu().vk().CmdWriteAccelerationStructuresPropertiesKHR(commands, 2, structures.data(), type, pool, 0);
        });
        expectRejected(rule);
    };
    rejected(micromap_.handle().khr, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR,
             "VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-queryPool-02493");
    rejected(VK_NULL_HANDLE, kSize,
             "VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-pAccelerationStructures-parameter");
    uint64_t value = 0;
    EXPECT_EQ(vkGetQueryPoolResults(gpu().device(), pool, 0, 1, 8, &value, 8, VK_QUERY_RESULT_64_BIT), VK_NOT_READY);
}

// Rejected, not handed to the driver, to which micromaps and query types of the layer's mean nothing.
TEST_F(MicromapStructureRejected, QueryPoolsOfOtherTypes)
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
    expectRejected("VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-queryPool-02493");
    for (const VkQueryType type : {VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT, VK_QUERY_TYPE_OCCLUSION}) {
        write(type, type);
        expectRejected("VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-queryType-06742");
    }
}

// Only builds of micromaps may omit the ranges: VUID-vkCmdBuildAccelerationStructuresKHR-ppBuildRangeInfos-11543.
TEST_F(MicromapStructureRejected, NoRangesOfABottomLevelStructure)
{
    if (validationOfTests() == Validation::Above)
        GTEST_SKIP() << "validation 1.4.363 reads the ranges";
    Blas blas(gpu());
    blas.prepare({mapped(&micromap_)});
    build(blas.buildInfo(), nullptr);
    expectRejected("VUID-vkCmdBuildAccelerationStructuresKHR-ppBuildRangeInfos-11543");
}

// The structure as source of an update; a build ignores it.
TEST_F(MicromapStructureRejected, SourceOfAnUpdate)
{
    Blas blas(gpu());
    blas.prepare({mapped(&micromap_)}, VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR);
    BuildInfo info = blas.buildInfo();
    info.srcAccelerationStructure = micromap_.handle().khr;
    build(info, blas.ranges());
    expectNoMessages();
    info.mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR;
    build(info, blas.ranges());
    expectRejected("VUID-vkCmdBuildAccelerationStructuresKHR-srcAccelerationStructure-04629");
    info.srcAccelerationStructure = VK_NULL_HANDLE;
    build(info, blas.ranges());
    expectRejected("VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-04630");
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
    auto info = vkInit<VkAccelerationStructureCreateInfo2KHR>(
        {.addressRange = {memory.address(), 4096}, .type = kMicromapType});
    VkAccelerationStructureKHR structure = VK_NULL_HANDLE;
    EXPECT_EQ(create(gpu().device(), &info, nullptr, &structure), VK_SUCCESS);
    gpu().vk().DestroyAccelerationStructureKHR(gpu().device(), structure, nullptr);
}

} // namespace
