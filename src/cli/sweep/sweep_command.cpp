// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fmt/format.h>
#include <map>
#include <memory>
#include <mutex>

#include "base/error.h"
#include "base/process.h"
#include "base/progress.h"
#include "base/text.h"
#include "cli/bake/bake.h"
#include "cli/base/exit_code.h"
#include "cli/base/files.h"
#include "cli/options/commands.h"
#include "cli/options/options.h"
#include "cli/sweep/sweep.h"
#include "core/parallel.h"
#include "core/utf8_path.h"
#include "gltf/file/gltf_error.h"
#include "inspect/report_parts.h"

namespace vellum::cli
{
namespace
{

constexpr const char *kSweepDetails = R"(
Shows what vellum bake would make of files with many settings, and writes none of them: automatic levels and each level up to
--max-level in 4 and in 2 states, and budgets from 1K on until they change nothing. For each there are the bytes of
micromaps, the share of the alpha-tested surface that is known, the bytes for each further percentage point, and the
expected shader calls. One setting is recommended, with the reason.

Of several files, bytes are added up, and the share is the mean of all files. A budget is that of each file. Each texture is
decoded once, each triangle is classified once for each level and twice for all budgets.

The page (.html) has the table and a chart, a .svg the chart alone. An existing file is replaced only if vellum wrote it, or
with --force.

Examples:
  vellum sweep tree.glb
      the table and the recommendation
  vellum sweep models/ -o sweep.html
      all .glb and .gltf files in models/, as a page
  vellum sweep tree.glb --max-level 12 --json
      finer levels than auto chooses by default
)";

SweptFile sweepFile(const std::filesystem::path &path, const DocumentBakeOptions &options,
                    UnmatchedExclusions &exclusions)
{
    SweptFile file;
    file.path = utf8Text(path);
    try {
        const Document document = openDocument(path);
        exclusions.note(document);
        file.result = sweepDocument(document, options);
        return file;
    } catch (const GltfError &error) {
        file.error = error.what();
    } catch (const std::bad_alloc &) {
        file.error = file.path + ": out of memory";
    } catch (const std::exception &error) {
        file.error = file.path + ": " + error.what();
    }
    exclusions.noteUnread();
    return file;
}

Sweep sweepFiles(const SweepOptions &options)
{
    Sweep sweep;
    const std::vector<std::filesystem::path> paths = gltfFiles(options.inputs);
    UnmatchedExclusions exclusions(options.bake);
    sweep.files.resize(paths.size());
    ProgressLine progress("sweeping");
    std::mutex updating;
    std::vector<double> done(paths.size());
    double all = 0;
    const auto update = [&](size_t file, double share) {
        const std::lock_guard lock(updating);
        all += share - done[file];
        done[file] = share;
        progress.update(static_cast<size_t>(1000 * all / static_cast<double>(done.size())), 1000);
    };
    const unsigned threads = threadCount(options.threads);
    DecodedImages images;
    inParallel(threads, paths.size(), [&](size_t i) {
        DocumentBakeOptions bake = options.bake;
        bake.images = &images;
        bake.bake.threads = std::max(1u, threads / static_cast<unsigned>(std::min<size_t>(threads, paths.size())));
        bake.bake.progress = [&](size_t n, size_t total) {
            update(i, static_cast<double>(n) / static_cast<double>(std::max<size_t>(total, 1)));
        };
        sweep.files[i] = sweepFile(paths[i], bake, exclusions);
        update(i, 1);
    });
    std::vector<const DocumentOutlines *> bakeable;
    for (const SweptFile &file : sweep.files)
        if (!file.result.outlines.empty())
            bakeable.push_back(&file.result);
    sweep.bakeable = bakeable.size();
    sweep.rows = rowsOf(bakeable);
    sweep.recommendation = recommend(sweep.rows, options.given);
    exclusions.print();
    return sweep;
}

void declareSweep(CLI::App &command, SweepOptions &options)
{
    command.footer(kSweepDetails);
    command.option_defaults()->group(kInput);
    command.add_option("IN", options.inputs, "glTF files (.glb, .gltf) or folders of them")
        ->type_name("IN...")
        ->required();
    command.option_defaults()->group(kOutput);
    command
        .add_option("-o,--output", options.output, "The page (.html) or the chart (.svg) to write, or - for the page")
        ->type_name("OUT");
    command.add_flag("--force", options.force, "Replace existing files, whoever wrote them");
    command.add_flag("--json", options.json, "Print the table as JSON, also for each file");
    command.option_defaults()->group(kGeneral);
    command.add_flag("-q,--quiet", options.quiet, "Print errors only");
    addThreadsOption(command, options.threads);
}

} // namespace

std::string exclusionsText(const Sweep &sweep)
{
    double without = 0;
    size_t count = 0;
    std::map<std::string, size_t> reasons;
    for (const SweptFile &file : sweep.files) {
        without += file.result.withoutMicromap / static_cast<double>(std::max<size_t>(sweep.bakeable, 1));
        for (const SkippedPrimitive &skipped : file.result.skipped) {
            ++count;
            ++reasons[reasonFor(skipped)];
        }
    }
    std::string text;
    if (without > 1e-9)
        text = percent(without) + " of the alpha-tested surface gets no micromap";
    if (count == 0)
        return text;
    text += text.empty() ? "" : ": ";
    text += counted(count, "alpha-tested primitive") + " skipped (";
    for (const auto &[reason, times] : reasons)
        text += (text.ends_with('(') ? "" : ", ") + reason + (reasons.size() > 1 ? fmt::format(": {}", times) : "");
    return text + ")";
}

