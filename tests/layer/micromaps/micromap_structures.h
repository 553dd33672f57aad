// SPDX-License-Identifier: Apache-2.0
// Shared by the tests of VK_KHR_opacity_micromap: micromaps as acceleration structures, created, built, queried and
// traced.
#pragma once

#include <algorithm>

#include "gpu/copies.h"
#include "harness/harness.h"
#include "micromaps/build_flags.h"
#include "structures/constants.h"

namespace vt
{

using BuildInfo = VkAccelerationStructureBuildGeometryInfoKHR;
using RangeInfo = VkAccelerationStructureBuildRangeInfoKHR;

inline constexpr VkBufferUsageFlags kStorage =
    VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;

// An acceleration structure of vkCreateAccelerationStructure2KHR, on a range of a buffer of the test's.
class Placed
{
public:
    Placed(Gpu &gpu, VkAccelerationStructureTypeKHR type, VkDeviceAddress address, VkDeviceSize size)
        : gpu_(gpu), size_(size)
    {
        auto info = vkInit<VkAccelerationStructureCreateInfo2KHR>(
            {.addressRange = {address, size}, .addressFlags = kUnknownUsage, .type = type});
        VT_CHECK(gpu.vk().CreateAccelerationStructure2KHR(gpu.device(), &info, nullptr, &handle_));
    }
    // In memory of its own.
    Placed(Gpu &gpu, VkAccelerationStructureTypeKHR type, VkDeviceSize size)
        : Placed(gpu, type, std::make_shared<Guarded>(gpu, size, 256, kStorage))
    {
    }
    Placed(const Placed &) = delete;
    Placed &operator=(const Placed &) = delete;
    ~Placed()
    {
        if (own_) {
            EXPECT_TRUE(own_->intact()) << "something was written beyond an acceleration structure";
        }
        gpu_.vk().DestroyAccelerationStructureKHR(gpu_.device(), handle_, nullptr);
    }
    [[nodiscard]] VkAccelerationStructureKHR handle() const { return handle_; }
    [[nodiscard]] MicromapHandle micromap() const { return {VK_NULL_HANDLE, handle_}; }
    [[nodiscard]] VkDeviceSize size() const { return size_; }
    [[nodiscard]] VkDeviceAddress address() const
    {
        auto info = vkInit<VkAccelerationStructureDeviceAddressInfoKHR>({.accelerationStructure = handle_});
        return gpu_.vk().GetAccelerationStructureDeviceAddressKHR(gpu_.device(), &info);
    }

private:
    Placed(Gpu &gpu, VkAccelerationStructureTypeKHR type, std::shared_ptr<Guarded> memory)
        : Placed(gpu, type, memory->address(), memory->size())
    {
        own_ = std::move(memory);
    }

    Gpu &gpu_;
    VkDeviceSize size_;
    std::shared_ptr<Guarded> own_;
    VkAccelerationStructureKHR handle_ = VK_NULL_HANDLE;
};

// One triangle of each state, then of each state in reverse order, at a level above that which a record itself can
// hold.
inline MicromapInput eightStates(bool backwards = false)
{
    MicromapInput input;
    for (uint8_t i = 0; i < 8; ++i) {
        const auto state = static_cast<uint8_t>(i % 4);
        input.add(4, kFourState, std::vector<uint8_t>(256, backwards ? static_cast<uint8_t>(3 - state) : state));
    }
    return input;
}
// Three triangles that share the data of one, of which a build that allows compaction keeps one.
inline MicromapInput repeated()
{
    MicromapInput input;
    std::vector<uint8_t> states(256, 0);
    states[7] = 1;
    for (int i = 0; i < 3; ++i)
        input.add(4, kFourState, states);
    return input;
}
// Bytes of eightStates: header, records, and data of all triangles; compacted: once of each unknown state.
inline constexpr VkDeviceSize kWhole = 64 + 8 * 8 + 8 * 64;
inline constexpr VkDeviceSize kCompacted = 64 + 8 * 8 + 2 * 64;
inline const std::vector<int> kForwards{0, 1, 2, 2, 0, 1, 2, 2};
inline const std::vector<int> kBackwards{2, 2, 1, 0, 2, 2, 1, 0};
inline const std::vector<int> kPlain(8, 2);

class MicromapStructure : public GpuTest
{
protected:
    explicit MicromapStructure(const Options &options = {.api = Api::Khr}) : GpuTest(options) {}

