// SPDX-License-Identifier: Apache-2.0
// Serialized bottom-level structures that name micromaps of VK_KHR_opacity_micromap: the blocks of the header
// ("serialized-as-header" in the specification), which the application changes before it deserializes.
#include "micromaps/micromap_structures.h"

#include <algorithm>

#include "core/records.h"
#include "harness/program/labels.h"

namespace
{

const vt::Labels kStructureBlocksLabels{{"StructureBlocks.*", "one_api stacked serialized"}};

using namespace vt;

// The words of the header behind the sizes.
struct Blocks {
    explicit Blocks(Serialized &data) : data_(data) {}
    [[nodiscard]] uint32_t word(size_t i) const
    {
        uint32_t value = 0;
        std::memcpy(&value, data_.bytes().data() + i * 4, 4);
        return value;
    }
    void setWord(size_t i, uint32_t value) { std::memcpy(data_.bytes().data() + i * 4, &value, 4); }
    [[nodiscard]] uint32_t format() const { return word(13); }
    [[nodiscard]] uint32_t count() const { return word(12); }
    [[nodiscard]] uint32_t type() const { return word(14); }
    [[nodiscard]] uint64_t addresses() const { return data_.handle(1); }
    [[nodiscard]] uint64_t address(size_t i) const { return data_.handle(2 + i); }
    void setAddress(size_t i, uint64_t value) { data_.setHandle(2 + i, value); }

private:
    Serialized &data_;
};

class StructureBlocks : public GpuTest
{
protected:
    StructureBlocks() : GpuTest({.api = Api::Khr}) {}

