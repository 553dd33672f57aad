// SPDX-License-Identifier: Apache-2.0
// HTML pages that need no other file: that of `vellum inspect`, and others.
#pragma once

#include <string>

#include "inspect/inspected_file.h"
#include "inspect/page_data.h"

namespace vellum::inspect
{

// The page of `vellum inspect`.
std::string makePage(const Document &document, const InspectedFile &file, const PageLimits &limits = {});

// A page without scripts: a heading, and a body that is HTML already. Tables, .chosen rows and .muted paragraphs have a
// style; so have <b class="bar"><i style="width: 40%"></i></b>.
std::string plainPage(const std::string &title, const std::string &body);

} // namespace vellum::inspect
