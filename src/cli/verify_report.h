// What `vellum verify` prints of a file.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "gltf/micromaps/known_surface.h"
#include "verify/file.h"

namespace vellum::cli
{

// A file that was verified, or why it was not.
struct VerifiedFile {
    std::string path;
    std::string error; // in one line; empty where it was read
    verify::FileReport report;
    std::optional<SurfaceShares> surface;
};

// What a process can tell by its exit code; of several the smallest that is not 0.
enum class Judgement : int {
    AllRight = 0,
    Unreadable = 1, // or not to be verified for another reason
    Structure = 2,
    Wrong = 3,
    OutsideMargins = 4, // only with --strict, as are those below
    Needless = 5,
    NoMicromaps = 6,
};
Judgement judgementOf(const VerifiedFile &file, bool strict);

// For people: a table, offences and findings.
void printVerified(const VerifiedFile &file);

// {"files": [...]}
std::string verifiedJson(const std::vector<VerifiedFile> &files, bool strict);

} // namespace vellum::cli
