#include "layer/pipelines/ray_flag_probe.h"

#include <memory>

#include "core/ray_flags.h"
#include "layer/pipelines/device_pipelines.h"
#include "layer/pipelines/ray_flag_probe_pipeline.h"
#include "layer/structures/trial_structure.h"

namespace vellum::layer
{
namespace
{

constexpr uint32_t kProbedBits = shared::kCarriedRayFlags;
constexpr uint32_t kCommittedTriangle = 1;

bool returns(uint32_t flags)
{
    return (flags & kProbedBits) == kProbedBits;
}

// One triangle, one instance of it, and one ray.
class RayTrial : public Trial
{
public:
    RayTrial(DevicePipelines &device, std::optional<bool> &answer)
        : device_(device), answer_(answer), triangle_(device.buffers.gpu), instance_(device.buffers.gpu)
    {
    }

    bool record(VkCommandBuffer commands) override
    {
        if (!triangle_.buildTriangle(commands, VK_GEOMETRY_OPAQUE_BIT_KHR) ||
            !instance_.buildInstance(commands, triangle_) || results_.create(device_.buffers.gpu, 8) != VK_SUCCESS)
            return false;
        return trace(commands, {instance_.address(), results_.address(), kProbedBits});
    }

    void read() override { answer_ = carried(results_.words()); }

protected:
    virtual bool trace(VkCommandBuffer commands, const shared::RayFlagProbePush &push) = 0;
    virtual bool carried(const uint32_t *results) const = 0;

    DevicePipelines &device_;

private:
    std::optional<bool> &answer_;
    TrialStructure triangle_, instance_;
    GpuBuffer results_;
};

class QueryTrial : public RayTrial
{
public:
    using RayTrial::RayTrial;

private:
    bool trace(VkCommandBuffer commands, const shared::RayFlagProbePush &push) override
    {
        return InjectedWork(device_.commands, commands).dispatch(InjectedShader::RayFlagProbe, push, 1, 1);
    }
    bool carried(const uint32_t *results) const override
    {
        return returns(results[0]) && results[1] == kCommittedTriangle;
    }
};

class PipelineTrial : public RayTrial
{
public:
    PipelineTrial(DevicePipelines &device, std::optional<bool> &answer)
        : RayTrial(device, answer), pipeline_(device.buffers.gpu)
    {
    }

private:
    bool trace(VkCommandBuffer commands, const shared::RayFlagProbePush &push) override
    {
        return pipeline_.record(commands, push);
    }
    bool carried(const uint32_t *results) const override { return returns(results[0]) && returns(results[1]); }

    RayFlagPipelineProbe pipeline_;
};

} // namespace

bool RayFlagBits::carried(Way way)
{
    std::lock_guard lock(mutex_);
    std::optional<bool> &answer = answers_[static_cast<size_t>(way)];
    if (!answer)
        answer = tryOut(way).value_or(false);
    return *answer;
}

std::optional<bool> RayFlagBits::tryOut(Way way)
{
    if (!device_.driver.settings->carriedRayFlags)
        return false;
    const bool query = way == Way::Query;
    if (!(query ? device_.driver.asked.rayQueries : device_.driver.asked.rayTracingPipelines) ||
        !device_.commands.trials.exists())
        return true;
    // What one device found out holds for the instance's others of the same physical device.
    DriverHabits &habits = *device_.driver.habits;
    std::lock_guard lock(habits.mutex);
    std::optional<bool> &known = query ? habits.queriesCarryFlagBits : habits.pipelinesCarryFlagBits;
    if (!known) {
        if (query)
            device_.commands.trials.run(std::make_unique<QueryTrial>(device_, known));
        else
            device_.commands.trials.run(std::make_unique<PipelineTrial>(device_, known));
    }
    return known;
}

} // namespace vellum::layer
