// SPDX-License-Identifier: Apache-2.0
// Queries of micromap sizes and of acceleration structures with micromaps: host reads, device copies, resets, in every
// format.
#include <thread>

#include "command_buffer/inherited_state.h"
#include "gpu/copies.h"
#include "harness/harness.h"
#include "harness/mock_driver.h"
#include "harness/program/labels.h"

namespace
{

const vt::Labels kQueryLabels{{"Queries.*", "quirks stacked packed"},
                              {"Queries.AMicromapThatWasNeverBuilt", "unpacked"},
                              {"Queries.AccelerationStructuresWithMicromaps", "serialized"},
                              {"Queries.Wrong*", "strict"}};

using namespace vt;

constexpr std::array<VkQueryType, 2> kTypes{VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT,
                                            VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT};
constexpr uint32_t kCount = 5;
constexpr VkDeviceSize kSentinel = 0x5a5a5a5a5a5a5a5a;

// A pool of the query type that the tests' extension has in place of this one.
QueryPool poolOf(Gpu &gpu, VkQueryType type, uint32_t count)
{
    return {gpu, micromapQueryType(gpu, type), count};
}

class Queries : public GpuTest
{
protected:
    Queries() : GpuTest({.maintenance = true}) {} // for VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SIZE_KHR

    void SetUp() override
    {
        for (uint32_t i = 0; i < kCount; ++i) {
            MicromapInput input;
            for (uint32_t k = 0; k <= i; ++k) {
                std::vector<uint8_t> states(256, 0);
                states[k] = 1; // each is another one
                input.add(4, kFourState, states);
            }
            input.add(4, kFourState, std::vector<uint8_t>(256, 1)); // folded
            micromaps_.push_back(
                std::make_unique<Micromap>(gpu(), std::move(input), VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT));
            micromaps_.back()->build();
            handles_.push_back(micromaps_.back()->handle());
        }
    }
    // The size of micromap i.
    VkDeviceSize sizeOf(VkQueryType type, uint32_t i)
    {
        const VkDeviceSize compacted = 64 + (i + 3) / 2 * 16 + (i + 1) * 64;
        if (type == VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT)
            return reportedSize(gpu(), compacted);
        const VkDeviceSize serialized = 64 + compacted + 64; // with the data of the folded triangle
        return translatedTests() ? reportedSize(gpu(), serialized) : serialized;
    }
    void write(VkCommandBuffer commands, VkQueryType type, VkQueryPool pool, uint32_t first, uint32_t count = kCount)
    {
        recordMicromapProperties(gpu(), commands, std::span(handles_).first(count), micromapQueryType(gpu(), type),
                                 pool, first);
    }
    VkResult read(VkQueryPool pool, uint32_t first, uint32_t count, void *data, size_t size, VkDeviceSize stride,
                  VkQueryResultFlags flags)
    {
        return vkGetQueryPoolResults(gpu().device(), pool, first, count, size, data, stride, flags);
    }
    VkPipelineStageFlags2 buildStage()
    {
        return gpu().khr() ? VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR
                           : VK_PIPELINE_STAGE_2_MICROMAP_BUILD_BIT_EXT;
    }
    void expectMessage(const char *part)
    {
        bool found = false;
        for (const Message &m : gpu().takeUnexpectedMessages()) {
            EXPECT_TRUE(m.fromVellum()) << m.id << ": " << m.text;
            found |= m.id.find(part) != std::string::npos;
        }
        EXPECT_TRUE(found) << part;
    }

