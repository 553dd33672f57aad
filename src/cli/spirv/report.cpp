// SPDX-License-Identifier: Apache-2.0
#include "cli/spirv/report.h"

#include <fmt/format.h>

#include "base/text.h"
#include "cli/spirv/modules.h"
#include "inspect/report_parts.h"

namespace vellum::cli
{
namespace
{

using Kind = LintFinding::Kind;
using When = spirv::MicromapMode::When;

std::string versionOf(const SpirvFile &file)
{
    return fmt::format("{}.{}", file.version >> 16, file.version >> 8 & 0xff);
}

std::string describe(const spirv::MicromapMode &mode)
{
    switch (mode.when) {
    case When::Absent: return "no execution mode";
    case When::Never: return "execution mode false";
    case When::Always: return "execution mode true";
    case When::Specialized:
        return fmt::format("execution mode by specialization constant {} (default {})", mode.constantId, mode.initial);
    case When::Computed: return "execution mode by an expression of specialization constants";
    case When::Invalid: break;
    }
    return "invalid execution mode";
}

std::string describe(const spirv::EntryPoint &entry)
{
    const char *rays = entry.queries && entry.traces ? "ray queries, traced rays"
                       : entry.queries               ? "ray queries"
                       : entry.traces                ? "traced rays: the pipeline needs the micromap bit"
                                                     : "no rays";
    std::string text = fmt::format("{} ({}): {}", entry.name, stageName(entry.model), rays);
    if (entry.queries || entry.mode.when != When::Absent)
        text += "; " + describe(entry.mode);
    return text;
}

const char *nameOf(When when)
{
    switch (when) {
    case When::Absent: return "absent";
    case When::Never: return "false";
    case When::Always: return "true";
    case When::Specialized: return "constant";
    case When::Computed: return "computed";
    case When::Invalid: break;
    }
    return "invalid";
}

const char *nameOf(Kind kind)
{
    switch (kind) {
    case Kind::QueriesWithoutMode: return "queriesWithoutMode";
    case Kind::ModeWithoutQueries: return "modeWithoutQueries";
    case Kind::InvalidMode: return "invalidMode";
    case Kind::Emulation: return "emulation";
    case Kind::RayFlags: break;
    }
    return "rayFlags";
}

void write(const spirv::EntryPoint &entry, JsonWriter &json)
{
    json.beginObject().member("name", entry.name).member("stage", stageName(entry.model));
    json.member("rayQueries", entry.queries).member("tracesRays", entry.traces);
    json.key("micromaps").beginObject().member("mode", nameOf(entry.mode.when));
    if (entry.mode.when == When::Specialized)
        json.member("constantId", entry.mode.constantId).member("default", entry.mode.initial);
    json.end().end();
}

void write(const LintFinding &finding, JsonWriter &json)
{
    json.beginObject().member("kind", nameOf(finding.kind)).key("entryPoint");
    finding.entryPoint.empty() ? json.null() : json.value(finding.entryPoint);
    json.member("message", finding.message).end();
}

void write(const SpirvFile &file, JsonWriter &json)
{
    json.beginObject().member("file", file.path);
    if (!file.error.empty()) {
        json.member("error", file.error).end();
        return;
    }
    json.member("bytes", file.bytes).member("version", versionOf(file));
    if (file.output)
        json.member("output", file.output->path)
            .member("outputBytes", file.output->bytes)
            .member("changed", file.output->changed);
    json.list("entryPoints", file.entryPoints, [&](const auto &entry) { write(entry, json); });
    if (file.findings)
        json.list("findings", *file.findings, [&](const auto &finding) { write(finding, json); });
    json.end();
}

} // namespace

void printSpirv(const SpirvFile &file)
{
    if (!file.error.empty())
        return;
    fmt::print("{}: SPIR-V {}, {}\n", file.path, versionOf(file), counted(file.entryPoints.size(), "entry point"));
    for (const spirv::EntryPoint &entry : file.entryPoints)
        fmt::print("  {}\n", describe(entry));
    if (file.findings)
        for (const LintFinding &finding : *file.findings)
            fmt::print("  finding: {}{}\n", finding.entryPoint.empty() ? "" : finding.entryPoint + ": ",
                       finding.message);
    if (file.findings && file.findings->empty())
        fmt::print("  no findings\n");
    if (file.output)
        fmt::print("  {}: {}{}\n", file.output->path, counted(file.output->bytes, "byte"),
                   file.output->changed ? "" : ", unchanged");
}

std::string spirvJson(const char *action, std::span<const SpirvFile> files)
{
    JsonWriter json;
    beginReport(json, "spirv");
    json.member("action", action);
    json.list("files", files, [&](const SpirvFile &file) { write(file, json); });
    return json.end().text();
}

} // namespace vellum::cli
