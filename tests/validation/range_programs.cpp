// SPDX-License-Identifier: Apache-2.0
// Wrong address ranges of copies, fills, updates, query results and markers.
#include "range_commands.h"

namespace vt
{
namespace
{

constexpr VkBufferUsageFlags kTransfers = VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;

// --- rules that each command has ---

template <const RangeCommand &command>
void nullRange(Gpu &gpu, bool wrong)
{
    const RangeBuffer buffer(gpu, command.usage);
    recordOnly(gpu, [&](VkCommandBuffer commands) {
        command.record(gpu, commands, {wrong ? 0 : buffer.address(), command.size}, kUnknownUsage);
    });
}

template <const RangeCommand &command>
void pastTheEnd(Gpu &gpu, bool wrong)
{
    const RangeBuffer buffer(gpu, command.usage);
    const VkDeviceSize offset = RangeBuffer::kSize - command.size + (wrong ? 16 : 0);
    recordOnly(gpu, [&](VkCommandBuffer commands) {
        command.record(gpu, commands, {buffer.address() + offset, command.size}, kUnknownUsage);
    });
}

template <const RangeCommand &command>
void destroyedBuffer(Gpu &gpu, bool wrong)
{
    auto buffer = std::make_unique<RangeBuffer>(gpu, command.usage);
    const VkDeviceAddress address = buffer->address();
    if (wrong)
        buffer.reset();
    recordOnly(gpu, [&](VkCommandBuffer commands) {
        command.record(gpu, commands, {address, command.size}, kUnknownUsage);
    });
}

// --- copies ---

VkDeviceMemoryCopyKHR regionOf(const VkDeviceAddressRangeKHR &from, const VkDeviceAddressRangeKHR &to)
{
    return vkInit<VkDeviceMemoryCopyKHR>(
        {.srcRange = from, .srcFlags = kUnknownUsage, .dstRange = to, .dstFlags = kUnknownUsage});
}

void copy(Gpu &gpu, std::span<const VkDeviceMemoryCopyKHR> regions)
{
    const auto info = vkInit<VkCopyDeviceMemoryInfoKHR>(
        {.regionCount = static_cast<uint32_t>(regions.size()), .pRegions = regions.data()});
    recordOnly(gpu, [&](VkCommandBuffer commands) { gpu.vk().CmdCopyMemoryKHR(commands, &info); });
}

void smallTarget(Gpu &gpu, bool wrong)
{
    const RangeBuffer buffer(gpu, kTransfers);
    const auto region = regionOf({buffer.address(), 64}, {buffer.address() + 128, wrong ? 60u : 64u});
    copy(gpu, std::span(&region, 1));
}

void overlapInsideARegion(Gpu &gpu, bool wrong)
{
    const RangeBuffer buffer(gpu, kTransfers);
    const auto region = regionOf({buffer.address(), 64}, {buffer.address() + (wrong ? 63 : 64), 64});
    copy(gpu, std::span(&region, 1));
}

void overlapOfRegions(Gpu &gpu, bool wrong)
{
    const RangeBuffer buffer(gpu, kTransfers);
    const VkDeviceAddress at = buffer.address();
    const std::array regions{regionOf({at, 64}, {at + 256, 64}),
                             regionOf({at + 128, 64}, {at + (wrong ? 32 : 512), 64})};
    copy(gpu, regions);
}

void overlapOfSources(Gpu &gpu, bool wrong)
{
    const RangeBuffer buffer(gpu, kTransfers);
    const VkDeviceAddress at = buffer.address();
    const std::array regions{regionOf({at, 64}, {at + 256, 64}),
                             regionOf({at + (wrong ? 32 : 64), 64}, {at + 512, 64})};
    copy(gpu, regions);
}

// --- updates and markers ---

void updateSize(Gpu &gpu, bool wrong)
{
    const RangeBuffer buffer(gpu, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    const std::array<uint32_t, 4> data{};
    const VkDeviceAddressRangeKHR range{buffer.address(), 16};
    recordOnly(gpu, [&](VkCommandBuffer commands) {
        gpu.vk().CmdUpdateMemoryKHR(commands, &range, kUnknownUsage, wrong ? 14 : 16, data.data());
    });
}

void mark(Gpu &gpu, VkPipelineStageFlags2 stage)
{
    const RangeBuffer buffer(gpu, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    const auto info = vkInit<VkMemoryMarkerInfoAMD>(
        {.stage = stage, .dstRange = {buffer.address(), 4}, .dstFlags = kUnknownUsage, .marker = 1});
    recordOnly(gpu, [&](VkCommandBuffer commands) { gpu.vk().CmdWriteMarkerToMemoryAMD(commands, &info); });
}

void stagesOfMarker(Gpu &gpu, bool wrong)
{
    mark(gpu, wrong ? VK_PIPELINE_STAGE_2_COPY_BIT | VK_PIPELINE_STAGE_2_CLEAR_BIT : VK_PIPELINE_STAGE_2_COPY_BIT);
}

void buildStageOfMarker(Gpu &gpu, bool wrong)
{
    mark(gpu, wrong ? VK_PIPELINE_STAGE_2_MICROMAP_BUILD_BIT_EXT : VK_PIPELINE_STAGE_2_COPY_BIT);
}

// --- query results ---

void queryResults(Gpu &gpu, VkDeviceSize offset, VkDeviceSize bytes, VkDeviceSize stride, VkQueryResultFlags flags)
{
    const RangeBuffer buffer(gpu, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    const QueryPool pool(gpu, VK_QUERY_TYPE_TIMESTAMP, 4);
    const VkStridedDeviceAddressRangeKHR range{buffer.address() + offset, bytes, stride};
    recordOnly(gpu, [&](VkCommandBuffer commands) {
        gpu.vk().CmdCopyQueryPoolResultsToMemoryKHR(commands, pool, 0, 4, &range, kUnknownUsage, flags);
    });
}

void narrowResults(Gpu &gpu, bool wrong)
{
    queryResults(gpu, wrong ? 2 : 0, 64, 8, 0);
}

void narrowStride(Gpu &gpu, bool wrong)
{
    queryResults(gpu, 0, 64, wrong ? 6 : 8, 0);
}

void wideResults(Gpu &gpu, bool wrong)
{
    queryResults(gpu, wrong ? 4 : 0, 64, 8, VK_QUERY_RESULT_64_BIT);
}

void fewResults(Gpu &gpu, bool wrong)
{
    queryResults(gpu, 0, wrong ? 31 : 32, 8, VK_QUERY_RESULT_64_BIT);
}

void availability(Gpu &gpu, bool wrong)
{
    queryResults(gpu, 0, wrong ? 60 : 64, 16, VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WITH_AVAILABILITY_BIT);
}

void protectedResults(Gpu &gpu, bool wrong)
{
    const RangeBuffer buffer(gpu, VK_BUFFER_USAGE_TRANSFER_DST_BIT, wrong ? kProtectedBuffer : 0);
    recordOnly(gpu, [&](VkCommandBuffer commands) {
        kQueryResults.record(gpu, commands, {buffer.address(), 64}, wrong ? kProtectedRange : kUnknownUsage);
    });
}

// --- features of another device ---

// A device of the same driver with VK_KHR_device_address_commands, and these features. Its commands are found by name.
class OtherDevice
{
public:
    OtherDevice(Gpu &gpu, bool addressCommands, bool synchronization2)
    {
        auto synchronization =
            vkInit<VkPhysicalDeviceSynchronization2Features>({.synchronization2 = VkBool32{synchronization2}});
        auto commands = vkInit<VkPhysicalDeviceDeviceAddressCommandsFeaturesKHR>(
            {.pNext = &synchronization, .deviceAddressCommands = VkBool32{addressCommands}});
        auto structures = vkInit<VkPhysicalDeviceAccelerationStructureFeaturesKHR>(
            {.pNext = &commands, .accelerationStructure = VK_TRUE});
        auto addresses =
            vkInit<VkPhysicalDeviceBufferDeviceAddressFeatures>({.pNext = &structures, .bufferDeviceAddress = VK_TRUE});
        const std::array extensions{VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME,
                                    VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME,
                                    VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME};
        const float priority = 1;
        const auto queue = vkInit<VkDeviceQueueCreateInfo>(
            {.queueFamilyIndex = gpu.family(), .queueCount = 1, .pQueuePriorities = &priority});
        const auto info = vkInit<VkDeviceCreateInfo>({.pNext = &addresses,
                                                      .queueCreateInfoCount = 1,
                                                      .pQueueCreateInfos = &queue,
                                                      .enabledExtensionCount = extensions.size(),
                                                      .ppEnabledExtensionNames = extensions.data()});
        VT_CHECK(vkCreateDevice(gpu.physical(), &info, nullptr, &device_));
        const auto pool = vkInit<VkCommandPoolCreateInfo>({.queueFamilyIndex = gpu.family()});
        VT_CHECK(command<PFN_vkCreateCommandPool>("vkCreateCommandPool")(device_, &pool, nullptr, &pool_));
        const auto buffer = vkInit<VkBufferCreateInfo>(
            {.size = 4096,
             .usage = VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT |
                      VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR});
        VT_CHECK(command<PFN_vkCreateBuffer>("vkCreateBuffer")(device_, &buffer, nullptr, &buffer_));
        VkMemoryRequirements needs;
        command<PFN_vkGetBufferMemoryRequirements>("vkGetBufferMemoryRequirements")(device_, buffer_, &needs);
        const auto flags = vkInit<VkMemoryAllocateFlagsInfo>({.flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT});
        const auto memory = vkInit<VkMemoryAllocateInfo>({.pNext = &flags,
                                                          .allocationSize = needs.size,
                                                          .memoryTypeIndex = gpu.memoryType(needs.memoryTypeBits, 0)});
        VT_CHECK(command<PFN_vkAllocateMemory>("vkAllocateMemory")(device_, &memory, nullptr, &memory_));
        VT_CHECK(command<PFN_vkBindBufferMemory>("vkBindBufferMemory")(device_, buffer_, memory_, 0));
    }
    OtherDevice(const OtherDevice &) = delete;
    OtherDevice &operator=(const OtherDevice &) = delete;
    ~OtherDevice()
    {
        command<PFN_vkDestroyBuffer>("vkDestroyBuffer")(device_, buffer_, nullptr);
        command<PFN_vkFreeMemory>("vkFreeMemory")(device_, memory_, nullptr);
        command<PFN_vkDestroyCommandPool>("vkDestroyCommandPool")(device_, pool_, nullptr);
        command<PFN_vkDestroyDevice>("vkDestroyDevice")(device_, nullptr);
    }
    template <typename Function>
    [[nodiscard]] Function command(const char *name) const
    {
        return reinterpret_cast<Function>(vkGetDeviceProcAddr(device_, name));
    }
    [[nodiscard]] VkDevice get() const { return device_; }
    [[nodiscard]] VkDeviceAddress address() const
    {
        const auto info = vkInit<VkBufferDeviceAddressInfo>({.buffer = buffer_});
        return command<PFN_vkGetBufferDeviceAddress>("vkGetBufferDeviceAddress")(device_, &info);
    }
    [[nodiscard]] VkCommandBuffer begin() const
    {
        const auto info = vkInit<VkCommandBufferAllocateInfo>(
            {.commandPool = pool_, .level = VK_COMMAND_BUFFER_LEVEL_PRIMARY, .commandBufferCount = 1});
        VkCommandBuffer commands = VK_NULL_HANDLE;
        VT_CHECK(command<PFN_vkAllocateCommandBuffers>("vkAllocateCommandBuffers")(device_, &info, &commands));
        const auto beginInfo = vkInit<VkCommandBufferBeginInfo>();
        VT_CHECK(command<PFN_vkBeginCommandBuffer>("vkBeginCommandBuffer")(commands, &beginInfo));
        return commands;
    }

private:
    VkDevice device_ = VK_NULL_HANDLE;
    VkCommandPool pool_ = VK_NULL_HANDLE;
    VkBuffer buffer_ = VK_NULL_HANDLE;
    VkDeviceMemory memory_ = VK_NULL_HANDLE;
};

void creationWithoutFeature(Gpu &gpu, bool wrong)
{
    const OtherDevice other(gpu, !wrong, true);
    const auto info =
        vkInit<VkAccelerationStructureCreateInfo2KHR>({.addressRange = {other.address(), 4096},
                                                       .addressFlags = kUnknownUsage,
                                                       .type = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR});
    VkAccelerationStructureKHR structure = VK_NULL_HANDLE;
    VT_CHECK(other.command<PFN_vkCreateAccelerationStructure2KHR>("vkCreateAccelerationStructure2KHR")(
        other.get(), &info, nullptr, &structure));
    other.command<PFN_vkDestroyAccelerationStructureKHR>("vkDestroyAccelerationStructureKHR")(other.get(), structure,
                                                                                              nullptr);
}

void markerWithoutFeature(Gpu &gpu, bool wrong)
{
    const OtherDevice other(gpu, true, !wrong);
    const auto info = vkInit<VkMemoryMarkerInfoAMD>({.stage = VK_PIPELINE_STAGE_2_COPY_BIT,
                                                     .dstRange = {other.address(), 4},
                                                     .dstFlags = kUnknownUsage,
                                                     .marker = 1});
    other.command<PFN_vkCmdWriteMarkerToMemoryAMD>("vkCmdWriteMarkerToMemoryAMD")(other.begin(), &info);
}

// --- images ---

struct ImageCopy {
    VkFormat format = VK_FORMAT_R32_UINT;
    VkImageCreateFlags flags = 0;
    VkImageAspectFlags aspect = VK_IMAGE_ASPECT_COLOR_BIT;
    VkDeviceSize offset = 0;
    bool toMemory = true;
    uint32_t family = UINT32_MAX; // of queues; else that of the device
    // If set, there is a second region: a column of two texels next to the first, in memory from this offset on.
    std::optional<VkDeviceSize> second = {};
};

// Copies 4 by 4 texels.
void copyImage(Gpu &gpu, const ImageCopy &copy)
{
    const DeviceImage image(
        gpu, vkInit<VkImageCreateInfo>({.flags = copy.flags,
                                        .imageType = VK_IMAGE_TYPE_2D,
                                        .format = copy.format,
                                        .extent = {8, 8, 1},
                                        .mipLevels = 1,
                                        .arrayLayers = 1,
                                        .samples = VK_SAMPLE_COUNT_1_BIT,
                                        .usage = VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT}));
    const RangeBuffer buffer(gpu, kTransfers);
    std::vector regions{vkInit<VkDeviceMemoryImageCopyKHR>({.addressRange = {buffer.address() + copy.offset, 256},
                                                            .addressFlags = kUnknownUsage,
                                                            .addressRowLength = 8,
                                                            .imageSubresource = {copy.aspect, 0, 0, 1},
                                                            .imageLayout = VK_IMAGE_LAYOUT_GENERAL,
                                                            .imageExtent = {4, 4, 1}})};
    if (copy.second) {
        regions.push_back(regions[0]);
        regions[1].addressRange.address = buffer.address() + *copy.second;
        regions[1].imageOffset = {4, 0, 0};
    }
    const auto info = vkInit<VkCopyDeviceMemoryImageInfoKHR>(
        {.image = image.handle(), .regionCount = static_cast<uint32_t>(regions.size()), .pRegions = regions.data()});
    recordOnly(
        gpu,
        [&](VkCommandBuffer commands) {
            copy.toMemory ? gpu.vk().CmdCopyImageToMemoryKHR(commands, &info)
                          : gpu.vk().CmdCopyMemoryToImageKHR(commands, &info);
        },
        false, copy.family);
}

template <bool toMemory>
void protectedImage(Gpu &gpu, bool wrong)
{
    copyImage(gpu, {.flags = wrong ? VkImageCreateFlags{VK_IMAGE_CREATE_PROTECTED_BIT} : 0, .toMemory = toMemory});
}

template <bool toMemory>
void transferQueue(Gpu &gpu, bool wrong)
{
    copyImage(gpu, {.format = VK_FORMAT_R8_UINT, .offset = wrong ? 2u : 4u, .toMemory = toMemory, .family = 3});
}

void depthAlignment(Gpu &gpu, bool wrong)
{
    copyImage(gpu, {.format = VK_FORMAT_D16_UNORM, .aspect = VK_IMAGE_ASPECT_DEPTH_BIT, .offset = wrong ? 2u : 4u});
}

void planeAlignment(Gpu &gpu, bool wrong)
{
    copyImage(gpu, {.format = VK_FORMAT_G8_B8R8_2PLANE_420_UNORM,
                    .aspect = VK_IMAGE_ASPECT_PLANE_1_BIT,
                    .offset = wrong ? 1u : 2u});
}

// Rows of 16 bytes, 32 bytes apart: the rows of another region fit between them.
void overlappingRows(Gpu &gpu, bool wrong)
{
    copyImage(gpu, {.second = wrong ? 12 : 16});
}

constexpr auto kNeeds = kNeedsAddressCommands;
constexpr auto kMarkers = kNeedsAddressCommands | kNeedsMarkers;

constexpr WrongProgram kPrograms[] = {
    {"VUID-VkDeviceAddressRangeKHR-size-11411", Api::Khr, kNeeds, nullRange<kFill>},
    {"VUID-VkDeviceAddressRangeKHR-size-11411", Api::Khr, kNeeds, nullRange<kUpdate>, "Update"},
    {"VUID-VkDeviceAddressRangeKHR-size-11411", Api::Khr, kNeeds, nullRange<kCopySource>, "CopySource"},
    {"VUID-VkDeviceAddressRangeKHR-size-11411", Api::Khr, kNeeds, nullRange<kImageCopy>, "ImageCopy"},
    {"VUID-VkDeviceAddressRangeKHR-size-11411", Api::Khr, kNeeds, nullRange<kIndexBuffer>, "IndexBuffer"},
    {"VUID-VkDeviceAddressRangeKHR-size-11411", Api::Khr, kNeeds, nullRange<kDispatch>, "Dispatch"},
    {"VUID-VkDeviceAddressRangeKHR-size-11411", Api::Khr, kNeeds, nullRange<kCondition>, "Condition"},
    {"VUID-VkDeviceAddressRangeKHR-size-11411", Api::Khr, kNeeds, nullRange<kDrawCount>, "DrawCount"},
    {"VUID-VkDeviceAddressRangeKHR-size-11411", Api::Khr, kNeeds, nullRange<kBarrier>, "Barrier"},
    {"VUID-VkDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, pastTheEnd<kFill>},
    {"VUID-VkDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, destroyedBuffer<kFill>, "Destroyed"},
    {"VUID-VkDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, pastTheEnd<kUpdate>, "Update"},
    {"VUID-VkDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, pastTheEnd<kCopySource>, "CopySource"},
    {"VUID-VkDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, pastTheEnd<kCopyTarget>, "CopyTarget"},
    {"VUID-VkDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, pastTheEnd<kImageCopy>, "ImageCopy"},
    {"VUID-VkDeviceAddressRangeKHR-address-11365", Api::Khr, kMarkers, pastTheEnd<kMarker>, "Marker"},
    {"VUID-VkDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, pastTheEnd<kIndexBuffer>, "IndexBuffer"},
    {"VUID-VkDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, pastTheEnd<kFeedbackBuffer>, "Feedback"},
    {"VUID-VkDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, pastTheEnd<kDispatch>, "Dispatch"},
    {"VUID-VkDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, pastTheEnd<kDrawCount>, "DrawCount"},
    {"VUID-VkDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, pastTheEnd<kCondition>, "Condition"},
    {"VUID-VkDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, pastTheEnd<kBarrier>, "Barrier"},
    {"VUID-VkStridedDeviceAddressRangeKHR-size-11411", Api::Khr, kNeeds, nullRange<kDraw>},
    {"VUID-VkStridedDeviceAddressRangeKHR-size-11411", Api::Khr, kNeeds, nullRange<kQueryResults>, "QueryResults"},
    {"VUID-VkStridedDeviceAddressRangeKHR-size-11411", Api::Khr, kNeeds, nullRange<kVertexBuffer>, "VertexBuffer"},
    {"VUID-VkStridedDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, pastTheEnd<kDraw>},
    {"VUID-VkStridedDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, pastTheEnd<kCountedDraw>, "Counted"},
    {"VUID-VkStridedDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, pastTheEnd<kQueryResults>, "QueryResults"},
    {"VUID-VkStridedDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, pastTheEnd<kVertexBuffer>, "VertexBuffer"},

    {"VUID-VkDeviceMemoryCopyKHR-srcRange-13017", Api::Khr, kNeeds, usage<kCopySource>},
    {"VUID-VkDeviceMemoryCopyKHR-dstRange-13018", Api::Khr, kNeeds, usage<kCopyTarget>},
    {"VUID-VkDeviceMemoryCopyKHR-size-13016", Api::Khr, kNeeds, smallTarget},
    {"VUID-VkCopyDeviceMemoryInfoKHR-srcRange-13015", Api::Khr, kNeeds, overlapInsideARegion},
    {"VUID-VkCopyDeviceMemoryInfoKHR-srcRange-13015", Api::Khr, kNeeds, overlapOfRegions, "Regions"},
    {"VUID-VkCopyDeviceMemoryInfoKHR-srcRange-13015", Api::Khr, kNeeds, overlapOfSources, "Sources"},
    {"VUID-vkCmdCopyMemoryKHR-commandBuffer-13012", Api::Khr, kNeeds, protectedFlag<kCopySource>},
    {"VUID-vkCmdCopyMemoryKHR-commandBuffer-13013", Api::Khr, kNeeds, protectedFlag<kCopyTarget>},
    {"VUID-vkCmdCopyMemoryKHR-commandBuffer-13014", Api::Khr, kNeeds, protectedCommands<kCopyTarget>},

    {"VUID-vkCmdFillMemoryKHR-dstRange-13000", Api::Khr, kNeeds, usage<kFill>},
    {"VUID-vkCmdFillMemoryKHR-pDstRange-13001", Api::Khr, kNeeds, alignment<kFill, 2>},
    {"VUID-vkCmdFillMemoryKHR-pDstRange-13002", Api::Khr, kNeeds, size<kFill, 64, 62>},
    {"VUID-vkCmdFillMemoryKHR-commandBuffer-13003", Api::Khr, kNeeds, protectedFlag<kFill>},
    {"VUID-vkCmdFillMemoryKHR-commandBuffer-13004", Api::Khr, kNeeds, protectedCommands<kFill>},

    {"VUID-vkCmdUpdateMemoryKHR-dstRange-13005", Api::Khr, kNeeds, usage<kUpdate>},
    {"VUID-vkCmdUpdateMemoryKHR-pDstRange-13006", Api::Khr, kNeeds, alignment<kUpdate, 2>},
    {"VUID-vkCmdUpdateMemoryKHR-pDstRange-13007", Api::Khr, kNeeds, size<kUpdate, 65536, 65540>},
    {"VUID-vkCmdUpdateMemoryKHR-dataSize-13008", Api::Khr, kNeeds, size<kUpdate, 16, 12>},
    {"VUID-vkCmdUpdateMemoryKHR-dataSize-13009", Api::Khr, kNeeds, updateSize},
    {"VUID-vkCmdUpdateMemoryKHR-commandBuffer-13010", Api::Khr, kNeeds, protectedFlag<kUpdate>},
    {"VUID-vkCmdUpdateMemoryKHR-commandBuffer-13011", Api::Khr, kNeeds, protectedCommands<kUpdate>},

    {"VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-pDstRange-13080", Api::Khr, kNeeds, usage<kQueryResults>},
    {"VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-flags-13077", Api::Khr, kNeeds, narrowResults},
    {"VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-flags-13077", Api::Khr, kNeeds, narrowStride, "Stride"},
    {"VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-flags-13078", Api::Khr, kNeeds, wideResults},
    {"VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-pDstRange-13079", Api::Khr, kNeeds, fewResults},
    {"VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-pDstRange-13079", Api::Khr, kNeeds, availability, "Availability"},
    {"VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-dstFlags-13085", Api::Khr, kNeeds, protectedResults},

    {"VUID-VkMemoryMarkerInfoAMD-dstRange-13039", Api::Khr, kMarkers, usage<kMarker>},
    {"VUID-VkMemoryMarkerInfoAMD-dstRange-13040", Api::Khr, kMarkers, alignment<kMarker, 2>},
    {"VUID-VkMemoryMarkerInfoAMD-dstRange-13041", Api::Khr, kMarkers, size<kMarker, 4, 3>},
    {"VUID-VkMemoryMarkerInfoAMD-stage-13038", Api::Khr, kMarkers, stagesOfMarker},
    {"VUID-VkMemoryMarkerInfoAMD-stage-11541", Api::Khr, kMarkers, buildStageOfMarker},
    {"VUID-vkCmdWriteMarkerToMemoryAMD-synchronization2-13042", Api::Khr, kMarkers, markerWithoutFeature},
    {"VUID-vkCmdWriteMarkerToMemoryAMD-commandBuffer-13044", Api::Khr, kMarkers, protectedFlag<kMarker>},
    {"VUID-vkCmdWriteMarkerToMemoryAMD-commandBuffer-13045", Api::Khr, kMarkers, protectedCommands<kMarker>},
    {"VUID-vkCmdWriteMarkerToMemoryAMD-pInfo-13046", Api::Khr, kMarkers,
     [](Gpu &gpu, bool wrong) {
         const RangeBuffer buffer(gpu, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
         recordOnly(gpu, [&](VkCommandBuffer commands) {
             kMarker.record(gpu, commands, {buffer.address(), 4}, wrong ? kProtectedRange : kUnknownUsage);
         });
     },
     "", "VUID-vkCmdWriteMarkerToMemoryAMD-commandBuffer-13044 VUID-VkMemoryMarkerInfoAMD-dstRange-13099"},
    {"VUID-vkCmdWriteMarkerToMemoryAMD-pInfo-13047", Api::Khr, kMarkers,
     [](Gpu &gpu, bool wrong) {
         const RangeBuffer buffer(gpu, VK_BUFFER_USAGE_TRANSFER_DST_BIT, wrong ? kProtectedBuffer : 0);
         recordOnly(gpu, [&](VkCommandBuffer commands) {
             kMarker.record(gpu, commands, {buffer.address(), 4}, kUnknownUsage);
         });
     },
     "", "VUID-VkMemoryMarkerInfoAMD-dstRange-13098"},

    {"VUID-vkCmdCopyMemoryToImageKHR-addressRange-13128", Api::Khr, kNeeds, usage<kImageSource>},
    {"VUID-vkCmdCopyImageToMemoryKHR-addressRange-13129", Api::Khr, kNeeds, usage<kImageCopy>},
    {"VUID-vkCmdCopyMemoryToImageKHR-commandBuffer-13102", Api::Khr, kNeeds, protectedFlag<kImageSource>},
    {"VUID-vkCmdCopyImageToMemoryKHR-commandBuffer-13102", Api::Khr, kNeeds, protectedFlag<kImageCopy>},
    {"VUID-vkCmdCopyImageToMemoryKHR-commandBuffer-13025", Api::Khr, kNeeds, protectedCommands<kImageCopy>},
    {"VUID-vkCmdCopyMemoryToImageKHR-commandBuffer-13021", Api::Khr, kNeeds, protectedCommands<kImageSource>},
    {"VUID-vkCmdCopyImageToMemoryKHR-commandBuffer-13103", Api::Khr, kNeeds, protectedImage<true>},
    {"VUID-vkCmdCopyMemoryToImageKHR-commandBuffer-13103", Api::Khr, kNeeds, protectedImage<false>},
    {"VUID-vkCmdCopyImageToMemoryKHR-commandBuffer-13104", Api::Khr, kNeeds | kNeedsTransferQueue, transferQueue<true>},
    {"VUID-vkCmdCopyMemoryToImageKHR-commandBuffer-13104", Api::Khr, kNeeds | kNeedsTransferQueue,
     transferQueue<false>},
    {"VUID-VkCopyDeviceMemoryImageInfoKHR-image-13030", Api::Khr, kNeeds, planeAlignment},
    {"VUID-VkCopyDeviceMemoryImageInfoKHR-image-13031", Api::Khr, kNeeds, depthAlignment},
    {"VUID-VkCopyDeviceMemoryImageInfoKHR-pRegions-12473", Api::Khr, kNeeds, overlappingRows},
    {"VUID-vkCreateAccelerationStructure2KHR-deviceAddressCommands-13086", Api::Khr, kNeeds, creationWithoutFeature},
    {"VUID-VkCopyDeviceMemoryImageInfoKHR-image-13029", Api::Khr, kNeeds, alignment<kImageCopy, 2>},
    {"VUID-VkDeviceMemoryImageCopyKHR-size-13037", Api::Khr, kNeeds, size<kImageCopy, 64, 63>},
    {"VUID-VkDeviceMemoryImageCopyKHR-size-13037", Api::Khr, kNeeds, size<kImageSource, 64, 60>, "ToImage"},
};

} // namespace

std::span<const WrongProgram> rangePrograms()
{
    return kPrograms;
}

} // namespace vt
