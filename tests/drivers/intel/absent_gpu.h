// An Intel GPU that is not there, for Mesa's driver ANV: it opens the GPU's file and asks the kernel driver xe about it
// by ioctl. What is linked with this has its own ioctl and drmGetDevices2, which come before those of the system's
// libraries, also for drivers that are loaded later: they answer for one GPU. Memory and synchronization objects are
// real ones of the process, so everything up to the submission of commands runs in the driver as it would with a GPU.
// What is submitted is done at once, and does nothing.
#pragma once

#include <span>

#include "interface.h"

namespace vellum::test::intel
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

// Those that can be used here: one of each generation that traces rays.
std::span<const Gpu> gpus();

// Lets this process have one of them from now on, by its name. Throws if there is none of that name.
void install(const char *name);

} // namespace vellum::test::intel
