// SPDX-License-Identifier: Apache-2.0
// The part of the interface between Vulkan drivers and the Linux kernel that is used here and is the same for all
// drivers: libdrm's structures for devices, and the ioctls of DRM. It is declared here, like that of the kernel drivers
// xe and amdgpu, because some of the headers are not packaged in Debian 12. All of it is a stable binary interface
// (xf86drm.h and drm.h; xe_drm.h; amdgpu_drm.h).
#pragma once

#include <cstddef>
#include <cstdint>

namespace vellum::test::kernel
{

using u8 = uint8_t;
using u16 = uint16_t;
using u32 = uint32_t;
using u64 = uint64_t;

// --- libdrm ---

constexpr int kPrimaryNode = 0, kRenderNode = 2, kNodes = 3;
constexpr int kPciBus = 0;

struct PciBus {
    u16 domain;
    u8 bus, device, function;
};
struct PciDevice {
    u16 vendor, device, subVendor, subDevice;
    u8 revision;
};
struct DrmDevice {
    char **nodes;
    int availableNodes; // a bit for each
    int busType;
    PciBus *bus;
    PciDevice *device;
};

// --- ioctls of DRM ---

constexpr unsigned kDrmType = 'd';

enum class Call : unsigned { // the number in the ioctl
    Version = 0x00,
    Client = 0x05,
    CloseObject = 0x09,
    Capability = 0x0c,
    FirstOfDriver = 0x40, // from here to 0x9f the kernel driver's
    CreateSync = 0xbf,
    DestroySync = 0xc0,
    WaitSync = 0xc3,
    ResetSync = 0xc4,
    SignalSync = 0xc5,
    WaitTimeline = 0xca,
    QueryTimeline = 0xcb,
    TransferSync = 0xcc,
    SignalTimeline = 0xcd,
};

struct Version {
    int major, minor, patch;
    size_t nameLength;
    char *name;
    size_t dateLength;
    char *date;
    size_t descriptionLength;
    char *description;
};
struct Client {
    int index, authenticated;
    unsigned long process, user, magic, calls;
};
struct Capability {
    u64 which, value;
};
constexpr u64 kSyncCapability = 0x13, kTimelineCapability = 0x14;
struct Handle { // also: create (flags), destroy
    u32 handle, flags;
};
constexpr u32 kCreateSignaled = 1;

struct SyncWait {
    u64 handles;
    int64_t deadline; // of CLOCK_MONOTONIC, in nanoseconds
    u32 count, flags, firstSignaled, pad;
};
struct TimelineWait {
    u64 handles, points;
    int64_t deadline;
    u32 count, flags, firstSignaled, pad;
};
constexpr u32 kWaitAll = 1, kWaitForSubmit = 2, kWaitAvailable = 4;
struct SyncArray { // reset, signal
    u64 handles;
    u32 count, pad;
};
struct TimelineArray { // query, signal
    u64 handles, points;
    u32 count, flags;
};
struct SyncTransfer {
    u32 source, destination;
    u64 sourcePoint, destinationPoint;
    u32 flags, pad;
};

} // namespace vellum::test::kernel
