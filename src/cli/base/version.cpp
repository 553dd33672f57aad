// SPDX-License-Identifier: Apache-2.0
#include "cli/base/version.h"

#include "cli/base/commit.h"
#include "gltf/data/decompress.h"
#include "gltf/data/image.h"

namespace vellum::cli
{

std::string versionText()
{
    const std::string commit = kCommit;
    return commit.empty() ? VELLUM_VERSION : VELLUM_VERSION " (" + commit + ")";
}

std::vector<std::string> unreadableFormats()
{
    std::vector<std::string> formats;
    if (!kDecodesWebp)
        formats.emplace_back("WebP images");
    if (!kDecompressesMeshes)
        formats.emplace_back("geometry compressed by Draco or meshoptimizer");
    return formats;
}

} // namespace vellum::cli
