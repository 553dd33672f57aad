#include "cli/verify_report.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <rapidjson/prettywriter.h>
#include <rapidjson/stringbuffer.h>

#include "cli/base/numbers.h"
#include "gltf/file/utf8.h"

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
    const std::string test = primitive.cutoff ? fmt::format("cutoff {:.9g}", *primitive.cutoff) : "alphaMode BLEND";
    fmt::print("  {}: {}, {}: {}, {}, {}\n", what, primitive.name, placeOf(f), nameOf(f.state), value, test);
}

// As wide as it is printed, as far as that can be told.
std::size_t codePoints(const std::string &text)
{
    return static_cast<std::size_t>(
        std::count_if(text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xc0) != 0x80; }));
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
        width = std::max(width, codePoints(row.name));
    fmt::print("  {:<{}} {:>11} {:>16} {:>11} {:>8} {:>8} {:>8} {:>9} {:>10}\n", "primitive", width, "triangles",
               "micro-triangles", "transparent", "opaque", "unknown", "wrong", "outside", "needlessly");
    fmt::print("  {:<{}} {:>11} {:>16} {:>11} {:>8} {:>8} {:>8} {:>9} {:>10}\n", "", width, "", "", "", "", "",
               "claims", "margins", "unknown");
    for (const Row &row : rows) {
        const Counts &c = row.counts;
        const std::uint64_t all = c.opaque + c.transparent + c.unknown;
        fmt::print("  {:<{}} {:>11} {:>16} {:>11} {:>8} {:>8} {:>8} {:>9} {:>10}\n", row.name, width,
                   grouped(row.triangles), grouped(c.microTriangles()), share(c.transparent, all), share(c.opaque, all),
                   share(c.unknown, all), grouped(c.of(Kind::Wrong)), grouped(c.of(Kind::OutsideMargins)),
                   grouped(c.of(Kind::Needless)));
    }
}

