#include "cli/verify_report.h"

#include <fmt/format.h>

#include <cmath>

#include "cli/base/numbers.h"

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

// Of the JSON, too.
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
    fmt::print("  {}: {}, {}: {}, {}, cutoff {:.9g}\n", what, primitive.name, placeOf(f), nameOf(f.state), value,
               primitive.cutoff);
}

struct Row {
    std::string name;
    std::size_t triangles;
    Counts counts;
};

void printTable(const std::vector<Row> &rows)
{
    const auto share = [](std::uint64_t part, std::uint64_t all) {
        return all == 0 ? std::string("-")
                        : fmt::format("{:.1f} %", 100.0 * static_cast<double>(part) / static_cast<double>(all));
    };
    std::size_t width = 9;
    for (const Row &row : rows)
        width = std::max(width, row.name.size());
    fmt::print("  {:<{}} {:>11} {:>16} {:>8} {:>11} {:>8} {:>8} {:>9} {:>10}\n", "primitive", width, "triangles",
               "micro-triangles", "opaque", "transparent", "unknown", "wrong", "outside", "needlessly");
    fmt::print("  {:<{}} {:>11} {:>16} {:>8} {:>11} {:>8} {:>8} {:>9} {:>10}\n", "", width, "", "", "", "", "",
               "claims", "margins", "unknown");
    for (const Row &row : rows) {
        const Counts &c = row.counts;
        const std::uint64_t all = c.opaque + c.transparent + c.unknown;
        fmt::print("  {:<{}} {:>11} {:>16} {:>8} {:>11} {:>8} {:>8} {:>9} {:>10}\n", row.name, width,
                   grouped(row.triangles), grouped(c.microTriangles()), share(c.opaque, all), share(c.transparent, all),
                   share(c.unknown, all), grouped(c.of(Kind::Wrong)), grouped(c.of(Kind::OutsideMargins)),
                   grouped(c.of(Kind::Needless)));
    }
}

void printTwoState(const Counts &c)
{
    const std::uint64_t all = c.twoStateTrue + c.twoStateMixed + c.twoStateReversed;
    if (all == 0)
        return;
    const auto share = [all](std::uint64_t part) {
        return 100.0 * static_cast<double>(part) / static_cast<double>(all);
    };
    fmt::print("  2-state data, an approximation: {} micro-triangles, {:.2f} % as the texture is all over them, "
               "{:.2f} % with both outcomes, {:.2f} % the other way round\n",
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
               report.mixedSpecialIndices ? "; special indices beside others in one geometry" : "");
}

void printFindings(const verify::FileReport &report)
{
    const Counts sum = report.counts();
    std::array<std::size_t, verify::kKinds> listed{};
    for (const PrimitiveReport &primitive : report.primitives) {
        for (const Finding &f : primitive.result.findings) {
            print(primitive, f);
            ++listed[static_cast<std::size_t>(f.kind)];
        }
    }
    std::size_t shown = 0;
    std::uint64_t all = 0;
    for (std::size_t kind = 0; kind < verify::kKinds; ++kind) {
        shown += listed[kind];
        all += sum.findings[kind];
    }
    if (shown < all)
        fmt::print("  and {} more (--max lists more)\n", grouped(all - shown));
}

std::string quoted(const std::string &text)
{
    std::string result = "\"";
    for (const char c : text) {
        if (c == '"' || c == '\\')
            result += {'\\', c};
        else if (static_cast<unsigned char>(c) < 0x20)
            result += fmt::format("\\u{:04x}", static_cast<unsigned>(c));
        else
            result += c;
    }
    return result + '"';
}

// JSON has no word for what is not a number.
std::string jsonNumber(double value)
{
    return std::isfinite(value) ? fmt::format("{:.17g}", value) : "null";
}

std::string countsJson(const Counts &c)
{
    return fmt::format("\"microTriangles\": {}, \"opaque\": {}, \"transparent\": {}, \"unknown\": {}, \"wrong\": {}, "
                       "\"outsideMargins\": {}, \"needlesslyUnknown\": {}, \"open\": {}, \"twoState\": {{\"true\": {}, "
                       "\"mixed\": {}, \"reversed\": {}}}",
                       c.microTriangles(), c.opaque, c.transparent, c.unknown, c.of(Kind::Wrong),
                       c.of(Kind::OutsideMargins), c.of(Kind::Needless), c.open, c.twoStateTrue, c.twoStateMixed,
                       c.twoStateReversed);
}

// Calls append(element) for each, with commas between.
template <typename List, typename Append>
std::string listJson(const List &list, Append &&element)
{
    std::string text = "[";
    for (const auto &e : list)
        text += (text.size() > 1 ? ", " : "") + element(e);
    return text + "]";
}

