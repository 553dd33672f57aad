// SPDX-License-Identifier: Apache-2.0
// The quirks "ext" and "emulating" of the mock driver: drivers with micromaps of their own, below Vellum's layer.
#include <algorithm>
#include <cstring>

#include "gpu/copies.h"
#include "gpu/execution_mode.h"
#include "harness/harness.h"
#include "harness/mock_driver.h"
#include "shaders/tracer_comp.h"

namespace
{

using namespace vt;

// Options without the Vellum layer above the driver.
Options alone(const char *quirks)
{
    return {.vellum = false, .validation = false, .quirks = quirks, .api = Api::Ext, .memory = Memory::Apart};
}

bool provides(const Gpu &gpu, const char *name)
{
    uint32_t count = 0;
    VT_CHECK(vkEnumerateDeviceExtensionProperties(gpu.physical(), nullptr, &count, nullptr));
    std::vector<VkExtensionProperties> all(count);
    VT_CHECK(vkEnumerateDeviceExtensionProperties(gpu.physical(), nullptr, &count, all.data()));
    return std::any_of(all.begin(), all.end(),
                       [name](const VkExtensionProperties &e) { return std::strcmp(e.extensionName, name) == 0; });
}

TEST(ExtDriver, HasMicromapsOfItsOwn)
{
    Gpu own(alone("ext")), emulated(Options{.api = Api::Ext});
    EXPECT_TRUE(provides(own, VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME));
    for (const char *name : {VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME, VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME,
                             "VK_ARM_pipeline_opacity_micromap"})
        EXPECT_FALSE(provides(own, name)) << name;
    const auto builds = testDriverFunction<uint64_t (*)()>("vellumExtBuilds");
    const uint64_t before = builds();
    const Patchwork ownPatchwork(own), emulatedPatchwork(emulated);
    EXPECT_GT(builds(), before);
    const auto expected = seenOf(emulated, Blas(emulated, emulatedPatchwork.geometries()));
    EXPECT_EQ(seenOf(own, Blas(own, ownPatchwork.geometries())), expected);
    std::vector<Geometry> plain = ownPatchwork.geometries();
    for (Geometry &geometry : plain)
        geometry.micromap.reset();
    EXPECT_NE(seenOf(own, Blas(own, plain)), expected);
    for (const Message &m : own.takeUnexpectedMessages())
        ADD_FAILURE() << m.id << ": " << m.text;
}

// The driver reports everything that VK_EXT_opacity_micromap does not have.
TEST(ExtDriver, ReportsTheOtherExtensions)
{
    Gpu gpu(alone("ext"));
    const auto expectReported = [&gpu](const std::string &part) {
        const auto messages = gpu.takeMessages();
        EXPECT_TRUE(std::any_of(messages.begin(), messages.end(), [&part](const Message &m) {
            return m.id == "SPY" && m.text.find(part) != std::string::npos;
        })) << part;
    };
    auto build = vkInit<VkAccelerationStructureBuildGeometryInfoKHR>(
        {.flags = VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR});
    auto sizes = vkInit<VkAccelerationStructureBuildSizesInfoKHR>();
    gpu.vk().GetAccelerationStructureBuildSizesKHR(gpu.device(), VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR,
                                                   &build, nullptr, &sizes);
    expectReported("LOSSY");

    auto attachment = vkInit<VkAccelerationStructureTrianglesOpacityMicromapKHR>();
    auto geometry = vkInit<VkAccelerationStructureGeometryKHR>({.geometryType = VK_GEOMETRY_TYPE_TRIANGLES_KHR});
    geometry.geometry.triangles =
        vkInit<VkAccelerationStructureGeometryTrianglesDataKHR>({.pNext = &attachment,
                                                                 .vertexFormat = VK_FORMAT_R32G32B32_SFLOAT,
                                                                 .vertexStride = sizeof(Vec3),
                                                                 .indexType = VK_INDEX_TYPE_NONE_KHR});
    build.flags = 0;
    build.type = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR;
    build.geometryCount = 1;
    build.pGeometries = &geometry;
    const uint32_t one = 1;
    gpu.vk().GetAccelerationStructureBuildSizesKHR(gpu.device(), VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR,
                                                   &build, &one, &sizes);
    expectReported("VkAccelerationStructureTrianglesOpacityMicromapKHR");

    auto ranges = vkInit<VkMemoryRangeBarriersInfoKHR>();
    auto dependency = vkInit<VkDependencyInfo>({.pNext = &ranges});
    gpu.submit([&](VkCommandBuffer commands) { vkCmdPipelineBarrier2(commands, &dependency); });
    expectReported("VkMemoryRangeBarriersInfoKHR");

    const std::vector<uint32_t> words = withModeWhereNeeded(tracer_comp);
    auto module =
        vkInit<VkShaderModuleCreateInfo>({.codeSize = words.size() * sizeof(uint32_t), .pCode = words.data()});
    VkShaderModule made = VK_NULL_HANDLE;
    VT_CHECK(vkCreateShaderModule(gpu.device(), &module, nullptr, &made));
    vkDestroyShaderModule(gpu.device(), made, nullptr);
    expectReported("OpacityMicromapIdKHR");
}

// Says that it has none, and rewrites what it gets nevertheless: shaders have what Vellum's layer put into them, and
// more.
TEST(EmulatingDriver, ReportsNothing)
{
    Gpu gpu(Options{.quirks = "emulating"});
    Gpu below(Options{.vellum = false, .validation = false, .quirks = "emulating", .micromaps = false});
    EXPECT_FALSE(provides(below, VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME));
    EXPECT_NE(vkGetDeviceProcAddr(below.device(), "vkCreateMicromapEXT"), nullptr);
    EXPECT_TRUE(provides(gpu, VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME));
    Gpu usual{Options{}};
    const Patchwork stacked(gpu), patchwork(usual);
    EXPECT_EQ(seenOf(gpu, Blas(gpu, stacked.geometries())), seenOf(usual, Blas(usual, patchwork.geometries())));
}

} // namespace
