// SPDX-License-Identifier: Apache-2.0
// vellum-gpu-bake-bench: the baker on the GPU compared with the one on the CPU, on the triangles and texture of
// vellum-bake-bench. On a driver that runs on the CPU (lavapipe), compare CPU time; on others, elapsed time. The exit
// status is 1 if they contradict each other.
#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <memory>

#include "bake/bake.h"
#include "bake_work.h"
#include "core/curve.h"
#include "gpu/device.h"
#include "process_times.h"
#include "render/world.h"
#include "vellum/gpu_bake.h"
#include "vk/vk_init.h"

namespace
{

using namespace vellum;
using gpu::Buffer;

struct Settings {
    size_t triangles = 10000;
    uint32_t size = 1024;
    unsigned threads = 1;
    unsigned rounds = 3;
    bool exact = false;
    std::vector<std::string> levels = {"3", "5", "auto", "7"};
    std::string device;
};

// A micromap from the GPU's buffers.
class GpuBake
{
public:
    GpuBake(gpu::Device &device, const render::Texture &texture, uint32_t size,
            const std::vector<TriangleUvs> &triangles)
        : device_(device), count_(static_cast<uint32_t>(triangles.size())),
          uvs_(device.upload(std::span(triangles), kUsage)),
          result_(device, sizeof(GpuBakeResult), kUsage, gpu::Buffer::Place::Device),
          indices_(device, 4 * VkDeviceSize{count_}, kUsage, gpu::Buffer::Place::Device)
    {
        CHECK_VK(GpuBaker::create({device.device(), vkGetDeviceProcAddr}, baker_));
        GpuAlphaInfo info;
        info.view = texture.view();
        info.width = info.height = size;
        CHECK_VK(baker_->createAlpha(info, alpha_));
        scratch_ = gpu::Buffer(device, GpuBaker::scratchBytes(info, count_),
                               kUsage | VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT, gpu::Buffer::Place::Device);
    }

    // Sizes first, as capacity for all would take most of the memory.
    void prepare(const GpuBakeOptions &options)
    {
        device_.submit([&](VkCommandBuffer commands) {
            if (!baker_->recordSizes(commands, *alpha_, input(), options, scratch(), result_.address()))
                throw std::runtime_error("the GPU baker does not take these options");
        });
        GpuBakeResult result{};
        const std::vector<uint32_t> words = result_.words(sizeof result / 4);
        std::memcpy(&result, words.data(), sizeof result);
        output_.triangles = result.triangles;
        data_ = gpu::Buffer(device_, GpuBaker::dataBytes(output_, options.format), kUsage, gpu::Buffer::Place::Device);
        records_ = gpu::Buffer(device_, GpuBaker::recordBytes(output_), kUsage, gpu::Buffer::Place::Device);
        output_.data = data_.address();
        output_.records = records_.address();
        output_.indices = indices_.address();
    }

    void run(const GpuBakeOptions &options)
    {
        device_.submit([&](VkCommandBuffer commands) {
            if (!baker_->record(commands, *alpha_, input(), options, scratch(), output_, result_.address()))
                throw std::runtime_error("the GPU baker does not take these options");
            const auto all = vkInit<VkMemoryBarrier>(
                {.srcAccessMask = VK_ACCESS_SHADER_WRITE_BIT, .dstAccessMask = VK_ACCESS_MEMORY_READ_BIT});
            vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, 0,
                                 1, &all, 0, nullptr, 0, nullptr);
        });
    }

    [[nodiscard]] Micromap read()
    {
        Micromap micromap;
        const std::vector<uint32_t> indices = indices_.words(count_);
        micromap.indices.assign(indices.begin(), indices.end());
        const std::vector<uint32_t> records = records_.words(static_cast<size_t>(GpuBaker::recordBytes(output_) / 4));
        for (size_t i = 0; i + 1 < records.size(); i += 2)
            micromap.triangles.push_back({records[i], static_cast<uint16_t>(records[i + 1] & 0xffffu),
                                          static_cast<Format>(records[i + 1] >> 16)});
        const std::vector<uint32_t> data =
            data_.words(static_cast<size_t>(GpuBaker::dataBytes(output_, VK_OPACITY_MICROMAP_FORMAT_4_STATE_EXT) / 4));
        micromap.data.resize(data.size() * 4);
        std::memcpy(micromap.data.data(), data.data(), micromap.data.size());
        return micromap;
    }

private:
    static constexpr VkBufferUsageFlags kUsage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT |
                                                 VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT |
                                                 VK_BUFFER_USAGE_TRANSFER_SRC_BIT;

    [[nodiscard]] GpuBakeInput input() const
    {
        GpuBakeInput input;
        input.uvs = uvs_.address();
        input.indexType = VK_INDEX_TYPE_NONE_KHR;
        input.triangles = count_;
        input.vertices = 3 * count_;
        return input;
    }
    [[nodiscard]] GpuBaker::Scratch scratch() const { return {scratch_.handle(), 0, scratch_.address()}; }

    gpu::Device &device_;
    uint32_t count_;
    gpu::Buffer uvs_, result_, indices_, scratch_, data_, records_;
    std::unique_ptr<GpuBaker> baker_;
    std::unique_ptr<GpuAlpha> alpha_;
    GpuBakeOutput output_;
};

// Shares of all micro-triangles, all triangles counting the same.
struct Score {
    double unknown = 0;
    double needless = 0; // unknown where the CPU baker knows
    double more = 0;     // known where it does not know
    size_t wrong = 0;    // micro-triangles that are the contrary of what the CPU baker knows
};

