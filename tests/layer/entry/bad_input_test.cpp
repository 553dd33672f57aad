// SPDX-License-Identifier: Apache-2.0
// Micromap builds that contradict themselves or their memory: the layer names the rule, does not crash, writes nothing
// out of bounds, and the device goes on working. Harmless violations are tolerated, unless VELLUM_STRICT is set.
#include "check/oracle/outcome.h"
#include "command_buffer/state_scene.h"
#include "harness/harness.h"
#include "harness/program/labels.h"
#include "harness/severity.h"

namespace
{

const vt::Labels kBadInputLabels{{"BadInput.*", "strict"}, {"BadInputExt.*", "one_api strict_ext"}};

using namespace vt;

constexpr uint32_t kHuge = 0x7fffffff;

class BadInput : public GpuTest
{
protected:
    explicit BadInput(const Options &options = {}) : GpuTest(options) {}

    void SetUp() override
    {
        MicromapInput input;
        for (uint8_t state = 0; state < 4; ++state)
            input.add(2, kFourState, std::vector<uint8_t>(16, state));
        micromap_ = std::make_unique<Micromap>(gpu(), std::move(input));
        expectNoMessages();
    }

    void TearDown() override
    {
        expectStillWorking();
        micromap_.reset();
        GpuTest::TearDown();
    }

    // A tolerated fault: one warning, and the micromap is built with one triangle of each state. A strict layer rejects
    // it.
    void expectBuilt(const char *rule, const std::function<void(VkMicromapBuildInfoEXT &)> &change,
                     const std::vector<int> &expected = {-1, 0, 1, 1})
    {
        micromap_->forget();
        buildWith(change);
        expectOneMessage(rule);
        EXPECT_EQ(seen({micromap_.get()}, 4), strictTests() ? std::vector<int>(4, 1) : expected);
        expectNoMessages();
    }
    void expectOneMessage(const char *rule)
    {
        const std::vector<Message> messages = gpu().takeUnexpectedMessages();
        if (validationOfTests() == Validation::Below) {
            EXPECT_EQ(messages.size(), 1u) << rule;
        }
        for (const Message &m : messages)
            EXPECT_TRUE(m.fromVellum() && m.id.find(rule) != std::string::npos) << m.id << ": " << m.text;
    }

    // Vellum reports an error, and no layer below it does.
    void expectFinding(const char *rule)
    {
        bool isReported = false;
        for (const Message &m : gpu().takeUnexpectedMessages()) {
            if (m.fromVellum() && m.severity == expectedSeverity(m)) {
                EXPECT_NE(m.id.find(rule), std::string::npos) << m.id << ": " << m.text;
                EXPECT_FALSE(m.text.empty());
                isReported = true;
            } else {
                ADD_FAILURE() << "from elsewhere: " << m.id << ": " << m.text;
            }
        }
        EXPECT_TRUE(isReported) << "no message";
    }

    void expectStillWorking()
    {
        StateScene scene(gpu());
        gpu().submit([&](VkCommandBuffer commands) { scene.record(commands); });
        scene.expectRight();
    }

    void buildWith(const std::function<void(VkMicromapBuildInfoEXT &)> &change)
    {
        MicromapBuild build{micromap_->buildInfo(), micromap_->handle()};
        change(build.info);
        record(std::span(&build, 1));
    }
    void record(std::span<const MicromapBuild> builds)
    {
        gpu().submit([&](VkCommandBuffer commands) { recordMicromapBuilds(gpu(), commands, builds); });
    }
    VkMicromapBuildSizesInfoEXT sizesOf(const VkMicromapBuildInfoEXT &info) { return micromapSizes(gpu(), info); }
    // The rule's id in VK_EXT_opacity_micromap or in VK_KHR_opacity_micromap.
    const char *id(const char *ext, const char *khr) { return gpu().khr() ? khr : ext; }

