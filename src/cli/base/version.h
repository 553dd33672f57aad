// SPDX-License-Identifier: Apache-2.0
// Which vellum this is.
#pragma once

#include <string>
#include <vector>

namespace vellum::cli
{

// "0.1.0 (0123456789ab)", with the commit if it is known.
std::string versionText();
// What this build was made without, such as "WebP images"; empty if it reads everything.
std::vector<std::string> unreadableFormats();

} // namespace vellum::cli
