// SPDX-License-Identifier: Apache-2.0
// A program for `vellum run`. It uses micromaps as its arguments say, in their order.
//   instance creates an instance
//   plain    creates a device without micromaps
//   right    creates a device and queries the sizes of a micromap
//   build    records the build of an acceleration structure without geometry
//   error    queries the sizes of a micromap of a type that does not exist, which the layer rejects
//   warning  allocates memory with flags that the layer tolerates
//   both     does the last two in two other processes
//   crash    writes to address 0
//   words, variables: prints all arguments after this one, or the environment variables that they name
#include <bit>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "vellum/vulkan_opacity_micromap.h"

namespace
{

void check(bool right, const char *what)
{
    if (right)
        return;
    std::fprintf(stderr, "micromap_program: %s\n", what);
    std::exit(1);
}

class Device
{
public:
    enum class With { Nothing, Device, Micromaps };
    explicit Device(With with = With::Micromaps)
    {
        VkApplicationInfo application{VK_STRUCTURE_TYPE_APPLICATION_INFO};
        application.apiVersion = VK_API_VERSION_1_3;
        VkInstanceCreateInfo info{VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO};
        info.pApplicationInfo = &application;
        check(vkCreateInstance(&info, nullptr, &instance_) == VK_SUCCESS, "no instance");
        uint32_t count = 1;
        VkPhysicalDevice physicalDevice = VK_NULL_HANDLE;
        check(vkEnumeratePhysicalDevices(instance_, &count, &physicalDevice) >= VK_SUCCESS && count == 1, "no device");
        if (with != With::Nothing)
            createDevice(physicalDevice, with == With::Micromaps);
    }
    ~Device()
    {
        if (device_ != VK_NULL_HANDLE)
            vkDestroyDevice(device_, nullptr);
        vkDestroyInstance(instance_, nullptr);
    }
    Device(const Device &) = delete;
    Device &operator=(const Device &) = delete;

