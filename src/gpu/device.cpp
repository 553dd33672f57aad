// SPDX-License-Identifier: Apache-2.0
#include "gpu/device.h"

#include <stdexcept>
#include <utility>

#include "gpu/arena.h"
#include "gpu/execution_mode.h"
#include "gpu/launch.h"
#include "gpu/vertex_format.h"

namespace vellum::gpu
{
namespace
{

constexpr VkDeviceSize kBlock = VkDeviceSize{8} << 20;
constexpr VkDeviceSize kSmall = kBlock / 8; // sizes up to this share a block

} // namespace

// Pieces are taken one behind the other; their memory is used anew when all are freed.
class MemoryPool::Block
{
public:
    uint32_t type = 0;
    VkDeviceMemory memory = VK_NULL_HANDLE;
    VkDeviceSize size = 0;
    VkDeviceSize used = 0;
    size_t pieces = 0;
};

MemoryPool::MemoryPool(VkDevice device) : device_(device) {}

MemoryPool::~MemoryPool()
{
    for (const auto &block : blocks_)
        vkFreeMemory(device_, block->memory, nullptr);
}

MemoryPool::Piece MemoryPool::allocate(const VkMemoryRequirements &requirements, uint32_t type)
{
    const auto offsetIn = [&](const Block &block) {
        return (block.used + requirements.alignment - 1) / requirements.alignment * requirements.alignment;
    };
    const auto fits = [&](const std::unique_ptr<Block> &block) {
        return block->type == type && offsetIn(*block) <= block->size &&
               requirements.size <= block->size - offsetIn(*block);
    };
    auto found = std::find_if(blocks_.begin(), blocks_.end(), fits);
    if (found == blocks_.end()) {
        auto block = std::make_unique<Block>();
        block->type = type;
        block->size = requirements.size <= kSmall ? kBlock : requirements.size;
        const VkMemoryAllocateFlagsInfo flags{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO, nullptr,
                                              VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT, 0};
        const VkMemoryAllocateInfo info{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO, &flags, block->size, type};
        CHECK_VK(vkAllocateMemory(device_, &info, nullptr, &block->memory));
        blocks_.push_back(std::move(block));
        found = blocks_.end() - 1;
    }
    Block &block = **found;
    const VkDeviceSize offset = offsetIn(block);
    block.used = offset + requirements.size;
    ++block.pieces;
    return {block.memory, offset, &block};
}

void MemoryPool::free(const Piece &piece)
{
    if (piece.block == nullptr || --piece.block->pieces != 0)
        return;
    piece.block->used = 0;
    if (piece.block->size == kBlock)
        return;
    vkFreeMemory(device_, piece.memory, nullptr);
    std::erase_if(blocks_, [&](const auto &block) { return block.get() == piece.block; });
}

namespace
{

// Enabled where the device has them.
constexpr std::array<const char *, 10> kWantedExtensions{
    VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME,
    VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME,
    VK_KHR_RAY_QUERY_EXTENSION_NAME,
    VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME,
    VK_KHR_PUSH_DESCRIPTOR_EXTENSION_NAME,
    VK_KHR_SYNCHRONIZATION_2_EXTENSION_NAME,
    VK_KHR_PIPELINE_LIBRARY_EXTENSION_NAME,
    VK_EXT_CONDITIONAL_RENDERING_EXTENSION_NAME,
    VK_EXT_GRAPHICS_PIPELINE_LIBRARY_EXTENSION_NAME,
    VK_EXT_INDEX_TYPE_UINT8_EXTENSION_NAME,
};

// The extensions that became part of versions of Vulkan after 1.1.
constexpr std::array kExtensionsOfVulkan11{VK_KHR_BUFFER_DEVICE_ADDRESS_EXTENSION_NAME,
                                           VK_EXT_DESCRIPTOR_INDEXING_EXTENSION_NAME,
                                           VK_KHR_SPIRV_1_4_EXTENSION_NAME,
                                           VK_KHR_SHADER_FLOAT_CONTROLS_EXTENSION_NAME,
                                           VK_EXT_SCALAR_BLOCK_LAYOUT_EXTENSION_NAME,
                                           VK_EXT_EXTENDED_DYNAMIC_STATE_EXTENSION_NAME};

// A features structure of a few members, for headers that lack it.
struct SomeFeatures {
    VkStructureType sType;
    void *pNext = nullptr;
    std::array<VkBool32, 4> enabled{};
};
struct NewerExtension {
    const char *name;
    uint32_t features; // VkStructureType
};
constexpr std::array<NewerExtension, 11> kNewerExtensions{{
    {"VK_EXT_pipeline_robustness", VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PIPELINE_ROBUSTNESS_FEATURES_EXT},
    {"VK_KHR_maintenance5", 1000470000},
    {"VK_EXT_descriptor_heap", 1000135009},
    {"VK_EXT_descriptor_buffer", VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DESCRIPTOR_BUFFER_FEATURES_EXT},
    {"VK_EXT_device_generated_commands", 1000572000},
    {"VK_EXT_shader_module_identifier", VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_MODULE_IDENTIFIER_FEATURES_EXT},
    {"VK_KHR_pipeline_binary", 1000483000},
    {"VK_KHR_ray_tracing_position_fetch", 1000481000},
    {"VK_EXT_pipeline_library_group_handles", 1000498000},
    {"VK_EXT_shader_object", 1000482000},
    {"VK_KHR_maintenance6", 1000545000},
}};

// The command buffers that precede one submission. Another one that is made while it is recorded has its own; those of
// a recording that failed are freed.
struct Preceding {
    VkDevice device;
    VkCommandPool pool;
    std::vector<VkCommandBuffer> &own;
    std::vector<VkCommandBuffer> outer = std::exchange(own, {});

