// SPDX-License-Identifier: Apache-2.0
// Objects destroyed in an invalid or barely valid order, as programs do at their end. Drivers tolerate it, and so does
// the layer: it does not crash, and objects made afterwards work.
#include <array>
#include <cstring>
#include <functional>
#include <memory>
#include <utility>

#include <gtest/gtest.h>

#include "gpu/pipeline_tracer.h"
#include "gpu/scene.h"
#include "gpu/tracer.h"
#include "harness/harness.h"
#include "harness/program/labels.h"

using namespace vt;

namespace
{

const vt::Labels kDestructionLabels{{"Destruction.*", "forcing"}};

// Memory, buffer and structure, each to be destroyed when the test says so.
class Pieces
{
public:
    explicit Pieces(Gpu &gpu) : gpu_(gpu) {}
    Pieces(const Pieces &) = delete;
    Pieces &operator=(const Pieces &) = delete;
    ~Pieces()
    {
        destroyStructure();
        destroyBuffer();
        freeMemory();
    }

    void allocate(VkDeviceSize bytes, VkBufferUsageFlags usage)
    {
        auto info =
            vkInit<VkBufferCreateInfo>({.size = bytes, .usage = usage | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT});
        VT_CHECK(vkCreateBuffer(gpu_.device(), &info, nullptr, &buffer_));
        memory_ = gpu_.bindMemory(buffer_, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT);
        static_cast<void>(gpu_.address(buffer_)); // the layer records it
    }
    void makeStructure(VkAccelerationStructureTypeKHR type, VkDeviceSize bytes)
    {
        auto info = vkInit<VkAccelerationStructureCreateInfoKHR>({.buffer = buffer_, .size = bytes, .type = type});
        VT_CHECK(gpu_.vk().CreateAccelerationStructureKHR(gpu_.device(), &info, nullptr, &structure_));
    }

    void makeMicromap(VkDeviceSize bytes)
    {
        auto info = vkInit<VkMicromapCreateInfoEXT>(
            {.buffer = buffer_, .size = bytes, .type = VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT});
        VT_CHECK(gpu_.vk().CreateMicromapEXT(gpu_.device(), &info, nullptr, &micromap_));
    }

    void freeMemory() { vkFreeMemory(gpu_.device(), std::exchange(memory_, VK_NULL_HANDLE), nullptr); }
    void destroyBuffer() { vkDestroyBuffer(gpu_.device(), std::exchange(buffer_, VK_NULL_HANDLE), nullptr); }
    void destroyStructure()
    {
        gpu_.vk().DestroyAccelerationStructureKHR(gpu_.device(), std::exchange(structure_, VK_NULL_HANDLE), nullptr);
        if (micromap_ != VK_NULL_HANDLE)
            gpu_.vk().DestroyMicromapEXT(gpu_.device(), std::exchange(micromap_, VK_NULL_HANDLE), nullptr);
    }
    // Destroys the parts in one of the six orders.
    void destroy(uint32_t order)
    {
        const std::array<std::function<void()>, 3> parts{[this] { destroyStructure(); }, [this] { destroyBuffer(); },
                                                         [this] { freeMemory(); }};
        constexpr std::array<std::array<size_t, 3>, 6> kOrders{
            {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}}};
        for (const size_t part : kOrders[order])
            parts[part]();
    }

    [[nodiscard]] VkAccelerationStructureKHR structure() const { return structure_; }
    [[nodiscard]] VkMicromapEXT micromap() const { return micromap_; }

private:
    Gpu &gpu_;
    VkDeviceMemory memory_ = VK_NULL_HANDLE;
    VkBuffer buffer_ = VK_NULL_HANDLE;
    VkAccelerationStructureKHR structure_ = VK_NULL_HANDLE;
    VkMicromapEXT micromap_ = VK_NULL_HANDLE;
};

class Destruction : public GpuTest
{
protected:
    // Validation and spy rightly report the order.
    Destruction() : GpuTest({.validation = false, .spy = false, .memory = Memory::Apart}) {}

    std::unique_ptr<Micromap> makeMicromap(uint8_t state)
    {
        MicromapInput input;
        input.add(3, kFourState, std::vector<uint8_t>(64, state));
        auto micromap = std::make_unique<Micromap>(gpu(), std::move(input));
        micromap->build();
        return micromap;
    }
    static Geometry mapped(const Micromap &micromap)
    {
        Geometry geometry{.vertices = triangleRow(1)};
        geometry.micromap = Attachment{&micromap};
        return geometry;
    }
    void expectCandidates(const Structure &tlas, uint32_t count)
    {
        Ray ray;
        ray.origin = {0.3f, 0.3f, 1};
        EXPECT_EQ(Tracer(gpu()).trace(tlas, std::span(&ray, 1))[0].candidateCount, count);
    }
    // A new scene, which may get handles, addresses and table entries of what is gone.
    void expectRightFromNowOn()
    {
        for (const uint8_t state : {uint8_t{0}, uint8_t{3}}) {
            const auto micromap = makeMicromap(state);
            const Blas blas(gpu(), {mapped(*micromap)});
            expectCandidates(Tlas(gpu(), {instance(blas, {}, 5)}), state == 0 ? 0 : 1);
        }
    }
    // A copy of `source` in pieces.
    std::unique_ptr<Pieces> copyOf(const Structure &source, VkAccelerationStructureTypeKHR type)
    {
        auto pieces = std::make_unique<Pieces>(gpu());
        pieces->allocate(source.size(), VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR);
        pieces->makeStructure(type, source.size());
        gpu().submit([&](VkCommandBuffer commands) {
            auto info =
                vkInit<VkCopyAccelerationStructureInfoKHR>({.src = source.handle(),
                                                            .dst = pieces->structure(),
                                                            .mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR});
            gpu().vk().CmdCopyAccelerationStructureKHR(commands, &info);
        });
        return pieces;
    }
};