std::string primitiveJson(const PrimitiveReport &p)
{
    const std::string findings = listJson(p.result.findings, [](const Finding &f) {
        return fmt::format(
            "{{\"kind\": \"{}\", \"triangle\": {}, \"microTriangle\": {}, \"level\": {}, \"special\": {}, "
            "\"state\": \"{}\", \"uv\": [{}, {}], \"value\": {}}}",
            nameOf(f.kind), f.triangle, f.microTriangle, f.level, f.special, nameOf(f.state), jsonNumber(f.u),
            jsonNumber(f.v), jsonNumber(f.value));
    });
    return fmt::format("{{\"mesh\": {}, \"primitive\": {}, \"name\": {}, \"material\": {}, \"cutoff\": {}, "
                       "\"triangles\": {}, \"specialIndices\": {}, {}, \"findings\": {}}}",
                       p.place.mesh, p.place.primitive, quoted(p.name), quoted(p.material), jsonNumber(p.cutoff),
                       p.triangles, p.special, countsJson(p.result.counts), findings);
}

std::string fileJson(const VerifiedFile &file, bool strict)
{
    const verify::FileReport &r = file.report;
    const std::string head =
        fmt::format("{{\"file\": {}, \"code\": {}, ", quoted(file.path), static_cast<int>(judgementOf(file, strict)));
    if (!file.error.empty())
        return head + "\"error\": " + quoted(file.error) + "}";
    const auto said = [](const auto &of, const char *what, const std::string &text) {
        return fmt::format("{{\"place\": {}, \"{}\": {}}}", quoted(of), what, quoted(text));
    };
    return head +
           fmt::format(
               "\"extension\": {}, \"micromaps\": {}, \"level2State\": {}, \"level4State\": {}, "
               "\"mixedSpecialIndices\": {}, \"offences\": {}, \"unverified\": {}, {}, "
               "\"primitives\": {}}}",
               r.extension.empty() ? "null" : quoted(r.extension), r.micromaps,
               r.level2State < 0 ? "null" : std::to_string(r.level2State),
               r.level4State < 0 ? "null" : std::to_string(r.level4State), r.mixedSpecialIndices,
               listJson(r.offences, [&](const MicromapOffence &o) { return said(o.place, "message", o.message); }),
               listJson(r.unverified, [&](const verify::Unverified &u) { return said(u.name, "reason", u.reason); }),
               countsJson(r.counts()), listJson(r.primitives, primitiveJson));
}

} // namespace

Judgement judgementOf(const VerifiedFile &file, bool strict)
{
    const verify::FileReport &report = file.report;
    const Counts sum = report.counts();
    if (!file.error.empty())
        return Judgement::Unreadable;
    if (!report.offences.empty())
        return Judgement::Structure;
    if (sum.of(Kind::Wrong) > 0)
        return Judgement::Wrong;
    if (!report.unverified.empty())
        return Judgement::Unreadable;
    if (!strict)
        return Judgement::AllRight;
    if (report.extension.empty())
        return Judgement::NoMicromaps;
    if (sum.of(Kind::OutsideMargins) + sum.open > 0)
        return Judgement::OutsideMargins;
    return sum.of(Kind::Needless) > 0 ? Judgement::Needless : Judgement::AllRight;
}

void printVerified(const VerifiedFile &file)
{
    const verify::FileReport &report = file.report;
    if (!file.error.empty()) {
        fmt::print("{}\n  cannot be read\n", file.path); // the reason is said elsewhere
        return;
    }
    if (!report.offences.empty()) {
        fmt::print("{}: {}\n", file.path, report.extension.empty() ? "micromaps" : report.extension);
        for (const MicromapOffence &offence : report.offences)
            fmt::print("  structure: {}: {}\n", offence.place, offence.message);
        fmt::print("  what the micromaps say was not looked at\n");
        return;
    }
    if (report.extension.empty()) {
        fmt::print("{}: no micromaps\n", file.path);
        return;
    }
    fmt::print("{}: {}, {} micromaps, structure all right\n", file.path, report.extension, report.micromaps);
    printDevice(report);
    std::vector<Row> rows;
    std::size_t triangles = 0;
    for (const PrimitiveReport &p : report.primitives) {
        rows.push_back({p.name, p.triangles, p.result.counts});
        triangles += p.triangles;
    }
    const Counts sum = report.counts();
    if (rows.size() > 1)
        rows.push_back({"all", triangles, sum});
    if (!rows.empty())
        printTable(rows);
    printTwoState(sum);
    for (const verify::Unverified &u : report.unverified)
        fmt::print("  not verified: {}: {}\n", u.name, u.reason);
    printFindings(report);
    if (sum.open > 0)
        fmt::print("  left open: {} claims that are too close to call, or take too long\n", grouped(sum.open));
}

std::string verifiedJson(const std::vector<VerifiedFile> &files, bool strict)
{
    return "{\"files\": " + listJson(files, [strict](const VerifiedFile &file) { return fileJson(file, strict); }) +
           "}";
}

} // namespace vellum::cli
