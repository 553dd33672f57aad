// SPDX-License-Identifier: Apache-2.0
// What the layer's shaders declare that they need: no more than emulated micromaps need of a device.
#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <set>
#include <span>
#include <string>

#include "spirv/module/opcodes.h"

namespace
{

struct LayerShader {
    const char *name;
    std::span<const uint32_t> words;
};
#include "layer_shaders.h" // kLayerShaders

struct Needs {
    uint32_t version = 0;
    std::set<uint32_t> capabilities;
    std::set<std::string> extensions;
};

Needs needsOf(std::span<const uint32_t> words)
{
    Needs needs{.version = words[1], .capabilities = {}, .extensions = {}};
    for (size_t at = 5; at < words.size(); at += words[at] >> 16) {
        const uint32_t opcode = words[at] & 0xffffu;
        if (opcode == spv::OpCapability)
            needs.capabilities.insert(words[at + 1]);
        else if (opcode == spv::OpExtension)
            needs.extensions.insert(reinterpret_cast<const char *>(&words[at + 1]));
    }
    return needs;
}

// bufferDeviceAddress is what the layer enables itself. VK_KHR_acceleration_structure needs Vulkan 1.1, which has
// SPIR-V 1.3. Whoever traces rays has also enabled rayQuery or rayTracingPipeline, whose extensions need
// VK_KHR_spirv_1_4.
TEST(LayerShaders, NeedOnlyWhatEmulationNeeds)
{
    EXPECT_GT(std::size(kLayerShaders), 25u);
    for (const LayerShader &shader : kLayerShaders) {
        SCOPED_TRACE(shader.name);
        const Needs needs = needsOf(shader.words);
        const bool pipelines = needs.capabilities.contains(spv::CapabilityRayTracingKHR);
        const bool queries = needs.capabilities.contains(spv::CapabilityRayQueryKHR);
        const bool mayTrace = std::strcmp(shader.name, "any_hit") == 0;
        EXPECT_TRUE(mayTrace || (!pipelines && !queries));
        EXPECT_LE(needs.version, mayTrace ? 0x00010400u : 0x00010300u);
        for (const uint32_t capability : needs.capabilities)
            EXPECT_TRUE(capability == spv::CapabilityShader || capability == spv::CapabilityRayTracingKHR ||
                        capability == spv::CapabilityRayQueryKHR ||
                        capability == spv::CapabilityPhysicalStorageBufferAddresses)
                << "capability " << capability;
        for (const std::string &extension : needs.extensions)
            EXPECT_TRUE(extension == "SPV_KHR_physical_storage_buffer" ||
                        (pipelines && extension == "SPV_KHR_ray_tracing") ||
                        (queries && extension == "SPV_KHR_ray_query"))
                << extension;
    }
}

} // namespace
