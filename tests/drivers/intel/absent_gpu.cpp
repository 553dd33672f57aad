#include "absent_gpu.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <string>

#include "answers.h"
#include "sync_objects.h"

namespace vellum::test::intel
{
namespace
{

constexpr Gpu kGpus[]{
    {"dg2", 0x56a0, 8, 12, 55, true, 32, 16, false},
    {"mtl", 0x7d55, 4, 12, 71, false, 8, 16, false},
    {"lnl", 0x64a0, 4, 20, 4, false, 8, 8, true},
    {"bmg", 0xe20b, 4, 20, 1, true, 20, 8, true},
};

// A file that was opened by its name from this one is the GPU's for ioctl. Objects are pieces of the file, so that
// the driver maps them as it maps those of a GPU: by their place in the file.
class Kernel
{
public:
    Kernel() : file_(memfd_create("vellum-absent-gpu", MFD_CLOEXEC)), path_("/proc/self/fd/" + std::to_string(file_))
    {
        if (file_ < 0)
            throw std::runtime_error("memfd_create failed");
        struct stat found {
        };
        fstat(file_, &found);
        inode_ = found.st_ino;
        device_ = found.st_dev;
    }

    const Gpu *gpu = nullptr;

    [[nodiscard]] const std::string &path() const { return path_; }
    bool owns(int file) const
    {
        struct stat found {
        };
        return fstat(file, &found) == 0 && found.st_ino == inode_ && found.st_dev == device_;
    }
    // 0 or an error of errno.h.
    int call(unsigned number, void *argument);

private:
    int version(Version &version);
    int query(DeviceQuery &query);
    int createObject(CreateObject &object);
    int mapObject(MapObject &map);
    int closeObject(u32 handle);
    int signalAll(u64 syncs, u32 count);
    int timeline(Call call, TimelineArray &array);

