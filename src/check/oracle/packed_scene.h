// SPDX-License-Identifier: Apache-2.0
// A random scene in the memory of an arena, as an application keeps one: built on several threads and queues with
// scratch memory that builds share, copied, compacted, serialized, updated and built again beside what stays, in room
// that has just become free. After each operation the arena is compared with what it was before: nothing but what the
// operation names has changed. Whatever happens, rays see the same scene.
#pragma once

#include <string>

#include "check/gpu/copies.h"
#include "check/oracle/random_scene.h"
#include "check/oracle/scene_build.h"

namespace vellum::check::oracle
{

class PackedScene
{
public:
    PackedScene(Device &gpu, const Scene &scene, Random &random);
    PackedScene(const PackedScene &) = delete;
    PackedScene &operator=(const PackedScene &) = delete;

    // Each of the objects has something done to it, and then the top level.
    void change();
    // Traces. Meanwhile one of the objects is built anew in another place, which the scene then uses.
    void traceBesideBuild(Tracer &tracer, std::span<const Ray> rays, uint32_t capacity);
    // What was done since the beginning, in words.
    [[nodiscard]] const std::string &history() const { return history_; }

private:
    struct Bottom {
        std::vector<Geometry> geometries;
        std::unique_ptr<Blas> structure;
    };
    using Record = std::function<void(VkCommandBuffer)>;
    using Writes = std::vector<Arena::Range>;

    void buildEverything();
    void changeObject(size_t object);
    void changeMicromapOf(Bottom &bottom, uint32_t way);
    void copyObject(Bottom &bottom, VkCopyAccelerationStructureModeKHR mode);
    void reloadObject(Bottom &bottom);
    void buildObject(Bottom &bottom, VkBuildAccelerationStructureModeKHR mode);
    void moveAndBuildOver(Bottom &moved, Bottom &built);
    void renameObject(Bottom &bottom);
    void buildTop();
    void copyTop(uint32_t way);
    [[nodiscard]] std::unique_ptr<Structure> reloaded(const Structure &source, std::unique_ptr<Structure> target);

    // Executes, and expects that nothing else was written to.
    void run(const std::string &what, const Writes &writes, const Record &record);
    [[nodiscard]] uint64_t asked(VkQueryType type, const std::function<void(VkCommandBuffer, VkQueryPool)> &ask);
    [[nodiscard]] VkDeviceSize sizeOf(const Structure &structure, VkQueryType type);
    [[nodiscard]] uint32_t below(uint32_t n) { return static_cast<uint32_t>(random_() % n); }

    Device &gpu_;
    const Scene &scene_;
    Random &random_;
    std::vector<std::unique_ptr<Micromap>> micromaps_;
    std::vector<Bottom> bottoms_;
    std::unique_ptr<Structure> top_;
    std::string history_;
};

} // namespace vellum::check::oracle
