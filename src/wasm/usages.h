// SPDX-License-Identifier: Apache-2.0
// Usage counts as JSON.
#pragma once

#include <span>
#include <string_view>

#include "base/json_writer.h"
#include "vellum/vellum.h"

namespace vellum::wasm
{

// Of VellumMicromapUsage or MicromapUsage.
template <typename Usage>
void writeUsages(JsonWriter &json, std::span<const Usage> usages)
{
    json.list("usages", usages, [&](const Usage &usage) {
        json.beginObject().member("count", usage.count).member("subdivisionLevel", usage.subdivisionLevel);
        json.member("format", static_cast<uint32_t>(usage.format)).end();
    });
}

} // namespace vellum::wasm
