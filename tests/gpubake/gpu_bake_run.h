// Bakes on the GPU as an application does, between guard bytes, and brings the result back.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "bake/bake.h"
#include "harness/scene.h"
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
    VkImage image_ = VK_NULL_HANDLE;
    VkDeviceMemory memory_ = VK_NULL_HANDLE;
    vellum::GpuAlphaInfo info_;
};

// Vertices as an application has them.
struct Mesh {
    std::vector<std::uint8_t> uvs;
    std::uint32_t uvStride = 8;
    VkFormat uvFormat = VK_FORMAT_R32G32_SFLOAT;
    std::uint32_t vertices = 0;
    std::vector<std::uint8_t> indices;
    VkIndexType indexType = VK_INDEX_TYPE_NONE_KHR;
    std::uint32_t triangles = 0;

    // Three vertices for each.
    static Mesh of(std::span<const vellum::TriangleUvs> triangles);
};

struct GpuBaked {
    vellum::GpuBakeResult result;
    std::vector<std::int32_t> indices;
    std::vector<VkMicromapTriangleEXT> records;
    std::vector<std::uint8_t> data;

    [[nodiscard]] vellum::State stateOf(std::uint32_t triangle, std::uint32_t microTriangle) const;
    // What a micromap build makes of it.
    [[nodiscard]] vellum::Micromap micromap() const;
};

enum class Steps { One, Two };

class BakeRunner
{
public:
    explicit BakeRunner(Gpu &gpu);

    // With room for every triangle where the steps are one and there is no other, or as much as the sizes say.
    GpuBaked bake(const AlphaImage &image, const Mesh &mesh, const vellum::GpuBakeOptions &options,
                  Steps steps = Steps::One, const vellum::GpuBakeRoom *room = nullptr);
    GpuBaked bake(const vellum::AlphaTexture &texture, std::span<const vellum::TriangleUvs> triangles,
                  const vellum::GpuBakeOptions &options);
    [[nodiscard]] const vellum::GpuBaker &baker() const { return *baker_; }

private:
    Gpu &gpu_;
    std::unique_ptr<vellum::GpuBaker> baker_;
};

// The same options for the GPU.
vellum::GpuBakeOptions onGpu(const vellum::BakeOptions &options);

inline constexpr VkBufferUsageFlags kBakeStorage =
    VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;

} // namespace vt
