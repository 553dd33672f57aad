// SPDX-License-Identifier: Apache-2.0
// The options of a bake, as JavaScript passes them.
#pragma once

#include "vellum/vellum.h"
#include "wasm/result.h"

namespace vellum::wasm
{

// `numbers`: the members of VellumBakeOptions in the order of kOptions in bindings/js/index.js, NaN for a default. The
// callbacks are those of index.js, with one thread.
VellumBakeOptions optionsOf(const double *numbers, Result &result);

} // namespace vellum::wasm
