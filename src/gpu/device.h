// SPDX-License-Identifier: Apache-2.0
// A Vulkan device, buffers and their memory, and command submission.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <typeindex>
#include <vector>
#include <vulkan/vulkan.h>

#include "gpu/device_selection.h"
#include "vk/newer.h"
#include "vk/vk_init.h"

namespace vellum::gpu
{

// Gives out memory of a device. Small pieces share allocations: a device may allow no more than 4,096 of them
// (maxMemoryAllocationCount).
class MemoryPool
{
public:
    class Block;
    struct Piece {
        VkDeviceMemory memory = VK_NULL_HANDLE;
        VkDeviceSize offset = 0;
        Block *block = nullptr;
    };

    explicit MemoryPool(VkDevice device);
    // When all is freed, before the device is destroyed.
    ~MemoryPool();
    MemoryPool(const MemoryPool &) = delete;
    MemoryPool &operator=(const MemoryPool &) = delete;

    // Memory for buffers with a device address. Throws VulkanError.
    Piece allocate(const VkMemoryRequirements &requirements, uint32_t type);
    void free(const Piece &piece);

private:
    VkDevice device_;
    std::vector<std::unique_ptr<Block>> blocks_;
};

// Where Guarded memory is (arena.h): each piece in a buffer of its own, or all packed in few buffers, where handles are
// as large as their objects, or reach to the end of the buffer and are GENERIC as far as the API allows. DeviceLocal:
// where the device reads it fastest, without guard bytes; this includes the data of Device::upload and binding tables.
enum class Memory { Apart, Packed, PackedToTheEnd, DeviceLocal };

struct DeviceOptions {
    uint32_t physicalDevice = 0; // its number in the instance
    Api api = Api::Ext;
    bool micromaps = true;        // enable opacity micromaps
    bool bothApis = false;        // enable the other API as well
    bool micromapFeature = true;  // enable the feature as well as the extension
    bool hostCommands = true;     // enable micromapHostCommands
    bool fewFeatures = false;     // without nullDescriptor, indexTypeUint8, drawIndirectCount and synchronization2
    bool declaresMode = true;     // with Api::Khr: modules with ray queries get the execution mode of micromaps
    bool addressReplay = true;    // enable bufferDeviceAddressCaptureReplay, where the device has it
    bool allQueueFamilies = true; // a queue of each family, or only of the one that is used
    bool privateData = false;     // structures and micromaps keep private data (Device::keepPrivateData)
    // Buffers for acceleration structures have VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT. The rule that demands it
    // (VUID-VkAccelerationStructureCreateInfoKHR-pInfo-09542, by its number) is younger than the extension.
    bool addressedStructures = true;
    std::vector<std::string> extensions; // enabled where the device has them, with their features
    Memory memory = Memory::Apart;
    // Called with what Device and its objects find wrong by themselves, such as a write outside a structure's memory.
    std::function<void(const std::string &)> onFault = {};
};
#define CHECK_INSTANCE_COMMANDS(X)                                                                                     \
    X(CreateDebugUtilsMessengerEXT)                                                                                    \
    X(DestroyDebugUtilsMessengerEXT)

#define CHECK_DEVICE_COMMANDS(X)                                                                                       \
    X(CreatePrivateDataSlot)                                                                                           \
    X(DestroyPrivateDataSlot)                                                                                          \
    X(SetPrivateData)                                                                                                  \
    X(GetPrivateData)                                                                                                  \
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
    X(QueueInsertDebugUtilsLabelEXT)                                                                                   \
    X(CreateDeferredOperationKHR)                                                                                      \
    X(DestroyDeferredOperationKHR)                                                                                     \
    X(DeferredOperationJoinKHR)                                                                                        \
    X(GetDeferredOperationResultKHR)                                                                                   \
    X(CmdPushDescriptorSetKHR)                                                                                         \
    X(CmdBindDescriptorSets2KHR)                                                                                       \
    X(CmdPushConstants2KHR)                                                                                            \
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
    X(CmdDrawMeshTasksEXT)                                                                                             \
    X(CmdDrawMeshTasksIndirectEXT)                                                                                     \
    X(CmdDrawMeshTasksIndirectCountEXT)                                                                                \
    X(CmdBindTransformFeedbackBuffersEXT)                                                                              \
    X(CmdBeginTransformFeedbackEXT)                                                                                    \
    X(CmdEndTransformFeedbackEXT)                                                                                      \
    X(CmdDrawIndirectByteCountEXT)                                                                                     \
    X(CmdBeginConditionalRenderingEXT)                                                                                 \
    X(CmdEndConditionalRenderingEXT)

struct Commands {
#define CHECK_MEMBER(name) PFN_vk##name name = nullptr;
    CHECK_INSTANCE_COMMANDS(CHECK_MEMBER)
    CHECK_DEVICE_COMMANDS(CHECK_MEMBER)
#undef CHECK_MEMBER
};

class Arena;
class Device;

// A buffer with memory of its own, mapped; or in the device's memory, with others.
class Buffer
{
public:
    enum class Place { Host, Device };