    ~Preceding()
    {
        if (!own.empty())
            vkFreeCommandBuffers(device, pool, static_cast<uint32_t>(own.size()), own.data());
        own = std::move(outer);
    }
};

uint64_t privateValue(uint64_t object, size_t slot)
{
    return (object * 2 + slot + 1) * 0x9e3779b97f4a7c15;
}

} // namespace

VkResult deferred(const Device &gpu, const std::function<VkResult(VkDeferredOperationKHR)> &command)
{
    VkDeferredOperationKHR operation = VK_NULL_HANDLE;
    CHECK_VK(gpu.vk().CreateDeferredOperationKHR(gpu.device(), nullptr, &operation));
    VkResult result = command(operation);
    if (result == VK_OPERATION_DEFERRED_KHR) {
        do {
            result = gpu.vk().DeferredOperationJoinKHR(gpu.device(), operation);
        } while (result == VK_THREAD_IDLE_KHR);
        if (result == VK_SUCCESS)
            result = gpu.vk().GetDeferredOperationResultKHR(gpu.device(), operation);
    } else if (result == VK_OPERATION_NOT_DEFERRED_KHR) {
        result = VK_SUCCESS;
    }
    gpu.vk().DestroyDeferredOperationKHR(gpu.device(), operation, nullptr);
    return result;
}

void barrier(VkCommandBuffer commands)
{
    const auto all = vkInit<VkMemoryBarrier>({.srcAccessMask = VK_ACCESS_MEMORY_READ_BIT | VK_ACCESS_MEMORY_WRITE_BIT,
                                              .dstAccessMask = VK_ACCESS_MEMORY_READ_BIT | VK_ACCESS_MEMORY_WRITE_BIT});
    vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT,
                         VK_PIPELINE_STAGE_ALL_COMMANDS_BIT | VK_PIPELINE_STAGE_HOST_BIT, 0, 1, &all, 0, nullptr, 0,
                         nullptr);
}

Device::Device(InstanceOptions instance, DeviceOptions options)
    : Device(std::make_unique<Instance>(std::move(instance)), std::move(options))
{
}

Device::Device(std::unique_ptr<Instance> instance, DeviceOptions options) : Device(*instance, std::move(options))
{
    ownInstance_ = std::move(instance);
}

Device::Device(const DeviceInfo &info, std::optional<Api> api)
    : Device(*info.instance, {.physicalDevice = info.number,
                              .api = api.value_or(Api::Khr),
                              .micromaps = api.has_value(),
                              .hostCommands = false,
                              .fewFeatures = true,
                              .declaresMode = false,
                              .addressReplay = false,
                              .allQueueFamilies = false,
                              .memory = Memory::DeviceLocal})
{
}

