// SPDX-License-Identifier: Apache-2.0
// The check `gpu`: what only data on the device shows. Validation's shaders check the input of builds before the
// builds, and log what they find; see gpu_log.h for when that is reported, gpu_records.h for what they compare with.
#pragma once

#include <span>
#include <vector>

#include <vulkan/vulkan.h>

#include "core/push.h"
#include "layer/base/driver.h"
#include "layer/command_buffer/injected_work.h"
#include "layer/input/builds.h"
#include "layer/validation/gpu/gpu_log.h"
#include "layer/validation/gpu/serialized_data.h"
#include "layer/validation/model/device_model.h"

namespace vellum::layer
{

struct GpuChecks {
    DeviceModel &device;
    GpuLog log{};
    PendingChecks pending{};

    // `driver`: the device as the implementation of micromaps knows it. Reports why the check is off if it cannot be
    // made.
    void create(const Driver &driver);
    // Reports findings, and checks that waited for the device. `idle`: the device executes nothing.
    void report(bool idle);
};

// The checks of one command that builds. Its destructor records nothing; record() does, before the command.
class GpuBuildChecks
{
public:
    GpuBuildChecks(GpuChecks &gpu, VkCommandBuffer commandBuffer, input::BuildCommand command)
        : gpu_(gpu), device_(gpu.device), commandBuffer_(commandBuffer), command_(command)
    {
    }
    void add(const input::MicromapBuild &build);
    void add(const input::StructureBuild &build);
    void record();

private:
    struct Usage {
        shared::UsageBeginPush begin;
        shared::TriangleCheckPush triangles;
    };
    struct Indices {
        shared::IndexCheckPush push;
        bool counted; // the triangles with an index into the micromap, for VK_EXT_opacity_micromap
    };
    struct NewRecord {
        std::shared_ptr<ValidatedStructure> target;
        RecordWords words;
    };
    [[nodiscard]] shared::FindingPush findingOf(uint32_t i, uint32_t geometry, ObjectHandle object, bool khr) const;
    void addIndices(const input::StructureBuild &build, uint32_t g, const input::Attachment &attachment);
    void addInstances(const input::StructureBuild &build, const input::Access &access);
    void dispatch(InjectedWork &work);
    void newRecord(const std::shared_ptr<ValidatedStructure> &target, RecordWords words);

    GpuChecks &gpu_;
    DeviceModel &device_;
    VkCommandBuffer commandBuffer_;
    input::BuildCommand command_;
    std::vector<NewRecord> records_;
    std::vector<Usage> usages_;
    std::vector<Indices> indices_;
    std::vector<shared::InstanceCheckPush> instances_;
};

// Checks the input of builds of micromaps by the host.
void checkHostBuild(GpuChecks &gpu, const input::MicromapBuild &build);

// A copy gives `to` what `from` holds; null: unknown contents, such as serialized data. `commandBuffer`: null for
// copies by the host.
void copyRecord(DeviceModel &device, VkCommandBuffer commandBuffer, const std::shared_ptr<ValidatedStructure> &from,
                const std::shared_ptr<ValidatedStructure> &to);

} // namespace vellum::layer
