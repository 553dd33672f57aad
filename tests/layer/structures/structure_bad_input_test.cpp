// SPDX-License-Identifier: Apache-2.0
// Invalid copies of acceleration structures: the layer names the rule, writes nothing out of bounds, and the structures
// can be traced.
#include "command_buffer/state_scene.h"
#include "gpu/copies.h"
#include "harness/harness.h"
#include "harness/program/labels.h"
#include "structures/constants.h"

#include <algorithm>
#include <random>

namespace
{

const vt::Labels kStructureBadInputLabels{{"BadCopies.*", "slow strict_ext"}};

using namespace vt;

// Without the validation layer, which would report the deliberate errors, too.
class BadCopies : public GpuTest
{
protected:
    BadCopies() : GpuTest({.validation = false}) {}

    void SetUp() override
    {
        patchwork_ = std::make_unique<Patchwork>(gpu());
        source_ = std::make_unique<Blas>(gpu(), patchwork_->geometries());
        expected_ = seenOf(gpu(), *source_);
        expectNoMessages();
    }
    void TearDown() override
    {
        // The device goes on working.
        EXPECT_EQ(seenOf(gpu(), *source_), expected_);
        source_.reset();
        patchwork_.reset();
        StateScene scene(gpu());
        gpu().submit([&](VkCommandBuffer commands) { scene.record(commands); });
        scene.expectRight();
        GpuTest::TearDown();
    }

    // Vellum reports an error by that rule. What shaders find out is reported with the next command buffer.
    void expectFinding(const std::string &rule)
    {
        gpu().submit([](VkCommandBuffer) {});
        bool isReported = false;
        for (const Message &m : gpu().takeUnexpectedMessages()) {
            EXPECT_TRUE(m.fromVellum() && m.id.find(rule) != std::string::npos) << m.id << ": " << m.text;
            isReported = true;
        }
        EXPECT_TRUE(isReported) << "no message of " << rule;
    }

    std::unique_ptr<Structure> made(VkAccelerationStructureTypeKHR type, VkDeviceSize size)
    {
        auto structure = std::make_unique<Structure>(gpu(), type);
        structure->create(size);
        return structure;
    }

    void copyWith(VkAccelerationStructureKHR from, VkAccelerationStructureKHR to, int mode)
    {
        gpu().submit([&](VkCommandBuffer commands) {
            recordCopy(gpu(), commands, from, to, static_cast<VkCopyAccelerationStructureModeKHR>(mode));
        });
    }

    // The structure appears empty, and tracing it is harmless.
    void expectNothing(const Structure &structure, bool top)
    {
        const auto seenNow = top ? seen(gpu(), structure, Patchwork::rays()) : seenOf(gpu(), structure);
        for (const std::string &one : seenNow)
            EXPECT_EQ(one, "");
    }

