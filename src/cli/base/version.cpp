// SPDX-License-Identifier: Apache-2.0
#include "cli/base/version.h"

#include "cli/base/commit.h"

namespace vellum::cli
{

std::string versionText()
{
    const std::string commit = kCommit;
    return commit.empty() ? VELLUM_VERSION : VELLUM_VERSION " (" + commit + ")";
}

} // namespace vellum::cli
