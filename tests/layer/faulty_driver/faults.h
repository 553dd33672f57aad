// SPDX-License-Identifier: Apache-2.0
// The faulty driver: a layer between an application and Vellum's layer. Both together, over lavapipe, are a driver with
// VK_EXT_opacity_micromap and VK_KHR_opacity_micromap and one planted fault, which the environment variable
// VELLUM_TEST_FAULT names when an instance is created. faults.cpp lists all faults; each file implements those of one
// subject by changing the application's calls. Without a fault every call passes unchanged. Among the names are also
// freedoms, which the specification allows.
//
// It needs a driver like lavapipe, whose device addresses are host pointers.
#pragma once

#include "layers/driver.h"

#include <cstring>
#include <functional>
#include <utility>

namespace faults
{

using driver::deviceOf;
using driver::has;
using driver::hasAny;
using driver::keyOf;
using driver::Level;
using driver::LevelRows;
using driver::next;
using driver::Row;

using BuildInfo = VkAccelerationStructureBuildGeometryInfoKHR;
using RangeInfo = VkAccelerationStructureBuildRangeInfoKHR;

LevelRows attachmentRows();
LevelRows boxRows();
LevelRows commandRows();
LevelRows copyRows();
LevelRows genericRows();
LevelRows instanceRows();
LevelRows micromapRows();
LevelRows processRows();
LevelRows shaderRows();
LevelRows stateRows();
LevelRows submissionRows();

// --- what a command reads and writes while the device executes it (submissions.cpp) ---

// Memory of the faulty driver that the host and the device access. It remains until the command buffer is recorded
// again, or freed with or without its pool. The address is a multiple of 256.
struct Memory {
    uint8_t *bytes = nullptr;
    VkDeviceAddress address = 0;
};
Memory memoryFor(VkCommandBuffer commands, VkDeviceSize bytes);

// Called whenever the command buffer is submitted, when the queue has completed what was submitted to it before. Build
// inputs are copied there, and the copies changed: the application's own memory stays as it is. Input that the same
// submission computes is not there yet.
void beforeExecution(VkCommandBuffer commands, std::function<void()> function);
// Called when the device has executed it.
void afterExecution(VkCommandBuffer commands, std::function<void()> function);
// Called once, after the next submission to any queue of the device was executed.
void afterNextSubmission(void *key, std::function<void()> function);

template <class T>
T *hostPointer(VkDeviceAddress address)
{
    return reinterpret_cast<T *>(address);
}

// --- handles ---

// A micromap of either API as a number.
template <class Handle>
uint64_t numberOf(Handle handle)
{
    return reinterpret_cast<uint64_t>(handle);
}
template <class Handle>
Handle handleOf(uint64_t number)
{
    return reinterpret_cast<Handle>(number);
}

inline const VkAccelerationStructureGeometryKHR &geometryOf(const BuildInfo &info, uint32_t i)
{
    return info.pGeometries != nullptr ? info.pGeometries[i] : *info.ppGeometries[i];
}

// --- what copies of micromaps change in the structures that use them (copies.cpp) ---

// The micromap that a shallow clone stands for, or the micromap itself.
uint64_t originalOf(uint64_t micromap);
// The triangle that compaction lost; UINT32_MAX if none.
uint32_t lostTriangleOf(uint64_t micromap);
// Called by attachments.cpp when a micromap is destroyed, in the files that keep something about it.
void forgetCopies(uint64_t micromap);
void forgetBuild(uint64_t micromap);
// A micromap of so many triangles is built.
void noteBuilt(uint64_t micromap, uint64_t triangles, bool lossy);
// True if it was built as lossy, or is a copy of one that was.
bool isLossy(uint64_t micromap);
// The number of triangles in its build.
uint64_t trianglesOf(uint64_t micromap);

} // namespace faults
