// SPDX-License-Identifier: Apache-2.0
// VK_EXT_descriptor_buffer: shaders reach a top-level structure by an address in a descriptor, and bindings survive
// work that the layer adds between binding and use.
#include "command_buffer/compute_pipeline.h"
#include "command_buffer/state_scene.h"
#include "pipelines/pipeline_scene.h"

#include "harness/program/labels.h"
#include "shaders/tracer_comp.h"

namespace
{

const vt::Labels kDescriptorBufferLabels{{"DescriptorBuffers.*", "quirks packed forcing"},
                                         {"DescriptorBuffersWithoutLayer.*", "one_api"}};

using namespace vt;

constexpr VkFlags64 kDescriptorBufferBit = VK_PIPELINE_CREATE_DESCRIPTOR_BUFFER_BIT_EXT;

struct DescriptorCommands {
    explicit DescriptorCommands(const Gpu &gpu)
    {
        const auto load = [&gpu](auto &function, const char *name) {
            function =
                reinterpret_cast<std::remove_reference_t<decltype(function)>>(vkGetDeviceProcAddr(gpu.device(), name));
        };
        load(layoutSize, "vkGetDescriptorSetLayoutSizeEXT");
        load(bindingOffset, "vkGetDescriptorSetLayoutBindingOffsetEXT");
        load(descriptor, "vkGetDescriptorEXT");
        load(bindBuffers, "vkCmdBindDescriptorBuffersEXT");
        load(setOffsets, "vkCmdSetDescriptorBufferOffsetsEXT");
    }
    PFN_vkGetDescriptorSetLayoutSizeEXT layoutSize;
    PFN_vkGetDescriptorSetLayoutBindingOffsetEXT bindingOffset;
    PFN_vkGetDescriptorEXT descriptor;
    PFN_vkCmdBindDescriptorBuffersEXT bindBuffers;
    PFN_vkCmdSetDescriptorBufferOffsetsEXT setOffsets;
};

// A set of descriptors in a buffer: binding 0 an acceleration structure, bindings 1.. storage buffers.
class DescriptorTable
{
public:
    DescriptorTable(Gpu &gpu, uint32_t buffers, const VkPushConstantRange &push) : gpu_(gpu), commands_(gpu)
    {
        std::vector<VkDescriptorSetLayoutBinding> bindings;
        for (uint32_t i = 0; i <= buffers; ++i)
            bindings.push_back(
                {i, i == 0 ? VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR : VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1,
                 VK_SHADER_STAGE_ALL, nullptr});
        auto set =
            vkInit<VkDescriptorSetLayoutCreateInfo>({.flags = VK_DESCRIPTOR_SET_LAYOUT_CREATE_DESCRIPTOR_BUFFER_BIT_EXT,
                                                     .bindingCount = static_cast<uint32_t>(bindings.size()),
                                                     .pBindings = bindings.data()});
        VT_CHECK(vkCreateDescriptorSetLayout(gpu.device(), &set, nullptr, &setLayout_));
        auto layout = vkInit<VkPipelineLayoutCreateInfo>({.setLayoutCount = 1,
                                                          .pSetLayouts = &setLayout_,
                                                          .pushConstantRangeCount = 1,
                                                          .pPushConstantRanges = &push});
        VT_CHECK(vkCreatePipelineLayout(gpu.device(), &layout, nullptr, &layout_));
        properties_ = vkInit<VkPhysicalDeviceDescriptorBufferPropertiesEXT>();
        auto properties = vkInit<VkPhysicalDeviceProperties2>({.pNext = &properties_});
        vkGetPhysicalDeviceProperties2(gpu.physical(), &properties);
        VkDeviceSize size = 0;
        commands_.layoutSize(gpu.device(), setLayout_, &size);
        buffer_ = Buffer(gpu, size, usage());
    }
    DescriptorTable(const DescriptorTable &) = delete;
    DescriptorTable &operator=(const DescriptorTable &) = delete;
    ~DescriptorTable()
    {
        vkDestroyPipelineLayout(gpu_.device(), layout_, nullptr);
        vkDestroyDescriptorSetLayout(gpu_.device(), setLayout_, nullptr);
    }

