// SPDX-License-Identifier: Apache-2.0
#include "faulty_driver/micromap_input.h"

namespace faults
{
namespace
{

uint32_t bitsOf(uint16_t format)
{
    return format == VK_OPACITY_MICROMAP_FORMAT_2_STATE_EXT ? 1 : 2;
}

bool isRegular(uint32_t level, uint32_t format)
{
    return level <= kHighestLevel &&
           (format == VK_OPACITY_MICROMAP_FORMAT_2_STATE_EXT || format == VK_OPACITY_MICROMAP_FORMAT_4_STATE_EXT);
}

uint64_t bytesOf(uint32_t level, uint16_t format)
{
    return ((uint64_t{bitsOf(format)} << 2 * level) + 7) / 8;
}

template <class Usage>
void read(MicromapInput &input, uint32_t count, const Usage *usages, const Usage *const *pointers)
{
    input.usagePointers = usages == nullptr && pointers != nullptr;
    for (uint32_t i = 0; (usages != nullptr || pointers != nullptr) && i < count; ++i) {
        const Usage &usage = usages != nullptr ? usages[i] : *pointers[i];
        input.usages.push_back({usage.count, usage.subdivisionLevel, static_cast<uint32_t>(usage.format)});
    }
}

// `own`: the bytes of data that the triangle has; what is read beyond them is zero.
MicromapTriangle decoded(const VkMicromapTriangleEXT &triangle, const MicromapInput &input, uint64_t own)
{
    MicromapTriangle content{.level = triangle.subdivisionLevel,
                             .format = triangle.format,
                             .lossy = input.lossy,
                             .address = input.data + triangle.dataOffset};
    const auto *source = hostPointer<const uint8_t>(input.data + triangle.dataOffset);
    const uint32_t bits = bitsOf(triangle.format);
    for (uint64_t bit = 0; bit < uint64_t{bits} << 2 * content.level; bit += bits) {
        const uint32_t byte = bit / 8 < own ? source[bit / 8] : 0;
        content.states.push_back(static_cast<uint8_t>(byte >> bit % 8 & ((1u << bits) - 1)));
    }
    return content;
}

void encode(const MicromapTriangle &content, std::span<uint8_t> bytes)
{
    std::fill(bytes.begin(), bytes.end(), uint8_t{0});
    const uint32_t bits = bitsOf(content.format);
    for (size_t i = 0; i < content.states.size(); ++i) {
        uint8_t &byte = bytes[i * bits / 8];
        byte = static_cast<uint8_t>(byte | content.states[i] << i * bits % 8);
    }
}

} // namespace

MicromapInput::MicromapInput(const VkMicromapBuildInfoEXT &info)
    : target(numberOf(info.dstMicromap)), data(info.data.deviceAddress), triangles(info.triangleArray.deviceAddress),
      stride(info.triangleArrayStride)
{
    read(*this, info.usageCountsCount, info.pUsageCounts, info.ppUsageCounts);
}

MicromapInput::MicromapInput(const BuildInfo &info)
    : target(numberOf(info.dstAccelerationStructure)),
      lossy((info.flags & VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR) != 0)
{
    const auto *given = driver::inChain<VkAccelerationStructureGeometryMicromapDataKHR>(
        geometryOf(info, 0).pNext, VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_MICROMAP_DATA_KHR);
    data = given->data;
    triangles = given->triangleArray;
    stride = given->triangleArrayStride;
    read(*this, given->usageCountsCount, given->pUsageCounts, given->ppUsageCounts);
}

void putInto(VkMicromapBuildInfoEXT &info, const MicromapInput &input)
{
    info.usageCountsCount = static_cast<uint32_t>(input.usages.size());
    info.pUsageCounts = input.usages.data();
    info.ppUsageCounts = nullptr;
    info.data.deviceAddress = input.data;
    info.triangleArray.deviceAddress = input.triangles;
    info.triangleArrayStride = input.stride;
}

void putInto(BuildInfo &info, const MicromapInput &input, VkAccelerationStructureGeometryKHR &geometry,
             VkAccelerationStructureGeometryMicromapDataKHR &data, std::vector<VkMicromapUsageKHR> &usages)
{
    geometry = geometryOf(info, 0);
    usages.clear();
    for (const VkMicromapUsageEXT &usage : input.usages)
        usages.push_back({usage.count, usage.subdivisionLevel, static_cast<VkOpacityMicromapFormatKHR>(usage.format)});
    data = vkInit<VkAccelerationStructureGeometryMicromapDataKHR>(
        {.usageCountsCount = static_cast<uint32_t>(usages.size()),
         .pUsageCounts = usages.data(),
         .data = input.data,
         .triangleArray = input.triangles,
         .triangleArrayStride = input.stride});
    geometry.pNext = &data;
    info.geometryCount = 1;
    info.pGeometries = &geometry;
    info.ppGeometries = nullptr;
}

uint64_t triangleCount(const MicromapInput &input)
{
    uint64_t count = 0;
    for (const VkMicromapUsageEXT &usage : input.usages)
        count += usage.count;
    return count;
}

void rewriteWhenExecuted(VkCommandBuffer commands, MicromapInput &input, void (*header)(VkMicromapTriangleEXT &),
                         void (*states)(MicromapTriangle &, const MicromapTriangles &before))
{
    const uint64_t count = triangleCount(input);
    uint64_t capacity = 0;
    for (const VkMicromapUsageEXT &usage : input.usages) {
        if (isRegular(usage.subdivisionLevel, usage.format))
            capacity += usage.count * bytesOf(usage.subdivisionLevel, static_cast<uint16_t>(usage.format));
    }
    const Memory triangles = memoryFor(commands, count * sizeof(VkMicromapTriangleEXT));
    const Memory data = memoryFor(commands, capacity);
    beforeExecution(commands, [=, given = input, key = keyOf(commands)] {
        uint64_t used = 0;
        MicromapTriangles before;
        for (uint64_t t = 0; t < count; ++t) {
            VkMicromapTriangleEXT triangle;
            std::memcpy(&triangle, hostPointer<const void>(given.triangles + t * given.stride), sizeof triangle);
            if (isRegular(triangle.subdivisionLevel, triangle.format)) {
                const uint64_t own = bytesOf(triangle.subdivisionLevel, triangle.format);
                if (header != nullptr)
                    header(triangle);
                MicromapTriangle content = decoded(triangle, given, own);
                content.key = key;
                const MicromapTriangle read = content;
                if (states != nullptr)
                    states(content, before);
                before.push_back(read);
                triangle.dataOffset = static_cast<uint32_t>(used);
                // The usage counts may state less than there is.
                if (const uint64_t bytes = bytesOf(content.level, content.format); used + bytes <= capacity) {
                    encode(content, {data.bytes + used, bytes});
                    used += bytes;
                }
            }
            std::memcpy(triangles.bytes + t * sizeof triangle, &triangle, sizeof triangle);
        }
    });
    input.triangles = triangles.address;
    input.data = data.address;
    input.stride = sizeof(VkMicromapTriangleEXT);
}

} // namespace faults
