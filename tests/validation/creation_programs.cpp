// SPDX-License-Identifier: Apache-2.0
// Wrong creations and destructions of micromaps, and use without the feature.
#include "recorded.h"

namespace vt
{
namespace
{

constexpr VkAllocationCallbacks kCallbacks{
    .pUserData = nullptr,
    .pfnAllocation = [](void *, size_t size, size_t alignment, VkSystemAllocationScope) -> void * {
        return alignment <= alignof(std::max_align_t) ? std::malloc(size) : nullptr;
    },
    .pfnReallocation = [](void *, void *old, size_t size, size_t, VkSystemAllocationScope) -> void * {
        return std::realloc(old, size);
    },
    .pfnFree = [](void *, void *memory) { std::free(memory); },
    .pfnInternalAllocation = nullptr,
    .pfnInternalFree = nullptr,
};

// --- VK_EXT_opacity_micromap ---

template <auto change>
void extCreation(Gpu &gpu, bool wrong)
{
    const Buffer right(gpu, 65536, micromapStorageUsage(gpu));
    const Buffer other(gpu, 65536, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    auto info = vkInit<VkMicromapCreateInfoEXT>(
        {.buffer = right.handle(), .size = 4096, .type = VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT});
    if (wrong)
        change(info, other.handle());
    VkMicromapEXT micromap = VK_NULL_HANDLE;
    if (gpu.vk().CreateMicromapEXT(gpu.device(), &info, nullptr, &micromap) == VK_SUCCESS)
        gpu.vk().DestroyMicromapEXT(gpu.device(), micromap, nullptr);
}

template <bool createdWith>
void extAllocator(Gpu &gpu, bool wrong)
{
    const Buffer buffer(gpu, 65536, micromapStorageUsage(gpu));
    auto info = vkInit<VkMicromapCreateInfoEXT>(
        {.buffer = buffer.handle(), .size = 4096, .type = VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT});
    const VkAllocationCallbacks *given = createdWith ? &kCallbacks : nullptr;
    const VkAllocationCallbacks *other = createdWith ? nullptr : &kCallbacks;
    VkMicromapEXT micromap = VK_NULL_HANDLE;
    VT_CHECK(gpu.vk().CreateMicromapEXT(gpu.device(), &info, given, &micromap));
    gpu.vk().DestroyMicromapEXT(gpu.device(), micromap, wrong ? other : given);
}

void structureAllocator(Gpu &gpu, bool wrong, bool createdWith)
{
    const Buffer buffer(gpu, 65536, micromapStorageUsage(gpu));
    const auto info = vkInit<VkAccelerationStructureCreateInfoKHR>(
        {.buffer = buffer.handle(), .size = 4096, .type = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR});
    VkAccelerationStructureKHR structure = VK_NULL_HANDLE;
    VT_CHECK(
        gpu.vk().CreateAccelerationStructureKHR(gpu.device(), &info, createdWith ? &kCallbacks : nullptr, &structure));
    gpu.vk().DestroyAccelerationStructureKHR(gpu.device(), structure, createdWith != wrong ? &kCallbacks : nullptr);
}
void withAllocator(Gpu &gpu, bool wrong)
{
    structureAllocator(gpu, wrong, true);
}
void withoutAllocator(Gpu &gpu, bool wrong)
{
    structureAllocator(gpu, wrong, false);
}

// Sparse buffers need no memory before they are used.
void sparse(Gpu &gpu, bool wrong)
{
    const auto info =
        vkInit<VkBufferCreateInfo>({.flags = VK_BUFFER_CREATE_SPARSE_BINDING_BIT |
                                             (wrong ? VkBufferCreateFlags{VK_BUFFER_CREATE_SPARSE_RESIDENCY_BIT} : 0),
                                    .size = 65536,
                                    .usage = micromapStorageUsage(gpu)});
    VkBuffer buffer = VK_NULL_HANDLE;
    VT_CHECK(vkCreateBuffer(gpu.device(), &info, nullptr, &buffer));
    destroyMicromap(gpu, createMicromap(gpu, buffer, gpu.khr() ? gpu.address(buffer) : 0, 0, 4096));
    vkDestroyBuffer(gpu.device(), buffer, nullptr);
}

// Without the feature there is no valid program.
void createdWithoutFeature(Gpu &gpu, bool wrong)
{
    const Buffer buffer(gpu, 65536, micromapStorageUsage(gpu));
    if (wrong)
        destroyMicromap(gpu, createMicromap(gpu, buffer.handle(), buffer.address(), 0, 4096));
}

void micromapDestroyedTwice(Gpu &gpu, bool wrong)
{
    const Buffer buffer(gpu, 65536, micromapStorageUsage(gpu));
    const auto info = vkInit<VkMicromapCreateInfoEXT>(
        {.buffer = buffer.handle(), .size = 4096, .type = VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT});
    VkMicromapEXT micromap = VK_NULL_HANDLE;
    VT_CHECK(gpu.vk().CreateMicromapEXT(gpu.device(), &info, nullptr, &micromap));
    for (int i = 0; i < (wrong ? 2 : 1); ++i)
        gpu.vk().DestroyMicromapEXT(gpu.device(), micromap, nullptr);
}

void structureDestroyedTwice(Gpu &gpu, bool wrong)
{
    const Buffer buffer(gpu, 65536, micromapStorageUsage(gpu));
    const auto info = vkInit<VkAccelerationStructureCreateInfoKHR>(
        {.buffer = buffer.handle(), .size = 4096, .type = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR});
    VkAccelerationStructureKHR structure = VK_NULL_HANDLE;
    VT_CHECK(gpu.vk().CreateAccelerationStructureKHR(gpu.device(), &info, nullptr, &structure));
    for (int i = 0; i < (wrong ? 2 : 1); ++i)
        gpu.vk().DestroyAccelerationStructureKHR(gpu.device(), structure, nullptr);
}

void destroyedWithoutFeature(Gpu &gpu, bool wrong)
{
    if (wrong)
        gpu.vk().DestroyMicromapEXT(gpu.device(), VK_NULL_HANDLE, nullptr);
}

void sizesWithoutFeature(Gpu &gpu, bool wrong)
{
    if (!wrong)
        return;
    auto info = vkInit<VkMicromapBuildInfoEXT>({.type = VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT});
    auto sizes = vkInit<VkMicromapBuildSizesInfoEXT>();
    gpu.vk().GetMicromapBuildSizesEXT(gpu.device(), VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &info, &sizes);
}

void versionWithoutFeature(Gpu &gpu, bool wrong)
{
    if (!wrong)
        return;
    const std::array<uint8_t, 2 * VK_UUID_SIZE> version{};
    micromapIsCompatible(gpu, version.data());
}

void buildWithoutFeature(Gpu &gpu, bool wrong)
{
    if (wrong)
        recordUnlessWrong(gpu, wrong,
                          [&](VkCommandBuffer commands) { gpu.vk().CmdBuildMicromapsEXT(commands, 0, nullptr); });
}

// --- VK_KHR_opacity_micromap ---

template <auto change>
void khrCreation(Gpu &gpu, bool wrong)
{
    const Guarded right(gpu, 4096, 256, micromapStorageUsage(gpu));
    const Guarded other(gpu, 4096, 256, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    auto info =
        vkInit<VkAccelerationStructureCreateInfo2KHR>({.addressRange = {right.address(), 2048},
                                                       .addressFlags = kUnknownUsage,
                                                       .type = VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR});
    if (wrong)
        change(info, other.address());
    VkAccelerationStructureKHR structure = VK_NULL_HANDLE;
    if (gpu.vk().CreateAccelerationStructure2KHR(gpu.device(), &info, nullptr, &structure) == VK_SUCCESS)
        gpu.vk().DestroyAccelerationStructureKHR(gpu.device(), structure, nullptr);
}

// Flags for capture and replay of addresses, on the buffer and on the structure.
struct Replays {
    bool buffer, structure;
};

template <Replays change>
void replays(Gpu &gpu, bool wrong)
{
    const auto info = vkInit<VkBufferCreateInfo>(
        {.flags = wrong && change.buffer ? VkBufferCreateFlags{VK_BUFFER_CREATE_DEVICE_ADDRESS_CAPTURE_REPLAY_BIT} : 0,
         .size = 65536,
         .usage = micromapStorageUsage(gpu)});
    VkBuffer buffer = VK_NULL_HANDLE;
    VT_CHECK(vkCreateBuffer(gpu.device(), &info, nullptr, &buffer));
    const VkDeviceMemory memory = gpu.bindMemory(buffer);
    auto creation =
        vkInit<VkAccelerationStructureCreateInfo2KHR>({.addressRange = {gpu.address(buffer), 2048},
                                                       .addressFlags = kUnknownUsage,
                                                       .type = VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR});
    if (wrong && change.structure)
        creation.createFlags = VK_ACCELERATION_STRUCTURE_CREATE_DEVICE_ADDRESS_CAPTURE_REPLAY_BIT_KHR;
    VkAccelerationStructureKHR structure = VK_NULL_HANDLE;
    if (gpu.vk().CreateAccelerationStructure2KHR(gpu.device(), &creation, nullptr, &structure) == VK_SUCCESS)
        gpu.vk().DestroyAccelerationStructureKHR(gpu.device(), structure, nullptr);
    vkDestroyBuffer(gpu.device(), buffer, nullptr);
    vkFreeMemory(gpu.device(), memory, nullptr);
}

// A device of a group of two physical devices; lavapipe does not look at the group.
class GroupDevice
{
public:
    explicit GroupDevice(const Gpu &gpu)
    {
        const std::array<VkPhysicalDevice, 2> physical{gpu.physical(), gpu.physical()};
        auto group =
            vkInit<VkDeviceGroupDeviceCreateInfo>({.physicalDeviceCount = 2, .pPhysicalDevices = physical.data()});
        auto vulkan12 = vkInit<VkPhysicalDeviceVulkan12Features>({.pNext = &group, .bufferDeviceAddress = VK_TRUE});
        auto structures = vkInit<VkPhysicalDeviceAccelerationStructureFeaturesKHR>(
            {.pNext = &vulkan12, .accelerationStructure = VK_TRUE});
        auto micromaps =
            vkInit<VkPhysicalDeviceOpacityMicromapFeaturesKHR>({.pNext = &structures, .micromap = VK_TRUE});
        const auto addresses = vkInit<VkPhysicalDeviceDeviceAddressCommandsFeaturesKHR>(
            {.pNext = &micromaps, .deviceAddressCommands = VK_TRUE});
        const float priority = 1;
        const auto queue = vkInit<VkDeviceQueueCreateInfo>(
            {.queueFamilyIndex = gpu.family(), .queueCount = 1, .pQueuePriorities = &priority});
        constexpr std::array<const char *, 4> kExtensions{
            VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME, VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME,
            VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME, VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME};
        const auto info = vkInit<VkDeviceCreateInfo>({.pNext = &addresses,
                                                      .queueCreateInfoCount = 1,
                                                      .pQueueCreateInfos = &queue,
                                                      .enabledExtensionCount = kExtensions.size(),
                                                      .ppEnabledExtensionNames = kExtensions.data()});
        // The layer's own micromaps are not available there.
        if (const VkResult result = vkCreateDevice(gpu.physical(), &info, nullptr, &handle);
            result != VK_ERROR_FEATURE_NOT_PRESENT)
            VT_CHECK(result);
    }
    GroupDevice(const GroupDevice &) = delete;
    GroupDevice &operator=(const GroupDevice &) = delete;
    ~GroupDevice() { vkDestroyDevice(handle, nullptr); }
    VkDevice handle = VK_NULL_HANDLE;
};

// The address is in no buffer, so there is no valid program.
void replayOfGroup(Gpu &gpu, bool wrong)
{
    const GroupDevice device(gpu);
    if (device.handle == VK_NULL_HANDLE) {
        gpu.takeMessages();
        GTEST_SKIP() << "a driver's own micromaps only";
    }
    const auto info = vkInit<VkAccelerationStructureCreateInfo2KHR>(
        {.createFlags = wrong ? VkFlags{VK_ACCELERATION_STRUCTURE_CREATE_DEVICE_ADDRESS_CAPTURE_REPLAY_BIT_KHR} : 0,
         .addressRange = {65536, 2048},
         .addressFlags = kUnknownUsage,
         .type = VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR});
    const auto create = reinterpret_cast<PFN_vkCreateAccelerationStructure2KHR>(
        vkGetDeviceProcAddr(device.handle, "vkCreateAccelerationStructure2KHR"));
    const auto destroy = reinterpret_cast<PFN_vkDestroyAccelerationStructureKHR>(
        vkGetDeviceProcAddr(device.handle, "vkDestroyAccelerationStructureKHR"));
    VkAccelerationStructureKHR structure = VK_NULL_HANDLE;
    if (wrong && create(device.handle, &info, nullptr, &structure) == VK_SUCCESS)
        destroy(device.handle, structure, nullptr);
}

void oldCreation(Gpu &gpu, bool wrong)
{
    const Buffer buffer(gpu, 65536, micromapStorageUsage(gpu));
    auto info = vkInit<VkAccelerationStructureCreateInfoKHR>(
        {.buffer = buffer.handle(),
         .size = 4096,
         .type = wrong ? VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR
                       : VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR});
    VkAccelerationStructureKHR structure = VK_NULL_HANDLE;
    if (gpu.vk().CreateAccelerationStructureKHR(gpu.device(), &info, nullptr, &structure) == VK_SUCCESS)
        gpu.vk().DestroyAccelerationStructureKHR(gpu.device(), structure, nullptr);
}

void creationWithoutFeature(Gpu &gpu, bool wrong)
{
    const Guarded memory(gpu, 4096, 256, micromapStorageUsage(gpu));
    auto info = vkInit<VkAccelerationStructureCreateInfo2KHR>(
        {.addressRange = {memory.address(), 2048},
         .addressFlags = kUnknownUsage,
         .type = wrong ? VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR
                       : VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR});
    VkAccelerationStructureKHR structure = VK_NULL_HANDLE;
    if (gpu.vk().CreateAccelerationStructure2KHR(gpu.device(), &info, nullptr, &structure) == VK_SUCCESS)
        gpu.vk().DestroyAccelerationStructureKHR(gpu.device(), structure, nullptr);
}

#define EXT_CHANGE(...) [](VkMicromapCreateInfoEXT &info, [[maybe_unused]] VkBuffer other) { __VA_ARGS__; }
#define KHR_CHANGE(...)                                                                                                \
    [](VkAccelerationStructureCreateInfo2KHR &info, [[maybe_unused]] VkDeviceAddress other) { __VA_ARGS__; }

const WrongProgram kPrograms[] = {
    {"VUID-VkMicromapCreateInfoEXT-deviceAddress-07433", Api::Ext, kNeedsNothing,
     extCreation<EXT_CHANGE(info.deviceAddress = 65536)>},
    {"VUID-VkMicromapCreateInfoEXT-createFlags-parameter", Api::Ext, kNeedsNothing,
     extCreation<EXT_CHANGE(info.createFlags = 0x100)>},
    {"VUID-VkMicromapCreateInfoEXT-buffer-parameter", Api::Ext, kNeedsEmulation,
     extCreation<EXT_CHANGE(info.buffer = VK_NULL_HANDLE)>},
    {"VUID-VkMicromapCreateInfoEXT-buffer-07435", Api::Ext, kNeedsNothing,
     extCreation<EXT_CHANGE(info.buffer = other)>},
    {"VUID-VkMicromapCreateInfoEXT-offset-07437", Api::Ext, kNeedsNothing,
     extCreation<EXT_CHANGE(info.offset = 65536)>},
    {"VUID-VkMicromapCreateInfoEXT-offset-07438", Api::Ext, kNeedsNothing, extCreation<EXT_CHANGE(info.offset = 128)>},
    {"VUID-VkMicromapCreateInfoEXT-micromapCaptureReplay-11616", Api::Ext, kNeedsNothing,
     extCreation<EXT_CHANGE(info.createFlags = VK_MICROMAP_CREATE_DEVICE_ADDRESS_CAPTURE_REPLAY_BIT_EXT)>},
    {"VUID-vkDestroyMicromapEXT-micromap-07442", Api::Ext, kNeedsNothing, extAllocator<true>},
    {"VUID-vkDestroyMicromapEXT-micromap-07443", Api::Ext, kNeedsNothing, extAllocator<false>},
    {"VUID-vkDestroyMicromapEXT-micromap-parameter", Api::Ext, kNeedsNothing, micromapDestroyedTwice},
    {"VUID-VkMicromapCreateInfoEXT-buffer-07436", Api::Ext, kNeedsNothing, sparse},
    {"VUID-vkCreateMicromapEXT-micromap-11615", Api::Ext, kNeedsNoFeature, createdWithoutFeature, "",
     "VUID-vkDestroyMicromapEXT-micromap-11619"},
    {"VUID-vkDestroyMicromapEXT-micromap-11619", Api::Ext, kNeedsNoFeature, destroyedWithoutFeature},
    {"VUID-vkGetMicromapBuildSizesEXT-micromap-11618", Api::Ext, kNeedsNoFeature, sizesWithoutFeature},
    {"VUID-vkGetDeviceMicromapCompatibilityEXT-micromap-11666", Api::Ext, kNeedsNoFeature, versionWithoutFeature},
    {"VUID-vkCmdBuildMicromapsEXT-micromap-11648", Api::Ext, kNeedsNoFeature, buildWithoutFeature, "",
     "VUID-vkCmdBuildMicromapsEXT-infoCount-arraylength"},

    {"VUID-VkAccelerationStructureCreateInfoKHR-type-11600", Api::Khr, kNeedsNothing, oldCreation},
    {"VUID-VkAccelerationStructureCreateInfo2KHR-micromap-11609", Api::Khr, kNeedsNoFeature, creationWithoutFeature},
    {"VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11602", Api::Khr, kNeedsNothing,
     khrCreation<KHR_CHANGE(info.addressRange.address = 0)>},
    {"VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11603", Api::Khr, kNeedsNothing,
     khrCreation<KHR_CHANGE(info.addressRange.address = other)>},
    {"VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11605", Api::Khr, kNeedsNothing,
     khrCreation<KHR_CHANGE(info.addressRange.address += 128)>},
    {"VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11608", Api::Khr, kNeedsNothing,
     khrCreation<KHR_CHANGE(info.addressRange.size = 0)>},
    {"VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11604", Api::Khr, kNeedsNothing, sparse},
    {"VUID-vkDestroyAccelerationStructureKHR-accelerationStructure-02443", Api::Khr, kNeedsNothing, withAllocator},
    {"VUID-vkDestroyAccelerationStructureKHR-accelerationStructure-02444", Api::Khr, kNeedsNothing, withoutAllocator},
    {"VUID-vkDestroyAccelerationStructureKHR-accelerationStructure-parameter", Api::Khr, kNeedsNothing,
     structureDestroyedTwice},
    {"VUID-VkAccelerationStructureCreateInfo2KHR-createFlags-11607", Api::Khr, kNeedsFewFeatures,
     khrCreation<KHR_CHANGE(info.createFlags = VK_ACCELERATION_STRUCTURE_CREATE_DEVICE_ADDRESS_CAPTURE_REPLAY_BIT_KHR)>,
     "", "VUID-VkAccelerationStructureCreateInfo2KHR-createFlags-03613"},
    {"VUID-VkAccelerationStructureCreateInfo2KHR-createFlags-11606", Api::Khr, kNeedsNothing,
     replays<Replays{.buffer = true, .structure = false}>},
    {"VUID-VkAccelerationStructureCreateInfo2KHR-createFlags-11673", Api::Khr, kNeedsNothing, replayOfGroup, "",
     "VUID-VkAccelerationStructureCreateInfo2KHR-createFlags-03613", false, nullptr,
     "VELLUM-VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11602"},
    {"VUID-VkAccelerationStructureCreateInfo2KHR-createFlags-03613", Api::Khr, kNeedsFewFeatures,
     replays<Replays{.buffer = true, .structure = true}>},
    {"VUID-VkAccelerationStructureCreateInfo2KHR-createFlags-11610", Api::Khr, kNeedsNothing,
     khrCreation<KHR_CHANGE(info.createFlags =
                                VK_ACCELERATION_STRUCTURE_CREATE_DESCRIPTOR_BUFFER_CAPTURE_REPLAY_BIT_EXT)>},
    {"VUID-VkAccelerationStructureCreateInfo2KHR-createFlags-11611", Api::Khr, kNeedsNothing,
     khrCreation<KHR_CHANGE(info.createFlags = VK_ACCELERATION_STRUCTURE_CREATE_MOTION_BIT_NV)>},
};

#undef EXT_CHANGE
#undef KHR_CHANGE

} // namespace

std::span<const WrongProgram> creationPrograms()
{
    return kPrograms;
}

} // namespace vt
