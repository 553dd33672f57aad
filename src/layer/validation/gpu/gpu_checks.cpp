// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/gpu/gpu_checks.h"

#include <algorithm>
#include <cstring>
#include <iterator>
#include <utility>

namespace vellum::layer
{
namespace
{

using namespace shared;

constexpr uint32_t kLossy = VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR;

// The limits of whoever implements micromaps. A driver's own are asked for; translation never makes a lossy build.
LevelLimits ownLimits(const Driver &driver)
{
    if (driver.emulated())
        return {};
    VkPhysicalDeviceOpacityMicromapPropertiesEXT ext{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_PROPERTIES_EXT};
    VkPhysicalDeviceOpacityMicromapPropertiesKHR khr{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_PROPERTIES_KHR};
    const bool own = driver.enabled.khr && !driver.translated();
    VkPhysicalDeviceProperties2 properties{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2,
                                           own ? static_cast<void *>(&khr) : static_cast<void *>(&ext),
                                           {}};
    driver.instance->GetPhysicalDeviceProperties2(driver.physicalDevice, &properties);
    if (own)
        return {khr.maxOpacity2StateSubdivisionLevel, khr.maxOpacity4StateSubdivisionLevel,
                khr.maxOpacityLossy4StateSubdivisionLevel};
    return {ext.maxOpacity2StateSubdivisionLevel, ext.maxOpacity4StateSubdivisionLevel,
            ext.maxOpacity4StateSubdivisionLevel};
}

LevelLimits limitsOf(const Driver &driver)
{
    const LevelLimits own = ownLimits(driver);
    return {simulatedLimit(own.twoState, driver.settings->most2StateLevel),
            simulatedLimit(own.fourState, driver.settings->most4StateLevel),
            simulatedLimit(own.lossy, driver.settings->mostLossyLevel)};
}

uint32_t highestLevel(const MicromapBuildInput &build)
{
    uint32_t level = 0;
    for (const VkMicromapUsageEXT &usage : build.usages)
        level = std::max(level, usage.subdivisionLevel);
    return level;
}

// The word of limits that findingOfTriangle() takes.
uint32_t limitsWord(const LevelLimits &limits, const MicromapBuildInput &build, bool khr)
{
    const auto four = [](uint32_t level) { return std::min(level, 15u); };
    return std::min(limits.twoState, kUsageLevels - 1) |
           std::min(limits.fourState, kUsageLevels - 1) << kLimitFourStateShift |
           std::min(limits.lossy, kUsageLevels - 1) << kLimitLossyShift |
           four(highestLevel(build)) << kLimitDeclaredShift | (khr && (build.flags & kLossy) != 0 ? kLimitLossy : 0);
}

bool declared(const VkMicromapUsageEXT &usage)
{
    return usage.subdivisionLevel < kUsageLevels && (usage.format == 1 || usage.format == 2);
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
    limits = limitsOf(driver);
    if (log.create(device.buffers.gpu) == VK_SUCCESS && device.records.create(device.buffers.gpu) == VK_SUCCESS)
        device.checks.gpu = true;
    else
        driver.report().error("VELLUM-validation-gpu", "no memory for the check of data on the GPU, which is off");
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

void GpuBuildChecks::add(uint32_t i, const MicromapBuildInput &build)
{
    if (!device_.checks.gpu)
        return;
    const uint64_t count = build.triangleCount();
    newRecord(build.target, {kRecordMicromap, build.flags, static_cast<uint32_t>(count)});
    const AddressMap &addresses = device_.buffers.addresses;
    const VkDeviceAddress array = build.triangles.deviceAddress;
    if (!build.target || count == 0 || count > kMaxMicromapTriangles || !addresses.find(array).buffer)
        return;
    const bool khr = command_ != SiteCommand::BuildMicromaps;
    const uint64_t readable = addresses.elementsFrom(array, sizeof(VkMicromapTriangleEXT), build.triangleStride);
    if (readable < count) {
        if (khr)
            return; // the check `core` reports it
        const Place command("vkCmdBuildMicromapsEXT");
        device_.fault(command.element("pInfos", i), "VELLUM-micromap-triangle-array",
                      "triangle " + std::to_string(readable) + " is outside the buffer of triangleArray; the usage " +
                          "counts state " + std::to_string(count) + " triangles",
                      build.target->handle);
        return;
    }
    Usage &usage = usages_.emplace_back();
    usage.begin = {};
    for (const VkMicromapUsageEXT &given : build.usages) {
        if (declared(given))
            usage.begin.declared[usageKind(given.subdivisionLevel, given.format)] += given.count;
    }
    TriangleCheckPush &push = usage.triangles;
    push = {};
    push.finding = findingOf(i, kNoGeometry, build.target->handle, khr);
    push.triangles = array;
    push.stride = static_cast<uint32_t>(build.triangleStride);
    push.count = static_cast<uint32_t>(count);
    push.dataBytes =
        static_cast<uint32_t>(std::min<VkDeviceSize>(addresses.bytesFrom(build.data.deviceAddress), UINT32_MAX));
    push.limits = limitsWord(gpu_.limits, build, khr);
}

void GpuBuildChecks::add(uint32_t i, const VkAccelerationStructureBuildGeometryInfoKHR &info,
                         const GeometryCounts &counts)
{
    if (!device_.checks.gpu)
        return;
    const bool top = info.type == VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR;
    newRecord(device_.objects.structures.get(info.dstAccelerationStructure),
              {top ? kRecordTop : kRecordBottom, info.flags, 0});
    if (!counts.ranges && !counts.most)
        return;
    for (uint32_t g = 0; g < info.geometryCount; ++g) {
        const VkAccelerationStructureGeometryKHR *geometry = geometryOf(info, g);
        if (!geometry || counts.primitives(g) == 0)
            continue;
        if (geometry->geometryType == VK_GEOMETRY_TYPE_INSTANCES_KHR)
            addInstances(i, g, info, geometry->geometry.instances, counts);
        else if (const auto attachment = attachmentOf(device_, *geometry))
            addIndices(i, g, *attachment, counts);
    }
}

void GpuBuildChecks::addIndices(uint32_t i, uint32_t g, const AttachmentInput &attachment, const GeometryCounts &counts)
{
    IndexCheckPush push{};
    push.attached = attachment.handle.handle != 0;
    push.indexBytes = indexBytes(attachment.indexType);
    const AddressMap &addresses = device_.buffers.addresses;
    const VkDeviceAddress indices = attachment.indexBuffer.deviceAddress;
    const bool indexed = push.indexBytes != 0;
    if (indexed ? !addresses.find(indices).buffer
                : attachment.indexType != VK_INDEX_TYPE_NONE_KHR || push.attached == 0)
        return;
    push.finding = findingOf(i, g, attachment.handle, attachment.khr);
    push.record = device_.records.addressOf(attachment.micromap ? attachment.micromap->record.get() : nullptr);
    push.range = counts.range(g);
    push.triangleCount = counts.primitives(g);
    push.baseTriangle = attachment.baseTriangle;
    if (indexed) {
        push.indices = indices;
        push.indexStride = static_cast<uint32_t>(attachment.indexStride);
        push.readable = addresses.elementsFrom(indices, push.indexBytes, push.indexStride);
    } else {
        push.indices = push.record; // not read
    }
    indices_.push_back(push);
}

void GpuBuildChecks::addInstances(uint32_t i, uint32_t g, const VkAccelerationStructureBuildGeometryInfoKHR &info,
                                  const VkAccelerationStructureGeometryInstancesDataKHR &data,
                                  const GeometryCounts &counts)
{
    InstanceCheckPush push{};
    push.pointers = data.arrayOfPointers;
    const VkDeviceAddress begin = data.data.deviceAddress + (counts.ranges ? counts.ranges[g].primitiveOffset : 0);
    const VkDeviceSize bytes = instanceStride(data);
    if (!device_.buffers.addresses.find(begin).buffer)
        return;
    push.finding = findingOf(i, g, info.dstAccelerationStructure, false);
    push.instances = begin;
    push.records = device_.records.address();
    push.references = device_.records.references();
    push.range = counts.range(g);
    push.count = std::min(counts.primitives(g), device_.buffers.addresses.elementsFrom(begin, bytes, bytes));
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
    if (dispatches)
        dispatch(work);
    work.barrier(true);
}

void GpuBuildChecks::dispatch(InjectedWork &work)
{
    if (!records_.empty())
        work.barrier();
    for (const IndexCheckPush &push : indices_)
        work.dispatch(InjectedShader::IndexCheck, push, push.triangleCount, 64);
    for (const InstanceCheckPush &push : instances_)
        work.dispatch(InjectedShader::InstanceCheck, push, push.count, 64);
    ScratchMemory &scratch = device_.commands.states.get(commandBuffer_)->scratch;
    scratch.restart();
    for (Usage &usage : usages_) {
        usage.begin.counts = scratch.allocate(kUsageWords * 4);
        if (usage.begin.counts == 0)
            return;
        usage.triangles.counts = usage.begin.counts;
        work.dispatch(InjectedShader::UsageBegin, usage.begin, kUsageWords, 64);
    }
    for (uint32_t comparing = 0; comparing < 2 && !usages_.empty(); ++comparing) {
        work.barrier();
        for (Usage &usage : usages_) {
            usage.triangles.comparing = comparing;
            work.dispatch(InjectedShader::TriangleCheck, usage.triangles,
                          comparing != 0 ? 1 : (usage.triangles.count - 1) / kCheckedTriangles + 1, 64);
        }
    }
}

void checkHostBuild(GpuChecks &gpu, uint32_t i, const MicromapBuildInput &build)
{
    const auto count = static_cast<uint32_t>(build.triangleCount());
    if (!gpu.device.checks.gpu || !build.target)
        return;
    if (build.target->record)
        gpu.device.records.set(*build.target->record, {kRecordMicromap, build.flags, count});
    const auto *triangles = static_cast<const char *>(build.triangles.hostAddress);
    if (!triangles || !build.data.hostAddress)
        return;
    Finding finding{0, siteOf(SiteCommand::BuildMicromapsOnHost, i), kNoGeometry, 0, 0, 0, build.target->handle.handle};
    uint32_t declaredCounts[kUsageKinds] = {}, found[kUsageKinds] = {};
    bool wrong = false;
    for (const VkMicromapUsageEXT &usage : build.usages) {
        if (declared(usage))
            declaredCounts[usageKind(usage.subdivisionLevel, usage.format)] += usage.count;
    }
    for (finding.element = 0; finding.element < count; ++finding.element) {
        VkMicromapTriangleEXT t;
        std::memcpy(&t, triangles + finding.element * build.triangleStride, sizeof t);
        finding.what = findingOfTriangle(t.dataOffset, t.subdivisionLevel, t.format,
                                         limitsWord(gpu.limits, build, false), UINT32_MAX);
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
