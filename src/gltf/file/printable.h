// SPDX-License-Identifier: Apache-2.0
// Text from a file that is shown to people.
#pragma once

#include <string>

namespace vellum
{

// With "?" for each control character (of ASCII, and U+0080 to U+009F in UTF-8): a name must not break a table into
// lines, or tell a terminal what to do.
std::string printable(std::string text);

} // namespace vellum
