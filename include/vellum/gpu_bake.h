// The baker on the GPU: opacity micromaps from alpha textures, inside an application's own command buffers.
//
// The states are those of docs/baking.md, with the same tolerances: a micro-triangle is opaque or transparent only if
// every point of it is, filtered as the sampler does it. What single precision cannot decide is unknown, with the
// better guess by area. The output is what a micromap build reads: data, VkMicromapTriangleEXT records, and indices
// with special indices for triangles that are one state all over.
//
// Needs Vulkan 1.2 with the feature bufferDeviceAddress, and a queue for compute shaders. No other feature is used.
//
//   std::unique_ptr<vellum::GpuBaker> baker;
//   std::unique_ptr<vellum::GpuAlpha> alpha;
//   vellum::GpuBaker::create({device, vkGetDeviceProcAddr}, baker);
//   baker->createAlpha({view, VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL, width, height}, alpha);
//
// In one step, with as much room as there is for triangles with data of each level:
//
//   vellum::GpuBakeRoom room; // room.triangles[5] = 10000; room.data, room.records, room.indices: addresses
//   baker->record(commands, *alpha, input, options, scratch, room, result);
//
// In two steps, the first of which says how much there are:
//
//   baker->recordSizes(commands, *alpha, input, options, scratch, result); // submit, wait, read the result
//   baker->recordData(commands, *alpha, input, options, scratch, room, result);
//
// Then a barrier to the build, with usage(room, options.format) as the usage counts of micromap and geometry.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include <vulkan/vulkan.h>

namespace vellum
{

inline constexpr std::uint32_t kGpuBakeLevels = 13; // subdivision levels 0..12

// An image of which one component is alpha, and the sampler that shaders read it with. The view may have any format
// that can be sampled as floats, block-compressed ones too.
struct GpuAlphaInfo {
    VkImageView view = VK_NULL_HANDLE; // 2D, of an image with VK_IMAGE_USAGE_SAMPLED_BIT
    VkImageLayout layout = VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL;
    std::uint32_t width = 0;     // of the view's first mip level, in texels: 1..65536
    std::uint32_t height = 0;    //
    std::uint32_t mipLevels = 1; // of the view, 1..16: a claim holds on each of them
    std::uint32_t component = 3; // 0..3: r, g, b, a, after the view's swizzle
    VkSamplerAddressMode wrapU = VK_SAMPLER_ADDRESS_MODE_REPEAT;
    VkSamplerAddressMode wrapV = VK_SAMPLER_ADDRESS_MODE_REPEAT;
    VkFilter filter = VK_FILTER_LINEAR; // or VK_FILTER_NEAREST
    float border = 0;                   // what VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_BORDER reads outside
};

// The triangles. Buffers at addresses need VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT, as do those of the output.
// A triangle with an index out of range, or with a coordinate that is not finite or 2^24 texels or more from the
// origin, is unknown; nothing outside the buffers is read.
struct GpuBakeInput {
    VkDeviceAddress uvs = 0;                      // a multiple of the size of a component, as is the stride
    std::uint32_t uvStride = 8;                   // bytes from one vertex to the next
    VkFormat uvFormat = VK_FORMAT_R32G32_SFLOAT;  // or VK_FORMAT_R16G16_SFLOAT, VK_FORMAT_R16G16_UNORM
    std::uint32_t vertices = 0;                   // how many there are
    VkDeviceAddress indices = 0;                  // a multiple of an index's size
    VkIndexType indexType = VK_INDEX_TYPE_UINT32; // UINT8, UINT16, UINT32, or NONE_KHR
    std::uint32_t triangles = 0;                  // at most 2^24
};

// What becomes of unknown states in 2-state data.
enum class GpuTwoStateRule { Nearest, UnknownIsOpaque, UnknownIsTransparent };

struct GpuBakeOptions {
    VkOpacityMicromapFormatEXT format = VK_OPACITY_MICROMAP_FORMAT_4_STATE_EXT;
    GpuTwoStateRule twoStateRule = GpuTwoStateRule::Nearest;
    // The subdivision level of all triangles, 0..12. If automatic, the most: each triangle gets the level at which the
    // legs of its micro-triangles are about `texelsPerEdge` texels of the first mip level long.
    std::uint32_t level = 5;
    bool automatic = false;
    float texelsPerEdge = 4;
    // Triangles that are one state all over become special indices. Without, every triangle gets data, as
    // VK_PIPELINE_CREATE_2_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_KHR needs it.
    bool specialIndices = true;
    // A sample is opaque where alpha `test` cutoff holds: VK_COMPARE_OP_GREATER_OR_EQUAL, GREATER, LESS or
    // LESS_OR_EQUAL.
    double cutoff = 0.5;
    VkCompareOp test = VK_COMPARE_OP_GREATER_OR_EQUAL;
    // What a sampler may do differently from the mathematics: see docs/baking.md. Zeros or more.
    double valueTolerance = 2.0 / 255.0;
    double subtexelTolerance = 1.0 / 16.0;
    double barycentricTolerance = 1e-5;
    double interpolationTolerance = 16.0 / (1 << 24);
};

// Where the output goes, and how much there may be.
struct GpuBakeRoom {
    // Triangles with data, by level. There is no need to know how many there will be: triangles without room become
    // unknown, and records that are not needed repeat another one, so that as many as this are always valid.
    std::array<std::uint32_t, kGpuBakeLevels> triangles{};
    VkDeviceAddress data = 0;    // dataBytes(); a multiple of 4, and of 256 for a build
    VkDeviceAddress records = 0; // recordBytes(), VkMicromapTriangleEXT; a multiple of 4, and of 256 for a build
    VkDeviceAddress indices = 0; // 4 bytes for each triangle of the input, VK_INDEX_TYPE_UINT32; a multiple of 4
};

// What the GPU writes to an address that is a multiple of 4.
struct GpuBakeResult {
    // kGpuBakeNoRoom: some triangle became unknown because the room of its level was full. kGpuBakeTooMuch: more than
    // 2^32 pieces of 64 micro-triangles would have had to be looked at; all triangles that need that became unknown.
    std::uint32_t status;
    std::array<std::uint32_t, kGpuBakeLevels> triangles; // with data, by level: the room that does
    // Triangles that became a special index, by state (0 transparent, 1 opaque, 2 and 3 unknown). Not set by
    // recordSizes().
    std::array<std::uint32_t, 4> special;
};
inline constexpr std::uint32_t kGpuBakeNoRoom = 0x1;
inline constexpr std::uint32_t kGpuBakeTooMuch = 0x2;

// An alpha image as the baker reads it. Must outlive the execution of all commands that were recorded with it, and be
// destroyed before the device.
class GpuAlpha
{
public:
    ~GpuAlpha();
    GpuAlpha(const GpuAlpha &) = delete;
    GpuAlpha &operator=(const GpuAlpha &) = delete;

private:
    friend class GpuBaker;
    struct State;
    explicit GpuAlpha(std::unique_ptr<State> state);
    std::unique_ptr<State> state_;
};

// Recording is safe from several threads, with a command buffer each. Must outlive the execution of what it recorded.
class GpuBaker
{
public:
    struct Info {
        VkDevice device = VK_NULL_HANDLE;
        PFN_vkGetDeviceProcAddr getDeviceProcAddr = nullptr;
        VkPipelineCache cache = VK_NULL_HANDLE; // of the application's, if any
        const VkAllocationCallbacks *allocator = nullptr;
    };

