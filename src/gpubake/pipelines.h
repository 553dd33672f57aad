// The GPU baker's compute pipelines, all with one layout: an image in set 0, and push constants.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "gpubake/functions.h"

namespace vellum::gpubake
{

// In the order in which they run.
enum class Shader : std::uint8_t {
    Params,
    Begin,
    Cells,
    Blocks,
    Plan,
    Count,
    Scan,
    Place,
    Probe,
    Measure,
    Write,
    Records,
};
inline constexpr std::size_t kShaders = 12;

// Push constants are at most what every device has.
inline constexpr std::uint32_t kPushBytes = 128;

class Pipelines
{
public:
    Pipelines(VkDevice device, const VkAllocationCallbacks *allocator) : m_device(device), m_allocator(allocator) {}
    ~Pipelines();
    Pipelines(const Pipelines &) = delete;
    Pipelines &operator=(const Pipelines &) = delete;

    VkResult create(PFN_vkGetDeviceProcAddr getDeviceProcAddr, VkPipelineCache cache);

    [[nodiscard]] VkDevice device() const { return m_device; }
    [[nodiscard]] const VkAllocationCallbacks *allocator() const { return m_allocator; }
    [[nodiscard]] const Functions &functions() const { return m_functions; }
    [[nodiscard]] VkDescriptorSetLayout setLayout() const { return m_setLayout; }
    [[nodiscard]] VkPipelineLayout layout() const { return m_layout; }
    [[nodiscard]] VkPipeline operator[](Shader shader) const { return m_pipelines[static_cast<std::size_t>(shader)]; }

private:
    VkResult createLayouts();

    VkDevice m_device;
    const VkAllocationCallbacks *m_allocator;
    bool m_loaded = false;
    Functions m_functions;
    VkDescriptorSetLayout m_setLayout = VK_NULL_HANDLE;
    VkPipelineLayout m_layout = VK_NULL_HANDLE;
    std::array<VkPipeline, kShaders> m_pipelines{};
};

} // namespace vellum::gpubake