    void write(VkDeviceAddress scene, std::span<const Buffer *const> buffers)
    {
        auto info = vkInit<VkDescriptorGetInfoEXT>({.type = VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR});
        info.data.accelerationStructure = scene;
        put(0, info, properties_.accelerationStructureDescriptorSize);
        for (size_t i = 0; i < buffers.size(); ++i) {
            auto range =
                vkInit<VkDescriptorAddressInfoEXT>({.address = buffers[i]->address(), .range = buffers[i]->size()});
            info.type = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
            info.data.pStorageBuffer = &range;
            put(static_cast<uint32_t>(i + 1), info, properties_.storageBufferDescriptorSize);
        }
    }

    // `flags2`: the usage comes in VkBufferUsageFlags2CreateInfo.
    void bind(VkCommandBuffer commands, VkPipelineBindPoint point, bool flags2 = false) const
    {
        auto own = vkInit<VkBufferUsageFlags2CreateInfoKHR>({.usage = usage()});
        auto binding = vkInit<VkDescriptorBufferBindingInfoEXT>(
            {.pNext = flags2 ? &own : nullptr, .address = buffer_.address(), .usage = flags2 ? 0 : usage()});
        commands_.bindBuffers(commands, 1, &binding);
        const uint32_t index = 0;
        const VkDeviceSize offset = 0;
        commands_.setOffsets(commands, point, layout_, 0, 1, &index, &offset);
    }
    [[nodiscard]] VkPipelineLayout layout() const { return layout_; }

private:
    // Includes a usage flag that the layer removes.
    [[nodiscard]] VkBufferUsageFlags usage() const
    {
        return VK_BUFFER_USAGE_RESOURCE_DESCRIPTOR_BUFFER_BIT_EXT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT |
               (gpu_.options().vellum ? VK_BUFFER_USAGE_MICROMAP_BUILD_INPUT_READ_ONLY_BIT_EXT : 0);
    }

    void put(uint32_t binding, const VkDescriptorGetInfoEXT &info, size_t size)
    {
        VkDeviceSize offset = 0;
        commands_.bindingOffset(gpu_.device(), setLayout_, binding, &offset);
        commands_.descriptor(gpu_.device(), &info, size, buffer_.bytes() + offset);
    }

    Gpu &gpu_;
    DescriptorCommands commands_;
    VkPhysicalDeviceDescriptorBufferPropertiesEXT properties_{};
    VkDescriptorSetLayout setLayout_ = VK_NULL_HANDLE;
    VkPipelineLayout layout_ = VK_NULL_HANDLE;
    Buffer buffer_;
};

class DescriptorBuffers : public PipelineSceneTest
{
protected:
    explicit DescriptorBuffers(bool vellum = true)
        : PipelineSceneTest({.vellum = vellum, .oldValidation = false, .micromaps = vellum, .newer = true})
    {
    }
    void SetUp() override
    {
        PipelineSceneTest::SetUp();
        if (!IsSkipped() && !gpu().has(VK_EXT_DESCRIPTOR_BUFFER_EXTENSION_NAME))
            GTEST_SKIP() << "no VK_EXT_descriptor_buffer";
    }
    bool lavapipeBefore26()
    {
        auto driver = vkInit<VkPhysicalDeviceDriverProperties>();
        auto properties = vkInit<VkPhysicalDeviceProperties2>({.pNext = &driver});
        vkGetPhysicalDeviceProperties2(gpu().physical(), &properties);
        return driver.driverID == VK_DRIVER_ID_MESA_LLVMPIPE && !gpu().onLavapipe26();
    }

