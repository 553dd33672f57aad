// SPDX-License-Identifier: Apache-2.0
#include "cli/vulkan/layer_path.h"

#include <cstdlib>
#include <fstream>
#include <string>

namespace vellum::cli
{
namespace
{

bool hasManifest(const std::filesystem::path &folder)
{
    std::error_code error;
    for (const auto &entry : std::filesystem::directory_iterator(folder, error)) {
        if (entry.path().extension() != ".json")
            continue;
        std::ifstream file(entry.path());
        const std::string text(std::istreambuf_iterator<char>(file), {});
        if (text.find(kLayerName) != std::string::npos)
            return true;
    }
    return false;
}

} // namespace

std::optional<std::filesystem::path> findLayerFolder()
{
    std::error_code error;
    const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", error);
    if (error)
        return std::nullopt;
    const std::filesystem::path prefix = program.parent_path().parent_path();
    for (const char *folder : {"lib", "share/vulkan/explicit_layer.d"})
        if (hasManifest(prefix / folder))
            return prefix / folder;
    return std::nullopt;
}

void addLayerFolder(const std::filesystem::path &folder)
{
    // The loader ignores VK_ADD_LAYER_PATH where the user has set VK_LAYER_PATH.
    const char *variable = std::getenv("VK_LAYER_PATH") != nullptr ? "VK_LAYER_PATH" : "VK_ADD_LAYER_PATH";
    const char *old = std::getenv(variable);
    const std::string value = (old != nullptr && *old != '\0' ? std::string(old) + ":" : "") + folder.string();
    setenv(variable, value.c_str(), 1);
}

void offerLayer(const std::optional<std::filesystem::path> &folder)
{
    if (const auto found = folder ? folder : findLayerFolder())
        addLayerFolder(*found);
}

} // namespace vellum::cli