Device::Device(const Instance &instance, DeviceOptions options) : instance_(instance), options_(std::move(options))
{
    createDevice();
    deviceMemory_ = std::make_unique<MemoryPool>(device_);
    if (options_.memory == Memory::Packed || options_.memory == Memory::PackedToTheEnd)
        arena_ = std::make_unique<Arena>(*this);
}

Device::~Device()
{
    twin_.reset();
    if (device_ == VK_NULL_HANDLE)
        return;
    vkDeviceWaitIdle(device_);
    kept_.clear();
    arena_.reset();
    deviceMemory_.reset();
    for (const VkPrivateDataSlot slot : privateData_)
        if (slot != VK_NULL_HANDLE)
            commands_.DestroyPrivateDataSlot(device_, slot, nullptr);
    vkDestroyCommandPool(device_, pool_, nullptr);
    vkDestroyDevice(device_, nullptr);
}

Device &Device::twin()
{
    if (!twin_) {
        DeviceOptions options = options_;
        options.memory = Memory::Apart;
        twin_ = std::make_unique<Device>(instance_.options(), std::move(options));
    }
    return *twin_;
}

void Device::keepPrivateData(VkObjectType type, uint64_t handle)
{
    for (size_t i = 0; i < privateData_.size(); ++i) {
        if (privateData_[i] == VK_NULL_HANDLE)
            continue;
        uint64_t before = 1;
        commands_.GetPrivateData(device_, type, handle, privateData_[i], &before);
        if (before != 0)
            fault("vkGetPrivateData: a new object has a value that is not 0");
        CHECK_VK(commands_.SetPrivateData(device_, type, handle, privateData_[i], privateValue(handle, i)));
    }
}

void Device::expectPrivateData(VkObjectType type, uint64_t handle)
{
    for (size_t i = 0; i < privateData_.size(); ++i) {
        uint64_t value = privateValue(handle, i);
        if (privateData_[i] != VK_NULL_HANDLE)
            commands_.GetPrivateData(device_, type, handle, privateData_[i], &value);
        if (value != privateValue(handle, i))
            fault("vkGetPrivateData: a value other than that which was set");
    }
}

void Device::fault(const std::string &what)
{
    if (options_.onFault)
        return options_.onFault(what);
    const std::lock_guard lock(faultsMutex_);
    faults_.push_back(what);
}

std::vector<std::string> Device::takeFaults()
{
    const std::lock_guard lock(faultsMutex_);
    return std::exchange(faults_, {});
}

