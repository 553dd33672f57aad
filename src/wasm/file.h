// SPDX-License-Identifier: Apache-2.0
// glTF files in memory, and the frame of the functions that read them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "core/utf8_path.h"
#include "gltf/document.h"
#include "library/call.h"
#include "wasm/call.h"

namespace vellum::wasm
{

// The bytes of a file, and its name.
struct File {
    const uint8_t *bytes;
    size_t size;
    const char *name;

    [[nodiscard]] Document document() const { return {utf8Path(name), {bytes, bytes + size}}; }
};

// Runs a function that takes a Result and throws what vellum/gltf.h reports.
template <typename Function>
const Result::Words *run(Function &&function)
{
    return guardedExport([&] {
        auto result = std::make_unique<Result>();
        const VellumResult code = library::guarded(keepMessage, result.get(), [&] {
            try {
                function(*result);
            } catch (const GltfError &error) {
                throw library::Failure(VELLUM_ERROR_FILE, error.what());
            }
        });
        return finish(std::move(result), code);
    });
}

} // namespace vellum::wasm
