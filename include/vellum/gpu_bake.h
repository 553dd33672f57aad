// SPDX-License-Identifier: Apache-2.0
// The baker on the GPU: records compute work that bakes opacity micromaps into an application's command buffer.
//
// It makes the promise of docs/baking.md, with the same tolerances: a micro-triangle is opaque or transparent only if
// the alpha test has that outcome at every point of it. What single precision cannot decide is unknown. The output is
// the input of a micromap build: data, VkMicromapTriangleEXT records, and indices, with special indices for triangles
// of one state. docs/design/gpu-baker.md has the argument.
//
// Needs Vulkan 1.2, the feature bufferDeviceAddress and a queue with compute support, and no other feature.
//
//   std::unique_ptr<vellum::GpuBaker> baker;
//   std::unique_ptr<vellum::GpuAlpha> alpha;
//   vellum::GpuBaker::create({device, vkGetDeviceProcAddr}, baker);
//   baker->createAlpha({view, VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL, width, height}, alpha);
//
// In one step, with a fixed capacity for each level:
//
//   vellum::GpuBakeOutput output; // set output.triangles[5] = 10000 and the addresses
//   baker->record(commands, *alpha, input, options, scratch, output, result);
//
// In two steps, the first of which computes the capacity needed:
//
//   baker->recordSizes(commands, *alpha, input, options, scratch, result); // submit, wait, read the result
//   baker->recordData(commands, *alpha, input, options, scratch, output, result);
//
// Then record a barrier to the micromap build. usage(output, options.format) returns the usage counts of micromap and
// geometry.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include <vulkan/vulkan.h>

namespace vellum
{

inline constexpr std::uint32_t kGpuBakeLevels = 13; // subdivision levels 0..12

// An image, its component with alpha, and the sampler state that shaders read it with. The view may have any format
// that is sampled as floats, including block-compressed ones.
struct GpuAlphaInfo {
    VkImageView view = VK_NULL_HANDLE; // 2D, of an image with VK_IMAGE_USAGE_SAMPLED_BIT
    VkImageLayout layout = VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL;
    std::uint32_t width = 0;     // texels of the view's first mip level, 1..65536
    std::uint32_t height = 0;    //
    std::uint32_t mipLevels = 1; // of the view, 1..16; states hold for each of them
    std::uint32_t component = 3; // 0..3: r, g, b, a, after the view's swizzle
    VkSamplerAddressMode wrapU = VK_SAMPLER_ADDRESS_MODE_REPEAT;
    VkSamplerAddressMode wrapV = VK_SAMPLER_ADDRESS_MODE_REPEAT;
    VkFilter filter = VK_FILTER_LINEAR; // or VK_FILTER_NEAREST
    float border = 0;                   // alpha outside with VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_BORDER
};

// The triangles. Buffers of input and output need VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT. A triangle with an index
// out of range, or a coordinate that is not finite or at least 2^24 texels from the origin, is unknown; nothing outside
// of the buffers is read if their sizes are multiples of 4: shaders load whole words, also of 8-bit and 16-bit numbers.
struct GpuBakeInput {
    VkDeviceAddress uvs = 0;                      // address and stride: multiples of the size of a component
    std::uint32_t uvStride = 8;                   // bytes from one vertex to the next
    VkFormat uvFormat = VK_FORMAT_R32G32_SFLOAT;  // or VK_FORMAT_R16G16_SFLOAT, VK_FORMAT_R16G16_UNORM
    std::uint32_t vertices = 0;                   // number of vertices
    VkDeviceAddress indices = 0;                  // a multiple of the size of an index
    VkIndexType indexType = VK_INDEX_TYPE_UINT32; // UINT8, UINT16, UINT32, or NONE_KHR
    std::uint32_t triangles = 0;                  // at most 2^24
};

// The state of unknown micro-triangles in 2-state data; see VellumTwoStateRule.
enum class GpuTwoStateRule { Nearest, UnknownIsOpaque, UnknownIsTransparent };

struct GpuBakeOptions {
    VkOpacityMicromapFormatEXT format = VK_OPACITY_MICROMAP_FORMAT_4_STATE_EXT;
    GpuTwoStateRule twoStateRule = GpuTwoStateRule::Nearest;
    // Subdivision level of all triangles, 0..12. With `automatic`, the highest level: each triangle gets the level at
    // which the edges of its micro-triangles are about `texelsPerEdge` texels of the first mip level long.
    std::uint32_t level = 5;
    bool automatic = false;
    float texelsPerEdge = 4;
    // Triangles of one state get special indices. If false, every triangle gets data, as
    // VK_PIPELINE_CREATE_2_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_KHR requires.
    bool specialIndices = true;
    // A sample is opaque if "alpha `test` cutoff" is true. One of VK_COMPARE_OP_GREATER_OR_EQUAL, GREATER, LESS,
    // LESS_OR_EQUAL.
    double cutoff = 0.5;
    VkCompareOp test = VK_COMPARE_OP_GREATER_OR_EQUAL;
    // Bounds of rounding errors, 0 or more, as in VellumBakeOptions.
    double valueTolerance = 2.0 / 255.0;
    double subtexelTolerance = 1.0 / 16.0;
    double barycentricTolerance = 1e-5;
    double interpolationTolerance = 16.0 / (1 << 24);
};

// The memory of the output, and its capacity.
struct GpuBakeOutput {
    // Capacity in triangles with data, by level. Triangles beyond it become unknown; unused records repeat another one,
    // so all of them are valid.
    std::array<std::uint32_t, kGpuBakeLevels> triangles{};
    VkDeviceAddress data = 0;    // dataBytes(); a multiple of 4, and of 256 for a build
    VkDeviceAddress records = 0; // recordBytes(), VkMicromapTriangleEXT; a multiple of 4, and of 256 for a build
    VkDeviceAddress indices = 0; // 4 bytes for each triangle of the input, VK_INDEX_TYPE_UINT32; a multiple of 4
};

// The result that the GPU writes to `result`, an address that is a multiple of 4.
struct GpuBakeResult {
    // 0, or a combination of: kGpuBakeOverCapacity: triangles became unknown because the capacity of their level was
    // reached. kGpuBakeTooMuch: triangles became unknown because more than 2^32 blocks of 64 micro-triangles had to be
    // examined.
    std::uint32_t status;
    std::array<std::uint32_t, kGpuBakeLevels> triangles; // with data, by level: the capacity needed
    // Triangles with special indices, by state (0 transparent, 1 opaque, 2 and 3 unknown). Not set by recordSizes().
    std::array<std::uint32_t, 4> special;
};
inline constexpr std::uint32_t kGpuBakeOverCapacity = 0x1;
inline constexpr std::uint32_t kGpuBakeTooMuch = 0x2;

// An alpha image, prepared for the baker. It must outlive the execution of all commands recorded with it, and must be
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

// Threads may record at the same time, each into its own command buffer. It must outlive the execution of what it
// recorded.
class GpuBaker
{
public:
    struct Info {
        VkDevice device = VK_NULL_HANDLE;
        PFN_vkGetDeviceProcAddr getDeviceProcAddr = nullptr;
        VkPipelineCache cache = VK_NULL_HANDLE; // optional
        const VkAllocationCallbacks *allocator = nullptr;
    };

