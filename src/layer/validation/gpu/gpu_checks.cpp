// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/gpu/gpu_checks.h"

#include <algorithm>
#include <cstring>
#include <iterator>
#include <utility>

#include "core/records.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

constexpr uint32_t kLossy = VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR;

uint32_t highestLevel(const input::UsageCounts &usages)
{
    uint32_t level = 0;
    for (uint32_t i = 0; i < usages.size(); ++i)
        level = std::max(level, usages[i].subdivisionLevel);
    return level;
}

// The word of limits that findingOfTriangle() takes.
uint32_t limitsWord(const RuleDevice &rules, const input::MicromapBuild &build)
{
    const MicromapLimits &limits = rules.limits(build.khr);
    const auto four = [](uint32_t level) { return std::min(level, 15u); };
    return std::min(limits.twoStateLevel, kUsageLevels - 1) |
           std::min(limits.fourStateLevel, kUsageLevels - 1) << kLimitFourStateShift |
           std::min(limits.lossyLevel, kUsageLevels - 1) << kLimitLossyShift |
           four(highestLevel(build.usages)) << kLimitDeclaredShift |
           (build.khr && (build.flags & kLossy) != 0 ? kLimitLossy : 0);
}

// Adds the usage counts of known levels and formats to `counts`, by usageKind().
void addDeclared(const input::UsageCounts &usages, uint32_t *counts)
{
    for (uint32_t i = 0; i < usages.size(); ++i) {
        const VkMicromapUsageEXT &usage = usages[i];
        if (usage.subdivisionLevel < kUsageLevels && (usage.format == 1 || usage.format == 2))
            counts[usageKind(usage.subdivisionLevel, usage.format)] += usage.count;
    }
}

} // namespace

void GpuChecks::create(const Driver &driver)
{
    if (!std::exchange(device.checks.gpu, false))
        return;
    if (!driver.enabled.bufferAddresses && !driver.providesMicromaps()) {
        driver.report().warning("VELLUM-validation-gpu",
                                "bufferDeviceAddress is not enabled: data on the GPU is not checked");
        return;
    }
    device.checks.gpu =
        log.create(device.buffers.gpu) == VK_SUCCESS && device.records.create(device.buffers.gpu) == VK_SUCCESS;
    if (!device.checks.gpu)
        driver.report().error("VELLUM-validation-gpu", "no memory for the check of data on the GPU, which is off");
    else if (driver.enabled.otherStructures)
        device.records.setIncomplete();
}

void GpuChecks::report(bool idle)
{
    if (idle)
        log.drainIdle(*this);
    else
        log.drain(*this);
    pending.report(device);
}

FindingPush GpuBuildChecks::findingOf(uint32_t i, uint32_t geometry, ObjectHandle object, bool khr) const
{
    const bool structure = object.type == VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR;
    return {gpu_.log.address(),  object.handle, (khr ? kFindingKhr : 0) | (structure ? kFindingStructure : 0),
            siteOf(command_, i), geometry,      0};
}

void GpuBuildChecks::newRecord(const std::shared_ptr<ValidatedStructure> &target, RecordWords words)
{
    if (target && target->record)
        records_.push_back({target, words});
}

void GpuBuildChecks::add(const input::MicromapBuild &build)
{
    if (!device_.checks.gpu)
        return;
    const auto target = device_.objects.structureOf(build.target);
    const uint64_t count = build.usages.triangles();
    newRecord(target, {kRecordMicromap, build.flags, static_cast<uint32_t>(count)});
    const AddressMap &addresses = device_.buffers.addresses;
    const VkDeviceAddress array = build.triangles.deviceAddress;
    if (!target || count == 0 || count > kMaxMicromapTriangles || !addresses.find(array).buffer)
        return;
    const uint64_t readable = addresses.elementsFrom(array, sizeof(VkMicromapTriangleEXT), build.triangleStride);
    if (readable < count) {
        if (build.khr)
            return; // the check `core` reports it
        const Place command(nameOf(command_));
        device_.at(command.element("pInfos", build.element), build.target)
            .report("VELLUM-micromap-triangle-array", nullptr,
                    "triangle " + std::to_string(readable) + " is outside the buffer of triangleArray; the usage " +
                        "counts state " + std::to_string(count) + " triangles");
        return;
    }
    Usage &usage = usages_.emplace_back();
    usage.begin = {};
    addDeclared(build.usages, usage.begin.declared);
    TriangleCheckPush &push = usage.triangles;
    push = {};
    push.finding = findingOf(build.element, kNoGeometry, build.target, build.khr);
    push.triangles = array;
    push.stride = static_cast<uint32_t>(build.triangleStride);
    push.count = static_cast<uint32_t>(count);
    push.dataBytes =
        static_cast<uint32_t>(std::min<VkDeviceSize>(addresses.bytesFrom(build.data.deviceAddress), UINT32_MAX));
    push.limits = limitsWord(device_.rules, build);
}

