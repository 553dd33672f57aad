// SPDX-License-Identifier: Apache-2.0
// vellum-micromap-bench: how fast micromaps are built, against a plain vkCmdCopyBuffer of the same bytes: those of the
// build's input, data and triangle array. Each build is timed right after a copy of them, from submission to the end of
// the fence's wait; the ratios' median counts. On a machine that has other work to do, compare the fastest of each
// kind.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <functional>
#include <optional>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "base/statistics.h"
#include "core/micromap.h"
#include "gpu/instance.h"
#include "gpu/scene.h"

namespace
{

using namespace vellum;

struct Flags {
    const char *name;
    VkBuildMicromapFlagsEXT bits;
    bool copied = false; // a query of the compacted size and a compacting copy follow
};
constexpr Flags kFlags[] = {
    {"none", 0},
    {"fast trace", VK_BUILD_MICROMAP_PREFER_FAST_TRACE_BIT_EXT},
    {"fast build", VK_BUILD_MICROMAP_PREFER_FAST_BUILD_BIT_EXT},
    {"compaction", VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT},
    {"compaction, copied", VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT, true},
};

double seconds(const std::function<void()> &work)
{
    const auto begin = std::chrono::steady_clock::now();
    work();
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

// As many triangles of a level as fill about that many bytes; no two have the same data. `unaligned`: after one of
// level 0.
Micromap inputOf(uint32_t level, Format format, size_t bytes, bool unaligned)
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
    if (unaligned) {
        micromap.data.insert(micromap.data.begin(), 1);
        micromap.triangles.push_back({0, 0, format});
    }
    for (size_t i = 0; i < count; ++i)
        micromap.triangles.push_back(
            {static_cast<uint32_t>(i * each + (unaligned ? 1 : 0)), static_cast<uint16_t>(level), format});
    return micromap;
}

VkDeviceSize bytesOf(const Micromap &input)
{
    return input.data.size() + std::as_bytes(std::span(input.triangles)).size();
}

// One micromap and its inputs.
class Build
{
public:
    Build(gpu::Device &device, const Micromap &input, const Flags &flags)
        : device_(device), micromap_(device, inputOf(input), flags.bits), commands_(device.begin(0))
    {
        micromap_.record(commands_);
        if (flags.copied) {
            sizes_ = gpu::QueryPool(device, VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT);
            copy_.emplace(device, micromap_, micromap_.size());
            vkCmdResetQueryPool(commands_, sizes_, 0, 1);
            barrier();
            gpu::recordMicromapProperties(device, commands_, std::span(&micromap_.handle(), 1), sizes_.type(), sizes_,
                                          0);
            gpu::recordMicromapCopy(device, commands_, micromap_.handle(), copy_->handle(),
                                    VK_COPY_MICROMAP_MODE_COMPACT_EXT);
        }
        device.end(commands_);
    }

    double run()
    {
        return seconds([this] { device_.execute(commands_); });
    }

private:
    static gpu::MicromapInput inputOf(const Micromap &from)
    {
        gpu::MicromapInput input;
        input.data = from.data;
        input.triangles.resize(from.triangles.size());
        std::memcpy(input.triangles.data(), from.triangles.data(),
                    input.triangles.size() * sizeof(VkMicromapTriangleEXT));
        return input;
    }

    void barrier() const
    {
        const VkMemoryBarrier memory{VK_STRUCTURE_TYPE_MEMORY_BARRIER, nullptr, VK_ACCESS_MEMORY_WRITE_BIT,
                                     VK_ACCESS_MEMORY_READ_BIT};
        vkCmdPipelineBarrier(commands_, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, 0, 1,
                             &memory, 0, nullptr, 0, nullptr);
    }

    gpu::Device &device_;
    gpu::Micromap micromap_;
    gpu::QueryPool sizes_;
    std::optional<gpu::Micromap> copy_;
    VkCommandBuffer commands_;
};

// A copy of as many bytes as a build reads.
class Copy
{
public:
    Copy(gpu::Device &device, const Micromap &input)
        : device_(device), from_(device, bytesOf(input), VK_BUFFER_USAGE_TRANSFER_SRC_BIT, gpu::Buffer::Place::Device),
          to_(device, bytesOf(input), VK_BUFFER_USAGE_TRANSFER_DST_BIT, gpu::Buffer::Place::Device),
          commands_(device.begin(0))
    {
        const VkBufferCopy region{0, 0, bytesOf(input)};
        vkCmdCopyBuffer(commands_, from_.handle(), to_.handle(), 1, &region);
        device.end(commands_);
    }
    double run()
    {
        return seconds([this] { device_.execute(commands_); });
    }

private:
    gpu::Device &device_;
    gpu::Buffer from_, to_;
    VkCommandBuffer commands_;
};

void measure(gpu::Device &device, uint32_t level, Format format, const Flags &flags, size_t bytes, bool unaligned,
             unsigned repetitions)
{
    const Micromap input = inputOf(level, format, bytes, unaligned);
    Build build(device, input, flags);
    Copy copy(device, input);
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
        return static_cast<double>(bytesOf(input)) / median(times) * 1e-9;
    };
    const auto fastest = [](const std::vector<double> &times) { return *std::min_element(times.begin(), times.end()); };
    fmt::print("| {} | {}-state | {} | {} | {:.1f} | {:.2f} | {:.2f} | {:.2f} | {:.2f} |\n", level,
               format == Format::TwoState ? 2 : 4, flags.name, input.triangles.size(),
               static_cast<double>(bytesOf(input)) * 1e-6, rate(builds), rate(copies), median(ratios),
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
    bool unaligned = false;
    std::optional<std::string> wanted;
    std::optional<std::filesystem::path> layerPath;
    app.add_option("--levels", levels, "subdivision levels");
    app.add_option("--megabytes", megabytes, "size of each micromap");
    app.add_option("--repetitions", repetitions, "builds of each kind");
    app.add_flag("--unaligned", unaligned,
                 "a triangle of level 0 comes first, and all data behind it, without padding");
    app.add_option("-d,--device", wanted, "the Vulkan device: a number or a part of its name");
    app.add_option("--layer-path", layerPath, "folder of the layer's manifest");
    CLI11_PARSE(app, argc, argv);
    try {
        gpu::offerLayer(layerPath);
        const gpu::Instance instance(true);
        gpu::Device device(gpu::DeviceSelection(wanted).from(instance), gpu::Api::Ext);
        fmt::print("| level | format | flags | triangles | MB | build, GB/s | copy, GB/s | build/copy | fastest |\n"
                   "|--:|---|---|--:|--:|--:|--:|--:|--:|\n");
        for (const Flags &flags : kFlags)
            for (const Format format : {Format::TwoState, Format::FourState})
                for (const uint32_t level : levels)
                    measure(device, level, format, flags, megabytes * 1000 * 1000, unaligned, repetitions);
    } catch (const std::exception &error) {
        fmt::print(stderr, "vellum-micromap-bench: {}\n", error.what());
        return 1;
    }
    return 0;
}
