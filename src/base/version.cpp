// SPDX-License-Identifier: Apache-2.0
#include "base/version.h"

#include "base/commit.h"

namespace vellum
{

std::string versionText()
{
    const std::string commit = kCommit;
    return commit.empty() ? VELLUM_VERSION : VELLUM_VERSION " (" + commit + ")";
}

} // namespace vellum
