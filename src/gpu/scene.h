// SPDX-License-Identifier: Apache-2.0
// Micromaps and acceleration structures as an application makes them. Every object lies between guard bytes, which the
// test can check: nothing may be written beyond the sizes that Vulkan reported.
#pragma once

#include "gpu/arena.h"
#include "gpu/micromap_commands.h"
#include "gpu/vertex_format.h"

#include <array>
#include <cstdint>
#include <optional>

namespace vellum::gpu
{

inline constexpr uint16_t kTwoState = VK_OPACITY_MICROMAP_FORMAT_2_STATE_EXT;
inline constexpr uint16_t kFourState = VK_OPACITY_MICROMAP_FORMAT_4_STATE_EXT;
inline constexpr uint32_t kFlagTwoState = 0x10; // VK_GEOMETRY_INSTANCE_FORCE_OPACITY_MICROMAP_2_STATE_EXT
inline constexpr uint32_t kFlagDisable = 0x20;  // VK_GEOMETRY_INSTANCE_DISABLE_OPACITY_MICROMAPS_EXT

// The form of usage counts. "Multiple elements with the same format and subdivisionLevel are allowed and the total
// count for that format and subdivisionLevel is the sum of the count for each element" (VkMicromapBuildInfoEXT,
// VkAccelerationStructureGeometryMicromapDataKHR; VkAccelerationStructureTrianglesOpacityMicromapEXT alike).
enum UsageForm : uint32_t {
    kUsageZeros = 1,      // elements with count 0 before the others
    kUsageSplit = 2,      // counts are split into two elements, the second ones behind all first ones
    kUsageDescending = 4, // by format and level
};
// The order of the data of a micromap's triangles. dataOffset is "a byte aligned value" (VkMicromapTriangleKHR).
enum DataLayout : uint32_t {
    kDataDescending = 1,  // the data of the last triangle first
    kDataGaps = 2,        // 1 to 7 bytes of garbage between two; unused bits of a byte are garbage as well
    kDataOverlapping = 4, // a triangle whose data occurs within that of others has none of its own
};

// The input of a micromap build.
struct MicromapInput {
    std::vector<VkMicromapTriangleEXT> triangles;
    std::vector<uint8_t> data;
    VkDeviceSize stride = sizeof(VkMicromapTriangleEXT);
    std::vector<VkMicromapUsageEXT> declared; // not empty: instead of the true usage
    bool usagePointers = false;               // usage counts come as an array of pointers
    uint32_t usageForm = 0;                   // bits of UsageForm
    bool onHost = false;                      // sizes are those that builds on host or device need

    // Appends a triangle and its data; states: 4^level values 0..3 (only 0 and 1 in the 2-state format).
    uint32_t add(uint32_t level, uint16_t format, std::span<const uint8_t> states);
    [[nodiscard]] std::vector<VkMicromapUsageEXT> usage() const;
    // The usage of a geometry with these indices; negative ones do not count. form: bits of UsageForm
    [[nodiscard]] std::vector<VkMicromapUsageEXT> usage(std::span<const int32_t> indices, uint32_t base,
                                                        uint32_t form = 0) const;
    // Lays the data out otherwise. layout: bits of DataLayout
    void layOut(uint32_t layout);
};

class Micromap
{
public:
    // inputs: null: what its builds read has memory of its own
    Micromap(Device &gpu, MicromapInput input, VkBuildMicromapFlagsEXT flags = 0, SharedScratch *scratch = nullptr,
             BuildInputs *inputs = nullptr);
    // For a copy, not a build: of that size, with the content of `like`.
    Micromap(Device &gpu, const Micromap &like, VkDeviceSize size);
    Micromap(const Micromap &) = delete;
    Micromap &operator=(const Micromap &) = delete;
    ~Micromap();

