// SPDX-License-Identifier: Apache-2.0
#include "cli/verify/verify_report.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

#include "base/text.h"
#include "inspect/report_parts.h"

namespace vellum::cli
{
namespace
{

using verify::Counts;
using verify::Finding;
using verify::Kind;
using verify::PrimitiveReport;

const char *nameOf(State state)
{
    switch (state) {
    case State::Transparent: return "transparent";
    case State::Opaque: return "opaque";
    case State::UnknownTransparent: return "unknown-transparent";
    case State::UnknownOpaque: break;
    }
    return "unknown-opaque";
}

// The name in JSON.
const char *nameOf(Kind kind)
{
    switch (kind) {
    case Kind::Wrong: return "wrong";
    case Kind::OutsideMargins: return "outsideMargins";
    case Kind::Needless: break;
    }
    return "needlesslyUnknown";
}

std::string placeOf(const Finding &f)
{
    return f.special ? fmt::format("triangle {} (special index)", f.triangle)
                     : fmt::format("triangle {}, micro-triangle {} of level {}", f.triangle, f.microTriangle, f.level);
}

void print(const PrimitiveReport &primitive, const Finding &f)
{
    const std::string value = std::isnan(f.value) ? "where nothing is a number"
                                                  : fmt::format("alpha {:.9g} at uv {:.9g} {:.9g}", f.value, f.u, f.v);
    const char *what = f.kind == Kind::Wrong            ? "wrong"
                       : f.kind == Kind::OutsideMargins ? "outside the margins"
                                                        : "needlessly unknown";
    const std::string test = primitive.cutoff ? fmt::format("cutoff {:.9g}", *primitive.cutoff) : "alphaMode BLEND";
    fmt::print("  {}: {}, {}: {}, {}, {}\n", what, primitive.name, placeOf(f), nameOf(f.state), value, test);
}

// The approximate width in columns.
size_t codePoints(const std::string &text)
{
    return static_cast<size_t>(
        std::count_if(text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xc0) != 0x80; }));
}

struct Row {
    std::string name;
    size_t triangles;
    Counts counts;
};

void printTable(const std::vector<Row> &rows)
{
    const auto share = [](uint64_t part, uint64_t all) {
        return all == 0 ? std::string("-")
                        : fmt::format("{:.1f} %", 100.0 * static_cast<double>(part) / static_cast<double>(all));
    };
    size_t width = 9;
    for (const Row &row : rows)
        width = std::max(width, codePoints(row.name));
    fmt::print("  {:<{}} {:>11} {:>16} {:>11} {:>8} {:>8} {:>8} {:>9} {:>10}\n", "primitive", width, "triangles",
               "micro-triangles", "transparent", "opaque", "unknown", "wrong", "outside", "needlessly");
    fmt::print("  {:<{}} {:>11} {:>16} {:>11} {:>8} {:>8} {:>8} {:>9} {:>10}\n", "", width, "", "", "", "", "",
               "claims", "margins", "unknown");
    for (const Row &row : rows) {
        const Counts &c = row.counts;
        const uint64_t all = c.opaque + c.transparent + c.unknown;
        fmt::print("  {:<{}} {:>11} {:>16} {:>11} {:>8} {:>8} {:>8} {:>9} {:>10}\n", row.name, width,
                   grouped(row.triangles), grouped(c.microTriangles()), share(c.transparent, all), share(c.opaque, all),
                   share(c.unknown, all), grouped(c.of(Kind::Wrong)), grouped(c.of(Kind::OutsideMargins)),
                   grouped(c.of(Kind::Needless)));
    }
}

// Prints only the primitives with findings where there are very many, unless `verbose`.
void printPrimitives(const verify::FileReport &report, bool verbose)
{
    const size_t many = verbose ? ~size_t{0} : 40;
    std::vector<Row> rows;
    size_t triangles = 0;
    for (const PrimitiveReport &p : report.primitives) {
        const Counts &c = p.result.counts;
        const bool clean = c.of(Kind::Wrong) + c.of(Kind::OutsideMargins) + c.of(Kind::Needless) + c.open == 0;
        if (report.primitives.size() <= many || !clean)
            rows.push_back({p.name, p.triangles, c});
        triangles += p.triangles;
    }
    if (report.primitives.size() > 1)
        rows.push_back(
            {report.primitives.size() == rows.size() ? "all" : fmt::format("all {}", report.primitives.size()),
             triangles, report.counts()});
    if (rows.empty())
        return;
    printTable(rows);
    fmt::print("  shares are of micro-triangles\n");
}

