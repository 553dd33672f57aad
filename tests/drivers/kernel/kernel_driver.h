// SPDX-License-Identifier: Apache-2.0
// The common base of kernel drivers: they report a GPU, and handle calls of the programs that use it.
#pragma once

#include "drm_interface.h"
#include "objects.h"
#include "sync_objects.h"

namespace vellum::test::kernel
{

// The values by which libdrm and the driver find a GPU.
struct Identity {
    const char *driver; // its name
    int major, minor;   // of the interface
    u16 vendor, device; // of PCI
    u8 revision;
};

class KernelDriver
{
public:
    KernelDriver(Objects &objects, SyncObjects &syncs) : objects_(objects), syncs_(syncs) {}
    KernelDriver(const KernelDriver &) = delete;
    KernelDriver &operator=(const KernelDriver &) = delete;
    virtual ~KernelDriver() = default;

    [[nodiscard]] virtual Identity identity() const = 0;
    // An ioctl from Call::FirstOfDriver on. 0 or an error of errno.h.
    virtual int call(unsigned number, void *argument) = 0;

protected:
    [[nodiscard]] Objects &objects() const { return objects_; }
    [[nodiscard]] SyncObjects &syncs() const { return syncs_; }

private:
    Objects &objects_;
    SyncObjects &syncs_;
};

template <class T>
std::span<const T> array(u64 address, u64 count)
{
    return {reinterpret_cast<const T *>(address), static_cast<size_t>(count)};
}

} // namespace vellum::test::kernel
