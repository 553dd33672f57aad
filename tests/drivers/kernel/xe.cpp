// SPDX-License-Identifier: Apache-2.0
#include "xe.h"

#include <cerrno>
#include <cstring>
#include <vector>

#include "xe_interface.h"

namespace vellum::test::kernel::xe
{
namespace
{

struct Gpu {
    const char *name;
    u16 id; // of PCI
    u8 revision;
    u16 major, minor; // of the version of its graphics
    bool ownMemory;
    u16 cores;
    u16 units;   // execution units of a core
    bool simd16; // width of a unit; otherwise 8
};

constexpr Gpu kGpus[]{
    {"dg2", 0x56a0, 8, 12, 55, true, 32, 16, false},
    {"mtl", 0x7d55, 4, 12, 71, false, 8, 16, false},
    {"lnl", 0x64a0, 4, 20, 4, false, 8, 8, true},
    {"bmg", 0xe20b, 4, 20, 1, true, 20, 8, true},
};

constexpr u64 kMemoryBytes = u64{16} << 30;
constexpr u32 kClock = 19'200'000;

class Bytes
{
public:
    template <class T>
    Bytes &add(const T &value)
    {
        const auto *first = reinterpret_cast<const std::byte *>(&value);
        bytes_.insert(bytes_.end(), first, first + sizeof value);
        return *this;
    }
    std::vector<std::byte> take() { return std::move(bytes_); }

private:
    std::vector<std::byte> bytes_;
};

// A list begins with its length.
Bytes list(u32 count)
{
    return Bytes().add(count).add(u32{0});
}

std::vector<std::byte> configuration(const Gpu &gpu)
{
    constexpr u64 kAddressBits = 48, kNormalPriority = 1;
    return list(5)
        .add(u64{gpu.id} | u64{gpu.revision} << 16)
        .add(u64{gpu.ownMemory})
        .add(u64{gpu.ownMemory ? kPageSize : 0x1000})
        .add(kAddressBits)
        .add(kNormalPriority)
        .take();
}

std::vector<std::byte> regions(const Gpu &gpu)
{
    MemoryRegion system{}, own{};
    system.pageSize = 0x1000;
    system.size = kMemoryBytes;
    own.kind = own.instance = 1;
    own.pageSize = kPageSize;
    own.size = own.visibleSize = kMemoryBytes;
    Bytes bytes = list(gpu.ownMemory ? 2 : 1).add(system);
    if (gpu.ownMemory)
        bytes.add(own);
    return bytes.take();
}

std::vector<std::byte> gts(const Gpu &gpu)
{
    Gt main{};
    main.clock = kClock;
    main.nearRegions = gpu.ownMemory ? 2 : 1;
    main.farRegions = gpu.ownMemory ? 1 : 0;
    main.major = gpu.major;
    main.minor = gpu.minor;
    main.revision = gpu.revision;
    return list(1).add(main).take();
}

std::vector<std::byte> engines()
{
    Bytes bytes = list(3);
    for (const u16 kind : {kRenderEngine, kCopyEngine, kComputeEngine})
        bytes.add(Engine{kind, 0, 0, 0, {}});
    return bytes.take();
}

std::vector<std::byte> topology(const Gpu &gpu)
{
    Bytes bytes;
    const auto mask = [&](Mask which, unsigned bits) {
        bytes.add(u16{0}).add(which).add(u32{sizeof(u64)}).add((u64{1} << bits) - 1);
    };
    mask(Mask::GeometryCores, gpu.cores);
    mask(Mask::ComputeCores, gpu.cores);
    mask(Mask::CacheBanks, gpu.cores);
    // The driver reads no more than four bytes of this one.
    bytes.add(u16{0}).add(gpu.simd16 ? Mask::Simd16Units : Mask::Simd8Units).add(u32{sizeof(u32)});
    bytes.add((u32{1} << gpu.units) - 1);
    return bytes.take();
}

// Keys and values of the table that the GPU's firmware has. For the compiler the units of a core and the threads of a
// unit count. The rest is about stages of rasterization, without which the driver would believe that there is one
// thread: plausible numbers, and not those of the GPU.
std::vector<std::byte> hardwareTable(const Gpu &gpu)
{
    constexpr u32 kThreads = 512, kMinEntries = 64, kMaxEntries = 1024;
    Bytes bytes;
    const auto item = [&](u32 key, u32 value) { bytes.add(key).add(u32{1}).add(value); };
    item(3, gpu.units);
    item(15, 8);                                      // threads of a unit
    for (const u32 stage : {16u, 17u, 18u, 19u, 21u}) // vertex, geometry, tessellation (two), fragment
        item(stage, kThreads);
    for (const u32 stage : {29u, 33u, 35u, 37u}) { // vertex, tessellation, geometry, tessellation
        item(stage, kMinEntries);
        item(stage + 1, kMaxEntries);
    }
    item(68, 768); // memory that stages hand on results in, in KiB
    return bytes.take();
}

// The bytes that a query answers with; none where this GPU has no answer.
std::vector<std::byte> answer(const Gpu &gpu, Query query)
{
    switch (query) {
    case Query::Engines: return engines();
    case Query::MemoryRegions: return regions(gpu);
    case Query::Configuration: return configuration(gpu);
    case Query::Gts: return gts(gpu);
    case Query::HardwareTable: return hardwareTable(gpu);
    case Query::Topology: return topology(gpu);
    case Query::Firmware: return Bytes().add(Firmware{0, 0, 0, 1, 20, 0, 0, 0}).take();
    }
    return {};
}

class Xe : public KernelDriver
{
public:
    Xe(const Gpu &gpu, Objects &objects, SyncObjects &syncs) : KernelDriver(objects, syncs), gpu_(gpu) {}

