// SPDX-License-Identifier: Apache-2.0
// Errors in a glTF file.
#pragma once

#include <stdexcept>
#include <string>

namespace vellum
{

// Its message is one line, which names the file if a function reads one by its path or as a Document.
class GltfError : public std::runtime_error
{
public:
    using std::runtime_error::runtime_error;
};

// Something that the file may well have, and that is not supported: a compression, a kind of image.
class GltfUnsupported : public GltfError
{
public:
    using GltfError::GltfError;
};

// An output cannot be written, and neither can others.
class GltfStorageError : public GltfError
{
public:
    enum class Cause {
        Full,     // the file system has too few bytes for this file
        Quota,    // so has the user, the group or the folder
        ReadOnly, // the file system
    };
    GltfStorageError(const std::string &message, Cause cause) : GltfError(message), cause_(cause) {}
    [[nodiscard]] Cause cause() const { return cause_; }

private:
    Cause cause_;
};

} // namespace vellum