    int file_;
    std::string path_;
    ino_t inode_ = 0;
    dev_t device_ = 0;
    SyncObjects syncs_;
    std::mutex mutex_;
    struct Piece {
        off_t offset, size;
    };
    std::map<u32, Piece> objects_;
    off_t end_ = 0;
    u32 last_ = 0; // of objects, address spaces and queues
};

template <class T>
std::span<const T> array(u64 address, u32 count)
{
    return {reinterpret_cast<const T *>(address), count};
}

int Kernel::version(Version &version)
{
    const auto copy = [](const char *text, char *to, std::size_t &length) {
        if (to != nullptr)
            std::memcpy(to, text, std::min(length, std::strlen(text)));
        length = std::strlen(text);
    };
    version.major = 1;
    version.minor = version.patch = 0;
    copy("xe", version.name, version.nameLength);
    copy("20200101", version.date, version.dateLength);
    copy("an absent GPU", version.description, version.descriptionLength);
    return 0;
}

int Kernel::query(DeviceQuery &query)
{
    const std::vector<std::byte> bytes = answer(*gpu, query.query);
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

int Kernel::createObject(CreateObject &object)
{
    std::lock_guard lock(mutex_);
    const off_t size = static_cast<off_t>((object.size + kPageSize - 1) / kPageSize * kPageSize);
    if (object.size == 0 || ftruncate(file_, end_ + size) != 0)
        return ENOMEM;
    object.handle = ++last_;
    objects_[object.handle] = {end_, size};
    end_ += size;
    return 0;
}

int Kernel::mapObject(MapObject &map)
{
    std::lock_guard lock(mutex_);
    const auto found = objects_.find(map.handle);
    if (found == objects_.end())
        return ENOENT;
    map.offset = static_cast<u64>(found->second.offset);
    return 0;
}

int Kernel::closeObject(u32 handle)
{
    std::lock_guard lock(mutex_);
    const auto found = objects_.extract(handle);
    if (!found)
        return EINVAL;
    // Its place is not used again, but it costs no memory any more.
    fallocate(file_, FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, found.mapped().offset, found.mapped().size);
    return 0;
}

// What is submitted is done at once. A submission that waits for what was never submitted is wrong.
int Kernel::signalAll(u64 syncs, u32 count)
{
    for (const Sync &sync : array<Sync>(syncs, count)) {
        if (sync.kind != kBinary && sync.kind != kTimeline)
            return EINVAL;
        const u32 handle = static_cast<u32>(sync.handle);
        const u64 point = sync.kind == kTimeline ? sync.point : 1;
        u64 value = 0;
        if ((sync.flags & kSignal) == 0) {
            if (const int error = syncs_.value(handle, value))
                return error;
            if (value < point)
                return EINVAL;
        }
    }
    for (const Sync &sync : array<Sync>(syncs, count)) {
        if ((sync.flags & kSignal) == 0)
            continue;
        if (const int error = syncs_.signal(static_cast<u32>(sync.handle), sync.kind == kTimeline ? sync.point : 1))
            return error;
    }
    return 0;
}

int Kernel::timeline(Call call, TimelineArray &array)
{
    const auto *handles = reinterpret_cast<const u32 *>(array.handles);
    auto *points = reinterpret_cast<u64 *>(array.points);
    for (u32 i = 0; i < array.count; ++i) {
        const int error =
            call == Call::QueryTimeline ? syncs_.value(handles[i], points[i]) : syncs_.signal(handles[i], points[i]);
        if (error != 0)
            return error;
    }
    return 0;
}

int Kernel::call(unsigned number, void *argument)
{
    const auto newHandle = [this](u32 &handle) {
        std::lock_guard lock(mutex_);
        handle = ++last_;
        return 0;
    };
    switch (const Call call{number}) {
    case Call::Version: return version(*static_cast<Version *>(argument));
    case Call::Capability: {
        auto *capability = static_cast<Capability *>(argument);
        capability->value = capability->which == kSyncCapability || capability->which == kTimelineCapability;
        return 0;
    }
    case Call::DeviceQuery: return query(*static_cast<DeviceQuery *>(argument));
    case Call::CreateObject: return createObject(*static_cast<CreateObject *>(argument));
    case Call::MapObject: return mapObject(*static_cast<MapObject *>(argument));
    case Call::CloseObject: return closeObject(static_cast<Handle *>(argument)->handle);
    case Call::CreateVm: return newHandle(static_cast<CreateVm *>(argument)->vm);
    case Call::CreateQueue: return newHandle(static_cast<CreateQueue *>(argument)->queue);
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
    case Call::CreateSync: {
        auto *created = static_cast<Handle *>(argument);
        created->handle = syncs_.create((created->flags & kCreateSignaled) != 0);
        return 0;
    }
    case Call::DestroySync: return syncs_.destroy(static_cast<Handle *>(argument)->handle);
    case Call::WaitSync: {
        auto *wait = static_cast<SyncWait *>(argument);
        return syncs_.wait(array<u32>(wait->handles, wait->count), {}, wait->deadline, wait->flags,
                           wait->firstSignaled);
    }
    case Call::WaitTimeline: {
        auto *wait = static_cast<TimelineWait *>(argument);
        return syncs_.wait(array<u32>(wait->handles, wait->count), array<u64>(wait->points, wait->count),
                           wait->deadline, wait->flags, wait->firstSignaled);
    }
    case Call::ResetSync: {
        const auto *reset = static_cast<SyncArray *>(argument);
        return syncs_.reset(array<u32>(reset->handles, reset->count));
    }
    case Call::SignalSync: {
        const auto *signal = static_cast<SyncArray *>(argument);
        for (const u32 handle : array<u32>(signal->handles, signal->count)) {
            if (const int error = syncs_.signal(handle, 1))
                return error;
        }
        return 0;
    }
    case Call::QueryTimeline:
    case Call::SignalTimeline: return timeline(call, *static_cast<TimelineArray *>(argument));
    case Call::TransferSync: {
        const auto *transfer = static_cast<SyncTransfer *>(argument);
        u64 value = 0;
        if (const int error = syncs_.value(transfer->source, value))
            return error;
        if (value < std::max<u64>(transfer->sourcePoint, 1))
            return EINVAL;
        return syncs_.signal(transfer->destination, transfer->destinationPoint);
    }
    }
    return EINVAL;
}

// Never destroyed: drivers may close their files after this program's objects are gone.
Kernel &kernel()
{
    static auto *made = new Kernel;
    return *made;
}

bool installed = false;

// libdrm frees a device with one call of free, so all of it is one piece of memory.
DrmDevice *describe()
{
    struct Device {
        DrmDevice device;
        PciBus bus;
        PciDevice pci;
        std::array<char *, kNodes> nodes;
        std::array<char, 32> path;
    };
    auto *made = static_cast<Device *>(std::calloc(1, sizeof(Device)));
    if (made == nullptr)
        return nullptr;
    const Gpu &gpu = *kernel().gpu;
    std::snprintf(made->path.data(), made->path.size(), "%s", kernel().path().c_str());
    made->nodes.fill(made->path.data());
    made->bus = {0, 3, 0, 0};
    made->pci = {0x8086, gpu.id, 0x8086, 0, gpu.revision};
    made->device = {made->nodes.data(), 1 << kPrimaryNode | 1 << kRenderNode, kPciBus, &made->bus, &made->pci};
    return &made->device;
}

} // namespace

std::span<const Gpu> gpus()
{
    return kGpus;
}

void install(const char *name)
{
    for (const Gpu &gpu : kGpus) {
        if (std::strcmp(gpu.name, name) == 0) {
            kernel().gpu = &gpu;
            installed = true;
            return;
        }
    }
    throw std::invalid_argument(std::string("no Intel GPU of the name ") + name);
}

} // namespace vellum::test::intel

// --- what comes before the system's functions of these names ---

#define VELLUM_EXPORTED extern "C" __attribute__((visibility("default"))) // NOLINT

VELLUM_EXPORTED int ioctl(int file, unsigned long request, ...);
VELLUM_EXPORTED int drmGetDevices2(std::uint32_t flags, vellum::test::intel::DrmDevice **devices, int most);
VELLUM_EXPORTED int drmGetDevice2(int file, std::uint32_t flags, vellum::test::intel::DrmDevice **device);

int ioctl(int file, unsigned long request, ...)
{
    using namespace vellum::test::intel;
    std::va_list arguments;
    va_start(arguments, request);
    void *argument = va_arg(arguments, void *);
    va_end(arguments);
    if (installed && (request >> 8 & 0xff) == kDrmType && kernel().owns(file)) {
        const int error = kernel().call(request & 0xff, argument);
        errno = error;
        return error == 0 ? 0 : -1;
    }
    return static_cast<int>(syscall(SYS_ioctl, file, request, argument));
}

int drmGetDevices2(std::uint32_t, vellum::test::intel::DrmDevice **devices, int most)
{
    using namespace vellum::test::intel;
    if (!installed)
        return 0; // no GPU of this machine has a part in these tests
    if (devices != nullptr && most > 0 && (devices[0] = describe()) == nullptr)
        return -ENOMEM;
    return 1;
}

int drmGetDevice2(int file, std::uint32_t, vellum::test::intel::DrmDevice **device)
{
    using namespace vellum::test::intel;
    if (!installed || !kernel().owns(file))
        return -ENODEV;
    *device = describe();
    return *device == nullptr ? -ENOMEM : 0;
}