    Buffer() = default;
    // Host: filled with zeros.
    Buffer(Device &gpu, VkDeviceSize size, VkBufferUsageFlags usage, Place place = Place::Host);
    // A buffer in the memory of another one, which outlives it: that many bytes from the offset on, which is rounded
    // down as the device demands. No buffer if the memory cannot hold it.
    Buffer(Device &gpu, const Buffer &other, VkDeviceSize offset, VkDeviceSize size, VkBufferUsageFlags usage);
    Buffer(Buffer &&other) noexcept { swap(other); }
    Buffer &operator=(Buffer &&other) noexcept
    {
        swap(other);
        return *this;
    }
    ~Buffer();

    [[nodiscard]] VkBuffer handle() const { return buffer_; }
    // On the host: its memory, and where in that it begins, not at 0.
    [[nodiscard]] VkDeviceMemory memory() const { return memory_; }
    [[nodiscard]] VkDeviceSize begin() const { return begin_; }
    [[nodiscard]] VkDeviceSize size() const { return size_; }
    // Valid only if the usage includes VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT.
    [[nodiscard]] VkDeviceAddress address() const { return address_; }
    // Null on the device.
    [[nodiscard]] uint8_t *bytes() const { return bytes_; }
    template <class T>
    [[nodiscard]] std::span<T> as() const
    {
        return {reinterpret_cast<T *>(bytes_), static_cast<size_t>(size_) / sizeof(T)};
    }
    // Writes device memory by a copy, which the usage must allow.
    void write(VkDeviceSize offset, const void *content, size_t size);
    [[nodiscard]] std::vector<uint32_t> words(size_t count) const; // the first ones

private:
    void swap(Buffer &other) noexcept;

    Device *gpu_ = nullptr;
    VkBuffer buffer_ = VK_NULL_HANDLE;
    VkDeviceMemory memory_ = VK_NULL_HANDLE;
    VkDeviceSize begin_ = 0;
    MemoryPool::Piece piece_; // on the device
    VkDeviceSize size_ = 0;
    VkDeviceAddress address_ = 0;
    uint8_t *bytes_ = nullptr;
};

// A pool of queries, used as the handle it is.
// An image with memory of its own.
class DeviceImage
{
public:
    DeviceImage(Device &gpu, const VkImageCreateInfo &info);
    DeviceImage(const DeviceImage &) = delete;
    DeviceImage &operator=(const DeviceImage &) = delete;
    ~DeviceImage();
    [[nodiscard]] VkImage handle() const { return image_; }

private:
    explicit DeviceImage(Device &gpu) : gpu_(gpu) {}

