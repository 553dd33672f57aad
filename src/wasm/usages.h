// SPDX-License-Identifier: Apache-2.0
// Usage counts as JSON.
#pragma once

#include <span>
#include <string_view>

#include "base/json_writer.h"
#include "vellum/vellum.h"

namespace vellum::wasm
{

inline void writeUsages(JsonWriter &json, std::span<const VellumMicromapUsage> usages)
{
    json.list("usages", usages, [&](const VellumMicromapUsage &usage) {
        json.beginObject().member("count", usage.count).member("subdivisionLevel", usage.subdivisionLevel);
        json.member("format", usage.format).end();
    });
}

} // namespace vellum::wasm
