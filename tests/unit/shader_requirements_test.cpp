// SPDX-License-Identifier: Apache-2.0
// The requirements that the layer's shaders declare: no more than emulated micromaps need of a device.
#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <map>
#include <set>
#include <span>
#include <string>

#include "spirv/module/numbers.h"

namespace spv = vellum::spv;

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

// Calls visit(opcode, words) for each instruction.
template <typename Visit>
void eachInstruction(std::span<const uint32_t> words, Visit visit)
{
    for (size_t at = 5; at < words.size(); at += words[at] >> 16)
        visit(words[at] & 0xffffu, words.subspan(at, words[at] >> 16));
}

Needs needsOf(std::span<const uint32_t> words)
{
    Needs needs{.version = words[1], .capabilities = {}, .extensions = {}};
    eachInstruction(words, [&needs](uint32_t opcode, std::span<const uint32_t> instruction) {
        if (opcode == spv::OpCapability)
            needs.capabilities.insert(instruction[1]);
        else if (opcode == spv::OpExtension)
            needs.extensions.insert(reinterpret_cast<const char *>(&instruction[1]));
    });
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

// The numbers of stores to buffers in functions with a memory barrier: to coherent memory and to other memory.
std::map<bool, int> storesWithBarriers(std::span<const uint32_t> module)
{
    std::set<uint32_t> coherent;            // types of blocks
    std::map<uint32_t, uint32_t> pointedTo; // types in buffers, by the types of their pointers
    std::map<uint32_t, uint32_t> typeOf;
    std::map<uint32_t, uint32_t> baseOf; // of access chains
    std::map<bool, int> stores, ofFunction;
    bool barrier = false;
    eachInstruction(module, [&](uint32_t opcode, std::span<const uint32_t> words) {
        switch (opcode) {
        case spv::OpMemberDecorate:
            if (words[3] == spv::DecorationCoherent)
                coherent.insert(words[1]);
            break;
        case spv::OpTypePointer:
            if (words[2] == spv::StorageClassPhysicalStorageBuffer)
                pointedTo[words[1]] = words[3];
            break;
        case spv::OpAccessChain: baseOf[words[2]] = words[3]; [[fallthrough]];
        case spv::OpLoad:
        case spv::OpBitcast:
        case spv::OpConvertUToPtr: typeOf[words[2]] = words[1]; break;
        case spv::OpStore:
            if (baseOf.contains(words[1]) && pointedTo.contains(typeOf[words[1]]))
                ++ofFunction[coherent.contains(pointedTo[typeOf[baseOf[words[1]]]])];
            break;
        case spv::OpMemoryBarrier: barrier = true; break;
        case spv::OpFunctionEnd:
            for (const auto &[isCoherent, number] : ofFunction)
                stores[isCoherent] += barrier ? number : 0;
            ofFunction.clear();
            barrier = false;
            break;
        default: break;
        }
    });
    return stores;
}

// A barrier orders no other stores for readers outside the invocation, such as the host.
TEST(LayerShaders, MemoryBarriersOrderCoherentStores)
{
    int coherent = 0;
    for (const LayerShader &shader : kLayerShaders) {
        std::map<bool, int> stores = storesWithBarriers(shader.words);
        EXPECT_EQ(stores[false], 0) << shader.name;
        coherent += stores[true];
    }
    EXPECT_GT(coherent, 10);
}

} // namespace