// Those of which something is to be said, where there are very many.
void printPrimitives(const verify::FileReport &report)
{
    constexpr std::size_t kMany = 40;
    std::vector<Row> rows;
    std::size_t triangles = 0;
    for (const PrimitiveReport &p : report.primitives) {
        const Counts &c = p.result.counts;
        const bool clean = c.of(Kind::Wrong) + c.of(Kind::OutsideMargins) + c.of(Kind::Needless) + c.open == 0;
        if (report.primitives.size() <= kMany || !clean)
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

class JsonReport
{
public:
    JsonReport() : m_writer(m_buffer) { m_writer.SetIndent(' ', 2); }
    std::string write(const std::vector<VerifiedFile> &files, bool strict);

private:
    void name(const char *text) { m_writer.Key(text); }
    void add(const std::string &value)
    {
        const std::string text = toUtf8(value);
        m_writer.String(text.c_str(), static_cast<rapidjson::SizeType>(text.size()));
    }
    void add(std::uint64_t value) { m_writer.Uint64(value); }
    void add(bool value) { m_writer.Bool(value); }
    // JSON has no word for what is not a number.
    void add(double value) { std::isfinite(value) ? m_writer.Double(value) : m_writer.Null(); }
    template <typename T>
    void member(const char *text, const T &value)
    {
        name(text);
        add(value);
    }
    template <typename List, typename Add>
    void list(const char *text, const List &elements, Add &&addElement)
    {
        name(text);
        m_writer.StartArray();
        for (const auto &element : elements) {
            m_writer.StartObject();
            addElement(element);
            m_writer.EndObject();
        }
        m_writer.EndArray();
    }
    void level(const char *text, int value);
    void counts(const Counts &c);
    void surface(const std::optional<SurfaceShares> &shares);
    void finding(const Finding &f);
    void primitive(const PrimitiveReport &p);
    void file(const VerifiedFile &file, bool strict);

    rapidjson::StringBuffer m_buffer;
    rapidjson::PrettyWriter<rapidjson::StringBuffer> m_writer;
};

void JsonReport::level(const char *text, int value)
{
    name(text);
    value < 0 ? m_writer.Null() : m_writer.Int(value);
}

void JsonReport::counts(const Counts &c)
{
    member("microTriangles", c.microTriangles());
    member("transparent", c.transparent);
    member("opaque", c.opaque);
    member("unknown", c.unknown);
    for (std::size_t kind = 0; kind < verify::kKinds; ++kind)
        member(nameOf(static_cast<Kind>(kind)), c.findings[kind]);
    member("open", c.open);
    name("twoState");
    m_writer.StartObject();
    member("true", c.twoStateTrue);
    member("mixed", c.twoStateMixed);
    member("reversed", c.twoStateReversed);
    m_writer.EndObject();
}

void JsonReport::surface(const std::optional<SurfaceShares> &shares)
{
    name("surface");
    if (!shares) {
        m_writer.Null();
        return;
    }
    m_writer.StartObject();
    member("known", shares->known());
    member("withoutMicromap", shares->withoutMicromap);
    m_writer.EndObject();
}

void JsonReport::finding(const Finding &f)
{
    member("kind", std::string(nameOf(f.kind)));
    member("triangle", std::uint64_t{f.triangle});
    member("microTriangle", std::uint64_t{f.microTriangle});
    member("level", std::uint64_t{f.level});
    member("special", f.special);
    member("state", std::string(nameOf(f.state)));
    name("uv");
    m_writer.StartArray();
    add(f.u);
    add(f.v);
    m_writer.EndArray();
    member("value", f.value);
}

void JsonReport::primitive(const PrimitiveReport &p)
{
    member("mesh", std::uint64_t{p.place.mesh});
    member("primitive", std::uint64_t{p.place.primitive});
    member("name", p.name);
    member("material", p.material);
    if (!p.caution.empty())
        member("caution", p.caution);
    name("cutoff");
    p.cutoff ? add(*p.cutoff) : static_cast<void>(m_writer.Null());
    member("triangles", std::uint64_t{p.triangles});
    member("specialIndices", std::uint64_t{p.special});
    counts(p.result.counts);
    list("findings", p.result.findings, [this](const Finding &f) { finding(f); });
}

void JsonReport::file(const VerifiedFile &file, bool strict)
{
    const verify::FileReport &r = file.report;
    member("file", file.path);
    member("code", static_cast<std::uint64_t>(judgementOf(file, strict)));
    if (!file.error.empty()) {
        member("error", file.error);
        return;
    }
    member("extension", r.extension);
    member("micromaps", std::uint64_t{r.micromaps});
    level("level2State", r.level2State);
    level("level4State", r.level4State);
    member("mixedSpecialIndices", r.mixedSpecialIndices);
    list("offences", r.offences, [this](const MicromapOffence &o) {
        member("place", o.place);
        member("message", o.message);
    });
    list("unverified", r.unverified, [this](const verify::Unverified &u) {
        member("place", u.name);
        member("reason", u.reason);
    });
    counts(r.counts());
    surface(file.surface);
    list("primitives", r.primitives, [this](const PrimitiveReport &p) { primitive(p); });
}

std::string JsonReport::write(const std::vector<VerifiedFile> &files, bool strict)
{
    m_writer.StartObject();
    list("files", files, [&](const VerifiedFile &f) { file(f, strict); });
    m_writer.EndObject();
    return m_buffer.GetString();
}

} // namespace

Judgement judgementOf(const VerifiedFile &file, bool strict)
{
    const verify::FileReport &report = file.report;
    const Counts sum = report.counts();
    if (!file.error.empty())
        return Judgement::Unreadable;
    if (!report.unverified.empty())
        return Judgement::Unreadable;
    if (!report.offences.empty())
        return Judgement::Structure;
    if (sum.of(Kind::Wrong) > 0)
        return Judgement::Wrong;
    if (!strict)
        return Judgement::AllRight;
    if (report.extension.empty())
        return Judgement::NoMicromaps;
    const bool cautious = std::any_of(report.primitives.begin(), report.primitives.end(),
                                      [](const PrimitiveReport &p) { return !p.caution.empty(); });
    if (cautious || sum.of(Kind::OutsideMargins) + sum.open > 0)
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
    fmt::print("{}: {}, {}, structure all right\n", file.path, report.extension, counted(report.micromaps, "micromap"));
    printDevice(report);
    printPrimitives(report);
    if (file.surface)
        fmt::print("  {}\n", surfaceKnown(file.surface->known()));
    const Counts sum = report.counts();
    printTwoState(sum);
    for (const PrimitiveReport &p : report.primitives)
        if (!p.caution.empty())
            fmt::print("  caution: {}: {}: verified without that\n", p.name, p.caution);
    for (const verify::Unverified &u : report.unverified)
        fmt::print("  not verified: {}: {}\n", u.name, u.reason);
    printFindings(report);
    if (sum.open > 0)
        fmt::print("  left open: {} claims that are too close to call, or take too long\n", grouped(sum.open));
}

std::string verifiedJson(const std::vector<VerifiedFile> &files, bool strict)
{
    return JsonReport().write(files, strict);
}

} // namespace vellum::cli