    std::unique_ptr<Patchwork> patchwork_;
    std::unique_ptr<Blas> source_;
    std::vector<std::string> expected_;
};

TEST_F(BadCopies, Handles)
{
    const auto target = made(kBottom, source_->size());
    copyWith(VK_NULL_HANDLE, target->handle(), VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR);
    expectFinding("VkCopyAccelerationStructureInfoKHR-src-parameter");
    copyWith(source_->handle(), VK_NULL_HANDLE, VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR);
    expectFinding("VkCopyAccelerationStructureInfoKHR-dst-parameter");
    copyWith(source_->handle(), source_->handle(), VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR);
    expectFinding("VkCopyAccelerationStructureInfoKHR-dst-07791");
}

TEST_F(BadCopies, Modes)
{
    const auto target = made(kBottom, serialize(gpu(), *source_).deserializedSize());
    // With an invalid mode a copy clones; the other commands have only one possible mode.
    for (const int mode : {2, 3, 7, 0x7fffffff}) {
        const auto clone = made(kBottom, source_->size());
        copyWith(source_->handle(), clone->handle(), mode);
        expectFinding("VkCopyAccelerationStructureInfoKHR-mode-03410");
        if (!strictTests()) {
            EXPECT_EQ(seenOf(gpu(), *clone), expected_);
        }
    }
    const Buffer buffer(gpu(), 1 << 20, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    gpu().submit([&](VkCommandBuffer commands) {
        auto save = vkInit<VkCopyAccelerationStructureToMemoryInfoKHR>({.src = source_->handle()});
        save.dst.deviceAddress = buffer.address();
        save.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR;
        gpu().vk().CmdCopyAccelerationStructureToMemoryKHR(commands, &save);
    });
    expectFinding("VkCopyAccelerationStructureToMemoryInfoKHR-mode-03412");
    gpu().submit([&](VkCommandBuffer commands) {
        auto load = vkInit<VkCopyMemoryToAccelerationStructureInfoKHR>();
        load.src.deviceAddress = buffer.address();
        load.dst = target->handle();
        load.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR;
        gpu().vk().CmdCopyMemoryToAccelerationStructureKHR(commands, &load);
    });
    expectFinding("VkCopyMemoryToAccelerationStructureInfoKHR-mode-03413");
    if (!strictTests()) {
        EXPECT_EQ(seenOf(gpu(), *target), expected_);
    }
}

TEST_F(BadCopies, Addresses)
{
    const auto target = made(kBottom, serialize(gpu(), *source_).deserializedSize());
    const Buffer buffer(gpu(), 1 << 20, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    const VkDeviceAddress aligned = (buffer.address() + 255) / 256 * 256;
    const auto load = [&](VkDeviceAddress address, VkAccelerationStructureKHR to) {
        gpu().submit([&](VkCommandBuffer commands) {
            auto info = vkInit<VkCopyMemoryToAccelerationStructureInfoKHR>();
            info.src.deviceAddress = address;
            info.dst = to;
            info.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_DESERIALIZE_KHR;
            gpu().vk().CmdCopyMemoryToAccelerationStructureKHR(commands, &info);
        });
    };
    load(0, target->handle());
    expectFinding("pInfo-03742");
    load(aligned + 8, target->handle());
    expectFinding("pInfo-03743");
    load(aligned, VK_NULL_HANDLE);
    expectFinding("VkCopyMemoryToAccelerationStructureInfoKHR-dst-parameter");
    gpu().submit([&](VkCommandBuffer commands) { recordSerialize(gpu(), commands, *source_, 0); });
    expectFinding("pInfo-03739");
    gpu().submit([&](VkCommandBuffer commands) { recordSerialize(gpu(), commands, *source_, aligned + 8); });
    expectFinding("pInfo-03740");
    const Structure none(gpu(), kBottom);
    gpu().submit([&](VkCommandBuffer commands) { recordSerialize(gpu(), commands, none, aligned); });
    expectFinding("VkCopyAccelerationStructureToMemoryInfoKHR-src-parameter");
    // Aligned as far as the layer needs it.
    gpu().submit([&](VkCommandBuffer commands) { recordSerialize(gpu(), commands, *source_, aligned + 16); });
    expectFinding("pInfo-03740");
    load(aligned + 16, target->handle());
    expectFinding("pInfo-03743");
    if (!strictTests()) {
        EXPECT_EQ(seenOf(gpu(), *target), expected_);
    }
}

TEST_F(BadCopies, TargetsThatAreTooSmall)
{
    const auto half = made(kBottom, source_->size() / 2 / 256 * 256);
    copyWith(source_->handle(), half->handle(), VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR);
    expectFinding("mode-12418");
    // In a buffer with enough memory: lavapipe 26 writes all of a compacted copy, whatever the size of the structure.
    const Buffer buffer(gpu(), source_->size(), gpu().structureUsage());
    const auto tiny = std::make_unique<Structure>(gpu(), kBottom);
    tiny->placeIn(buffer.handle(), 0);
    tiny->create(256);
    copyWith(source_->handle(), tiny->handle(), VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR);
    expectFinding("mode-12419");
    expectNothing(*tiny, false);

    const Serialized data = serialize(gpu(), *source_);
    for (const VkDeviceSize size :
         {VkDeviceSize{128}, VkDeviceSize{256}, VkDeviceSize{4096}, data.deserializedSize() - 256}) {
        const auto small = made(kBottom, size);
        deserialize(gpu(), data, *small);
        expectFinding("VkCopyMemoryToAccelerationStructureInfoKHR-dst-03746");
        if (size >= 256) // else nothing was put there, not even an empty structure
            expectNothing(*small, false);
    }
    const Tlas top(gpu(), std::vector(50, instance(*source_, {}, 1)));
    const auto smallTop = made(kTop, top.size() / 2 / 256 * 256);
    copyWith(top.handle(), smallTop->handle(), VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR);
    expectFinding("mode-12419");
    expectNothing(*smallTop, true);
    const Serialized topData = serialize(gpu(), top);
    const auto smallLoaded = made(kTop, topData.deserializedSize() / 2 / 256 * 256);
    deserialize(gpu(), topData, *smallLoaded);
    expectFinding("dst-03746");
    expectNothing(*smallLoaded, true);
}

TEST_F(BadCopies, OtherTypes)
{
    const auto top = made(kTop, source_->size());
    copyWith(source_->handle(), top->handle(), VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR);
    expectFinding("VELLUM-copy-type");
    const auto topFromBottom = made(kTop, source_->size());
    deserialize(gpu(), serialize(gpu(), *source_), *topFromBottom);
    expectFinding("VELLUM-serialized-type");
    expectNothing(*topFromBottom, true);
    const Tlas scene(gpu(), {instance(*source_, {}, 1)});
    const auto bottomFromTop = made(kBottom, 1 << 16);
    deserialize(gpu(), serialize(gpu(), scene), *bottomFromTop);
    expectFinding("VELLUM-serialized-type");
    expectNothing(*bottomFromTop, false);
}

TEST_F(BadCopies, MemoryThatIsTooSmall)
{
    const Serialized data = serialize(gpu(), *source_);
    const Tlas scene(gpu(), std::vector(20, instance(*source_, {}, 1)));
    const Serialized topData = serialize(gpu(), scene);
    for (const Structure *structure : std::initializer_list<const Structure *>{source_.get(), &scene}) {
        const uint64_t total = structure == &scene ? topData.total() : data.total();
        for (const uint64_t size : {uint64_t{16}, uint64_t{64}, total / 2, total - 16}) {
            // Two buffers over the same memory: the data must stay in the smaller one.
            auto info = vkInit<VkBufferCreateInfo>(
                {.size = size,
                 .usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT});
            VkBuffer buffer = VK_NULL_HANDLE;
            VT_CHECK(vkCreateBuffer(gpu().device(), &info, nullptr, &buffer));
            VkMemoryRequirements needs;
            vkGetBufferMemoryRequirements(gpu().device(), buffer, &needs);
            needs.size = total + 65536;
            const VkDeviceMemory memory = gpu().allocate(needs, VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT);
            VT_CHECK(vkBindBufferMemory(gpu().device(), buffer, memory, 0));
            void *mapped = nullptr;
            VT_CHECK(vkMapMemory(gpu().device(), memory, 0, VK_WHOLE_SIZE, 0, &mapped));
            std::memset(mapped, 0xa5, total + 65536);
            const VkDeviceAddress address = gpu().address(buffer);
            gpu().submit([&](VkCommandBuffer commands) { recordSerialize(gpu(), commands, *structure, address); });
            expectFinding("VkCopyAccelerationStructureToMemoryInfoKHR-dst-03561");
            const auto *bytes = static_cast<const uint8_t *>(mapped);
            EXPECT_TRUE(std::all_of(bytes, bytes + total + 65536, [](uint8_t b) { return b == 0xa5; })) << size;
            vkDestroyBuffer(gpu().device(), buffer, nullptr);
            vkFreeMemory(gpu().device(), memory, nullptr);
        }
    }
}

TEST_F(BadCopies, ForeignData)
{
    const Serialized data = serialize(gpu(), *source_);
    const auto target = made(kBottom, data.deserializedSize());
    for (const size_t byte : {0u, 15u, 16u, 31u}) {
        Serialized changed = data;
        changed.bytes()[byte] ^= 0x40;
        deserialize(gpu(), changed, *target);
        expectFinding("VkCopyMemoryToAccelerationStructureInfoKHR-pInfo-03414");
        expectNothing(*target, false);
    }
    // Data that the driver serialized without the layer, which it would accept.
    Gpu without({.vellum = false, .validation = false, .micromaps = false});
    const Blas plain(without, {Geometry{.vertices = triangleRow(6)}});
    deserialize(gpu(), serialize(without, plain), *target);
    expectFinding("VkCopyMemoryToAccelerationStructureInfoKHR-pInfo-03414");
    expectNothing(*target, false);
    // The structure is not spoilt.
    deserialize(gpu(), data, *target);
    EXPECT_EQ(seenOf(gpu(), *target), expected_);
}

TEST_F(BadCopies, TruncatedData)
{
    const Tlas scene(gpu(), std::vector(20, instance(*source_, {}, 1)));
    for (const Structure *structure : std::initializer_list<const Structure *>{source_.get(), &scene}) {
        const bool top = structure == &scene;
        const Serialized data = serialize(gpu(), *structure);
        const auto target = made(top ? kTop : kBottom, data.deserializedSize());
        for (const uint64_t size : {uint64_t{16}, uint64_t{56}, uint64_t{120}, data.total() / 2, data.total() - 16}) {
            deserialize(gpu(), data, *target, size);
            expectFinding("VkCopyMemoryToAccelerationStructureInfoKHR-src-04960");
            expectNothing(*target, top);
            // The memory goes on, but the data does not.
            Serialized cut({data.bytes().begin(), data.bytes().begin() + static_cast<ptrdiff_t>(size)});
            cut.bytes().resize(data.bytes().size());
            if (cut.bytes() == data.bytes()) // only padding was cut off
                continue;
            deserialize(gpu(), cut, *target);
            gpu().submit([](VkCommandBuffer) {});
            EXPECT_FALSE(gpu().takeMessages().empty());
            expectNothing(*target, top);
        }
    }
}

TEST_F(BadCopies, DamagedData)
{
    const Tlas scene(gpu(), std::vector(20, instance(*source_, {}, 1)));
    std::mt19937 random(7);
    for (const Structure *structure : std::initializer_list<const Structure *>{source_.get(), &scene}) {
        const bool top = structure == &scene;
        const Serialized data = serialize(gpu(), *structure);
        const auto target = made(top ? kTop : kBottom, data.deserializedSize());
        for (int round = 0; round < 70; ++round) {
            // Headers first, then anywhere but in the handles and the padding, which are not protected.
            Serialized changed = data;
            const size_t protectedFrom = top ? 56 + 8 * 20 : 64;
            size_t byte = round < 16 ? 32 + static_cast<size_t>(round)
                                     : protectedFrom + random() % (data.bytes().size() - protectedFrom);
            if (round >= 16 && round < 40)
                byte = data.bytes().size() - (top ? 20 * 64 : 0) - 64 + static_cast<size_t>(round);
            const auto flip = static_cast<uint8_t>(1u << random() % 8);
            changed.bytes()[std::min(byte, data.bytes().size() - 1)] ^= flip;
            deserialize(gpu(), changed, *target);
            gpu().submit([](VkCommandBuffer) {});
            const bool reported = !gpu().takeMessages().empty();
            // Reserved words of the block's header mean nothing: there the data is as good as before.
            if (reported)
                expectNothing(*target, top);
            else
                EXPECT_EQ(top ? seen(gpu(), *target, Patchwork::rays()) : seenOf(gpu(), *target),
                          top ? seen(gpu(), scene, Patchwork::rays()) : expected_)
                    << "byte " << byte;
        }
    }
}

TEST_F(BadCopies, HandlesThatNameNothing)
{
    Blas second(gpu(), patchwork_->geometries());
    const Tlas scene(gpu(), {instance(*source_, {}, 1), instance(second, {20, 0, 0}, 2)});
    Serialized data = serialize(gpu(), scene);
    const auto expected = seen(gpu(), scene, Patchwork::rays());
    const auto target = made(kTop, data.deserializedSize());
    const auto rays = Patchwork::rays({20, 0, 0});
    for (const uint64_t wrong : {uint64_t{0x100}, ~uint64_t{0}, second.address() + 256}) {
        Serialized changed = data;
        changed.relocate([&](uint64_t handle) { return handle == second.address() ? wrong : handle; });
        deserialize(gpu(), changed, *target);
        expectFinding("VELLUM-copy-reference");
        EXPECT_EQ(seen(gpu(), *target, Patchwork::rays()), expected) << "the other instance is there";
        for (const std::string &one : seen(gpu(), *target, rays))
            EXPECT_EQ(one, "");
    }
    // Created but not built, with the descriptor of one that was.
    std::make_unique<Blas>(gpu(), patchwork_->geometries()).reset();
    const auto unbuilt = made(kBottom, second.size());
    Serialized changed = data;
    changed.relocate([&](uint64_t handle) { return handle == second.address() ? unbuilt->address() : handle; });
    deserialize(gpu(), changed, *target);
    expectFinding("VELLUM-copy-unbuilt-reference");
    EXPECT_EQ(seen(gpu(), *target, Patchwork::rays()), expected);
}

// The driver, which follows references when it builds, gets none that lead nowhere.
TEST_F(BadCopies, InstancesThatReferenceNoBottomLevelStructure)
{
    const auto expected = seen(gpu(), Tlas(gpu(), {instance(*source_, {}, 1)}), Patchwork::rays());
    const Buffer zeros(gpu(), 65536, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    const Tlas top(gpu(), {instance(*source_, {}, 1)});
    auto destroyed = std::make_unique<Blas>(gpu(), patchwork_->geometries());
    const VkDeviceAddress gone = destroyed->address();
    destroyed.reset();
    for (const VkDeviceAddress wrong : {VkDeviceAddress{0x1234567800}, ~VkDeviceAddress{255}, zeros.address(),
                                        source_->address() + 256, top.address(), gone}) {
        VkAccelerationStructureInstanceKHR other = instance(*source_, {20, 0, 0}, 2);
        other.accelerationStructureReference = wrong;
        const Tlas scene(gpu(), {instance(*source_, {}, 1), other});
        expectFinding("vkCmdBuildAccelerationStructuresKHR-pInfos-12281");
        EXPECT_EQ(seen(gpu(), scene, Patchwork::rays()), expected) << std::hex << wrong;
        for (const std::string &one : seen(gpu(), scene, Patchwork::rays({20, 0, 0})))
            EXPECT_EQ(one, "");
    }
}

// A copy of a scene whose bottom-level structure is gone.
TEST_F(BadCopies, DestroyedReferences)
{
    auto gone = std::make_unique<Blas>(gpu(), patchwork_->geometries());
    const Tlas scene(gpu(), {instance(*source_, {}, 1), instance(*gone, {20, 0, 0}, 2)});
    const auto target = made(kTop, scene.size());
    gone.reset();
    copyWith(scene.handle(), target->handle(), VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR);
    expectFinding("VELLUM-copy-reference");
    for (const std::string &one : seen(gpu(), *target, Patchwork::rays({20, 0, 0})))
        EXPECT_EQ(one, "");
    EXPECT_EQ(seen(gpu(), *target, Patchwork::rays()),
              seen(gpu(), Tlas(gpu(), {instance(*source_, {}, 1)}), Patchwork::rays()));
}

TEST_F(BadCopies, SourcesThatWereNeverBuilt)
{
    // Undefined content; the layer's part does no harm. Nor does the descriptor of one that was built.
    std::make_unique<Tlas>(gpu(), std::vector{instance(*source_, {}, 1)}).reset();
    const auto unbuilt = made(kTop, 1 << 16), target = made(kTop, 1 << 16);
    copyWith(unbuilt->handle(), target->handle(), VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR);
    expectNothing(*target, true);
    const Guarded memory(gpu(), 4096, 256,
                         VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    gpu().submit([&](VkCommandBuffer commands) { recordSerialize(gpu(), commands, *unbuilt, memory.address()); });
    const Serialized data({memory.bytes(), memory.bytes() + memory.size()});
    EXPECT_EQ(data.handleCount(), 0u);
    expectNothing(*deserialized(gpu(), data, kTop), true);
}

} // namespace