    Device &gpu_;
    VkImage image_ = VK_NULL_HANDLE;
    VkDeviceMemory memory_ = VK_NULL_HANDLE;
};

class QueryPool
{
public:
    QueryPool() = default;
    QueryPool(Device &gpu, VkQueryType type, uint32_t count = 1);
    QueryPool(QueryPool &&other) noexcept { swap(other); }
    QueryPool &operator=(QueryPool &&other) noexcept
    {
        swap(other);
        return *this;
    }
    ~QueryPool();

    operator VkQueryPool() const { return pool_; } // NOLINT
    [[nodiscard]] VkQueryType type() const { return type_; }
    // The value must be available.
    [[nodiscard]] uint64_t value(uint32_t query = 0) const;

private:
    void swap(QueryPool &other) noexcept;

    Device *gpu_ = nullptr;
    VkQueryType type_{};
    VkQueryPool pool_ = VK_NULL_HANDLE;
};

struct Submission {
    bool secondary = false;  // in a secondary command buffer
    uint32_t times = 1;      // that it is submitted
    bool rerecorded = false; // it is recorded twice
};

class Device
{
public:
    // Creates an instance for the device.
    Device(InstanceOptions instance, DeviceOptions options);
    // For drawing: with micromaps by `api`, or without, in the device's memory and without options that cost time.
    Device(const DeviceInfo &info, std::optional<Api> api);
    Device(const Device &) = delete;
    Device &operator=(const Device &) = delete;
    ~Device();

    [[nodiscard]] const DeviceOptions &options() const { return options_; }
    [[nodiscard]] bool khr() const { return options_.api == Api::Khr; }
    // Uses that API from now on, on a device with both.
    void use(Api api) { options_.api = api; }
    // A module as shader() makes it.
    [[nodiscard]] std::vector<uint32_t> code(std::span<const uint32_t> words) const;
    [[nodiscard]] VkInstance instance() const { return instance_.handle(); }
    [[nodiscard]] VkPhysicalDevice physical() const { return physical_; }
    [[nodiscard]] VkDevice device() const { return device_; }
    [[nodiscard]] VkQueue queue() const { return queue_; }
    [[nodiscard]] VkCommandPool pool() const { return pool_; }
    [[nodiscard]] bool has(const char *deviceExtension) const;
    [[nodiscard]] const std::vector<KnownFault> &knownFaults() const { return knownFaults_; }
    [[nodiscard]] bool hasFault(Fault fault) const
    {
        return std::any_of(knownFaults_.begin(), knownFaults_.end(), [&](const auto &f) { return f.fault == fault; });
    }
    // Lavapipe of Mesa 26 or newer, whose faults some tests have to avoid: each says which.
    [[nodiscard]] bool onLavapipe26() const { return lavapipe26_; }
    [[nodiscard]] const Commands &vk() const { return commands_; }
    // Null where memory is not packed.
    [[nodiscard]] Arena *arena() const { return arena_.get(); }
    [[nodiscard]] MemoryPool &deviceMemory() { return *deviceMemory_; }
    // All queues of its family that the device was made with: what is not said otherwise goes to the first one.
    [[nodiscard]] std::span<const VkQueue> queues() const { return queues_; }
    // The family that they are of, which is the first one for both graphics and compute. Where there are others, the
    // device was made with a queue of each.
    [[nodiscard]] uint32_t family() const { return family_; }
    [[nodiscard]] std::span<const VkQueueFamilyProperties> families() const { return families_; }
    [[nodiscard]] VkQueue queueOf(uint32_t family) const;
    // Enabled features.
    [[nodiscard]] bool hasIndirectBuilds() const { return indirectBuilds_; }
    [[nodiscard]] bool hasMicromapHostCommands() const { return micromapHostCommands_; }
    [[nodiscard]] bool hasSynchronization2() const { return synchronization2_; } // of Vulkan 1.3
    [[nodiscard]] bool hasHostQueryReset() const { return hostQueryReset_; }
    // Draws may read how many they are, up to LaunchPlan::kMostDraws.
    [[nodiscard]] bool hasCountedDraws() const { return countedDraws_; }
    [[nodiscard]] bool hasIndirectTraces() const { return indirectTraces_[0]; } // vkCmdTraceRaysIndirectKHR
    [[nodiscard]] bool hasIndirectTraces2() const { return indirectTraces_[1]; }
    [[nodiscard]] bool hasPrimitiveCulling() const { return primitiveCulling_; } // rayTraversalPrimitiveCulling
    // shaderSampledImageArrayNonUniformIndexing
    [[nodiscard]] bool hasVariableTextureIndices() const { return variableTextureIndices_; }
    // The highest level of micromap triangles, by format.
    [[nodiscard]] uint32_t maxLevel(uint16_t format) const
    {
        return format == VK_OPACITY_MICROMAP_FORMAT_2_STATE_EXT ? maxLevels_[0] : maxLevels_[1];
    }
    // The highest level of triangles of four states in lossy builds; 0 without VK_KHR_opacity_micromap.
    [[nodiscard]] uint32_t maxLossyLevel() const { return maxLevels_[2]; }
    // The limits of a bottom-level structure, a top-level one and a micromap.
    [[nodiscard]] uint64_t maxGeometries() const { return maxGeometries_; }
    [[nodiscard]] uint64_t maxPrimitives() const { return maxPrimitives_; }
    [[nodiscard]] uint64_t maxInstances() const { return maxInstances_; }
    [[nodiscard]] uint64_t maxMicromapTriangles() const { return maxMicromapTriangles_; }
    // The formats of kVertexFormats that the device supports.
    [[nodiscard]] std::vector<VkFormat> vertexFormats() const;
    [[nodiscard]] const VkPhysicalDeviceDriverProperties &driver() const { return driver_; }
    [[nodiscard]] uint32_t scratchAlignment() const { return scratchAlignment_; }
    [[nodiscard]] const VkPhysicalDeviceRayTracingPipelinePropertiesKHR &pipelineProperties() const
    {
        return pipelineProperties_;
    }

