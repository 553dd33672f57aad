// Micromap builds that contradict themselves, or their memory: a message that names the rule, no crash, nothing written
// where it does not belong, and a device that goes on working.
#include "commands/state_scene.h"
#include "harness/expected.h"

namespace
{

using namespace vt;

constexpr std::uint32_t kHuge = 0x7fffffff;

class BadInput : public GpuTest
{
protected:
    explicit BadInput(const Options &options = {}) : GpuTest(options) {}

    void SetUp() override
    {
        MicromapInput input;
        for (std::uint8_t state = 0; state < 4; ++state)
            input.add(2, kFourState, std::vector<std::uint8_t>(16, state));
        micromap_ = std::make_unique<Micromap>(gpu(), std::move(input));
        expectNoMessages();
    }

    void TearDown() override
    {
        expectStillWorking();
        micromap_.reset();
        GpuTest::TearDown();
    }

    // Vellum complains, and nobody below it has a reason to.
    void expectComplaint(const char *rule)
    {
        bool complained = false;
        for (const Message &m : gpu().takeUnexpectedMessages()) {
            if (m.fromVellum() && m.severity == VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT) {
                EXPECT_NE(m.id.find(rule), std::string::npos) << m.id << ": " << m.text;
                EXPECT_FALSE(m.text.empty());
                complained = true;
            } else {
                ADD_FAILURE() << "from elsewhere: " << m.id << ": " << m.text;
            }
        }
        EXPECT_TRUE(complained) << "no message";
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
    // What the rule is called in VK_EXT_opacity_micromap and in VK_KHR_opacity_micromap.
    const char *id(const char *ext, const char *khr) { return gpu().khr() ? khr : ext; }

    // What the shader sees of a row of triangles with that attachment: -1 nothing, 0 a committed hit, 1 a candidate.
    std::vector<int> seen(const Attachment &attachment, std::uint32_t triangles)
    {
        Geometry geometry{.vertices = triangleRow(triangles)};
        geometry.micromap = attachment;
        const Blas blas(gpu(), {geometry});
        const Tlas tlas(gpu(), {instance(blas, {}, 1)});
        std::vector<Ray> rays(triangles);
        for (std::uint32_t i = 0; i < triangles; ++i)
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
    buildWith([&](VkMicromapBuildInfoEXT &info) { info.ppUsageCounts = &pointer; });
    expectComplaint(id("07516", "VkAccelerationStructureGeometryMicromapDataKHR-pUsageCounts"));
    VkMicromapBuildInfoEXT info = micromap_->buildInfo();
    info.ppUsageCounts = &pointer;
    sizesOf(info);
    expectComplaint(id("07516", "VkAccelerationStructureGeometryMicromapDataKHR-pUsageCounts"));
}

TEST_F(BadInput, LevelsAndFormats)
{
    const char *twoState = id("VkMicromapBuildInfoEXT-subdivisionLevel-11654",
                              "VkAccelerationStructureGeometryMicromapDataKHR-subdivisionLevel-11645");
    const char *fourState = id("VkMicromapBuildInfoEXT-subdivisionLevel-11655",
                               "VkAccelerationStructureBuildGeometryInfoKHR-subdivisionLevel-11564");
    const char *format = id("VkMicromapBuildInfoEXT-format-11652", "VkMicromapUsageKHR-format-parameter");
    for (const auto &[usage, rule] :
         std::initializer_list<std::pair<VkMicromapUsageEXT, const char *>>{{{1, 13, kTwoState}, twoState},
                                                                            {{1, 13, kFourState}, fourState},
                                                                            {{1, kHuge, kFourState}, fourState},
                                                                            {{1, 2, 0}, format},
                                                                            {{1, 2, 3}, format},
                                                                            {{1, 2, kHuge}, format}}) {
        SCOPED_TRACE(testing::Message() << "level " << usage.subdivisionLevel << " format " << usage.format);
        const auto change = [&usage = usage](VkMicromapBuildInfoEXT &info) {
            info.usageCountsCount = 1;
            info.pUsageCounts = &usage;
        };
        buildWith(change);
        expectComplaint(rule);
        VkMicromapBuildInfoEXT info = micromap_->buildInfo();
        change(info);
        sizesOf(info);
        expectComplaint(rule);
    }
}

// What only VK_EXT_opacity_micromap has.
class BadInputExt : public BadInput
{
protected:
    BadInputExt() : BadInput(Options{.api = Api::Ext}) {}
};

TEST_F(BadInputExt, Type)
{
    buildWith([](VkMicromapBuildInfoEXT &info) { info.type = static_cast<VkMicromapTypeEXT>(7); });
    expectComplaint("VUID-VkMicromapBuildInfoEXT-type-parameter");
}

TEST_F(BadInput, Mode)
{
    buildWith([](VkMicromapBuildInfoEXT &info) { info.mode = static_cast<VkBuildMicromapModeEXT>(3); });
    expectComplaint(id("VkMicromapBuildInfoEXT-mode-parameter", "mode-11545"));
}

TEST_F(BadInput, NoDestination)
{
    record(std::array{MicromapBuild{micromap_->buildInfo(), {}}});
    expectComplaint(id("vkCmdBuildMicromapsEXT-dstMicromap-07463", "dstAccelerationStructure-11547"));
}

TEST_F(BadInput, TriangleArrayStride)
{
    // A rule of VK_KHR_opacity_micromap's; the layer takes any stride of 8 bytes or more.
    gpu().breaks("VUID-VkAccelerationStructureGeometryMicromapDataKHR-triangleArrayStride-11647");
    for (const VkDeviceSize stride : {VkDeviceSize{0}, VkDeviceSize{4}}) {
        buildWith([stride](VkMicromapBuildInfoEXT &info) { info.triangleArrayStride = stride; });
        expectComplaint(id("VELLUM-micromap-stride", "triangleArrayStride-11646"));
    }
    buildWith([](VkMicromapBuildInfoEXT &info) { info.triangleArrayStride = 10; });
    expectNoMessages();
}

TEST_F(BadInput, DestinationTooSmall)
{
    MicromapInput input;
    for (std::uint8_t state = 0; state < 4; ++state)
        input.add(6, kFourState, std::vector<std::uint8_t>(4096, state));
    const Micromap large(gpu(), std::move(input));
    const VkMicromapBuildSizesInfoEXT sizes = sizesOf(large.buildInfo());
    const Guarded storage(gpu(), sizes.micromapSize / 2, 256, micromapStorageUsage(gpu()));
    const MicromapHandle small =
        createMicromap(gpu(), storage.buffer(), storage.address() - storage.offset(), storage.offset(), storage.size());
    record(std::array{MicromapBuild{large.buildInfo(), small}});
    expectComplaint(id("vkCmdBuildMicromapsEXT-pInfos-07461", "pInfos-10126"));
    EXPECT_TRUE(storage.intact());
    destroyMicromap(gpu(), small);
}

TEST_F(BadInputExt, CreateBeyondTheBuffer)
{
    const Buffer buffer(gpu(), 4096, VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT);
    for (const auto &[offset, size] : std::initializer_list<std::pair<VkDeviceSize, VkDeviceSize>>{
             {0, 4097}, {4096, 256}, {256, ~VkDeviceSize{0}}, {8192, 1}, {100, 256}}) {
        SCOPED_TRACE(testing::Message() << "offset " << offset << " size " << size);
        VkMicromapCreateInfoEXT create{};
        create.sType = VK_STRUCTURE_TYPE_MICROMAP_CREATE_INFO_EXT;
        create.buffer = buffer.handle();
        create.offset = offset;
        create.size = size;
        VkMicromapEXT micromap = VK_NULL_HANDLE;
        const VkResult result = gpu().vk().CreateMicromapEXT(gpu().device(), &create, nullptr, &micromap);
        expectComplaint(offset % 256 == 0 ? "VUID-VkMicromapCreateInfoEXT-offset-07437"
                                          : "VUID-VkMicromapCreateInfoEXT-offset-07438");
        if (result == VK_SUCCESS)
            gpu().vk().DestroyMicromapEXT(gpu().device(), micromap, nullptr);
        else
            EXPECT_EQ(micromap, static_cast<VkMicromapEXT>(VK_NULL_HANDLE));
    }
}

TEST_F(BadInput, CountsThatOverflow)
{
    const std::vector<VkMicromapUsageEXT> usage(64, {0xffffffff, 12, kFourState});
    VkMicromapBuildInfoEXT info = micromap_->buildInfo();
    info.usageCountsCount = static_cast<std::uint32_t>(usage.size());
    info.pUsageCounts = usage.data();
    EXPECT_EQ(sizesOf(info).micromapSize, 0u);
    expectComplaint(id("VELLUM-micromap-too-large", "VkAccelerationStructureGeometryMicromapDataKHR-count-11643"));
}

TEST_F(BadInput, NoUsageAtAll)
{
    // No counts are no triangles.
    buildWith([](VkMicromapBuildInfoEXT &info) {
        info.usageCountsCount = 0;
        info.pUsageCounts = nullptr;
    });
    expectNoMessages();
    VkMicromapBuildInfoEXT info = micromap_->buildInfo();
    info.usageCountsCount = 3;
    info.pUsageCounts = nullptr;
    sizesOf(info);
    expectComplaint(id("07516", "VkAccelerationStructureGeometryMicromapDataKHR-pUsageCounts-11642"));
}

// Of VK_KHR_opacity_micromap: MicromapStructureRefused.BuildsAndTheirMemory.
TEST_F(BadInputExt, AddressesAndScratchMemory)
{
    const std::vector<std::uint8_t> before(micromap_->memory(), micromap_->memory() + micromap_->size());
    const auto refused = [&](const char *rule, const std::function<void(VkMicromapBuildInfoEXT &)> &change) {
        SCOPED_TRACE(rule);
        buildWith(change);
        expectComplaint(rule);
        EXPECT_EQ(std::vector<std::uint8_t>(micromap_->memory(), micromap_->memory() + micromap_->size()), before);
    };
    refused("vkCmdBuildMicromapsEXT-pInfos-10896", [](auto &info) { info.data.deviceAddress = 0; });
    refused("vkCmdBuildMicromapsEXT-pInfos-10897", [](auto &info) { info.triangleArray.deviceAddress = 0; });
    refused("vkCmdBuildMicromapsEXT-pInfos-07512", [](auto &info) { info.scratchData.deviceAddress = 0; });
    refused("vkCmdBuildMicromapsEXT-pInfos-07514", [](auto &info) { info.scratchData.deviceAddress += 2; });
    const Buffer little(gpu(), 16, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    refused("vkCmdBuildMicromapsEXT-pInfos-07509",
            [&](auto &info) { info.scratchData.deviceAddress = little.address(); });
}

// VUID-vkCmdBuildMicromapsEXT-pInfos-07515 wants multiples of 256; the layer needs none.
TEST_F(BadInputExt, UnalignedInput)
{
    gpu().breaks("VUID-vkCmdBuildMicromapsEXT-pInfos-07515");
    MicromapInput input;
    for (std::uint8_t state = 0; state < 4; ++state)
        input.add(4, kFourState, std::vector<std::uint8_t>(256, state));
    const std::uint32_t bytes = input.triangles[1].dataOffset;
    for (const bool data : {false, true}) {
        Micromap micromap(gpu(), input);
        VkMicromapBuildInfoEXT info = micromap.buildInfo();
        const VkMicromapUsageEXT three{3, 4, kFourState};
        info.usageCountsCount = 1;
        info.pUsageCounts = &three;
        // Without the first triangle, or with each triangle's data taken for that of the one before it.
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
    const Buffer buffer(gpu(), 4096, VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT);
    VkMicromapCreateInfoEXT good{};
    good.sType = VK_STRUCTURE_TYPE_MICROMAP_CREATE_INFO_EXT;
    good.buffer = buffer.handle();
    good.size = 4096;
    const auto refused = [&](const char *rule, const std::function<void(VkMicromapCreateInfoEXT &)> &change) {
        VkMicromapCreateInfoEXT create = good;
        change(create);
        VkMicromapEXT micromap = VK_NULL_HANDLE;
        EXPECT_LT(gpu().vk().CreateMicromapEXT(gpu().device(), &create, nullptr, &micromap), VK_SUCCESS);
        EXPECT_EQ(micromap, static_cast<VkMicromapEXT>(VK_NULL_HANDLE));
        expectComplaint(rule);
    };
    refused("VkMicromapCreateInfoEXT-type-parameter", [](auto &create) {
        create.type = static_cast<VkMicromapTypeEXT>(1000397000); // VK_MICROMAP_TYPE_DISPLACEMENT_MICROMAP_NV
    });
    refused("VkMicromapCreateInfoEXT-micromapCaptureReplay-11616",
            [](auto &create) { create.createFlags = VK_MICROMAP_CREATE_DEVICE_ADDRESS_CAPTURE_REPLAY_BIT_EXT; });
    // An address that means nothing is reported, and does no harm.
    VkMicromapCreateInfoEXT create = good;
    create.deviceAddress = 4096;
    VkMicromapEXT micromap = VK_NULL_HANDLE;
    EXPECT_EQ(gpu().vk().CreateMicromapEXT(gpu().device(), &create, nullptr, &micromap), VK_SUCCESS);
    expectComplaint("VkMicromapCreateInfoEXT-deviceAddress-07433");
    gpu().vk().DestroyMicromapEXT(gpu().device(), micromap, nullptr);
}

TEST_F(BadInput, RefusedBesideGood)
{
    // Of two builds in one command the good one may be done or not, the bad one must not be.
    MicromapInput input;
    input.add(2, kFourState, std::vector<std::uint8_t>(16, 1));
    Micromap other(gpu(), std::move(input));
    std::array builds{MicromapBuild{micromap_->buildInfo(), micromap_->handle()},
                      MicromapBuild{other.buildInfo(), other.handle()}};
    builds[1].info.mode = static_cast<VkBuildMicromapModeEXT>(3);
    record(builds);
    expectComplaint(id("VkMicromapBuildInfoEXT-mode-parameter", "mode-11545"));
}

// From here on: content that only the device sees. No message, but a defined picture: what lies outside is unknown.

TEST_F(BadInput, DataBeyondTheBuffer)
{
    MicromapInput input;
    for (std::uint8_t state = 0; state < 4; ++state)
        input.add(4, kFourState, std::vector<std::uint8_t>(256, 1));
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
        input.add(3, kFourState, std::vector<std::uint8_t>(64, 1));
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
    // The usage counts, and so the micromap, leave no room for these triangles' data.
    MicromapInput input;
    for (int i = 0; i < 3; ++i) {
        std::vector<std::uint8_t> states(std::size_t{1} << 16);
        for (std::size_t k = 0; k < states.size(); ++k)
            states[k] = static_cast<std::uint8_t>(k * 7 % 4);
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
    input.add(3, kFourState, std::vector<std::uint8_t>(64, 1));
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
