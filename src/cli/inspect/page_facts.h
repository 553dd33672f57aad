// SPDX-License-Identifier: Apache-2.0
// The part of the page's data that is JSON.
#pragma once

#include <string>

#include "cli/inspect/inspected_file.h"
#include "cli/inspect/page_data.h"

namespace vellum::cli
{

std::string pageFacts(const Document &document, const InspectedFile &file, const PageData &data,
                      const PageLimits &limits);

// With its longer edge at most `edge`, each texel the mean of a square of them.
Image scaledDown(const Image &image, uint32_t edge);

} // namespace vellum::cli
