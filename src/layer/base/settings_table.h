// SPDX-License-Identifier: Apache-2.0
// Every setting of the layer, stated once. settings.py reads this table for the manifest.
#pragma once

// Levels of the setting `report`: X(name, value of ReportLevel, label, description)
#define VELLUM_REPORT_LEVELS(X)                                                                                        \
    X(none, None, "None", "Print nothing.")                                                                            \
    X(error, Error, "Error", "Print errors.")                                                                          \
    X(warning, Warning, "Warning", "Print errors and warnings.")                                                       \
    X(info, Info, "Info", "Print all messages.")

// Values of the setting `implementation`: X(name, value of Preferred, label, description)
#define VELLUM_IMPLEMENTATIONS(X)                                                                                      \
    X(auto, Automatic, "Automatic",                                                                                    \
      "The driver's where it has them. VK_KHR_opacity_micromap by a driver's VK_EXT_opacity_micromap. Otherwise "      \
      "emulated.")                                                                                                     \
    X(driver, Driver, "Driver", "Only what the driver has.")                                                           \
    X(ext, Ext, "EXT",                                                                                                 \
      "As auto, and VK_KHR_opacity_micromap by the driver's VK_EXT_opacity_micromap even if the driver has both.")     \
    X(emulated, Emulated, "Emulated", "Emulated, even if the driver has them.")

// Names of the setting `validate`, which takes several with commas: X(name, member of Checks, label, description)
#define VELLUM_CHECKS(X)                                                                                               \
    X(core, core, "Core", "What the parameters of commands and the state of objects show.")                            \
    X(gpu, gpu, "GPU", "Data on the GPU: input of builds, instances, and what rays meet.")                             \
    X(sync, sync, "Synchronization", "Barriers between builds, copies and traces, and objects changed while in use.")

// X(key, member of Settings, type, default, label, description)
// A setting has its key as its name in VkLayerSettingEXT. In files, vellum_opacity_micromap. precedes the key; in the
// environment the key is in capitals, and VELLUM_ precedes it.
#define VELLUM_SETTINGS(X)                                                                                             \
    X(implementation, implementation, Preferred, Preferred::Automatic, "Implementation",                               \
      "Who implements micromaps: the driver where it has them (auto), only the driver (driver), the driver's "         \
      "VK_EXT_opacity_micromap also for VK_KHR_opacity_micromap (ext), or the layer (emulated).")                      \
    X(report, report, ReportLevel, ReportLevel::None, "Messages on stderr",                                            \
      "Print messages of this severity and above to stderr. VK_EXT_debug_utils messengers always get them. If it is "  \
      "not set, errors and warnings are printed while validate is on and there is no messenger.")                      \
    X(validate, validate, Checks, {}, "Validate",                                                                      \
      "Check the rules of the micromap and address extensions, whoever implements them: core, gpu, sync, several of "  \
      "them with commas, or all.")                                                                                     \
    X(message_limit, messageLimit, uint32_t, 10, "Limit of equal messages",                                            \
      "Report each message id at most this many times for each instance. 0: no limit.")                                \
    X(break_on_error, breakOnError, bool, false, "Break on errors", "Raise SIGTRAP after each error, for debuggers.")  \
    X(strict, strict, bool, false, "Strict",                                                                           \
      "Reject input that breaks a rule even if it does no harm, instead of only warning. For tests of applications.")  \
    X(assume_micromaps, assumeMicromaps, bool, false, "Assume micromaps",                                              \
      "Use micromaps in ray tracing pipelines without the micromap bit and in ray queries without the execution "      \
      "mode, if the feature is enabled. Also where micromaps are the driver's own.")                                   \
    X(max_opacity_2_state_subdivision_level, most2StateLevel, uint32_t, 0, "Limit of levels, 2 states",                \
      "Simulate a device with this maxOpacity2StateSubdivisionLevel, at least 3, where its own is higher. 0: its "     \
      "own.")                                                                                                          \
    X(max_opacity_4_state_subdivision_level, most4StateLevel, uint32_t, 0, "Limit of levels, 4 states",                \
      "The same of maxOpacity4StateSubdivisionLevel.")                                                                 \
    X(max_opacity_lossy_4_state_subdivision_level, mostLossyLevel, uint32_t, 0, "Limit of levels, lossy",              \
      "The same of maxOpacityLossy4StateSubdivisionLevel.")                                                            \
    X(constant_ray_flags, constantRayFlags, bool, true, "Constant ray flags",                                          \
      "Use the values of ray flags that are constant in a module or pipeline. Turned off only for tests.")             \
    X(cache_folder, cacheFolder, std::string, {}, "Cache folder",                                                      \
      "Folder for the addresses of the layer's tables, so that shader caches of one run hit in the next. Default: "    \
      "vellum in the user's cache folder. Empty: addresses are not kept.")                                             \
    X(dump_shaders, dumpShaders, std::string, {}, "Dump shaders",                                                      \
      "Existing folder to which each shader that the layer rewrites is written, before and after.")                    \
    X(report_file, reportFile, std::string, {}, "Report file",                                                         \
      "File to which each message is appended: severity, id, text and process in a line. vellum run uses it.")