void Device::createDevice()
{
#define CHECK_LOAD(name)                                                                                               \
    commands_.name = reinterpret_cast<PFN_vk##name>(vkGetInstanceProcAddr(instance_.handle(), "vk" #name));
    CHECK_INSTANCE_COMMANDS(CHECK_LOAD)
#undef CHECK_LOAD
    uint32_t count = 0;
    CHECK_VK(vkEnumeratePhysicalDevices(instance_.handle(), &count, nullptr));
    std::vector<VkPhysicalDevice> all(count);
    CHECK_VK(vkEnumeratePhysicalDevices(instance_.handle(), &count, all.data()));
    if (options_.physicalDevice >= count)
        throw std::runtime_error("no Vulkan device");
    physical_ = all[options_.physicalDevice];

    count = 0;
    CHECK_VK(vkEnumerateDeviceExtensionProperties(physical_, nullptr, &count, nullptr));
    std::vector<VkExtensionProperties> present(count);
    CHECK_VK(vkEnumerateDeviceExtensionProperties(physical_, nullptr, &count, present.data()));
    const auto add = [&](const char *name) {
        for (const VkExtensionProperties &p : present) {
            if (std::strcmp(p.extensionName, name) == 0 && !has(name))
                extensions_.emplace_back(name);
        }
    };
    for (const char *name : kWantedExtensions)
        add(name);
    if (instance_.options().apiVersion < VK_API_VERSION_1_2)
        std::ranges::for_each(kExtensionsOfVulkan11, add);
    if (options_.micromaps && (options_.api == Api::Ext || options_.bothApis))
        extensions_.emplace_back(VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME);
    if (options_.micromaps && (options_.api == Api::Khr || options_.bothApis)) {
        extensions_.emplace_back(VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME);
        extensions_.emplace_back(VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME);
    }
    for (const std::string &name : options_.extensions)
        add(name.c_str());

    auto features = vkInit<VkPhysicalDeviceFeatures2>();
    void **tail = &features.pNext;
    const auto chain = [&tail](auto &structure) {
        *tail = &structure;
        tail = &structure.pNext;
    };
    const auto chainFor = [&](const char *extension, auto &structure) {
        if (has(extension))
            chain(structure);
    };
    auto vulkan11 = vkInit<VkPhysicalDeviceVulkan11Features>();
    auto vulkan12 = vkInit<VkPhysicalDeviceVulkan12Features>();
    auto vulkan13 = vkInit<VkPhysicalDeviceVulkan13Features>();
    auto structures = vkInit<VkPhysicalDeviceAccelerationStructureFeaturesKHR>();
    auto queries = vkInit<VkPhysicalDeviceRayQueryFeaturesKHR>();
    auto pipelines = vkInit<VkPhysicalDeviceRayTracingPipelineFeaturesKHR>();
    auto conditional = vkInit<VkPhysicalDeviceConditionalRenderingFeaturesEXT>();
    auto libraries = vkInit<VkPhysicalDeviceGraphicsPipelineLibraryFeaturesEXT>();
    auto smallIndices = vkInit<VkPhysicalDeviceIndexTypeUint8FeaturesEXT>();
    auto micromaps = vkInit<VkPhysicalDeviceOpacityMicromapFeaturesEXT>();
    auto micromapsKhr = vkInit<VkPhysicalDeviceOpacityMicromapFeaturesKHR>();
    auto addressCommands = vkInit<VkPhysicalDeviceDeviceAddressCommandsFeaturesKHR>();
    auto maintenance = vkInit<VkPhysicalDeviceRayTracingMaintenance1FeaturesKHR>();
    auto mesh = vkInit<VkPhysicalDeviceMeshShaderFeaturesEXT>();
    auto feedback = vkInit<VkPhysicalDeviceTransformFeedbackFeaturesEXT>();
    auto robustness = vkInit<VkPhysicalDeviceRobustness2FeaturesEXT>();
    auto executables = vkInit<VkPhysicalDevicePipelineExecutablePropertiesFeaturesKHR>();
    std::array<SomeFeatures, kNewerExtensions.size()> newer{};
    auto addresses = vkInit<VkPhysicalDeviceBufferDeviceAddressFeatures>();
    auto scalarLayout = vkInit<VkPhysicalDeviceScalarBlockLayoutFeatures>();
    auto synchronization = vkInit<VkPhysicalDeviceSynchronization2Features>();
    if (instance_.options().apiVersion < VK_API_VERSION_1_2) {
        chain(addresses);
        chain(scalarLayout);
        chain(synchronization);
    } else {
        chain(vulkan11);
        chain(vulkan12);
        chain(vulkan13);
    }
    chain(structures);
    chainFor(VK_KHR_RAY_QUERY_EXTENSION_NAME, queries);
    chainFor(VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME, pipelines);
    chainFor(VK_EXT_CONDITIONAL_RENDERING_EXTENSION_NAME, conditional);
    chainFor(VK_EXT_GRAPHICS_PIPELINE_LIBRARY_EXTENSION_NAME, libraries);
    chainFor(VK_EXT_INDEX_TYPE_UINT8_EXTENSION_NAME, smallIndices);
    chainFor(VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME, micromaps);
    chainFor(VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME, micromapsKhr);
    chainFor(VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME, addressCommands);
    chainFor(VK_EXT_MESH_SHADER_EXTENSION_NAME, mesh);
    chainFor(VK_EXT_TRANSFORM_FEEDBACK_EXTENSION_NAME, feedback);
    chainFor(VK_EXT_ROBUSTNESS_2_EXTENSION_NAME, robustness);
    chainFor(VK_KHR_PIPELINE_EXECUTABLE_PROPERTIES_EXTENSION_NAME, executables);
    chainFor(VK_KHR_RAY_TRACING_MAINTENANCE_1_EXTENSION_NAME, maintenance);
    for (size_t i = 0; i < newer.size(); ++i) {
        newer[i].sType = static_cast<VkStructureType>(kNewerExtensions[i].features);
        chainFor(kNewerExtensions[i].name, newer[i]);
    }
    vkGetPhysicalDeviceFeatures2(physical_, &features);
    vulkan12.bufferDeviceAddressCaptureReplay &= VkBool32{options_.addressReplay};
    if (!options_.micromapFeature)
        micromaps.micromap = micromapsKhr.micromap = VK_FALSE;
    features.features.robustBufferAccess = VK_FALSE;
    robustness.robustBufferAccess2 = VK_FALSE;
    mesh.multiviewMeshShader = mesh.primitiveFragmentShadingRateMeshShader =
        VK_FALSE; // need features that are not enabled
    if (options_.fewFeatures)
        structures.accelerationStructureCaptureReplay = robustness.nullDescriptor = smallIndices.indexTypeUint8 =
            vulkan12.drawIndirectCount = vulkan13.synchronization2 = synchronization.synchronization2 = VK_FALSE;
    if (!options_.hostCommands)
        micromaps.micromapHostCommands = VK_FALSE;

    uint32_t families = 0;
    vkGetPhysicalDeviceQueueFamilyProperties(physical_, &families, nullptr);
    families_.resize(families);
    vkGetPhysicalDeviceQueueFamilyProperties(physical_, &families, families_.data());
    const auto firstWith = [this](VkQueueFlags flags) {
        return std::ranges::find_if(families_, [flags](const auto &f) { return (f.queueFlags & flags) == flags; });
    };
    auto family = firstWith(VK_QUEUE_GRAPHICS_BIT | VK_QUEUE_COMPUTE_BIT);
    if (family == families_.end())
        family = firstWith(VK_QUEUE_COMPUTE_BIT);
    if (family == families_.end())
        throw std::runtime_error("the device has no queue for compute shaders");
    family_ = static_cast<uint32_t>(family - families_.begin());
    constexpr std::array<float, 4> priorities{1, 1, 1, 1};
    std::vector<VkDeviceQueueCreateInfo> queues(families);
    for (uint32_t i = 0; i < families; ++i) {
        queues[i] = vkInit<VkDeviceQueueCreateInfo>(
            {.queueFamilyIndex = i,
             .queueCount = i == family_ ? std::min<uint32_t>(families_[i].queueCount, priorities.size()) : 1u,
             .pQueuePriorities = priorities.data()});
    }
    if (!options_.allQueueFamilies)
        queues = {queues[family_]};
    std::vector<const char *> names;
    for (const std::string &name : extensions_)
        names.push_back(name.c_str());
    auto info = vkInit<VkDeviceCreateInfo>({.pNext = &features,
                                            .queueCreateInfoCount = static_cast<uint32_t>(queues.size()),
                                            .pQueueCreateInfos = queues.data(),
                                            .enabledExtensionCount = static_cast<uint32_t>(names.size()),
                                            .ppEnabledExtensionNames = names.data()});
    CHECK_VK(vkCreateDevice(physical_, &info, nullptr, &device_));
#define CHECK_LOAD(name) commands_.name = reinterpret_cast<PFN_vk##name>(vkGetDeviceProcAddr(device_, "vk" #name));
    CHECK_DEVICE_COMMANDS(CHECK_LOAD)
#undef CHECK_LOAD

    const uint32_t ownQueues = std::min<uint32_t>(families_[family_].queueCount, priorities.size());
    for (uint32_t i = 0; i < ownQueues; ++i)
        vkGetDeviceQueue(device_, family_, i, &queues_.emplace_back());
    queue_ = queues_[0];
    auto pool = vkInit<VkCommandPoolCreateInfo>(
        {.flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT, .queueFamilyIndex = family_});
    CHECK_VK(vkCreateCommandPool(device_, &pool, nullptr, &pool_));
    const auto slot = vkInit<VkPrivateDataSlotCreateInfo>();
    for (size_t i = 0; options_.privateData && vulkan13.privateData != VK_FALSE && i < privateData_.size(); ++i)
        CHECK_VK(commands_.CreatePrivateDataSlot(device_, &slot, nullptr, &privateData_[i]));

    auto limits = vkInit<VkPhysicalDeviceAccelerationStructurePropertiesKHR>();
    pipelineProperties_ = vkInit<VkPhysicalDeviceRayTracingPipelinePropertiesKHR>();
    limits.pNext = &pipelineProperties_;
    driver_ = vkInit<VkPhysicalDeviceDriverProperties>();
    pipelineProperties_.pNext = &driver_;
    auto micromapLimits = vkInit<VkPhysicalDeviceOpacityMicromapPropertiesEXT>();
    auto micromapLimitsKhr = vkInit<VkPhysicalDeviceOpacityMicromapPropertiesKHR>();
    if (has(VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME)) {
        driver_.pNext = &micromapLimitsKhr;
        if (has(VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME))
            micromapLimitsKhr.pNext = &micromapLimits;
    } else if (has(VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME)) {
        driver_.pNext = &micromapLimits;
    }
    auto properties = vkInit<VkPhysicalDeviceProperties2>({.pNext = &limits});
    vkGetPhysicalDeviceProperties2(physical_, &properties);
    pipelineProperties_.pNext = nullptr;
    driver_.pNext = nullptr;
    limits_ = properties.properties.limits;
    // On a CPU driver, device timestamps are the host's clock.
    timestamps_ =
        families_[family_].timestampValidBits != 0 && properties.properties.deviceType != VK_PHYSICAL_DEVICE_TYPE_CPU;
    scratchAlignment_ = std::max(limits.minAccelerationStructureScratchOffsetAlignment, 1u);
    knownFaults_ =
        gpu::knownFaults(physical_, options_.micromaps && instance_.options().apiVersion >= VK_API_VERSION_1_3);
    lavapipe26_ = isLavapipe26(physical_);
    maxGeometries_ = limits.maxGeometryCount;
    maxPrimitives_ = limits.maxPrimitiveCount;
    maxInstances_ = limits.maxInstanceCount;
    if (khr() && has(VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME))
        maxMicromapTriangles_ = micromapLimitsKhr.maxMicromapTriangles;
    if (khr())
        maxLevels_ = {micromapLimitsKhr.maxOpacity2StateSubdivisionLevel,
                      micromapLimitsKhr.maxOpacity4StateSubdivisionLevel,
                      micromapLimitsKhr.maxOpacityLossy4StateSubdivisionLevel};
    else
        maxLevels_ = {micromapLimits.maxOpacity2StateSubdivisionLevel, micromapLimits.maxOpacity4StateSubdivisionLevel,
                      0};
    indirectBuilds_ = structures.accelerationStructureIndirectBuild != VK_FALSE;
    micromapHostCommands_ = micromaps.micromapHostCommands != VK_FALSE;
    variableTextureIndices_ = vulkan12.shaderSampledImageArrayNonUniformIndexing != VK_FALSE;
    hostQueryReset_ = vulkan12.hostQueryReset != VK_FALSE;
    countedDraws_ = vulkan12.drawIndirectCount != VK_FALSE && limits_.maxDrawIndirectCount >= LaunchPlan::kMostDraws;
    synchronization2_ = vulkan13.synchronization2 != VK_FALSE;
    indirectTraces_ = {pipelines.rayTracingPipelineTraceRaysIndirect != VK_FALSE,
                       maintenance.rayTracingPipelineTraceRaysIndirect2 != VK_FALSE};
    primitiveCulling_ = pipelines.rayTraversalPrimitiveCulling != VK_FALSE;
}

