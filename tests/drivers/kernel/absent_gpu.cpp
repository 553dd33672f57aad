// SPDX-License-Identifier: Apache-2.0
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

#include "amdgpu.h"
#include "msm.h"
#include "xe.h"

namespace vellum::test::kernel
{
namespace
{

// A file that was opened by its name from this one is the GPU's for ioctl.
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

    std::unique_ptr<KernelDriver> driver; // null: no GPU yet

    void install(const char *gpu)
    {
        driver = xe::create(gpu, objects_, syncs_);
        if (!driver)
            driver = amdgpu::create(gpu, objects_, syncs_);
        if (!driver)
            driver = msm::create(gpu, objects_, syncs_);
        if (!driver)
            throw std::invalid_argument(std::string("no GPU of the name ") + gpu);
    }
    [[nodiscard]] const std::string &path() const { return path_; }
    bool owns(int file) const
    {
        struct stat found {
        };
        return fstat(file, &found) == 0 && found.st_ino == inode_ && found.st_dev == device_;
    }
    // 0 or an error of errno.h.
    int call(unsigned number, void *argument);
    Objects &objects() { return objects_; }

private:
    int version(Version &version) const;
    int signalAll(const SyncArray &array);
    int timeline(Call call, const TimelineArray &array);
    int transfer(const SyncTransfer &transfer);

    int file_;
    std::string path_;
    ino_t inode_ = 0;
    dev_t device_ = 0;
    SyncObjects syncs_;
    Objects objects_{file_};
};

int Kernel::version(Version &version) const
{
    const auto copy = [](const char *text, char *to, size_t &length) {
        if (to != nullptr)
            std::memcpy(to, text, std::min(length, std::strlen(text)));
        length = std::strlen(text);
    };
    const Identity identity = driver->identity();
    version.major = identity.major;
    version.minor = identity.minor;
    version.patch = 0;
    copy(identity.driver, version.name, version.nameLength);
    copy("20200101", version.date, version.dateLength);
    copy("an absent GPU", version.description, version.descriptionLength);
    return 0;
}

int Kernel::signalAll(const SyncArray &list)
{
    for (const u32 handle : array<u32>(list.handles, list.count)) {
        if (const int error = syncs_.signal(handle, 1))
            return error;
    }
    return 0;
}

int Kernel::timeline(Call call, const TimelineArray &list)
{
    const auto *handles = reinterpret_cast<const u32 *>(list.handles);
    auto *points = reinterpret_cast<u64 *>(list.points);
    for (u32 i = 0; i < list.count; ++i) {
        const int error =
            call == Call::QueryTimeline ? syncs_.value(handles[i], points[i]) : syncs_.signal(handles[i], points[i]);
        if (error != 0)
            return error;
    }
    return 0;
}

int Kernel::transfer(const SyncTransfer &transfer)
{
    u64 value = 0;
    if (const int error = syncs_.value(transfer.source, value))
        return error;
    if (value < std::max<u64>(transfer.sourcePoint, 1))
        return EINVAL;
    return syncs_.signal(transfer.destination, transfer.destinationPoint);
}

int Kernel::call(unsigned number, void *argument)
{
    constexpr unsigned kAfterDriver = 0xa0;
    if (number >= unsigned{static_cast<unsigned>(Call::FirstOfDriver)} && number < kAfterDriver)
        return driver->call(number, argument);
    switch (const Call call{number}) {
    case Call::Version: return version(*static_cast<Version *>(argument));
    case Call::Client: static_cast<Client *>(argument)->authenticated = 1; return 0;
    case Call::Capability: {
        auto *capability = static_cast<Capability *>(argument);
        capability->value = capability->which == kSyncCapability || capability->which == kTimelineCapability;
        return 0;
    }
    case Call::CloseObject: return objects_.close(static_cast<Handle *>(argument)->handle);
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
    case Call::SignalSync: return signalAll(*static_cast<SyncArray *>(argument));
    case Call::QueryTimeline:
    case Call::SignalTimeline: return timeline(call, *static_cast<TimelineArray *>(argument));
    case Call::TransferSync: return transfer(*static_cast<SyncTransfer *>(argument));
    default: return EINVAL;
    }
}

// Never destroyed: drivers may close their files after this program's objects are gone.
Kernel &kernel()
{
    static auto *made = new Kernel;
    return *made;
}

// Until then the functions below are the system's, except libdrm's list of GPUs.
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
    const Identity identity = kernel().driver->identity();
    std::snprintf(made->path.data(), made->path.size(), "%s", kernel().path().c_str());
    made->nodes.fill(made->path.data());
    made->bus = {0, 3, 0, 0};
    made->pci = {identity.vendor, identity.device, identity.vendor, 0, identity.revision};
    made->device = {made->nodes.data(), 1 << kPrimaryNode | 1 << kRenderNode, kPciBus, &made->bus, &made->pci};
    return &made->device;
}

} // namespace

void install(const std::string &gpu)
{
    kernel().install(gpu.c_str());
    installed = true;
}

} // namespace vellum::test::kernel

// --- what comes before the system's functions of these names ---

#define VELLUM_EXPORTED extern "C" __attribute__((visibility("default"))) // NOLINT

VELLUM_EXPORTED int ioctl(int file, unsigned long request, ...);
VELLUM_EXPORTED int drmGetDevices2(uint32_t flags, vellum::test::kernel::DrmDevice **devices, int most);
VELLUM_EXPORTED int drmGetDevice2(int file, uint32_t flags, vellum::test::kernel::DrmDevice **device);

int ioctl(int file, unsigned long request, ...)
{
    using namespace vellum::test::kernel;
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

int drmGetDevices2(uint32_t, vellum::test::kernel::DrmDevice **devices, int most)
{
    using namespace vellum::test::kernel;
    if (!installed)
        return 0; // no GPU of this machine has a part in these tests
    if (devices != nullptr && most > 0 && (devices[0] = describe()) == nullptr)
        return -ENOMEM;
    return 1;
}

int drmGetDevice2(int file, uint32_t, vellum::test::kernel::DrmDevice **device)
{
    using namespace vellum::test::kernel;
    if (!installed || !kernel().owns(file))
        return -ENODEV;
    *device = describe();
    return *device == nullptr ? -ENOMEM : 0;
}
