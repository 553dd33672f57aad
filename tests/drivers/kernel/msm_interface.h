// SPDX-License-Identifier: Apache-2.0
// The ioctls of the kernel driver msm, as far as turnip uses them.
#pragma once

#include "drm_interface.h"

namespace vellum::test::kernel::msm
{

enum class Call : unsigned { // the number in the ioctl
    Parameter = 0x40,
    CreateObject = 0x42,
    ObjectInfo = 0x43,
    Submit = 0x46,
    WaitFence = 0x47,
    Advise = 0x48,
    CreateQueue = 0x4a,
    CloseQueue = 0x4b,
};

enum class ParameterName : u32 {
    GpuId = 0x01,
    OnChipBytes = 0x02,
    ChipId = 0x03,
    Timestamp = 0x05,
    OnChipBase = 0x06,
    Priorities = 0x07,
    Faults = 0x09,
    Suspends = 0x0a,
    AddressBegin = 0x0e,
    AddressBytes = 0x0f,
    HighestBankBit = 0x10,
    Raytracing = 0x11,
    BandwidthSwizzle = 0x12,
    MacrotileMode = 0x13,
    TrapBase = 0x14,
};
struct Parameter {
    u32 pipe;
    ParameterName name;
    u64 value;
    u32 length, pad;
};

struct CreateObject {
    u64 size;
    u32 flags, handle;
};
enum class InfoName : u32 {
    Offset = 0, // for mmap
};
struct ObjectInfo {
    u32 handle;
    InfoName name;
    u64 value;
    u32 length, pad;
};
struct Advise {
    u32 handle, advice, retained;
};

struct CreateQueue {
    u32 flags, priority, id;
};
struct SubmittedSync {
    u32 handle, flags;
    u64 point;
};
struct Submit {
    u32 flags, fence, objectCount, commandCount;
    u64 objects, commands;
    int file;
    u32 queue;
    u64 waits, signals;
    u32 waitCount, signalCount, syncBytes, pad;
};

static_assert(sizeof(Parameter) == 24 && sizeof(CreateObject) == 16 && sizeof(ObjectInfo) == 24);
static_assert(sizeof(CreateQueue) == 12 && sizeof(SubmittedSync) == 16 && sizeof(Submit) == 72);

} // namespace vellum::test::kernel::msm