    // The result of a ray at each triangle of a row with that attachment: -1 nothing, 0 a committed hit, 1 a candidate.
    std::vector<int> seen(const Attachment &attachment, uint32_t triangles)
    {
        Geometry geometry{.vertices = triangleRow(triangles)};
        geometry.micromap = attachment;
        const Blas blas(gpu(), {geometry});
        const Tlas tlas(gpu(), {instance(blas, {}, 1)});
        std::vector<Ray> rays(triangles);
        for (uint32_t i = 0; i < triangles; ++i)
            rays[i].origin = {1.5f * static_cast<float>(i) + 0.3f, 0.3f, 1};
        std::vector<int> out;
        for (const Result &r : Tracer(gpu()).trace(tlas, rays))
            out.push_back(r.candidateCount > 0 ? 1 : r.committed == kTriangle ? 0 : -1);
        return out;
    }

    std::unique_ptr<Micromap> micromap_;
};

TEST_F(BadInput, BothUsageArrays)
{
    const VkMicromapUsageEXT *pointer = micromap_->buildInfo().pUsageCounts;
    const char *rule = id("07516", "VkAccelerationStructureGeometryMicromapDataKHR-pUsageCounts");
    expectBuilt(rule, [&](VkMicromapBuildInfoEXT &info) { info.ppUsageCounts = &pointer; });
    VkMicromapBuildInfoEXT info = micromap_->buildInfo();
    const VkDeviceSize size = sizesOf(info).micromapSize;
    info.ppUsageCounts = &pointer;
    EXPECT_EQ(sizesOf(info).micromapSize, strictTests() ? 0 : size);
    expectOneMessage(rule);
}

TEST_F(BadInput, LevelsAndFormats)
{
    const char *twoState = id("VkMicromapBuildInfoEXT-subdivisionLevel-11654",
                              "VkAccelerationStructureGeometryMicromapDataKHR-subdivisionLevel-11645");
    const char *fourState = id("VkMicromapBuildInfoEXT-subdivisionLevel-11655",
                               "VkAccelerationStructureBuildGeometryInfoKHR-subdivisionLevel-11564");
    const char *format = id("VkMicromapBuildInfoEXT-format-11652", "VkMicromapUsageKHR-format-parameter");
    for (const auto &[usage, rule] : std::initializer_list<std::pair<VkMicromapUsageEXT, const char *>>{
             {{1, 13, kTwoState}, twoState}, {{1, 13, kFourState}, fourState}, {{1, kHuge, kFourState}, fourState}}) {
        SCOPED_TRACE(testing::Message() << "level " << usage.subdivisionLevel << " format " << usage.format);
        const auto change = [&usage = usage](VkMicromapBuildInfoEXT &info) {
            info.usageCountsCount = 1;
            info.pUsageCounts = &usage;
        };
        buildWith(change);
        expectFinding(rule);
        VkMicromapBuildInfoEXT info = micromap_->buildInfo();
        change(info);
        EXPECT_EQ(sizesOf(info).micromapSize, 0u);
        expectFinding(rule);
    }
    // Counts of a format that there is not are as good as those of one that takes most. Where there are no triangles,
    // so is any level.
    for (const uint32_t other : {0u, 3u, kHuge}) {
        SCOPED_TRACE(testing::Message() << "format " << other);
        const VkMicromapUsageEXT usage{4, 2, other};
        expectBuilt(format, [&](VkMicromapBuildInfoEXT &info) {
            info.usageCountsCount = 1;
            info.pUsageCounts = &usage;
        });
    }
    const std::array<VkMicromapUsageEXT, 2> usages{{{0, kHuge, kFourState}, {4, 2, kFourState}}};
    expectBuilt(fourState, [&](VkMicromapBuildInfoEXT &info) {
        info.usageCountsCount = 2;
        info.pUsageCounts = usages.data();
    });
}

// Rules that exist in VK_EXT_opacity_micromap only.
class BadInputExt : public BadInput
{
protected:
    BadInputExt() : BadInput(Options{.api = Api::Ext}) {}
};

TEST_F(BadInputExt, Type)
{
    buildWith([](VkMicromapBuildInfoEXT &info) { info.type = static_cast<VkMicromapTypeEXT>(7); });
    expectFinding("VUID-VkMicromapBuildInfoEXT-type-parameter");
}

// One of the flags is VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR, which this extension does not have.
TEST_F(BadInputExt, UnknownFlags)
{
    MicromapInput input;
    for (int i = 0; i < 4; ++i)
        input.add(5, kFourState, std::vector<uint8_t>(1024, 1));
    Micromap micromap(gpu(), std::move(input));
    VkMicromapBuildInfoEXT info = micromap.buildInfo();
    const VkMicromapBuildSizesInfoEXT plain = sizesOf(info);
    info.flags |= kLossy;
    const VkMicromapBuildSizesInfoEXT flagged = sizesOf(info);
    expectOneMessage("VUID-VkMicromapBuildInfoEXT-flags-parameter");
    EXPECT_EQ(flagged.micromapSize, strictTests() ? 0 : plain.micromapSize);
    EXPECT_EQ(flagged.buildScratchSize, strictTests() ? 0 : plain.buildScratchSize);
    expectBuilt("VUID-VkMicromapBuildInfoEXT-flags-parameter",
                [](VkMicromapBuildInfoEXT &build) { build.flags |= kLossy | 0x40000000; });
}

TEST_F(BadInput, Mode)
{
    expectBuilt(id("vkCmdBuildMicromapsEXT-mode-07462", "mode-11545"),
                [](VkMicromapBuildInfoEXT &info) { info.mode = static_cast<VkBuildMicromapModeEXT>(3); });
}

TEST_F(BadInput, NoDestination)
{
    record(std::array{MicromapBuild{micromap_->buildInfo(), {}}});
    expectFinding(id("vkCmdBuildMicromapsEXT-dstMicromap-07463", "dstAccelerationStructure-03800"));
}

TEST_F(BadInput, TriangleArrayStride)
{
    // A rule of VK_KHR_opacity_micromap's; the layer takes any stride below 4 GiB.
    gpu().breaks("VUID-VkAccelerationStructureGeometryMicromapDataKHR-triangleArrayStride-11647");
    // The first triangle four times (stride 0), and triangles that overlap. VK_EXT_opacity_micromap allows both.
    const auto expectStride = [&](VkDeviceSize stride, const std::vector<int> &expected) {
        const auto change = [stride](VkMicromapBuildInfoEXT &info) { info.triangleArrayStride = stride; };
        if (gpu().khr())
            return expectBuilt("triangleArrayStride-11646", change, expected);
        micromap_->forget();
        buildWith(change);
        expectNoMessages();
        EXPECT_EQ(seen({micromap_.get()}, 4), expected);
    };
    expectStride(0, {-1, -1, -1, -1});
    expectStride(4, {-1, 1, 0, 1});
    buildWith([](VkMicromapBuildInfoEXT &info) { info.triangleArrayStride = 10; });
    expectNoMessages();
}

TEST_F(BadInput, DestinationTooSmall)
{
    MicromapInput input;
    for (uint8_t state = 0; state < 4; ++state)
        input.add(6, kFourState, std::vector<uint8_t>(4096, state));
    const Micromap large(gpu(), std::move(input));
    const VkMicromapBuildSizesInfoEXT sizes = sizesOf(large.buildInfo());
    const Guarded storage(gpu(), sizes.micromapSize / 2, 256, micromapStorageUsage(gpu()));
    const MicromapHandle small =
        createMicromap(gpu(), storage.buffer(), storage.address() - storage.offset(), storage.offset(), storage.size());
    record(std::array{MicromapBuild{large.buildInfo(), small}});
    expectFinding(id("vkCmdBuildMicromapsEXT-pInfos-07461", "pInfos-10126"));
    EXPECT_TRUE(storage.intact());
    destroyMicromap(gpu(), small);
}

TEST_F(BadInputExt, CreateBeyondTheBuffer)
{
    const Buffer buffer(gpu(), 4096, VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT);
    // The first two have something in the buffer, and the third is aligned as far as the layer needs it.
    for (const auto &[offset, size, harmless] :
         std::initializer_list<std::tuple<VkDeviceSize, VkDeviceSize, bool>>{{0, 4097, true},
                                                                             {256, ~VkDeviceSize{0}, true},
                                                                             {16, 256, true},
                                                                             {4096, 256, false},
                                                                             {8192, 1, false},
                                                                             {100, 256, false}}) {
        SCOPED_TRACE(testing::Message() << "offset " << offset << " size " << size);
        auto create = vkInit<VkMicromapCreateInfoEXT>({.buffer = buffer.handle(), .offset = offset, .size = size});
        VkMicromapEXT micromap = VK_NULL_HANDLE;
        const VkResult result = gpu().vk().CreateMicromapEXT(gpu().device(), &create, nullptr, &micromap);
        expectOneMessage(offset % 256 == 0 ? "VUID-VkMicromapCreateInfoEXT-offset-07437"
                                           : "VUID-VkMicromapCreateInfoEXT-offset-07438");
        EXPECT_EQ(result == VK_SUCCESS, harmless && !strictTests());
        EXPECT_EQ(micromap != VK_NULL_HANDLE, result == VK_SUCCESS);
        gpu().vk().DestroyMicromapEXT(gpu().device(), micromap, nullptr);
    }
}

// A micromap whose size exceeds its buffer can be built if what is used of it lies in the buffer.
TEST_F(BadInputExt, BuiltInWhatReachesBeyondTheBuffer)
{
    if (strictTests())
        GTEST_SKIP() << "there is no such micromap";
    for (const bool fits : {true, false}) {
        const Guarded storage(gpu(), micromapSizes(gpu(), micromap_->buildInfo()).micromapSize, 256,
                              VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
        auto create = vkInit<VkMicromapCreateInfoEXT>({.buffer = storage.buffer(),
                                                       .offset = fits ? storage.offset() : storage.offset() + 65536,
                                                       .size = VkDeviceSize{1} << 40});
        VkMicromapEXT micromap = VK_NULL_HANDLE;
        const VkResult result = gpu().vk().CreateMicromapEXT(gpu().device(), &create, nullptr, &micromap);
        expectOneMessage("offset-07437");
        EXPECT_EQ(result == VK_SUCCESS, fits);
        if (result != VK_SUCCESS)
            continue;
        record(std::array{MicromapBuild{micromap_->buildInfo(), {micromap, VK_NULL_HANDLE}}});
        expectNoMessages();
        EXPECT_TRUE(storage.intact());
        // A large one has no space.
        const VkMicromapUsageEXT usage{1000, 6, kFourState};
        VkMicromapBuildInfoEXT large = micromap_->buildInfo();
        large.usageCountsCount = 1;
        large.pUsageCounts = &usage;
        record(std::array{MicromapBuild{large, {micromap, VK_NULL_HANDLE}}});
        expectOneMessage("pInfos-07461");
        gpu().vk().DestroyMicromapEXT(gpu().device(), micromap, nullptr);
    }
}

TEST_F(BadInput, CountsThatOverflow)
{
    const std::vector<VkMicromapUsageEXT> usage(64, {0xffffffff, 12, kFourState});
    VkMicromapBuildInfoEXT info = micromap_->buildInfo();
    info.usageCountsCount = static_cast<uint32_t>(usage.size());
    info.pUsageCounts = usage.data();
    EXPECT_EQ(sizesOf(info).micromapSize, 0u);
    const std::vector<Message> messages = gpu().takeUnexpectedMessages();
    ASSERT_FALSE(messages.empty());
    EXPECT_EQ(messages.back().id, gpu().khr() && strictTests()
                                      ? "VELLUM-VUID-VkAccelerationStructureGeometryMicromapDataKHR-count-11643"
                                      : "VELLUM-micromap-too-large");
}

TEST_F(BadInput, NoUsageAtAll)
{
    // Without counts there are no triangles.
    buildWith([](VkMicromapBuildInfoEXT &info) {
        info.usageCountsCount = 0;
        info.pUsageCounts = nullptr;
    });
    expectNoMessages();
    VkMicromapBuildInfoEXT info = micromap_->buildInfo();
    info.usageCountsCount = 3;
    info.pUsageCounts = nullptr;
    sizesOf(info);
    expectFinding(id("07516", "VkAccelerationStructureGeometryMicromapDataKHR-pUsageCounts-11642"));
}

// MicromapStructureRejected.BuildsAndTheirMemory is the same test for VK_KHR_opacity_micromap.
TEST_F(BadInputExt, AddressesAndScratchMemory)
{
    const std::vector<uint8_t> before(micromap_->memory(), micromap_->memory() + micromap_->size());
    const auto rejected = [&](const char *rule, const std::function<void(VkMicromapBuildInfoEXT &)> &change) {
        SCOPED_TRACE(rule);
        buildWith(change);
        expectFinding(rule);
        EXPECT_EQ(std::vector<uint8_t>(micromap_->memory(), micromap_->memory() + micromap_->size()), before);
    };
    rejected("vkCmdBuildMicromapsEXT-pInfos-10896", [](auto &info) { info.data.deviceAddress = 0; });
    rejected("vkCmdBuildMicromapsEXT-pInfos-10897", [](auto &info) { info.triangleArray.deviceAddress = 0; });
    rejected("vkCmdBuildMicromapsEXT-pInfos-07512", [](auto &info) { info.scratchData.deviceAddress = 0; });
    rejected("vkCmdBuildMicromapsEXT-pInfos-07514", [](auto &info) { info.scratchData.deviceAddress += 2; });
    const Buffer little(gpu(), 16, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    rejected("vkCmdBuildMicromapsEXT-pInfos-07509",
             [&](auto &info) { info.scratchData.deviceAddress = little.address(); });
}

// VUID-vkCmdBuildMicromapsEXT-pInfos-07515 wants multiples of 256; the layer needs none.
TEST_F(BadInputExt, UnalignedInput)
{
    gpu().breaks("VUID-vkCmdBuildMicromapsEXT-pInfos-07515");
    MicromapInput input;
    for (uint8_t state = 0; state < 4; ++state)
        input.add(4, kFourState, std::vector<uint8_t>(256, state));
    const uint32_t bytes = input.triangles[1].dataOffset;
    for (const bool data : {false, true}) {
        Micromap micromap(gpu(), input);
        VkMicromapBuildInfoEXT info = micromap.buildInfo();
        const VkMicromapUsageEXT three{3, 4, kFourState};
        info.usageCountsCount = 1;
        info.pUsageCounts = &three;
        // Skips the first triangle record, or shifts the data by one triangle.
        if (data)
            info.data.deviceAddress += bytes;
        else
            info.triangleArray.deviceAddress += sizeof(VkMicromapTriangleEXT);
        record(std::array{MicromapBuild{info, micromap.handle()}});
        expectNoMessages();
        EXPECT_EQ(seen({&micromap}, 3), (std::vector{0, 1, 1})) << data;
    }
}

TEST_F(BadInputExt, CreateTypeAndFlags)
{
    const Buffer buffer(gpu(), 4096,
                        VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    auto good = vkInit<VkMicromapCreateInfoEXT>({.buffer = buffer.handle(), .size = 4096});
    const auto made = [&](const char *rule, const std::function<void(VkMicromapCreateInfoEXT &)> &change) {
        VkMicromapCreateInfoEXT create = good;
        change(create);
        VkMicromapEXT micromap = VK_NULL_HANDLE;
        EXPECT_EQ(gpu().vk().CreateMicromapEXT(gpu().device(), &create, nullptr, &micromap) == VK_SUCCESS,
                  !strictTests());
        EXPECT_EQ(micromap == VK_NULL_HANDLE, strictTests());
        expectOneMessage(rule);
        if (!micromap)
            return;
        record(std::array{MicromapBuild{micromap_->buildInfo(), {micromap, VK_NULL_HANDLE}}});
        expectNoMessages();
        gpu().vk().DestroyMicromapEXT(gpu().device(), micromap, nullptr);
    };
    made("VkMicromapCreateInfoEXT-type-parameter", [](auto &create) {
        create.type = static_cast<VkMicromapTypeEXT>(1000397000); // VK_MICROMAP_TYPE_DISPLACEMENT_MICROMAP_NV
    });
    made("VkMicromapCreateInfoEXT-micromapCaptureReplay-11616", [](auto &create) {
        create.createFlags = VK_MICROMAP_CREATE_DEVICE_ADDRESS_CAPTURE_REPLAY_BIT_EXT;
        create.deviceAddress = 4096;
    });
    made("VkMicromapCreateInfoEXT-deviceAddress-07433", [](auto &create) { create.deviceAddress = 4096; });
}

TEST_F(BadInput, RejectsOneAmongGoodOnes)
{
    // Of two builds in one command the valid one may be executed, the invalid one must not be.
    MicromapInput input;
    input.add(2, kFourState, std::vector<uint8_t>(16, 1));
    Micromap other(gpu(), std::move(input));
    std::array builds{MicromapBuild{micromap_->buildInfo(), micromap_->handle()},
                      MicromapBuild{other.buildInfo(), other.handle()}};
    builds[1].info.data.deviceAddress = 0;
    record(builds);
    expectFinding(id("vkCmdBuildMicromapsEXT-pInfos-10896", "micromap-11550"));
}

// The tests from here on use content that only the device sees. There is no message, but the result is defined:
// anything outside is unknown.

TEST_F(BadInput, DataBeyondTheBuffer)
{
    MicromapInput input;
    for (uint8_t state = 0; state < 4; ++state)
        input.add(4, kFourState, std::vector<uint8_t>(256, 1));
    input.triangles[1].dataOffset = 1 << 20;
    input.triangles[2].dataOffset = 0xffffffff;
    input.triangles[3].dataOffset = 0xfffffff0;
    Micromap micromap(gpu(), std::move(input));
    micromap.build();
    EXPECT_EQ(seen({&micromap}, 4), (std::vector{0, 1, 1, 1}));
}

TEST_F(BadInput, RecordsThatBreakTheRules)
{
    gpu().breaks("VUID-VkAccelerationStructureTrianglesOpacityMicromapEXT-format-11679");
    MicromapInput input;
    for (int i = 0; i < 6; ++i)
        input.add(3, kFourState, std::vector<uint8_t>(64, 1));
    input.declared = {{6, 3, kFourState}};
    input.triangles[1].subdivisionLevel = 13;
    input.triangles[2].subdivisionLevel = 0xffff;
    input.triangles[3].format = 0;
    input.triangles[4].format = 3;
    Micromap micromap(gpu(), std::move(input));
    micromap.build();
    EXPECT_EQ(seen({&micromap}, 6), (std::vector{0, 1, 1, 1, 1, 0}));
}

TEST_F(BadInput, RecordsLargerThanDeclared)
{
    // The usage counts, and so the micromap, leave no space for these triangles' data.
    MicromapInput input;
    for (int i = 0; i < 3; ++i) {
        std::vector<uint8_t> states(size_t{1} << 16);
        for (size_t k = 0; k < states.size(); ++k)
            states[k] = static_cast<uint8_t>(k * 7 % 4);
        input.add(8, kFourState, states);
    }
    input.declared = {{3, 0, kTwoState}};
    Micromap micromap(gpu(), std::move(input));
    micromap.build(); // its guard bytes are looked at when it goes
    seen({&micromap}, 3);
}

TEST_F(BadInput, FewerTrianglesThanDeclared)
{
    gpu().breaks("VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11554");
    MicromapInput input;
    input.add(3, kFourState, std::vector<uint8_t>(64, 1));
    input.declared = {{100000, 3, kFourState}};
    Micromap micromap(gpu(), std::move(input));
    micromap.build();
    EXPECT_EQ(seen({&micromap}, 1), std::vector{0});
}

TEST_F(BadInput, IndicesBeyondTheMicromap)
{
    micromap_->build();
    EXPECT_EQ(seen({micromap_.get(), VK_INDEX_TYPE_UINT32, {1, 4, kHuge, -5, -1000}}, 5), (std::vector{0, 1, 1, 1, 1}));
    EXPECT_EQ(seen({micromap_.get(), VK_INDEX_TYPE_UINT16, {1, 4, 0x7fff, -5, -1000}}, 5),
              (std::vector{0, 1, 1, 1, 1}));
    EXPECT_EQ(seen({micromap_.get(), VK_INDEX_TYPE_UINT32, {1, 0, 2}, {}, 0xffffffff}, 3), (std::vector{1, 1, 1}));
    EXPECT_EQ(seen({micromap_.get(), VK_INDEX_TYPE_UINT32, {1, -2}, {}, kHuge}, 2), (std::vector{1, 0}));
    EXPECT_EQ(seen({micromap_.get()}, 6), (std::vector{-1, 0, 1, 1, 1, 1}));
    EXPECT_EQ(seen({nullptr, VK_INDEX_TYPE_UINT32, {0, -2, 3}}, 3), (std::vector{1, 0, 1}));
    gpu().takeMessages();
}

TEST_F(BadInput, IndexBufferTooShort)
{
    gpu().breaks("VUID-vkCmdBuildAccelerationStructuresKHR-indexBuffer-11577");
    micromap_->build();
    Attachment attachment{micromap_.get(), VK_INDEX_TYPE_UINT32, {-2, -2}};
    Geometry geometry{.vertices = triangleRow(100000)};
    geometry.micromap = attachment;
    const Blas blas(gpu(), {geometry});
    const Tlas tlas(gpu(), {instance(blas, {}, 1)});
    std::vector<Ray> rays(2);
    rays[0].origin = {1.8f, 0.3f, 1};
    rays[1].origin = {1.5f * 4096 + 0.25f, 0.25f, 1};
    const std::vector<Result> results = Tracer(gpu()).trace(tlas, rays);
    EXPECT_EQ(results[0].committed, kTriangle);
    EXPECT_EQ(results[1].candidateCount, 1u) << "what cannot be read is unknown";
}

TEST_F(BadInput, MicromapThatWasNeverBuilt)
{
    EXPECT_EQ(seen({micromap_.get()}, 4), (std::vector{1, 1, 1, 1}));
}

TEST_F(BadInputExt, GeometryWithBothUsageArrays)
{
    gpu().breaks("VUID-VkAccelerationStructureTrianglesOpacityMicromapEXT-pUsageCounts-07335");
    micromap_->build();
    Geometry geometry{.vertices = triangleRow(4)};
    geometry.micromap = Attachment{micromap_.get()};
    Blas blas(gpu());
    blas.prepare({geometry});
    const VkAccelerationStructureBuildGeometryInfoKHR &info = blas.buildInfo();
    VkAccelerationStructureGeometryKHR changed = info.pGeometries[0];
    auto attachment =
        *static_cast<const VkAccelerationStructureTrianglesOpacityMicromapEXT *>(changed.geometry.triangles.pNext);
    const VkMicromapUsageEXT *pointer = attachment.pUsageCounts;
    attachment.ppUsageCounts = &pointer;
    changed.geometry.triangles.pNext = &attachment;
    VkAccelerationStructureBuildGeometryInfoKHR bad = info;
    bad.pGeometries = &changed;
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = blas.ranges();
    gpu().submit(
        [&](VkCommandBuffer commands) { gpu().vk().CmdBuildAccelerationStructuresKHR(commands, 1, &bad, &ranges); });
    for (const Message &m : gpu().takeUnexpectedMessages())
        EXPECT_TRUE(m.fromVellum()) << m.id << ": " << m.text;
}

} // namespace
