// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace vellum::check
{

// The extension that micromaps are made and used with.
enum class Api { Ext, Khr };

} // namespace vellum::check