VkQueue Device::queueOf(uint32_t family) const
{
    VkQueue queue = VK_NULL_HANDLE;
    vkGetDeviceQueue(device_, family, 0, &queue);
    return queue;
}

bool Device::has(const char *deviceExtension) const
{
    return std::find(extensions_.begin(), extensions_.end(), deviceExtension) != extensions_.end();
}

VkCommandBuffer Device::begin(VkCommandBufferUsageFlags usage, VkCommandBufferLevel level)
{
    auto allocation =
        vkInit<VkCommandBufferAllocateInfo>({.commandPool = pool_, .level = level, .commandBufferCount = 1});
    VkCommandBuffer commands = VK_NULL_HANDLE;
    CHECK_VK(vkAllocateCommandBuffers(device_, &allocation, &commands));
    beginAgain(commands, usage);
    return commands;
}

void Device::beginAgain(VkCommandBuffer commands, VkCommandBufferUsageFlags usage)
{
    auto info = vkInit<VkCommandBufferBeginInfo>({.flags = usage});
    auto inheritance = vkInit<VkCommandBufferInheritanceInfo>();
    info.pInheritanceInfo = &inheritance; // ignored for primary ones
    CHECK_VK(vkBeginCommandBuffer(commands, &info));
}

void Device::end(VkCommandBuffer commands)
{
    CHECK_VK(vkEndCommandBuffer(commands));
}