void printTwoState(const Counts &c)
{
    const uint64_t all = c.twoStateTrue + c.twoStateMixed + c.twoStateReversed;
    if (all == 0)
        return;
    const auto share = [all](uint64_t part) { return 100.0 * static_cast<double>(part) / static_cast<double>(all); };
    fmt::print("  2-state data, an approximation: {} micro-triangles, {:.2f} % match the texture all over, "
               "{:.2f} % have both outcomes, {:.2f} % are reversed\n",
               grouped(all), share(c.twoStateTrue), share(c.twoStateMixed), share(c.twoStateReversed));
}

void printDevice(const verify::FileReport &report)
{
    std::string levels;
    if (report.level2State >= 0)
        levels = fmt::format("2-state level {}", report.level2State);
    if (report.level4State >= 0)
        levels += fmt::format("{}4-state level {}", levels.empty() ? "" : ", ", report.level4State);
    fmt::print("  a device needs: {}{}\n", levels.empty() ? "no levels" : levels,
               report.mixedSpecialIndices ? ", special and other indices in one geometry" : "");
}

void printFindings(const verify::FileReport &report)
{
    const Counts sum = report.counts();
    std::array<size_t, verify::kKinds> listed{};
    for (const PrimitiveReport &primitive : report.primitives) {
        for (const Finding &f : primitive.result.findings) {
            print(primitive, f);
            ++listed[static_cast<size_t>(f.kind)];
        }
    }
    size_t shown = 0;
    uint64_t all = 0;
    for (size_t kind = 0; kind < verify::kKinds; ++kind) {
        shown += listed[kind];
        all += sum.findings[kind];
    }
    if (shown < all)
        fmt::print("  and {} more (--max-findings lists more)\n", grouped(all - shown));
}

// The options that findings of sound micromaps can be due to.
void printHints(const verify::FileReport &report)
{
    const bool blend = std::any_of(report.primitives.begin(), report.primitives.end(), [](const PrimitiveReport &p) {
        return !p.cutoff && p.result.counts.of(Kind::Wrong) > 0;
    });
    if (blend)
        fmt::print(
            "  hint: alphaMode BLEND is known where alpha is 0 or 1 only; micromaps that were baked for a cutoff "
            "are verified with the same --blend-cutoff\n");
    if (report.counts().of(Kind::OutsideMargins) > 0)
        fmt::print(
            "  hint: micromaps that were baked with other tolerances are verified with the same options, such as "
            "--exact\n");
}

void writeLevel(const char *name, int level, JsonWriter &json)
{
    json.key(name);
    level < 0 ? json.null() : json.value(level);
}

void write(const Counts &c, JsonWriter &json)
{
    json.key("counts").beginObject().member("microTriangles", c.microTriangles());
    json.member("transparent", c.transparent).member("opaque", c.opaque).member("unknown", c.unknown);
    for (size_t kind = 0; kind < verify::kKinds; ++kind)
        json.member(nameOf(static_cast<Kind>(kind)), c.findings[kind]);
    json.member("open", c.open).key("twoState").beginObject();
    json.member("true", c.twoStateTrue).member("mixed", c.twoStateMixed).member("reversed", c.twoStateReversed);
    json.end().end();
}

void write(const Finding &f, JsonWriter &json)
{
    json.beginObject().member("kind", nameOf(f.kind)).member("triangle", f.triangle);
    json.member("microTriangle", f.microTriangle).member("level", f.level).member("special", f.special);
    json.member("state", kStateNames[static_cast<size_t>(f.state)])
        .values("uv", std::array{f.u, f.v})
        .member("value", f.value)
        .end();
}

