// SPDX-License-Identifier: Apache-2.0
// The HTML page of `vellum inspect`: one file that needs no other.
#pragma once

#include <string>

#include "inspect/inspected_file.h"
#include "inspect/page_data.h"

namespace vellum::inspect
{

std::string makePage(const Document &document, const InspectedFile &file, const PageLimits &limits = {});

} // namespace vellum::inspect
