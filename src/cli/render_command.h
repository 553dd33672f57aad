// SPDX-License-Identifier: Apache-2.0
// `vellum render`
#pragma once

#include "cli/render_options.h"

namespace vellum::cli
{

// Renders, writes the pictures and prints what was done on stdout. Returns the exit code.
int renderCommand(const RenderOptions &options);

// The scene of a file, or the grove.
Scene loadScene(const std::optional<std::filesystem::path> &file);

} // namespace vellum::cli
