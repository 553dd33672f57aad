// SPDX-License-Identifier: Apache-2.0
// The HTML page of `vellum inspect`: one file that needs no other.
#pragma once

#include <string>

#include "inspect/inspected_file.h"
#include "inspect/page_data.h"

namespace vellum::inspect
{

std::string makePage(const Document &document, const InspectedFile &file, const PageLimits &limits = {});

// The image with its longer edge at most `edge`; each texel is the mean of a square of texels.
Image scaledDown(const Image &image, uint32_t edge);

} // namespace vellum::inspect
