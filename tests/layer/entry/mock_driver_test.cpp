// SPDX-License-Identifier: Apache-2.0
// The mock driver itself, without the layer: each quirk enforces what it advertises.
#include <algorithm>

#include "command_buffer/compute_pipeline.h"
#include "gpu/copies.h"
#include "harness/harness.h"
#include "harness/mock_driver.h"
#include "shaders/empty.h"

namespace
{

using namespace vt;

class MockDriver : public testing::Test
{
protected:
    void make(const char *quirks)
    {
        gpu_ = std::make_unique<Gpu>(
            Options{.vellum = false, .validation = false, .spy = false, .quirks = quirks, .micromaps = false});
    }
    Gpu &gpu() { return *gpu_; }
    // Expects messages of the driver only, each of which contains `part`.
    void expectReported(const std::string &part)
    {
        const auto messages = gpu().takeMessages();
        EXPECT_FALSE(messages.empty()) << part;
        for (const Message &m : messages) {
            EXPECT_EQ(m.id, "DRIVER");
            EXPECT_NE(m.text.find(part), std::string::npos) << m.text;
        }
    }

private:
    std::unique_ptr<Gpu> gpu_;
};

TEST_F(MockDriver, KnowsItsQuirks)
{
    EXPECT_THROW(make("structures,nonsense"), std::runtime_error);
    EXPECT_NO_THROW(make("structures"));
}

TEST_F(MockDriver, Alignments)
{
    make("alignments");
    EXPECT_EQ(gpu().scratchAlignment(), 256u);
    EXPECT_EQ(gpu().pipelineProperties().shaderGroupBaseAlignment, 64u);
    EXPECT_EQ(gpu().pipelineProperties().shaderGroupHandleAlignment, 32u);
    Blas blas(gpu());
    blas.prepare({Geometry{.vertices = triangleRow(1)}});
    VkCommandBuffer commands = gpu().begin();
    VkAccelerationStructureBuildGeometryInfoKHR info = blas.buildInfo();
    info.scratchData.deviceAddress += 128;
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = blas.ranges();
    gpu().vk().CmdBuildAccelerationStructuresKHR(commands, 1, &info, &ranges);
    expectReported("pInfos-03710");
    const VkStridedDeviceAddressRegionKHR table{info.scratchData.deviceAddress + 32, 48, 96}, none{};
    gpu().vk().CmdTraceRaysKHR(commands, &none, &none, &table, &none, 0, 0, 0);
    expectReported("VUID-vkCmdTraceRaysKHR");
    vkFreeCommandBuffers(gpu().device(), gpu().pool(), 1, &commands);
}

TEST_F(MockDriver, FewPushConstants)
{
    make("push128");
    const VkPushConstantRange range{VK_SHADER_STAGE_COMPUTE_BIT, 0, 132};
    auto info = vkInit<VkPipelineLayoutCreateInfo>({.pushConstantRangeCount = 1, .pPushConstantRanges = &range});
    VkPipelineLayout layout = VK_NULL_HANDLE;
    VT_CHECK(vkCreatePipelineLayout(gpu().device(), &info, nullptr, &layout));
    vkDestroyPipelineLayout(gpu().device(), layout, nullptr);
    expectReported("size-00298");
}

// Another device of the process receives the messages, as the device that tests share does.
TEST_F(MockDriver, MessagesOfOtherTestsAreDropped)
{
    Gpu shared(Options{.vellum = false, .validation = false, .spy = false, .quirks = "push128", .micromaps = false});
    make("push128");
    const VkPushConstantRange range{VK_SHADER_STAGE_COMPUTE_BIT, 0, 132};
    const auto info = vkInit<VkPipelineLayoutCreateInfo>({.pushConstantRangeCount = 1, .pPushConstantRanges = &range});
    VkPipelineLayout layout = VK_NULL_HANDLE;
    VT_CHECK(vkCreatePipelineLayout(gpu().device(), &info, nullptr, &layout));
    vkDestroyPipelineLayout(gpu().device(), layout, nullptr);
    expectReported("size-00298");
    shared.reset(shared.options());
    EXPECT_TRUE(shared.takeMessages().empty());
}

TEST_F(MockDriver, MemoryThatTheHostDoesNotSee)
{
    make("discrete");
    auto info = vkInit<VkMemoryAllocateInfo>({.allocationSize = 4096, .memoryTypeIndex = 0});
    VkDeviceMemory memory = VK_NULL_HANDLE;
    VT_CHECK(vkAllocateMemory(gpu().device(), &info, nullptr, &memory));
    void *data = nullptr;
    EXPECT_EQ(vkMapMemory(gpu().device(), memory, 0, VK_WHOLE_SIZE, 0, &data), VK_ERROR_MEMORY_MAP_FAILED);
    expectReported("memory-00682");
    vkFreeMemory(gpu().device(), memory, nullptr);
}

TEST_F(MockDriver, AHeapThatIsFull)
{
    make("window");
    auto info = vkInit<VkMemoryAllocateInfo>({.allocationSize = VkDeviceSize{129} << 20});
    info.memoryTypeIndex = 3; // local and visible
    VkDeviceMemory first = VK_NULL_HANDLE, second = VK_NULL_HANDLE;
    EXPECT_EQ(vkAllocateMemory(gpu().device(), &info, nullptr, &first), VK_SUCCESS);
    EXPECT_EQ(vkAllocateMemory(gpu().device(), &info, nullptr, &second), VK_ERROR_OUT_OF_DEVICE_MEMORY);
    vkFreeMemory(gpu().device(), first, nullptr);
    EXPECT_EQ(vkAllocateMemory(gpu().device(), &info, nullptr, &second), VK_SUCCESS);
    vkFreeMemory(gpu().device(), second, nullptr);
    EXPECT_TRUE(gpu().takeMessages().empty());
}

TEST_F(MockDriver, ImportedMemory)
{
    make("dirty");
    auto info = vkInit<VkMemoryAllocateInfo>({.allocationSize = 4096});
    VkDeviceMemory memory = VK_NULL_HANDLE;
    VT_CHECK(vkAllocateMemory(gpu().device(), &info, nullptr, &memory));
    void *data = nullptr;
    VT_CHECK(vkMapMemory(gpu().device(), memory, 0, VK_WHOLE_SIZE, 0, &data));
    EXPECT_EQ(static_cast<uint8_t *>(data)[4095], 0xd7);
    vkFreeMemory(gpu().device(), memory, nullptr);
}

TEST_F(MockDriver, ScratchMemoryThatIsAllUsed)
{
    make("scratch");
    Blas blas(gpu());
    blas.prepare({Geometry{.vertices = triangleRow(4)}});
    const VkDeviceSize size = blas.scratchRange().size;
    VkAccelerationStructureBuildGeometryInfoKHR info = blas.buildInfo();
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = blas.ranges();
    const auto build = [&](VkDeviceAddress scratch) {
        info.scratchData.deviceAddress = scratch;
        gpu().submit([&](VkCommandBuffer commands) {
            gpu().vk().CmdBuildAccelerationStructuresKHR(commands, 1, &info, &ranges);
        });
    };
    const Buffer buffer(gpu(), 2 * size,
                        VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    std::memset(buffer.bytes(), 1, static_cast<size_t>(buffer.size()));
    build(buffer.address());
    EXPECT_TRUE(gpu().takeMessages().empty());
    EXPECT_NE(buffer.bytes()[size - 8], 1);
    EXPECT_EQ(buffer.bytes()[size], 1);
    build(buffer.address() + buffer.size() - size + 128);
    expectReported("scratch memory");
}

TEST_F(MockDriver, SmallWorkgroups)
{
    make("compute");
    VkCommandBuffer commands = gpu().begin();
    vkCmdDispatch(commands, 0, 65535, 1);
    EXPECT_TRUE(gpu().takeMessages().empty());
    vkCmdDispatch(commands, 0, 65536, 1);
    vkFreeCommandBuffers(gpu().device(), gpu().pool(), 1, &commands);
    expectReported("groupCountX-00386");
}

TEST_F(MockDriver, NoRayQueries)
{
    make("noqueries");
    EXPECT_FALSE(gpu().has(VK_KHR_RAY_QUERY_EXTENSION_NAME));
    EXPECT_TRUE(gpu().has(VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME));
    const Tracer tracer(gpu());
    expectReported("pCode-08740");
}

TEST_F(MockDriver, HeapsThatAreInvalidated)
{
    make("heaps");
    const auto bindHeap =
        reinterpret_cast<PFN_vkCmdBindResourceHeapEXT>(vkGetDeviceProcAddr(gpu().device(), "vkCmdBindResourceHeapEXT"));
    const auto pushData =
        reinterpret_cast<PFN_vkCmdPushDataEXT>(vkGetDeviceProcAddr(gpu().device(), "vkCmdPushDataEXT"));
    const VkPushConstantRange range{VK_SHADER_STAGE_COMPUTE_BIT, 0, 4};
    auto info = vkInit<VkPipelineLayoutCreateInfo>({.pushConstantRangeCount = 1, .pPushConstantRanges = &range});
    VkPipelineLayout layout = VK_NULL_HANDLE;
    VT_CHECK(vkCreatePipelineLayout(gpu().device(), &info, nullptr, &layout));
    const ComputePipeline forHeaps(gpu(), VK_NULL_HANDLE, empty, VK_PIPELINE_CREATE_2_DESCRIPTOR_HEAP_BIT_EXT);
    const ComputePipeline forSets(gpu(), layout, empty, 0);
    VkCommandBuffer commands = gpu().begin();
    const uint32_t word = 1;
    const auto heap = vkInit<VkBindHeapInfoEXT>({.heapRange = {256, 256}});
    const auto data = vkInit<VkPushDataInfoEXT>({.data = {&word, sizeof word}});
    const auto run = [&](const ComputePipeline &pipeline) {
        vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline.handle());
        vkCmdDispatch(commands, 1, 1, 1);
    };
    const auto pushConstants = [&] {
        vkCmdPushConstants(commands, layout, VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof word, &word);
    };
    bindHeap(commands, &heap);
    pushData(commands, &data);
    run(forHeaps);
    EXPECT_TRUE(gpu().takeMessages().empty());
    pushConstants();
    pushData(commands, &data);
    run(forHeaps);
    expectReported("has invalidated the heap");
    bindHeap(commands, &heap);
    run(forHeaps);
    EXPECT_TRUE(gpu().takeMessages().empty());
    pushConstants();
    bindHeap(commands, &heap);
    run(forHeaps);
    expectReported("without its push data");
    run(forSets);
    expectReported("without the descriptor sets");
    vkFreeCommandBuffers(gpu().device(), gpu().pool(), 1, &commands);
    vkDestroyPipelineLayout(gpu().device(), layout, nullptr);
}

TEST_F(MockDriver, FamiliesForOnePurpose)
{
    make("queues");
    ASSERT_EQ(gpu().families().size(), 4u);
    EXPECT_EQ(gpu().family(), 1u);
    auto info = vkInit<VkCommandPoolCreateInfo>();
    VkCommandPool pool = VK_NULL_HANDLE;
    VT_CHECK(vkCreateCommandPool(gpu().device(), &info, nullptr, &pool));
    auto allocation = vkInit<VkCommandBufferAllocateInfo>({.commandPool = pool, .commandBufferCount = 2});
    std::array<VkCommandBuffer, 2> commands{};
    VT_CHECK(vkAllocateCommandBuffers(gpu().device(), &allocation, commands.data()));
    auto begin = vkInit<VkCommandBufferBeginInfo>();
    for (VkCommandBuffer one : commands)
        VT_CHECK(vkBeginCommandBuffer(one, &begin));
    vkCmdDispatch(commands[0], 0, 0, 0);
    expectReported("vkCmdDispatch");
    VT_CHECK(vkEndCommandBuffer(commands[1]));
    gpu().execute(commands[1]); // on the other family's queue
    expectReported("pCommandBuffers-00074");
    vkDestroyCommandPool(gpu().device(), pool, nullptr);
}

TEST_F(MockDriver, StructuresThatShrink)
{
    make("structures");
    if (gpu().onLavapipe26())
        GTEST_SKIP() << "the quirk simulates this driver";
    const Blas blas(gpu(), {Geometry{.vertices = triangleRow(100)}},
                    VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR);
    EXPECT_EQ(blas.size() % 2, 1u);
    const VkDeviceSize compacted = queried(gpu(), blas, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR);
    EXPECT_LT(compacted, blas.size() * 3 / 4);
    Structure copied(gpu(), VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR);
    copied.create(compacted);
    copy(gpu(), blas, copied, VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR);
    EXPECT_EQ(seenOf(gpu(), copied), seenOf(gpu(), blas));
    EXPECT_TRUE(gpu().takeMessages().empty());
}

TEST_F(MockDriver, AddressesElsewhere)
{
    make("elsewhere");
    const Buffer buffer(gpu(), 65536, gpu().structureUsage());
    EXPECT_NE(reinterpret_cast<uint64_t>(buffer.bytes()), buffer.address());
    for (const bool generic : {false, true}) {
        Structure structure(gpu(), generic ? VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR
                                           : VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR);
        structure.placeIn(buffer.handle(), 256);
        structure.create(1024);
        EXPECT_EQ(structure.address() == buffer.address() + 256, generic);
    }
}

} // namespace
