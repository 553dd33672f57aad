// SPDX-License-Identifier: Apache-2.0
// Micromaps and structures that are built, copied, serialized, reloaded and traced over many frames: every ray finds
// the expected state, and memory does not grow.
//
//   VELLUM_STRESS=full    10,000 micromaps with 1,000,000 triangles, 1,000 frames
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>

#include "check/oracle/outcome.h"
#include "harness/harness.h"
#include "structures/footprint.h"
#include "world.h"

namespace
{

using namespace stress;
using namespace vt;

constexpr Extent kShort{6, 5, 30, 24, 256, 60, 20};
constexpr Extent kFull{100, 100, 100, 200, 512, 1000, 200};
constexpr float kApart = 10; // of instances, in z

class Stress : public GpuTest
{
protected:
    explicit Stress(Memory memory = Memory::Packed) : GpuTest({.validation = false, .spy = false, .memory = memory}) {}

    void changingScene();

    struct Shown {
        uint32_t blas, customIndex, flags;
        Vec3 place;
    };
    struct Look {
        Ray ray;
        uint32_t instance;
        Outcome outcome;
    };

    // A frame's instances.
    std::vector<VkAccelerationStructureInstanceKHR> scatter(std::mt19937 &random, const World &world,
                                                            const Extent &extent)
    {
        constexpr std::array<uint32_t, 7> flags{0, kFlagTwoState, kFlagDisable, 4, 8, kFlagTwoState | 4, 0};
        shown_.clear();
        std::vector<VkAccelerationStructureInstanceKHR> out;
        for (uint32_t i = 0; i < extent.instances; ++i) {
            const Shown s{static_cast<uint32_t>(random() % extent.blases),
                          static_cast<uint32_t>(random()) & 0xffffff,
                          flags[random() % flags.size()],
                          {static_cast<float>(random() % 64), static_cast<float>(random() % 64),
                           -kApart * static_cast<float>(i)}};
            VkAccelerationStructureInstanceKHR instance{};
            for (size_t k = 0; k < 3; ++k) {
                instance.transform.matrix[k][k] = 1;
                instance.transform.matrix[k][3] = s.place[k];
            }
            instance.instanceCustomIndex = s.customIndex & 0xffffffu;
            instance.mask = 0xff;
            instance.flags = s.flags & 0xffu;
            instance.accelerationStructureReference = world.address(s.blas);
            out.push_back(instance);
            shown_.push_back(s);
        }
        return out;
    }

    std::vector<Look> aim(std::mt19937 &random, const World &world, const Extent &extent)
    {
        constexpr std::array<uint32_t, 7> flags{
            0, 0, kRayOpaque, kRayNoOpaque, kRayCullOpaque, kRayCullNoOpaque, kRayForceTwoState};
        std::vector<Look> looks;
        for (uint32_t r = 0; r < extent.rays; ++r) {
            Look look{};
            look.instance = static_cast<uint32_t>(random() % extent.instances);
            const Shown &s = shown_[look.instance];
            const auto geometry = static_cast<uint32_t>(random() % extent.geometries);
            const World::Place place = world.place(s.blas, geometry, static_cast<uint32_t>(random() % extent.triangles),
                                                   static_cast<uint32_t>(random()));
            for (size_t k = 0; k < 3; ++k)
                look.ray.origin[k] = place.point[k] + s.place[k];
            look.ray.origin[2] += 1;
            look.ray.tMax = 2;
            look.ray.flags = flags[random() % flags.size()];
            look.ray.rule = random() % 2 == 0 ? kAlways : kNever;
            look.outcome = outcomeOf(place.state, World::opaque(geometry), s.flags, look.ray.flags);
            looks.push_back(look);
        }
        return looks;
    }

    void expectSeen(Tracer &tracer, const Structure &scene, const std::vector<Look> &looks,
                    const std::vector<Shown> &shown, const std::string &what)
    {
        std::vector<Ray> rays;
        for (const Look &look : looks)
            rays.push_back(look.ray);
        const std::vector<Result> results = tracer.trace(scene, rays);
        uint32_t wrong = 0;
        for (size_t i = 0; i < looks.size(); ++i) {
            const Look &look = looks[i];
            const Result &r = results[i];
            const bool isCandidate = look.outcome == Outcome::NonOpaque;
            const bool hit = look.outcome == Outcome::Opaque || (isCandidate && look.ray.rule == kAlways);
            const uint32_t custom = shown[look.instance].customIndex;
            const bool right = r.candidateCount == (isCandidate ? 1u : 0u) &&
                               r.committed == (hit ? kTriangle : kNone) &&
                               (!isCandidate || r.candidates[0].customIndex == custom) &&
                               (!hit || (r.customIndex == custom && r.instance == look.instance));
            wrong += right ? 0 : 1;
            hits_ += hit ? 1 : 0;
        }
        compared_ += looks.size();
        EXPECT_EQ(wrong, 0u) << what;
    }