TEST_F(Destruction, StructuresBuffersAndMemoryInAnyOrder)
{
    const auto micromap = makeMicromap(0);
    for (uint32_t order = 0; order < 6; ++order) {
        SCOPED_TRACE(order);
        const Blas blas(gpu(), {mapped(*micromap)});
        const Tlas tlas(gpu(), {instance(blas, {}, 5)});
        const auto bottom = copyOf(blas, VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR);
        const auto top = copyOf(tlas, VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR);
        bottom->destroy(order);
        top->destroy(5 - order);
        expectCandidates(tlas, 0);
        expectRightFromNowOn();
    }
}

TEST_F(Destruction, MicromapsBuffersAndMemoryInAnyOrder)
{
    if (gpu().khr())
        GTEST_SKIP() << "VkMicromapEXT only";
    const auto micromap = makeMicromap(0);
    for (uint32_t order = 0; order < 6; ++order) {
        SCOPED_TRACE(order);
        Pieces pieces(gpu());
        pieces.allocate(micromap->size(), VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT);
        pieces.makeMicromap(micromap->size());
        gpu().submit([&](VkCommandBuffer commands) {
            auto info = vkInit<VkCopyMicromapInfoEXT>(
                {.src = micromap->handle().ext, .dst = pieces.micromap(), .mode = VK_COPY_MICROMAP_MODE_CLONE_EXT});
            gpu().vk().CmdCopyMicromapEXT(commands, &info);
        });
        pieces.destroy(order);
        expectRightFromNowOn();
    }
}

// The bottom level before the top level that names it, and the micromap before both. Nothing is traced any more.
TEST_F(Destruction, ReferencedObjectsFirst)
{
    for (int round = 0; round < 3; ++round) {
        auto micromap = makeMicromap(0);
        auto blas = std::make_unique<Blas>(gpu(), std::vector{mapped(*micromap)});
        auto tlas = std::make_unique<Tlas>(gpu(), std::vector{instance(*blas, {}, 5)});
        expectCandidates(*tlas, 0);
        micromap.reset();
        expectRightFromNowOn();
        blas.reset();
        expectRightFromNowOn();
        tlas.reset();
        expectRightFromNowOn();
    }
}

// Input, scratch memory and command pools go as soon as the GPU is done, which the specification allows.
TEST_F(Destruction, InputsOfBuilds)
{
    const auto micromap = makeMicromap(0);
    micromap->forgetInput();
    Blas blas(gpu(), {mapped(*micromap)});
    blas.forgetInput();
    Tlas tlas(gpu(), {instance(blas, {}, 5)});
    tlas.forgetInput();
    expectRightFromNowOn();
    expectCandidates(tlas, 0);
}

// Everything that a pipeline was made of is destroyed before the pipeline is used. The tracers of the other tests
// destroy only modules before.
TEST_F(Destruction, LibrariesBeforeThePipeline)
{
    if (!gpu().has(VK_KHR_PIPELINE_LIBRARY_EXTENSION_NAME) || !gpu().has(VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME))
        GTEST_SKIP() << "no pipeline libraries";
    const auto micromap = makeMicromap(0);
    const Blas blas(gpu(), {mapped(*micromap)});
    const Tlas tlas(gpu(), {instance(blas, {}, 5)});
    PipelineTracerSetup setup;
    setup.make = [](Device &gpu, const PipelineSetup &from) {
        PipelineSetup library = from;
        library.flags |= VK_PIPELINE_CREATE_LIBRARY_BIT_KHR;
        const RayPipeline all(gpu, library);
        PipelineSetup linking = from;
        linking.stages.clear();
        linking.groups.clear();
        linking.libraries = {all.handle()};
        return MadePipeline{RayPipeline(gpu, linking), {}};
    };
    Ray ray;
    ray.origin = {0.3f, 0.3f, 1};
    ray.rule = kAlways;
    PipelineTracer tracer(gpu(), setup);
    const PipelineResult result = tracer.trace(tlas, std::span(&ray, 1))[0];
    EXPECT_EQ(result.candidateCount, 0u);
    EXPECT_EQ(result.committed, kNone);
}

} // namespace
