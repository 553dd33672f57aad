// SPDX-License-Identifier: Apache-2.0
// Whichever of the layer's allocations fails, the process goes on, no driver object leaks, and the same call succeeds
// once there is memory again.
#include <algorithm>

#include "allocations/failing_allocations.h"
#include "command_buffer/compute_pipeline.h"
#include "command_buffer/shader_objects.h"
#include "command_buffer/state_scene.h"
#include "entry/micromap_device.h"
#include "gpu/copies.h"
#include "gpu/pipeline_tracer.h"
#include "harness/harness.h"
#include "harness/mock_driver.h"
#include "harness/program/labels.h"
#include "pipelines/pipeline_binaries.h"
#include "shaders/tracer_comp.h"

namespace
{

const vt::Labels kAllocationFailureLabels{{"Fail/DeferredAllocations.*", "one_api"},
                                          {"Fail/ShaderObjectAllocations.*", "one_api"},
                                          {"Fail/ValidatedAllocations.*", "one_api"},
                                          {"Fail/BinaryAllocations.*", "one_api"},
                                          {"Fail/TranslatedAllocations.*", "one_api"}};

using namespace vt;

// Objects of the driver that exist.
long alive()
{
    return testDriverFunction<long (*)()>("vellumDriverObjects")();
}

class Allocations : public testing::TestWithParam<Failing>
{
protected:
    explicit Allocations(Options options = {})
    {
        // The quirk counts objects that are left behind. A validation layer would do the same, but slower.
        options.validation = false;
        options.quirks += options.quirks.empty() ? "failures" : ",failures";
        gpu_ = std::make_unique<Gpu>(options);
    }
    void TearDown() override
    {
        failAllocations(0, Failing::Once);
        static_cast<void>(gpu_->takeUnexpectedMessages());
        gpu_.reset();
    }
    [[nodiscard]] Gpu &gpu() { return *gpu_; }

    static constexpr uint64_t kLast = 80;

    using WhileItFails = std::function<void(const std::function<void()> &)>;
    // Does it with another of the layer's allocations failing each time: fewer of them the more there are, but of the
    // last ones, with which the driver has made something, each. `act` is given what lets them fail while a function
    // runs, returns whether that worked, and destroys what was made.
    void failEach(const std::function<bool(const WhileItFails &)> &act)
    {
        // First, while what is made once and kept is not there yet.
        uint64_t made = 0, most = 0;
        for (uint64_t n = 1;; n += 1 + n / 32) {
            SCOPED_TRACE(testing::Message() << "allocation " << n);
            const bool works = failAt(act, n, made);
            most = std::max(most, made);
            if (made < n) {
                EXPECT_TRUE(works);
            }
            if (HasFailure())
                return;
            if (made < n)
                break;
        }
        EXPECT_GT(most, 0u) << "the layer allocates nothing";
        // From here on, a failed call leaves nothing behind.
        const long before = alive();
        const uint64_t all = made;
        allocations_ += all;
        RecordProperty("allocations", static_cast<int>(allocations_));
        for (uint64_t n = 1; n <= all; n += n + kLast > all ? 1 : 1 + all / 100) {
            SCOPED_TRACE(testing::Message() << "again, allocation " << n << " of " << all);
            static_cast<void>(failAt(act, n, made));
            EXPECT_LE(alive(), before);
            if (HasFailure())
                return;
        }
        EXPECT_TRUE(failAt(act, 0, made)) << "there is memory again";
    }
    bool failAt(const std::function<bool(const WhileItFails &)> &act, uint64_t n, uint64_t &made)
    {
        return act([&](const std::function<void()> &call) {
            failAllocations(n, GetParam());
            call();
            made = failAllocations(0, GetParam());
        });
    }
    // An object by its command, and what destroys it.
    template <class Handle>
    void failCreation(const std::function<VkResult(Handle *)> &create, const std::function<void(Handle)> &destroy)
    {
        failEach([&](const WhileItFails &whileItFails) {
            Handle object{};
            VkResult result = VK_SUCCESS;
            whileItFails([&] { result = create(&object); });
            EXPECT_TRUE(result == VK_SUCCESS || result == VK_ERROR_OUT_OF_HOST_MEMORY) << result;
            if (result == VK_SUCCESS)
                destroy(object);
            return result == VK_SUCCESS;
        });
    }
    void failRecorded(const std::function<void(VkCommandBuffer)> &record)
    {
        failEach([&](const WhileItFails &whileItFails) {
            gpu().submit([&](VkCommandBuffer commands) { whileItFails([&] { record(commands); }); });
            return true;
        });
    }