    // Traces by a ray query; micromap, BLAS and TLAS are built after everything was bound.
    void expectQuery()
    {
        constexpr VkBufferUsageFlags kUsage =
            VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;
        constexpr uint32_t kCapacity = 4;
        StateScene scene(gpu());
        const std::vector<Ray> rays = StateScene::rays();
        DescriptorTable table(gpu(), 3, {VK_SHADER_STAGE_COMPUTE_BIT, 0, 16});
        const ComputePipeline pipeline(gpu(), table.layout(), tracer_comp, kDescriptorBufferBit);
        const Buffer origin = gpu().upload(std::span<const Ray>(rays), VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
        const Buffer seen(gpu(), rays.size() * sizeof(RawResult), kUsage);
        const Buffer candidates(gpu(), rays.size() * kCapacity * sizeof(Candidate), kUsage);
        table.write(scene.tlas().address(), std::array<const Buffer *, 3>{&origin, &seen, &candidates});
        const std::array<uint32_t, 4> push{static_cast<uint32_t>(rays.size()), kCapacity, 0, 0};
        gpu().submit([&](VkCommandBuffer commands) {
            table.bind(commands, VK_PIPELINE_BIND_POINT_COMPUTE);
            vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline.handle());
            vkCmdPushConstants(commands, table.layout(), VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof push, push.data());
            scene.record(commands);
            vkCmdDispatch(commands, 1, 1, 1);
            barrier(commands);
        });
        std::vector<Result> results;
        for (const RawResult &result : seen.as<RawResult>())
            results.push_back({result, {}});
        StateScene::expectRight(results);
    }

    // For the null record, the layer copies the hit records by a dispatch of its own when the trace is recorded.
    // `between`: called after everything is bound.
    void expectPipeline(const std::function<void(VkCommandBuffer)> &between, bool flags2 = false)
    {
        DescriptorTable table(gpu(), 6, {PipelineResources::kStages, 0, PipelineTracer::kPushSize});
        const PipelineTracerSetup setup{.records = {0, 1, std::nullopt},
                                        .make = [&](Device &g, const PipelineSetup &from) {
                                            PipelineSetup own = from;
                                            own.layout = table.layout();
                                            own.flags |= static_cast<VkPipelineCreateFlags>(kDescriptorBufferBit);
                                            return MadePipeline{RayPipeline(g, own), {}};
                                        }};
        PipelineTracer tracer(gpu(), setup);
        for (const uint32_t flags : opacityRayFlags(gpu().options().micromaps)) {
            tracer.prepare(scene_->tlas(), scene_->rays(flags), 4);
            table.write(scene_->tlas().address(), tracer.buffers());
            gpu().submit([&](VkCommandBuffer commands) {
                tracer.bind(commands); // for what it pushes; its set is replaced
                table.bind(commands, VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR, flags2);
                between(commands);
                tracer.dispatch(commands);
                barrier(commands);
            });
            scene_->expect(tracer.results(), flags);
        }
    }
};

TEST_F(DescriptorBuffers, Query)
{
    if (lavapipeBefore26())
        GTEST_SKIP() << "lavapipe before Mesa 26 crashes in dispatches with descriptor buffers, without the layer, too";
    expectQuery();
}

TEST_F(DescriptorBuffers, RayTracingPipeline)
{
    expectPipeline([](VkCommandBuffer) {});
}

TEST_F(DescriptorBuffers, StayBoundOverBuilds)
{
    StateScene other(gpu());
    expectPipeline([&](VkCommandBuffer commands) { other.record(commands); });
    other.expectRight();
}

TEST_F(DescriptorBuffers, UsageOf64Bits)
{
    if (!gpu().has("VK_KHR_maintenance5"))
        GTEST_SKIP() << "no VK_KHR_maintenance5";
    expectPipeline([](VkCommandBuffer) {}, true);
}

class DescriptorBuffersWithoutLayer : public DescriptorBuffers
{
protected:
    DescriptorBuffersWithoutLayer() : DescriptorBuffers(false) {}
};

TEST_F(DescriptorBuffersWithoutLayer, RayTracingPipeline)
{
    expectPipeline([](VkCommandBuffer) {});
}

} // namespace
