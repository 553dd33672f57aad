// SPDX-License-Identifier: Apache-2.0
// vellum-hit-table-bench: what the hit tables of traces cost that use emulated micromaps. No rays are traced. Times
// from the beginning of recording to the end of the wait, of a command buffer with a pipeline that uses micromaps, of
// the same with a plain pipeline, and of a copy of the table by the driver, in turns.
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <functional>
#include <vector>

#include <fmt/format.h>

#include "command_sides.h"
#include "layer_comparison.h"

namespace
{

using namespace vellum;
using bench::BenchBuffer;
using bench::CommandSide;
using Record = std::function<void(VkCommandBuffer)>;

constexpr VkDeviceSize kMiB = VkDeviceSize{1} << 20;
constexpr VkDeviceSize kStride = 64; // handle, and 32 bytes for shaders

double median(std::vector<double> values)
{
    std::ranges::nth_element(values, values.begin() + static_cast<ptrdiff_t>(values.size() / 2));
    return values[values.size() / 2];
}

class HitTableBench
{
public:
    HitTableBench(const gpu::DeviceInfo &on, unsigned repetitions)
        : side_("micromaps", on, gpu::Api::Khr, 0), repetitions_(repetitions), pool_(side_.makePool()),
          commands_(side_.allocate(pool_, VK_COMMAND_BUFFER_LEVEL_PRIMARY)), micromaps_(side_.makeRayTracing(true))
    {
    }
    ~HitTableBench()
    {
        side_.vk.DestroyPipeline(side_.device, micromaps_, nullptr);
        side_.vk.DestroyCommandPool(side_.device, pool_, nullptr);
    }
    HitTableBench(const HitTableBench &) = delete;
    HitTableBench &operator=(const HitTableBench &) = delete;

    // `traces` of a table in one command buffer. `written`: a barrier after each, as if a shader had written the table.
    void row(VkDeviceSize bytes, unsigned traces, bool written)
    {
        const BenchBuffer table = makeTable(bytes), target = makeTable(bytes);
        const std::array<Record, 3> records = {
            [&](VkCommandBuffer commands) { trace(commands, side_.rayTracing, table, bytes, traces, written); },
            [&](VkCommandBuffer commands) { trace(commands, micromaps_, table, bytes, traces, written); },
            [&](VkCommandBuffer commands) {
                const VkBufferCopy region{0, 0, bytes};
                side_.vk.CmdCopyBuffer(commands, table.buffer, target.buffer, 1, &region);
            }};
        std::array<std::vector<double>, 3> times;
        for (unsigned r = 0; r <= repetitions_; ++r)
            for (size_t i = 0; i < records.size(); ++i) {
                const double time = measure(records[i]);
                if (r > 0) // the first warms up
                    times[i].push_back(time);
            }
        const double plain = median(times[0]), own = median(times[1]), copy = median(times[2]);
        const double each = (own - plain) / traces;
        fmt::print("| {} MiB | {} | {} | {:.3f} | {:.3f} | {:.3f} | {:.4f} | {:.2f} |\n", bytes / kMiB, traces,
                   written ? "yes" : "no", plain, own, copy, each, copy / each);
        std::fflush(stdout);
        side_.destroy(table);
        side_.destroy(target);
    }

private:
    [[nodiscard]] BenchBuffer makeTable(VkDeviceSize bytes) const
    {
        const BenchBuffer made = side_.makeBuffer(
            bytes, VK_BUFFER_USAGE_SHADER_BINDING_TABLE_BIT_KHR | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT |
                       VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT);
        void *data = nullptr;
        gpu::checkResult(side_.vk.MapMemory(side_.device, made.memory, 0, VK_WHOLE_SIZE, 0, &data), "mapping memory");
        std::memset(data, 1, bytes);
        side_.vk.UnmapMemory(side_.device, made.memory);
        return made;
    }

    void trace(VkCommandBuffer commands, VkPipeline pipeline, const BenchBuffer &table, VkDeviceSize bytes,
               unsigned traces, bool written) const
    {
        const VkStridedDeviceAddressRegionKHR one{table.address, kStride, kStride}, none{};
        const VkStridedDeviceAddressRegionKHR hit{table.address, kStride, bytes};
        side_.vk.CmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR, pipeline);
        for (unsigned i = 0; i < traces; ++i) {
            side_.vk.CmdTraceRaysKHR(commands, &one, &one, &hit, &none, 0, 1, 1);
            const auto memory = vkInit<VkMemoryBarrier>(
                {.srcAccessMask = VK_ACCESS_SHADER_WRITE_BIT, .dstAccessMask = VK_ACCESS_SHADER_READ_BIT});
            if (written)
                side_.vk.CmdPipelineBarrier(commands, VK_PIPELINE_STAGE_RAY_TRACING_SHADER_BIT_KHR,
                                            VK_PIPELINE_STAGE_RAY_TRACING_SHADER_BIT_KHR, 0, 1, &memory, 0, nullptr, 0,
                                            nullptr);
        }
    }

    // Milliseconds.
    double measure(const Record &record)
    {
        const auto start = std::chrono::steady_clock::now();
        side_.begin(commands_, VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT);
        record(commands_);
        gpu::checkResult(side_.vk.EndCommandBuffer(commands_), "recording");
        const auto submit = vkInit<VkSubmitInfo>({.commandBufferCount = 1, .pCommandBuffers = &commands_});
        gpu::checkResult(side_.vk.QueueSubmit(side_.queue, 1, &submit, VK_NULL_HANDLE), "submitting");
        gpu::checkResult(side_.vk.DeviceWaitIdle(side_.device), "waiting");
        return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    }

    CommandSide side_;
    unsigned repetitions_;
    VkCommandPool pool_;
    VkCommandBuffer commands_;
    VkPipeline micromaps_;
};

void run(const gpu::DeviceInfo &, const gpu::DeviceInfo &on, unsigned repetitions)
{
    HitTableBench bench(on, repetitions);
    fmt::print(
        "{}, {}, medians of {}, milliseconds\n\n"
        "| table | traces | may change between | plain pipeline | micromaps | copy | (micromaps - plain) / traces "
        "| copy / that |\n|---|--:|---|--:|--:|--:|--:|--:|\n",
        on.name, on.implementation, repetitions);
    for (const VkDeviceSize size : {1u, 8u, 31u, 64u, 256u})
        bench.row(size * kMiB, 1, false);
    for (const VkDeviceSize size : {1u, 10u}) {
        bench.row(size * kMiB, 1000, false);
        bench.row(size * kMiB, 50, true);
    }
}

} // namespace

int main(int argc, char **argv)
{
    return bench::compareDevices(argc, argv, "vellum-hit-table-bench",
                                 "Hit tables of traces that use emulated micromaps; prints Markdown.",
                                 "Submissions of each kind", run);
}
