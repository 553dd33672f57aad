// SPDX-License-Identifier: Apache-2.0
// "-": files from stdin, and data to stdout.
#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "gltf/document.h"

namespace vellum::cli
{

// As an operand: stdin, or as an output stdout.
inline bool isStandardStream(const std::filesystem::path &path)
{
    return path == "-";
}

// All of stdin, at most 2 GiB. Throws GltfError.
std::vector<uint8_t> readStdin();

// Reads a glTF file, from stdin for "-". Throws GltfError.
Document openDocument(const std::filesystem::path &path);

// Discards what is printed to stdout from now on, and shows no progress.
void discardReports();

// Keeps stdout for data: what is printed to it from now on goes to stderr or is discarded.
class DataOutput
{
public:
    enum class Reports { ToStderr, Discarded };
    explicit DataOutput(Reports reports);
    // Throws Error.
    void write(std::span<const uint8_t> bytes);
    void write(std::string_view text) { write({reinterpret_cast<const uint8_t *>(text.data()), text.size()}); }
    // What was written has reached stdout. Throws Error.
    void finish();

private:
    std::unique_ptr<std::FILE, int (*)(std::FILE *)> file_;
};

// Writes a file, whole or not at all; for "-" to `data`, which must then be there. Throws Error.
void writeData(const std::filesystem::path &path, std::span<const uint8_t> bytes, std::optional<DataOutput> &data);

} // namespace vellum::cli
