// SPDX-License-Identifier: Apache-2.0
// The picture: everything but the way of tracing, with or without micromaps in the structures that are traced.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/picture.h"
#include "gpu/device.h"
#include "render/math.h"
#include "render/world.h"

namespace vellum::render
{

// What draws the picture: ray queries in a compute shader, or a ray tracing pipeline.
enum class Trace { Query, Pipeline };

// The methods that the device supports, in this order; at least one if it traces rays.
std::vector<Trace> tracesOf(const gpu::DeviceInfo &device);

// The stages in which a pipeline traces.
struct TraceStages {
    VkPipelineBindPoint bindPoint;
    VkPipelineStageFlags pipelineStage;
    VkShaderStageFlags shaders; // stages that use the descriptors and push constants
};
TraceStages stagesOf(Trace trace);

// The specialization constants 0, 1, ... of shaders/scene.glsl.
struct TraceConstants {
    uint32_t textures = 1;
    uint32_t heavyReads = 0;
    VkBool32 counting = VK_FALSE;
    VkBool32 painting = VK_FALSE;
    VkBool32 vertexAlphas = VK_FALSE;
};

struct TracePipelineInfo {
    VkPipelineLayout layout = VK_NULL_HANDLE;
    bool micromaps = false; // the structures that it traces have some
    TraceConstants constants;
};

class TracePipeline
{
public:
    virtual ~TracePipeline() = default;
    TracePipeline(const TracePipeline &) = delete;
    TracePipeline &operator=(const TracePipeline &) = delete;

    // Traces these many pixels. Descriptors and push constants must be bound.
    virtual void record(VkCommandBuffer commands, uint32_t width, uint32_t height) const = 0;

protected:
    TracePipeline() = default;
};

// `device` must outlive the pipeline. Throws gpu::VulkanError or std::runtime_error.
std::unique_ptr<TracePipeline> makeTracePipeline(gpu::Device &device, Trace trace, const TracePipelineInfo &info);

// A pinhole camera that sees all of a scene.
struct View {
    float yaw = 25;         // degrees about the vertical axis; 0 looks along -z
    float pitch = 3;        // degrees down
    float zoom = 1;         // above 1: closer
    float fieldOfView = 32; // degrees, vertical
};

struct Camera {
    Vec3 origin{};
    // The direction of the ray through the picture's point (x, y), both -1..1, y up: forward + x * right + y * up.
    Vec3 right{};
    Vec3 up{};
    Vec3 forward{};
};

// The camera that looks from just so far that all `points` are in a picture of `aspect` (width by height), in the
// middle of it, for a zoom of 1.
Camera fitCamera(std::span<const Vec3> points, const View &view, float aspect);

struct RenderSettings {
    uint32_t width = 1280;
    uint32_t height = 720;
    uint32_t samples = 1; // per pixel
    bool heavy = false;   // 16 more texture reads per candidate
    Trace trace = Trace::Query;
    bool paintStates = false; // on the leaves, in kStateColors; by Trace::Query only
    View view;
};

struct CandidateCount {
    uint64_t rays = 0;
    uint64_t candidates = 0; // handed to the shader
    [[nodiscard]] double perRay() const
    {
        return rays == 0 ? 0 : static_cast<double>(candidates) / static_cast<double>(rays);
    }
};

class Renderer
{
public:
    // Uploads and builds everything. `micromaps` as for World; with settings.paintStates they are only painted, and
    // need nothing of the device. `device` must outlive the renderer, `scene` need not.
    // Throws std::runtime_error where the device lacks something.
    Renderer(gpu::Device &device, const RenderScene &scene, std::span<const Micromap *const> micromaps,
             const RenderSettings &settings);
    ~Renderer();
    Renderer(const Renderer &) = delete;
    Renderer &operator=(const Renderer &) = delete;

    // Renders one frame.
    gpu::Milliseconds timedFrame();
    // Draws a frame and returns the milliseconds: on a GPU by timestamps, otherwise by the clock.
    double frame() { return timedFrame().gpu; }
    // Makes a new pipeline, renders a frame with it, and returns the milliseconds of both together by the clock.
    double firstFrame();
    // The picture of the last frame.
    [[nodiscard]] Picture picture();
    // Renders once more with a shader that counts.
    CandidateCount count();
    // The number of candidates by pixel: those that the shader got for all rays of a sample, on average.
    std::vector<float> candidatesPerPixel();
    [[nodiscard]] VkDeviceSize micromapBytes() const { return world_.micromapBytes(); }
    [[nodiscard]] VkDeviceSize structureBytes() const { return world_.structureBytes(); }

private:
    struct Frame { // push constants of shaders/scene.glsl
        float origin[4], right[4], up[4], forward[4], sun[4];
    };

    Renderer(gpu::Device &device, const RenderSettings &settings, World &&world);
    static Frame makeFrame(const RenderScene &scene, const RenderSettings &settings);
    void uploadScene(const RenderScene &scene, std::span<const Micromap *const> micromaps);
    void createLayouts();
    void createDescriptors();
    [[nodiscard]] std::unique_ptr<TracePipeline> makePipeline(bool counting) const;
    void record(VkCommandBuffer commands, const TracePipeline &pipeline) const;
    void recordFrame();
    std::vector<uint32_t> countPixels(); // candidates and rays of each

    gpu::Device &device_;
    RenderSettings settings_;
    World world_;
    Frame frame_{};
    std::vector<Texture> textures_;
    gpu::Buffer pixels_, records_, uvs_, normals_, counts_, states_, alphas_;
    bool hasAlphas_ = false; // of vertices
    VkDescriptorSetLayout setLayout_ = VK_NULL_HANDLE;
    VkPipelineLayout layout_ = VK_NULL_HANDLE;
    VkDescriptorPool pool_ = VK_NULL_HANDLE;
    VkDescriptorSet set_ = VK_NULL_HANDLE;
    std::unique_ptr<TracePipeline> pipeline_;
    std::unique_ptr<TracePipeline> countingPipeline_; // made when it is first needed
    gpu::GpuTimer timer_;
    VkCommandBuffer commands_ = VK_NULL_HANDLE;
};

} // namespace vellum::render
