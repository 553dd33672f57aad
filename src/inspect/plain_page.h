// SPDX-License-Identifier: Apache-2.0
// A web page without scripts: a heading, and whatever else is HTML already.
#pragma once

#include <string>

namespace vellum::inspect
{

// Tables, .chosen rows and .muted paragraphs have a style; so have <b class="bar"><i style="width: 40%"></i></b>.
std::string plainPage(const std::string &title, const std::string &body);

} // namespace vellum::inspect
