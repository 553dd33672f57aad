// SPDX-License-Identifier: Apache-2.0
// Structures whose device address is not that of their memory; only GENERIC ones must have the latter
// (vkGetAccelerationStructureDeviceAddressKHR). The driver is lavapipe with the quirk "elsewhere".
#include "gpu/copies.h"
#include "harness/harness.h"

namespace
{

using namespace vt;

class StructureAddresses : public GpuTest
{
protected:
    StructureAddresses() : GpuTest({.quirks = "elsewhere"}) {}
};

// Two structures with one content and an address each: instances may name either.
TEST_F(StructureAddresses, TwoAtOneAddress)
{
    const Patchwork patchwork(gpu());
    const Buffer buffer(gpu(), 65536, gpu().structureUsage() | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    for (const bool genericFirst : {false, true}) {
        Blas blas(gpu());
        Structure generic(gpu(), VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR);
        blas.placeIn(buffer.handle(), 256);
        generic.placeIn(buffer.handle(), 256);
        if (genericFirst)
            generic.create(32768);
        blas.build(patchwork.geometries());
        if (!genericFirst)
            generic.create(32768);
        ASSERT_NE(blas.address(), generic.address());
        const auto expected = seenOf(gpu(), Blas(gpu(), patchwork.geometries()));
        EXPECT_EQ(seenOf(gpu(), blas), expected);
        EXPECT_EQ(seenOf(gpu(), generic), expected);
    }
}

// A structure that is gone, while another one at its place lives on, has no address any more: the driver gives it to
// one somewhere else.
TEST_F(StructureAddresses, OneThatIsReused)
{
    const Patchwork first(gpu(), 1), second(gpu(), 2);
    const VkBufferUsageFlags usage = gpu().structureUsage() | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;
    const Buffer buffer(gpu(), 65536, usage), other(gpu(), 65536, usage);
    const auto expectedFirst = seenOf(gpu(), Blas(gpu(), first.geometries()));
    const auto expectedSecond = seenOf(gpu(), Blas(gpu(), second.geometries()));
    ASSERT_NE(expectedFirst, expectedSecond);
    // The address of the remaining one is queried before or after the other is destroyed.
    for (const bool isQueried : {false, true}) {
        auto gone = std::make_unique<Blas>(gpu());
        gone->placeIn(buffer.handle(), 256);
        gone->build(first.geometries());
        const VkDeviceAddress address = gone->address();
        auto info = vkInit<VkAccelerationStructureCreateInfoKHR>({.buffer = buffer.handle(),
                                                                  .offset = 256,
                                                                  .size = 32768,
                                                                  .type = VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR});
        VkAccelerationStructureKHR stays = VK_NULL_HANDLE;
        VT_CHECK(gpu().vk().CreateAccelerationStructureKHR(gpu().device(), &info, nullptr, &stays));
        auto query = vkInit<VkAccelerationStructureDeviceAddressInfoKHR>({.accelerationStructure = stays});
        if (isQueried)
            gpu().vk().GetAccelerationStructureDeviceAddressKHR(gpu().device(), &query);
        gone.reset();

        Blas elsewhere(gpu());
        elsewhere.placeIn(other.handle(), 256);
        elsewhere.build(second.geometries());
        ASSERT_EQ(elsewhere.address(), address);
        VkAccelerationStructureInstanceKHR named = instance(elsewhere, {}, 77);
        named.accelerationStructureReference =
            gpu().vk().GetAccelerationStructureDeviceAddressKHR(gpu().device(), &query);
        EXPECT_EQ(seen(gpu(), Tlas(gpu(), {named}), Patchwork::rays()), expectedFirst);
        EXPECT_EQ(seenOf(gpu(), elsewhere), expectedSecond);
        gpu().vk().DestroyAccelerationStructureKHR(gpu().device(), stays, nullptr);
    }
}

// A structure of vkCreateAccelerationStructure2KHR has the address of its range, whatever its type.
TEST(StructureAddressesKhr, OfARange)
{
    Gpu gpu({.quirks = "elsewhere", .api = Api::Khr});
    const Buffer buffer(gpu, 65536, gpu.structureUsage() | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    for (const auto type :
         {VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR, VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR,
          VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR, VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR}) {
        auto info = vkInit<VkAccelerationStructureCreateInfo2KHR>(
            {.addressRange = {buffer.address() + 256, 32768}, .addressFlags = kUnknownUsage, .type = type});
        VkAccelerationStructureKHR structure = VK_NULL_HANDLE;
        VT_CHECK(gpu.vk().CreateAccelerationStructure2KHR(gpu.device(), &info, nullptr, &structure));
        auto query = vkInit<VkAccelerationStructureDeviceAddressInfoKHR>({.accelerationStructure = structure});
        EXPECT_EQ(gpu.vk().GetAccelerationStructureDeviceAddressKHR(gpu.device(), &query), info.addressRange.address)
            << type;
        gpu.vk().DestroyAccelerationStructureKHR(gpu.device(), structure, nullptr);
    }
}

// Objects may be destroyed in any order: after the buffer, the driver is not called for structures in it.
TEST_F(StructureAddresses, DestroyedBuffer)
{
    auto buffer =
        std::make_unique<Buffer>(gpu(), 65536, gpu().structureUsage() | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    auto info = vkInit<VkAccelerationStructureCreateInfoKHR>(
        {.buffer = buffer->handle(), .size = 32768, .type = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR});
    VkAccelerationStructureKHR queried = VK_NULL_HANDLE, never = VK_NULL_HANDLE;
    VT_CHECK(gpu().vk().CreateAccelerationStructureKHR(gpu().device(), &info, nullptr, &queried));
    VT_CHECK(gpu().vk().CreateAccelerationStructureKHR(gpu().device(), &info, nullptr, &never));
    auto query = vkInit<VkAccelerationStructureDeviceAddressInfoKHR>({.accelerationStructure = queried});
    EXPECT_NE(gpu().vk().GetAccelerationStructureDeviceAddressKHR(gpu().device(), &query), 0u);
    buffer.reset();
    gpu().vk().DestroyAccelerationStructureKHR(gpu().device(), queried, nullptr);
    gpu().vk().DestroyAccelerationStructureKHR(gpu().device(), never, nullptr);
}

// Content stays at an address, also while no structure with an address of the driver exists there.
TEST(StructureAddressesKhr, OneThatIsMadeAgain)
{
    Gpu gpu({.quirks = "elsewhere", .api = Api::Khr});
    const Patchwork patchwork(gpu);
    const auto expected = seenOf(gpu, Blas(gpu, patchwork.geometries()));
    const Buffer buffer(gpu, 65536, gpu.structureUsage() | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    auto gone = std::make_unique<Blas>(gpu);
    gone->placeIn(buffer.handle(), 256);
    gone->build(patchwork.geometries());
    const VkDeviceSize size = gone->size();
    auto info = vkInit<VkAccelerationStructureCreateInfo2KHR>(
        {.addressRange = {buffer.address() + 256, 256}, .type = VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR});
    VkAccelerationStructureKHR micromap = VK_NULL_HANDLE;
    VT_CHECK(gpu.vk().CreateAccelerationStructure2KHR(gpu.device(), &info, nullptr, &micromap));
    gone.reset();
    Blas again(gpu);
    again.placeIn(buffer.handle(), 256);
    again.create(size);
    EXPECT_EQ(seenOf(gpu, again), expected);
    gpu.vk().DestroyAccelerationStructureKHR(gpu.device(), micromap, nullptr);
    for (const Message &m : gpu.takeUnexpectedMessages())
        ADD_FAILURE() << m.id << ": " << m.text;
}

// Both are the same memory, even if their addresses differ.
TEST_F(StructureAddresses, CopyToItself)
{
    const Patchwork patchwork(gpu());
    const Buffer buffer(gpu(), 65536, gpu().structureUsage() | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    Blas blas(gpu());
    Structure generic(gpu(), VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR);
    blas.placeIn(buffer.handle(), 256);
    blas.build(patchwork.geometries());
    generic.placeIn(buffer.handle(), 256);
    generic.create(32768);
    copy(gpu(), blas, generic);
    bool rejected = false;
    for (const Message &m : gpu().takeMessages())
        rejected = rejected || m.id == "VELLUM-VUID-VkCopyAccelerationStructureInfoKHR-dst-07791";
    EXPECT_TRUE(rejected);
}

} // namespace
