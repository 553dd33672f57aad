// SPDX-License-Identifier: Apache-2.0
// VK_EXT_shader_object: ray queries in a shader object, and a bound one that survives builds.
#include <cstddef>
#include <vector>

#include "command_buffer/shader_objects.h"
#include "command_buffer/state_scene.h"
#include "harness/program/labels.h"

namespace
{

const vt::Labels kShaderObjectLabels{{"ShaderObject.*", "forcing"}, {"ShaderObject.ThePromise*", "strict"}};

using namespace vt;

class ShaderObject : public GpuTest
{
protected:
    ShaderObject() : GpuTest({.oldValidation = false, .shaderObject = true}) {}
};

TEST_F(ShaderObject, TracesAndSurvivesBuilds)
{
    if (!gpu().has("VK_EXT_shader_object"))
        GTEST_SKIP() << "no VK_EXT_shader_object";
    const auto create = reinterpret_cast<CreateShaders>(vkGetDeviceProcAddr(gpu().device(), "vkCreateShadersEXT"));
    const auto destroy = reinterpret_cast<DestroyShader>(vkGetDeviceProcAddr(gpu().device(), "vkDestroyShaderEXT"));
    const auto bind = reinterpret_cast<BindShaders>(vkGetDeviceProcAddr(gpu().device(), "vkCmdBindShadersEXT"));
    ASSERT_TRUE(create != nullptr && destroy != nullptr && bind != nullptr);

    StateScene scene(gpu());
    Tracer tracer(gpu());
    TracerShader description(gpu(), tracer);
    ShaderCreateInfo &info = description.info;
    ShaderHandle shader = 0;
    VT_CHECK(create(gpu().device(), 1, &info, nullptr, &shader));

    const std::vector<Ray> rays = scene.rays();
    tracer.prepare(scene.tlas(), rays);
    gpu().submit([&](VkCommandBuffer commands) {
        tracer.bind(commands); // descriptor set and push constants; the shader object replaces the pipeline
        const VkShaderStageFlagBits stage = VK_SHADER_STAGE_COMPUTE_BIT;
        bind(commands, 1, &stage, &shader);
        scene.record(commands);
        tracer.dispatch(commands);
        barrier(commands);
    });
    StateScene::expectRight(tracer.results());
    destroy(gpu().device(), shader, nullptr);
}

// VK_SHADER_CREATE_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_EXT: the spy below the layer reports if it gets
// there.
TEST_F(ShaderObject, ThePromiseOfNoMixedSpecialIndicesStaysInTheLayer)
{
    if (!gpu().has("VK_EXT_shader_object"))
        GTEST_SKIP() << "no VK_EXT_shader_object";
    const auto create = reinterpret_cast<CreateShaders>(vkGetDeviceProcAddr(gpu().device(), "vkCreateShadersEXT"));
    const auto destroy = reinterpret_cast<DestroyShader>(vkGetDeviceProcAddr(gpu().device(), "vkDestroyShaderEXT"));
    const Tracer tracer(gpu());
    TracerShader description(gpu(), tracer);
    description.info.flags = 1u << 12;
    ShaderHandle shader = 0;
    const bool rejected = strictTests() && !gpu().khr();
    EXPECT_EQ(create(gpu().device(), 1, &description.info, nullptr, &shader),
              rejected ? VK_ERROR_VALIDATION_FAILED_EXT : VK_SUCCESS);
    EXPECT_EQ(shader == 0, rejected);
    destroy(gpu().device(), shader, nullptr);
    const std::vector<Message> messages = gpu().takeUnexpectedMessages();
    ASSERT_EQ(messages.size(), gpu().khr() ? 0u : 1u);
    for (const Message &m : messages)
        EXPECT_EQ(m.id, "VELLUM-VUID-VkShaderCreateInfoEXT-micromap-11623") << m.text;
}

// A rewritten shader holds addresses of its device's tables: its binary must come back on devices with tables there,
// and on no others.
TEST_F(ShaderObject, BinariesFitOnlyWhereTheTablesAre)
{
    if (!gpu().has("VK_EXT_shader_object"))
        GTEST_SKIP() << "no VK_EXT_shader_object";
    using GetBinary = VkResult(VKAPI_PTR *)(VkDevice, ShaderHandle, size_t *, void *);
    const auto create = reinterpret_cast<CreateShaders>(vkGetDeviceProcAddr(gpu().device(), "vkCreateShadersEXT"));
    const auto destroy = reinterpret_cast<DestroyShader>(vkGetDeviceProcAddr(gpu().device(), "vkDestroyShaderEXT"));
    const auto binaryOf = reinterpret_cast<GetBinary>(vkGetDeviceProcAddr(gpu().device(), "vkGetShaderBinaryDataEXT"));
    ASSERT_TRUE(create != nullptr && destroy != nullptr && binaryOf != nullptr);

    Tracer tracer(gpu());
    TracerShader description(gpu(), tracer);
    ShaderCreateInfo &info = description.info;
    ShaderHandle shader = 0;
    VT_CHECK(create(gpu().device(), 1, &info, nullptr, &shader));

    size_t size = 0;
    VT_CHECK(binaryOf(gpu().device(), shader, &size, nullptr));
    std::vector<std::max_align_t> storage(size / sizeof(std::max_align_t) + 1);
    auto *bytes = reinterpret_cast<uint8_t *>(storage.data());
    size_t small = size - 1;
    EXPECT_EQ(binaryOf(gpu().device(), shader, &small, bytes), VK_INCOMPLETE);
    VT_CHECK(binaryOf(gpu().device(), shader, &size, bytes));
    destroy(gpu().device(), shader, nullptr);

    info.codeType = 0; // VK_SHADER_CODE_TYPE_BINARY_EXT
    info.codeSize = size;
    info.pCode = bytes;
    EXPECT_EQ(create(gpu().device(), 1, &info, nullptr, &shader), VK_SUCCESS);
    destroy(gpu().device(), shader, nullptr);

    {
        // Exists at the same time, so its tables have other addresses.
        Gpu other(gpu().options());
        const Tracer otherTracer(other);
        TracerShader otherDescription(other, otherTracer);
        otherDescription.info.codeType = info.codeType;
        otherDescription.info.codeSize = size;
        otherDescription.info.pCode = bytes;
        const auto otherCreate =
            reinterpret_cast<CreateShaders>(vkGetDeviceProcAddr(other.device(), "vkCreateShadersEXT"));
        EXPECT_EQ(otherCreate(other.device(), 1, &otherDescription.info, nullptr, &shader),
                  static_cast<VkResult>(1000482000));
    }

    constexpr auto incompatible = static_cast<VkResult>(1000482000); // VK_INCOMPATIBLE_SHADER_BINARY_EXT
    bytes[20] ^= 1;                                                  // differs as with another device
    EXPECT_EQ(create(gpu().device(), 1, &info, nullptr, &shader), incompatible);
    EXPECT_EQ(shader, 0u);
    info.codeSize = 7;
    EXPECT_EQ(create(gpu().device(), 1, &info, nullptr, &shader), incompatible);
}

// As in the next run of a program: on lavapipe, the tables get the same addresses.
TEST(ShaderObjectBinary, FitsTheNextDevice)
{
    const Options options{.validation = false, .spy = false, .shaderObject = true};
    using GetBinary = VkResult(VKAPI_PTR *)(VkDevice, ShaderHandle, size_t *, void *);
    std::vector<std::max_align_t> storage;
    size_t size = 0;
    for (const bool first : {true, false}) {
        Gpu gpu(options);
        if (!gpu.has("VK_EXT_shader_object"))
            GTEST_SKIP() << "no VK_EXT_shader_object";
        const auto create = reinterpret_cast<CreateShaders>(vkGetDeviceProcAddr(gpu.device(), "vkCreateShadersEXT"));
        const auto destroy = reinterpret_cast<DestroyShader>(vkGetDeviceProcAddr(gpu.device(), "vkDestroyShaderEXT"));
        const auto bind = reinterpret_cast<BindShaders>(vkGetDeviceProcAddr(gpu.device(), "vkCmdBindShadersEXT"));
        const auto binaryOf =
            reinterpret_cast<GetBinary>(vkGetDeviceProcAddr(gpu.device(), "vkGetShaderBinaryDataEXT"));
        StateScene scene(gpu);
        Tracer tracer(gpu);
        TracerShader description(gpu, tracer);
        ShaderHandle shader = 0;
        if (!first) {
            description.info.codeType = 0; // VK_SHADER_CODE_TYPE_BINARY_EXT
            description.info.codeSize = size;
            description.info.pCode = storage.data();
        }
        ASSERT_EQ(create(gpu.device(), 1, &description.info, nullptr, &shader), VK_SUCCESS);
        if (first) {
            VT_CHECK(binaryOf(gpu.device(), shader, &size, nullptr));
            storage.resize(size / sizeof(std::max_align_t) + 1);
            VT_CHECK(binaryOf(gpu.device(), shader, &size, storage.data()));
        }
        tracer.prepare(scene.tlas(), scene.rays());
        gpu.submit([&](VkCommandBuffer commands) {
            scene.record(commands);
            tracer.bind(commands);
            const VkShaderStageFlagBits stage = VK_SHADER_STAGE_COMPUTE_BIT;
            bind(commands, 1, &stage, &shader);
            tracer.dispatch(commands);
            barrier(commands);
        });
        StateScene::expectRight(tracer.results());
        destroy(gpu.device(), shader, nullptr);
    }
}

} // namespace
