// SPDX-License-Identifier: Apache-2.0
// Capture and replay of addresses, as capture tools use it: what one process has recorded is played in another, with
// all memory and structures at their earlier addresses, and with the bytes that the first process wrote, in which
// instances name bottom-level structures by these addresses.
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "gpu/copies.h"
#include "harness/harness.h"

#include "harness/program/labels.h"

using namespace vt;

namespace
{

const vt::Labels kCaptureReplayLabels{{"CaptureReplay.*", "slow unforced unpacked"}};

constexpr const char *kFile = "VELLUM_TEST_CAPTURED"; // the file of a capture
constexpr const char *kReplays = "VELLUM_TEST_REPLAYS";
constexpr const char *kDriver = "capable,replay";
constexpr VkDeviceSize kBytes = VkDeviceSize{1} << 20; // of a structure

// The record of a capture tool: addresses and bytes, in the order of use.
class Captured
{
public:
    Captured(std::string path, bool replays) : path_(std::move(path)), replays_(replays)
    {
        std::ifstream file(path_, std::ios::binary);
        if (replays_)
            content_.assign(std::istreambuf_iterator<char>(file), {});
    }
    Captured(const Captured &) = delete;
    Captured &operator=(const Captured &) = delete;
    ~Captured()
    {
        if (!replays_)
            std::ofstream(path_, std::ios::binary) << content_;
    }

    [[nodiscard]] bool replays() const { return replays_; }
    // Keeps a value, or returns the earlier one.
    template <class T>
    T kept(const T &now)
    {
        T value = now;
        if (!replays_)
            content_.append(reinterpret_cast<const char *>(&now), sizeof now);
        else if (at_ + sizeof value <= content_.size())
            std::memcpy(&value, content_.data() + at_, sizeof value);
        else
            ADD_FAILURE() << "the capture ends";
        at_ += sizeof value;
        return value;
    }
    // The earlier address; 0 in the first process.
    uint64_t earlier()
    {
        uint64_t value = 0;
        if (replays_)
            std::memcpy(&value, content_.data() + at_, sizeof value);
        return value;
    }

private:
    std::string path_, content_;
    bool replays_;
    size_t at_ = 0;
};

// Memory for structures at its earlier address.
class Place
{
public:
    Place(Gpu &gpu, Captured &captured, VkDeviceSize size) : gpu_(gpu)
    {
        const uint64_t buffer = captured.earlier();
        const auto again = vkInit<VkBufferOpaqueCaptureAddressCreateInfo>({.opaqueCaptureAddress = buffer});
        const auto info = vkInit<VkBufferCreateInfo>({.pNext = &again,
                                                      .flags = VK_BUFFER_CREATE_DEVICE_ADDRESS_CAPTURE_REPLAY_BIT,
                                                      .size = size,
                                                      .usage = VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR |
                                                               VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT});
        VT_CHECK(vkCreateBuffer(gpu.device(), &info, nullptr, &buffer_));
        VkMemoryRequirements needs;
        vkGetBufferMemoryRequirements(gpu.device(), buffer_, &needs);
        const auto bufferInfo = vkInit<VkBufferDeviceAddressInfo>({.buffer = buffer_});
        // The opaque addresses of the mock driver are those of memory.
        const auto memoryAgain = vkInit<VkMemoryOpaqueCaptureAddressAllocateInfo>({.opaqueCaptureAddress = buffer});
        const auto flags = vkInit<VkMemoryAllocateFlagsInfo>(
            {.pNext = &memoryAgain,
             .flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT | VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_CAPTURE_REPLAY_BIT});
        const auto allocation =
            vkInit<VkMemoryAllocateInfo>({.pNext = &flags,
                                          .allocationSize = needs.size,
                                          .memoryTypeIndex = gpu.memoryType(needs.memoryTypeBits, 0)});
        VT_CHECK(vkAllocateMemory(gpu.device(), &allocation, nullptr, &memory_));
        VT_CHECK(vkBindBufferMemory(gpu.device(), buffer_, memory_, 0));
        const uint64_t now = vkGetBufferOpaqueCaptureAddress(gpu.device(), &bufferInfo);
        EXPECT_EQ(captured.kept(now), now);
    }
    Place(const Place &) = delete;
    Place &operator=(const Place &) = delete;
    ~Place()
    {
        vkDestroyBuffer(gpu_.device(), buffer_, nullptr);
        vkFreeMemory(gpu_.device(), memory_, nullptr);
    }
    // A structure with the address that it had in the first process, or the result that says that it cannot have it.
    VkResult create(VkDeviceSize offset, VkAccelerationStructureTypeKHR type, VkDeviceAddress earlier,
                    VkAccelerationStructureKHR &structure) const
    {
        const auto info = vkInit<VkAccelerationStructureCreateInfoKHR>(
            {.createFlags = VK_ACCELERATION_STRUCTURE_CREATE_DEVICE_ADDRESS_CAPTURE_REPLAY_BIT_KHR,
             .buffer = buffer_,
             .offset = offset,
             .size = kBytes,
             .type = type,
             .deviceAddress = earlier});
        return gpu_.vk().CreateAccelerationStructureKHR(gpu_.device(), &info, nullptr, &structure);
    }
    [[nodiscard]] VkBuffer buffer() const { return buffer_; }

private:
    Gpu &gpu_;
    VkBuffer buffer_ = VK_NULL_HANDLE;
    VkDeviceMemory memory_ = VK_NULL_HANDLE;
};

// A structure that is built by a handle of the test's own, at the address that it had in the first process.
template <class Scene>
class Replayed : public Scene
{
public:
    Replayed(Gpu &gpu, const Place &place, VkDeviceSize offset, Captured &captured) : Scene(gpu), device_(gpu)
    {
        this->placeIn(place.buffer(), offset);
        const auto type = std::is_same_v<Scene, Tlas> ? VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR
                                                      : VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR;
        VT_CHECK(place.create(offset, type, captured.earlier(), replayed_));
        const auto query = vkInit<VkAccelerationStructureDeviceAddressInfoKHR>({.accelerationStructure = replayed_});
        address_ = gpu.vk().GetAccelerationStructureDeviceAddressKHR(gpu.device(), &query);
        EXPECT_EQ(captured.kept(address_), address_);
    }
    ~Replayed() override { device_.vk().DestroyAccelerationStructureKHR(device_.device(), replayed_, nullptr); }

