// SPDX-License-Identifier: Apache-2.0
// A small Vulkan for the tests: an application's instance with Vellum's layer on top, the validation layer and a spy
// below it (nearer to the driver), a device, buffers, command submission, and every message that the layers sent.
// With the environment variable VELLUM_TEST_VALIDATION=above the validation layer is between the tests and Vellum's
// layer, and checks the tests instead; this needs a validation layer that knows the extensions (1.4.360).
#pragma once

#include "vellum/vulkan_opacity_micromap.h"
#include "vk/vk_init.h"

#include <atomic>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace vt
{

namespace newer = vellum::newer;

struct Message {
    VkDebugUtilsMessageSeverityFlagBitsEXT severity;
    std::string id;
    std::string text;
    std::string object; // name of the first object that it is about

    [[nodiscard]] bool fromVellum() const { return id.starts_with("VELLUM-"); }
};

// Which extension the tests go through: the environment variable VELLUM_TEST_API says "ext" or "khr".
enum class Api { Ext, Khr };
Api apiOfTests();

// Where Guarded memory lies (arena.h): each piece in a buffer of its own, or all packed in few buffers, where handles
// are as large as what they are for, or reach to the end of the buffer and are GENERIC as far as the API allows. The
// environment variable VELLUM_TEST_ARENA says "exact" or "end".
enum class Memory { Apart, Packed, PackedToTheEnd };
Memory memoryOfTests();

// Where the validation layer is, seen from Vellum's: the environment variable VELLUM_TEST_VALIDATION.
enum class Validation { Below, Above };
Validation validationOfTests();

// Whether the layer also rejects what does no harm: by its own environment variable, VELLUM_STRICT. Tests of wrong
// input run both ways.
inline bool strictTests()
{
    const char *value = std::getenv("VELLUM_STRICT");
    return value && std::strcmp(value, "1") == 0;
}

struct Options {
    bool vellum = true;
    bool validation = true;
    bool oldValidation = true; // also a validation layer older than VK_KHR_opacity_micromap
    bool spy = true;           // layers/spy.cpp: what must not reach the driver
    std::string quirks = {};   // of the mock driver (layers/quirks.cpp), with commas; and those of VELLUM_TEST_QUIRKS
    std::string absentGpu{};   // a GPU that its driver compiles for though it is not there (drivers/compiled.h)
    bool micromaps = true;     // enable opacity micromaps on the device
    Api api = apiOfTests();    // by this extension
    bool bothApis = false;     // enable the other one, too
    bool hostCommands = true;  // enable micromapHostCommands
    bool validate = false;     // the layer's setting
    bool shaderObject = false; // VK_EXT_shader_object, which the oldest supported headers do not know
    bool debugMarker = false;  // VK_EXT_debug_marker, which the spy has
    bool maintenance = false;  // VK_KHR_ray_tracing_maintenance1
    bool newer = false; // extensions for ray tracing pipelines that the oldest supported headers do not know, and
                        // the validation layer of that age reports as errors: see oldValidation
    bool addressCommands = false; // VK_KHR_device_address_commands, and the extensions whose commands it has again
    bool nullIndexBuffer = false; // VK_KHR_maintenance6
    bool micromapFeature = true;  // where the extension is enabled, its feature too
    bool shared = false;          // by all tests of the process that request the same
    bool addressReplay = true;    // enable bufferDeviceAddressCaptureReplay, where it is there
    Memory memory = memoryOfTests();
    bool declaresMode = true; // with Api::Khr: modules of ray queries have the execution mode, and so use micromaps

    bool operator==(const Options &) const = default;
};

#define VT_INSTANCE_COMMANDS(X)                                                                                        \
    X(CreateDebugUtilsMessengerEXT)                                                                                    \
    X(DestroyDebugUtilsMessengerEXT)

#define VT_DEVICE_COMMANDS(X)                                                                                          \
    X(CreateMicromapEXT)                                                                                               \
    X(DestroyMicromapEXT)                                                                                              \
    X(GetMicromapBuildSizesEXT)                                                                                        \
    X(CmdBuildMicromapsEXT)                                                                                            \
    X(CmdCopyMicromapEXT)                                                                                              \
    X(GetDeviceMicromapCompatibilityEXT)                                                                               \
    X(CmdCopyMicromapToMemoryEXT)                                                                                      \
    X(CmdCopyMemoryToMicromapEXT)                                                                                      \
    X(CmdWriteMicromapsPropertiesEXT)                                                                                  \
    X(BuildMicromapsEXT)                                                                                               \
    X(CopyMicromapEXT)                                                                                                 \
    X(CopyMicromapToMemoryEXT)                                                                                         \
    X(CopyMemoryToMicromapEXT)                                                                                         \
    X(WriteMicromapsPropertiesEXT)                                                                                     \
    X(CmdWriteAccelerationStructuresPropertiesKHR)                                                                     \
    X(CreateAccelerationStructure2KHR)                                                                                 \
    X(CreateAccelerationStructureKHR)                                                                                  \
    X(DestroyAccelerationStructureKHR)                                                                                 \
    X(GetAccelerationStructureBuildSizesKHR)                                                                           \
    X(GetAccelerationStructureDeviceAddressKHR)                                                                        \
    X(CmdBuildAccelerationStructuresKHR)                                                                               \
    X(CmdBuildAccelerationStructuresIndirectKHR)                                                                       \
    X(CmdCopyAccelerationStructureKHR)                                                                                 \
    X(CmdCopyAccelerationStructureToMemoryKHR)                                                                         \
    X(CmdCopyMemoryToAccelerationStructureKHR)                                                                         \
    X(GetDeviceAccelerationStructureCompatibilityKHR)                                                                  \
    X(CreateRayTracingPipelinesKHR)                                                                                    \
    X(GetRayTracingShaderGroupHandlesKHR)                                                                              \
    X(CmdTraceRaysKHR)                                                                                                 \
    X(CmdTraceRaysIndirectKHR)                                                                                         \
    X(CmdTraceRaysIndirect2KHR)                                                                                        \
    X(GetRayTracingShaderGroupStackSizeKHR)                                                                            \
    X(CmdSetRayTracingPipelineStackSizeKHR)                                                                            \
    X(CreateDeferredOperationKHR)                                                                                      \
    X(DestroyDeferredOperationKHR)                                                                                     \
    X(DeferredOperationJoinKHR)                                                                                        \
    X(GetDeferredOperationResultKHR)                                                                                   \
    X(CmdPushDescriptorSetKHR)                                                                                         \
    X(CmdCopyMemoryKHR)                                                                                                \
    X(CmdCopyMemoryToImageKHR)                                                                                         \
    X(CmdCopyImageToMemoryKHR)                                                                                         \
    X(CmdUpdateMemoryKHR)                                                                                              \
    X(CmdFillMemoryKHR)                                                                                                \
    X(CmdCopyQueryPoolResultsToMemoryKHR)                                                                              \
    X(CmdWriteMarkerToMemoryAMD)                                                                                       \
    X(CmdBindIndexBuffer3KHR)                                                                                          \
    X(CmdBindVertexBuffers3KHR)                                                                                        \
    X(CmdDrawIndirect2KHR)                                                                                             \
    X(CmdDrawIndexedIndirect2KHR)                                                                                      \
    X(CmdDrawIndirectCount2KHR)                                                                                        \
    X(CmdDrawIndexedIndirectCount2KHR)                                                                                 \
    X(CmdDrawMeshTasksIndirect2EXT)                                                                                    \
    X(CmdDrawMeshTasksIndirectCount2EXT)                                                                               \
    X(CmdDispatchIndirect2KHR)                                                                                         \
    X(CmdBeginConditionalRendering2EXT)                                                                                \
    X(CmdBindTransformFeedbackBuffers2EXT)                                                                             \
    X(CmdBeginTransformFeedback2EXT)                                                                                   \
    X(CmdEndTransformFeedback2EXT)                                                                                     \
    X(CmdDrawIndirectByteCount2EXT)                                                                                    \
    X(CmdDrawMeshTasksIndirectEXT)                                                                                     \
    X(CmdDrawMeshTasksIndirectCountEXT)                                                                                \
    X(CmdBindTransformFeedbackBuffersEXT)                                                                              \
    X(CmdBeginTransformFeedbackEXT)                                                                                    \
    X(CmdEndTransformFeedbackEXT)                                                                                      \
    X(CmdDrawIndirectByteCountEXT)                                                                                     \
    X(CmdBeginConditionalRenderingEXT)                                                                                 \
    X(CmdEndConditionalRenderingEXT)

struct Commands {
#define VT_MEMBER(name) PFN_vk##name name = nullptr;
    VT_INSTANCE_COMMANDS(VT_MEMBER)
    VT_DEVICE_COMMANDS(VT_MEMBER)
#undef VT_MEMBER
};

class Arena;
class Gpu;

// A buffer with memory of its own, mapped.
class Buffer
{
public:
    Buffer() = default;
    Buffer(Gpu &gpu, VkDeviceSize size, VkBufferUsageFlags usage);
    Buffer(Buffer &&other) noexcept { swap(other); }
    Buffer &operator=(Buffer &&other) noexcept
    {
        swap(other);
        return *this;
    }
    ~Buffer();

    [[nodiscard]] VkBuffer handle() const { return buffer_; }
    [[nodiscard]] VkDeviceMemory memory() const { return memory_; }
    [[nodiscard]] VkDeviceSize size() const { return size_; }
    // Only where the usage holds VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT.
    [[nodiscard]] VkDeviceAddress address() const { return address_; }
    [[nodiscard]] uint8_t *bytes() const { return bytes_; }
    template <class T>
    [[nodiscard]] std::span<T> as() const
    {
        return {reinterpret_cast<T *>(bytes_), static_cast<size_t>(size_) / sizeof(T)};
    }

private:
    void swap(Buffer &other) noexcept;

    Gpu *gpu_ = nullptr;
    VkBuffer buffer_ = VK_NULL_HANDLE;
    VkDeviceMemory memory_ = VK_NULL_HANDLE;
    VkDeviceSize size_ = 0;
    VkDeviceAddress address_ = 0;
    uint8_t *bytes_ = nullptr;
};

// A pool of queries, used as the handle it is.
class QueryPool
{
public:
    QueryPool() = default;
    QueryPool(Gpu &gpu, VkQueryType type, uint32_t count = 1);
    QueryPool(QueryPool &&other) noexcept { swap(other); }
    QueryPool &operator=(QueryPool &&other) noexcept
    {
        swap(other);
        return *this;
    }
    ~QueryPool();

    operator VkQueryPool() const { return pool_; } // NOLINT
    [[nodiscard]] VkQueryType type() const { return type_; }
    // Which must be available.
    [[nodiscard]] uint64_t value(uint32_t query = 0) const;

private:
    void swap(QueryPool &other) noexcept;

    Gpu *gpu_ = nullptr;
    VkQueryType type_{};
    VkQueryPool pool_ = VK_NULL_HANDLE;
};

class Gpu
{
public:
    explicit Gpu(const Options &options = {});
    Gpu(const Gpu &) = delete;
    Gpu &operator=(const Gpu &) = delete;
    ~Gpu();

    [[nodiscard]] const Options &options() const { return options_; }
    [[nodiscard]] bool khr() const { return options_.api == Api::Khr; }
    // What is made from now on goes through that API; of a device with both.
    void use(Api api) { options_.api = api; }
    // A module as shader() makes it.
    [[nodiscard]] std::vector<uint32_t> code(std::span<const uint32_t> words) const;
    [[nodiscard]] VkInstance instance() const { return instance_; }
    [[nodiscard]] VkPhysicalDevice physical() const { return physical_; }
    [[nodiscard]] VkDevice device() const { return device_; }
    [[nodiscard]] VkQueue queue() const { return queue_; }
    [[nodiscard]] VkCommandPool pool() const { return pool_; }
    [[nodiscard]] bool has(const char *deviceExtension) const;
    // Lavapipe of Mesa 26 or newer, which some tests have to go round: each says what it does, with and without the
    // layer.
    [[nodiscard]] bool onLavapipe26() const { return lavapipe26_; }
    [[nodiscard]] const Commands &vk() const { return commands_; }
    // Null where memory is Memory::Apart.
    [[nodiscard]] Arena *arena() const { return arena_.get(); }
    // All queues of its family that the device was made with: what is not said otherwise goes to the first one.
    [[nodiscard]] std::span<const VkQueue> queues() const { return queues_; }
    // The family that they are of, which is the first one for both graphics and compute. Where there are others, the
    // device was made with a queue of each.
    [[nodiscard]] uint32_t family() const { return family_; }
    [[nodiscard]] std::span<const VkQueueFamilyProperties> families() const { return families_; }
    [[nodiscard]] VkQueue queueOf(uint32_t family) const;
    [[nodiscard]] uint32_t scratchAlignment() const { return scratchAlignment_; }
    [[nodiscard]] const VkPhysicalDeviceRayTracingPipelinePropertiesKHR &pipelineProperties() const
    {
        return pipelineProperties_;
    }

    [[nodiscard]] uint32_t memoryType(uint32_t allowed, VkMemoryPropertyFlags wanted) const;
    // Memory of a type with these properties; addressed: for buffers with device addresses. The caller frees it.
    [[nodiscard]] VkDeviceMemory allocate(const VkMemoryRequirements &needs, VkMemoryPropertyFlags wanted = 0,
                                          bool addressed = true) const;
    // Memory of the buffer's size, bound to it.
    [[nodiscard]] VkDeviceMemory bindMemory(VkBuffer buffer, VkMemoryPropertyFlags wanted = 0,
                                            bool addressed = true) const;
    [[nodiscard]] VkDeviceAddress address(VkBuffer buffer) const;
    // A buffer with device address and the content, readable by everything that needs an address.
    template <class T>
    Buffer upload(std::span<const T> content, VkBufferUsageFlags usage)
    {
        Buffer buffer(*this, std::max<VkDeviceSize>(content.size_bytes(), 16),
                      usage | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
        if (!content.empty())
            std::memcpy(buffer.bytes(), content.data(), content.size_bytes());
        return buffer;
    }

    VkCommandBuffer begin(VkCommandBufferUsageFlags usage = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT,
                          VkCommandBufferLevel level = VK_COMMAND_BUFFER_LEVEL_PRIMARY);
    void end(VkCommandBuffer commands);
    // Submits and waits.
    void execute(VkCommandBuffer commands);
    // begin, record, end, execute.
    void submit(const std::function<void(VkCommandBuffer)> &record);
    VkShaderModule shader(std::span<const uint32_t> words) const;

    // All messages since the last call.
    std::vector<Message> takeMessages();
    // The messages that no test expects: those not on the short list of false alarms in harness.cpp. Where Vellum
    // reports an error, the test meant it, and a validation layer above reports no more than that.
    std::vector<Message> takeUnexpectedMessages();
    // The test breaks the rule with this VUID: a validation layer above may say so.
    void breaks(std::string rule) { broken_.push_back(std::move(rule)); }
    // Usage of buffers for acceleration structures. Below Vellum's layer without
    // VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT: the rule that demands it (pInfo-09542) is younger than the extension.
    [[nodiscard]] VkBufferUsageFlags structureUsage() const;
    // As it was made, for the next test: what use() and breaks() changed is forgotten.
    void reset(const Options &options);
    void addMessage(Message message);
    // How often the layer said that an intersection shader does not see all ray flags, which is not kept as a message.
    [[nodiscard]] size_t intersectionWarnings() const { return intersectionWarnings_; }

private:
    void createInstance();
    void createDevice();

    Options options_;
    VkInstance instance_ = VK_NULL_HANDLE;
    VkDebugUtilsMessengerEXT messenger_ = VK_NULL_HANDLE;
    VkPhysicalDevice physical_ = VK_NULL_HANDLE;
    VkDevice device_ = VK_NULL_HANDLE;
    VkQueue queue_ = VK_NULL_HANDLE;
    std::vector<VkQueue> queues_;
    uint32_t family_ = 0;
    std::vector<VkQueueFamilyProperties> families_;
    std::unique_ptr<Arena> arena_;
    VkCommandPool pool_ = VK_NULL_HANDLE;
    Commands commands_;
    std::vector<std::string> extensions_;
    uint32_t scratchAlignment_ = 0;
    bool lavapipe26_ = false;
    VkPhysicalDeviceRayTracingPipelinePropertiesKHR pipelineProperties_{};
    std::mutex messagesMutex_; // layers speak on whichever thread calls them
    std::vector<Message> messages_;
    std::vector<std::string> broken_;
    std::atomic<size_t> intersectionWarnings_ = 0;
};

// A test with a device; at its end nobody may have reported an error. Where the device is shared, what a test left
// alive is reported when the process ends; run_cases.py then runs the tests one by one to find out which it was.
class GpuTest : public testing::Test
{
protected:
    explicit GpuTest(const Options &options = {});
    ~GpuTest() override;
    void TearDown() override;

    void expectNoMessages()
    {
        for (const Message &m : gpu_->takeUnexpectedMessages())
            ADD_FAILURE() << m.id << ": " << m.text;
    }
    Gpu &gpu() { return *gpu_; }

private:
    std::shared_ptr<Gpu> gpu_;
};

// Throws what the test then reports.
void check(VkResult result, const char *what);
#define VT_CHECK(call) ::vt::check((call), #call)

// Everything before it happens before everything after it.
void barrier(VkCommandBuffer commands);

} // namespace vt
