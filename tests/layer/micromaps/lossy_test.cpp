// SPDX-License-Identifier: Apache-2.0
// Lossy micromaps of VK_KHR_opacity_micromap: the device writes the same bits as core/lossy.h, and rays find the
// application's state or an unknown state in its place.
#include <algorithm>
#include <cmath>

#include "check/oracle/outcome.h"
#include "core/lossy.h"
#include "core/micromap_memory.h"
#include "harness/harness.h"
#include "harness/program/labels.h"
#include "harness/states.h"
#include "micromaps/build_flags.h"

namespace
{

const vt::Labels kLossyLabels{{"Lossy.*", "slow"}};

using namespace vt;

constexpr std::array<VkBuildMicromapFlagsEXT, 4> kFlags{0, kAllow, kTrace | kAllow, kFast};

vellum::Micromap modelOf(const MicromapInput &input)
{
    vellum::Micromap model;
    model.data = input.data;
    for (const VkMicromapTriangleEXT &t : input.triangles)
        model.triangles.push_back({t.dataOffset, t.subdivisionLevel, static_cast<vellum::Format>(t.format)});
    return vellum::lossyMicromap(model);
}

// A lossy micromap's memory, as the host writes the coarsened one: each triangle's data units follow those before it.
std::vector<uint8_t> memoryOf(const MicromapInput &input, VkBuildMicromapFlagsEXT flags)
{
    const vellum::Micromap lossy = modelOf(input);
    std::vector<vellum::MicromapTriangle> triangles = lossy.triangles;
    std::vector<uint8_t> data;
    for (size_t i = 0; i < 2 * triangles.size(); ++i) {
        vellum::MicromapTriangle &t = triangles[i % triangles.size()];
        if ((t.subdivisionLevel > 2) != (i < triangles.size())) // these have no units, and come last
            continue;
        data.resize((data.size() + 15) / 16 * 16);
        const auto offset = static_cast<uint32_t>(data.size());
        const auto from = lossy.data.begin() + t.dataOffset;
        data.insert(data.end(), from, from + vellum::packedBytes(t.subdivisionLevel, t.format));
        t.dataOffset = offset;
    }
    vellum::MicromapBuildInput build;
    build.triangles = reinterpret_cast<const uint8_t *>(triangles.data());
    build.triangleCount = static_cast<uint32_t>(triangles.size());
    build.data = data.data();
    build.dataBytes = data.size();
    build.buildFlags = flags;
    build.maxLevel = 12;
    for (const VkMicromapTriangleEXT &t : input.triangles)
        if (t.subdivisionLevel > 2)
            build.capacityUnits +=
                (vellum::packedBytes(t.subdivisionLevel, static_cast<vellum::Format>(t.format)) + 15) / 16;
    std::vector<uint8_t> memory(
        vellum::micromapMemoryBytes(build.triangleCount, build.capacityUnits)); // zeros between data
    vellum::writeMicromapMemory(build, memory.data());
    memory.resize(vellum::micromapMemoryInUse(memory.data()));
    return memory;
}

// Leaves: ellipses at random, unknown where their edges are.
std::vector<uint8_t> foliage(Random &random, uint32_t level)
{
    struct Leaf {
        double u, v, length, width, angle;
    };
    std::vector<Leaf> leaves(3);
    const auto uniform = [&] { return static_cast<double>(random() >> 8) / (1 << 24); };
    for (Leaf &leaf : leaves)
        leaf = {0.8 * uniform(), 0.8 * uniform(), 0.2 + 0.2 * uniform(), 0.08 + 0.08 * uniform(), 6.3 * uniform()};
    std::vector<uint8_t> states(size_t{1} << (2 * level));
    const double reach = 1.0 / (1u << level);
    for (uint32_t i = 0; i < states.size(); ++i) {
        const auto [u, v] = microTriangleCentre(i, level);
        double least = 1e9;
        for (const Leaf &leaf : leaves) {
            const double x = std::cos(leaf.angle) * (u - leaf.u) + std::sin(leaf.angle) * (v - leaf.v);
            const double y = std::cos(leaf.angle) * (v - leaf.v) - std::sin(leaf.angle) * (u - leaf.u);
            least = std::min(least, (std::hypot(x / leaf.length, y / leaf.width) - 1) * leaf.width);
        }
        const bool unknown = std::abs(least) < reach;
        states[i] = static_cast<uint8_t>((unknown ? 2 : 0) | (least < 0 ? 1 : 0));
    }
    return states;
}

class Lossy : public GpuTest
{
protected:
    explicit Lossy(bool validate = false) : GpuTest(Options{.api = Api::Khr, .validate = validate, .shared = !validate})
    {
    }