    // Makes the pipelines. VK_ERROR_INITIALIZATION_FAILED where a function is missing, or what Vulkan says.
    static VkResult create(const Info &info, std::unique_ptr<GpuBaker> &baker);
    ~GpuBaker();
    GpuBaker(const GpuBaker &) = delete;
    GpuBaker &operator=(const GpuBaker &) = delete;

    // VK_ERROR_FORMAT_NOT_SUPPORTED where the description is out of range, or what Vulkan says.
    VkResult createAlpha(const GpuAlphaInfo &info, std::unique_ptr<GpuAlpha> &alpha) const;

    // Bytes of scratch memory for so many triangles. Of a buffer with VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT,
    // STORAGE_BUFFER and INDIRECT_BUFFER: workgroups are counted there.
    [[nodiscard]] static VkDeviceSize scratchBytes(const GpuAlphaInfo &alpha, std::uint32_t triangles);

    struct Scratch {
        VkBuffer buffer = VK_NULL_HANDLE;
        VkDeviceSize offset = 0;     // in the buffer, a multiple of 4
        VkDeviceAddress address = 0; // of what is at the offset
    };

    // Records everything, for a room whose size is given. False, with nothing recorded, where an argument is out of the
    // range that is written beside it.
    //
    // Outside of render passes; inputs must be available to shader reads of compute shaders and may not change until
    // the commands have executed, nor may the scratch memory. Writes are those of compute shaders
    // (VK_ACCESS_SHADER_WRITE_BIT); the application makes them visible to what comes next. Binds a compute pipeline, a
    // descriptor set and push constants, and restores nothing.
    [[nodiscard]] bool record(VkCommandBuffer commands, const GpuAlpha &alpha, const GpuBakeInput &input,
                              const GpuBakeOptions &options, const Scratch &scratch, const GpuBakeRoom &room,
                              VkDeviceAddress result) const;

    // The same in two steps. The first writes the result: the room that is needed. The second takes the same arguments,
    // and the scratch memory as the first left it; a barrier between them is the application's.
    [[nodiscard]] bool recordSizes(VkCommandBuffer commands, const GpuAlpha &alpha, const GpuBakeInput &input,
                                   const GpuBakeOptions &options, const Scratch &scratch, VkDeviceAddress result) const;
    [[nodiscard]] bool recordData(VkCommandBuffer commands, const GpuAlpha &alpha, const GpuBakeInput &input,
                                  const GpuBakeOptions &options, const Scratch &scratch, const GpuBakeRoom &room,
                                  VkDeviceAddress result) const;

    // What a room takes: at most 2^32 - 1 bytes of data.
    [[nodiscard]] static std::uint64_t dataBytes(const GpuBakeRoom &room, VkOpacityMicromapFormatEXT format);
    [[nodiscard]] static std::uint64_t recordBytes(const GpuBakeRoom &room);
    // The usage counts of a room for VkMicromapBuildInfoEXT and VkAccelerationStructureTrianglesOpacityMicromapEXT. A
    // geometry refers to no record more than once.
    [[nodiscard]] static std::vector<VkMicromapUsageEXT> usage(const GpuBakeRoom &room,
                                                               VkOpacityMicromapFormatEXT format);

private:
    struct State;
    explicit GpuBaker(std::unique_ptr<State> state);
    std::unique_ptr<State> state_;
};

} // namespace vellum
