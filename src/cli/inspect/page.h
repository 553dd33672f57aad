// SPDX-License-Identifier: Apache-2.0
// The HTML page of `vellum inspect`: one file that needs no other.
#pragma once

#include <string>

#include "cli/inspect/inspected_file.h"
#include "cli/inspect/page_data.h"

namespace vellum::cli
{

std::string makePage(const Document &document, const InspectedFile &file, const PageLimits &limits = {});

} // namespace vellum::cli
