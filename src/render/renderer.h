// SPDX-License-Identifier: Apache-2.0
// The picture: everything but the way of tracing, with or without micromaps in the structures that are traced.
#pragma once

#include <cstdint>

#include "base/picture.h"
#include "render/camera.h"
#include "render/texture.h"
#include "render/trace_pipeline.h"
#include "render/world.h"

namespace vellum::render
{

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
    // The same, and returns the milliseconds: on a GPU by timestamps, else by the clock.
    double frame() { return timedFrame().gpu; }
    // Makes a new pipeline, renders a frame with it, and returns the milliseconds of both together by the clock.
    double firstFrame();
    // What the last frame drew.
    [[nodiscard]] Picture picture();
    // Renders once more with a shader that counts.
    CandidateCount count();
    // The same by pixel: what the shader was handed for all rays of a sample, on average.
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
