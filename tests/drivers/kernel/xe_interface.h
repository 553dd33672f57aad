// SPDX-License-Identifier: Apache-2.0
// The ioctls of the kernel driver xe, as far as ANV uses them.
#pragma once

#include "drm_interface.h"

namespace vellum::test::kernel::xe
{

enum class Call : unsigned { // the number in the ioctl
    Query = 0x40,
    CreateObject = 0x41,
    MapObject = 0x42,
    CreateVm = 0x43,
    DestroyVm = 0x44,
    Bind = 0x45,
    CreateQueue = 0x46,
    DestroyQueue = 0x47,
    QueueProperty = 0x48,
    Execute = 0x49,
};

enum class Query : u32 {
    Engines = 0,
    MemoryRegions = 1,
    Configuration = 2,
    Gts = 3, // "graphics technology", a part of the GPU
    HardwareTable = 4,
    Topology = 5,
    Firmware = 7,
};
struct DeviceQuery {
    u64 extensions;
    Query query;
    u32 size;
    u64 data;
    u64 reserved[2];
};

constexpr u16 kRenderEngine = 0, kCopyEngine = 1, kComputeEngine = 4;
struct Engine {
    u16 kind, instance, gt, pad;
    u64 reserved[3];
};
struct MemoryRegion {
    u16 kind, instance; // kind 0: the system's memory, 1: the GPU's own
    u32 pageSize;
    u64 size, used, visibleSize, visibleUsed;
    u64 reserved[6];
};
struct Gt {
    u16 kind, tile, gt, pad[3];
    u32 clock;
    u64 nearRegions, farRegions;
    u16 major, minor, revision, pad2;
    u64 reserved[7];
};
enum class Mask : u16 { GeometryCores = 1, ComputeCores = 2, CacheBanks = 3, Simd8Units = 4, Simd16Units = 5 };
struct Firmware {
    u16 kind, pad; // kind 0: the one that takes submissions
    u32 branch, major, minor, patch;
    u32 pad2;
    u64 reserved;
};

struct CreateObject {
    u64 extensions, size;
    u32 placement, flags, vm, handle;
    u16 caching, pad[3];
    u64 reserved[2];
};
struct MapObject {
    u64 extensions;
    u32 handle, flags;
    u64 offset;
    u64 reserved[2];
};
struct CreateVm {
    u64 extensions;
    u32 flags, vm;
    u64 reserved[2];
};
struct BindOperation {
    u64 extensions;
    u32 object;
    u16 cacheMode, pad;
    u64 offset, range, address;
    u32 operation, flags, region, pad2;
    u64 reserved[3];
};
struct Bind {
    u64 extensions;
    u32 vm, queue, pad, count;
    BindOperation one; // of one operation; else its first word points to an array
    u32 pad2, syncCount;
    u64 syncs;
    u64 reserved[2];
};
struct CreateQueue {
    u64 extensions;
    u16 width, placements;
    u32 vm, flags, queue;
    u64 instances;
    u64 reserved[2];
};
struct QueueProperty {
    u64 extensions;
    u32 queue, property;
    u64 value;
    u64 reserved[2];
};
struct Execute {
    u64 extensions;
    u32 queue, syncCount;
    u64 syncs, batch;
    u16 batches, pad[3];
    u64 reserved[2];
};
struct Sync {
    u64 extensions;
    u32 kind, flags;
    u64 handle; // 32 bits of it
    u64 point;
    u64 reserved[2];
};
constexpr u32 kBinary = 0, kTimeline = 1;
constexpr u32 kSignal = 1;

static_assert(sizeof(DeviceQuery) == 40 && sizeof(Engine) == 32 && sizeof(MemoryRegion) == 88 && sizeof(Gt) == 96);
static_assert(sizeof(CreateObject) == 56 && sizeof(MapObject) == 40 && sizeof(CreateVm) == 32);
static_assert(sizeof(BindOperation) == 80 && sizeof(Bind) == 136 && sizeof(CreateQueue) == 48);
static_assert(sizeof(QueueProperty) == 40 && sizeof(Execute) == 56 && sizeof(Sync) == 48);

} // namespace vellum::test::kernel::xe