Score score(const Micromap &gpu, const Micromap &cpu)
{
    const auto stateOf = [](const Micromap &micromap, size_t triangle, uint32_t index) {
        const int32_t special = micromap.indices[triangle];
        if (const auto state = specialState(special))
            return *state;
        const MicromapTriangle &t = micromap.triangles[static_cast<size_t>(special)];
        return readState(micromap.data.data() + t.dataOffset, index, t.format);
    };
    const auto levelOf = [](const Micromap &micromap, size_t triangle) {
        const int32_t index = micromap.indices[triangle];
        return index < 0 ? 0u : uint32_t{micromap.triangles[static_cast<size_t>(index)].subdivisionLevel};
    };
    const auto known = [](State state) { return state == State::Opaque || state == State::Transparent; };
    Score score;
    for (size_t t = 0; t < gpu.indices.size(); ++t) {
        const uint32_t count = microTriangleCount(std::max(levelOf(gpu, t), levelOf(cpu, t)));
        const double each = 1.0 / static_cast<double>(gpu.indices.size()) / count;
        for (uint32_t i = 0; i < count; ++i) {
            const State a = stateOf(gpu, t, i);
            const State b = stateOf(cpu, t, i);
            score.unknown += known(a) ? 0 : each;
            score.needless += !known(a) && known(b) ? each : 0;
            score.more += known(a) && !known(b) ? each : 0;
            score.wrong += known(a) && known(b) && a != b ? 1u : 0u;
        }
    }
    return score;
}

// Returns false where a state is the contrary of what the CPU baker knows.
bool compare(const Settings &settings, const std::string &level, const bench::BakeMesh &mesh, GpuBake &gpu)
{
    BakeOptions options;
    options.threads = settings.threads;
    if (settings.exact)
        options.exactly();
    GpuBakeOptions gpuOptions;
    gpuOptions.automatic = level == "auto";
    gpuOptions.level = options.maxLevel;
    if (!gpuOptions.automatic)
        options.level = gpuOptions.level = static_cast<uint32_t>(std::stoul(level));
    gpuOptions.valueTolerance = options.valueTolerance;
    gpuOptions.subtexelTolerance = options.subtexelTolerance;
    gpuOptions.barycentricTolerance = options.barycentricTolerance;
    gpuOptions.interpolationTolerance = options.interpolationTolerance;

    gpu.prepare(gpuOptions);
    gpu.run(gpuOptions); // the driver compiles shaders when they first run
    bench::BestTimes cpuTimes;
    bench::BestTimes gpuTimes;
    Micromap cpu;
    for (unsigned round = 0; round < settings.rounds; ++round) {
        cpuTimes.measure([&] {
            const AlphaTexture texture = mesh.texture();
            cpu = bake(texture, mesh.triangles, options).micromap;
        });
        gpuTimes.measure([&] { gpu.run(gpuOptions); });
    }
    const Score result = score(gpu.read(), cpu);
    fmt::print("{:>5} {:>10.3f} s {:>8.3f} s {:>10.3f} s {:>8.3f} s {:>8.3f} % {:>12.1f} {:>6} {:>12.1f}\n", level,
               cpuTimes.cpu, cpuTimes.wall, gpuTimes.cpu, gpuTimes.wall, 100 * result.unknown, 1e6 * result.needless,
               result.wrong, 1e6 * result.more);
    std::fflush(stdout);
    return result.wrong == 0;
}

} // namespace

int main(int argc, char **argv)
try {
    Settings settings;
    CLI::App app("Measures the baker on the GPU beside the one on the CPU.");
    app.add_option("--triangles", settings.triangles, "Triangles, with edges of 60 to 100 texels [10000]");
    app.add_option("--texture", settings.size, "Texels along a side of the texture [1024]");
    app.add_option("--threads", settings.threads, "Worker threads of the baker on the CPU [1]");
    app.add_option("--rounds", settings.rounds, "Runs of each, of which the best counts [3]");
    app.add_option("--levels", settings.levels, "Levels, 0 to 12 or auto [3,5,auto,7]")->delimiter(',');
    app.add_flag("--exact", settings.exact, "Without tolerances");
    app.add_option("--device", settings.device, "Number or part of the name of the Vulkan device");
    CLI11_PARSE(app, argc, argv);

    const gpu::Instance instance(false);
    const gpu::DeviceInfo info =
        (settings.device.empty() ? gpu::DeviceSelection() : gpu::DeviceSelection(settings.device)).from(instance);
    gpu::Device device(info, std::nullopt);
    const bench::BakeWork work = bench::leaves(settings.size, settings.triangles);
    const bench::BakeMesh &mesh = work.meshes.front();
    Image image;
    image.width = image.height = settings.size;
    image.rgba.assign(size_t{settings.size} * settings.size * 4, 255);
    for (size_t i = 0; i < mesh.alpha.size(); ++i)
        image.rgba[4 * i + 3] = mesh.alpha[i];
    const render::Texture texture(device, image, Material{});
    GpuBake gpu(device, texture, settings.size, mesh.triangles);
    fmt::print("{}\n{:>5} {:>12} {:>10} {:>12} {:>10} {:>10} {:>12} {:>6} {:>12}\n", info.name, "level", "CPU baker",
               "wall", "GPU baker", "wall", "unknown", "needless/M", "wrong", "more/M");
    bool agree = true;
    for (const std::string &level : settings.levels)
        agree &= compare(settings, level, mesh, gpu);
    return agree ? 0 : 1;
} catch (const std::exception &e) {
    fmt::print(stderr, "vellum-gpu-bake-bench: {}\n", e.what());
    return 1;
}