    // Creates the pipelines. Returns VK_ERROR_INITIALIZATION_FAILED if a Vulkan function is missing, or Vulkan's error.
    static VkResult create(const Info &info, std::unique_ptr<GpuBaker> &baker);
    ~GpuBaker();
    GpuBaker(const GpuBaker &) = delete;
    GpuBaker &operator=(const GpuBaker &) = delete;

    // Returns VK_ERROR_FORMAT_NOT_SUPPORTED if `info` is out of range, or Vulkan's error.
    VkResult createAlpha(const GpuAlphaInfo &info, std::unique_ptr<GpuAlpha> &alpha) const;

    // Bytes of scratch memory for this number of triangles. Its buffer needs the usages SHADER_DEVICE_ADDRESS,
    // STORAGE_BUFFER and INDIRECT_BUFFER.
    [[nodiscard]] static VkDeviceSize scratchBytes(const GpuAlphaInfo &alpha, std::uint32_t triangles);

    struct Scratch {
        VkBuffer buffer = VK_NULL_HANDLE;
        VkDeviceSize offset = 0;     // in the buffer, a multiple of 4
        VkDeviceAddress address = 0; // of the buffer plus `offset`
    };

    // Records the bake in one step. Returns false and records nothing if an argument is out of range.
    //
    // Must be recorded outside of render passes. Inputs must be visible to compute shaders (VK_ACCESS_SHADER_READ_BIT);
    // neither they nor the scratch memory may change until the commands have executed. Results are written by compute
    // shaders (VK_ACCESS_SHADER_WRITE_BIT); the application records the barrier after them. Changes the bound compute
    // pipeline, descriptor set and push constants.
    [[nodiscard]] bool record(VkCommandBuffer commands, const GpuAlpha &alpha, const GpuBakeInput &input,
                              const GpuBakeOptions &options, const Scratch &scratch, const GpuBakeOutput &output,
                              VkDeviceAddress result) const;

    // Records the same work in two steps. The first writes `result`, with the capacity needed. The second takes the
    // same arguments and the unchanged scratch memory; the application records a barrier between them.
    [[nodiscard]] bool recordSizes(VkCommandBuffer commands, const GpuAlpha &alpha, const GpuBakeInput &input,
                                   const GpuBakeOptions &options, const Scratch &scratch, VkDeviceAddress result) const;
    [[nodiscard]] bool recordData(VkCommandBuffer commands, const GpuAlpha &alpha, const GpuBakeInput &input,
                                  const GpuBakeOptions &options, const Scratch &scratch, const GpuBakeOutput &output,
                                  VkDeviceAddress result) const;

    // Bytes of data and of records that a capacity needs. The data may be at most 2^32 - 1 bytes.
    [[nodiscard]] static std::uint64_t dataBytes(const GpuBakeOutput &output, VkOpacityMicromapFormatEXT format);
    [[nodiscard]] static std::uint64_t recordBytes(const GpuBakeOutput &output);
    // The usage counts of a capacity, for VkMicromapBuildInfoEXT and
    // VkAccelerationStructureTrianglesOpacityMicromapEXT. A geometry refers to each record at most once.
    [[nodiscard]] static std::vector<VkMicromapUsageEXT> usage(const GpuBakeOutput &output,
                                                               VkOpacityMicromapFormatEXT format);

private:
    struct State;
    explicit GpuBaker(std::unique_ptr<State> state);
    std::unique_ptr<State> state_;
};

} // namespace vellum