    // With and without a deferred operation, one pipeline and two in a call.
    void failRayTracingPipelines()
    {
        const Commands &vk = gpu().vk();
        const auto make = [&](Device &, const PipelineSetup &setup) {
            for (const uint32_t count : {1u, 2u}) {
                for (const bool deferred : {false, true}) {
                    if (count > 1 && deferred) // then they are made one by one in any case
                        continue;
                    const PipelineInfo info(gpu(), setup);
                    const std::vector<VkRayTracingPipelineCreateInfoKHR> infos(count, info.get());
                    failEach([&](const WhileItFails &whileItFails) {
                        std::vector<VkPipeline> pipelines(count, VK_NULL_HANDLE);
                        VkDeferredOperationKHR operation = VK_NULL_HANDLE;
                        if (deferred)
                            VT_CHECK(vk.CreateDeferredOperationKHR(gpu().device(), nullptr, &operation));
                        VkResult result = VK_SUCCESS;
                        whileItFails([&] {
                            result = vk.CreateRayTracingPipelinesKHR(gpu().device(), operation, VK_NULL_HANDLE, count,
                                                                     infos.data(), nullptr, pipelines.data());
                            if (result != VK_OPERATION_DEFERRED_KHR)
                                return;
                            while (vk.DeferredOperationJoinKHR(gpu().device(), operation) == VK_THREAD_IDLE_KHR)
                                ;
                            result = vk.GetDeferredOperationResultKHR(gpu().device(), operation);
                        });
                        if (deferred)
                            vk.DestroyDeferredOperationKHR(gpu().device(), operation, nullptr);
                        for (const VkPipeline pipeline : pipelines)
                            vkDestroyPipeline(gpu().device(), pipeline, nullptr);
                        return result == VK_SUCCESS || result == VK_OPERATION_NOT_DEFERRED_KHR;
                    });
                }
            }
            return MadePipeline{RayPipeline(gpu(), setup), {}};
        };
        const PipelineTracer tracer(gpu(), {.groups = {{.anyHit = false}, {.box = true}}, .make = make});
    }

