// SPDX-License-Identifier: Apache-2.0
#include "cli/info/manifests.h"

#include <algorithm>
#include <fstream>
#include <rapidjson/document.h>

#include "base/process.h"
#include "base/text.h"
#include "cli/info/loader_system.h"
#include "core/utf8_path.h"
#include "gpu/layer_path.h"

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
    if (variable("VK_DRIVER_FILES"))
        addNamed("VK_DRIVER_FILES");
    else if (variable("VK_ICD_FILENAMES"))
        addNamed("VK_ICD_FILENAMES");
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

} // namespace vellum::cli
