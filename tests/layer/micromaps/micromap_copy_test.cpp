// SPDX-License-Identifier: Apache-2.0
// Copies of micromaps: clone, compact, serialize, deserialize, compatibility; sizes by queries. Copies are checked by
// tracing them.
#include <algorithm>
#include <tuple>

#include "check/oracle/outcome.h"
#include "core/micromap.h"
#include "core/micromap_memory.h"
#include "harness/harness.h"
#include "harness/program/labels.h"
#include "harness/states.h"
#include "micromaps/build_flags.h"

namespace
{

const vt::Labels kMicromapCopyLabels{{"MicromapCopy.*", "stacked forced"},
                                     {"MicromapCopy.RejectsWrongCopies", "lenient strict"},
                                     {"MicromapCopy.SerializedHeader", "inside"},
                                     {"MicromapCopy.TooSmallATarget", "inside"},
                                     {"MicromapCopy.InvalidDataBecomesUnknown", "inside"},
                                     {"MicromapCopyValidated.*", "inside"},
                                     {"LargeMicromapCopy.*", "stacked forced inside"}};

using namespace vt;

constexpr size_t kSerializedHeader = 64;

class MicromapCopy : public GpuTest
{
protected:
    explicit MicromapCopy(const Options &options = {.shared = true}) : GpuTest(options) {}

    // 3 times 8 triangles of level 5, each pattern three times with data of its own, and 6 uniform ones.
    static MicromapInput repetitive()
    {
        Random random(17);
        MicromapInput input;
        std::vector<std::vector<uint8_t>> patterns;
        for (int i = 0; i < 8; ++i)
            patterns.push_back(randomStates(random, 5, kFourState));
        for (int round = 0; round < 3; ++round) {
            for (const auto &pattern : patterns)
                input.add(5, kFourState, pattern);
            for (const uint8_t state : {uint8_t{0}, uint8_t{1}})
                input.add(5, kFourState, std::vector<uint8_t>(1024, state));
        }
        return input;
    }
    static constexpr VkDeviceSize kRepetitiveBuilt = 64 + 30 * 8 + 30 * 256;
    static constexpr VkDeviceSize kRepetitiveCompacted = 64 + 30 * 8 + 8 * 256;

    VkDeviceSize query(const Micromap &m, VkQueryType type) { return queryMicromap(gpu(), m.handle(), type); }
    VkDeviceSize compactedSize(const Micromap &m) { return query(m, VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT); }
    VkDeviceSize serializedSize(const Micromap &m) { return query(m, VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT); }
    [[nodiscard]] VkDeviceSize reported(VkDeviceSize bytes) { return reportedSize(gpu(), bytes); }