    std::unique_ptr<Gpu> gpu_;
    uint64_t allocations_ = 0; // of everything that was tried
};

#define INSTANTIATE(Suite)                                                                                             \
    INSTANTIATE_TEST_SUITE_P(Fail, Suite, testing::Values(Failing::Once, Failing::FromThenOn), nameOf)

std::string nameOf(const testing::TestParamInfo<Failing> &info)
{
    return info.param == Failing::Once ? "Once" : "FromThenOn";
}

TEST_P(Allocations, Device)
{
    const long before = alive();
    const MicromapDeviceInfo info(gpu().family());
    failCreation<VkDevice>(
        [&](VkDevice *device) {
            const VkResult result = vkCreateDevice(gpu().physical(), info.get(), nullptr, device);
            if (result == VK_SUCCESS) // it is found by its key
                vkDeviceWaitIdle(*device);
            return result;
        },
        [](VkDevice device) { vkDestroyDevice(device, nullptr); });
    EXPECT_EQ(alive(), before);
}

TEST_P(Allocations, Messenger)
{
    auto info =
        vkInit<VkDebugUtilsMessengerCreateInfoEXT>({.messageSeverity = VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT,
                                                    .messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT});
    info.pfnUserCallback = [](auto, auto, auto, auto) -> VkBool32 { return VK_FALSE; };
    const Commands &vk = gpu().vk();
    // The first of many, for which the layer's vector has no capacity left.
    std::vector<VkDebugUtilsMessengerEXT> others;
    failEach([&](const WhileItFails &whileItFails) {
        VkDebugUtilsMessengerEXT messenger = VK_NULL_HANDLE;
        VkResult result = VK_SUCCESS;
        uint64_t count = 0;
        whileItFails([&] {
            for (; count < 9 && result == VK_SUCCESS; ++count) {
                result = vk.CreateDebugUtilsMessengerEXT(gpu().instance(), &info, nullptr, &messenger);
                if (result == VK_SUCCESS)
                    others.push_back(messenger);
            }
        });
        for (const VkDebugUtilsMessengerEXT other : others)
            vk.DestroyDebugUtilsMessengerEXT(gpu().instance(), other, nullptr);
        others.clear();
        return result == VK_SUCCESS;
    });
}

TEST_P(Allocations, BufferWithMemory)
{
    auto info = vkInit<VkBufferCreateInfo>(
        {.size = 65536, .usage = VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT});
    failEach([&](const WhileItFails &whileItFails) {
        VkBuffer buffer = VK_NULL_HANDLE;
        VkDeviceMemory memory = VK_NULL_HANDLE;
        VkDeviceAddress address = 0;
        VkResult result = VK_SUCCESS;
        whileItFails([&] {
            result = vkCreateBuffer(gpu().device(), &info, nullptr, &buffer);
            if (result != VK_SUCCESS) {
                buffer = VK_NULL_HANDLE;
                return;
            }
            VkMemoryRequirements requirements{};
            vkGetBufferMemoryRequirements(gpu().device(), buffer, &requirements);
            const auto flags = vkInit<VkMemoryAllocateFlagsInfo>({.flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT});
            const auto allocate =
                vkInit<VkMemoryAllocateInfo>({.pNext = &flags,
                                              .allocationSize = requirements.size,
                                              .memoryTypeIndex = gpu().memoryType(
                                                  requirements.memoryTypeBits, VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT)});
            result = vkAllocateMemory(gpu().device(), &allocate, nullptr, &memory);
            if (result != VK_SUCCESS)
                memory = VK_NULL_HANDLE;
            if (result == VK_SUCCESS)
                result = vkBindBufferMemory(gpu().device(), buffer, memory, 0);
            if (result != VK_SUCCESS)
                return;
            const auto addressInfo = vkInit<VkBufferDeviceAddressInfo>({.buffer = buffer});
            address = vkGetBufferDeviceAddress(gpu().device(), &addressInfo);
        });
        vkDestroyBuffer(gpu().device(), buffer, nullptr);
        vkFreeMemory(gpu().device(), memory, nullptr);
        return address != 0;
    });
}

TEST_P(Allocations, Micromap)
{
    const Buffer buffer(gpu(), 65536,
                        VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT |
                            (gpu().khr() ? VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR
                                         : VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT));
    const Commands &vk = gpu().vk();
    if (gpu().khr()) {
        auto info = vkInit<VkAccelerationStructureCreateInfo2KHR>(
            {.addressRange = {(buffer.address() + 255) & ~VkDeviceAddress{255}, 4096},
             .type = VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR});
        failCreation<VkAccelerationStructureKHR>(
            [&](auto *made) { return vk.CreateAccelerationStructure2KHR(gpu().device(), &info, nullptr, made); },
            [&](auto made) { vk.DestroyAccelerationStructureKHR(gpu().device(), made, nullptr); });
        return;
    }
    auto info = vkInit<VkMicromapCreateInfoEXT>(
        {.buffer = buffer.handle(), .size = 4096, .type = VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT});
    failCreation<VkMicromapEXT>([&](auto *made) { return vk.CreateMicromapEXT(gpu().device(), &info, nullptr, made); },
                                [&](auto made) { vk.DestroyMicromapEXT(gpu().device(), made, nullptr); });
}

// Its address is queried as well, so that instances can name it.
TEST_P(Allocations, Structure)
{
    const Buffer buffer(gpu(), 1u << 20, gpu().structureUsage() | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    const Commands &vk = gpu().vk();
    for (const VkAccelerationStructureTypeKHR type :
         {VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR, VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR,
          VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR}) {
        VkDeviceSize offset = 0;
        failEach([&](const WhileItFails &whileItFails) {
            auto info = vkInit<VkAccelerationStructureCreateInfoKHR>(
                {.buffer = buffer.handle(), .offset = offset++ % 64 * 256, .size = 4096, .type = type});
            VkAccelerationStructureKHR made = VK_NULL_HANDLE;
            VkResult result = VK_SUCCESS;
            VkDeviceAddress address = 0;
            whileItFails([&] {
                result = vk.CreateAccelerationStructureKHR(gpu().device(), &info, nullptr, &made);
                if (result != VK_SUCCESS)
                    return;
                const auto addressInfo =
                    vkInit<VkAccelerationStructureDeviceAddressInfoKHR>({.accelerationStructure = made});
                address = vk.GetAccelerationStructureDeviceAddressKHR(gpu().device(), &addressInfo);
            });
            if (result == VK_SUCCESS)
                vk.DestroyAccelerationStructureKHR(gpu().device(), made, nullptr);
            return result == VK_SUCCESS && address != 0;
        });
    }
}

TEST_P(Allocations, ShaderModule)
{
    const std::vector<uint32_t> code = gpu().code(tracer_comp);
    auto info = vkInit<VkShaderModuleCreateInfo>({.codeSize = code.size() * 4, .pCode = code.data()});
    failCreation<VkShaderModule>(
        [&](VkShaderModule *module) { return vkCreateShaderModule(gpu().device(), &info, nullptr, module); },
        [&](VkShaderModule module) { vkDestroyShaderModule(gpu().device(), module, nullptr); });
}

TEST_P(Allocations, ComputePipeline)
{
    const Tracer tracer(gpu());
    const VkShaderModule module = gpu().shader(tracer_comp);
    auto info = vkInit<VkComputePipelineCreateInfo>(
        {.stage = vkInit<VkPipelineShaderStageCreateInfo>(
             {.stage = VK_SHADER_STAGE_COMPUTE_BIT, .module = module, .pName = "main"}),
         .layout = tracer.layout()});
    failCreation<VkPipeline>(
        [&](VkPipeline *pipeline) {
            return vkCreateComputePipelines(gpu().device(), VK_NULL_HANDLE, 1, &info, nullptr, pipeline);
        },
        [&](VkPipeline pipeline) { vkDestroyPipeline(gpu().device(), pipeline, nullptr); });
    vkDestroyShaderModule(gpu().device(), module, nullptr);
}

TEST_P(Allocations, RayTracingPipelines)
{
    failRayTracingPipelines();
}

TEST_P(Allocations, QueryPools)
{
    for (const VkQueryType type :
         {VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR, VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT}) {
        auto info = vkInit<VkQueryPoolCreateInfo>({.queryType = type, .queryCount = 1000});
        failCreation<VkQueryPool>(
            [&](VkQueryPool *pool) { return vkCreateQueryPool(gpu().device(), &info, nullptr, pool); },
            [&](VkQueryPool pool) { vkDestroyQueryPool(gpu().device(), pool, nullptr); });
    }
}

TEST_P(Allocations, CommandBuffers)
{
    auto info = vkInit<VkCommandBufferAllocateInfo>({.commandPool = gpu().pool(), .commandBufferCount = 3});
    std::array<VkCommandBuffer, 3> made{};
    failCreation<VkCommandBuffer>(
        [&](VkCommandBuffer *) {
            const VkResult result = vkAllocateCommandBuffers(gpu().device(), &info, made.data());
            if (result != VK_SUCCESS) { // "all objects must be destroyed ... and set to NULL"
                EXPECT_EQ(std::count(made.begin(), made.end(), VkCommandBuffer{}), 3);
            }
            return result;
        },
        [&](VkCommandBuffer) { vkFreeCommandBuffers(gpu().device(), gpu().pool(), 3, made.data()); });
}

TEST_P(Allocations, Recordings)
{
    StateScene scene(gpu());
    for (uint32_t step = 0; step < StateScene::kSteps; ++step) {
        SCOPED_TRACE(testing::Message() << "step " << step);
        failRecorded([&](VkCommandBuffer commands) { scene.recordStep(commands, step); });
    }
    scene.expectRight();
}

TEST_P(Allocations, RecordedCopies)
{
    const Patchwork patchwork(gpu());
    const Blas source(gpu(), patchwork.geometries());
    const Tlas top(gpu(), {instance(source, {}, 7)});
    const auto expected = seen(gpu(), top, Patchwork::rays());
    Structure copied(gpu(), VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR);
    copied.create(source.size());
    const auto copy = [&](VkCommandBuffer commands) { recordCopy(gpu(), commands, source.handle(), copied.handle()); };
    if (gpu().onLavapipe26())
        gpu().submit(copy); // which is passed on as it is, and allocates nothing
    else
        failRecorded(copy);
    EXPECT_EQ(seenOf(gpu(), copied), seenOf(gpu(), source));
    Structure topCopy(gpu(), VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR);
    topCopy.create(top.size());
    failRecorded([&](VkCommandBuffer commands) { recordCopy(gpu(), commands, top.handle(), topCopy.handle()); });
    EXPECT_EQ(seen(gpu(), topCopy, Patchwork::rays()), expected);
    const Buffer data(gpu(), 1u << 20,
                      VK_BUFFER_USAGE_TRANSFER_DST_BIT | VK_BUFFER_USAGE_TRANSFER_SRC_BIT |
                          VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    const VkDeviceAddress begin = (data.address() + 255) & ~VkDeviceAddress{255};
    failRecorded([&](VkCommandBuffer commands) { recordSerialize(gpu(), commands, source, begin); });
}
INSTANTIATE(Allocations);

// On a driver that defers operations.
class DeferredAllocations : public Allocations
{
protected:
    DeferredAllocations() : Allocations({.quirks = "deferred"}) {}
};
TEST_P(DeferredAllocations, RayTracingPipelines)
{
    failRayTracingPipelines();
}
INSTANTIATE(DeferredAllocations);

class ShaderObjectAllocations : public Allocations
{
protected:
    ShaderObjectAllocations() : Allocations({.shaderObject = true}) {}
};
TEST_P(ShaderObjectAllocations, Shaders)
{
    const auto create = reinterpret_cast<CreateShaders>(vkGetDeviceProcAddr(gpu().device(), "vkCreateShadersEXT"));
    const auto destroy = reinterpret_cast<DestroyShader>(vkGetDeviceProcAddr(gpu().device(), "vkDestroyShaderEXT"));
    if (create == nullptr)
        GTEST_SKIP() << "no shader objects";
    const Tracer tracer(gpu());
    const TracerShader shader(gpu(), tracer);
    failCreation<ShaderHandle>(
        [&](ShaderHandle *made) { return create(gpu().device(), 1, &shader.info, nullptr, made); },
        [&](ShaderHandle made) { destroy(gpu().device(), made, nullptr); });
}
INSTANTIATE(ShaderObjectAllocations);

// If the validation's own allocations fail, the device is created without validation.
class ValidatedAllocations : public Allocations
{
protected:
    ValidatedAllocations() : Allocations({.validate = true}) {}
};
TEST_P(ValidatedAllocations, Device)
{
    const long before = alive();
    const MicromapDeviceInfo info(gpu().family());
    failCreation<VkDevice>(
        [&](VkDevice *device) { return vkCreateDevice(gpu().physical(), info.get(), nullptr, device); },
        [](VkDevice device) { vkDestroyDevice(device, nullptr); });
    EXPECT_EQ(alive(), before);
}
INSTANTIATE(ValidatedAllocations);

class BinaryAllocations : public Allocations
{
protected:
    BinaryAllocations() : Allocations({.oldValidation = false, .quirks = "caching", .newer = true}) {}
};
// Binaries of a pipeline, and binaries created from data.
TEST_P(BinaryAllocations, Binaries)
{
    const Tracer tracer(gpu());
    const VkShaderModule module = gpu().shader(tracer_comp);
    const auto capture = vkInit<VkPipelineCreateFlags2CreateInfoKHR>({.flags = kCaptureData});
    auto info = vkInit<VkComputePipelineCreateInfo>(
        {.pNext = &capture,
         .stage = vkInit<VkPipelineShaderStageCreateInfo>(
             {.stage = VK_SHADER_STAGE_COMPUTE_BIT, .module = module, .pName = "main"}),
         .layout = tracer.layout()});
    VkPipeline pipeline = VK_NULL_HANDLE;
    VT_CHECK(vkCreateComputePipelines(gpu().device(), VK_NULL_HANDLE, 1, &info, nullptr, &pipeline));
    const auto create = reinterpret_cast<PFN_vkCreatePipelineBinariesKHR>(
        vkGetDeviceProcAddr(gpu().device(), "vkCreatePipelineBinariesKHR"));
    const auto destroy = reinterpret_cast<PFN_vkDestroyPipelineBinaryKHR>(
        vkGetDeviceProcAddr(gpu().device(), "vkDestroyPipelineBinaryKHR"));
    Binaries binaries(gpu());
    const Kept kept = binaries.keep(binaries.from(pipeline));
    VkPipelineBinaryKeyKHR key = kept.key;
    VkPipelineBinaryDataKHR data{kept.data.size(), const_cast<uint8_t *>(kept.data.data())};
    const VkPipelineBinaryKeysAndDataKHR all{1, &key, &data};
    for (const bool ofData : {false, true}) {
        VkPipelineBinaryCreateInfoKHR binaryInfo{};
        binaryInfo.sType = VK_STRUCTURE_TYPE_PIPELINE_BINARY_CREATE_INFO_KHR;
        if (ofData)
            binaryInfo.pKeysAndDataInfo = &all;
        else
            binaryInfo.pipeline = pipeline;
        failCreation<VkPipelineBinaryKHR>(
            [&](VkPipelineBinaryKHR *made) {
                VkPipelineBinaryHandlesInfoKHR handles{VK_STRUCTURE_TYPE_PIPELINE_BINARY_HANDLES_INFO_KHR, nullptr, 1,
                                                       made};
                return create(gpu().device(), &binaryInfo, nullptr, &handles);
            },
            [&](VkPipelineBinaryKHR made) { destroy(gpu().device(), made, nullptr); });
    }
    vkDestroyPipeline(gpu().device(), pipeline, nullptr);
    vkDestroyShaderModule(gpu().device(), module, nullptr);
}
INSTANTIATE(BinaryAllocations);

// On a driver with micromaps of its own, to which the layer translates.
class TranslatedAllocations : public Allocations
{
protected:
    TranslatedAllocations() : Allocations({.quirks = "ext", .api = Api::Khr}) {}
};
TEST_P(TranslatedAllocations, Recordings)
{
    StateScene scene(gpu());
    for (uint32_t step = 0; step < StateScene::kSteps; ++step) {
        SCOPED_TRACE(testing::Message() << "step " << step);
        failRecorded([&](VkCommandBuffer commands) { scene.recordStep(commands, step); });
    }
    scene.expectRight();
}
TEST_P(TranslatedAllocations, MicromapAndStructure)
{
    const Buffer buffer(gpu(), 65536,
                        VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR |
                            VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    const Commands &vk = gpu().vk();
    for (const VkAccelerationStructureTypeKHR type :
         {VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR, VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR}) {
        auto info = vkInit<VkAccelerationStructureCreateInfo2KHR>(
            {.addressRange = {(buffer.address() + 255) & ~VkDeviceAddress{255}, 4096}, .type = type});
        failCreation<VkAccelerationStructureKHR>(
            [&](auto *made) { return vk.CreateAccelerationStructure2KHR(gpu().device(), &info, nullptr, made); },
            [&](auto made) { vk.DestroyAccelerationStructureKHR(gpu().device(), made, nullptr); });
    }
}
TEST_P(TranslatedAllocations, QueryPool)
{
    auto info = vkInit<VkQueryPoolCreateInfo>(
        {.queryType = VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR, .queryCount = 1000});
    failCreation<VkQueryPool>(
        [&](VkQueryPool *pool) { return vkCreateQueryPool(gpu().device(), &info, nullptr, pool); },
        [&](VkQueryPool pool) { vkDestroyQueryPool(gpu().device(), pool, nullptr); });
}
INSTANTIATE(TranslatedAllocations);

} // namespace