    VkDeviceAddress addressOf(const Micromap &micromap)
    {
        auto info =
            vkInit<VkAccelerationStructureDeviceAddressInfoKHR>({.accelerationStructure = micromap.handle().khr});
        return gpu().vk().GetAccelerationStructureDeviceAddressKHR(gpu().device(), &info);
    }
    // A micromap made like another, with its content once `copyTo` has executed.
    std::unique_ptr<Micromap> like(const Micromap &other)
    {
        return std::make_unique<Micromap>(gpu(), other, other.size());
    }
    void copyTo(const Micromap &from, const Micromap &to)
    {
        gpu().submit(
            [&](VkCommandBuffer commands) { recordCopy(gpu(), commands, from.handle().khr, to.handle().khr); });
    }
    // The ids of the unexpected messages.
    std::vector<std::string> ids()
    {
        std::vector<std::string> out;
        for (const Message &m : gpu().takeUnexpectedMessages())
            out.push_back(m.id);
        return out;
    }
};

TEST_F(StructureBlocks, HeaderNamesTheMicromaps)
{
    const Patchwork patchwork(gpu());
    const Blas blas(gpu(), patchwork.geometries());
    Serialized data = serialize(gpu(), blas);
    EXPECT_EQ(queried(gpu(), blas, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR), data.total());
    const Blocks blocks(data);
    EXPECT_EQ(blocks.format(), 0xffffffffu);
    ASSERT_EQ(blocks.count(), 1u);
    EXPECT_EQ(blocks.type(), VK_ACCELERATION_STRUCTURE_SERIALIZED_BLOCK_TYPE_OPACITY_MICROMAP_KHR);
    // Three geometries of the patchwork have a micromap: one the first, and two the second.
    std::vector<uint64_t> expected;
    for (const Geometry &geometry : patchwork.geometries()) {
        if (geometry.micromap && geometry.micromap->micromap != nullptr)
            expected.push_back(addressOf(*geometry.micromap->micromap));
    }
    ASSERT_EQ(blocks.addresses(), expected.size());
    for (size_t i = 0; i < expected.size(); ++i)
        EXPECT_EQ(blocks.address(i), expected[i]);
}

TEST_F(StructureBlocks, NoMicromapsNoBlocks)
{
    const Blas plain(gpu(), {Geometry{.vertices = triangleRow(6)}});
    Serialized data = serialize(gpu(), plain);
    const Blocks blocks(data);
    EXPECT_EQ(blocks.format(), 0xffffffffu);
    EXPECT_EQ(blocks.count(), 0u);
    const auto back = deserialized(gpu(), data, kBottom);
    EXPECT_EQ(seenOf(gpu(), *back), seenOf(gpu(), plain));
}

TEST_F(StructureBlocks, SameAddresses)
{
    const Patchwork patchwork(gpu());
    const Blas blas(gpu(), patchwork.geometries());
    const Serialized data = serialize(gpu(), blas);
    const auto back = deserialized(gpu(), data, kBottom);
    EXPECT_EQ(seenOf(gpu(), *back), seenOf(gpu(), blas));
}

// A handle that is created later over a micromap's memory does not change its content.
TEST_F(StructureBlocks, SmallerMicromapInTheSameMemory)
{
    const Patchwork patchwork(gpu());
    const Blas blas(gpu(), patchwork.geometries());
    const Serialized data = serialize(gpu(), blas);
    const Placed other(gpu(), kMicromapType, addressOf(patchwork.micromap(0)), 64);
    ASSERT_GT(patchwork.micromap(0).size(), other.size());
    const auto back = deserialized(gpu(), data, kBottom);
    EXPECT_EQ(seenOf(gpu(), *back), seenOf(gpu(), blas));
}

// The micromaps are other objects, whose content may come after the structure's.
TEST_F(StructureBlocks, OtherAddresses)
{
    const Patchwork patchwork(gpu());
    std::vector<std::string> expected;
    std::map<uint64_t, std::unique_ptr<Micromap>> moved;
    Serialized data;
    {
        const Blas blas(gpu(), patchwork.geometries());
        expected = seenOf(gpu(), blas);
        data = serialize(gpu(), blas);
    }
    Blocks blocks(data);
    for (size_t i = 0; i < 2; ++i)
        moved[addressOf(patchwork.micromap(i))] = like(patchwork.micromap(i));
    for (size_t i = 0; i < blocks.addresses(); ++i)
        blocks.setAddress(i, addressOf(*moved.at(blocks.address(i))));
    const auto back = deserialized(gpu(), data, kBottom);
    for (size_t i = 0; i < 2; ++i)
        copyTo(patchwork.micromap(i), *moved.at(addressOf(patchwork.micromap(i))));
    for (size_t i = 0; i < 2; ++i) {
        std::memset(const_cast<uint8_t *>(patchwork.micromap(i).memory()), 0x33,
                    static_cast<size_t>(patchwork.micromap(i).size()));
    }
    EXPECT_EQ(seenOf(gpu(), *back), expected);

    // Serialized again, the data names the current micromaps.
    Serialized again = serialize(gpu(), *back);
    const Blocks second(again);
    ASSERT_EQ(second.addresses(), blocks.addresses());
    for (size_t i = 0; i < blocks.addresses(); ++i)
        EXPECT_EQ(second.address(i), blocks.address(i));
    const auto third = deserialized(gpu(), again, kBottom);
    EXPECT_EQ(seenOf(gpu(), *third), expected);
}

TEST_F(StructureBlocks, CopiesKeepTheNames)
{
    const Patchwork patchwork(gpu());
    const Blas blas(gpu(), patchwork.geometries(), VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR);
    Serialized first = serialize(gpu(), blas);
    Structure compact(gpu(), kBottom);
    compact.create(queried(gpu(), blas, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR));
    copy(gpu(), blas, compact, VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR);
    Serialized second = serialize(gpu(), compact);
    const Blocks a(first), b(second);
    ASSERT_EQ(a.addresses(), b.addresses());
    for (size_t i = 0; i < a.addresses(); ++i)
        EXPECT_EQ(a.address(i), b.address(i));
    EXPECT_EQ(seenOf(gpu(), *deserialized(gpu(), second, kBottom)), seenOf(gpu(), blas));
}

// VUID-VkCopyMemoryToAccelerationStructureInfoKHR-dst-11585: reported, and the geometry has no micromap.
TEST_F(StructureBlocks, AddressesOfNoMicromap)
{
    const Patchwork patchwork(gpu());
    const Blas blas(gpu(), patchwork.geometries());
    auto geometries = patchwork.geometries();
    for (Geometry &geometry : geometries) {
        if (geometry.micromap && geometry.micromap->micromap != nullptr)
            geometry.micromap.reset();
    }
    const auto without = seenOf(gpu(), Blas(gpu(), geometries));
    const Serialized data = serialize(gpu(), blas);
    const Micromap &known = patchwork.micromap(0);
    for (const uint64_t wrong : {uint64_t{0}, uint64_t{1} << 40, addressOf(known) + 256, addressOf(known) + 1}) {
        SCOPED_TRACE(wrong);
        Serialized changed = data;
        Blocks blocks(changed);
        for (size_t i = 0; i < blocks.addresses(); ++i)
            blocks.setAddress(i, wrong);
        const auto back = deserialized(gpu(), changed, kBottom);
        EXPECT_EQ(seenOf(gpu(), *back), without);
        const auto expected = {std::string("VELLUM-VUID-VkCopyMemoryToAccelerationStructureInfoKHR-dst-11585")};
        EXPECT_EQ(ids(), std::vector<std::string>(expected));
    }
}

// An instance of such a structure, of which the device knows only that it has no micromap, is copied as it was written:
// with another structure in the place of that one its micromap is seen.
TEST_F(StructureBlocks, InstancesOfStructuresWithoutTheirMicromap)
{
    const Patchwork patchwork(gpu());
    for (Geometry &geometry : patchwork.geometries()) {
        if (!geometry.micromap || geometry.micromap->micromap == nullptr)
            continue;
        const Blas blas(gpu(), {geometry});
        Serialized data = serialize(gpu(), blas);
        Blocks(data).setAddress(0, 0);
        const auto lost = deserialized(gpu(), data, kBottom);
        Serialized top = serialize(gpu(), Tlas(gpu(), std::vector{instance(*lost, {}, 0)}));
        top.relocate([&](uint64_t) { return blas.address(); });
        EXPECT_EQ(
            seen(gpu(), *deserialized(gpu(), top, VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR), Patchwork::rays()),
            seen(gpu(), Tlas(gpu(), std::vector{instance(blas, {}, 0)}), Patchwork::rays()));
        EXPECT_EQ(ids(), std::vector<std::string>{"VELLUM-VUID-VkCopyMemoryToAccelerationStructureInfoKHR-dst-11585"});
    }
}

// The key of a deleted entry in the table of addresses (core/records.h) is not a valid address.
TEST_F(StructureBlocks, AddressThatMarksDeletedEntries)
{
    using namespace vellum::shared;
    const Patchwork patchwork(gpu());
    const Blas blas(gpu(), patchwork.geometries());
    Serialized data = serialize(gpu(), blas);
    // Three micromaps that want the place of that key; the first one's is deleted, in the middle of the others' search.
    const Buffer memory(gpu(), 1 << 24,
                        VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR |
                            VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    constexpr uint32_t kMask = 1023;
    std::vector<VkAccelerationStructureKHR> structures;
    for (VkDeviceAddress at = memory.address(); structures.size() < 3 && at < memory.address() + (1 << 23);
         at += 65536) {
        for (VkDeviceAddress address = at; address < at + 65536; address += 256) {
            const VkDeviceAddress key = address + kMicromapKey;
            const auto hash = hashReference(static_cast<uint32_t>(key), static_cast<uint32_t>(key >> 32));
            if ((hash & kMask) != (hashReference(~0u, ~0u) & kMask))
                continue;
            auto info = vkInit<VkAccelerationStructureCreateInfo2KHR>(
                {.addressRange = {address, 1 << 20}, .type = VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR});
            VT_CHECK(
                gpu().vk().CreateAccelerationStructure2KHR(gpu().device(), &info, nullptr, &structures.emplace_back()));
            break;
        }
    }
    ASSERT_EQ(structures.size(), 3u);
    {
        // Descriptors of destroyed structures are reused first.
        const Blas other(gpu(), {Geometry{.vertices = triangleRow(1)}}), another(gpu(), patchwork.geometries());
        gpu().vk().DestroyAccelerationStructureKHR(gpu().device(), structures[0], nullptr);
    }
    Blocks blocks(data);
    for (size_t i = 0; i < blocks.addresses(); ++i)
        blocks.setAddress(i, ~uint64_t{0} - kMicromapKey);
    const auto back = deserialized(gpu(), data, kBottom);
    (void)seenOf(gpu(), *back);
    EXPECT_EQ(ids(), std::vector<std::string>{"VELLUM-VUID-VkCopyMemoryToAccelerationStructureInfoKHR-dst-11585"});
    for (size_t i = 1; i < structures.size(); ++i)
        gpu().vk().DestroyAccelerationStructureKHR(gpu().device(), structures[i], nullptr);
}

// "Memory does not need to be bound to the underlying buffer when vkCreateAccelerationStructureKHR is called."
TEST_F(StructureBlocks, GenericStructuresMadeBeforeTheirMemory)
{
    const Patchwork patchwork(gpu());
    const Blas blas(gpu(), patchwork.geometries());
    const auto expected = seenOf(gpu(), blas);
    Serialized data = serialize(gpu(), blas);
    auto create = vkInit<VkBufferCreateInfo>(
        {.usage = VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT});
    const VkDeviceSize second = (patchwork.micromap(0).size() + 255) / 256 * 256;
    create.size = second + patchwork.micromap(1).size();
    VkBuffer buffer = VK_NULL_HANDLE;
    VT_CHECK(vkCreateBuffer(gpu().device(), &create, nullptr, &buffer));
    VkAccelerationStructureKHR structures[2] = {};
    for (size_t i = 0; i < 2; ++i) {
        auto info = vkInit<VkAccelerationStructureCreateInfoKHR>({.buffer = buffer,
                                                                  .offset = i * second,
                                                                  .size = patchwork.micromap(i).size(),
                                                                  .type = VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR});
        VT_CHECK(gpu().vk().CreateAccelerationStructureKHR(gpu().device(), &info, nullptr, &structures[i]));
    }
    const VkDeviceMemory memory = gpu().bindMemory(buffer);

    std::map<uint64_t, uint64_t> moved;
    for (size_t i = 0; i < 2; ++i)
        moved[addressOf(patchwork.micromap(i))] = gpu().address(buffer) + i * second;
    Blocks blocks(data);
    for (size_t i = 0; i < blocks.addresses(); ++i)
        blocks.setAddress(i, moved.at(blocks.address(i)));
    const auto back = deserialized(gpu(), data, kBottom);
    gpu().submit([&](VkCommandBuffer commands) {
        for (size_t i = 0; i < 2; ++i)
            recordCopy(gpu(), commands, patchwork.micromap(i).handle().khr, structures[i]);
    });
    EXPECT_EQ(seenOf(gpu(), *back), expected);
    EXPECT_EQ(ids(), std::vector<std::string>{});
    for (const VkAccelerationStructureKHR structure : structures)
        gpu().vk().DestroyAccelerationStructureKHR(gpu().device(), structure, nullptr);
    vkDestroyBuffer(gpu().device(), buffer, nullptr);
    vkFreeMemory(gpu().device(), memory, nullptr);
}

TEST_F(StructureBlocks, MicromapThatIsTooSmall)
{
    const Patchwork patchwork(gpu());
    const Blas blas(gpu(), patchwork.geometries());
    Serialized data = serialize(gpu(), blas);
    const Micromap small(gpu(), patchwork.micromap(0), 128);
    Blocks blocks(data);
    blocks.setAddress(0, addressOf(small));
    const auto back = deserialized(gpu(), data, kBottom);
    (void)seenOf(gpu(), *back);
    EXPECT_EQ(ids(), std::vector<std::string>{"VELLUM-VUID-VkCopyMemoryToAccelerationStructureInfoKHR-dst-11585"});
}

// VUID-VkCopyMemoryToAccelerationStructureInfoKHR-src-11583, and invalid headers: the whole copy is rejected.
TEST_F(StructureBlocks, DamagedHeaders)
{
    const Patchwork patchwork(gpu());
    const Blas blas(gpu(), patchwork.geometries());
    const Serialized data = serialize(gpu(), blas);
    const std::vector<std::pair<size_t, uint32_t>> changes{
        {12, 0}, {12, 2}, {12, 0xffffffffu}, {13, 0}, {13, 1}, {14, 1}, {16, 0}, {16, 5}, {16, 0xfffffffu}, {17, 1}};
    for (const auto &[word, value] : changes) {
        SCOPED_TRACE(testing::Message() << "word " << word << " = " << value);
        Serialized changed = data;
        Blocks(changed).setWord(word, value);
        const auto back = deserialized(gpu(), changed, kBottom);
        const auto seen = seenOf(gpu(), *back);
        EXPECT_TRUE(std::all_of(seen.begin(), seen.end(), [](const std::string &s) { return s.empty(); }));
        const auto got = ids();
        ASSERT_FALSE(got.empty());
        EXPECT_EQ(got.front(), "VELLUM-VUID-VkCopyMemoryToAccelerationStructureInfoKHR-src-04960");
    }
}

} // namespace