    [[nodiscard]] VkMicromapBuildSizesInfoEXT sizes(VkMicromapTypeEXT type) const
    {
        const VkMicromapUsageEXT usage{1, 2, VK_OPACITY_MICROMAP_FORMAT_4_STATE_EXT};
        VkMicromapBuildInfoEXT build{VK_STRUCTURE_TYPE_MICROMAP_BUILD_INFO_EXT};
        build.type = type;
        build.usageCountsCount = 1;
        build.pUsageCounts = &usage;
        VkMicromapBuildSizesInfoEXT sizes{VK_STRUCTURE_TYPE_MICROMAP_BUILD_SIZES_INFO_EXT};
        const auto query = reinterpret_cast<PFN_vkGetMicromapBuildSizesEXT>(
            vkGetDeviceProcAddr(device_, "vkGetMicromapBuildSizesEXT"));
        check(query != nullptr, "no vkGetMicromapBuildSizesEXT");
        query(device_, VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &build, &sizes);
        return sizes;
    }
    void allocate() const
    {
        const VkMemoryAllocateFlagsInfo flags{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO};
        const VkBaseInStructure unknown{static_cast<VkStructureType>(0x70000000),
                                        reinterpret_cast<const VkBaseInStructure *>(&flags)};
        const VkMemoryAllocateInfo info{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO, &unknown, 4096, 0};
        VkDeviceMemory memory = VK_NULL_HANDLE;
        check(vkAllocateMemory(device_, &info, nullptr, &memory) == VK_SUCCESS, "no memory");
        vkFreeMemory(device_, memory, nullptr);
    }
    void recordBuild() const
    {
        VkAccelerationStructureBuildGeometryInfoKHR build{
            VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_GEOMETRY_INFO_KHR};
        build.type = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR;
        VkAccelerationStructureBuildSizesInfoKHR sizes{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR};
        function<PFN_vkGetAccelerationStructureBuildSizesKHR>("vkGetAccelerationStructureBuildSizesKHR")(
            device_, VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &build, nullptr, &sizes);
        constexpr VkDeviceSize kHalf = 1 << 16; // of the buffer: the structure, and scratch memory
        check(sizes.accelerationStructureSize <= kHalf && sizes.buildScratchSize <= kHalf, "too large");
        VkBufferCreateInfo buffers{VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO};
        buffers.size = 2 * kHalf;
        buffers.usage = VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT |
                        VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;
        VkBuffer buffer = VK_NULL_HANDLE;
        check(vkCreateBuffer(device_, &buffers, nullptr, &buffer) == VK_SUCCESS, "no buffer");
        VkMemoryRequirements needs{};
        vkGetBufferMemoryRequirements(device_, buffer, &needs);
        VkMemoryAllocateFlagsInfo flags{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO};
        flags.flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT;
        const auto type = static_cast<uint32_t>(std::countr_zero(needs.memoryTypeBits));
        const VkMemoryAllocateInfo info{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO, &flags, needs.size, type};
        VkDeviceMemory memory = VK_NULL_HANDLE;
        check(vkAllocateMemory(device_, &info, nullptr, &memory) == VK_SUCCESS, "no memory");
        check(vkBindBufferMemory(device_, buffer, memory, 0) == VK_SUCCESS, "no memory of the buffer");
        VkAccelerationStructureCreateInfoKHR structures{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_KHR};
        structures.buffer = buffer;
        structures.size = sizes.accelerationStructureSize;
        structures.type = build.type;
        check(function<PFN_vkCreateAccelerationStructureKHR>("vkCreateAccelerationStructureKHR")(
                  device_, &structures, nullptr, &build.dstAccelerationStructure) == VK_SUCCESS,
              "no structure");
        const VkBufferDeviceAddressInfo address{VK_STRUCTURE_TYPE_BUFFER_DEVICE_ADDRESS_INFO, nullptr, buffer};
        build.scratchData.deviceAddress = vkGetBufferDeviceAddress(device_, &address) + kHalf;
        record(build);
        function<PFN_vkDestroyAccelerationStructureKHR>("vkDestroyAccelerationStructureKHR")(
            device_, build.dstAccelerationStructure, nullptr);
        vkDestroyBuffer(device_, buffer, nullptr);
        vkFreeMemory(device_, memory, nullptr);
    }

private:
    template <typename Function>
    [[nodiscard]] Function function(const char *name) const
    {
        const auto found = reinterpret_cast<Function>(vkGetDeviceProcAddr(device_, name));
        check(found != nullptr, name);
        return found;
    }
    void record(const VkAccelerationStructureBuildGeometryInfoKHR &build) const
    {
        const VkCommandPoolCreateInfo pools{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO, nullptr, 0, 0};
        VkCommandPool pool = VK_NULL_HANDLE;
        check(vkCreateCommandPool(device_, &pools, nullptr, &pool) == VK_SUCCESS, "no command pool");
        const VkCommandBufferAllocateInfo one{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO, nullptr, pool,
                                              VK_COMMAND_BUFFER_LEVEL_PRIMARY, 1};
        VkCommandBuffer commands = VK_NULL_HANDLE;
        check(vkAllocateCommandBuffers(device_, &one, &commands) == VK_SUCCESS, "no command buffer");
        const VkCommandBufferBeginInfo begin{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
        check(vkBeginCommandBuffer(commands, &begin) == VK_SUCCESS, "no recording");
        const VkAccelerationStructureBuildRangeInfoKHR *ranges = nullptr;
        function<PFN_vkCmdBuildAccelerationStructuresKHR>("vkCmdBuildAccelerationStructuresKHR")(commands, 1, &build,
                                                                                                 &ranges);
        check(vkEndCommandBuffer(commands) == VK_SUCCESS, "not recorded");
        vkDestroyCommandPool(device_, pool, nullptr);
    }
    void createDevice(VkPhysicalDevice physicalDevice, bool micromaps)
    {
        const float priority = 1;
        VkDeviceQueueCreateInfo queue{VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO};
        queue.queueCount = 1;
        queue.pQueuePriorities = &priority;
        const char *extensions[] = {VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME,
                                    VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME,
                                    VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME};
        VkPhysicalDeviceOpacityMicromapFeaturesEXT micromap{
            VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_EXT};
        micromap.micromap = VK_TRUE;
        VkPhysicalDeviceVulkan13Features vulkan13{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_FEATURES, &micromap};
        vulkan13.synchronization2 = VK_TRUE;
        VkPhysicalDeviceVulkan12Features vulkan12{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES, &vulkan13};
        vulkan12.bufferDeviceAddress = VK_TRUE;
        VkPhysicalDeviceAccelerationStructureFeaturesKHR structure{
            VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR, &vulkan12};
        structure.accelerationStructure = VK_TRUE;
        VkDeviceCreateInfo info{VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO};
        info.queueCreateInfoCount = 1;
        info.pQueueCreateInfos = &queue;
        if (micromaps) {
            info.pNext = &structure;
            info.enabledExtensionCount = 3;
            info.ppEnabledExtensionNames = extensions;
        }
        check(vkCreateDevice(physicalDevice, &info, nullptr, &device_) == VK_SUCCESS, "no device with micromaps");
    }

    VkInstance instance_ = VK_NULL_HANDLE;
    VkDevice device_ = VK_NULL_HANDLE;
};

// UndefinedBehaviorSanitizer would end the program in its own way.
[[gnu::no_sanitize("undefined")]] void crash()
{
    volatile int *volatile nowhere = nullptr;
    *nowhere = 1;
}

void run(const std::string &what)
{
    if (what == "instance")
        Device(Device::With::Nothing);
    else if (what == "plain")
        Device(Device::With::Device);
    else if (what == "right")
        check(Device().sizes(VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT).micromapSize != 0, "no size");
    else if (what == "build")
        Device().recordBuild();
    else if (what == "error")
        check(Device().sizes(static_cast<VkMicromapTypeEXT>(77)).micromapSize == 0, "a size");
    else if (what == "warning")
        Device().allocate();
    else if (what == "crash")
        crash();
    else
        check(false, "what?");
}

void runInProcesses(const std::string &program)
{
    for (const char *use : {"error", "warning"})
        check(std::system(('"' + program + "\" " + use).c_str()) == 0, "a process failed");
}

void print(const char *text)
{
    std::printf("%s|", text ? text : "");
}

} // namespace

int main(int argc, char **argv)
{
    const std::string first = argc > 1 ? argv[1] : "";
    const bool prints = first == "words" || first == "variables";
    for (int i = prints ? 2 : 1; i < argc; ++i) {
        const std::string word = argv[i];
        if (prints)
            print(first == "words" ? argv[i] : std::getenv(argv[i]));
        else if (word == "both")
            runInProcesses(argv[0]);
        else
            run(word);
    }
}