    [[nodiscard]] const MicromapHandle &handle() const { return handle_; }
    [[nodiscard]] const MicromapInput &input() const { return input_; }
    // The information for a build of it; dstMicromap where the API is VK_EXT_opacity_micromap.
    [[nodiscard]] const VkMicromapBuildInfoEXT &buildInfo() const { return info_; }
    // Its memory; size as vkGetMicromapBuildSizesEXT reported it.
    [[nodiscard]] const uint8_t *memory() const { return storage_.bytes(); }
    // Clears the memory, so that nothing seems to have been built there.
    void forget() const { std::memset(storage_.bytes(), 0, static_cast<size_t>(storage_.size())); }
    [[nodiscard]] VkDeviceSize size() const { return storage_.size(); }
    void record(VkCommandBuffer commands);
    void build();
    // Prepares another build by the same handle. False: it needs more memory than there is.
    [[nodiscard]] bool setInput(MicromapInput input, SharedScratch *scratch = nullptr);
    // The input in host memory, for vkBuildMicromapsEXT.
    [[nodiscard]] VkMicromapBuildInfoEXT hostBuildInfo() const;
    // Builds it by vkBuildMicromapsEXT.
    void buildOnHost(bool deferred = false) const;
    // The buffer that the micromap lies in.
    [[nodiscard]] VkDeviceMemory storageMemory() const { return storage_.memory(); }
    // Its memory, and the scratch memory that a build writes to.
    [[nodiscard]] Arena::Range range() const { return storage_.range(); }
    [[nodiscard]] Arena::Range scratchRange() const { return scratch_->range(); }
    // Overwrites everything a build has read or used, as an application may afterwards.
    void scribble();
    // Frees it.
    void forgetInput();

private:
    void create(VkDeviceSize size);
    void upload(SharedScratch *scratch, VkDeviceSize scratchSize);
    void describe();

    Device &gpu_;
    MicromapInput input_;
    VkBuildMicromapFlagsEXT flags_ = 0;
    std::vector<VkMicromapUsageEXT> usage_;
    std::vector<VkMicromapUsageEXT> scattered_;
    std::vector<const VkMicromapUsageEXT *> usagePointers_; // into it
    BuildInputs *inputs_ = nullptr;
    std::shared_ptr<Guarded> data_, triangles_;
    Guarded storage_;
    std::shared_ptr<Guarded> scratch_;
    VkMicromapBuildInfoEXT info_{};
    MicromapHandle handle_;
};

// VkAccelerationStructureTrianglesOpacityMicromapEXT of a geometry.
struct Attachment {
    const Micromap *micromap = nullptr;
    VkIndexType indexType = VK_INDEX_TYPE_NONE_KHR;
    std::vector<int32_t> indices;   // the values the index buffer holds
    std::optional<uint32_t> stride; // tightly packed unless given; 0: every triangle reads the first index
    uint32_t base = 0;
    uint32_t indexOffset = 0; // bytes before the first index
    bool usagePointers = false;
    uint32_t usageForm = 0; // bits of UsageForm
};

// Packs indices the way an application would, with the gaps of the stride left as garbage. The last one has its whole
// stride: VUID-vkCmdBuildAccelerationStructuresKHR-indexBuffer-11577.
std::vector<uint8_t> packIndices(const Attachment &attachment, VkDeviceSize stride);

struct Geometry {
    std::vector<Vec3> vertices;
    std::vector<uint32_t> indices;
    VkIndexType indexType = VK_INDEX_TYPE_NONE_KHR;
    std::vector<VkAabbPositionsKHR> boxes; // not empty: AABB geometry
    bool isAabbs = false;                  // AABB geometry, also where there are no boxes
    VkGeometryFlagsKHR flags = 0;
    std::optional<Attachment> micromap;
    uint32_t skippedTriangles = 0; // primitiveOffset, in triangles
    uint32_t spareTriangles = 0;   // at the end, that are not built, though sizes allow for them
    uint32_t firstVertex = 0;
    VkFormat vertexFormat = VK_FORMAT_R32G32B32_SFLOAT;
    uint32_t stride = 0;       // bytes from one vertex or box to the next; 0: packed tightly
    uint32_t leadingBytes = 0; // before the first index, vertex (where there are no indices) or box: primitiveOffset
    std::optional<VkTransformMatrixKHR> transform;
    uint32_t transformOffset = 0;
    bool byPointer = false; // of one of a build: all come by ppGeometries

    [[nodiscard]] uint32_t primitives() const;
};

// An acceleration structure and what its last build read.
class Structure
{
public:
    Structure(Device &gpu, VkAccelerationStructureTypeKHR type) : gpu_(gpu), type_(type) {}
    Structure(const Structure &) = delete;
    Structure &operator=(const Structure &) = delete;
    virtual ~Structure();