    // The result of a ray at each of eight triangles: 0 nothing, 1 a hit, 2 a candidate.
    std::vector<int> traced(const Structure &scene)
    {
        std::vector<Ray> rays(8);
        for (size_t i = 0; i < 8; ++i)
            rays[i].origin = {1.5f * static_cast<float>(i) + 0.3f, 0.3f, 1};
        std::vector<int> out;
        for (const Result &r : Tracer(gpu()).trace(scene, rays))
            out.push_back(r.candidateCount > 0 ? 2 : r.committed == kTriangle ? 1 : 0);
        return out;
    }
    std::vector<int> tracedBottom(VkDeviceAddress reference)
    {
        VkAccelerationStructureInstanceKHR one{};
        one.transform.matrix[0][0] = one.transform.matrix[1][1] = one.transform.matrix[2][2] = 1;
        one.mask = 0xff;
        one.accelerationStructureReference = reference;
        return traced(Tlas(gpu(), {one}));
    }
    static Geometry mapped(const Micromap *micromap)
    {
        Geometry geometry{.vertices = triangleRow(8)};
        if (micromap != nullptr)
            geometry.micromap = Attachment{micromap};
        return geometry;
    }
    // The results of eight triangles with this micromap.
    std::vector<int> tracedMicromap(const Micromap &micromap)
    {
        return tracedBottom(Blas(gpu(), {mapped(&micromap)}).address());
    }
    // As above, for a structure without an object of class Micromap.
    std::vector<int> tracedMicromap(VkAccelerationStructureKHR micromap)
    {
        const Micromap any(gpu(), eightStates());
        Blas blas(gpu());
        blas.prepare({mapped(&any)});
        VkAccelerationStructureGeometryKHR geometry = blas.buildInfo().pGeometries[0];
        auto attachment =
            *static_cast<const VkAccelerationStructureTrianglesOpacityMicromapKHR *>(geometry.geometry.triangles.pNext);
        attachment.micromap = micromap;
        geometry.geometry.triangles.pNext = &attachment;
        BuildInfo info = blas.buildInfo();
        info.pGeometries = &geometry;
        build(info, blas.ranges());
        return tracedBottom(blas.address());
    }
    void build(const BuildInfo &info, const RangeInfo *ranges = nullptr)
    {
        gpu().submit([&](VkCommandBuffer commands) {
            gpu().vk().CmdBuildAccelerationStructuresKHR(commands, 1, &info, &ranges);
        });
    }
    void buildInto(const Micromap &input, VkAccelerationStructureKHR target)
    {
        const StructureBuild translated(input.buildInfo(), target);
        build(translated.info);
    }
    void copy(VkAccelerationStructureKHR from, VkAccelerationStructureKHR to,
              VkCopyAccelerationStructureModeKHR mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR)
    {
        gpu().submit([&](VkCommandBuffer commands) { recordCopy(gpu(), commands, from, to, mode); });
    }
    VkAccelerationStructureBuildSizesInfoKHR sizesOf(const BuildInfo &info, uint32_t primitives = 8)
    {
        auto sizes = vkInit<VkAccelerationStructureBuildSizesInfoKHR>();
        // VUID-vkGetAccelerationStructureBuildSizesKHR-pMaxPrimitiveCounts-11613
        const uint32_t *counts = info.type == kMicromapType ? nullptr : &primitives;
        gpu().vk().GetAccelerationStructureBuildSizesKHR(
            gpu().device(), VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &info, counts, &sizes);
        return sizes;
    }
    VkDeviceSize query(VkAccelerationStructureKHR structure, VkQueryType type)
    {
        return queryAll({structure}, type)[0];
    }
    // Queries on the host, and checks that a copy on the device gives the same values.
    std::vector<uint64_t> queryAll(const std::vector<VkAccelerationStructureKHR> &structures, VkQueryType type)
    {
        const auto count = static_cast<uint32_t>(structures.size());
        const QueryPool pool(gpu(), type, count + 1);
        const Buffer out(gpu(), 8 * count, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
        gpu().submit([&](VkCommandBuffer commands) {
            vkCmdResetQueryPool(commands, pool, 0, count + 1);
            gpu().vk().CmdWriteAccelerationStructuresPropertiesKHR(commands, count, structures.data(), type, pool, 1);
            vkCmdCopyQueryPoolResults(commands, pool, 1, count, out.handle(), 0, 8,
                                      VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT);
        });
        std::vector<uint64_t> values(count);
        EXPECT_EQ(
            vkGetQueryPoolResults(gpu().device(), pool, 1, count, 8 * count, values.data(), 8, VK_QUERY_RESULT_64_BIT),
            VK_SUCCESS);
        for (uint32_t i = 0; i < count; ++i)
            EXPECT_EQ(out.as<uint64_t>()[i], values[i]) << i;
        return values;
    }
    // A vkCreateAccelerationStructure2KHR that the layer rejects.
    void expectCreationRejected(VkAccelerationStructureTypeKHR type, const VkDeviceAddressRangeKHR &range,
                                const std::string &rule)
    {
        auto info = vkInit<VkAccelerationStructureCreateInfo2KHR>(
            {.addressRange = range, .addressFlags = kUnknownUsage, .type = type});
        VkAccelerationStructureKHR handle = VK_NULL_HANDLE;
        EXPECT_NE(gpu().vk().CreateAccelerationStructure2KHR(gpu().device(), &info, nullptr, &handle), VK_SUCCESS);
        EXPECT_EQ(handle, VkAccelerationStructureKHR{});
        expectRejected(rule);
    }
    // Exactly one message of the layer's since the last look, with that rule's whole name. A validation layer above
    // requests the sizes of a build itself, which the layer rejects as often.
    void expectRejected(const std::string &rule)
    {
        const std::vector<Message> messages = gpu().takeUnexpectedMessages();
        for (const Message &m : messages)
            EXPECT_EQ(m.id, "VELLUM-" + rule) << m.text;
        if (validationOfTests() == Validation::Above)
            EXPECT_GE(messages.size(), 1u) << rule;
        else
            EXPECT_EQ(messages.size(), 1u) << rule;
    }
};

} // namespace vt
