// SPDX-License-Identifier: Apache-2.0
#include "amdgpu.h"

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "amdgpu_interface.h"

namespace vellum::test::kernel::amdgpu
{
namespace
{

struct Gpu {
    const char *name;
    u16 id; // of PCI
    u32 family, externalRevision;
    u8 major, minor, revision; // of the version of its graphics
    u32 engines, arrays;       // shader engines, and arrays of each
    u32 units;                 // compute units of an array
    u32 backends;
    u32 addressing; // the register with the layout of its memory
};

constexpr Gpu kGpus[]{
    {"vega10", 0x687f, 141, 0x01, 9, 0, 1, 4, 1, 16, 16, 0x2a114042},
    {"navi21", 0x73bf, 143, 0x28, 10, 3, 0, 4, 2, 10, 16, 0x444},
    {"navi31", 0x744c, 145, 0x01, 11, 0, 0, 6, 2, 8, 24, 0x545},
    {"gfx1201", 0x7550, 152, 0x50, 12, 0, 1, 4, 2, 8, 16, 0x404},
};

constexpr u64 kMemoryBytes = u64{16} << 30;

Engine engine(const Gpu &gpu, u32 kind)
{
    Engine made{};
    if (kind != kGraphics && kind != kCompute)
        return made;
    made.major = gpu.major;
    made.minor = gpu.minor;
    made.startAlignment = made.sizeAlignment = 32;
    made.rings = kind == kGraphics ? 1 : 0xf;
    made.version = u32{gpu.major} << 16 | u32{gpu.minor} << 8 | gpu.revision;
    return made;
}

// The compiler looks at the generation and at the numbers of units, for how many waves there may be. Clocks, caches and
// the like are plausible, and not those of the GPU.
Device device(const Gpu &gpu)
{
    Device made{};
    made.id = gpu.id;
    made.externalRevision = gpu.externalRevision;
    made.family = gpu.family;
    made.engines = gpu.engines;
    made.arrays = gpu.arrays;
    made.clock = 100'000;
    made.engineClock = 2'000'000;
    made.memoryClock = 1'000'000;
    made.units = gpu.engines * gpu.arrays * gpu.units;
    for (u32 e = 0; e < gpu.engines; ++e) {
        for (u32 a = 0; a < gpu.arrays; ++a) // engines from the fifth on share the words of the first ones
            made.unitMask[e % 4][a + e / 4 * 2] = (u32{1} << gpu.units) - 1;
    }
    made.backendMask = (u32{1} << gpu.backends) - 1;
    made.backends = gpu.backends;
    made.contexts = 8;
    made.pcieGeneration = 4;
    made.pcieLanes = 16;
    made.addressBegin = 0x200000;
    made.addressEnd = u64{1} << 47;
    made.highBegin = ~u64{0} << 47;
    made.highEnd = ~u64{0} << 21;
    made.addressAlignment = made.pageSize = 0x1000;
    made.fragmentSize = 0x200000;
    made.memoryType = 9; // GDDR6
    made.memoryWidth = 256;
    made.waveSize = gpu.major >= 10 ? 32 : 64;
    made.vectorRegisters = 256;
    made.unitsOfArray = gpu.units;
    made.cacheBlocks = 16;
    made.tableDepth = 32;
    made.primitiveDepth = 1792;
    made.geometryWaves = 32;
    made.vectorCache = 32; // KiB, as the next ones
    made.scalarCaches = 1;
    made.scalarCache = 16;
    made.instructionCache = 32;
    made.firstCache = 256;
    made.secondCache = 4096;
    made.thirdCache = u64{64} << 20;
    return made;
}

class Amdgpu : public KernelDriver
{
public:
    Amdgpu(const Gpu &gpu, Objects &objects, SyncObjects &syncs) : KernelDriver(objects, syncs), gpu_(gpu) {}

    [[nodiscard]] Identity identity() const override { return {"amdgpu", 3, 61, 0x1002, gpu_.id, 0}; }