void Device::execute(VkCommandBuffer commands)
{
    std::vector<VkCommandBuffer> all = std::exchange(before_, {});
    all.push_back(commands);
    auto submission =
        vkInit<VkSubmitInfo>({.commandBufferCount = static_cast<uint32_t>(all.size()), .pCommandBuffers = all.data()});
    CHECK_VK(vkQueueSubmit(queue_, 1, &submission, VK_NULL_HANDLE));
    CHECK_VK(vkQueueWaitIdle(queue_));
    all.pop_back();
    if (!all.empty())
        vkFreeCommandBuffers(device_, pool_, static_cast<uint32_t>(all.size()), all.data());
}

void Device::submit(const std::function<void(VkCommandBuffer)> &record, const Submission &submission)
{
    const Preceding own{device_, pool_, before_};
    const VkCommandBufferUsageFlags usage =
        submission.times == 1 ? VkCommandBufferUsageFlags{VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT} : 0;
    const auto recordInto = [&](VkCommandBuffer to) {
        record(to);
        if (submission.rerecorded) {
            end(to);
            beginAgain(to, usage);
            record(to);
        }
    };
    VkCommandBuffer commands = begin(usage), inner = VK_NULL_HANDLE;
    if (submission.secondary) {
        inner = begin(usage, VK_COMMAND_BUFFER_LEVEL_SECONDARY);
        recordInto(inner);
        end(inner);
        vkCmdExecuteCommands(commands, 1, &inner);
    } else {
        recordInto(commands);
    }
    end(commands);
    for (uint32_t i = 0; i < submission.times; ++i)
        execute(commands);
    vkFreeCommandBuffers(device_, pool_, 1, &commands);
    if (submission.secondary)
        vkFreeCommandBuffers(device_, pool_, 1, &inner);
}