    // Records the build that is prepared, into the structure that is replayed.
    void build()
    {
        VkAccelerationStructureBuildGeometryInfoKHR info = this->buildInfo();
        info.dstAccelerationStructure = replayed_;
        if (info.srcAccelerationStructure != VK_NULL_HANDLE)
            info.srcAccelerationStructure = replayed_;
        const VkAccelerationStructureBuildRangeInfoKHR *ranges = this->ranges();
        device_.submit([&](VkCommandBuffer commands) {
            device_.vk().CmdBuildAccelerationStructuresKHR(commands, 1, &info, &ranges);
        });
    }
    [[nodiscard]] VkAccelerationStructureKHR replayed() const { return replayed_; }
    // An instance of a BLAS of the first process.
    [[nodiscard]] VkAccelerationStructureInstanceKHR at(Vec3 place, uint32_t index) const
    {
        VkAccelerationStructureInstanceKHR one = instance(*this, place, index);
        one.accelerationStructureReference = address_;
        return one;
    }

private:
    Gpu &device_;
    VkAccelerationStructureKHR replayed_ = VK_NULL_HANDLE;
    VkDeviceAddress address_ = 0;
};

void expectSeen(Captured &captured, const std::vector<std::string> &seen)
{
    std::string text;
    for (const std::string &one : seen)
        text += one + '\n';
    const size_t hash = std::hash<std::string>()(text);
    EXPECT_EQ(captured.kept(hash), hash) << text;
}

// Run by the test below, in processes of its own.
TEST(CaptureReplayRun, DISABLED_Run)
{
    Captured captured(std::getenv(kFile), std::getenv(kReplays) != nullptr);
    Gpu gpu(Options{.validation = false, .quirks = kDriver});
    // Objects that the replaying process has created before, so that the layer's own addresses and slots differ from
    // those of the capture.
    std::vector<std::unique_ptr<Tlas>> others;
    const Patchwork other(gpu, 7);
    const Blas otherBlas(gpu, other.geometries());
    for (int i = 0; captured.replays() && i < 3; ++i)
        others.push_back(std::make_unique<Tlas>(gpu, std::vector{instance(otherBlas, {}, 9)}));

    const Place place(gpu, captured, 4 * kBytes);
    const Patchwork first(gpu, 1), second(gpu, 2);
    Replayed<Blas> blas(gpu, place, 0, captured), updated(gpu, place, kBytes, captured),
        clone(gpu, place, 2 * kBytes, captured);
    Replayed<Tlas> tlas(gpu, place, 3 * kBytes, captured);
    blas.prepare(first.geometries());
    blas.build();
    updated.prepare(second.geometries(), VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR);
    updated.build();
    updated.prepare(second.geometries(), VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR,
                    VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR);
    updated.build();
    gpu.submit([&](VkCommandBuffer commands) { recordCopy(gpu, commands, blas.replayed(), clone.replayed()); });
    // The bytes of the first process, with its addresses.
    std::vector<VkAccelerationStructureInstanceKHR> instances;
    for (const auto &one : {blas.at({}, 1), updated.at({0, 40, 0}, 2), clone.at({0, 80, 0}, 3)})
        instances.push_back(captured.kept(one));
    tlas.prepare(instances);
    tlas.build();
    for (const float y : {0.0f, 40.0f, 80.0f}) {
        const std::vector<std::string> what = seen(gpu, tlas, Patchwork::rays({0, y, 0}));
        EXPECT_GT(std::set<std::string>(what.begin(), what.end()).size(), 3u);
        expectSeen(captured, what);
    }
    for (const Message &m : gpu.takeUnexpectedMessages())
        ADD_FAILURE() << m.id << ": " << m.text;
}

// A structure that cannot be where it was is not created.
TEST(CaptureReplay, AnotherAddress)
{
    Gpu gpu(Options{.validation = false, .quirks = kDriver});
    Captured none("/dev/null", false);
    const Place place(gpu, none, 2 * kBytes);
    VkAccelerationStructureKHR structure = VK_NULL_HANDLE;
    constexpr auto kType = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR;
    EXPECT_EQ(place.create(0, kType, gpu.address(place.buffer()) + kBytes, structure),
              VK_ERROR_INVALID_OPAQUE_CAPTURE_ADDRESS);
    ASSERT_EQ(place.create(kBytes, kType, gpu.address(place.buffer()) + kBytes, structure), VK_SUCCESS);
    gpu.vk().DestroyAccelerationStructureKHR(gpu.device(), structure, nullptr);
}

TEST(CaptureReplay, AnotherProcess)
{
    namespace fs = std::filesystem;
    const fs::path folder = fs::temp_directory_path() / ("vellum-capture-" + std::to_string(getpid()));
    fs::create_directories(folder);
    for (const bool replays : {false, true}) {
        const fs::path log = folder / "log"; // run_cases.py reads the output of this process
        const pid_t child = fork();
        if (child == 0) {
            setenv(kFile, (folder / "captured").c_str(), 1);
            if (replays)
                setenv(kReplays, "1", 1);
            if (std::freopen(log.c_str(), "w", stdout) == nullptr || dup2(fileno(stdout), 2) < 0)
                _exit(1);
            execl("/proc/self/exe", "layer_tests", "--gtest_filter=CaptureReplayRun.DISABLED_Run",
                  "--gtest_also_run_disabled_tests", nullptr);
            _exit(1);
        }
        int status = 1;
        waitpid(child, &status, 0);
        std::ifstream file(log);
        const std::string text{std::istreambuf_iterator<char>(file), {}};
        EXPECT_EQ(status, 0) << (replays ? "replay: " : "capture: ") << text;
        EXPECT_NE(text.find("[  PASSED  ] 1 test."), std::string::npos) << text;
    }
    fs::remove_all(folder);
}

} // namespace
