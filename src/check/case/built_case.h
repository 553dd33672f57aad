// SPDX-License-Identifier: Apache-2.0
// A case on a device: its scene is built by the plan, and its steps are carried out. Where the device has an arena, the
// arena is compared with what it was before each operation: nothing but what the operation names has changed.
#pragma once

#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "check/case/case.h"
#include "gpu/copies.h"
#include "gpu/programs/marker.h"

namespace vellum::check
{

// The flags that a bottom-level structure of the case is built with.
VkBuildAccelerationStructureFlagsKHR buildFlagsOf(const Case &c, uint32_t object);

// Returns whether the device can create the image of the plan.
bool supportsImage(const Device &gpu, const AddressPlan &plan);

class BuiltCase
{
public:
    BuiltCase(Device &gpu, const Case &c);
    BuiltCase(const BuiltCase &) = delete;
    BuiltCase &operator=(const BuiltCase &) = delete;

    // Builds micromaps and bottom-level structures, carries out the steps, builds the top level and makes the queries,
    // one of these at a time. False: all is done.
    bool advance();
    void finish()
    {
        while (advance()) {
        }
    }
    // Called while each command buffer is recorded.
    void setBetween(std::function<void()> between) { between_ = std::move(between); }

    [[nodiscard]] const Structure &top() const { return *top_; }
    // A top level of the same instances without flags, which rays of every mask see.
    [[nodiscard]] std::unique_ptr<Tlas> plainTop() const;
    // Records the part of the case that belongs to the submission that traces: all builds, or one in new memory
    // concurrent with the rays.
    void recordWithRays(VkCommandBuffer commands);

private:
    struct Bottom {
        VkBuildAccelerationStructureFlagsKHR flags = 0;
        std::vector<Geometry> geometries;
        std::unique_ptr<Blas> structure;
    };
    using Record = std::function<void(VkCommandBuffer)>;
    using Writes = std::vector<Arena::Range>;
    struct QueryRun;
    struct Work { // builds of one kind: for each, what is recorded and what it writes to
        std::string name;
        size_t count = 0;
        std::function<Writes(size_t, VkCommandBuffer, SharedScratch &)> record;
    };

    void addParts();
    void buildMicromaps();
    void buildMicromapsTogether();
    [[nodiscard]] uint32_t spareTriangles() const;
    void describeObjects();
    Writes prepareNew(uint32_t object, SharedScratch *scratch);
    // Prepares a top level of inactive instances for the front of a command, with BuildPlan::unrelated; else null.
    [[nodiscard]] std::unique_ptr<Tlas> unrelatedTop(Writes &writes, std::vector<const Structure *> &structures) const;
    void buildObjects();
    void buildTop();
    void apply(const Step &step);
    void applyToObject(const Step &step);
    void applyToTop(const Step &step);
    // plain: without flags, for all rays.
    [[nodiscard]] std::vector<VkAccelerationStructureInstanceKHR> instances(bool plain = false) const;
    void prepareTop(Tlas &tlas, VkBuildAccelerationStructureModeKHR mode) const;
    void buildTopAgain(const Step &step);
    void prepareAll();
    // The three parts of all.
    void recordMicromaps(VkCommandBuffer commands) const;
    void recordObjects(VkCommandBuffer commands) const;
    void recordTop(VkCommandBuffer commands) const;
    void recordAll(VkCommandBuffer commands);
    void buildMicromap(Micromap &micromap, const Step &step);
    void buildMicromapBeside(Micromap &micromap, uint32_t number);

