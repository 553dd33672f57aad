// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fmt/format.h>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/progress.h"
#include "base/text.h"
#include "cli/base/exit_code.h"
#include "cli/base/files.h"
#include "cli/options/commands.h"
#include "cli/options/options.h"
#include "gltf/micromaps/known_surface.h"
#include "inspect/report_parts.h"
#include "verify/file.h"

namespace vellum::cli
{
namespace
{

constexpr const char *kVerifyDetails = R"(
Checks the structure of the micromaps, and every micro-triangle against the texture, independently of the baker: only the
reader of glTF files and images is shared. A claim (opaque or transparent) is wrong if the alpha test has the other
outcome anywhere in the micro-triangle, edges included, in exact arithmetic. Counted separately are claims that are true
but do not hold with the margins that GPUs have around a micro-triangle, and states that are unknown without need. 2-state
data is an approximation; how good it is, is printed.

Folders are searched recursively. Of several exit codes the smallest is returned.

Examples:
  vellum verify ash.omm.glb
      a table, and the first findings
  vellum verify --strict baked/ && echo fine
      all .glb and .gltf files in a folder; fails for anything that could be better
  vellum verify --exact ash.omm.glb
      for micromaps that were baked without tolerances
  vellum verify --json ash.omm.glb | jq .files[0].counts.wrong
      the same for a script
)";

// A file that was verified, or the reason why it was not.
struct VerifiedFile {
    std::string path;
    std::string error; // in one line; empty if it was read
    verify::FileReport report;
    std::optional<SurfaceShares> surface;
    std::string extension; // empty if it has no micromaps, or invalid ones
    std::vector<MicromapSummary> micromaps;
    ExitCode code = ExitCode::Success;
};

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
const char *nameOf(verify::Kind kind)
{
    switch (kind) {
    case verify::Kind::Wrong: return "wrong";
    case verify::Kind::OutsideMargins: return "outsideMargins";
    case verify::Kind::Needless: break;
    }
    return "needlesslyUnknown";
}

std::string placeOf(const verify::Finding &f)
{
    return f.special ? fmt::format("triangle {} (special index)", f.triangle)
                     : fmt::format("triangle {}, micro-triangle {} of level {}", f.triangle, f.microTriangle, f.level);
}

void print(const verify::PrimitiveReport &primitive, const verify::Finding &f)
{
    const std::string value = std::isnan(f.value) ? "where nothing is a number"
                                                  : fmt::format("alpha {:.9g} at uv {:.9g} {:.9g}", f.value, f.u, f.v);
    const char *what = f.kind == verify::Kind::Wrong            ? "wrong"
                       : f.kind == verify::Kind::OutsideMargins ? "outside the margins"
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
    verify::Counts counts;
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
        const verify::Counts &c = row.counts;
        const uint64_t all = c.opaque + c.transparent + c.unknown;
        fmt::print("  {:<{}} {:>11} {:>16} {:>11} {:>8} {:>8} {:>8} {:>9} {:>10}\n", row.name, width,
                   grouped(row.triangles), grouped(c.microTriangles()), share(c.transparent, all), share(c.opaque, all),
                   share(c.unknown, all), grouped(c.of(verify::Kind::Wrong)),
                   grouped(c.of(verify::Kind::OutsideMargins)), grouped(c.of(verify::Kind::Needless)));
    }
}

