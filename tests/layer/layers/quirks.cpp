// SPDX-License-Identifier: Apache-2.0
// All quirks, and the levels that they belong to.
#include "layers/driver.h"

namespace driver
{

const char *const kQuirkVariable = "VELLUM_TEST_MOCK_DRIVER";

std::span<const Quirk> allQuirks()
{
    static constexpr Quirk quirks[]{
        {"spy", Level::Spy, "a driver without micromaps, which reports every flag, structure and name of theirs"},
        {"displacement", Level::Spy, "a driver with micromaps and VK_NV_displacement_micromap, which it only says"},
        {"implicit", Level::Spy,
         "the loader lists the extensions of Vellum's layer among the driver's, as for the manifest of an implicit "
         "layer"},
        {"hostmemory", Level::Spy, "a memory type more, of which there is memory left when there is no other"},
        {"ext", Level::Ext,
         "VK_EXT_opacity_micromap, of a second copy of Vellum's layer below, and neither VK_KHR_opacity_micromap nor "
         "VK_KHR_device_address_commands"},
        {"khr", Level::Ext,
         "VK_KHR_opacity_micromap and VK_KHR_device_address_commands, of that copy, and not VK_EXT_opacity_micromap"},
        {"emulating", Level::Ext,
         "a driver that rewrites shaders and structures itself: that copy emulates micromaps on every device, though "
         "it says nothing of them"},
        {"vendors", Level::Vendors,
         "extensions for ray tracing that do not work together with the layer's micromaps, and one that it does not "
         "know, "
         "which the driver only says"},
        {"heaps", Level::Heaps,
         "VK_EXT_descriptor_heap, for shaders that use no descriptors; state that a command invalidates is lost (Using "
         "Heaps)"},
        {"failures", Level::Failures,
         "commands that a test selects run out of memory, or the device is lost (Lost Device)"},
        {"uncompiled", Level::Failures,
         "pipelines that are made only if nothing has to be compiled are not made (VK_PIPELINE_COMPILE_REQUIRED)"},
        {"caching", Level::Caches,
         "VK_EXT_shader_module_identifier and VK_KHR_pipeline_binary: what was compiled once is known by its code, on "
         "later devices, too"},
        {"deferred", Level::Deferral,
         "pipelines whose creation may be deferred are made by the threads that join, a piece each (Deferred Host "
         "Operations)"},
        {"alignments", Level::Limits,
         "the largest alignments (Required Limits): scratch memory 256, group handles 32, group tables 64, strides of "
         "at most 4096, non-coherent atoms 256"},
        {"push128", Level::Limits, "maxPushConstantsSize is 128, the least that there may be (Required Limits)"},
        {"compute", Level::Limits,
         "the least compute shaders (Required Limits): workgroups of 128 invocations, 65,535 of them in each "
         "direction, "
         "with 16 KiB of shared memory"},
        {"few", Level::Limits,
         "neither nullDescriptor nor indexTypeUint8 nor drawIndirectCount (Feature Requirements)"},
        {"noqueries", Level::Limits,
         "no VK_KHR_ray_query, as GPUs for computing have it: rays are traced by ray tracing pipelines alone"},
        {"queues", Level::Queues,
         "queue families for graphics, graphics and compute, compute, and transfers, in this order (Physical Devices)"},
        {"structures", Level::Structures,
         "structures need half as much again when they are built than they hold; sizes are odd, and compaction "
         "shrinks; "
         "a driver writes no more of a handle than the structure needs"},
        {"discrete", Level::Memory,
         "memory of the device is not host-visible, the host's not local to the device, and one type of it not "
         "coherent (Device Memory)"},
        {"window", Level::Memory,
         "of the device's memory 256 MiB are host-visible, in a heap of their own; allocations fail when it is full"},
        {"uncached", Level::Memory,
         "memory types with DEVICE_COHERENT_BIT_AMD, which only devices with that feature may use, are all that is "
         "local to the device and host-visible"},
#ifndef _WIN32 // where memory cannot be mapped this way
        {"elsewhere", Level::Addresses,
         "a structure's address is not that of its buffer, unless it is GENERIC "
         "(vkGetAccelerationStructureDeviceAddressKHR), and is given again; mapped memory is not at its device "
         "address"},
        {"replay", Level::Replay,
         "bufferDeviceAddressCaptureReplay: memory is at the requested address, or at a random one; host "
         "memory cannot be imported"},
#endif
        {"dirty", Level::Garbage, "memory that is allocated holds what was there before, and not zeros"},
        {"scratch", Level::Garbage,
         "builds need more scratch memory, updates still more than those, and write to all of it"},
        {"capable", Level::IndirectBuilds,
         "features that lavapipe lacks: accelerationStructureIndirectBuild, accelerationStructureHostCommands, "
         "bufferDeviceAddressCaptureReplay and accelerationStructureCaptureReplay"},
    };
    return quirks;
}

std::span<const NamedLevel> allLevels()
{
    static const NamedLevel all[]{
        {Level::Deferral, deferralRows()},
        {Level::Spy, spyRows()},
        {Level::Ext, extRows()},
        {Level::Vendors, vendorRows()},
        {Level::Heaps, heapRows()},
        {Level::Failures, failureRows()},
        {Level::Caches, cacheRows()},
        {Level::Limits, limitRows()},
        {Level::Queues, queueRows()},
        {Level::Structures, structureRows()},
        {Level::Memory, memoryRows()},
#ifndef _WIN32
        {Level::Addresses, addressRows()},
        {Level::Replay, replayRows()},
#endif
        {Level::IndirectBuilds, indirectBuildRows()},
        {Level::Garbage, garbageRows()},
        {Level::Unsupported, unsupportedRows(), /* always */ true},
    };
    return all;
}

} // namespace driver