void write(const PrimitiveReport &p, JsonWriter &json)
{
    json.beginObject().member("primitive", p.name).member("material", p.material);
    if (!p.caution.empty())
        json.member("caution", p.caution);
    json.key("cutoff");
    p.cutoff ? json.value(*p.cutoff) : json.null();
    json.member("triangles", p.triangles).member("specialIndices", p.special);
    write(p.result.counts, json);
    json.list("findings", p.result.findings, [&](const Finding &f) { write(f, json); });
    json.end();
}

void write(const VerifiedFile &file, JsonWriter &json)
{
    const verify::FileReport &r = file.report;
    json.beginObject().member("file", file.path).member("exitCode", static_cast<int>(file.code));
    if (!file.error.empty()) {
        json.member("error", file.error).end();
        return;
    }
    json.member("extension", file.extension);
    writeMicromaps(file.micromaps, json);
    writeLevel("level2State", r.level2State, json);
    writeLevel("level4State", r.level4State, json);
    json.member("mixedSpecialIndices", r.mixedSpecialIndices);
    json.key("findings").beginArray();
    for (const MicromapFinding &finding : r.findings)
        writeFinding("structure", finding.place, finding.message, json);
    for (const verify::Unverified &unverified : r.unverified)
        writeFinding("unverified", unverified.name, unverified.reason, json);
    json.end();
    write(r.counts(), json);
    writeSurface(file.surface, json);
    json.list("primitives", r.primitives, [&](const PrimitiveReport &p) { write(p, json); });
    json.end();
}

} // namespace

ExitCode exitCodeOf(const VerifiedFile &file, bool strict, bool requireMicromaps)
{
    const verify::FileReport &report = file.report;
    const Counts sum = report.counts();
    if (!file.error.empty() || !report.unverified.empty())
        return ExitCode::Failed;
    if (!report.findings.empty())
        return ExitCode::InvalidMicromaps;
    if (sum.of(Kind::Wrong) > 0)
        return ExitCode::WrongClaims;
    if ((strict || requireMicromaps) && report.primitives.empty())
        return ExitCode::NoMicromaps;
    if (!strict)
        return ExitCode::Success;
    const bool cautious = std::any_of(report.primitives.begin(), report.primitives.end(),
                                      [](const PrimitiveReport &p) { return !p.caution.empty(); });
    if (cautious || sum.of(Kind::OutsideMargins) + sum.open > 0)
        return ExitCode::UncertainClaims;
    return sum.of(Kind::Needless) > 0 ? ExitCode::NeedlesslyUnknown : ExitCode::Success;
}

void printVerified(const VerifiedFile &file, bool verbose)
{
    const verify::FileReport &report = file.report;
    if (!file.error.empty())
        return; // the error goes to stderr
    if (!report.findings.empty()) {
        fmt::print("{}: invalid micromaps\n", file.path);
        for (const MicromapFinding &finding : report.findings)
            fmt::print("  structure: {}: {}\n", finding.place, finding.message);
        fmt::print("  the states were not verified\n");
        return;
    }
    if (file.extension.empty()) {
        fmt::print("{}: no micromaps\n", file.path);
        return;
    }
    fmt::print("{}: {}, {}, valid structure\n", file.path, file.extension, counted(file.micromaps.size(), "micromap"));
    if (report.primitives.empty() && report.unverified.empty())
        fmt::print("  no primitive has a micromap\n");
    printDevice(report);
    printPrimitives(report, verbose);
    if (file.surface)
        fmt::print("  {}\n", describe(*file.surface));
    const Counts sum = report.counts();
    printTwoState(sum);
    for (const PrimitiveReport &p : report.primitives)
        if (!p.caution.empty())
            fmt::print("  caution: {}: {}\n", p.name, p.caution);
    for (const verify::Unverified &u : report.unverified)
        fmt::print("  not verified: {}: {}\n", u.name, u.reason);
    printFindings(report);
    printHints(report);
    if (sum.open > 0)
        fmt::print("  undecided: {} claims that are too close to call, or take too long\n", grouped(sum.open));
}

std::string verifiedJson(const std::vector<VerifiedFile> &files)
{
    JsonWriter json;
    beginReport(json, "verify");
    json.list("files", files, [&](const VerifiedFile &file) { write(file, json); });
    return json.end().text();
}

} // namespace vellum::cli
