// The picture: everything but the way of tracing, with or without micromaps in the structures that are traced.
#pragma once

#include <cstdint>

#include "cli/picture/picture.h"
#include "cli/renderer/acceleration.h"
#include "cli/renderer/trace_pipeline.h"
#include "cli/scene/camera.h"

namespace vellum::cli
{

struct RenderSettings {
    std::uint32_t width = 1280;
    std::uint32_t height = 720;
    std::uint32_t samples = 1; // per pixel
    bool heavy = false;        // 16 more texture reads per candidate
    Trace trace = Trace::Query;
    bool paintStates = false; // on the leaves, in kStateColors; by Trace::Query only
    View view;
};

struct CandidateCount {
    std::uint64_t rays = 0;
    std::uint64_t candidates = 0; // handed to the shader
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
    // For Trace::Pipeline the device must have ray tracing pipelines enabled.
    Renderer(Device &device, const RenderScene &scene, std::span<const Micromap *const> micromaps,
             const RenderSettings &settings);
    ~Renderer();
    Renderer(const Renderer &) = delete;
    Renderer &operator=(const Renderer &) = delete;

    // Renders one frame and returns its milliseconds: on a GPU by timestamps, else by the clock.
    double frame();
    // Makes a new pipeline, renders a frame with it, and returns the milliseconds of both together by the clock.
    double firstFrame();
    // What the last frame drew.
    [[nodiscard]] Picture picture();
    // Renders once more with a shader that counts.
    CandidateCount count();
    // The same by pixel: what the shader was handed for all rays of a sample, on average.
    std::vector<float> candidatesPerPixel();
    [[nodiscard]] VkDeviceSize micromapBytes() const { return m_world.micromapBytes(); }

private:
    struct Frame { // push constants of shaders/scene.glsl
        float origin[4], right[4], up[4], forward[4], sun[4];
    };

    Renderer(Device &device, const RenderSettings &settings, World &&world);
    static Frame makeFrame(const RenderScene &scene, const RenderSettings &settings);
    void uploadScene(const RenderScene &scene, std::span<const Micromap *const> micromaps);
    void createLayouts();
    void createDescriptors();
    [[nodiscard]] std::unique_ptr<TracePipeline> makePipeline(bool counting) const;
    void record(VkCommandBuffer commands, const TracePipeline &pipeline) const;
    void recordFrame();
    std::vector<std::uint32_t> countPixels(); // candidates and rays of each

    Device &m_device;
    RenderSettings m_settings;
    World m_world;
    Frame m_frame{};
    std::vector<Texture> m_textures;
    Buffer m_pixels, m_records, m_uvs, m_normals, m_counts, m_states, m_alphas;
    bool m_hasAlphas = false; // of vertices
    VkDescriptorSetLayout m_setLayout = VK_NULL_HANDLE;
    VkPipelineLayout m_layout = VK_NULL_HANDLE;
    VkDescriptorPool m_pool = VK_NULL_HANDLE;
    VkDescriptorSet m_set = VK_NULL_HANDLE;
    std::unique_ptr<TracePipeline> m_pipeline;
    std::unique_ptr<TracePipeline> m_countingPipeline; // made when it is first needed
    VkQueryPool m_timestamps = VK_NULL_HANDLE;
    double m_nanosecondsPerTick = 1;
    VkCommandBuffer m_commands = VK_NULL_HANDLE;
};

} // namespace vellum::cli