    [[nodiscard]] const VkPhysicalDeviceLimits &limits() const { return limits_; }
    // Timestamps are worth more than the host's clock: a processor that is not the host's, with a timer.
    [[nodiscard]] bool hasTimestamps() const { return timestamps_; }

    // A type with all `wanted` properties, best with `preferred` too.
    [[nodiscard]] uint32_t memoryType(uint32_t allowed, VkMemoryPropertyFlags wanted,
                                      VkMemoryPropertyFlags preferred = 0) const;
    // Memory of a type with these properties; addressed: for buffers with device addresses. The caller frees it.
    [[nodiscard]] VkDeviceMemory allocate(const VkMemoryRequirements &needs, VkMemoryPropertyFlags wanted = 0,
                                          bool addressed = true) const;
    // Memory of the buffer's size, bound to it.
    [[nodiscard]] VkDeviceMemory bindMemory(VkBuffer buffer, VkMemoryPropertyFlags wanted = 0,
                                            bool addressed = true) const;
    [[nodiscard]] VkDeviceAddress address(VkBuffer buffer) const;
    // A buffer with device address and the content, readable by everything that needs an address. On the device with
    // Memory::DeviceLocal.
    template <class T>
    Buffer upload(std::span<const T> content, VkBufferUsageFlags usage)
    {
        return upload(content.data(), content.size_bytes(), usage);
    }
    Buffer upload(const void *content, size_t size, VkBufferUsageFlags usage);

    VkCommandBuffer begin(VkCommandBufferUsageFlags usage = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT,
                          VkCommandBufferLevel level = VK_COMMAND_BUFFER_LEVEL_PRIMARY);
    void end(VkCommandBuffer commands);
    // Submits and waits.
    void execute(VkCommandBuffer commands);
    // While submit records: the command buffer is submitted together with these, which precede it and are then freed.
    void executeBefore(std::span<const VkCommandBuffer> commands) { before_.assign(commands.begin(), commands.end()); }
    // begin, record, end, execute.
    void submit(const std::function<void(VkCommandBuffer)> &record, const Submission &submission = {});
    // Names what follows in capture tools: VkDebugUtilsLabelEXT.
    void insertLabel(const std::string &text) const;
    VkShaderModule shader(std::span<const uint32_t> words) const;

