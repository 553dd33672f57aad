// SPDX-License-Identifier: Apache-2.0
// What only the page of bindings/js/page needs: the page of `vellum inspect`.
#include "inspect/page.h"

#include "base/error.h"
#include "wasm/call.h"
#include "wasm/file.h"

using namespace vellum;
using namespace vellum::wasm;

// The only part of the result is the HTML.
VELLUM_EXPORT("inspectPage")
const Result::Words *vellumInspectPageOfCall(const uint8_t *bytes, size_t size, const char *name)
{
    return run([&](Result &result) {
        try {
            const Document document = File{bytes, size, name}.document();
            const auto page =
                std::make_shared<std::string>(inspect::makePage(document, inspect::inspectFile(document, {}, nullptr)));
            result.text = "{}";
            result.add(page->data(), page->size());
            result.owner = page;
        } catch (const Error &error) {
            throw library::Failure(VELLUM_ERROR_FILE, error.what());
        }
    });
}
