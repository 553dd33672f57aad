// SPDX-License-Identifier: Apache-2.0
// The recorder: a layer above all others that writes which values an application gives to the members of every
// structure of acceleration structures, micromaps and ray tracing pipelines. A label that is inserted into a queue
// names what follows (vkQueueInsertDebugUtilsLabelEXT: its text up to a space). With VELLUM_TEST_RECORD=FOLDER each
// process writes FOLDER/PID.tsv: a line for each label, member and value. generate.py lists the members.
//
// It reads build inputs of the device when a queue gets the commands, since they may be written after recording. So it
// needs a driver like lavapipe, whose device addresses are host pointers.
#include "layers/driver.h"

#include <bit>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <map>
#include <set>
#include <sys/uio.h>
#include <type_traits>
#include <unistd.h>
#include <utility>
#include <vector>

namespace
{

using driver::Level;
using driver::Row;

constexpr Level kLevel = Level::Recorder;
constexpr size_t kMostValues = 1000;   // of a member
constexpr uint64_t kMostElements = 64; // elements read of an array in device memory

std::mutex mutex; // of all that follows
std::string label = "none";
using Values = std::map<std::string, std::set<int64_t>, std::less<>>; // by structure and member
std::map<std::string, Values, std::less<>> recorded;                  // by label
std::vector<std::pair<std::string, std::function<void()>>> later;     // what reads memory, with its label

void note(const char *member, int64_t value)
{
    std::set<int64_t> &values = recorded[label][member];
    if (values.size() < kMostValues)
        values.insert(value);
}

// Records that a structure or command occurs.
void used(const char *name)
{
    note(name, 1);
}

template <class T>
void noteValue(const char *member, T v)
{
    note(member, static_cast<int64_t>(v));
}
template <class T>
void noteFlags(const char *member, T v)
{
    note(member, static_cast<int64_t>(v));
}
// Counts up to 8 are exact, larger ones become the power of two below.
template <class T>
void noteNumber(const char *member, T v)
{
    const auto bits = static_cast<uint64_t>(v);
    note(member, static_cast<int64_t>(bits <= 8 ? bits : std::bit_floor(bits)));
}
// Null, or the alignment, up to 256.
void noteAddress(const char *member, VkDeviceAddress v)
{
    note(member, v == 0 ? 0 : static_cast<int64_t>(std::min<VkDeviceAddress>(v & (~v + 1), 256)));
}
template <class T>
void noteHandle(const char *member, T v)
{
    note(member, v == VK_NULL_HANDLE ? 0 : 1);
}
void notePointer(const char *member, const void *v)
{
    note(member, v == nullptr ? 0 : 1);
}
// Negative, zero, positive, not a number.
void noteReal(const char *member, float v)
{
    note(member, std::isnan(v) ? 2 : v < 0 ? -1 : v > 0 ? 1 : 0);
}
template <class T>
void noteArray(const char *member, const T *values, size_t count)
{
    for (size_t i = 0; i < count; ++i) {
        if constexpr (std::is_floating_point_v<T>)
            noteReal(member, values[i]);
        else
            noteNumber(member, values[i]);
    }
}

void visitChosen(VkGeometryTypeKHR type, const VkAccelerationStructureGeometryDataKHR &data);
template <class T>
void visitAll(const T *values, uint32_t count);
template <class T>
void visitAll(const T *const *values, uint32_t count);
void visitRanges(uint32_t count, const VkAccelerationStructureBuildGeometryInfoKHR *infos,
                 const VkAccelerationStructureBuildRangeInfoKHR *const *ranges);
void visitIndirectRanges(uint32_t count, const VkAccelerationStructureBuildGeometryInfoKHR *infos,
                         const VkDeviceAddress *addresses, const uint32_t *strides);
void visitMicromaps(uint32_t count, const VkMicromapBuildInfoEXT *infos);
template <class T>
void visitMemory(VkDeviceAddress from, VkDeviceSize stride, uint64_t count);

void readMemory()
{
    for (const auto &[name, read] : std::exchange(later, {})) {
        const std::string now = std::exchange(label, name);
        read();
        label = now;
    }
}

// A call of the next layer, which may call this one from other threads.
template <class Function, class... Arguments>
auto unlocked(Function function, Arguments... arguments)
{
    mutex.unlock();
    struct Lock {
        ~Lock() { mutex.lock(); }
    } lock;
    return function(arguments...);
}

void save()
{
    const char *folder = std::getenv("VELLUM_TEST_RECORD");
    if (folder == nullptr)
        return;
    const std::string path = std::string(folder) + "/" + std::to_string(getpid()) + ".tsv";
    const std::string unfinished = path + ".tmp"; // workers are killed at any time
    std::FILE *const file = std::fopen(unfinished.c_str(), "w");
    if (file == nullptr)
        return;
    for (const auto &[name, members] : recorded)
        for (const auto &[member, values] : members)
            for (const int64_t each : values)
                std::fprintf(file, "%s\t%s\t%lld\n", name.c_str(), member.c_str(), static_cast<long long>(each));
    if (std::fclose(file) == 0)
        std::rename(unfinished.c_str(), path.c_str());
}

VKAPI_ATTR void VKAPI_CALL insertLabel(VkQueue handle, const VkDebugUtilsLabelEXT *info)
{
    {
        const std::lock_guard lock(mutex);
        const std::string_view text = info->pLabelName;
        label = text.substr(0, text.find(' '));
    }
    if (const auto next = DRIVER_NEXT(vkQueueInsertDebugUtilsLabelEXT))
        next(handle, info);
}

// What `vellum check` submits by.
VKAPI_ATTR VkResult VKAPI_CALL queueSubmit(VkQueue handle, uint32_t count, const VkSubmitInfo *infos, VkFence fence)
{
    {
        const std::lock_guard lock(mutex);
        readMemory();
    }
    return DRIVER_NEXT(vkQueueSubmit)(handle, count, infos, fence);
}

// Writes out the record: workers may end without destroying their instance.
VKAPI_ATTR void VKAPI_CALL destroyDevice(VkDevice handle, const VkAllocationCallbacks *allocator)
{
    {
        const std::lock_guard lock(mutex);
        later.clear();
        save();
    }
    DRIVER_NEXT(vkDestroyDevice)(handle, allocator);
}

#define RECORDER_ROWS                                                                                                  \
    {"vkQueueInsertDebugUtilsLabelEXT", DRIVER_FUNCTION(insertLabel)},                                                 \
        {"vkQueueSubmit", DRIVER_FUNCTION(queueSubmit)}, {"vkDestroyDevice", DRIVER_FUNCTION(destroyDevice)},
#include "recorder_members.inc"

void visitChosen(VkGeometryTypeKHR type, const VkAccelerationStructureGeometryDataKHR &data)
{
    switch (type) {
    case VK_GEOMETRY_TYPE_TRIANGLES_KHR: return visit(data.triangles);
    case VK_GEOMETRY_TYPE_AABBS_KHR: return visit(data.aabbs);
    case VK_GEOMETRY_TYPE_INSTANCES_KHR: return visit(data.instances);
    default: return;
    }
}

template <class T>
void visitAll(const T *values, uint32_t count)
{
    for (uint32_t i = 0; values != nullptr && i < count; ++i)
        visit(values[i]);
}
template <class T>
void visitAll(const T *const *values, uint32_t count)
{
    for (uint32_t i = 0; values != nullptr && i < count; ++i)
        visit(*values[i]);
}

// Returns false where there is no memory any more.
template <class T>
bool readAt(VkDeviceAddress from, T &copy)
{
    const iovec to{&copy, sizeof copy}, at{reinterpret_cast<void *>(from), sizeof copy};
    return process_vm_readv(getpid(), &to, 1, &at, 1, 0) == static_cast<ssize_t>(sizeof copy);
}

// Visits the first elements and the last one of an array in device memory, in readMemory().
template <class T>
void visitMemory(VkDeviceAddress from, VkDeviceSize stride, uint64_t count)
{
    later.emplace_back(label, [from, stride, count] {
        for (uint64_t i = 0; from != 0 && i < count; i = i + 1 == count || i + 1 < kMostElements ? i + 1 : count - 1)
            if (T copy; readAt(from + i * stride, copy))
                visit(copy);
    });
}

template <class Usage>
uint64_t trianglesOf(uint32_t count, const Usage *counts, const Usage *const *pointers)
{
    uint64_t triangles = 0;
    for (uint32_t i = 0; i < count; ++i)
        triangles += counts != nullptr ? counts[i].count : pointers[i]->count;
    return triangles;
}

void visitMicromaps(uint32_t count, const VkMicromapBuildInfoEXT *infos)
{
    for (const VkMicromapBuildInfoEXT &info : std::span(infos, count))
        visitMemory<VkMicromapTriangleEXT>(info.triangleArray.deviceAddress, info.triangleArrayStride,
                                           trianglesOf(info.usageCountsCount, info.pUsageCounts, info.ppUsageCounts));
}

void visitIndirectRanges(uint32_t count, const VkAccelerationStructureBuildGeometryInfoKHR *infos,
                         const VkDeviceAddress *addresses, const uint32_t *strides)
{
    for (uint32_t i = 0; i < count; ++i)
        visitMemory<VkAccelerationStructureBuildRangeInfoKHR>(addresses[i], strides[i], infos[i].geometryCount);
    visitRanges(count, infos, nullptr);
}

void visitRanges(uint32_t count, const VkAccelerationStructureBuildGeometryInfoKHR *infos,
                 const VkAccelerationStructureBuildRangeInfoKHR *const *ranges)
{
    for (uint32_t i = 0; i < count; ++i) {
        const VkAccelerationStructureBuildGeometryInfoKHR &info = infos[i];
        for (uint32_t g = 0; g < info.geometryCount; ++g) {
            const auto &geometry = info.pGeometries != nullptr ? info.pGeometries[g] : *info.ppGeometries[g];
            if (geometry.geometryType == VK_GEOMETRY_TYPE_MICROMAP_KHR) {
                const auto *data = driver::inChain<VkAccelerationStructureGeometryMicromapDataKHR>(
                    geometry.pNext, VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_MICROMAP_DATA_KHR);
                if (data != nullptr)
                    visitMemory<VkMicromapTriangleKHR>(
                        data->triangleArray, data->triangleArrayStride,
                        trianglesOf(data->usageCountsCount, data->pUsageCounts, data->ppUsageCounts));
                continue;
            }
            if (ranges == nullptr || ranges[i] == nullptr)
                continue;
            const VkAccelerationStructureBuildRangeInfoKHR &range = ranges[i][g];
            visit(range);
            if (geometry.geometryType == VK_GEOMETRY_TYPE_TRIANGLES_KHR &&
                geometry.geometry.triangles.transformData.deviceAddress != 0)
                visitMemory<VkTransformMatrixKHR>(
                    geometry.geometry.triangles.transformData.deviceAddress + range.transformOffset, 0, 1);
            if (geometry.geometryType == VK_GEOMETRY_TYPE_AABBS_KHR)
                visitMemory<VkAabbPositionsKHR>(geometry.geometry.aabbs.data.deviceAddress + range.primitiveOffset,
                                                geometry.geometry.aabbs.stride, range.primitiveCount);
            if (geometry.geometryType != VK_GEOMETRY_TYPE_INSTANCES_KHR)
                continue;
            const VkDeviceAddress from = geometry.geometry.instances.data.deviceAddress + range.primitiveOffset;
            if (geometry.geometry.instances.arrayOfPointers == VK_FALSE) {
                visitMemory<VkAccelerationStructureInstanceKHR>(from, sizeof(VkAccelerationStructureInstanceKHR),
                                                                range.primitiveCount);
                continue;
            }
            later.emplace_back(label, [from, count = std::min<uint64_t>(range.primitiveCount, kMostElements)] {
                VkAccelerationStructureInstanceKHR instance;
                for (VkDeviceAddress n = 0, each = 0; n < count; ++n)
                    if (readAt(from + n * sizeof each, each) && readAt(each, instance))
                        visit(instance);
            });
        }
    }
}

} // namespace

namespace driver
{

const char *const kQuirkVariable = "VELLUM_TEST_RECORDER"; // it has no quirks

std::span<const Quirk> allQuirks()
{
    return {};
}

std::span<const NamedLevel> allLevels()
{
    static const NamedLevel all[]{{Level::Recorder, {kRows, {}}, true}};
    return all;
}

} // namespace driver