void GpuBuildChecks::add(const input::StructureBuild &build)
{
    if (!device_.checks.gpu)
        return;
    const bool top = build.given->type == VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR;
    newRecord(device_.objects.structureOf(build.given->dstAccelerationStructure),
              {top ? kRecordTop : kRecordBottom, build.given->flags, 0});
    for (uint32_t g = 0; g < build.geometries.size(); ++g)
        if (build.geometries[g].attachment && build.ranges.primitives(g) != 0)
            addIndices(build, g, *build.geometries[g].attachment);
    for (const input::Access &access : build.accesses)
        if (access.of == input::Access::Of::Instances && !build.hasMotion()) // the shader reads no other layout
            addInstances(build, access);
}

void GpuBuildChecks::addIndices(const input::StructureBuild &build, uint32_t g, const input::Attachment &attachment)
{
    IndexCheckPush push{};
    push.attached = attachment.micromap ? 1 : 0;
    push.indexBytes = input::indexBytes(attachment.indexType);
    const AddressMap &addresses = device_.buffers.addresses;
    const VkDeviceAddress indices = attachment.indexBuffer.deviceAddress;
    const bool indexed = push.indexBytes != 0;
    if (indexed ? !addresses.find(indices).buffer
                : attachment.indexType != VK_INDEX_TYPE_NONE_KHR || push.attached == 0)
        return;
    const auto micromap = device_.objects.structureOf(attachment.micromap);
    push.finding = findingOf(build.element, g, attachment.micromap, attachment.khr);
    push.record = device_.records.addressOf(micromap ? micromap->record.get() : nullptr);
    push.range = build.ranges.address(g);
    push.triangleCount = build.ranges.primitives(g);
    push.baseTriangle = attachment.baseTriangle;
    if (indexed) {
        push.indices = indices;
        push.indexStride = static_cast<uint32_t>(attachment.indexStride);
        push.readable = addresses.elementsFrom(indices, push.indexBytes, push.indexStride);
    } else {
        push.indices = push.record; // not read
    }
    // The check `core` reports counts of more triangles than the geometry has.
    const uint64_t declared = attachment.usages.triangles();
    push.declared = static_cast<uint32_t>(declared);
    indices_.push_back({push, !attachment.khr && push.attached != 0 && declared <= push.triangleCount});
}

void GpuBuildChecks::addInstances(const input::StructureBuild &build, const input::Access &access)
{
    InstanceCheckPush push{};
    const uint32_t g = access.geometry;
    const auto &data = build.geometries[g].given->geometry.instances;
    push.pointers = data.arrayOfPointers;
    const VkDeviceSize bytes = input::instanceStride(data);
    if (!device_.buffers.addresses.find(access.begin()).buffer)
        return;
    push.finding = findingOf(build.element, g, build.given->dstAccelerationStructure, false);
    push.instances = access.begin();
    push.records = device_.records.address();
    push.references = device_.records.references();
    push.range = build.ranges.address(g);
    push.count =
        std::min(build.ranges.primitives(g), device_.buffers.addresses.elementsFrom(access.begin(), bytes, bytes));
    push.feature = device_.driver.enabled.anyFeature();
    push.allowDisable = VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_DISABLE_OPACITY_MICROMAPS_BIT_KHR;
    instances_.push_back(push);
}

void GpuBuildChecks::record()
{
    if (records_.empty() && usages_.empty() && indices_.empty() && instances_.empty())
        return;
    // Conditional rendering that a secondary command buffer inherits would discard dispatches, but no transfers.
    const CommandState *state = device_.commands.states.get(commandBuffer_);
    const bool dispatches = state && !state->inheritsConditionalRendering;
    InjectedWork work(device_.commands, commandBuffer_);
    work.barrier();
    for (const NewRecord &record : records_)
        device_.records.set(device_.driver.next, commandBuffer_, *record.target->record, record.words);
    if (dispatches) {
        if (!records_.empty())
            work.barrier();
        dispatch(work);
    }
    work.barrier(true);
}