    void copy(const Micromap &from, const Micromap &to, VkCopyMicromapModeEXT mode)
    {
        gpu().submit(
            [&](VkCommandBuffer commands) { recordMicromapCopy(gpu(), commands, from.handle(), to.handle(), mode); });
    }
    Guarded serialize(const Micromap &from)
    {
        // The fewest usage flags that an application must specify.
        Guarded out(gpu(), serializedSize(from), 256, VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
        gpu().submit(
            [&](VkCommandBuffer commands) { recordMicromapToMemory(gpu(), commands, from.handle(), out.address()); });
        EXPECT_TRUE(out.intact());
        return out;
    }
    void deserialize(std::span<const uint8_t> bytes, const Micromap &to)
    {
        const Buffer source = exact(bytes);
        gpu().submit(
            [&](VkCommandBuffer commands) { recordMemoryToMicromap(gpu(), commands, source.address(), to.handle()); });
    }
    // A buffer that ends where the bytes do.
    Buffer exact(std::span<const uint8_t> bytes)
    {
        Buffer buffer(gpu(), bytes.size(), VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
        EXPECT_EQ(buffer.address() % 256, 0u);
        std::memcpy(buffer.bytes(), bytes.data(), bytes.size());
        return buffer;
    }

    // Traces the centres of micro-triangles of every triangle: what each state makes of a hit on non-opaque geometry.
    std::vector<uint8_t> traced(const Micromap &micromap)
    {
        const MicromapInput &input = micromap.input();
        const auto count = static_cast<uint32_t>(input.triangles.size());
        Geometry geometry{.vertices = triangleRow(count)};
        geometry.micromap = Attachment{&micromap};
        const Blas blas(gpu(), {geometry});
        const Tlas tlas(gpu(), {instance(blas, {}, 1)});
        std::vector<Ray> rays;
        for (uint32_t t = 0; t < count; ++t) {
            for (const uint32_t i : samples(input.triangles[t])) {
                const auto centre = microTriangleCentre(i, input.triangles[t].subdivisionLevel);
                Ray ray;
                ray.origin = {1.5f * static_cast<float>(t) + static_cast<float>(centre[0]),
                              static_cast<float>(centre[1]), 1};
                rays.push_back(ray);
            }
        }
        std::vector<uint8_t> seen;
        for (const Result &r : Tracer(gpu()).trace(tlas, rays))
            seen.push_back(r.candidateCount > 0 ? 2 : r.committed == kTriangle ? 1 : 0);
        return seen;
    }
    // The expected result according to the input.
    static std::vector<uint8_t> expected(const MicromapInput &input)
    {
        std::vector<uint8_t> out;
        for (const VkMicromapTriangleEXT &t : input.triangles) {
            for (const uint32_t i : samples(t)) {
                const auto state = static_cast<uint8_t>(
                    vellum::readState(input.data.data() + t.dataOffset, i, static_cast<vellum::Format>(t.format)));
                out.push_back(std::min<uint8_t>(state, 2));
            }
        }
        return out;
    }
    static std::vector<uint32_t> samples(const VkMicromapTriangleEXT &t)
    {
        std::vector<uint32_t> out;
        const uint32_t count = 1u << (2 * t.subdivisionLevel);
        for (uint32_t i = 0; i < count; i += std::max(1u, count / 61))
            out.push_back(i);
        return out;
    }
    std::vector<uint8_t> unknown(const MicromapInput &input) { return std::vector<uint8_t>(expected(input).size(), 2); }

    void expectMessage(const char *part)
    {
        bool found = false;
        for (const Message &m : gpu().takeUnexpectedMessages()) {
            EXPECT_TRUE(m.fromVellum()) << m.id << ": " << m.text;
            found |= m.id.find(part) != std::string::npos;
        }
        EXPECT_TRUE(found) << part;
    }
    // The rule's id in VK_EXT_opacity_micromap or in VK_KHR_opacity_micromap.
    const char *id(const char *ext, const char *khr) { return gpu().khr() ? khr : ext; }
    static std::vector<uint8_t> bytesOf(const Guarded &guarded)
    {
        return {guarded.bytes(), guarded.bytes() + guarded.size()};
    }
};

TEST_F(MicromapCopy, CloneIsTheSame)
{
    Micromap source(gpu(), repetitive(), 0);
    source.build();
    const Micromap target(gpu(), source, source.size());
    copy(source, target, VK_COPY_MICROMAP_MODE_CLONE_EXT);
    EXPECT_EQ(std::memcmp(source.memory(), target.memory(), source.size()), 0);
    source.scribble();
    EXPECT_EQ(traced(target), expected(source.input()));
}

TEST_F(MicromapCopy, CompactionFoldsAndShares)
{
    Micromap source(gpu(), repetitive(), kAllow);
    source.build();
    EXPECT_EQ(compactedSize(source), reported(kRepetitiveCompacted));
    EXPECT_LT(compactedSize(source), source.size() / 2);
    const Micromap target(gpu(), source, kRepetitiveCompacted);
    copy(source, target, VK_COPY_MICROMAP_MODE_COMPACT_EXT);
    EXPECT_EQ(traced(target), expected(source.input()));
    // A compacted micromap can be copied and measured like any other one.
    EXPECT_EQ(compactedSize(target), reported(kRepetitiveCompacted));
    const Micromap again(gpu(), target, kRepetitiveCompacted);
    copy(target, again, VK_COPY_MICROMAP_MODE_COMPACT_EXT);
    EXPECT_EQ(std::memcmp(target.memory(), again.memory(), kRepetitiveCompacted), 0);
}

// Each size is enough for a compacting copy of each, also of a source that was written again meanwhile.
TEST_F(MicromapCopy, CompactedSizeIsThatOfEveryCopy)
{
    Micromap source(gpu(), repetitive(), kAllow | VK_BUILD_MICROMAP_PREFER_FAST_BUILD_BIT_EXT);
    source.build();
    const VkDeviceSize size = compactedSize(source);
    EXPECT_EQ(size, reported(kRepetitiveCompacted));
    const Micromap clone(gpu(), source, source.size() + 4096), restored(gpu(), source, source.size());
    copy(source, clone, VK_COPY_MICROMAP_MODE_CLONE_EXT);
    deserialize(bytesOf(serialize(source)), restored);
    source.build();
    for (const Micromap *const each : std::array<const Micromap *, 3>{&source, &clone, &restored}) {
        EXPECT_EQ(compactedSize(*each), size);
        const Micromap target(gpu(), source, kRepetitiveCompacted);
        copy(*each, target, VK_COPY_MICROMAP_MODE_COMPACT_EXT);
        EXPECT_EQ(traced(target), expected(source.input()));
    }
}

// In a handle of more than 4 MiB, more triangles than micromap_compaction.cpp expects of a small micromap.
class LargeMicromapCopy : public MicromapCopy
{
protected:
    static constexpr uint32_t kTriangles = 60'000, kBytes = 64, kPatterns = 8;
    static constexpr VkDeviceSize kCompacted = 64 + kTriangles * 8 + kPatterns * kBytes;

    static MicromapInput large()
    {
        Random random(29);
        MicromapInput input;
        input.data.resize(size_t{kTriangles} * kBytes);
        std::generate_n(input.data.begin(), kPatterns * kBytes, [&] { return static_cast<uint8_t>(random() >> 8); });
        for (uint32_t i = 0; i < kTriangles; ++i) {
            input.triangles.push_back({i * kBytes, 4, kFourState});
            std::copy_n(input.data.begin() + i % kPatterns * kBytes, kBytes,
                        input.data.begin() + ptrdiff_t{i} * kBytes);
        }
        return input;
    }
    static MicromapInput tiny()
    {
        MicromapInput input;
        input.add(4, kFourState, std::vector<uint8_t>(256, 0));
        return input;
    }
    // Records a command buffer, which execute() submits.
    template <typename Record>
    VkCommandBuffer recorded(Record record)
    {
        VkCommandBuffer commands = gpu().begin();
        record(commands);
        gpu().end(commands);
        return commands;
    }
    void execute(VkCommandBuffer commands)
    {
        gpu().execute(commands);
        vkFreeCommandBuffers(gpu().device(), gpu().pool(), 1, &commands);
    }

    Micromap source_{gpu(), large(), kAllow};
};

// A small target is enough even if the copy is recorded before the build of its source. This is the first test, since
// addresses, by which the layer remembers sizes, are used again.
TEST_F(LargeMicromapCopy, RecordedBeforeTheBuild)
{
    ASSERT_TRUE(source_.setInput(tiny()));
    source_.build();
    const Micromap target(gpu(), source_, kCompacted);
    const VkCommandBuffer early = recorded([&](VkCommandBuffer commands) {
        recordMicromapCopy(gpu(), commands, source_.handle(), target.handle(), VK_COPY_MICROMAP_MODE_COMPACT_EXT);
    });
    ASSERT_TRUE(source_.setInput(large()));
    source_.build();
    execute(early);
    const std::vector<uint8_t> expected = compactedMemory(source_.memory());
    ASSERT_EQ(expected.size(), kCompacted);
    EXPECT_EQ(std::memcmp(target.memory(), expected.data(), kCompacted), 0);
}

// A copy fits in the size that a query has reported, although another build of the source is recorded between: it is
// executed after the copy.
TEST_F(LargeMicromapCopy, BeforeALaterBuild)
{
    source_.build();
    EXPECT_EQ(compactedSize(source_), reported(kCompacted));
    const std::vector<uint8_t> expected = compactedMemory(source_.memory());
    ASSERT_EQ(expected.size(), kCompacted);
    ASSERT_TRUE(source_.setInput(tiny()));
    const VkCommandBuffer later = recorded([&](VkCommandBuffer commands) { source_.record(commands); });
    const Micromap target(gpu(), source_, kCompacted);
    copy(source_, target, VK_COPY_MICROMAP_MODE_COMPACT_EXT);
    EXPECT_EQ(std::memcmp(target.memory(), expected.data(), kCompacted), 0);
    execute(later);
}

// Only a build with the flag promises a size of less than a clone's.
TEST_F(MicromapCopy, WithoutTheFlagNothingIsShared)
{
    gpu().breaks("VUID-vkCmdWriteMicromapsPropertiesEXT-pMicromaps-07502");
    gpu().breaks("VUID-vkCmdWriteAccelerationStructuresPropertiesKHR-accelerationStructures-03431");
    Micromap source(gpu(), repetitive(), 0);
    source.build();
    EXPECT_EQ(compactedSize(source), reported(kRepetitiveBuilt));
}

// Queries and copies of one micromap, many in one command, without a dependency between them.
TEST_F(MicromapCopy, CompactionsSideBySide)
{
    Micromap source(gpu(), repetitive(), kAllow);
    source.build();
    const VkQueryType type = micromapQueryType(gpu(), VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT);
    const QueryPool pool(gpu(), type, 20);
    const std::vector<MicromapHandle> handles(20, source.handle());
    const Micromap first(gpu(), source, kRepetitiveCompacted), second(gpu(), source, kRepetitiveCompacted);
    gpu().submit([&](VkCommandBuffer commands) {
        vkCmdResetQueryPool(commands, pool, 0, 20);
        recordMicromapProperties(gpu(), commands, handles, type, pool, 0);
        for (const Micromap *const target : {&first, &second})
            recordMicromapCopy(gpu(), commands, source.handle(), target->handle(), VK_COPY_MICROMAP_MODE_COMPACT_EXT);
    });
    for (uint32_t query = 0; query < 20; ++query)
        EXPECT_EQ(pool.value(query), reported(kRepetitiveCompacted)) << query;
    EXPECT_EQ(traced(first), expected(source.input()));
    EXPECT_EQ(traced(second), expected(source.input()));
}

TEST_F(MicromapCopy, CompactedSizeDoesNotDependOnTheRun)
{
    // Many equal triangles, so that invocations compete for the slots; scratch memory holds what the run before left.
    Random random(23);
    std::vector<std::vector<uint8_t>> patterns;
    for (int i = 0; i < 40; ++i)
        patterns.push_back(randomStates(random, 3, kFourState));
    MicromapInput input;
    for (int i = 0; i < 5000; ++i)
        input.add(3, kFourState, patterns[(random() >> 8) % patterns.size()]);
    Micromap micromap(gpu(), input, kAllow);
    micromap.build();
    const VkDeviceSize size = compactedSize(micromap);
    const Micromap first(gpu(), micromap, size), target(gpu(), micromap, size);
    copy(micromap, first, VK_COPY_MICROMAP_MODE_COMPACT_EXT);
    for (int run = 0; run < 10; ++run) {
        ASSERT_EQ(compactedSize(micromap), size);
        target.forget();
        copy(micromap, target, VK_COPY_MICROMAP_MODE_COMPACT_EXT);
        ASSERT_EQ(std::memcmp(target.memory(), first.memory(), vellum::micromapMemoryInUse(first.memory())), 0);
    }
}

TEST_F(MicromapCopy, SerializedHeader)
{
    Micromap source(gpu(), repetitive(), kAllow);
    source.build();
    const Guarded bytes = serialize(source);
    ASSERT_EQ(bytes.size(), kSerializedHeader + kRepetitiveBuilt);
    auto id = vkInit<VkPhysicalDeviceIDProperties>();
    auto properties = vkInit<VkPhysicalDeviceProperties2>({.pNext = &id});
    vkGetPhysicalDeviceProperties2(gpu().physical(), &properties);
    EXPECT_EQ(std::memcmp(bytes.bytes(), id.driverUUID, VK_UUID_SIZE), 0);
    uint64_t sizes[2];
    std::memcpy(sizes, bytes.bytes() + 32, 16);
    EXPECT_EQ(sizes[0], bytes.size());
    EXPECT_EQ(sizes[1], reported(kRepetitiveBuilt));
    EXPECT_EQ(std::memcmp(bytes.bytes() + kSerializedHeader, source.memory(), kRepetitiveBuilt), 0);
}

TEST_F(MicromapCopy, CompatibilityOfEveryByte)
{
    Micromap source(gpu(), repetitive());
    source.build();
    const Guarded bytes = serialize(source);
    const auto compatible = [&] { return micromapIsCompatible(gpu(), bytes.bytes()); };
    EXPECT_TRUE(compatible());
    for (size_t i = 0; i < 2 * VK_UUID_SIZE; ++i) {
        bytes.bytes()[i] ^= 1;
        EXPECT_FALSE(compatible()) << i;
        bytes.bytes()[i] ^= 1;
    }
    EXPECT_TRUE(compatible());
    // Without VK_KHR_opacity_micromap it is no data of an acceleration structure.
    const auto version = vkInit<VkAccelerationStructureVersionInfoKHR>({.pVersionData = bytes.bytes()});
    VkAccelerationStructureCompatibilityKHR result = VK_ACCELERATION_STRUCTURE_COMPATIBILITY_MAX_ENUM_KHR;
    gpu().vk().GetDeviceAccelerationStructureCompatibilityKHR(gpu().device(), &version, &result);
    EXPECT_EQ(result == VK_ACCELERATION_STRUCTURE_COMPATIBILITY_COMPATIBLE_KHR, gpu().khr());
}

TEST_F(MicromapCopy, SerializedMicromapsCanBeReloaded)
{
    for (const VkBuildMicromapFlagsEXT flags : {VkBuildMicromapFlagsEXT{0}, kAllow}) {
        Micromap source(gpu(), repetitive(), flags);
        source.build();
        const std::vector<uint8_t> bytes = bytesOf(serialize(source));
        // Into one of the source's size, one that it just fits in, and a larger one.
        for (const VkDeviceSize size :
             {source.size(), VkDeviceSize{bytes.size() - kSerializedHeader}, source.size() + 4096}) {
            const Micromap target(gpu(), source, size);
            deserialize(bytes, target);
            EXPECT_EQ(traced(target), expected(source.input()));
            EXPECT_EQ(bytesOf(serialize(target)), bytes);
        }
    }
}

TEST_F(MicromapCopy, InvalidDataBecomesUnknown)
{
    Micromap source(gpu(), repetitive());
    source.build();
    const std::vector<uint8_t> good = bytesOf(serialize(source));
    const auto expectUnknown = [&](std::vector<uint8_t> bytes, VkDeviceSize size, const char *what,
                                   bool tooLarge = false) {
        SCOPED_TRACE(what);
        const Micromap target(gpu(), source, size);
        deserialize(bytes, target);
        EXPECT_EQ(traced(target), unknown(source.input()));
        expectMessage(tooLarge ? "VELLUM-micromap-copy-size" : "VELLUM-micromap-serialized");
    };
    expectUnknown({good.begin(), good.end() - 16}, source.size(), "cut off");
    expectUnknown({good.begin(), good.begin() + 64}, source.size(), "only a header");
    expectUnknown({good.begin(), good.begin() + 16}, source.size(), "less than a header");
    expectUnknown(std::vector<uint8_t>(good.size(), 0), source.size(), "zeros");
    expectUnknown(std::vector<uint8_t>(good.size(), 0xff), source.size(), "ones");
    expectUnknown(good, good.size() - kSerializedHeader - 16, "too large for the target", true);
    std::vector<uint8_t> other = good;
    other[28] ^= 0x40;
    expectUnknown(other, source.size(), "another layout");
    other = good;
    std::memset(other.data() + kSerializedHeader + 4, 0xff, 8); // counts of triangles and units
    expectUnknown(other, source.size(), "huge counts");
}

TEST_F(MicromapCopy, RecordsOfAFileAreNotTrusted)
{
    MicromapInput input;
    Random random(9);
    for (int i = 0; i < 32; ++i)
        input.add(5, kFourState, std::vector<uint8_t>(1024, static_cast<uint8_t>(i % 2)));
    for (int i = 0; i < 32; ++i)
        input.add(5, kFourState, randomStates(random, 5, kFourState));
    Micromap source(gpu(), std::move(input));
    source.build();
    std::vector<uint8_t> bytes = bytesOf(serialize(source));
    const auto record = [&](size_t i, uint32_t word0, uint32_t word1) {
        const uint32_t words[2] = {word0, word1};
        std::memcpy(bytes.data() + kSerializedHeader + 64 + i * 8, words, 8);
    };
    record(40, 6 | 0x7ffffffu << 5, 0xaaaaaaaa); // far outside
    record(41, 20 | 0u << 5, 0xaaaaaaaa);        // level 12
    record(42, 25, 0xaaaaaaaa);                  // level 15
    record(43, 31 | 3u << 5, 0xfffffff0);        // far kind
    record(44, 31 | 0xffffffe0, 0);              // far kind of no level
    const Micromap target(gpu(), source, source.size());
    deserialize(bytes, target);
    const std::vector<uint8_t> seen = traced(target);
    std::vector<uint8_t> want = expected(source.input());
    const size_t each = want.size() / 64;
    std::fill(want.begin() + static_cast<ptrdiff_t>(40 * each), want.begin() + static_cast<ptrdiff_t>(45 * each),
              uint8_t{2});
    EXPECT_EQ(seen, want);
}

TEST_F(MicromapCopy, TooSmallATarget)
{
    Micromap source(gpu(), repetitive(), kAllow);
    source.build();
    const Micromap target(gpu(), source, kRepetitiveCompacted - 16);
    copy(source, target, VK_COPY_MICROMAP_MODE_COMPACT_EXT);
    EXPECT_EQ(traced(target), unknown(source.input()));
    expectMessage("VELLUM-micromap-copy-size");
}

TEST_F(MicromapCopy, RejectsWrongCopies)
{
    Micromap source(gpu(), repetitive(), kAllow);
    source.build();
    const Micromap target(gpu(), source, source.size());
    // A tolerated fault is executed, unless the layer is strict.
    const auto expectDone = [&] {
        EXPECT_EQ(traced(target) == expected(source.input()), !strictTests());
        target.forget();
    };
    copy(source, target, VK_COPY_MICROMAP_MODE_SERIALIZE_EXT);
    expectMessage(id("VkCopyMicromapInfoEXT-mode-07531", "VkCopyAccelerationStructureInfoKHR-mode-03410"));
    expectDone();
    copy(source, source, VK_COPY_MICROMAP_MODE_CLONE_EXT);
    expectMessage(id("VELLUM-micromap-copy-overlap", "VkCopyAccelerationStructureInfoKHR-dst-07791"));
    for (const auto &[from, to, ext, khr] :
         {std::tuple{MicromapHandle{}, target.handle(), "VkCopyMicromapInfoEXT-src-parameter",
                     "VkCopyAccelerationStructureInfoKHR-src-parameter"},
          std::tuple{source.handle(), MicromapHandle{}, "VkCopyMicromapInfoEXT-dst-parameter",
                     "VkCopyAccelerationStructureInfoKHR-dst-parameter"}}) {
        gpu().submit([&, from = from, to = to](VkCommandBuffer commands) {
            recordMicromapCopy(gpu(), commands, from, to, VK_COPY_MICROMAP_MODE_CLONE_EXT);
        });
        expectMessage(id(ext, khr));
    }
    const Buffer memory(gpu(), 65536, VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    const auto rejected = [&](VkDeviceAddress address, VkCopyMicromapModeEXT out, VkCopyMicromapModeEXT in,
                              const char *outId, const char *inId) {
        gpu().submit(
            [&](VkCommandBuffer commands) { recordMicromapToMemory(gpu(), commands, source.handle(), address, out); });
        expectMessage(outId);
        gpu().submit(
            [&](VkCommandBuffer commands) { recordMemoryToMicromap(gpu(), commands, address, target.handle(), in); });
        expectMessage(inId);
    };
    constexpr auto kOut = VK_COPY_MICROMAP_MODE_SERIALIZE_EXT;
    constexpr auto kIn = VK_COPY_MICROMAP_MODE_DESERIALIZE_EXT;
    constexpr auto kClone = VK_COPY_MICROMAP_MODE_CLONE_EXT;
    rejected(0, kOut, kIn, id("07536", "03739"), id("07543", "03742"));
    rejected(memory.address() + 8, kOut, kIn, id("07537", "11699"), id("07544", "11700"));
    // Validation 1.4.363 above crashes on VK_NULL_HANDLE for an acceleration structure here.
    if (!gpu().khr() || validationOfTests() == Validation::Below) {
        gpu().submit([&](VkCommandBuffer commands) { recordMicromapToMemory(gpu(), commands, {}, memory.address()); });
        expectMessage(id("VkCopyMicromapToMemoryInfoEXT-src-parameter",
                         "VkCopyAccelerationStructureToMemoryInfoKHR-src-parameter"));
    }
    gpu().submit([&](VkCommandBuffer commands) { recordMemoryToMicromap(gpu(), commands, memory.address(), {}); });
    expectMessage(
        id("VkCopyMemoryToMicromapInfoEXT-dst-parameter", "VkCopyMemoryToAccelerationStructureInfoKHR-dst-parameter"));
    for (const uint8_t byte : memory.as<uint8_t>())
        ASSERT_EQ(byte, 0);
    rejected(memory.address() + 16, kOut, kIn, id("07537", "11699"), id("07544", "11700"));
    expectDone();
    rejected(memory.address(), kClone, kClone, id("07542", "03412"), id("07548", "03413"));
    expectDone();
}

TEST_F(MicromapCopy, ALargeMicromap)
{
    Random random(31);
    MicromapInput input;
    for (int i = 0; i < 300; ++i)
        input.add(6, kFourState, randomStates(random, 6, kFourState));
    input.add(10, kTwoState, randomStates(random, 10, kTwoState));
    Micromap source(gpu(), std::move(input), kAllow);
    source.build();
    const Micromap compact(gpu(), source, compactedSize(source));
    copy(source, compact, VK_COPY_MICROMAP_MODE_COMPACT_EXT);
    const Micromap target(gpu(), source, source.size());
    deserialize(bytesOf(serialize(compact)), target);
    EXPECT_EQ(traced(target), expected(source.input()));
}

// 2^22 triangles that share 64 patterns, compacted; some of them, picked out by index, are traced.
TEST_F(MicromapCopy, FourMillionTriangles)
{
    constexpr uint32_t kCount = 1u << 22;
    MicromapInput input;
    input.declared = {{kCount, 3, kFourState}};
    Random random(41);
    std::vector<std::vector<uint8_t>> patterns;
    for (int i = 0; i < 64; ++i) {
        std::vector<uint8_t> states(64);
        for (uint8_t &state : states)
            state = static_cast<uint8_t>(random() >> 8 & 3u);
        patterns.push_back(states);
        input.add(3, kFourState, states);
    }
    input.triangles.resize(kCount);
    const auto patternOf = [](uint32_t i) { return i * 2654435761u >> 26; };
    for (uint32_t i = 0; i < kCount; ++i)
        input.triangles[i] = {patternOf(i) * 16, 3, kFourState};
    Micromap source(gpu(), std::move(input), kAllow);
    source.build();
    const VkDeviceSize size = compactedSize(source);
    EXPECT_EQ(size, reported(64 + kCount * 8ull + 64 * 16));
    const Micromap compact(gpu(), source, size);
    copy(source, compact, VK_COPY_MICROMAP_MODE_COMPACT_EXT);

    Attachment attachment{&compact, VK_INDEX_TYPE_UINT32};
    for (uint32_t i = 0; i < 64; ++i)
        attachment.indices.push_back(static_cast<int32_t>(i * 65537 + 64511));
    Geometry geometry{.vertices = triangleRow(64)};
    geometry.micromap = attachment;
    const Blas blas(gpu(), {geometry});
    const Tlas tlas(gpu(), {instance(blas, {}, 1)});
    std::vector<Ray> rays;
    std::vector<int> expectedCandidates;
    for (uint32_t t = 0; t < 64; ++t) {
        for (uint32_t i = 0; i < 64; ++i) {
            const auto centre = microTriangleCentre(i, 3);
            Ray ray;
            ray.origin = {1.5f * static_cast<float>(t) + static_cast<float>(centre[0]), static_cast<float>(centre[1]),
                          1};
            rays.push_back(ray);
            const auto micromapTriangle = static_cast<uint32_t>(attachment.indices[t]);
            expectedCandidates.push_back(patterns[patternOf(micromapTriangle)][i] >= 2 ? 1 : 0);
        }
    }
    std::vector<int> candidates;
    for (const Result &r : Tracer(gpu()).trace(tlas, rays))
        candidates.push_back(static_cast<int>(r.candidateCount));
    EXPECT_EQ(candidates, expectedCandidates);
}

TEST_F(MicromapCopy, OneTriangleOfLevelTwelve)
{
    Random random(43);
    MicromapInput input;
    std::vector<uint8_t> states(size_t{1} << 24);
    for (uint8_t &state : states)
        state = static_cast<uint8_t>(random() >> 8 & 3u);
    input.add(12, kFourState, states);
    for (const VkBuildMicromapFlagsEXT flags : {VkBuildMicromapFlagsEXT{0}, kAllow}) {
        Micromap source(gpu(), input, flags);
        source.build();
        const Micromap target(gpu(), source, compactedSize(source));
        copy(source, target, VK_COPY_MICROMAP_MODE_COMPACT_EXT);
        EXPECT_EQ(traced(target), expected(input));
    }
}

class MicromapCopyValidated : public MicromapCopy
{
protected:
    MicromapCopyValidated() : MicromapCopy(Options{.validate = true}) {}
};

TEST_F(MicromapCopyValidated, ReportsWrongCopies)
{
    Micromap source(gpu(), repetitive(), kAllow);
    source.build();
    const Micromap small(gpu(), source, kRepetitiveCompacted - 16);
    expectNoMessages();
    const auto expectGpuError = [this](const char *part) {
        gpu().submit([](VkCommandBuffer) {});
        expectMessage(part);
    };
    copy(source, small, VK_COPY_MICROMAP_MODE_COMPACT_EXT);
    expectGpuError(id("VELLUM-micromap-copy-size", "VkCopyAccelerationStructureInfoKHR-mode-12419"));
    const Micromap target(gpu(), source, source.size());
    deserialize(std::vector<uint8_t>(1000, 7), target);
    expectGpuError(
        id("VkCopyMemoryToMicromapInfoEXT-src-07549", "VkCopyMemoryToAccelerationStructureInfoKHR-pInfo-03414"));
    const Buffer memory(gpu(), 65536, VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    gpu().submit(
        [&](VkCommandBuffer commands) { recordMicromapToMemory(gpu(), commands, target.handle(), memory.address()); });
    expectGpuError("VELLUM-micromap-not-constructed");
    for (const uint8_t byte : memory.as<uint8_t>())
        ASSERT_EQ(byte, 0);
}

} // namespace