    static std::vector<uint8_t> inUse(const Micromap &micromap)
    {
        return {micromap.memory(), micromap.memory() + vellum::micromapMemoryInUse(micromap.memory())};
    }
    void expectModel(const MicromapInput &input)
    {
        for (const VkBuildMicromapFlagsEXT flags : kFlags) {
            SCOPED_TRACE(testing::Message() << "flags " << flags);
            Micromap micromap(gpu(), input, flags | kLossy);
            micromap.build();
            const std::vector<uint8_t> expected = memoryOf(input, flags | kLossy);
            const std::vector<uint8_t> actual = inUse(micromap);
            ASSERT_EQ(actual.size(), expected.size());
            const auto at = std::mismatch(actual.begin(), actual.end(), expected.begin()).first - actual.begin();
            EXPECT_EQ(static_cast<size_t>(at), actual.size()) << "differs from byte " << at;
        }
    }
    VkDeviceSize compactedSize(const Micromap &micromap)
    {
        const QueryPool pool(gpu(), VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR);
        const VkAccelerationStructureKHR structure = micromap.handle().khr;
        gpu().submit([&](VkCommandBuffer commands) {
            vkCmdResetQueryPool(commands, pool, 0, 1);
            gpu().vk().CmdWriteAccelerationStructuresPropertiesKHR(commands, 1, &structure, pool.type(), pool, 0);
        });
        return pool.value();
    }
};

class LossyValidated : public Lossy
{
protected:
    LossyValidated() : Lossy(true) {}
};

TEST_F(Lossy, EveryLevel)
{
    Random random(23);
    MicromapInput input;
    for (uint32_t level = 0; level <= 12; ++level)
        input.add(level, kFourState, randomStates(random, level, kFourState));
    expectModel(input);
}

// All levels that a triangle may have afterwards.
TEST_F(Lossy, EveryLevelToEveryLower)
{
    Random random(29);
    MicromapInput input;
    for (uint32_t level = 3; level <= 10; ++level) {
        for (uint32_t to = 2; to <= level; ++to) {
            const std::vector<uint8_t> coarse = randomStates(random, to, kFourState);
            std::vector<uint8_t> states(size_t{1} << (2 * level));
            for (size_t i = 0; i < states.size(); ++i)
                states[i] = coarse[i >> (2 * (level - to))];
            for (uint32_t speck = 0; speck < (to + 1) % 3; ++speck) // lost, or in the way
                states[random() % states.size()] ^= 1;
            input.add(level, kFourState, states);
        }
    }
    // Level 12 is reduced to 2, across the largest number of levels.
    std::vector<uint8_t> largest(size_t{1} << 24);
    for (size_t i = 0; i < largest.size(); ++i)
        largest[i] = (i >> 20) % 3 == 0;
    input.add(12, kFourState, largest);
    uint32_t levels = 0;
    const vellum::Micromap model = modelOf(input);
    for (size_t i = 0; i < model.triangles.size(); ++i)
        levels |= 1u << (input.triangles[i].subdivisionLevel - model.triangles[i].subdivisionLevel);
    EXPECT_EQ(levels, 0x5ffu);
    expectModel(input);
}

// They cost nothing, and what they become in 2-state override mode is decided by all of them.
TEST_F(Lossy, UnknownStatesOfBothKinds)
{
    Random random(61);
    MicromapInput input;
    for (uint32_t level = 3; level <= 10; ++level) {
        std::vector<uint8_t> states(size_t{1} << (2 * level));
        for (size_t i = 0; i < states.size(); ++i) {
            const size_t node = i >> (2 * (level - 2));
            states[i] = static_cast<uint8_t>(2 + (random() % 16 < node ? 1 : 0));
        }
        input.add(level, kFourState, states);
        const size_t half = states.size() / 32; // of each node of level 2: even, and one more or less
        for (size_t i = 0; i < states.size(); ++i)
            states[i] = static_cast<uint8_t>(2 + (i % (2 * half) < half + i / (2 * half) % 3 - 1 ? 1 : 0));
        input.add(level, kFourState, states);
    }
    for (const vellum::MicromapTriangle &t : modelOf(input).triangles)
        EXPECT_EQ(t.subdivisionLevel, 2);
    expectModel(input);
}

TEST_F(Lossy, ManyTriangles)
{
    for (const size_t count : {1u, 2u, 257u, 3001u}) {
        SCOPED_TRACE(testing::Message() << count << " triangles");
        Random random(static_cast<uint32_t>(count));
        MicromapInput input;
        input.stride = 12;
        while (input.triangles.size() < count) {
            const uint32_t level = random() % 7;
            if (!input.triangles.empty() && random() % 4 == 0)
                input.triangles.push_back(input.triangles[random() % input.triangles.size()]);
            else if (random() % 3 == 0)
                input.add(level, kFourState, foliage(random, level));
            else
                input.add(level, kFourState, randomStates(random, level, kFourState));
        }
        expectModel(input);
    }
}

// Data at odd bytes, of triangles in one part and in several.
TEST_F(Lossy, UnalignedInput)
{
    // A rule of VK_KHR_opacity_micromap's; the layer takes any stride.
    gpu().breaks("VUID-VkAccelerationStructureGeometryMicromapDataKHR-triangleArrayStride-11647");
    Random random(31);
    MicromapInput input;
    input.stride = 9;
    for (uint32_t i = 0; i < 40; ++i) {
        const uint32_t level = i % 10;
        input.data.push_back(0x77);
        input.add(level, kFourState, i % 2 == 0 ? foliage(random, level) : randomStates(random, level, kFourState));
    }
    expectModel(input);
}

// Equal input gives equal micromaps, in whatever order invocations run; other triangles in between change no triangle.
TEST_F(Lossy, Invariance)
{
    Random random(37);
    MicromapInput input;
    for (uint32_t i = 0; i < 200; ++i)
        input.add(3 + i % 6, kFourState, foliage(random, 3 + i % 6));
    for (const VkBuildMicromapFlagsEXT flags : kFlags) {
        Micromap first(gpu(), input, flags | kLossy);
        Micromap second(gpu(), input, flags | kLossy);
        first.build();
        gpu().submit([&](VkCommandBuffer commands) {
            first.record(commands);
            second.record(commands);
        });
        EXPECT_EQ(inUse(first), inUse(second));
        second.scribble();
        EXPECT_EQ(inUse(first), memoryOf(input, flags | kLossy));
    }
}

TEST_F(Lossy, CompactionSaves)
{
    Random random(41);
    MicromapInput input;
    for (uint32_t i = 0; i < 64; ++i)
        input.add(8, kFourState, foliage(random, 8));
    Micromap lossless(gpu(), input, kAllow);
    lossless.build();
    Micromap lossy(gpu(), input, kAllow | kLossy);
    lossy.build();
    EXPECT_EQ(lossy.size(), lossless.size()); // as large as the usage counts require
    const VkDeviceSize bytes = compactedSize(lossy);
    EXPECT_LT(2 * bytes, compactedSize(lossless));
    const Micromap compacted(gpu(), lossy, bytes);
    auto copy = vkInit<VkCopyAccelerationStructureInfoKHR>({.src = lossy.handle().khr,
                                                            .dst = compacted.handle().khr,
                                                            .mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR});
    gpu().submit([&](VkCommandBuffer commands) { gpu().vk().CmdCopyAccelerationStructureKHR(commands, &copy); });
    EXPECT_EQ(inUse(compacted), compactedMemory(memoryOf(input, kAllow | kLossy).data()));
    EXPECT_LT(2 * inUse(lossy).size(), inUse(lossless).size());
}

// A shader that takes unknown hits for what the application's data says sees the same picture.
TEST_F(Lossy, RaysSeeTheStateOrACandidate)
{
    Random random(43);
    MicromapInput input;
    std::vector<std::vector<uint8_t>> states;
    for (const uint32_t level : {2u, 4u, 5u, 6u, 7u, 8u}) {
        states.push_back(foliage(random, level));
        input.add(level, kFourState, states.back());
    }
    Micromap micromap(gpu(), input, kAllow | kLossy);
    micromap.build();
    micromap.scribble();
    Geometry geometry{.vertices = triangleRow(static_cast<uint32_t>(states.size()))};
    geometry.micromap = Attachment{&micromap};
    const Blas blas(gpu(), {geometry});
    Tlas tlas(gpu(), std::vector{instance(blas, {}, 0)});
    std::vector<Ray> rays;
    std::vector<std::pair<size_t, uint32_t>> places;
    for (size_t t = 0; t < states.size(); ++t) {
        const uint32_t level = input.triangles[t].subdivisionLevel;
        for (uint32_t i = 0; i<states[t].size(); i += level> 6 ? 7 : 1) {
            const auto [u, v] = microTriangleCentre(i, level);
            for (const uint32_t flags : {0u, kRayForceTwoState}) {
                rays.push_back(
                    {.origin = {1.5f * static_cast<float>(t) + static_cast<float>(u), static_cast<float>(v), 1},
                     .flags = flags});
                places.emplace_back(t, i);
            }
        }
    }
    const std::vector<Result> results = Tracer(gpu()).trace(tlas, rays);
    const vellum::Micromap model = modelOf(input);
    std::vector<size_t> candidates(states.size());
    std::vector<size_t> needed(states.size());
    std::vector<size_t> tried(states.size());
    for (size_t r = 0; r < rays.size(); ++r) {
        const auto [t, i] = places[r];
        const uint8_t state = states[t][i];
        const Result &seen = results[r];
        if (rays[r].flags != 0) {
            // The model says how the even or larger part of an unknown micro-triangle is taken.
            const uint32_t rise = input.triangles[t].subdivisionLevel - model.triangles[t].subdivisionLevel;
            const auto lossy = vellum::readState(model.data.data() + model.triangles[t].dataOffset, i >> (2 * rise),
                                                 vellum::Format::FourState);
            EXPECT_EQ(seen.candidateCount, 0u);
            EXPECT_EQ(seen.committed, (static_cast<unsigned>(lossy) & 1) != 0 ? kTriangle : kNone);
            continue;
        }
        ++tried[t];
        needed[t] += state >= 2 ? 1u : 0u;
        candidates[t] += seen.candidateCount;
        ASSERT_TRUE(seen.candidateCount == 1 || (state < 2 && seen.candidateCount == 0))
            << "triangle " << t << ", " << i;
        if (seen.candidateCount == 0) {
            EXPECT_EQ(seen.committed, state == 1 ? kTriangle : kNone) << "triangle " << t << ", " << i;
        }
    }
    for (size_t t = 0; t < states.size(); ++t)
        EXPECT_LE(static_cast<double>(candidates[t] - needed[t]), static_cast<double>(tried[t]) / 16 * 1.1)
            << "triangle " << t;
    EXPECT_GT(candidates.back(), needed.back());
}

// Micromaps without levels above 2 cannot become smaller.
TEST_F(Lossy, SmallTrianglesTakeNoMoreMemory)
{
    MicromapInput input;
    input.add(2, kFourState, std::vector<uint8_t>(16, 3));
    Micromap lossless(gpu(), input, kAllow);
    Micromap lossy(gpu(), input, kAllow | kLossy);
    lossy.build();
    lossless.build();
    EXPECT_EQ(lossy.size(), lossless.size());
    EXPECT_EQ(inUse(lossy).size(), inUse(lossless).size());
}

// Reported as in a lossless build; every other triangle has the state that it would have without the wrong ones.
TEST_F(LossyValidated, WrongInput)
{
    Random random(47);
    MicromapInput good;
    for (uint32_t i = 0; i < 300; ++i)
        good.add(3 + i % 6, kFourState, foliage(random, 3 + i % 6));
    MicromapInput wrong = good;
    wrong.declared = good.usage();
    wrong.triangles[1].subdivisionLevel = 13;
    wrong.triangles[2].subdivisionLevel = 0xffff;
    wrong.triangles[3].format = 0;
    wrong.triangles[4].format = 3;
    wrong.triangles[5].dataOffset = 0xfffffff0;
    wrong.triangles[6].subdivisionLevel = 9;
    wrong.triangles[257].dataOffset = static_cast<uint32_t>(good.data.size() - 1);
    const std::vector<size_t> bad{1, 2, 3, 4, 5, 6, 257};
    for (const VkBuildMicromapFlagsEXT flags : kFlags) {
        SCOPED_TRACE(testing::Message() << "flags " << flags);
        const auto reported = [&](const MicromapInput &input, VkBuildMicromapFlagsEXT all) {
            Micromap micromap(gpu(), input, all);
            micromap.build();
            std::vector<std::string> messages;
            for (const Message &m : gpu().takeUnexpectedMessages())
                messages.push_back(m.id + "|" + m.text);
            std::sort(messages.begin(), messages.end());
            return messages;
        };
        const std::vector<std::string> lossless = reported(wrong, flags);
        EXPECT_EQ(lossless.size(), bad.size());
        const std::vector<std::string> lossy = reported(wrong, flags | kLossy);
        EXPECT_EQ(lossy.size(), bad.size());
        for (const size_t triangle : bad) {
            const auto names = [part = "]: triangle " + std::to_string(triangle) + ": "](const std::string &m) {
                return m.find(part) != std::string::npos;
            };
            EXPECT_EQ(std::ranges::count_if(lossless, names), 1) << triangle;
            EXPECT_EQ(std::ranges::count_if(lossy, names), 1) << triangle;
        }
        EXPECT_TRUE(reported(good, flags | kLossy).empty());
        MicromapInput fewer = good;
        fewer.declared = good.usage();
        fewer.declared[0].count += 2;
        fewer.triangles.push_back({0, 0, kFourState});
        fewer.triangles.push_back({0, 0, kFourState});
        EXPECT_EQ(reported(fewer, flags | kLossy).size(), 1u); // of the counts
        Micromap micromap(gpu(), wrong, flags | kLossy);
        micromap.build();
        gpu().takeUnexpectedMessages();
        for (const size_t t : bad) {
            uint32_t record[2];
            std::memcpy(record, micromap.memory() + 64 + 8 * t, 8);
            EXPECT_EQ(record[0] & 31, 0u) << "triangle " << t;
            EXPECT_EQ(record[1], ~0u) << "triangle " << t;
        }
    }
}

// More data than the usage counts: in every order that invocations can run in, nothing is written where it must not be,
// and some are reported.
TEST_F(LossyValidated, MoreDataThanDeclared)
{
    Random random(53);
    MicromapInput input;
    for (uint32_t i = 0; i < 100; ++i)
        input.add(i % 2 == 0 ? 5 : 8, kFourState, foliage(random, i % 2 == 0 ? 5 : 8));
    input.declared = {{99, 3, kFourState}, {1, 8, kFourState}};
    for (const VkBuildMicromapFlagsEXT flags : kFlags) {
        Micromap micromap(gpu(), input, flags | kLossy);
        micromap.build();
        EXPECT_FALSE(gpu().takeUnexpectedMessages().empty());
        EXPECT_LE(inUse(micromap).size(), micromap.size());
    }
}

// 2-state triangles, which a lossy micromap must not have, stay what they are.
TEST_F(Lossy, TwoStateTrianglesStay)
{
    Random random(59);
    MicromapInput input;
    for (uint32_t level = 0; level <= 9; ++level) {
        input.add(level, kTwoState, randomStates(random, level, kTwoState));
        input.add(level, kFourState, randomStates(random, level, kFourState));
    }
    MicromapInput declared = input;
    for (uint32_t level = 0; level <= 9; ++level)
        declared.declared.push_back({2, level, kFourState});
    Micromap micromap(gpu(), declared, kAllow | kLossy);
    micromap.build();
    EXPECT_EQ(inUse(micromap), memoryOf(input, kAllow | kLossy));
}

} // namespace