    int call(unsigned number, void *argument) override
    {
        switch (Call{number}) {
        case Call::CreateObject: {
            auto *object = static_cast<CreateObject *>(argument);
            const u64 size = object->in.size;
            object->out = {};
            return objects().create(size, object->out.handle);
        }
        case Call::MapObject: {
            auto *map = static_cast<MapObject *>(argument);
            return objects().offset(map->in.handle, map->out.offset);
        }
        case Call::Context: return context(*static_cast<Context *>(argument));
        case Call::ObjectList: {
            auto *list = static_cast<ObjectList *>(argument);
            if (list->in.operation == kCreateList)
                list->out = {objects().newHandle(), 0};
            return 0;
        }
        case Call::Submit: return submit(*static_cast<Submit *>(argument));
        case Call::Query: return query(*static_cast<Info *>(argument));
        case Call::WaitIdle:
        case Call::WaitSubmission: static_cast<Wait *>(argument)->out = {}; return 0;
        case Call::ImportHost: static_cast<ImportHost *>(argument)->handle = objects().newHandle(); return 0;
        case Call::Bind:
        case Call::Metadata:
        case Call::Vm: return 0;
        }
        return EINVAL;
    }

private:
    int context(Context &context)
    {
        const u32 operation = context.in.operation;
        context = {};
        if (operation == kAllocate)
            context.out.context = objects().newHandle();
        return 0; // any other: no GPU was reset
    }

    // Submitted work completes at once.
    int submit(Submit &submit)
    {
        for (const Chunk *chunk : array<const Chunk *>(submit.in.chunks, submit.in.count)) {
            int error = 0;
            const u64 bytes = u64{chunk->words} * sizeof(u32);
            if (chunk->kind == kSignalSyncs) {
                for (const u32 handle : array<u32>(chunk->data, bytes / sizeof(u32)))
                    error = error != 0 ? error : syncs().signal(handle, 1);
            } else if (chunk->kind == kSignalTimelines) {
                for (const Timeline &t : array<Timeline>(chunk->data, bytes / sizeof(Timeline)))
                    error = error != 0 ? error : syncs().signal(t.handle, t.point);
            }
            if (error != 0)
                return error;
        }
        submit.out.handle = ++submissions_;
        return 0;
    }

    int query(const Info &info) const
    {
        const auto give = [&info](const auto &value) {
            std::memcpy(reinterpret_cast<void *>(info.answer), &value, std::min<size_t>(info.size, sizeof value));
            return 0;
        };
        switch (info.query) {
        case Query::Working: return give(u32{1});
        case Query::Engine: return give(engine(gpu_, info.parameters[0]));
        case Query::EngineCount: return give(u32{engine(gpu_, info.parameters[0]).rings != 0});
        case Query::Firmware: return give(Firmware{2000, 60});
        case Query::Registers: return registers(info);
        case Query::Device: return give(device(gpu_));
        case Query::Memory: {
            constexpr Heap kHeap{kMemoryBytes, kMemoryBytes, 0, kMemoryBytes / 4 * 3};
            return give(Memory{kHeap, kHeap, kHeap});
        }
        }
        return EINVAL;
    }

    int registers(const Info &info) const
    {
        constexpr u32 kAddressing = 0x263e;
        auto *values = reinterpret_cast<u32 *>(info.answer);
        for (u32 i = 0; i < info.parameters[1] && i < info.size / sizeof(u32); ++i)
            values[i] = info.parameters[0] + i == kAddressing ? gpu_.addressing : 0;
        return 0;
    }

    const Gpu &gpu_;
    u64 submissions_ = 0;
};

} // namespace

std::unique_ptr<KernelDriver> create(const std::string &gpu, Objects &objects, SyncObjects &syncs)
{
    for (const Gpu &one : kGpus) {
        if (gpu == one.name)
            return std::make_unique<Amdgpu>(one, objects, syncs);
    }
    return nullptr;
}

} // namespace vellum::test::kernel::amdgpu
