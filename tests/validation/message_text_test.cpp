// SPDX-License-Identifier: Apache-2.0
// What the messages of validation name and state, beyond their ids.
#include <cstdio>

#include "gpu/tracer.h"
#include "recorded.h"

namespace
{

using namespace vt;

class MessageText : public GpuTest
{
protected:
    MessageText() : GpuTest({.validation = false, .validate = true}) {}
    void name(VkObjectType type, uint64_t object, const char *text)
    {
        const auto set = reinterpret_cast<PFN_vkSetDebugUtilsObjectNameEXT>(
            vkGetInstanceProcAddr(gpu().instance(), "vkSetDebugUtilsObjectNameEXT"));
        const auto info =
            vkInit<VkDebugUtilsObjectNameInfoEXT>({.objectType = type, .objectHandle = object, .pObjectName = text});
        VT_CHECK(set(gpu().device(), &info));
    }
    void name(const Structure &structure, const char *text)
    {
        name(VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR, reinterpret_cast<uint64_t>(structure.handle()), text);
    }
    // The texts of the messages with the id.
    std::vector<std::string> textsOf(const std::string &id)
    {
        VT_CHECK(vkDeviceWaitIdle(gpu().device()));
        std::vector<std::string> texts;
        for (const Message &m : gpu().takeMessages())
            if (m.id == id)
                texts.push_back(m.text);
        return texts;
    }
    // Expects one message with the id, which has all the parts in this order.
    void expectOne(const std::string &id, const std::vector<std::string> &parts)
    {
        const std::vector<std::string> texts = textsOf(id);
        ASSERT_EQ(texts.size(), 1u) << id;
        size_t at = 0;
        for (const std::string &part : parts) {
            at = texts[0].find(part, at);
            ASSERT_NE(at, std::string::npos) << part << " in: " << texts[0];
        }
    }
    static Geometry oneTriangleGeometry()
    {
        Geometry geometry;
        appendTriangle(geometry.vertices, {});
        return geometry;
    }
};

TEST_F(MessageText, UnorderedLevels)
{
    Blas leaf(gpu()), twig(gpu());
    Tlas tlas(gpu());
    leaf.prepare({oneTriangleGeometry()});
    twig.prepare({oneTriangleGeometry()});
    tlas.prepare(std::array{instance(leaf, {}, 0, 0, 0), instance(leaf, {}, 1), instance(twig, {}, 2)});
    name(leaf, "leaf");
    name(tlas, "forest");
    gpu().submit([&](VkCommandBuffer commands) {
        leaf.record(commands);
        twig.record(commands);
        tlas.record(commands);
    });
    const std::string command = "vkCmdBuildAccelerationStructuresKHR: pInfos[0]";
    expectOne("VELLUM-sync-read-after-write",
              {command + " builds \"forest\" (0x", ") and reads acceleration structure \"leaf\" (0x",
               "), of instance 1, that " + command + " wrote in the same batch; no barrier makes the write (stage ",
               "stage ACCELERATION_STRUCTURE_BUILD, access ACCELERATION_STRUCTURE_READ",
               "; the same is true of the structure of another instance"});
}

TEST_F(MessageText, NameOfADestroyedStructure)
{
    const Storage storage(gpu());
    std::optional<Blas> blas;
    blas.emplace(gpu());
    blas->placeIn(storage.buffer(), 0);
    blas->build({oneTriangleGeometry()});
    name(*blas, "oak leaf");
    const Tlas tlas(gpu(), {instance(*blas, {}, 0)});
    blas.reset();
    Tracer(gpu()).trace(tlas, std::array{Ray{.origin = {0.3f, 0.3f, 1}}});
    expectOne("VELLUM-trace-invalid-structure", {"structure \"oak leaf\" (0x", ", of instance 0, was destroyed"});
}

TEST_F(MessageText, NameOfADestroyedMicromap)
{
    if (!gpu().khr())
        GTEST_SKIP() << "VK_KHR_opacity_micromap";
    const Twins twins(gpu());
    SharedMemory memory(gpu());
    const MicromapHandle micromap = memory.create(0, twins.source.size());
    name(micromap.objectType(), micromap.object(), "oak leaf micromap");
    gpu().submit([&](VkCommandBuffer commands) {
        recordMicromapBuilds(gpu(), commands, std::array{MicromapBuild{twins.source.buildInfo(), micromap}});
    });
    Geometry geometry = oneTriangleGeometry();
    geometry.micromap = Attachment{.micromap = &twins.source, .indexType = VK_INDEX_TYPE_UINT32, .indices = {0}};
    Blas blas(gpu());
    blas.prepare({geometry});
    Build build(gpu(), blas);
    auto given = *static_cast<const KhrAttached *>(build.geometry.geometry.triangles.pNext);
    build.geometry.geometry.triangles.pNext = &given;
    given.micromap = micromap.khr;
    gpu().submit([&](VkCommandBuffer commands) { build.record(commands); });
    const Tlas tlas(gpu(), {instance(blas, {}, 0)});
    memory.destroy(micromap);
    Tracer(gpu()).trace(tlas, std::array{Ray{.origin = {0.3f, 0.3f, 1}}});
    expectOne("VELLUM-trace-invalid-structure",
              {"micromap \"oak leaf micromap\" (0x", ", of instance 0, was destroyed"});
}

// The name ends with the handle: another object that gets it has none.
TEST_F(MessageText, NameEndsWithTheHandle)
{
    SharedMemory memory(gpu());
    const MicromapHandle first = memory.create(0, 1024);
    name(first.objectType(), first.object(), "first");
    memory.destroy(first);
    for (int i = 0; i < 64; ++i) {
        const MicromapHandle next = memory.create(0, 1024);
        if (next.object() != first.object())
            continue;
        memory.destroy(next); // twice
        destroyMicromap(gpu(), next);
        for (const Message &m : gpu().takeMessages())
            EXPECT_EQ(m.text.find("first"), std::string::npos) << m.text;
        return;
    }
    GTEST_SKIP() << "handles are not used again";
}

TEST_F(MessageText, MisalignedInputOfAMicromap)
{
    const Micromap micromap(gpu(), oneTriangle());
    VkMicromapBuildInfoEXT info = micromap.buildInfo();
    info.triangleArray.deviceAddress += 4;
    recordUnlessWrong(gpu(), true, [&](VkCommandBuffer commands) {
        recordMicromapBuilds(gpu(), commands, std::array{MicromapBuild{info, micromap.handle()}});
    });
    char address[32];
    std::snprintf(address, sizeof address, "%llx", static_cast<unsigned long long>(info.triangleArray.deviceAddress));
    expectOne(gpu().khr() ? "VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11552"
                          : "VELLUM-VUID-vkCmdBuildMicromapsEXT-pInfos-07515",
              {"triangleArray, at 0x" + std::string(address) + ": not a multiple of "});
}

TEST_F(MessageText, MicromapWithoutTriangles)
{
    if (!gpu().khr())
        GTEST_SKIP() << "VK_KHR_opacity_micromap";
    MicromapInput input = oneTriangle();
    input.declared = {{0, 2, kFourState}};
    Micromap micromap(gpu(), std::move(input));
    micromap.build();
    gpu().takeMessages();
    Geometry geometry = oneTriangleGeometry();
    geometry.micromap = Attachment{.micromap = &micromap, .indexType = VK_INDEX_TYPE_UINT32, .indices = {0}};
    const Blas blas(gpu(), {geometry});
    expectOne("VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-indexBuffer-11575",
              {"is outside the 0 triangles of micromap ", ", which was built with usage counts that sum to 0"});
}

// Valid, and most often a mistake.
TEST_F(MessageText, IndexStrideOfZero)
{
    Micromap micromap(gpu(), oneTriangle());
    micromap.build();
    const auto build = [&](uint32_t triangles, std::optional<uint32_t> stride) {
        Geometry geometry{.vertices = triangleRow(triangles)};
        geometry.micromap = Attachment{.micromap = &micromap,
                                       .indexType = VK_INDEX_TYPE_UINT16,
                                       .indices = std::vector<int32_t>(triangles, 0),
                                       .stride = stride};
        const Blas blas(gpu(), {geometry});
    };
    build(3, {});
    build(1, 0);
    EXPECT_TRUE(textsOf("VELLUM-attachment-index-stride").empty());
    build(3, 0);
    expectOne(
        "VELLUM-attachment-index-stride",
        {"pInfos[0].pGeometries[0].geometry.triangles.indexStride: it is 0, so that all 3 triangles have the first "
         "index"});
}

} // namespace
