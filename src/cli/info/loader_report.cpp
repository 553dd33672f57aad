// SPDX-License-Identifier: Apache-2.0
#include "cli/info/loader_report.h"

#include <algorithm>
#include <fmt/format.h>
#include <fstream>
#include <rapidjson/document.h>

#include "base/process.h"
#include "base/text.h"
#include "base/version.h"
#include "cli/info/loader_system.h"
#include "core/utf8_path.h"
#include "gpu/instance.h"
#include "inspect/report_parts.h"

namespace vellum::cli
{
namespace
{

namespace fs = std::filesystem;

constexpr size_t kMostBytes = 1 << 20;

// A folder's, or the one that the path is: newer loaders take both.
std::vector<fs::path> manifestsIn(const fs::path &folder)
{
    std::vector<fs::path> found;
    if (folder.extension() == ".json")
        return {folder};
    std::error_code error;
    for (const auto &entry : fs::directory_iterator(folder, error))
        if (entry.path().extension() == ".json")
            found.push_back(entry.path());
    std::sort(found.begin(), found.end());
    return found;
}

std::string problemOfLibrary(const fs::path &library)
{
    std::error_code error;
    if (!fs::exists(library, error))
        return "its library " + utf8Text(library) + " does not exist";
    return problemOfFormat(library);
}

// Finds the library of a manifest whose object `kind` has a library_path.
void readManifest(Manifest &manifest, const char *kind)
{
    std::ifstream file(manifest.path, std::ios::binary);
    std::string text(kMostBytes, '\0');
    file.read(text.data(), static_cast<std::streamsize>(text.size()));
    text.resize(static_cast<size_t>(file.gcount()));
    if (text.empty()) {
        manifest.problem = "it cannot be read";
        return;
    }
    rapidjson::Document json;
    json.Parse<rapidjson::kParseIterativeFlag>(text.data(), text.size());
    const bool has = !json.HasParseError() && json.IsObject() && json.HasMember(kind) && json[kind].IsObject() &&
                     json[kind].HasMember("library_path") && json[kind]["library_path"].IsString();
    if (!has) {
        manifest.problem = std::string("it is not a manifest: there is no library_path of its \"") + kind + "\"";
        return;
    }
    const std::string library = json[kind]["library_path"].GetString();
    manifest.library = utf8Path(library);
    if (isRelativeToManifest(library)) {
        manifest.library = (manifest.path.parent_path() / manifest.library).lexically_normal();
        manifest.problem = problemOfLibrary(manifest.library);
    }
    if (manifest.problem.empty())
        manifest.problem = problemOfLoading(manifest.library);
}

// The paths in a variable that is a list.
std::vector<fs::path> listedPaths(const char *name)
{
    std::vector<fs::path> paths;
    for (const std::string &part : partsOf(variable(name).value_or(""), kListSeparator))
        paths.push_back(utf8Path(part));
    return paths;
}

// The variable in place of the places where the loader looks for drivers; null: it looks there.
const char *variableOfDrivers()
{
    for (const char *name : {"VK_DRIVER_FILES", "VK_ICD_FILENAMES"})
        if (variable(name))
            return name;
    return nullptr;
}

bool namesLayer(const fs::path &path)
{
    std::ifstream file(path, std::ios::binary);
    std::string text(kMostBytes, '\0');
    file.read(text.data(), static_cast<std::streamsize>(text.size()));
    return text.find(gpu::kLayerName) != std::string::npos;
}

} // namespace

std::vector<Manifest> findDriverManifests()
{
    std::vector<Manifest> manifests;
    const auto addNamed = [&](const char *name) {
        for (const fs::path &part : listedPaths(name)) {
            std::error_code error;
            if (fs::is_directory(part, error))
                for (const fs::path &path : manifestsIn(part))
                    manifests.push_back({path, {}, name, ""});
            else
                manifests.push_back({part, {}, name, fs::exists(part, error) ? "" : "it does not exist"});
        }
    };
    if (const char *const name = variableOfDrivers())
        addNamed(name);
    else
        for (const ManifestPlace &place : systemPlaces(ManifestKind::Driver))
            for (const fs::path &path : manifestsIn(place.path))
                manifests.push_back({path, {}, place.from, ""});
    addNamed("VK_ADD_DRIVER_FILES");
    for (Manifest &manifest : manifests)
        if (manifest.problem.empty())
            readManifest(manifest, "ICD");
    return manifests;
}

std::vector<Manifest> findLayerManifests(const fs::path &folder)
{
    std::vector<ManifestPlace> places;
    const auto addNamed = [&](const char *name) {
        for (const fs::path &part : listedPaths(name))
            places.push_back({part, name});
    };
    if (variable("VK_LAYER_PATH")) {
        addNamed("VK_LAYER_PATH"); // and nothing else
    } else {
        addNamed("VK_ADD_LAYER_PATH");
        for (const ManifestPlace &place : systemPlaces(ManifestKind::ExplicitLayer))
            places.push_back(place);
    }
    if (!folder.empty())
        places.push_back({folder, "the folder beside this program"});
    std::vector<Manifest> manifests;
    for (const ManifestPlace &place : places) {
        for (const fs::path &path : manifestsIn(place.path)) {
            const bool known = std::any_of(manifests.begin(), manifests.end(), [&](const Manifest &m) {
                std::error_code error;
                return fs::equivalent(m.path, path, error);
            });
            if (known || !namesLayer(path))
                continue;
            manifests.push_back({path, {}, place.from, ""});
            readManifest(manifests.back(), "layer");
            std::error_code error;
            if (manifests.back().problem.empty() && fs::is_directory(place.path, error))
                manifests.back().problem = problemOfListing(path);
        }
    }
    return manifests;
}

namespace
{

bool isSet(const char *name)
{
    return !variable(name).value_or("").empty();
}

bool names(const char *name, const char *what)
{
    return variable(name).value_or("").find(what) != std::string::npos;
}

std::vector<std::string> commandsToTurnOn(const LoaderReport &report, const std::filesystem::path &folder)
{
    std::vector<std::string> commands;
    if (!report.layerFound && !folder.empty()) {
        // The loader ignores VK_ADD_LAYER_PATH where VK_LAYER_PATH is set.
        const char *name = variable("VK_LAYER_PATH") ? "VK_LAYER_PATH" : "VK_ADD_LAYER_PATH";
        commands.push_back(commandToSet(name, utf8Text(folder), isSet(name)));
    }
    if (!report.layerOnByVariable)
        commands.push_back(commandToSet("VK_INSTANCE_LAYERS", gpu::kLayerName, isSet("VK_INSTANCE_LAYERS")));
    return commands;
}

void explainLayer(LoaderReport &report, const std::filesystem::path &folder)
{
    if (!report.layerFound && environmentIsIgnored())
        report.problems.push_back(
            "the loader ignores variables, and layers that are registered for the user, in programs "
            "that run as administrator, such as this one");
    for (const Manifest &manifest : report.layers)
        if (!manifest.problem.empty())
            report.problems.push_back("the layer's manifest " + utf8Text(manifest.path) + ": " + manifest.problem);
    if (report.layers.empty())
        report.problems.push_back(
            std::string("there is no manifest of the layer, neither where the loader looks nor ") +
            (folder.empty() ? "beside this program" : "in " + utf8Text(folder)));
}

void explainDrivers(LoaderReport &report)
{
    for (const Manifest &manifest : report.drivers)
        if (!manifest.problem.empty())
            report.problems.push_back("the driver's manifest " + utf8Text(manifest.path) + ": " + manifest.problem);
    if (!report.drivers.empty())
        return;
    const char *const name = variableOfDrivers();
    report.problems.push_back(
        name ? std::string(name) + " is set, so that the loader looks nowhere else, and names no driver"
             : "no Vulkan driver is installed: there is no manifest of one where the loader looks");
}

void explainNoDevice(LoaderReport &report)
{
    const bool any =
        std::any_of(report.drivers.begin(), report.drivers.end(), [](const Manifest &m) { return m.problem.empty(); });
    if (any)
        report.problems.push_back(
            "no driver has a device; VK_LOADER_DEBUG=error,warn,driver says what becomes of them");
}

void explainNoMicromaps(LoaderReport &report)
{
    if (std::any_of(report.devices.begin(), report.devices.end(),
                    [](const DeviceDetails &d) { return d.hasMicromaps(); }))
        return;
    for (const DeviceDetails &device : report.devices)
        for (const std::string &missing : device.missing)
            report.problems.push_back(device.name + " has no " + missing + ", without which there are no micromaps");
    if (report.problems.empty())
        report.problems.push_back("no device has micromaps");
}

// Devices without the layer and, where it loads, with it.
void findDevices(LoaderReport &report)
{
    std::vector<DeviceDetails> plain;
    try {
        const gpu::Instance instance(false);
        plain = describeDevices(instance);
    } catch (const std::runtime_error &error) {
        const auto *const failure = dynamic_cast<const gpu::VulkanError *>(&error);
        const bool noDriver = failure != nullptr && failure->result() == VK_ERROR_INCOMPATIBLE_DRIVER;
        if (report.problems.empty() && !noDriver) // else the problems, or explainNoDevice(), say why
            report.problems.push_back(error.what());
        return;
    }
    report.devices = plain;
    if (report.layers.empty())
        return;
    try {
        const gpu::Instance instance(true);
        report.layerLoads = instance.hasLayers();
        if (!report.layerLoads)
            return;
        report.devices = describeDevices(instance);
    } catch (const std::runtime_error &error) {
        if (report.problems.empty())
            report.problems.push_back(error.what());
        return;
    }
    // The layer passes through what a driver has itself, unless VELLUM_IMPLEMENTATION is set.
    for (size_t i = 0; i < report.devices.size() && i < plain.size() && !isSet("VELLUM_IMPLEMENTATION"); ++i) {
        if (plain[i].ext == Provider::Driver)
            report.devices[i].ext = Provider::Driver;
        if (plain[i].khr == Provider::Driver)
            report.devices[i].khr = Provider::Driver;
    }
}

const char *nameOf(Provider provider)
{
    switch (provider) {
    case Provider::Driver: return "native";
    case Provider::Layer: return "emulated by the layer";
    case Provider::Translated: return "translated by the layer to VK_EXT_opacity_micromap";
    case Provider::Nobody: break;
    }
    return "none";
}

void printManifest(const char *what, const Manifest &manifest)
{
    fmt::print("{:<11} {} (from {})\n", what, utf8Text(manifest.path), manifest.from);
    if (!manifest.library.empty())
        fmt::print("            library {}\n", utf8Text(manifest.library));
    if (!manifest.problem.empty())
        fmt::print("            {}\n", manifest.problem);
}

void write(const std::vector<Manifest> &manifests, JsonWriter &json)
{
    json.beginArray();
    for (const Manifest &m : manifests)
        json.beginObject()
            .member("path", utf8Text(m.path))
            .member("from", m.from)
            .member("library", utf8Text(m.library))
            .member("problem", m.problem)
            .end();
    json.end();
}

void print(const DeviceDetails &d)
{
    const auto yes = [](bool has) { return has ? "yes" : "no"; };
    fmt::print("\n{:<11} {} ({}), Vulkan {}\n", fmt::format("device {}", d.number), d.name, d.kind, d.version);
    fmt::print("driver      {}\n", d.driver);
    fmt::print("ray tracing acceleration structures: {}, ray queries: {}, pipelines: {}\n",
               yes(d.accelerationStructures), yes(d.rayQueries), yes(d.rayTracingPipelines));
    fmt::print("micromaps   VK_KHR_opacity_micromap: {}\n            VK_EXT_opacity_micromap: {}\n", nameOf(d.khr),
               nameOf(d.ext));
    if (d.hasMicromaps())
        fmt::print("limits      subdivision level {} with 2 states, {} with 4\n", d.most2StateLevel, d.most4StateLevel);
    for (const std::string &missing : d.missing)
        fmt::print("missing     {}: the layer cannot bring micromaps without\n", missing);
}

} // namespace

LoaderReport reportLoader(const std::optional<std::filesystem::path> &wish)
{
    LoaderReport report;
    uint32_t version = VK_API_VERSION_1_0;
    vkEnumerateInstanceVersion(&version);
    report.loaderVersion = fmt::format("{}.{}.{}", VK_API_VERSION_MAJOR(version), VK_API_VERSION_MINOR(version),
                                       VK_API_VERSION_PATCH(version));
    std::error_code error; // a name that is printed for other programs is not relative
    const std::filesystem::path folder =
        wish ? std::filesystem::absolute(*wish, error) : gpu::findLayerFolder().value_or(std::filesystem::path());
    report.drivers = findDriverManifests();
    report.layers = findLayerManifests(folder);
    report.layerFound = gpu::layerIsAvailable();
    report.layerOnByVariable =
        names("VK_INSTANCE_LAYERS", gpu::kLayerName) || names("VK_LOADER_LAYERS_ENABLE", gpu::kLayerName);
    report.turnOn = commandsToTurnOn(report, folder);
    explainDrivers(report);
    explainLayer(report, folder);
    if (!folder.empty())
        gpu::addLayerFolder(folder);
    findDevices(report);
    if (report.devices.empty())
        explainNoDevice(report);
    else
        explainNoMicromaps(report);
    return report;
}

void print(const LoaderReport &report)
{
    fmt::print("vellum      {}\n", versionText());
    for (const std::string &format : unreadableFormats())
        fmt::print("            cannot read {}\n", format);
    fmt::print("loader      Vulkan {}\n", report.loaderVersion);
    for (const Manifest &driver : report.drivers)
        printManifest("driver", driver);
    for (const Manifest &layer : report.layers)
        printManifest("layer", layer);
    fmt::print(
        "layer       {}, {}\n", report.layerFound ? "the loader finds it" : "the loader does not find it by itself",
        report.layerOnByVariable ? "and it is turned on by an environment variable" : "a program has to turn it on");
    for (size_t i = 0; i < report.turnOn.size(); ++i)
        fmt::print("{:<11} {}\n", i == 0 ? "turn it on" : "", report.turnOn[i]);
    for (const DeviceDetails &device : report.devices)
        print(device);
}

void write(const LoaderReport &report, JsonWriter &json)
{
    json.beginObject().member("vellum", versionText()).member("loader", report.loaderVersion);
    json.key("drivers");
    write(report.drivers, json);
    json.key("layers");
    write(report.layers, json);
    json.member("layerFound", report.layerFound)
        .member("layerOnByVariable", report.layerOnByVariable)
        .member("layerLoads", report.layerLoads);
    json.values("turnOn", report.turnOn);
    json.list("devices", report.devices, [&](const DeviceDetails &device) {
        json.beginObject();
        writeMembers(device, json);
        json.end();
    });
    json.values("problems", report.problems).end();
}

} // namespace vellum::cli