void GpuBuildChecks::dispatch(InjectedWork &work)
{
    ScratchMemory &scratch = device_.commands.states.get(commandBuffer_)->scratch;
    scratch.restart();
    bool counts = false;
    // Returns the memory of a count; 0 without memory.
    const auto begin = [&](UsageBeginPush push) {
        push.counts = scratch.allocate(kUsageWords * 4);
        counts |= push.counts != 0 && work.dispatch(InjectedShader::UsageBegin, push, kUsageWords, 64);
        return push.counts;
    };
    for (Usage &usage : usages_)
        usage.triangles.counts = begin(usage.begin);
    for (Indices &indices : indices_)
        if (indices.counted)
            indices.push.counts = begin({});
    if (counts)
        work.barrier();
    for (const InstanceCheckPush &push : instances_)
        work.dispatch(InjectedShader::InstanceCheck, push, push.count, 64);
    for (const Indices &indices : indices_)
        work.dispatch(InjectedShader::IndexCheck, indices.push, indices.push.triangleCount, 64);
    for (const Usage &usage : usages_)
        if (usage.triangles.counts != 0)
            work.dispatch(InjectedShader::TriangleCheck, usage.triangles,
                          (usage.triangles.count - 1) / kCheckedTriangles + 1, 64);
    if (counts)
        work.barrier();
    for (Indices &indices : indices_) {
        indices.push.comparing = 1;
        if (indices.push.counts != 0)
            work.dispatch(InjectedShader::IndexCheck, indices.push, 1, 64);
    }
    for (Usage &usage : usages_) {
        usage.triangles.comparing = 1;
        if (usage.triangles.counts != 0)
            work.dispatch(InjectedShader::TriangleCheck, usage.triangles, 1, 64);
    }
}

void checkHostBuild(GpuChecks &gpu, const input::MicromapBuild &build)
{
    DeviceModel &device = gpu.device;
    const auto count = static_cast<uint32_t>(build.usages.triangles());
    const auto target = device.objects.structureOf(build.target);
    if (!device.checks.gpu || !target)
        return;
    if (target->record)
        device.records.set(*target->record, {kRecordMicromap, build.flags, count});
    const auto *triangles = static_cast<const char *>(build.triangles.hostAddress);
    if (!build.accepted || !triangles || !build.data.hostAddress)
        return;
    Finding finding{
        0, siteOf(input::BuildCommand::HostMicromaps, build.element), kNoGeometry, 0, 0, 0, build.target.handle};
    uint32_t declaredCounts[kUsageKinds] = {}, found[kUsageKinds] = {};
    bool wrong = false;
    addDeclared(build.usages, declaredCounts);
    for (finding.element = 0; finding.element < count; ++finding.element) {
        VkMicromapTriangleEXT t;
        std::memcpy(&t, triangles + finding.element * build.triangleStride, sizeof t);
        finding.what =
            findingOfTriangle(t.dataOffset, t.subdivisionLevel, t.format, limitsWord(device.rules, build), UINT32_MAX);
        finding.value0 = t.dataOffset;
        finding.value1 = t.subdivisionLevel | uint32_t{t.format} << 16;
        if (finding.what != 0) {
            reportFinding(gpu, finding);
            wrong = true;
        } else {
            ++found[usageKind(t.subdivisionLevel, t.format)];
        }
    }
    const auto differing = std::ranges::mismatch(declaredCounts, found).in1 - std::begin(declaredCounts);
    if (wrong || differing == kUsageKinds)
        return;
    const auto kind = static_cast<uint32_t>(differing);
    finding.what = kFindingCounts;
    finding.element = kind / 2 | (kind % 2 + 1) << 16;
    finding.value0 = declaredCounts[kind];
    finding.value1 = found[kind];
    reportFinding(gpu, finding);
}

void copyRecord(DeviceModel &device, VkCommandBuffer commandBuffer, const std::shared_ptr<ValidatedStructure> &from,
                const std::shared_ptr<ValidatedStructure> &to)
{
    if (!to || !to->record)
        return;
    const StructureRecords::Owner *source = from ? from->record.get() : nullptr;
    if (!commandBuffer) {
        device.records.copy(source, *to->record);
        return;
    }
    InjectedWork work(device.commands, commandBuffer);
    work.barrier();
    device.records.copy(device.driver.next, commandBuffer, source, *to->record);
    work.barrier();
}

} // namespace vellum::layer