    [[nodiscard]] VkBuildAccelerationStructureFlagsKHR topFlags() const;
    // How objects are built and updated.
    struct BuildMode {
        bool update = false, outOfPlace = false, exact = false;
    };
    template <class T>
    [[nodiscard]] std::unique_ptr<T> copied(const Structure &source, VkCopyAccelerationStructureModeKHR mode,
                                            VkDeviceSize size);
    template <class T>
    [[nodiscard]] std::unique_ptr<T> copied(const Structure &source, const Step &step);
    void reloadObject(const Step &step);
    void reloadTop(const Step &step);
    void buildObject(uint32_t object, BuildMode mode);
    // Returns what is destroyed when the build is done.
    [[nodiscard]] std::unique_ptr<Blas> prepareObject(uint32_t object, BuildMode mode);
    void rebuildObjects(const Step &step);
    void buildMicromapUsers(uint32_t micromap, const Step &step);
    void moveObject(Bottom &moved, uint32_t built);
    void setStates(Micromap &micromap, const Step &step);
    [[nodiscard]] std::unique_ptr<Micromap> copyOfMicromap(const Micromap &source, const Step &step);
    [[nodiscard]] Guarded serialized(const Micromap &micromap, const Step &step);
    void deserialize(const Guarded &data, Micromap &target, const Step &step);
    [[nodiscard]] std::unique_ptr<Micromap> reloadMicromap(std::unique_ptr<Micromap> source, const Step &step);
    void checkSerialized(const Guarded &data, std::string_view of, bool (*compatible)(const Device &, const uint8_t *));
    [[nodiscard]] Guarded serialized(const Structure &source);
    using Addresses = std::map<VkDeviceAddress, VkDeviceAddress>; // the old ones, the new ones
    // needed: addresses that the data of a top level must have. A bottom-level structure "may hold a reference" to its
    // micromaps (vkCmdBuildAccelerationStructuresKHR), or have what it needs of them.
    void replaceAddresses(const Guarded &data, bool top, const Addresses &addresses,
                          std::set<VkDeviceAddress> needed = {});
    void deserialize(const Guarded &data, Structure &target);

    void runOnThreads(const Work &work);
    // Records as the case does everything but rays: within conditional rendering, or not. Then writes late inputs, if
    // it is the last recording of a submission.
    void recordUnder(VkCommandBuffer commands, const Record &record, bool last = true);
    // As above. Conditional rendering also has a dispatch at its end, which it discards.
    void recordDiscarding(VkCommandBuffer commands, const Record &record);
    [[nodiscard]] std::unique_ptr<Micromap> newMicromap(const oracle::SceneMicromap &from,
                                                        SharedScratch *scratch = nullptr);
    template <class T>
    [[nodiscard]] std::unique_ptr<T> newStructure()
    {
        auto structure = std::make_unique<T>(gpu_);
        structure->useInputs(&inputs_);
        return structure;
    }
    // Reports a dispatch that was executed.
    void checkDiscarded(const std::string &what);
    // Executes, and reports what else was written to. Not repeatable: what is recorded replaces what it reads, so that
    // it is neither submitted nor recorded twice. Vellum's layer sizes copies of GENERIC structures by the build that
    // was recorded last, be it executed or not (docs/limitations.md).
    void execute(const std::string &what, const Writes &writes, const Record &record, bool repeatable = true);
    void executeOnHost(const std::string &what, const Writes &writes, const std::function<void()> &command);
    void runQueries();
    void copyAtAddresses();
    [[nodiscard]] VkAccelerationStructureKHR structureOf(const QueryTarget &target) const;
    // The value that a query of that structure reports in a pool of its own.
    [[nodiscard]] uint64_t alone(QueryPlan::Property property, const QueryTarget &target);
    [[nodiscard]] uint64_t query(VkQueryType type, uint32_t count,
                                 const std::function<void(VkCommandBuffer, VkQueryPool)> &record);
    [[nodiscard]] VkDeviceSize sizeOf(const Structure &structure, VkQueryType type);
    [[nodiscard]] VkDeviceSize sizeOf(const Micromap &micromap, VkQueryType type, const Step &step);

    Device &gpu_;
    const Case &case_;
    // Conditional rendering: what discards, and the dispatch that is discarded.
    Buffer predicate_;
    std::unique_ptr<Marker> discarded_;
    oracle::Scene scene_; // state after the steps so far
    std::vector<std::function<void()>> parts_;
    size_t done_ = 0; // of them
    std::function<void()> between_;
    BuildInputs inputs_;
    std::vector<std::unique_ptr<Micromap>> micromaps_;
    std::vector<Bottom> bottoms_;
    std::unique_ptr<Structure> top_;
    std::unique_ptr<Blas> beside_;
};

} // namespace vellum::check