// Prints only the primitives with findings where there are very many, unless `verbose`.
void printPrimitives(const verify::FileReport &report, bool verbose)
{
    const size_t many = verbose ? ~size_t{0} : 40;
    std::vector<Row> rows;
    size_t triangles = 0;
    for (const verify::PrimitiveReport &p : report.primitives) {
        const verify::Counts &c = p.result.counts;
        const bool clean =
            c.of(verify::Kind::Wrong) + c.of(verify::Kind::OutsideMargins) + c.of(verify::Kind::Needless) + c.open == 0;
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

void printTwoState(const verify::Counts &c)
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
    const verify::Counts sum = report.counts();
    std::array<size_t, verify::kKinds> listed{};
    for (const verify::PrimitiveReport &primitive : report.primitives) {
        for (const verify::Finding &f : primitive.result.findings) {
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
    const bool blend =
        std::any_of(report.primitives.begin(), report.primitives.end(), [](const verify::PrimitiveReport &p) {
            return !p.cutoff && p.result.counts.of(verify::Kind::Wrong) > 0;
        });
    if (blend)
        fmt::print(
            "  hint: alphaMode BLEND is known where alpha is 0 or 1 only; micromaps that were baked for a cutoff "
            "are verified with the same --blend-cutoff\n");
    const verify::Counts sum = report.counts();
    if (!blend && sum.of(verify::Kind::Wrong) > 0)
        fmt::print("  hint: the texture, its coordinates or alphaCutoff are not those of the bake; bake again\n");
    if (sum.of(verify::Kind::Wrong) == 0 && sum.of(verify::Kind::OutsideMargins) > 0)
        fmt::print(
            "  hint: micromaps that were baked with other tolerances are verified with the same options, such as "
            "--exact\n");
}

void writeLevel(const char *name, int level, JsonWriter &json)
{
    json.key(name);
    level < 0 ? json.null() : json.value(level);
}

void write(const verify::Counts &c, JsonWriter &json)
{
    json.key("counts").beginObject().member("microTriangles", c.microTriangles());
    json.member("transparent", c.transparent).member("opaque", c.opaque).member("unknown", c.unknown);
    for (size_t kind = 0; kind < verify::kKinds; ++kind)
        json.member(nameOf(static_cast<verify::Kind>(kind)), c.findings[kind]);
    json.member("open", c.open).key("twoState").beginObject();
    json.member("true", c.twoStateTrue).member("mixed", c.twoStateMixed).member("reversed", c.twoStateReversed);
    json.end().end();
}

void write(const verify::Finding &f, JsonWriter &json)
{
    json.beginObject().member("kind", nameOf(f.kind)).member("triangle", f.triangle);
    json.member("microTriangle", f.microTriangle).member("level", f.level).member("special", f.special);
    json.member("state", kStateNames[static_cast<size_t>(f.state)])
        .values("uv", std::array{f.u, f.v})
        .member("value", f.value)
        .end();
}

void write(const verify::PrimitiveReport &p, JsonWriter &json)
{
    json.beginObject().member("primitive", p.name).member("material", p.material);
    if (!p.caution.empty())
        json.member("caution", p.caution);
    json.key("cutoff");
    p.cutoff ? json.value(*p.cutoff) : json.null();
    json.member("triangles", p.triangles).member("specialIndices", p.special);
    write(p.result.counts, json);
    json.list("findings", p.result.findings, [&](const verify::Finding &f) { write(f, json); });
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
    json.list("primitives", r.primitives, [&](const verify::PrimitiveReport &p) { write(p, json); });
    json.end();
}

ExitCode exitCodeOf(const VerifiedFile &file, bool strict, bool requireMicromaps)
{
    const verify::FileReport &report = file.report;
    const verify::Counts sum = report.counts();
    if (!file.error.empty() || !report.unverified.empty())
        return ExitCode::Failed;
    if (!report.findings.empty())
        return ExitCode::InvalidMicromaps;
    if (sum.of(verify::Kind::Wrong) > 0)
        return ExitCode::WrongClaims;
    if ((strict || requireMicromaps) && report.primitives.empty())
        return ExitCode::NoMicromaps;
    if (!strict)
        return ExitCode::Success;
    const bool cautious = std::any_of(report.primitives.begin(), report.primitives.end(),
                                      [](const verify::PrimitiveReport &p) { return !p.caution.empty(); });
    if (cautious || sum.of(verify::Kind::OutsideMargins) + sum.open > 0)
        return ExitCode::UncertainClaims;
    return sum.of(verify::Kind::Needless) > 0 ? ExitCode::NeedlesslyUnknown : ExitCode::Success;
}

// Readable text: a table and findings. Without `verbose`, not all primitives of a file with very many.
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
    const verify::Counts sum = report.counts();
    printTwoState(sum);
    for (const verify::PrimitiveReport &p : report.primitives)
        if (!p.caution.empty())
            fmt::print("  caution: {}: {}\n", p.name, p.caution);
    for (const verify::Unverified &u : report.unverified)
        fmt::print("  not verified: {}: {}\n", u.name, u.reason);
    printFindings(report);
    printHints(report);
    if (sum.open > 0)
        fmt::print("  undecided: {} claims that are too close to call, or take too long\n", grouped(sum.open));
}

// Why the code of a file that was verified is not Success, in a few words.
std::string reasonOf(const VerifiedFile &file)
{
    const verify::Counts sum = file.report.counts();
    switch (file.code) {
    case ExitCode::InvalidMicromaps: return "invalid micromaps";
    case ExitCode::WrongClaims: return counted(sum.of(verify::Kind::Wrong), "wrong claim");
    case ExitCode::NoMicromaps: return "no micromaps";
    case ExitCode::UncertainClaims: return "claims outside the margins, undecided ones or a caution";
    case ExitCode::NeedlesslyUnknown:
        return counted(sum.of(verify::Kind::Needless), "needlessly unknown micro-triangle");
    default: return "not verified: " + file.report.unverified.front().reason;
    }
}

// "50 files: 48 fine, 1 with wrong claims, 1 without micromaps; exit status 4". `counts`: of the files, by their
// codes.
std::string summaryOf(const std::map<ExitCode, size_t> &counts, ExitCode code)
{
    static const std::map<ExitCode, const char *> kKinds = {
        {ExitCode::Success, "fine"},
        {ExitCode::Failed, "not verified"},
        {ExitCode::InvalidMicromaps, "with invalid micromaps"},
        {ExitCode::WrongClaims, "with wrong claims"},
        {ExitCode::UncertainClaims, "with uncertain claims"},
        {ExitCode::NeedlesslyUnknown, "with needlessly unknown states"},
        {ExitCode::NoMicromaps, "without micromaps"}};
    size_t files = 0;
    std::string kinds;
    for (const auto &[each, count] : counts) {
        files += count;
        kinds += fmt::format("{} {} {}", kinds.empty() ? "" : ",", count, kKinds.at(each));
    }
    return fmt::format("{}:{}", counted(files, "file"), kinds) +
           (code == ExitCode::Success ? "" : fmt::format("; exit status {}", static_cast<int>(code)));
}

std::string verifiedJson(const std::vector<VerifiedFile> &files)
{
    JsonWriter json;
    beginReport(json, "verify");
    json.list("files", files, [&](const VerifiedFile &file) { write(file, json); });
    return json.end().text();
}

struct VerifyOptions {
    std::vector<std::filesystem::path> files;
    verify::FileOptions file;
    bool exact = false;
    bool strict = false;
    bool requireMicromaps = false;
    bool json = false;
    bool verbose = false;
    bool quiet = false;
};

void declareVerify(CLI::App &command, VerifyOptions &options)
{
    command.footer(kVerifyDetails);
    command.option_defaults()->group(kInput);
    command.add_option("FILE", options.files, "glTF files (.glb, .gltf) or folders of them")
        ->type_name("FILE...")
        ->required();
    command
        .add_option("--blend-cutoff", options.file.blendCutoff,
                    "The cutoff of materials of alphaMode BLEND [that of vellum bake, which it notes in the file; else "
                    "none: opaque where alpha is 1, transparent where it is 0]")
        ->check(finite())
        ->type_name("ALPHA");
    command.option_defaults()->group(kOutput);
    command.add_flag("--strict", options.strict, "Exit with 5, 6 or 7 for what could be better");
    command.add_flag("--require-micromaps", options.requireMicromaps,
                     "Exit with 7 if a file has no micromaps, for example as a tool dropped them");
    command.add_flag(
        "--strict-2-state", options.file.strictTwoState,
        "Check 2-state data like 4-state data: claims that do not hold all over the micro-triangle are wrong");
    command
        .add_option("--max-findings", options.file.maxFindings,
                    "Most findings of each kind to list for a primitive [20]")
        ->check(wholeBetween(0, 1'000'000))
        ->type_name("COUNT");
    command.add_flag("-v,--verbose", options.verbose, "List primitives without findings, however many there are");
    command.add_flag("--json", options.json, "Print JSON instead of a table");
    verify::Tolerances &tolerances = options.file.tolerances;
    addToleranceOptions(command, options.exact,
                        {&tolerances.value, &tolerances.subtexel, &tolerances.barycentric, &tolerances.interpolation},
                        1024);
    command.option_defaults()->group(kGeneral);
    command.add_flag("-q,--quiet", options.quiet, "Print only what is wrong, on stderr");
    addThreadsOption(command, options.file.threads);
}

VerifiedFile verifyFile(const std::filesystem::path &path, const VerifyOptions &options)
{
    VerifiedFile file;
    file.path = utf8Text(path);
    ProgressLine progress("verifying " + file.path);
    verify::FileOptions fileOptions = options.file;
    fileOptions.progress = [&](size_t done, size_t total) { progress.update(done, total); };
    try {
        withinMemory(path, [&] {
            const Document document = openDocument(path);
            file.report = verify::verifyDocument(document, fileOptions);
            if (file.report.findings.empty() && !file.report.stored.extension.empty())
                file.surface = StoredShares(file.report.stored).of(surfaceAreas(document));
            file.micromaps = summariesOf(file.report.stored.micromaps);
            file.extension = std::move(file.report.stored.extension);
            file.report.stored = {}; // several files are reported together
        });
    } catch (const GltfError &error) {
        file.error = error.what();
    }
    return file;
}

int verifyCommand(VerifyOptions &options)
{
    if (options.exact)
        options.file.tolerances = {0, 0, 0, 0};
    if (options.quiet && !options.json)
        discardReports();
    std::vector<VerifiedFile> files;
    auto code = ExitCode::Success;
    const std::vector<std::filesystem::path> paths = gltfFiles(options.files);
    std::map<ExitCode, size_t> counts = {{ExitCode::Success, 0}};
    for (const std::filesystem::path &path : paths) {
        VerifiedFile file = verifyFile(path, options);
        file.code = exitCodeOf(file, options.strict, options.requireMicromaps);
        code = worse(code, file.code);
        ++counts[file.code];
        if (!file.error.empty())
            std::fprintf(stderr, "vellum: %s\n", file.error.c_str());
        else if (options.quiet && file.code != ExitCode::Success)
            std::fprintf(stderr, "vellum: %s: %s\n", file.path.c_str(), reasonOf(file).c_str());
        if (options.json) {
            files.push_back(std::move(file));
        } else {
            printVerified(file, options.verbose);
            std::fflush(stdout);
        }
    }
    if (options.json)
        fmt::print("{}\n", verifiedJson(files));
    else if (paths.size() > 1)
        fmt::print("{}\n", summaryOf(counts, code));
    return static_cast<int>(code);
}

} // namespace

std::function<int()> declareVerifyCommand(CLI::App &app)
{
    const auto options = std::make_shared<VerifyOptions>();
    declareVerify(*app.add_subcommand("verify", "Checks the micromaps of glTF files against their textures"), *options);
    return [options] { return verifyCommand(*options); };
}

} // namespace vellum::cli
