// SPDX-License-Identifier: Apache-2.0
// The layer on a driver with more features than lavapipe: indirect builds, and capture and replay of addresses. The
// driver is lavapipe with the quirk "capable".
#include "gpu/copies.h"
#include "harness/harness.h"
#include "harness/program/labels.h"

namespace
{

const vt::Labels kCapableDriverLabels{{"CapableDriverExt.*", "one_api strict_ext"}};

using namespace vt;

class CapableDriver : public GpuTest
{
protected:
    explicit CapableDriver(const Options &options = {.quirks = "capable"}) : GpuTest(options) {}

    // Builds what is prepared, with ranges from memory, of which the host says no more than `most` primitives.
    void buildIndirectly(const Structure &structure, std::vector<VkAccelerationStructureBuildRangeInfoKHR> ranges,
                         std::vector<uint32_t> most)
    {
        // After each range is an invalid one, which the stride skips.
        std::vector<VkAccelerationStructureBuildRangeInfoKHR> strided;
        for (const auto &range : ranges) {
            strided.push_back(range);
            strided.push_back({0xffffffffu, 0xffffffffu, 0xffffffffu, 0xffffffffu});
        }
        const Buffer buffer = gpu().upload(std::span<const VkAccelerationStructureBuildRangeInfoKHR>(strided),
                                           VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
        const VkDeviceAddress address = buffer.address();
        const uint32_t stride = 2 * sizeof(VkAccelerationStructureBuildRangeInfoKHR);
        const uint32_t *counts = most.data();
        gpu().submit([&](VkCommandBuffer commands) {
            gpu().vk().CmdBuildAccelerationStructuresIndirectKHR(commands, 1, &structure.buildInfo(), &address, &stride,
                                                                 &counts);
        });
    }
};

// The layer rejects the host commands of acceleration structures.
TEST_F(CapableDriver, HasNoHostCommandsOfStructures)
{
    Options options = gpu().options();
    options.vellum = options.micromaps = false;
    const Gpu bare(options);
    const auto hostCommands = [](const Gpu &gpu) {
        auto structures = vkInit<VkPhysicalDeviceAccelerationStructureFeaturesKHR>();
        auto features = vkInit<VkPhysicalDeviceFeatures2>({.pNext = &structures});
        vkGetPhysicalDeviceFeatures2(gpu.physical(), &features);
        return structures.accelerationStructureHostCommands;
    };
    EXPECT_TRUE(hostCommands(bare));
    EXPECT_FALSE(hostCommands(gpu()));
}

TEST_F(CapableDriver, IndirectBottomLevel)
{
    if (validationOfTests() == Validation::Above)
        GTEST_SKIP() << "validation 1.4.363 passes its own handle of the micromap on";
    const Patchwork patchwork(gpu());
    const Blas direct(gpu(), patchwork.geometries());
    Blas indirect(gpu());
    indirect.prepare(patchwork.geometries());
    std::vector<VkAccelerationStructureBuildRangeInfoKHR> ranges;
    std::vector<uint32_t> most;
    for (uint32_t g = 0; g < indirect.buildInfo().geometryCount; ++g) {
        ranges.push_back(indirect.ranges()[g]);
        most.push_back(indirect.ranges()[g].primitiveCount);
    }
    buildIndirectly(indirect, ranges, most);
    EXPECT_EQ(seenOf(gpu(), indirect), seenOf(gpu(), direct));
}

// Fewer primitives than the host says that there are at most.
TEST_F(CapableDriver, IndirectBottomLevelWithFewerPrimitives)
{
    if (validationOfTests() == Validation::Above)
        GTEST_SKIP() << "validation 1.4.363 passes its own handle of the micromap on";
    const Patchwork patchwork(gpu());
    Blas direct(gpu()), indirect(gpu());
    direct.prepare(patchwork.geometries());
    indirect.prepare(patchwork.geometries());
    std::vector<VkAccelerationStructureBuildRangeInfoKHR> ranges;
    std::vector<uint32_t> most;
    for (uint32_t g = 0; g < direct.buildInfo().geometryCount; ++g) {
        ranges.push_back(direct.ranges()[g]);
        most.push_back(ranges.back().primitiveCount);
        ranges.back().primitiveCount = g % 2 == 0 ? 4 : 1;
    }
    const auto *fewer = ranges.data();
    gpu().submit([&](VkCommandBuffer commands) {
        gpu().vk().CmdBuildAccelerationStructuresKHR(commands, 1, &direct.buildInfo(), &fewer);
    });
    buildIndirectly(indirect, ranges, most);
    const auto seen = seenOf(gpu(), indirect);
    EXPECT_EQ(seen, seenOf(gpu(), direct));
    EXPECT_NE(seen, seenOf(gpu(), Blas(gpu(), patchwork.geometries())));
}

TEST_F(CapableDriver, IndirectTopLevel)
{
    const Patchwork patchwork(gpu()), other(gpu(), 2);
    const Blas first(gpu(), patchwork.geometries()), second(gpu(), other.geometries());
    const std::vector<VkAccelerationStructureInstanceKHR> instances{
        instance(second, {90, 90, 90}, 1), instance(first, {}, 2), instance(second, {0, 40, 0}, 3),
        instance(first, {0, 80, 0}, 4)};
    std::vector<Ray> rays;
    for (const float y : {0.0f, 40.0f, 80.0f}) {
        for (const Ray &ray : Patchwork::rays({0, y, 0}))
            rays.push_back(ray);
    }
    for (const Arrangement arrangement : {Arrangement::Array, Arrangement::Pointers}) {
        SCOPED_TRACE(static_cast<int>(arrangement));
        Tlas direct(gpu()), indirect(gpu());
        direct.build(std::span(instances).subspan(1, 2), 0, VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR,
                     arrangement);
        indirect.prepare(instances, 0, VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR, arrangement);
        const uint32_t skipped = arrangement == Arrangement::Array ? sizeof instances[0] : sizeof(VkDeviceAddress);
        buildIndirectly(indirect, {{2, skipped, 0, 0}}, {4});
        const auto seenBefore = vt::seen(gpu(), indirect, rays);
        EXPECT_EQ(seenBefore, vt::seen(gpu(), direct, rays));
        // The same structure again, with more triangles.
        buildIndirectly(indirect, {{4, 0, 0, 0}}, {4});
        EXPECT_NE(vt::seen(gpu(), indirect, rays), seenBefore);
        buildIndirectly(indirect, {{0, 0, 0, 0}}, {4});
        for (const std::string &s : vt::seen(gpu(), indirect, rays))
            EXPECT_EQ(s, "");
    }
}

TEST_F(CapableDriver, CopyOfAnIndirectTopLevel)
{
    const Patchwork patchwork(gpu());
    const Blas blas(gpu(), patchwork.geometries());
    const std::vector<VkAccelerationStructureInstanceKHR> instances{instance(blas, {}, 2),
                                                                    instance(blas, {0, 40, 0}, 3)};
    Tlas indirect(gpu());
    indirect.prepare(instances);
    buildIndirectly(indirect, {{1, 0, 0, 0}}, {2});
    Structure clone(gpu(), VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR);
    clone.create(indirect.size());
    copy(gpu(), indirect, clone);
    const auto rays = Patchwork::rays();
    EXPECT_EQ(seen(gpu(), clone, rays), seen(gpu(), indirect, rays));
    EXPECT_EQ(serialize(gpu(), indirect).handleCount(), 1u);
}

class CapableDriverExt : public CapableDriver
{
protected:
    CapableDriverExt() : CapableDriver({.quirks = "capable", .api = Api::Ext}) {}
};

TEST_F(CapableDriverExt, CaptureReplayFeature)
{
    auto micromap = vkInit<VkPhysicalDeviceOpacityMicromapFeaturesEXT>();
    auto features = vkInit<VkPhysicalDeviceFeatures2>({.pNext = &micromap});
    vkGetPhysicalDeviceFeatures2(gpu().physical(), &features);
    EXPECT_TRUE(micromap.micromapCaptureReplay);
}

TEST_F(CapableDriverExt, CaptureReplayOfMicromaps)
{
    auto info = vkInit<VkBufferCreateInfo>(
        {.flags = VK_BUFFER_CREATE_DEVICE_ADDRESS_CAPTURE_REPLAY_BIT,
         .size = 4096,
         .usage = VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT});
    VkBuffer buffer = VK_NULL_HANDLE;
    VT_CHECK(vkCreateBuffer(gpu().device(), &info, nullptr, &buffer));
    const VkDeviceMemory memory = gpu().bindMemory(buffer);
    const VkDeviceAddress address = gpu().address(buffer);

    auto create =
        vkInit<VkMicromapCreateInfoEXT>({.createFlags = VK_MICROMAP_CREATE_DEVICE_ADDRESS_CAPTURE_REPLAY_BIT_EXT,
                                         .buffer = buffer,
                                         .offset = 256,
                                         .size = 1024,
                                         .type = VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT});
    const auto made = [&](VkDeviceAddress wanted) {
        create.deviceAddress = wanted;
        VkMicromapEXT micromap = VK_NULL_HANDLE;
        const VkResult result = gpu().vk().CreateMicromapEXT(gpu().device(), &create, nullptr, &micromap);
        if (result == VK_SUCCESS)
            gpu().vk().DestroyMicromapEXT(gpu().device(), micromap, nullptr);
        return result;
    };
    EXPECT_EQ(made(0), VK_SUCCESS);
    EXPECT_EQ(made(address + 256), VK_SUCCESS);
    EXPECT_TRUE(gpu().takeUnexpectedMessages().empty());
    EXPECT_EQ(made(address), VK_ERROR_INVALID_OPAQUE_CAPTURE_ADDRESS);
    auto messages = gpu().takeUnexpectedMessages();
    ASSERT_EQ(messages.size(), 1u);
    EXPECT_EQ(messages[0].id, "VELLUM-micromap-replay");
    create.createFlags = 0;
    EXPECT_EQ(made(address + 256) == VK_SUCCESS, !strictTests()); // the address means nothing then
    messages = gpu().takeUnexpectedMessages();
    ASSERT_EQ(messages.size(), 1u);
    EXPECT_EQ(messages[0].id, "VELLUM-VUID-VkMicromapCreateInfoEXT-deviceAddress-07433");
    vkDestroyBuffer(gpu().device(), buffer, nullptr);
    vkFreeMemory(gpu().device(), memory, nullptr);
}

class CapableDriverKhr : public CapableDriver
{
protected:
    CapableDriverKhr() : CapableDriver({.quirks = "capable", .api = Api::Khr}) {}
};

// A micromap of VK_KHR_opacity_micromap is at the address that it is given, of a buffer that is where it was.
TEST_F(CapableDriverKhr, CaptureReplayOfMicromaps)
{
    MicromapInput input;
    input.add(4, kFourState, std::vector<uint8_t>(256, 0));
    Micromap source(gpu(), input);
    source.build();
    auto info = vkInit<VkBufferCreateInfo>(
        {.flags = VK_BUFFER_CREATE_DEVICE_ADDRESS_CAPTURE_REPLAY_BIT,
         .size = 4096,
         .usage = VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT});
    VkBuffer buffer = VK_NULL_HANDLE;
    VT_CHECK(vkCreateBuffer(gpu().device(), &info, nullptr, &buffer));
    const VkDeviceMemory memory = gpu().bindMemory(buffer);
    auto create = vkInit<VkAccelerationStructureCreateInfo2KHR>(
        {.createFlags = VK_ACCELERATION_STRUCTURE_CREATE_DEVICE_ADDRESS_CAPTURE_REPLAY_BIT_KHR,
         .addressRange = {gpu().address(buffer) + 256, source.size()},
         .type = VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR});
    for (int run = 0; run < 2; ++run) { // capture, then replay
        VkAccelerationStructureKHR micromap = VK_NULL_HANDLE;
        ASSERT_EQ(gpu().vk().CreateAccelerationStructure2KHR(gpu().device(), &create, nullptr, &micromap), VK_SUCCESS);
        auto query = vkInit<VkAccelerationStructureDeviceAddressInfoKHR>({.accelerationStructure = micromap});
        EXPECT_EQ(gpu().vk().GetAccelerationStructureDeviceAddressKHR(gpu().device(), &query),
                  create.addressRange.address);
        gpu().submit([&](VkCommandBuffer commands) { recordCopy(gpu(), commands, source.handle().khr, micromap); });
        gpu().vk().DestroyAccelerationStructureKHR(gpu().device(), micromap, nullptr);
    }
    vkDestroyBuffer(gpu().device(), buffer, nullptr);
    vkFreeMemory(gpu().device(), memory, nullptr);
}

} // namespace
