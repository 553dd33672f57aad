// SPDX-License-Identifier: Apache-2.0
#include "gpu/copies.h"

#include <random>
#include <sstream>
#include <stdexcept>

namespace vellum::gpu
{
namespace
{

constexpr uint32_t kTriangles = 6; // of each geometry
constexpr std::array<std::array<float, 2>, 6> kPlaces{
    {{0.11f, 0.13f}, {0.62f, 0.17f}, {0.17f, 0.62f}, {0.31f, 0.29f}, {0.43f, 0.41f}, {0.05f, 0.83f}}};

constexpr VkBufferUsageFlags kSerializedUsage =
    VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;

MicromapInput randomInput(std::mt19937 &random, uint32_t triangles)
{
    MicromapInput input;
    for (uint32_t i = 0; i < triangles; ++i) {
        const uint32_t level = i % 6;
        const uint16_t format = i % 3 == 2 ? kTwoState : kFourState;
        std::vector<uint8_t> states(size_t{1} << (2 * level));
        for (uint8_t &state : states)
            state = static_cast<uint8_t>(random() % (format == kTwoState ? 2 : 4));
        input.add(level, format, states);
    }
    return input;
}

} // namespace

void recordCopy(Device &gpu, VkCommandBuffer commands, VkAccelerationStructureKHR from, VkAccelerationStructureKHR to,
                VkCopyAccelerationStructureModeKHR mode)
{
    auto info = vkInit<VkCopyAccelerationStructureInfoKHR>({.src = from, .dst = to, .mode = mode});
    gpu.vk().CmdCopyAccelerationStructureKHR(commands, &info);
}

void copy(Device &gpu, const Structure &from, const Structure &to, VkCopyAccelerationStructureModeKHR mode)
{
    gpu.submit([&](VkCommandBuffer commands) { recordCopy(gpu, commands, from.handle(), to.handle(), mode); });
}

void Serialized::relocate(const std::function<uint64_t(uint64_t)> &change)
{
    for (size_t i = 0; i < handleCount(); ++i)
        setHandle(i, change(handle(i)));
}

VkDeviceSize queried(Device &gpu, const Structure &structure, VkQueryType type)
{
    const QueryPool pool(gpu, type);
    const VkAccelerationStructureKHR handle = structure.handle();
    gpu.submit([&](VkCommandBuffer commands) {
        vkCmdResetQueryPool(commands, pool, 0, 1);
        gpu.vk().CmdWriteAccelerationStructuresPropertiesKHR(commands, 1, &handle, type, pool, 0);
    });
    VkDeviceSize value = 0;
    CHECK_VK(vkGetQueryPoolResults(gpu.device(), pool, 0, 1, sizeof value, &value, sizeof value,
                                   VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT));
    return value;
}

void recordSerialize(Device &gpu, VkCommandBuffer commands, const Structure &structure, VkDeviceAddress to)
{
    auto info = vkInit<VkCopyAccelerationStructureToMemoryInfoKHR>({.src = structure.handle()});
    info.dst.deviceAddress = to;
    info.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_SERIALIZE_KHR;
    gpu.vk().CmdCopyAccelerationStructureToMemoryKHR(commands, &info);
}

Serialized serialize(Device &gpu, const Structure &structure)
{
    // Space for more than the query reports, so that a wrong answer shows in the header and not as an overrun.
    const VkDeviceSize size = queried(gpu, structure, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR);
    const Guarded buffer(gpu, 2 * size + (1 << 16), 256, kSerializedUsage);
    gpu.submit([&](VkCommandBuffer commands) { recordSerialize(gpu, commands, structure, buffer.address()); });
    if (!buffer.intact())
        gpu.fault("serialization wrote beyond its destination");
    Serialized data({buffer.bytes(), buffer.bytes() + buffer.size()});
    if (data.total() > buffer.size())
        gpu.fault("the header of serialized data has a size that is larger than the query reported");
    data.bytes().resize(std::min<size_t>(data.total(), data.bytes().size()));
    return data;
}

void deserialize(Device &gpu, const Serialized &data, const Structure &to, VkDeviceSize capacity)
{
    // The data ends where the buffer does.
    const VkDeviceSize size = capacity == 0 ? data.bytes().size() : capacity;
    const Buffer buffer(gpu, size + 256, kSerializedUsage);
    const VkDeviceSize skipped = (256 - buffer.address() % 256) % 256;
    const Buffer exact(gpu, skipped + size, kSerializedUsage);
    if (exact.address() % 256 != buffer.address() % 256)
        throw std::runtime_error("two buffers of one size have different alignments");
    std::memcpy(exact.bytes() + skipped, data.bytes().data(), std::min<size_t>(size, data.bytes().size()));
    gpu.submit([&](VkCommandBuffer commands) {
        auto info = vkInit<VkCopyMemoryToAccelerationStructureInfoKHR>();
        info.src.deviceAddress = exact.address() + skipped;
        info.dst = to.handle();
        info.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_DESERIALIZE_KHR;
        gpu.vk().CmdCopyMemoryToAccelerationStructureKHR(commands, &info);
    });
    if (std::memcmp(exact.bytes() + skipped, data.bytes().data(), std::min<size_t>(size, data.bytes().size())) != 0)
        gpu.fault("deserialization wrote to the serialized data");
}

std::unique_ptr<Structure> deserialized(Device &gpu, const Serialized &data, VkAccelerationStructureTypeKHR type)
{
    auto structure = std::make_unique<Structure>(gpu, type);
    structure->create(data.deserializedSize());
    deserialize(gpu, data, *structure);
    return structure;
}

Patchwork::Patchwork(Device &gpu, uint32_t seed)
{
    std::mt19937 random(seed);
    for (const uint32_t triangles : {kTriangles, 2 * kTriangles}) {
        micromaps_.push_back(std::make_unique<Micromap>(gpu, randomInput(random, triangles)));
        micromaps_.back()->build();
    }
}

std::vector<Geometry> Patchwork::geometries() const
{
    std::vector<Geometry> out;
    for (uint32_t g = 0; g < 6; ++g)
        out.push_back(Geometry{.vertices = triangleRow(kTriangles, {0, 2 * static_cast<float>(g), 0})});
    out[0].micromap = Attachment{micromaps_[0].get()};
    out[1].flags = VK_GEOMETRY_OPAQUE_BIT_KHR;
    out[2].micromap = Attachment{micromaps_[1].get(), VK_INDEX_TYPE_UINT16, {5, -1, 0, -4, -2, 3}, {}, 6};
    out[3].micromap = Attachment{micromaps_[1].get(), VK_INDEX_TYPE_UINT32, {5, 4, 3, -3, 11, 10}};
    out[3].flags = VK_GEOMETRY_OPAQUE_BIT_KHR;
    out[4].micromap = Attachment{nullptr, VK_INDEX_TYPE_UINT16, {-1, -2, -3, -4, -1, -2}};
    return out;
}

std::vector<Ray> Patchwork::rays(Vec3 place, uint32_t flags)
{
    std::vector<Ray> out;
    for (uint32_t g = 0; g < 6; ++g) {
        for (uint32_t t = 0; t < kTriangles; ++t) {
            for (const auto &[u, v] : kPlaces) {
                Ray ray;
                ray.origin = {place[0] + 1.5f * static_cast<float>(t) + u, place[1] + 2 * static_cast<float>(g) + v,
                              place[2] + 1};
                ray.flags = flags;
                ray.rule = kHash;
                out.push_back(ray);
            }
        }
    }
    return out;
}

std::vector<std::string> seen(Device &gpu, const Structure &scene, std::span<const Ray> rays)
{
    Tracer tracer(gpu);
    std::vector<std::string> out;
    for (const Result &r : tracer.trace(scene, rays)) {
        std::ostringstream text;
        if (r.committed != kNone)
            text << "hit " << r.customIndex << ' ' << r.instance << ' ' << r.geometry << ' ' << r.primitive << ' '
                 << r.t << ' ' << r.u << ' ' << r.v;
        for (const Candidate &c : r.candidates)
            text << " candidate " << c.customIndex << ' ' << c.instance << ' ' << c.geometry << ' ' << c.primitive
                 << ' ' << c.t << ' ' << c.u << ' ' << c.v;
        out.push_back(text.str());
    }
    return out;
}

std::vector<std::string> seenOf(Device &gpu, const Structure &blas, uint32_t instanceFlags)
{
    const Tlas scene(gpu, {instance(blas, {}, 77, instanceFlags)});
    return seen(gpu, scene, Patchwork::rays());
}

} // namespace vellum::gpu
