// Structures whose address is not where they lie: only that of a GENERIC one must be
// (vkGetAccelerationStructureDeviceAddressKHR). The driver is lavapipe with the trait "elsewhere".
#include "harness/copies.h"

namespace
{

using namespace vt;

class StructureAddresses : public GpuTest
{
protected:
    StructureAddresses() : GpuTest({.traits = "elsewhere"}) {}
};

// Two handles for one content, with an address each: instances may name either.
TEST_F(StructureAddresses, TwoOfOnePlace)
{
    const Patchwork patchwork(gpu());
    const Buffer room(gpu(), 65536, gpu().structureUsage() | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    for (const bool genericFirst : {false, true}) {
        Blas blas(gpu());
        Structure generic(gpu(), VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR);
        blas.placeIn(room.handle(), 256);
        generic.placeIn(room.handle(), 256);
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

// The same memory, whatever their addresses are.
TEST_F(StructureAddresses, CopyToItself)
{
    const Patchwork patchwork(gpu());
    const Buffer room(gpu(), 65536, gpu().structureUsage() | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    Blas blas(gpu());
    Structure generic(gpu(), VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR);
    blas.placeIn(room.handle(), 256);
    blas.build(patchwork.geometries());
    generic.placeIn(room.handle(), 256);
    generic.create(32768);
    copy(gpu(), blas, generic);
    bool refused = false;
    for (const Message &m : gpu().takeMessages())
        refused = refused || m.id == "VELLUM-VUID-VkCopyAccelerationStructureInfoKHR-dst-07791";
    EXPECT_TRUE(refused);
}

} // namespace