    std::vector<std::unique_ptr<Micromap>> micromaps_;
    std::vector<MicromapHandle> handles_;
};

TEST_F(Queries, BothTypesInBothWidths)
{
    for (const VkQueryType type : kTypes) {
        const QueryPool pool = poolOf(gpu(), type, kCount + 3);
        gpu().submit([&](VkCommandBuffer commands) {
            vkCmdResetQueryPool(commands, pool, 0, kCount + 3);
            write(commands, type, pool, 2);
        });
        std::array<uint64_t, kCount> wide{};
        EXPECT_EQ(read(pool, 2, kCount, wide.data(), sizeof wide, 8, VK_QUERY_RESULT_64_BIT), VK_SUCCESS);
        std::array<uint32_t, kCount> narrow{};
        EXPECT_EQ(read(pool, 2, kCount, narrow.data(), sizeof narrow, 4, 0), VK_SUCCESS);
        for (uint32_t i = 0; i < kCount; ++i) {
            EXPECT_EQ(wide[i], sizeOf(type, i));
            EXPECT_EQ(narrow[i], sizeOf(type, i));
        }
    }
}

TEST_F(Queries, AvailabilityAndPartialResults)
{
    const VkQueryType type = kTypes[0];
    const QueryPool pool = poolOf(gpu(), type, kCount + 2);
    gpu().submit([&](VkCommandBuffer commands) {
        vkCmdResetQueryPool(commands, pool, 0, kCount + 2);
        write(commands, type, pool, 1);
    });
    struct Entry {
        uint64_t value, available;
    };
    std::array<Entry, kCount + 2> entries{};
    const VkQueryResultFlags flags = VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WITH_AVAILABILITY_BIT;
    const auto fill = [&] { entries.fill({kSentinel, kSentinel}); };
    fill();
    EXPECT_EQ(read(pool, 0, kCount + 2, entries.data(), sizeof entries, sizeof(Entry), flags), VK_NOT_READY);
    for (uint32_t i = 0; i < kCount + 2; ++i) {
        const bool written = i >= 1 && i <= kCount;
        EXPECT_EQ(entries[i].value, written ? sizeOf(type, i - 1) : kSentinel) << i;
        EXPECT_EQ(entries[i].available != 0, written) << i;
    }
    fill();
    EXPECT_EQ(
        read(pool, 0, kCount + 2, entries.data(), sizeof entries, sizeof(Entry), flags | VK_QUERY_RESULT_PARTIAL_BIT),
        VK_SUCCESS);
    EXPECT_EQ(entries[0].value, 0u);
    EXPECT_EQ(entries[0].available, 0u);
    EXPECT_EQ(entries[1].value, sizeOf(type, 0));
    // Without availability, values that are not available are not written either.
    fill();
    EXPECT_EQ(read(pool, 0, 2, entries.data(), sizeof entries, sizeof(Entry), VK_QUERY_RESULT_64_BIT), VK_NOT_READY);
    EXPECT_EQ(entries[0].value, kSentinel);
    EXPECT_EQ(entries[1].value, sizeOf(type, 0));
    EXPECT_EQ(entries[1].available, kSentinel) << "between the results";
    // Less data than queries: no more is written than there is space for.
    gpu().breaks("VUID-vkGetQueryPoolResults-dataSize-00817");
    fill();
    read(pool, 1, kCount, entries.data(), 8, 8, VK_QUERY_RESULT_64_BIT);
    EXPECT_EQ(entries[0].available, kSentinel);
}

TEST_F(Queries, ResetByHostAndDevice)
{
    const VkQueryType type = kTypes[1];
    const QueryPool pool = poolOf(gpu(), type, kCount);
    uint64_t value = 0;
    const auto available = [&](uint32_t i) {
        uint64_t pair[2] = {0, 7};
        read(pool, i, 1, pair, 16, 16, VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WITH_AVAILABILITY_BIT);
        return pair[1] != 0;
    };
    const auto writeAll = [&] { gpu().submit([&](VkCommandBuffer commands) { write(commands, type, pool, 0); }); };
    vkResetQueryPool(gpu().device(), pool, 0, kCount);
    EXPECT_EQ(read(pool, 0, 1, &value, 8, 8, VK_QUERY_RESULT_64_BIT), VK_NOT_READY);
    writeAll();
    for (uint32_t i = 0; i < kCount; ++i)
        EXPECT_TRUE(available(i));
    vkResetQueryPool(gpu().device(), pool, 1, 2);
    for (uint32_t i = 0; i < kCount; ++i)
        EXPECT_EQ(available(i), i < 1 || i > 2);
    gpu().submit([&](VkCommandBuffer commands) {
        vkCmdResetQueryPool(commands, pool, 0, kCount);
        write(commands, type, pool, 0, 3);
        vkCmdResetQueryPool(commands, pool, 2, 1);
    });
    for (uint32_t i = 0; i < kCount; ++i)
        EXPECT_EQ(available(i), i < 2);
}

TEST_F(Queries, WaitForTheDevice)
{
    const VkQueryType type = kTypes[0];
    const QueryPool pool = poolOf(gpu(), type, kCount);
    vkResetQueryPool(gpu().device(), pool, 0, kCount);
    auto timeline = vkInit<VkSemaphoreTypeCreateInfo>({.semaphoreType = VK_SEMAPHORE_TYPE_TIMELINE});
    auto create = vkInit<VkSemaphoreCreateInfo>({.pNext = &timeline});
    VkSemaphore semaphore = VK_NULL_HANDLE;
    VT_CHECK(vkCreateSemaphore(gpu().device(), &create, nullptr, &semaphore));
    VkCommandBuffer commands = gpu().begin();
    write(commands, type, pool, 0);
    gpu().end(commands);
    // The work waits for the host, and the host for the work's results.
    auto wait = vkInit<VkSemaphoreSubmitInfo>({.semaphore = semaphore, .value = 1, .stageMask = buildStage()});
    auto buffer = vkInit<VkCommandBufferSubmitInfo>({.commandBuffer = commands});
    auto submit = vkInit<VkSubmitInfo2>({.waitSemaphoreInfoCount = 1,
                                         .pWaitSemaphoreInfos = &wait,
                                         .commandBufferInfoCount = 1,
                                         .pCommandBufferInfos = &buffer});
    VT_CHECK(vkQueueSubmit2(gpu().queue(), 1, &submit, VK_NULL_HANDLE));
    uint64_t value = kSentinel;
    EXPECT_EQ(read(pool, 0, 1, &value, 8, 8, VK_QUERY_RESULT_64_BIT), VK_NOT_READY);
    EXPECT_EQ(value, kSentinel);
    std::thread signaller([&] {
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
        auto signal = vkInit<VkSemaphoreSignalInfo>({.semaphore = semaphore, .value = 1});
        vkSignalSemaphore(gpu().device(), &signal);
    });
    std::array<uint64_t, kCount> values{};
    EXPECT_EQ(read(pool, 0, kCount, values.data(), sizeof values, 8, VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT),
              VK_SUCCESS);
    signaller.join();
    for (uint32_t i = 0; i < kCount; ++i)
        EXPECT_EQ(values[i], sizeOf(type, i));
    VT_CHECK(vkQueueWaitIdle(gpu().queue()));
    vkDestroySemaphore(gpu().device(), semaphore, nullptr);
}

TEST_F(Queries, DeviceCopies)
{
    for (const VkQueryType type : kTypes) {
        for (const bool wide : {false, true}) {
            for (const bool availability : {false, true}) {
                for (const VkQueryResultFlags extra :
                     {VkQueryResultFlags{VK_QUERY_RESULT_WAIT_BIT}, VkQueryResultFlags{VK_QUERY_RESULT_PARTIAL_BIT}}) {
                    SCOPED_TRACE(testing::Message() << type << wide << availability << extra);
                    const size_t word = wide ? 8 : 4;
                    const size_t stride = 40;
                    const size_t offset = 16;
                    const QueryPool pool = poolOf(gpu(), type, kCount + 2);
                    // With the transfer usage only, as in an application.
                    const Buffer out(gpu(), 1024, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
                    std::memset(out.bytes(), 0x5a, 1024);
                    const uint32_t count = extra == VK_QUERY_RESULT_WAIT_BIT ? kCount : kCount + 1;
                    gpu().submit([&](VkCommandBuffer commands) {
                        vkCmdResetQueryPool(commands, pool, 0, kCount + 2);
                        write(commands, type, pool, 1);
                        vkCmdCopyQueryPoolResults(commands, pool, 1, count, out.handle(), offset, stride,
                                                  extra | (wide ? VK_QUERY_RESULT_64_BIT : 0) |
                                                      (availability ? VK_QUERY_RESULT_WITH_AVAILABILITY_BIT : 0));
                    });
                    std::vector<uint8_t> expected(1024, 0x5a);
                    for (uint32_t i = 0; i < count; ++i) {
                        const uint64_t pair[2] = {i < kCount ? sizeOf(type, i) : 0, i < kCount ? 1u : 0u};
                        for (size_t k = 0; k < (availability ? 2 : 1); ++k)
                            std::memcpy(&expected[offset + i * stride + k * word], &pair[k], word);
                    }
                    EXPECT_EQ(std::vector<uint8_t>(out.bytes(), out.bytes() + 1024), expected);
                }
            }
        }
    }
}

// Conditional rendering does not apply to copies. The layer replaces this one by commands of its own, which must not
// depend on the inherited condition either.
TEST_F(Queries, CopiesWhereConditionalRenderingIsInherited)
{
    Gpu other({.validation = false});
    if (!other.has(VK_EXT_CONDITIONAL_RENDERING_EXTENSION_NAME))
        GTEST_SKIP() << "no VK_EXT_conditional_rendering";
    const QueryPool pool = poolOf(other, kTypes[0], 1);
    const Buffer out(other, 16, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    std::memset(out.bytes(), 0x5a, 16);
    VkCommandBuffer secondary = beginInheritingCondition(other);
    vkCmdCopyQueryPoolResults(secondary, pool, 0, 1, out.handle(), 0, 8,
                              VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_PARTIAL_BIT);
    VT_CHECK(vkEndCommandBuffer(secondary));
    other.submit([&](VkCommandBuffer commands) {
        vkCmdResetQueryPool(commands, pool, 0, 1);
        vkCmdExecuteCommands(commands, 1, &secondary);
    });
    EXPECT_EQ(out.as<uint64_t>()[0], 0u);
    EXPECT_EQ(out.as<uint64_t>()[1], kSentinel);
}

// Two copies from one pool in a command buffer that is submitted twice: each has its own results.
TEST_F(Queries, CopiesSeeTheStateOfTheirTime)
{
    const VkQueryType type = kTypes[0];
    const QueryPool pool = poolOf(gpu(), type, 2);
    const Buffer out(gpu(), 64, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    const VkQueryResultFlags flags = VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_PARTIAL_BIT;
    VkCommandBuffer commands = gpu().begin(0);
    vkCmdResetQueryPool(commands, pool, 0, 2);
    vkCmdCopyQueryPoolResults(commands, pool, 0, 1, out.handle(), 0, 8, flags);
    write(commands, type, pool, 0, 1);
    vkCmdCopyQueryPoolResults(commands, pool, 0, 1, out.handle(), 8, 8, flags);
    vkCmdResetQueryPool(commands, pool, 0, 1);
    vkCmdCopyQueryPoolResults(commands, pool, 0, 1, out.handle(), 16, 8, flags);
    gpu().end(commands);
    for (int run = 0; run < 2; ++run) {
        std::memset(out.bytes(), 0x5a, 64);
        gpu().execute(commands);
        const auto values = out.as<uint64_t>();
        EXPECT_EQ(values[0], 0u);
        EXPECT_EQ(values[1], sizeOf(type, 0));
        EXPECT_EQ(values[2], 0u);
        EXPECT_EQ(values[3], kSentinel);
    }
}

TEST_F(Queries, RejectsWrongUse)
{
    if (validationOfTests() == Validation::Above)
        GTEST_SKIP() << "validation 1.4.363 reads behind the pool's queries";
    const QueryPool compacted = poolOf(gpu(), kTypes[0], 2);
    vkResetQueryPool(gpu().device(), compacted, 0, 2);
    const auto rejected = [&](const char *id, VkQueryType type, VkQueryPool pool, uint32_t first, uint32_t count) {
        gpu().submit([&](VkCommandBuffer commands) { write(commands, type, pool, first, count); });
        expectMessage(id);
    };
    // Either size of micromaps may be written to pools of the other; those of acceleration structures are the driver's.
    if (gpu().khr() || strictTests())
        rejected(gpu().khr() ? "02493" : "07525", kTypes[1], compacted, 0, 1);
    rejected(gpu().khr() ? "06742" : "07503", VK_QUERY_TYPE_OCCLUSION, compacted, 0, 1);
    rejected(gpu().khr() ? "query-04880" : "query-07528", kTypes[0], compacted, 1, 2);
    rejected(gpu().khr() ? "query-04880" : "query-07528", kTypes[0], compacted, 0xffffffff, 1);
    handles_[1] = {};
    rejected(gpu().khr() ? "pAccelerationStructures-parameter" : "pMicromaps-parameter", kTypes[0], compacted, 0, 2);
    uint64_t value = 0;
    EXPECT_EQ(read(compacted, 0, 1, &value, 8, 8, VK_QUERY_RESULT_64_BIT), VK_NOT_READY);
    if (gpu().khr() || strictTests())
        return;
    const QueryPool serialized = poolOf(gpu(), kTypes[1], 1);
    vkResetQueryPool(gpu().device(), serialized, 0, 1);
    gpu().submit([&](VkCommandBuffer commands) {
        write(commands, kTypes[1], serialized, 0, 1);
        write(commands, kTypes[1], compacted, 0, 1);
    });
    EXPECT_EQ(compacted.value(), serialized.value());
    expectMessage("07525");
}

// The driver, whose pool behind the layer's is another one, must see nothing of it either.
TEST_F(Queries, WrongUseStaysInTheLayer)
{
    if (validationOfTests() == Validation::Above)
        GTEST_SKIP() << "validation 1.4.363 reads behind the pool's queries";
    const VkQueryType type = VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR;
    const Blas blas(gpu(), {Geometry{.vertices = triangleRow(2)}},
                    VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR);
    const VkAccelerationStructureKHR structure = blas.handle();
    const QueryPool micromaps = poolOf(gpu(), kTypes[1], 2);
    const QueryPool sizes = poolOf(gpu(), VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SIZE_KHR, 2);
    for (const VkQueryPool pool : {VkQueryPool{micromaps}, VkQueryPool{sizes}}) {
        vkResetQueryPool(gpu().device(), pool, 0, 2);
        gpu().submit([&](VkCommandBuffer commands) {
            gpu().vk().CmdWriteAccelerationStructuresPropertiesKHR(commands, 1, &structure, type, pool, 0);
        });
        expectMessage("vkCmdWriteAccelerationStructuresPropertiesKHR-queryPool-02493");
    }
    vkResetQueryPool(gpu().device(), micromaps, 1, 2);
    expectMessage("query-range");
    gpu().submit([&](VkCommandBuffer commands) { vkCmdResetQueryPool(commands, micromaps, 2, 1); });
    expectMessage("query-range");
}

// Sizes of a micromap that holds garbage are not believed, but bounded by its own.
TEST_F(Queries, AMicromapThatWasNeverBuilt)
{
    const Micromap empty(gpu(), *micromaps_[0], 4096);
    handles_[0] = empty.handle();
    const QueryPool pool = poolOf(gpu(), kTypes[0], 1);
    vkResetQueryPool(gpu().device(), pool, 0, 1);
    gpu().submit([&](VkCommandBuffer commands) { write(commands, kTypes[0], pool, 0, 1); });
    uint64_t value = 0;
    EXPECT_EQ(read(pool, 0, 1, &value, 8, 8, VK_QUERY_RESULT_64_BIT), VK_SUCCESS);
    EXPECT_LE(value, 4096u);
}

// The driver does not know the records at the end of a structure: the layer adds their size to results.
TEST_F(Queries, AccelerationStructuresWithMicromaps)
{
    Geometry plain{.vertices = triangleRow(500)};
    Geometry mapped = plain;
    mapped.micromap = Attachment{micromaps_[0].get(), VK_INDEX_TYPE_UINT32, std::vector<int32_t>(500, 0)};
    const VkBuildAccelerationStructureFlagsKHR flags = VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR;
    const Blas small(gpu(), {plain}, flags);
    const Blas with(gpu(), {mapped}, flags);
    // With the same memory size as the one with micromaps, on which a driver's results may depend.
    Blas without(gpu(), {mapped}, flags);
    without.build({plain}, flags);
    ASSERT_EQ(without.size(), with.size());
    const VkDeviceSize records = with.size() - (small.size() + 255) / 256 * 256;
    ASSERT_GE(records, 500u * 8);
    const std::array<VkAccelerationStructureKHR, 2> structures{without.handle(), with.handle()};
    for (const VkQueryType type : {VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR,
                                   VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR}) {
        SCOPED_TRACE(type);
        const QueryPool pool = poolOf(gpu(), type, 3);
        const Buffer out(gpu(), 64, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
        gpu().submit([&](VkCommandBuffer commands) {
            vkCmdResetQueryPool(commands, pool, 0, 3);
            gpu().vk().CmdWriteAccelerationStructuresPropertiesKHR(commands, 2, structures.data(), type, pool, 1);
            vkCmdCopyQueryPoolResults(commands, pool, 1, 2, out.handle(), 8, 16,
                                      VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WITH_AVAILABILITY_BIT |
                                          VK_QUERY_RESULT_WAIT_BIT);
            vkCmdCopyQueryPoolResults(commands, pool, 1, 2, out.handle(), 48, 4, VK_QUERY_RESULT_WAIT_BIT);
        });
        uint64_t host[2] = {};
        EXPECT_EQ(read(pool, 1, 2, host, sizeof host, 8, VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT),
                  VK_SUCCESS);
        if (type == VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR) {
            EXPECT_EQ(host[0], serialize(gpu(), without).total());
            EXPECT_EQ(host[1], serialize(gpu(), with).total());
        } else {
            EXPECT_GT(host[0], 0u);
            EXPECT_GE(host[1], host[0] / 2 + records);
            EXPECT_LE(host[1], with.size());
        }
        const auto copied = out.as<uint64_t>();
        EXPECT_EQ(copied[1], host[0]);
        EXPECT_EQ(copied[2], 1u);
        EXPECT_EQ(copied[3], host[1]);
        EXPECT_EQ(copied[4], 1u);
        EXPECT_EQ(out.as<uint32_t>()[12], host[0]);
        EXPECT_EQ(out.as<uint32_t>()[13], host[1]);
        // A query that was corrected before, and is used again for a structure without.
        gpu().submit([&](VkCommandBuffer commands) {
            vkCmdResetQueryPool(commands, pool, 0, 3);
            gpu().vk().CmdWriteAccelerationStructuresPropertiesKHR(commands, 1, structures.data(), type, pool, 2);
        });
        uint64_t again = 0;
        EXPECT_EQ(read(pool, 2, 1, &again, 8, 8, VK_QUERY_RESULT_64_BIT), VK_SUCCESS);
        EXPECT_EQ(again, host[0]);
    }
}

TEST_F(Queries, OtherPoolsAreTheDrivers)
{
    const QueryPool pool = poolOf(gpu(), VK_QUERY_TYPE_TIMESTAMP, 2);
    const Buffer out(gpu(), 64, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    gpu().submit([&](VkCommandBuffer commands) {
        vkCmdResetQueryPool(commands, pool, 0, 2);
        vkCmdWriteTimestamp2(commands, buildStage(), pool, 0);
        vkCmdCopyQueryPoolResults(commands, pool, 0, 1, out.handle(), 0, 8,
                                  VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT);
    });
    uint64_t value = 0;
    EXPECT_EQ(read(pool, 0, 1, &value, 8, 8, VK_QUERY_RESULT_64_BIT), VK_SUCCESS);
    EXPECT_EQ(out.as<uint64_t>()[0], value);
}

} // namespace
