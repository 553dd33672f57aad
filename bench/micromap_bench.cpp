// SPDX-License-Identifier: Apache-2.0
// vellum-micromap-bench: how fast micromaps are built, against a plain vkCmdCopyBuffer of the same bytes: those of the
// build's input, data and triangle array. Each build is timed right after a copy of them, from submission to the end of
// the fence's wait; the ratios' median counts. On a machine that has other work to do, compare the fastest of each
// kind.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <functional>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "cli/base/statistics.h"
#include "cli/render_command.h"
#include "cli/vulkan/layer_path.h"
#include "cli/vulkan/resources.h"
#include "core/micromap.h"
#include "vk/vk_init.h"

namespace
{

using namespace vellum;
using cli::Buffer;

constexpr VkDeviceSize kAlignment = 256;
constexpr VkBufferUsageFlags kAddress = VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;

struct Flags {
    const char *name;
    VkBuildMicromapFlagsEXT bits;
};
constexpr Flags kFlags[] = {
    {"none", 0},
    {"fast trace", VK_BUILD_MICROMAP_PREFER_FAST_TRACE_BIT_EXT},
    {"fast build", VK_BUILD_MICROMAP_PREFER_FAST_BUILD_BIT_EXT},
    {"compaction", VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT},
};

double seconds(const std::function<void()> &work)
{
    const auto begin = std::chrono::steady_clock::now();
    work();
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

// As many triangles of a level as take about that many bytes; no two with the same data.
Micromap inputOf(uint32_t level, Format format, size_t bytes)
{
    Micromap micromap;
    const uint32_t each = packedBytes(level, format);
    const auto count = std::max<size_t>(bytes / (each + 8), 1);
    micromap.data.resize(count * each);
    uint64_t state = 88172645463325252u;
    for (uint8_t &byte : micromap.data) {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        byte = static_cast<uint8_t>(state);
    }
    for (size_t i = 0; i < count; ++i)
        micromap.triangles.push_back({static_cast<uint32_t>(i * each), static_cast<uint16_t>(level), format});
    return micromap;
}

VkDeviceSize bytesOf(const Micromap &input)
{
    return input.data.size() + std::as_bytes(std::span(input.triangles)).size();
}

// One micromap and what it is built from.
class Build
{
public:
    Build(cli::Device &device, const Micromap &input, VkBuildMicromapFlagsEXT flags)
        : device_(device), data_(cli::uploadBuffer(device, std::as_bytes(std::span(input.data)), kInput, kAlignment)),
          triangles_(cli::uploadBuffer(device, std::as_bytes(std::span(input.triangles)), kInput, kAlignment))
    {
        for (const MicromapUsage &u : input.buildUsage())
            usage_.push_back({u.count, u.subdivisionLevel, static_cast<uint32_t>(u.format)});
        info_ = vkInit<VkMicromapBuildInfoEXT>(
            {.flags = flags, .usageCountsCount = static_cast<uint32_t>(usage_.size()), .pUsageCounts = usage_.data()});
        info_.data.deviceAddress = data_.address(kAlignment);
        info_.triangleArray.deviceAddress = triangles_.address(kAlignment);
        info_.triangleArrayStride = sizeof(VkMicromapTriangleEXT);
        auto sizes = vkInit<VkMicromapBuildSizesInfoEXT>();
        const cli::DeviceFunctions &vk = device.functions();
        vk.getMicromapBuildSizes(device.handle(), VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &info_, &sizes);
        storage_ = Buffer(device, sizes.micromapSize, kAddress | VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT,
                          Buffer::Place::Device);
        auto create = vkInit<VkMicromapCreateInfoEXT>({.buffer = storage_.handle(), .size = sizes.micromapSize});
        cli::check(vk.createMicromap(device.handle(), &create, nullptr, &micromap_), "creating a micromap");
        const VkDeviceSize alignment = std::max(kAlignment, device.scratchAlignment());
        scratch_ = Buffer(device, sizes.buildScratchSize + alignment, kAddress | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT,
                          Buffer::Place::Device);
        info_.dstMicromap = micromap_;
        info_.scratchData.deviceAddress = scratch_.address(alignment);
        commands_ = device.allocateCommands();
        auto begin = vkInit<VkCommandBufferBeginInfo>();
        cli::check(vkBeginCommandBuffer(commands_, &begin), "recording");
        vk.cmdBuildMicromaps(commands_, 1, &info_);
        cli::check(vkEndCommandBuffer(commands_), "recording");
    }
    ~Build() { device_.functions().destroyMicromap(device_.handle(), micromap_, nullptr); }
    Build(const Build &) = delete;
    Build &operator=(const Build &) = delete;

    [[nodiscard]] const Buffer &data() const { return data_; }
    [[nodiscard]] const Buffer &triangles() const { return triangles_; }
    double run()
    {
        return seconds([this] { device_.submitAndWait(commands_); });
    }

private:
    static constexpr VkBufferUsageFlags kInput =
        kAddress | VK_BUFFER_USAGE_MICROMAP_BUILD_INPUT_READ_ONLY_BIT_EXT | VK_BUFFER_USAGE_TRANSFER_SRC_BIT;
    cli::Device &device_;
    Buffer data_, triangles_, storage_, scratch_;
    std::vector<VkMicromapUsageEXT> usage_;
    VkMicromapBuildInfoEXT info_{};
    VkMicromapEXT micromap_ = VK_NULL_HANDLE;
    VkCommandBuffer commands_ = VK_NULL_HANDLE;
};

class Copy
{
public:
    Copy(cli::Device &device, const Build &build, const Micromap &input)
        : device_(device), to_(device, bytesOf(input), VK_BUFFER_USAGE_TRANSFER_DST_BIT, Buffer::Place::Device),
          commands_(device.allocateCommands())
    {
        auto begin = vkInit<VkCommandBufferBeginInfo>();
        cli::check(vkBeginCommandBuffer(commands_, &begin), "recording");
        const VkDeviceSize data = input.data.size();
        const VkBufferCopy regions[]{{0, 0, data}, {0, data, bytesOf(input) - data}};
        vkCmdCopyBuffer(commands_, build.data().handle(), to_.handle(), 1, &regions[0]);
        vkCmdCopyBuffer(commands_, build.triangles().handle(), to_.handle(), 1, &regions[1]);
        cli::check(vkEndCommandBuffer(commands_), "recording");
    }
    double run()
    {
        return seconds([this] { device_.submitAndWait(commands_); });
    }

private:
    cli::Device &device_;
    Buffer to_;
    VkCommandBuffer commands_;
};

void measure(cli::Device &device, uint32_t level, Format format, const Flags &flags, size_t bytes, unsigned repetitions)
{
    const Micromap input = inputOf(level, format, bytes);
    Build build(device, input, flags.bits);
    Copy copy(device, build, input);
    build.run();
    copy.run();
    std::vector<double> builds;
    std::vector<double> copies;
    std::vector<double> ratios;
    for (unsigned i = 0; i < repetitions; ++i) {
        copies.push_back(copy.run());
        builds.push_back(build.run());
        ratios.push_back(copies.back() / builds.back());
    }
    const auto rate = [&](std::vector<double> &times) {
        return static_cast<double>(bytesOf(input)) / cli::median(times) * 1e-9;
    };
    const auto fastest = [](const std::vector<double> &times) { return *std::min_element(times.begin(), times.end()); };
    fmt::print("| {} | {}-state | {} | {} | {:.1f} | {:.2f} | {:.2f} | {:.2f} | {:.2f} |\n", level,
               format == Format::TwoState ? 2 : 4, flags.name, input.triangles.size(),
               static_cast<double>(bytesOf(input)) * 1e-6, rate(builds), rate(copies), cli::median(ratios),
               fastest(copies) / fastest(builds));
    std::fflush(stdout);
}

} // namespace

int main(int argc, char **argv)
{
    CLI::App app("Throughput of micromap builds, against a buffer copy of the same bytes");
    std::vector<uint32_t> levels = {0, 2, 3, 4, 5, 6, 8, 10, 12};
    size_t megabytes = 64;
    unsigned repetitions = 7;
    app.add_option("--levels", levels, "subdivision levels");
    app.add_option("--megabytes", megabytes, "size of each micromap");
    app.add_option("--repetitions", repetitions, "builds of each kind");
    CLI11_PARSE(app, argc, argv);
    try {
        if (const auto folder = cli::findLayerFolder())
            cli::addLayerFolder(*folder);
        const cli::Instance instance(true);
        cli::Device device(cli::chooseDevice(instance, std::nullopt), {cli::MicromapApi::Ext, false});
        fmt::print("| level | format | flags | triangles | MB | build, GB/s | copy, GB/s | build/copy | fastest |\n"
                   "|--:|---|---|--:|--:|--:|--:|--:|--:|\n");
        for (const Flags &flags : kFlags)
            for (const Format format : {Format::TwoState, Format::FourState})
                for (const uint32_t level : levels)
                    measure(device, level, format, flags, megabytes * 1000 * 1000, repetitions);
    } catch (const std::exception &error) {
        fmt::print(stderr, "vellum-micromap-bench: {}\n", error.what());
        return 1;
    }
    return 0;
}
