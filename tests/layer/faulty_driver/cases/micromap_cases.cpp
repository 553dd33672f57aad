// SPDX-License-Identifier: Apache-2.0
// Faults of micromaps.cpp.
#include "faulty_driver/cases/cases.h"

#include "command_buffer/state_scene.h"

namespace faults
{
namespace
{

using namespace vt;

// The states of one triangle at the middle of these micro-triangles of a level.
std::string statesWithin(Gpu &gpu, MicromapInput input, uint32_t level, std::initializer_list<uint32_t> microTriangles,
                         VkBuildMicromapFlagsEXT flags = 0)
{
    const auto micromap = built(gpu, std::move(input), flags);
    const RowScene scene(gpu, micromap.get(), 1);
    std::vector<Vec3> places;
    for (const uint32_t index : microTriangles) {
        const auto centre = microTriangleCentre(index, level);
        places.push_back({static_cast<float>(centre[0]), static_cast<float>(centre[1]), 1});
    }
    return statesAt(gpu, scene.tlas(), places);
}

MicromapInput one(uint32_t level, uint16_t format, const std::vector<uint8_t> &states)
{
    MicromapInput input;
    input.add(level, format, states);
    return input;
}

// A triangle whose first micro-triangles are opaque, and the others transparent.
MicromapInput beginsOpaque(uint32_t level, size_t count)
{
    std::vector<uint8_t> states(size_t{1} << 2 * level, 0);
    std::fill_n(states.begin(), count, uint8_t{1});
    return one(level, kFourState, states);
}

std::string usagePointers(Gpu &gpu)
{
    MicromapInput input = uniform({0}, 1);
    for (const uint8_t state : std::array<uint8_t, 2>{1, 2})
        input.add(2, kFourState, std::vector<uint8_t>(16, state));
    const Micromap micromap(gpu, std::move(input));
    VkMicromapBuildInfoEXT info = micromap.buildInfo();
    std::vector<const VkMicromapUsageEXT *> pointers;
    for (uint32_t i = 0; i < info.usageCountsCount; ++i)
        pointers.push_back(&info.pUsageCounts[i]);
    info.pUsageCounts = nullptr;
    info.ppUsageCounts = pointers.data();
    gpu.submit([&](VkCommandBuffer commands) {
        recordMicromapBuilds(gpu, commands, std::array{MicromapBuild{info, micromap.handle()}});
    });
    return statesOfMicromap(gpu, micromap);
}

std::string countedBy(Gpu &gpu, uint32_t form)
{
    MicromapInput input = uniform({0}, 1);
    for (const uint8_t state : std::array<uint8_t, 3>{1, 2, 0})
        input.add(2, kFourState, std::vector<uint8_t>(16, state));
    input.usageForm = form;
    return statesOfMicromap(gpu, *built(gpu, std::move(input)));
}

std::string zeroCounts(Gpu &gpu)
{
    return countedBy(gpu, kUsageZeros);
}

std::string splitCounts(Gpu &gpu)
{
    return countedBy(gpu, kUsageSplit);
}

// The second triangle has its data at byte 1.
std::string oddOffset(Gpu &gpu)
{
    MicromapInput input;
    input.add(1, kFourState, std::array<uint8_t, 4>{0, 0, 0, 0});
    input.add(1, kFourState, std::array<uint8_t, 4>{1, 1, 1, 1});
    return statesOfMicromap(gpu, *built(gpu, std::move(input)));
}

// Two triangles that differ in their last micro-triangle.
std::string differAtEnd(Gpu &gpu)
{
    constexpr uint32_t kLevel = 4, kLast = 255;
    MicromapInput input;
    std::vector<uint8_t> states(kLast + 1, 0);
    input.add(kLevel, kFourState, states);
    states[kLast] = 1;
    input.add(kLevel, kFourState, states);
    const auto micromap = built(gpu, std::move(input));
    const auto centre = microTriangleCentre(kLast, kLevel);
    const RowScene scene(gpu, micromap.get(), 2);
    std::vector<Vec3> places;
    for (const float triangle : {0.0f, 1.5f})
        places.push_back({triangle + static_cast<float>(centre[0]), static_cast<float>(centre[1]), 1});
    return statesAt(gpu, scene.tlas(), places);
}

std::string strided(Gpu &gpu)
{
    MicromapInput input = uniform({0, 1, 2});
    input.stride = 16;
    return statesOfMicromap(gpu, *built(gpu, std::move(input)));
}

std::string twoStates(Gpu &gpu)
{
    return statesWithin(gpu, one(2, kTwoState, std::vector<uint8_t>(16, 1)), 2, {0, 15});
}

std::string levelZero(Gpu &gpu)
{
    return statesWithin(gpu, one(0, kFourState, {1}), 1, {0, 1, 2, 3});
}

std::string farData(Gpu &gpu)
{
    return statesOfMicromap(gpu, *built(gpu, uniform({0, 1}, 9)));
}

std::string fourStates(Gpu &gpu)
{
    return statesWithin(gpu, one(1, kFourState, {1, 1, 1, 1}), 1, {0, 1, 2, 3});
}

std::string highestLevel(Gpu &gpu)
{
    return statesWithin(gpu, beginsOpaque(12, size_t{1} << 22), 1, {0, 3});
}

std::string highIndex(Gpu &gpu)
{
    return statesWithin(gpu, beginsOpaque(9, 0x10000), 1, {0, 3});
}

std::string levelOne(Gpu &gpu)
{
    return statesWithin(gpu, one(1, kFourState, {0, 1, 2, 3}), 1, {0, 1, 2, 3});
}

std::string lossy(Gpu &gpu)
{
    return statesWithin(gpu, one(1, kFourState, {0, 1, 1, 3}), 1, {0, 1, 2, 3}, kLossy);
}

// On a second device, created while the first one has micromaps.
std::string lossyOnTwin(Gpu &gpu)
{
    const MicromapInput input = one(1, kFourState, {0, 1, 2, 3});
    const auto first = built(gpu, input, kLossy);
    const auto micromap = std::make_unique<Micromap>(gpu.twin(), input, kLossy);
    micromap->build();
    const RowScene scene(gpu.twin(), micromap.get(), 1);
    std::vector<Vec3> places;
    for (uint32_t index = 0; index < 4; ++index) {
        const auto centre = microTriangleCentre(index, 1);
        places.push_back({static_cast<float>(centre[0]), static_cast<float>(centre[1]), 1});
    }
    return statesAt(gpu.twin(), scene.tlas(), places);
}

// Checks that equal lossy micromaps have equal states.
std::string lossyInMany(Gpu &gpu)
{
    std::vector<std::unique_ptr<Micromap>> all; // each has an address of its own
    std::string first;
    for (int i = 0; i < 32; ++i) {
        all.push_back(built(gpu, one(1, kFourState, {1, 1, 1, 1}), kLossy));
        const std::string states = statesOfMicromap(gpu, *all.back());
        first = first.empty() ? states : first;
        if (states != first)
            return "different";
    }
    return "equal";
}

std::string builtAgain(Gpu &gpu)
{
    const auto micromap = built(gpu, uniform({0})), other = built(gpu, uniform({1}));
    buildFrom(gpu, *other, *micromap);
    return statesOfMicromap(gpu, *micromap);
}

std::string builtTogether(Gpu &gpu)
{
    const Micromap first(gpu, uniform({0})), second(gpu, uniform({1}));
    gpu.submit([&](VkCommandBuffer commands) {
        recordMicromapBuilds(gpu, commands,
                             std::array{MicromapBuild{first.buildInfo(), first.handle()},
                                        MicromapBuild{second.buildInfo(), second.handle()}});
    });
    return statesOfMicromap(gpu, first) + statesOfMicromap(gpu, second);
}

// Records a build of a micromap by `build`, and in the same command buffer structures that use it and a trace.
std::string tracedAtOnce(Gpu &gpu, const std::function<void(VkCommandBuffer, Micromap &)> &build)
{
    Micromap micromap(gpu, uniform({1}));
    Geometry geometry{.vertices = triangleRow(1)};
    geometry.micromap = Attachment{&micromap};
    Blas blas(gpu);
    blas.prepare({geometry});
    Tlas tlas(gpu);
    tlas.prepare(std::vector{instance(blas, {}, 1)});
    Tracer tracer(gpu);
    const Ray ray{.origin = {0.3f, 0.3f, 1}};
    tracer.prepare(tlas, std::span(&ray, 1));
    gpu.submit([&](VkCommandBuffer commands) {
        build(commands, micromap);
        barrier(commands);
        blas.record(commands);
        barrier(commands);
        tlas.record(commands);
        barrier(commands);
        tracer.bind(commands);
        tracer.dispatch(commands);
        barrier(commands);
    });
    return tracer.results()[0].committed == kTriangle ? "opaque" : "not opaque";
}

std::string inOneCommandBuffer(Gpu &gpu)
{
    return tracedAtOnce(gpu, [](VkCommandBuffer commands, Micromap &micromap) { micromap.record(commands); });
}

std::string byHost(Gpu &gpu)
{
    return tracedAtOnce(gpu, [&gpu](VkCommandBuffer, Micromap &micromap) {
        const VkMicromapBuildInfoEXT info = micromap.hostBuildInfo();
        VT_CHECK(gpu.vk().BuildMicromapsEXT(gpu.device(), VK_NULL_HANDLE, 1, &info));
    });
}

std::string twoByHost(Gpu &gpu)
{
    const Micromap first(gpu, uniform({0})), second(gpu, uniform({1}));
    const std::array infos{first.hostBuildInfo(), second.hostBuildInfo()};
    VT_CHECK(gpu.vk().BuildMicromapsEXT(gpu.device(), VK_NULL_HANDLE, infos.size(), infos.data()));
    return statesOfMicromap(gpu, first) + statesOfMicromap(gpu, second);
}

} // namespace

std::span<const Case> micromapCases()
{
    static const std::array cases{
        Case{"usage-pointers-as-first", usagePointers, "012", "033"},
        Case{"usage-count-0-ends", zeroCounts, "0120", "3333"},
        Case{"usage-counts-once", splitCounts, "0120", "0123"},
        Case{"data-offset-multiple-of-4", oddOffset, "01", "00"},
        Case{"sharing-by-16-bytes", differAtEnd, "01", "00"},
        Case{"sharing-ignores-last-byte", differAtEnd, "01", "00"},
        Case{"triangle-stride", strided, "012", "031"},
        Case{"two-state-as-four", twoStates, "11", "30"},
        Case{"level-0-as-1", levelZero, "1111", "1000"},
        Case{"data-offset-16-bits", farData, "01", "00"},
        Case{"four-state-as-two", fourStates, "1111", "1010"},
        Case{"highest-level-truncated", highestLevel, "10", "11"},
        Case{"micro-triangle-index-16-bits", highIndex, "10", "11"},
        Case{"curve-mirrored-on-odd-levels", levelOne, "0123", "3210"},
        Case{"opaque-becomes-unknown", levelOne, "0123", "0323"},
        Case{"unknown-states-swapped", levelOne, "0123", "0132"},
        Case{"lossy-opaque-to-transparent", lossy, "0113", "0003", Api::Khr},
        Case{"lossy-differs-by-device", lossyOnTwin, "0123", "0323", Api::Khr},
        Case{"lossy-differs-by-address", lossyInMany, "equal", "different", Api::Khr},
        Case{"micromap-built-once", builtAgain, "1", "0"},
        Case{"only-first-micromap-build", builtTogether, "01", "03"},
        Case{"micromap-built-late", inOneCommandBuffer, "opaque", "not opaque"},
        Case{"only-first-host-build", twoByHost, "01", "03", Api::Ext},
        Case{"host-build-returns-early", byHost, "opaque", "not opaque", Api::Ext},
    };
    return cases;
}

} // namespace faults
