// SPDX-License-Identifier: Apache-2.0
// Bakes on the GPU as an application does, between guard bytes, and brings the result back.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "bake/bake.h"
#include "gpu/scene.h"
#include "harness/harness.h"
#include "vellum/gpu_bake.h"

namespace vt
{

// An image with the values of textures, the mip levels of one.
class AlphaImage
{
public:
    // R32_SFLOAT, or the alpha of R8G8B8A8_UNORM.
    enum class Format { Float, Unorm8 };
    AlphaImage(Gpu &gpu, std::span<const vellum::AlphaTexture> levels, Format format);
    AlphaImage(const AlphaImage &) = delete;
    AlphaImage &operator=(const AlphaImage &) = delete;
    ~AlphaImage();

    [[nodiscard]] const vellum::GpuAlphaInfo &info() const { return info_; }

private:
    void upload(std::span<const vellum::AlphaTexture> levels, Format format, VkFormat texels);

    Gpu &gpu_;
    std::optional<DeviceImage> image_;
    vellum::GpuAlphaInfo info_;
};

// Vertices as an application has them.
struct Mesh {
    std::vector<uint8_t> uvs;
    uint32_t uvStride = 8;
    VkFormat uvFormat = VK_FORMAT_R32G32_SFLOAT;
    uint32_t vertices = 0;
    std::vector<uint8_t> indices;
    VkIndexType indexType = VK_INDEX_TYPE_NONE_KHR;
    uint32_t triangles = 0;

    // Three vertices for each.
    static Mesh of(std::span<const vellum::TriangleUvs> triangles);
};

struct GpuBaked {
    vellum::GpuBakeResult result{};
    std::vector<int32_t> indices;
    std::vector<VkMicromapTriangleEXT> records;
    std::vector<uint8_t> data;

    [[nodiscard]] vellum::State stateOf(uint32_t triangle, uint32_t microTriangle) const;
    // The micromap that a build makes of these arrays.
    [[nodiscard]] vellum::Micromap micromap() const;
};

// Capacity for every triangle of a mesh.
vellum::GpuBakeOutput outputForAll(const Mesh &mesh, const vellum::GpuBakeOptions &options);

inline constexpr VkBufferUsageFlags kBakeStorage =
    VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;

// One bake: its buffers, which guard bytes surround, and its commands.
class BakeJob
{
public:
    BakeJob(Gpu &gpu, const vellum::GpuBaker &baker, const AlphaImage &image, const Mesh &mesh,
            const vellum::GpuBakeOptions &options);
    BakeJob(const BakeJob &) = delete;
    BakeJob &operator=(const BakeJob &) = delete;
    ~BakeJob();

    // Makes the output's buffers; before anything that writes them is recorded.
    void setOutput(const vellum::GpuBakeOutput &output, VkBufferUsageFlags more = 0);
    // Records what an application would. Returns false if the baker rejects it.
    [[nodiscard]] bool record(VkCommandBuffer commands);
    [[nodiscard]] bool recordSizes(VkCommandBuffer commands);
    [[nodiscard]] bool recordData(VkCommandBuffer commands);

    [[nodiscard]] vellum::GpuBakeResult result() const;
    [[nodiscard]] GpuBaked read() const;
    [[nodiscard]] const vellum::GpuBakeOutput &output() const { return output_; }
    [[nodiscard]] vellum::GpuBakeInput &input() { return input_; }

private:
    const vellum::GpuBaker &baker_;
    vellum::GpuBakeOptions options_;
    std::unique_ptr<vellum::GpuAlpha> alpha_;
    Buffer uvs_, meshIndices_;
    Guarded scratch_, result_, data_, records_, indices_;
    vellum::GpuBakeInput input_;
    vellum::GpuBakeOutput output_;
    Gpu &gpu_;
};

enum class Steps { One, Two };

class BakeRunner
{
public:
    explicit BakeRunner(Gpu &gpu);

    // Bakes in one step with capacity for all, or in two with the capacity that the first returns, unless `output` has
    // another.
    GpuBaked bake(const AlphaImage &image, const Mesh &mesh, const vellum::GpuBakeOptions &options,
                  Steps steps = Steps::One, const vellum::GpuBakeOutput *output = nullptr);
    GpuBaked bake(const vellum::AlphaTexture &texture, std::span<const vellum::TriangleUvs> triangles,
                  const vellum::GpuBakeOptions &options, Steps steps = Steps::One);
    [[nodiscard]] const vellum::GpuBaker &baker() const { return *baker_; }

private:
    Gpu &gpu_;
    std::unique_ptr<vellum::GpuBaker> baker_;
};

// A test on the device that all share, with a baker that those of a suite share: its shaders take longer than most
// tests.
class GpuBakeTest : public GpuTest
{
public:
    static void TearDownTestSuite() { shared_.reset(); }

protected:
    GpuBakeTest() : GpuTest({.shared = true}), runner_(runner(gpu())) {}

    BakeRunner &runner_;

private:
    static BakeRunner &runner(Gpu &gpu)
    {
        if (!shared_)
            shared_ = std::make_unique<BakeRunner>(gpu);
        return *shared_;
    }
    static inline std::unique_ptr<BakeRunner> shared_;
};

// The same options for the GPU baker.
vellum::GpuBakeOptions onGpu(const vellum::BakeOptions &options);

} // namespace vt