    // An object that a user of the device keeps with it, one of each type; destroyed before the device.
    template <class T>
    std::shared_ptr<T> kept()
    {
        std::shared_ptr<void> &object = kept_[std::type_index(typeid(T))];
        if (!object)
            object = std::make_shared<T>();
        return std::static_pointer_cast<T>(object);
    }

    // A second device of an instance of its own, both created like this one's, with Memory::Apart.
    Device &twin();

    // Usage of buffers for acceleration structures (DeviceOptions::addressedStructures).
    [[nodiscard]] VkBufferUsageFlags structureUsage() const;
    // Gives a new object values in two private data slots, which it must keep until it is destroyed. Nothing without
    // DeviceOptions::privateData, or without the feature.
    void keepPrivateData(VkObjectType type, uint64_t handle);
    void expectPrivateData(VkObjectType type, uint64_t handle);
    // Reports what is wrong: to DeviceOptions::onFault, or keeps it for takeFaults.
    void fault(const std::string &what);
    // The faults that were reported and kept since the last call.
    std::vector<std::string> takeFaults();

private:
    void beginAgain(VkCommandBuffer commands, VkCommandBufferUsageFlags usage);
    Device(std::unique_ptr<Instance> instance, DeviceOptions options);
    Device(const Instance &instance, DeviceOptions options);
    void createDevice();

    std::unique_ptr<Instance> ownInstance_;
    const Instance &instance_;
    DeviceOptions options_;
    VkPhysicalDevice physical_ = VK_NULL_HANDLE;
    VkDevice device_ = VK_NULL_HANDLE;
    VkQueue queue_ = VK_NULL_HANDLE;
    std::vector<VkQueue> queues_;
    uint32_t family_ = 0;
    std::vector<VkQueueFamilyProperties> families_;
    std::unique_ptr<Arena> arena_;
    std::unique_ptr<MemoryPool> deviceMemory_;
    std::unique_ptr<Device> twin_;
    VkCommandPool pool_ = VK_NULL_HANDLE;
    std::vector<VkCommandBuffer> before_;
    std::array<VkPrivateDataSlot, 2> privateData_{};
    std::map<std::type_index, std::shared_ptr<void>> kept_;
    Commands commands_;
    std::vector<std::string> extensions_;
    uint32_t scratchAlignment_ = 0;
    std::vector<KnownFault> knownFaults_;
    bool lavapipe26_ = false;
    bool indirectBuilds_ = false, micromapHostCommands_ = false, hostQueryReset_ = false, countedDraws_ = false,
         synchronization2_ = false;
    std::array<bool, 2> indirectTraces_{};
    bool primitiveCulling_ = false, variableTextureIndices_ = false;
    std::array<uint32_t, 3> maxLevels_{};
    uint64_t maxGeometries_ = 0, maxPrimitives_ = 0, maxInstances_ = 0;
    uint64_t maxMicromapTriangles_ = UINT64_MAX; // VK_EXT_opacity_micromap has no such limit
    std::mutex faultsMutex_;
    std::vector<std::string> faults_;
    VkPhysicalDeviceLimits limits_{};
    bool timestamps_ = false;
    VkPhysicalDeviceDriverProperties driver_{};
    VkPhysicalDeviceRayTracingPipelinePropertiesKHR pipelineProperties_{};
};

// Runs a command as a deferred operation, and joins it. Returns its result.
VkResult deferred(const Device &gpu, const std::function<VkResult(VkDeferredOperationKHR)> &command);
// Everything before it happens before everything after it, and before the host reads.
void barrier(VkCommandBuffer commands);

} // namespace vellum::gpu
