// SPDX-License-Identifier: Apache-2.0
// The ioctls of the kernel driver amdgpu, as far as RADV uses them.
#pragma once

#include "drm_interface.h"

namespace vellum::test::kernel::amdgpu
{

enum class Call : unsigned { // the number in the ioctl
    CreateObject = 0x40,
    MapObject = 0x41,
    Context = 0x42,
    ObjectList = 0x43,
    Submit = 0x44,
    Query = 0x45,
    Metadata = 0x46,
    WaitIdle = 0x47,
    Bind = 0x48,
    WaitSubmission = 0x49,
    ImportHost = 0x51,
    Vm = 0x53,
};

union CreateObject {
    struct {
        u64 size, alignment, domains, flags;
    } in;
    struct {
        u32 handle, pad;
    } out;
};
union MapObject {
    struct {
        u32 handle, pad;
    } in;
    struct {
        u64 offset;
    } out;
};
constexpr u32 kAllocate = 1;
union Context {
    struct {
        u32 operation, flags, context, priority;
    } in;
    struct {
        u32 context, pad;
    } out;
    u64 state[2];
};
constexpr u32 kCreateList = 0;
union ObjectList {
    struct {
        u32 operation, list, count, size;
        u64 objects;
    } in;
    struct {
        u32 list, pad;
    } out;
};
union Wait { // for idle objects, and for submissions
    u64 in[4];
    struct {
        u64 status; // 0: done
        u64 domain;
    } out;
};
struct ImportHost {
    u64 address, size;
    u32 flags, handle;
};

union Submit {
    struct {
        u32 context, list, count, flags;
        u64 chunks; // the address of an array of addresses
    } in;
    struct {
        u64 handle;
    } out;
};
struct Chunk {
    u32 kind, words;
    u64 data;
};
constexpr u32 kSignalSyncs = 5, kSignalTimelines = 9;
struct Timeline {
    u32 handle, flags;
    u64 point;
};

enum class Query : u32 {
    Working = 0x00,
    Engine = 0x02,
    EngineCount = 0x03,
    Firmware = 0x0e,
    Registers = 0x15,
    Device = 0x16,
    Memory = 0x19,
};
struct Info {
    u64 answer;
    u32 size;
    Query query;
    u32 parameters[4];
};
constexpr u32 kGraphics = 0, kCompute = 1;
struct Engine {
    u32 major, minor;
    u64 capabilities;
    u32 startAlignment, sizeAlignment, rings, version, slots, pad;
};
struct Heap {
    u64 total, usable, used, largest;
};
struct Memory {
    Heap own, visible, system;
};
struct Firmware {
    u32 version, feature;
};
struct Device {
    u32 id, chipRevision, externalRevision, pciRevision, family, engines, arrays, clock;
    u64 engineClock, memoryClock;
    u32 units, unusedMask, unitMask[4][4], backendMask, backends, contexts, pcieGeneration;
    u64 flags, addressBegin, addressEnd;
    u32 addressAlignment, fragmentSize, pageSize, constantRam, memoryType, memoryWidth, harvest, doubleLds;
    u64 buffers[4];
    u32 bufferSizes[4], waveSize, vectorRegisters, unitsOfArray, cacheBlocks, tableDepth, primitiveDepth, geometryWaves,
        pcieLanes, onMask[4][4];
    u64 highBegin, highEnd;
    u32 tileSteering;
    u64 disabledCaches, leastEngineClock, leastMemoryClock;
    u32 vectorCache, scalarCaches, scalarCache, instructionCache, firstCache, secondCache;
    u64 thirdCache;
    u32 backendMaskHigh, shadowSize, shadowAlignment, saveSize, saveAlignment, userQueues, pad;
};

static_assert(sizeof(CreateObject) == 32 && sizeof(Context) == 16 && sizeof(ObjectList) == 24 && sizeof(Submit) == 24);
static_assert(sizeof(Info) == 32 && sizeof(Engine) == 40 && sizeof(Memory) == 96 && sizeof(Chunk) == 16);
static_assert(offsetof(Device, flags) == 136 && offsetof(Device, highBegin) == 336 && sizeof(Device) == 448);

} // namespace vellum::test::kernel::amdgpu
