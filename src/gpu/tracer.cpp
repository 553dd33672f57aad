// SPDX-License-Identifier: Apache-2.0
#include "gpu/tracer.h"

#include <algorithm>

#include "gpu/launch.h"
#include "shaders/tracer_comp.h"

namespace vellum::gpu
{
namespace
{

static_assert(sizeof(Ray) == 48 && sizeof(Candidate) == 32 && sizeof(RawResult) == 48);

constexpr VkBufferUsageFlags kStorage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT;

} // namespace

bool hashConfirms(uint32_t customIndex, uint32_t instance, uint32_t geometry, uint32_t primitive)
{
    const uint32_t h =
        (customIndex * 0x9e3779b1u) ^ (instance * 0x85ebca6bu) ^ (geometry * 0xc2b2ae35u) ^ (primitive * 0x27d4eb2fu);
    return ((h ^ (h >> 15)) & 0x40u) != 0;
}

Tracer::Tracer(Device &gpu) : Tracer(gpu, tracer_comp) {}

Tracer::Tracer(Device &gpu, std::span<const uint32_t> words, const TracerSetup &setup)
    : gpu_(gpu), pushStages_(pushStages(setup.stage)), resources_(gpu, 3, sizeof(Push), {}, pushStages_)
{
    std::array<uint32_t, 3> values{};
    std::vector<VkSpecializationMapEntry> entries;
    if (setup.specializedFlags) {
        values[0] = *setup.specializedFlags;
        entries.push_back({0, 0, sizeof(uint32_t)});
    }
    if (setup.specializedMode) {
        values[1] = *setup.specializedMode;
        entries.push_back({kModeConstant, sizeof(uint32_t), sizeof(VkBool32)});
    }
    if (setup.specializedOther) {
        values[2] = *setup.specializedOther;
        entries.push_back({kModeConstant + 1, 2 * sizeof(uint32_t), sizeof(VkBool32)});
    }
    const VkSpecializationInfo specialization{static_cast<uint32_t>(entries.size()), entries.data(), sizeof values,
                                              values.data()};
    program_ = makeStageProgram(gpu, resources_.layout(),
                                {.stage = setup.stage,
                                 .words = words,
                                 .specialization = entries.empty() ? nullptr : &specialization,
                                 .inlineModule = setup.inlineModule,
                                 .objectLayout = setup.shaderObject ? resources_.setLayout() : VK_NULL_HANDLE,
                                 .pushSize = sizeof(Push),
                                 .vertexBuffers = setup.vertexBuffers,
                                 .dynamicStrides = setup.dynamicStrides});
}

void Tracer::prepare(const Structure &scene, std::span<const Ray> rays, uint32_t capacity)
{
    rays_ = gpu_.upload(rays, kStorage);
    results_ = Buffer(gpu_, std::max<size_t>(rays.size(), 1) * sizeof(RawResult), kStorage);
    candidates_ = Buffer(gpu_, std::max<size_t>(rays.size() * capacity, 1) * sizeof(Candidate), kStorage);
    push_ = {static_cast<uint32_t>(rays.size()), capacity, scene.address(), program_->helperScene()};
    program_->prepare(launch_, push_.rayCount);
    resources_.write(scene.handle(), std::array<const Buffer *, 3>{&rays_, &results_, &candidates_});
}

void Tracer::bind(VkCommandBuffer commands, bool maintenance6) const
{
    bindProgram(commands);
    bindSet(commands, maintenance6);
}

void Tracer::bindSet(VkCommandBuffer commands, bool maintenance6) const
{
    recordBindings(
        gpu_, commands,
        {program_->point(), resources_.layout(), resources_.set(), pushStages_, std::as_bytes(std::span(&push_, 1))},
        maintenance6);
}

void Tracer::dispatch(VkCommandBuffer commands) const
{
    program_->launch(commands);
}

void Tracer::clearResults()
{
    std::memset(results_.bytes(), 0xff, static_cast<size_t>(results_.size()));
}

std::vector<Result> Tracer::results() const
{
    const std::span<RawResult> raw = results_.as<RawResult>();
    const std::span<Candidate> list = candidates_.as<Candidate>();
    std::vector<Result> results(push_.rayCount);
    for (size_t i = 0; i < results.size(); ++i) {
        static_cast<RawResult &>(results[i]) = raw[i];
        const size_t kept = std::min(raw[i].candidateCount, push_.capacity);
        const auto first = list.begin() + static_cast<ptrdiff_t>(i * push_.capacity);
        results[i].candidates.assign(first, first + static_cast<ptrdiff_t>(kept));
    }
    return results;
}

std::vector<Result> Tracer::trace(const Structure &scene, std::span<const Ray> rays, uint32_t capacity)
{
    prepare(scene, rays, capacity);
    traceAndWait(gpu_, *this);
    return results();
}

} // namespace vellum::gpu
