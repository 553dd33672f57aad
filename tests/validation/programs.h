// SPDX-License-Identifier: Apache-2.0
// Programs with one small invalid use each, paired with a valid program that differs in that only. Validation must
// report the rule for the invalid one, once, and nothing for the valid one. The programs also run with another
// validation layer, to compare its reports (bench/validation).
#pragma once

#include <span>
#include <string>

#include "gpu/micromap_commands.h"
#include "gpu/scene.h"
#include "harness/harness.h"

namespace vt
{

// Requirements of a program beyond micromaps. Programs run on one device for each combination.
enum ProgramNeeds : unsigned {
    kNeedsNothing = 0,
    kNeedsAddressCommands = 1,   // VK_KHR_device_address_commands
    kNeedsHostCommands = 2,      // micromapHostCommands of VK_EXT_opacity_micromap
    kNeedsPipelines = 4,         // ray tracing pipelines
    kNeedsBothApis = 8,          // both micromap extensions
    kNeedsNoFeature = 16,        // the extension is enabled, its feature is not
    kNeedsFewFeatures = 32,      // the mock driver's quirk "few"
    kNeedsMarkers = 64,          // VK_AMD_buffer_marker, which the spy plays; no spy is below a driver's own micromaps
    kNeedsMaintenance5 = 128,    // VkPipelineCreateFlags2CreateInfo
    kNeedsShaderObjects = 256,   // VK_EXT_shader_object
    kNeedsTransferQueue = 512,   // queue family 3 is for transfers only: the mock driver's quirk "queues"
    kNeedsVendorCommands = 2048, // commands that the spy provides, as with kNeedsMarkers
    kNeedsEmulation = 4096,      // only emulation writes what the program changes
    kNeedsPlainShaders = 1024, // shaders get no execution mode by themselves; flags in VkPipelineCreateFlags2CreateInfo
};

struct WrongProgram {
    const char *rule; // VUID of the rule that it breaks
    Api api;          // the extension that it uses
    unsigned needs;   // ProgramNeeds
    void (*run)(Gpu &gpu, bool wrong);
    const char *variant = ""; // of several programs for one rule
    // Other rules that the program necessarily violates as well, separated by spaces.
    const char *also = "";
    // Some implementations report that the requested feature or memory is not available.
    bool mayBeUnavailable = false;
    // A quirk of the mock driver with which it cannot run.
    const char *notWith = nullptr;
    const char *perhaps = nullptr; // another message, of some implementations
};

// The programs of each file.
std::span<const WrongProgram> creationPrograms();
std::span<const WrongProgram> buildPrograms();
std::span<const WrongProgram> attachmentPrograms();
std::span<const WrongProgram> copyPrograms();
std::span<const WrongProgram> queryPrograms();
std::span<const WrongProgram> hostPrograms();
std::span<const WrongProgram> implicitPrograms();
std::span<const WrongProgram> hostStructurePrograms();
std::span<const WrongProgram> lifetimePrograms();
std::span<const WrongProgram> pendingPrograms();
std::span<const WrongProgram> rangePrograms();
std::span<const WrongProgram> rangeFlagPrograms();
std::span<const WrongProgram> drawRangePrograms();
std::span<const WrongProgram> barrierRangePrograms();
std::span<const WrongProgram> dataPrograms();
std::span<const WrongProgram> serializedPrograms();
std::span<const WrongProgram> pipelinePrograms();
std::span<const WrongProgram> syncPrograms();
std::span<const WrongProgram> tracePrograms();

} // namespace vt
