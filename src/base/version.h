// SPDX-License-Identifier: Apache-2.0
// The version of vellum.
#pragma once

#include <string>

namespace vellum
{

// "0.1.0 (0123456789ab)", with the commit if it is known.
std::string versionText();

} // namespace vellum