std::vector<std::array<std::string, 6>> tableOf(const Sweep &sweep)
{
    std::vector<std::array<std::string, 6>> table = {
        {"options", "bytes", "surface known", "approximate", "bytes per further %", "shader calls"}};
    for (const SweepRow &row : sweep.rows)
        table.push_back(
            {row.options(), row.tooLarge ? "too large" : grouped(row.bytes), percent(row.proven),
             row.setting.format == Format::TwoState ? percent(row.approximate()) : "-",
             row.bytesPerPercent ? grouped(static_cast<uint64_t>(std::max(0.0, *row.bytesPerPercent))) : "-",
             grouped(static_cast<uint64_t>(std::lround(row.shaderCalls())))});
    return table;
}

void printSweep(const Sweep &sweep)
{
    fmt::print("{}\n", sweep.bakeable == 1 && sweep.files.size() == 1
                           ? sweep.files[0].path
                           : counted(sweep.bakeable, "file") + ": bytes of all, mean share of the surface");
    std::vector<std::vector<std::string>> table;
    for (const auto &cells : tableOf(sweep)) {
        table.emplace_back(cells.begin(), cells.end());
        table.back().push_back(table.size() == 1 ? "levels" : levelsText(sweep.rows[table.size() - 2].levels));
    }
    fmt::print("{}", alignedRows(table, 1, "  "));
    if (sweep.recommendation)
        fmt::print("recommended: {}: {}\n", sweep.recommendation->options, sweep.recommendation->reason);
    fmt::print("{}\n", kBytesText);
    fmt::print("{}\n", kApproximateText);
    fmt::print("{}\n", kShaderCallsText);
    if (const std::string text = exclusionsText(sweep); !text.empty())
        fmt::print("{}\n", text);
}

void printSweepJson(const Sweep &sweep, const SweepOptions &options)
{
    JsonWriter json;
    beginReport(json, "sweep");
    json.key("outputs").beginArray();
    if (options.output)
        json.value(utf8Text(*options.output));
    json.end();
    json.list("files", sweep.files, [&](const SweptFile &file) {
        json.beginObject().member("file", file.path);
        if (!file.error.empty()) {
            json.member("error", file.error).end();
            return;
        }
        json.member("measured", file.result.measured).member("withoutMicromap", file.result.withoutMicromap);
        json.list("rows", rowsOf({&file.result}), [&](const SweepRow &row) { write(row, json); });
        writeSkipped(file.result.skipped, json);
        json.end();
    });
    json.list("rows", sweep.rows, [&](const SweepRow &row) { write(row, json); });
    json.key("recommendation");
    if (sweep.recommendation)
        json.beginObject()
            .member("options", sweep.recommendation->options)
            .member("reason", sweep.recommendation->reason)
            .end();
    else
        json.null();
    fmt::print("{}\n", json.end().text());
}

int sweepCommand(const SweepOptions &options)
{
    std::optional<DataOutput> data;
    if (options.output && isStandardStream(*options.output))
        data.emplace(DataOutput::Reports::ToStderr);
    if (options.quiet && !options.json)
        discardReports();
    const Sweep sweep = sweepFiles(options);
    auto code = ExitCode::Success;
    for (const SweptFile &file : sweep.files)
        if (!file.error.empty()) {
            std::fprintf(stderr, "vellum: %s\n", file.error.c_str());
            code = ExitCode::Failed;
        }
    if (sweep.rows.empty() && code == ExitCode::Success) {
        const std::string text = exclusionsText(sweep);
        throw Error("no primitive gets a micromap" + (text.empty() ? "" : ": " + text));
    }
    if (options.output && !sweep.rows.empty())
        writeData(*options.output, suffixOf(*options.output) == ".svg" ? sweepChart(sweep) : sweepPage(sweep), data);
    if (options.json)
        printSweepJson(sweep, options);
    else if (!sweep.rows.empty())
        printSweep(sweep);
    if (options.output && !options.json && !sweep.rows.empty() && !isStandardStream(*options.output))
        fmt::print("wrote {}\n", utf8Text(*options.output));
    return static_cast<int>(code);
}

std::function<int()> declareSweepCommand(CLI::App &app)
{
    const auto options = std::make_shared<SweepOptions>();
    CLI::App &command = *app.add_subcommand("sweep", "Compares what settings of bake would make of glTF files");
    declareSweep(command, *options);
    const auto own = static_cast<ptrdiff_t>(command.get_options().size());
    const std::function<void()> finish = declareBaking(command, options->bake);
    for (const char *varied : {"--level", "--states", "--budget", "--target-known"})
        command.remove_option(command.get_option(varied));
    std::vector<CLI::Option *> baking = command.get_options();
    baking.erase(baking.begin(), baking.begin() + own);
    return [options, finish, baking] {
        finish();
        for (const CLI::Option *option : baking)
            for (const std::string &value : option->results())
                options->given +=
                    " " + option->get_name() + (option->get_expected_max() == 0 ? "" : " " + shellWord(value));
        if (options->json && options->output == "-")
            throw UsageError("--json and an output to stdout exclude each other");
        if (options->output) {
            checkSuffix(*options->output, {".html", ".htm", ".svg"});
            checkWritable(*options->output, options->force);
        }
        return sweepCommand(*options);
    };
}

} // namespace vellum::cli