    [[nodiscard]] VkAccelerationStructureKHR handle() const { return structure_; }
    [[nodiscard]] VkDeviceAddress address() const { return address_; }
    [[nodiscard]] VkDeviceSize size() const { return size_; }
    // Uses memory of the caller's instead of memory of its own; before the first prepare.
    void placeIn(VkBuffer buffer, VkDeviceSize offset);
    // The next create uses the other's memory, if it is large enough: two handles, and later another content, in one
    // place.
    void useMemoryOf(const Structure &other) { reusedStorage_ = other.storage_; }
    // The next update reads the source, and writes a structure that is made as large, or exact: as large as Vulkan
    // reports for the update. Null: the same as it writes.
    void updateFrom(const Structure *source, bool exact = false) { source_ = source, exact_ = exact; }
    // The next builds get their geometries by ppGeometries.
    void usePointers(bool pointers) { usesPointers_ = pointers; }
    // The memory of what its builds read; null: memory of its own.
    void useInputs(BuildInputs *inputs) { inputMemory_ = inputs; }
    // Uses that scratch memory instead of memory of its own; null: its own again.
    void shareScratch(SharedScratch *scratch) { sharedScratch_ = scratch; }
    // Makes the structure, of that size, instead of the one there is.
    void create(VkDeviceSize size);
    // Its memory, if not placed, and the scratch memory that a build writes to. The structure's own address may be
    // elsewhere.
    [[nodiscard]] Arena::Range range() const { return {storage_->address(), size_}; }
    [[nodiscard]] Arena::Range scratchRange() const { return scratch_->range(); }
    // Frees what the last build has read or used.
    virtual void forgetInput() { scratch_.reset(); }
    void record(VkCommandBuffer commands) const;
    [[nodiscard]] const VkAccelerationStructureBuildGeometryInfoKHR &buildInfo() const { return info_; }
    [[nodiscard]] const VkAccelerationStructureBuildRangeInfoKHR *ranges() const { return ranges_.data(); }
    // Primitives of a geometry that the memory is large enough for.
    [[nodiscard]] uint32_t maxPrimitives(size_t geometry) const { return maxPrimitives_[geometry]; }

protected:
    // Creates the structure if it is missing or too small, the scratch memory, and the build info.
    void prepareBuild(VkBuildAccelerationStructureFlagsKHR flags, VkBuildAccelerationStructureModeKHR mode,
                      std::span<const uint32_t> maxPrimitives);
    [[nodiscard]] Device &gpu() const { return gpu_; }
    // Memory with bytes that a build reads.
    [[nodiscard]] std::shared_ptr<Guarded> uploadInput(const void *content, size_t size, size_t alignment) const;
    void checkGuards() const;
    void destroy();

    std::vector<VkAccelerationStructureGeometryKHR> geometries_;
    std::vector<VkAccelerationStructureBuildRangeInfoKHR> ranges_;

private:
    Device &gpu_;
    VkAccelerationStructureTypeKHR type_;
    VkAccelerationStructureKHR structure_ = VK_NULL_HANDLE;
    VkDeviceAddress address_ = 0;
    VkDeviceSize size_ = 0;
    const Structure *source_ = nullptr;
    bool exact_ = false;
    BuildInputs *inputMemory_ = nullptr;
    std::shared_ptr<Guarded> storage_, reusedStorage_;
    std::shared_ptr<Guarded> scratch_;
    SharedScratch *sharedScratch_ = nullptr;
    std::vector<uint32_t> maxPrimitives_;
    bool usesPointers_ = false;
    std::vector<VkAccelerationStructureGeometryKHR> pointedTo_;
    std::vector<const VkAccelerationStructureGeometryKHR *> pointers_;
    VkBuffer placedBuffer_ = VK_NULL_HANDLE;
    VkDeviceSize placedOffset_ = 0;
    VkAccelerationStructureBuildGeometryInfoKHR info_{};
};

class Blas : public Structure
{
public:
    explicit Blas(Device &gpu) : Structure(gpu, VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR) {}
    Blas(Device &gpu, std::vector<Geometry> geometries, VkBuildAccelerationStructureFlagsKHR flags = 0) : Blas(gpu)
    {
        build(std::move(geometries), flags);
    }
    void prepare(std::vector<Geometry> geometries, VkBuildAccelerationStructureFlagsKHR flags = 0,
                 VkBuildAccelerationStructureModeKHR mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR);
    void build(std::vector<Geometry> geometries, VkBuildAccelerationStructureFlagsKHR flags = 0,
               VkBuildAccelerationStructureModeKHR mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR);
    void forgetInput() override
    {
        Structure::forgetInput();
        buffers_.clear();
    }

private:
    void describeTriangles(const Geometry &input, VkAccelerationStructureGeometryTrianglesDataKHR &triangles,
                           VkAccelerationStructureBuildRangeInfoKHR &range);
    void describeBoxes(const Geometry &input, VkAccelerationStructureGeometryAabbsDataKHR &boxes,
                       VkAccelerationStructureBuildRangeInfoKHR &range);
    // Bytes that a build reads.
    VkDeviceAddress upload(const void *content, size_t size, size_t alignment);

