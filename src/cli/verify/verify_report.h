// SPDX-License-Identifier: Apache-2.0
// The output of `vellum verify` for a file.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cli/base/exit_code.h"
#include "gltf/micromaps/known_surface.h"
#include "inspect/report_parts.h"
#include "verify/file.h"

namespace vellum::cli
{

// A file that was verified, or the reason why it was not.
struct VerifiedFile {
    std::string path;
    std::string error; // in one line; empty if it was read
    verify::FileReport report;
    std::optional<SurfaceShares> surface;
    std::string extension; // empty if it has no micromaps, or invalid ones
    std::vector<MicromapSummary> micromaps;
    ExitCode code = ExitCode::Success;
};

ExitCode exitCodeOf(const VerifiedFile &file, bool strict, bool requireMicromaps);

// Readable text: a table and findings. Without `verbose`, not all primitives of a file with very many.
void printVerified(const VerifiedFile &file, bool verbose);

std::string verifiedJson(const std::vector<VerifiedFile> &files);

} // namespace vellum::cli
