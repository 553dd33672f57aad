// SPDX-License-Identifier: Apache-2.0
#include "gpu/layer_path.h"

#include <fstream>
#include <string>

#include "base/process.h"
#include "base/text.h"
#include "core/utf8_path.h"

namespace vellum::gpu
{
namespace
{

bool hasManifest(const std::filesystem::path &folder)
{
    std::error_code error;
    for (const auto &entry : std::filesystem::directory_iterator(folder, error)) {
        std::error_code unreadable;
        if (entry.path().extension() != ".json" || !entry.is_regular_file(unreadable))
            continue;
        std::ifstream file(entry.path());
        const std::string text(std::istreambuf_iterator<char>(file), {});
        if (text.find(kLayerName) != std::string::npos)
            return true;
    }
    return false;
}

void removeLayerFrom(const char *name, char separator)
{
    std::string rest;
    const std::string list = variable(name).value_or("");
    for (const std::string &layer : partsOf(list, separator))
        if (layer != kLayerName)
            rest += (rest.empty() ? "" : std::string(1, separator)) + layer;
    if (!list.empty())
        setVariable(name, rest);
}

} // namespace

std::optional<std::filesystem::path> findLayerFolder()
{
    const std::filesystem::path program = programPath();
    if (program.empty())
        return std::nullopt;
    const std::filesystem::path own = program.parent_path();
    const std::filesystem::path prefix = own.parent_path();
    for (const std::filesystem::path &folder : {own, prefix / "lib", prefix / "share/vulkan/explicit_layer.d"})
        if (hasManifest(folder))
            return folder;
    return std::nullopt;
}

void addLayerFolder(const std::filesystem::path &folder)
{
    // The loader ignores VK_ADD_LAYER_PATH where the user has set VK_LAYER_PATH.
    const char *name = variable("VK_LAYER_PATH") ? "VK_LAYER_PATH" : "VK_ADD_LAYER_PATH";
    const std::string old = variable(name).value_or("");
    // Behind the others: loader 1.3.239 takes the order of layers from that of their folders.
    setVariable(name, old.empty() ? utf8Text(folder) : old + kListSeparator + utf8Text(folder));
}

void offerLayer(const std::optional<std::filesystem::path> &folder)
{
    if (const auto found = folder ? folder : findLayerFolder())
        addLayerFolder(*found);
}

void withdrawLayer()
{
    removeLayerFrom("VK_INSTANCE_LAYERS", kListSeparator);
    removeLayerFrom("VK_LOADER_LAYERS_ENABLE", ',');
    const std::string disabled = variable("VK_LOADER_LAYERS_DISABLE").value_or("");
    setVariable("VK_LOADER_LAYERS_DISABLE", disabled + (disabled.empty() ? "" : ",") + kLayerName);
}

} // namespace vellum::gpu