    std::vector<Geometry> inputs_;
    std::vector<std::shared_ptr<Guarded>> buffers_;
    size_t filled_ = 0; // of the last buffer, where geometries share it
    std::vector<std::vector<VkMicromapUsageEXT>> usages_;
    std::vector<std::vector<const VkMicromapUsageEXT *>> usagePointers_;
    std::vector<VkAccelerationStructureTrianglesOpacityMicromapEXT> attachments_;
    std::vector<VkAccelerationStructureTrianglesOpacityMicromapKHR> attachmentsKhr_;
};

// Builds of several structures, which are prepared, by one command; indirect: by
// vkCmdBuildAccelerationStructuresIndirectKHR.
class StructureBuilds
{
public:
    StructureBuilds(Device &gpu, std::span<const Structure *const> structures, bool indirect = false);
    void record(VkCommandBuffer commands) const;

private:
    Device &gpu_;
    std::vector<VkAccelerationStructureBuildGeometryInfoKHR> infos_;
    std::vector<const VkAccelerationStructureBuildRangeInfoKHR *> ranges_;
    // Indirect
    Buffer memory_; // the ranges
    std::vector<VkDeviceAddress> addresses_;
    std::vector<uint32_t> strides_;
    std::vector<std::vector<uint32_t>> counts_;
    std::vector<const uint32_t *> maxCounts_;
};

// An instance at a place, not turned.
VkAccelerationStructureInstanceKHR instance(const Structure &blas, Vec3 place, uint32_t customIndex, uint32_t flags = 0,
                                            uint32_t mask = 0xff);

enum class Arrangement { Array, Pointers };

class Tlas : public Structure
{
public:
    explicit Tlas(Device &gpu) : Structure(gpu, VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR) {}
    // skipped: instances before the first one. spare: sizes allow for as many more, which do not exist.
    Tlas(Device &gpu, std::vector<VkAccelerationStructureInstanceKHR> instances) : Tlas(gpu) { build(instances); }
    void prepare(std::span<const VkAccelerationStructureInstanceKHR> instances,
                 VkBuildAccelerationStructureFlagsKHR flags = 0,
                 VkBuildAccelerationStructureModeKHR mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR,
                 Arrangement arrangement = Arrangement::Array, uint32_t skipped = 0, uint32_t spare = 0);
    void build(std::span<const VkAccelerationStructureInstanceKHR> instances,
               VkBuildAccelerationStructureFlagsKHR flags = 0,
               VkBuildAccelerationStructureModeKHR mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR,
               Arrangement arrangement = Arrangement::Array, uint32_t skipped = 0);
    void forgetInput() override
    {
        Structure::forgetInput();
        instances_.reset();
        pointers_.reset();
    }

private:
    std::shared_ptr<Guarded> instances_, pointers_;
};

// The right-angled triangle (0,0) (1,0) (0,1) in the plane z = 0, at a place: barycentrics are x and y.
void appendTriangle(std::vector<Vec3> &vertices, Vec3 place);
// n of them, one unit and a half apart in x.
std::vector<Vec3> triangleRow(uint32_t n, Vec3 place = {});

// The centre of micro-triangle `index` (barycentrics of vertices 1 and 2), by descending the curve of the
// specification: into the sub-triangle nearest vertex 0, the middle one with ordering flipped, the one nearest vertex
// 1, then nearest vertex 2 with ordering flipped.
std::array<double, 2> microTriangleCentre(uint32_t index, uint32_t level);
// Its corners, by the same descent.
std::array<std::array<double, 2>, 3> cornersOfMicroTriangle(uint32_t index, uint32_t level);

} // namespace vellum::gpu