void Device::insertLabel(const std::string &text) const
{
    const auto label = vkInit<VkDebugUtilsLabelEXT>({.pLabelName = text.c_str()});
    if (commands_.QueueInsertDebugUtilsLabelEXT != nullptr)
        commands_.QueueInsertDebugUtilsLabelEXT(queue_, &label);
}

std::vector<uint32_t> Device::code(std::span<const uint32_t> words) const
{
    return khr() && options_.declaresMode ? withModeWhereNeeded(words)
                                          : std::vector<uint32_t>(words.begin(), words.end());
}

std::vector<VkFormat> Device::vertexFormats() const
{
    std::vector<VkFormat> formats;
    for (const VkFormat format : kVertexFormats) {
        VkFormatProperties properties{};
        vkGetPhysicalDeviceFormatProperties(physical_, format, &properties);
        if ((properties.bufferFeatures & VK_FORMAT_FEATURE_ACCELERATION_STRUCTURE_VERTEX_BUFFER_BIT_KHR) != 0)
            formats.push_back(format);
    }
    return formats;
}

VkShaderModule Device::shader(std::span<const uint32_t> original) const
{
    const std::vector<uint32_t> words = code(original);
    auto info = vkInit<VkShaderModuleCreateInfo>({.codeSize = words.size() * sizeof(uint32_t), .pCode = words.data()});
    VkShaderModule module = VK_NULL_HANDLE;
    CHECK_VK(vkCreateShaderModule(device_, &info, nullptr, &module));
    return module;
}

} // namespace vellum::gpu
