// SPDX-License-Identifier: Apache-2.0
// Differences between operating systems for the Vulkan loader and its users.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace vellum::cli
{

enum class ManifestKind { Driver, ExplicitLayer };

// The location of manifests: a folder of them, or one manifest.
struct ManifestPlace {
    std::filesystem::path path;
    std::string from; // why it is looked at: "/usr/share/vulkan/icd.d", a key of Windows' registry
};

// The locations that the loader searches if no environment variable names others.
std::vector<ManifestPlace> systemPlaces(ManifestKind kind);

// Why a file cannot be loaded as a library by this program; empty where it seems right.
std::string problemOfFormat(const std::filesystem::path &library);
// Loads it as the loader does, since what it depends on may be missing. Empty if that works.
std::string problemOfLoading(const std::filesystem::path &library);
// Why the loader does not find a manifest in its folder.
std::string problemOfListing(const std::filesystem::path &manifest);
// Returns whether a library_path is relative to its manifest. The system searches for a bare name.
bool isRelativeToManifest(const std::string &library);

// The shell's command that sets a variable, before or in place of what it has.
std::string commandToSet(const std::string &variable, const std::string &value, bool keepOld);

} // namespace vellum::cli