    [[nodiscard]] Identity identity() const override { return {"xe", 1, 1, 0x8086, gpu_.id, gpu_.revision}; }

    int call(unsigned number, void *argument) override
    {
        switch (Call{number}) {
        case Call::Query: return query(*static_cast<DeviceQuery *>(argument));
        case Call::CreateObject: {
            auto *object = static_cast<CreateObject *>(argument);
            return objects().create(object->size, object->handle);
        }
        case Call::MapObject: {
            auto *map = static_cast<MapObject *>(argument);
            return objects().offset(map->handle, map->offset);
        }
        case Call::CreateVm: static_cast<CreateVm *>(argument)->vm = objects().newHandle(); return 0;
        case Call::CreateQueue: static_cast<CreateQueue *>(argument)->queue = objects().newHandle(); return 0;
        case Call::DestroyVm:
        case Call::DestroyQueue: return 0;
        case Call::QueueProperty: static_cast<QueueProperty *>(argument)->value = 0; return 0; // not banned
        case Call::Bind: {
            const auto *bind = static_cast<Bind *>(argument);
            return signalAll(bind->syncs, bind->syncCount);
        }
        case Call::Execute: {
            const auto *execute = static_cast<Execute *>(argument);
            return signalAll(execute->syncs, execute->syncCount);
        }
        }
        return EINVAL;
    }

private:
    int query(DeviceQuery &query) const
    {
        const std::vector<std::byte> bytes = answer(gpu_, query.query);
        if (bytes.empty())
            return EINVAL;
        if (query.size == 0) {
            query.size = static_cast<u32>(bytes.size());
            return 0;
        }
        if (query.size != bytes.size())
            return EINVAL;
        std::memcpy(reinterpret_cast<void *>(query.data), bytes.data(), bytes.size());
        return 0;
    }

    // Submitted work completes at once. A submission that waits for a point that was never submitted is an error.
    int signalAll(u64 list, u32 count)
    {
        for (const Sync &sync : array<Sync>(list, count)) {
            if (sync.kind != kBinary && sync.kind != kTimeline)
                return EINVAL;
            u64 value = 0;
            if ((sync.flags & kSignal) != 0)
                continue;
            if (const int error = syncs().value(static_cast<u32>(sync.handle), value))
                return error;
            if (value < (sync.kind == kTimeline ? sync.point : 1))
                return EINVAL;
        }
        for (const Sync &sync : array<Sync>(list, count)) {
            if ((sync.flags & kSignal) == 0)
                continue;
            const u64 point = sync.kind == kTimeline ? sync.point : 1;
            if (const int error = syncs().signal(static_cast<u32>(sync.handle), point))
                return error;
        }
        return 0;
    }

    const Gpu &gpu_;
};

} // namespace

std::unique_ptr<KernelDriver> create(const std::string &gpu, Objects &objects, SyncObjects &syncs)
{
    for (const Gpu &one : kGpus) {
        if (gpu == one.name)
            return std::make_unique<Xe>(one, objects, syncs);
    }
    return nullptr;
}

} // namespace vellum::test::kernel::xe