    // 0: clone, 1: compacted, 2: serialized and reloaded.
    void copyScene(const Tlas &scene, Structure &copied, uint32_t way)
    {
        if (way < 2) {
            copied.create(scene.size());
            gpu().submit([&](VkCommandBuffer commands) {
                auto info = vkInit<VkCopyAccelerationStructureInfoKHR>(
                    {.src = scene.handle(),
                     .dst = copied.handle(),
                     .mode = way == 0 ? VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR
                                      : VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR});
                gpu().vk().CmdCopyAccelerationStructureKHR(commands, &info);
            });
            return;
        }
        const Guarded memory(gpu(), scene.size() + 65536, 256,
                             VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
        gpu().submit([&](VkCommandBuffer commands) {
            auto info = vkInit<VkCopyAccelerationStructureToMemoryInfoKHR>({.src = scene.handle()});
            info.dst.deviceAddress = memory.address();
            info.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_SERIALIZE_KHR;
            gpu().vk().CmdCopyAccelerationStructureToMemoryKHR(commands, &info);
        });
        uint64_t size = 0;
        std::memcpy(&size, memory.bytes() + 40, 8);
        copied.create(size);
        gpu().submit([&](VkCommandBuffer commands) {
            auto info = vkInit<VkCopyMemoryToAccelerationStructureInfoKHR>();
            info.src.deviceAddress = memory.address();
            info.dst = copied.handle();
            info.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_DESERIALIZE_KHR;
            gpu().vk().CmdCopyMemoryToAccelerationStructureKHR(commands, &info);
        });
        EXPECT_TRUE(memory.intact());
    }

    std::vector<Shown> shown_;
    uint64_t compared_ = 0, hits_ = 0;
};

class StressToTheEnd : public Stress
{
protected:
    StressToTheEnd() : Stress(Memory::PackedToTheEnd) {}
};

void Stress::changingScene()
{
    const char *setting = std::getenv("VELLUM_STRESS");
    const Extent extent = setting != nullptr && std::string(setting) == "full" ? kFull : kShort;
    std::mt19937 random(4);
    World world(gpu(), extent);
    Tracer tracer(gpu());
    Tlas scene(gpu());
    // The largest of each half of the frames after the first ones: what the scene takes at a time varies.
    Footprint earlier, later;
    uint64_t earlierArena = 0;
    constexpr VkBuildAccelerationStructureFlagsKHR flags =
        VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR | VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR;
    for (uint32_t frame = 0; frame < extent.frames && !HasFailure(); ++frame) {
        for (int i = 0; i < 3; ++i)
            world.change(static_cast<uint32_t>(random() % extent.blases),
                         static_cast<World::Change>(random() % static_cast<uint32_t>(World::Change::Count)),
                         static_cast<uint32_t>(random() % extent.geometries));
        scene.build(scatter(random, world, extent), flags,
                    frame % 3 == 2 ? VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR
                                   : VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR);
        const auto looks = aim(random, world, extent);
        expectSeen(tracer, scene, looks, shown_, "frame " + std::to_string(frame));
        // A copy, looked at when the original has become another.
        const auto kept = shown_;
        Structure copied(gpu(), VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR);
        copyScene(scene, copied, frame % 3);
        scene.build(scatter(random, world, extent), flags);
        expectSeen(tracer, copied, looks, kept, "copy in frame " + std::to_string(frame));
        if (frame % (extent.frames / 50 + 1) == 0)
            gpu().arena()->expectIntact("frame " + std::to_string(frame));
        const Footprint now = Footprint::now();
        const bool isLate = frame >= extent.warmUp + (extent.frames - extent.warmUp) / 2;
        if (frame >= extent.warmUp) {
            Footprint &largest = isLate ? later : earlier;
            largest.resident = std::max(largest.resident, now.resident);
            largest.mappings = std::max(largest.mappings, now.mappings);
        }
        if (!isLate)
            earlierArena = gpu().arena()->counts().bytes;
        if (extent.frames >= 500 && frame % 100 == 99)
            std::printf("frame %u: %llu MiB, %llu mappings\n", frame + 1,
                        static_cast<unsigned long long>(now.resident >> 20),
                        static_cast<unsigned long long>(now.mappings));
    }
    std::printf("%u micromaps, %llu micromap triangles, %u frames: %llu rays compared, %llu hits; memory %llu -> %llu "
                "KiB, mappings %llu -> %llu\n",
                extent.micromaps(), static_cast<unsigned long long>(extent.micromaps()) * extent.triangles,
                extent.frames, static_cast<unsigned long long>(compared_), static_cast<unsigned long long>(hits_),
                static_cast<unsigned long long>(earlier.resident >> 10),
                static_cast<unsigned long long>(later.resident >> 10),
                static_cast<unsigned long long>(earlier.mappings), static_cast<unsigned long long>(later.mappings));
    const Arena::Counts counts = gpu().arena()->counts();
    std::printf("arena: %llu buffers, %llu pieces, %llu guard bytes checked\n",
                static_cast<unsigned long long>(counts.buffers), static_cast<unsigned long long>(counts.pieces),
                static_cast<unsigned long long>(counts.guardBytes));
    EXPECT_GT(hits_, compared_ / 4);
    if (kResidentIsMeaningful) {
        EXPECT_LT(later.resident, earlier.resident + (counts.bytes - earlierArena) + earlier.resident / 50 + (4 << 20));
    }
    EXPECT_LE(later.mappings, earlier.mappings + 16);
}

TEST_F(Stress, ChangingScene)
{
    changingScene();
}

TEST_F(StressToTheEnd, ChangingScene)
{
    changingScene();
}

} // namespace
