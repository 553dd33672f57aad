// SPDX-License-Identifier: Apache-2.0
// Errors in a glTF file.
#pragma once

#include <stdexcept>

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

// The file system of an output is full or read-only: no other file can be written there either.
class GltfStorageError : public GltfError
{
public:
    using GltfError::GltfError;
};

} // namespace vellum
