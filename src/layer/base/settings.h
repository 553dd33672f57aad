// The layer's settings. Sources, the later ones winning: vk_layer_settings.txt, VkLayerSettingsCreateInfoEXT,
// environment variables. Names and values that are none are reported on stderr.
#pragma once

#include <string>

namespace vellum::layer
{

// What tells copies of the layer apart (copy.cpp): the tests have a second one, which stands for a driver with
// micromaps under the first.
extern const char *const kLayerName;      // VK_LAYER_VELLUM_opacity_micromap
extern const char *const kVariablePrefix; // of environment variables: VELLUM_
extern const char *const kMessagePrefix;  // of ids of messages; empty but in the copy

enum class ReportLevel { None, Error, Warning, Info };

struct Settings {
    bool forceEmulation = false;            // VELLUM_FORCE_EMULATION, vellum_opacity_micromap.force_emulation
    ReportLevel report = ReportLevel::None; // VELLUM_REPORT, .report: what also goes to stderr
    bool validate = false; // VELLUM_VALIDATE, .validate: shaders look for wrong input, and the layer tells of it
    // VELLUM_ASSUME_MICROMAPS, .assume_micromaps: ray tracing pipelines without the micromap bit and ray queries
    // without the execution mode use micromaps all the same, where the feature is enabled
    bool assumeMicromaps = false;
    bool strict = false; // VELLUM_STRICT, .strict: what breaks a rule is refused where it does no harm, too
    // VELLUM_CONSTANT_RAY_FLAGS, .constant_ray_flags: if off, flags that are constant in a module or pipeline go the
    // way of those that are not; for tests
    bool constantRayFlags = true;
    // VELLUM_CACHE_FOLDER, .cache_folder: what is the same in every run is kept there (memory/kept_addresses.h);
    // nowhere if empty. Where it is not set, it is "vellum" in the user's folder for caches.
    std::string cacheFolder;
    // VELLUM_REPORT_FILE, .report_file: file to which each message is appended, as "<severity> <id>: <text>" in a line
    std::string reportFile;
    std::string dumpShaders; // VELLUM_DUMP_SHADERS, .dump_shaders: folder for SPIR-V before and after
};

// `instanceChain`: the pNext chain of VkInstanceCreateInfo.
Settings readSettings(const void *instanceChain);

} // namespace vellum::layer
