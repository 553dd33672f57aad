// SPDX-License-Identifier: Apache-2.0
#include "job/log.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <functional>
#include <string_view>

#include "base/error.h"
#include "base/json_reader.h"
#include "base/json_writer.h"
#include "base/text.h"
#include "core/utf8_path.h"

namespace vellum::job
{
namespace
{

// No string of a line has it: in strings, quotes are escaped.
constexpr std::string_view kLineStart = R"({"input":")";

// Calls take(line) for each line of a log, without what is cut off in front of it where logs were merged, until it
// returns false. Throws Error if the file cannot be read or is not a log.
void forEachLine(const std::filesystem::path &path, const std::function<bool(const std::string &)> &take)
{
    std::error_code error;
    std::ifstream file(path, std::ios::binary);
    if (!file || std::filesystem::is_directory(path, error))
        throw Error(utf8Text(path) + " cannot be read");
    bool isLog = false;
    for (std::string line; std::getline(file, line);) {
        const size_t start = line.rfind(kLineStart);
        isLog = isLog || start != std::string::npos;
        if (!isLog && !kLineStart.starts_with(line))
            throw Error(utf8Text(path) + " is not a log of vellum bake");
        if (start != std::string::npos && !take(line.substr(start)))
            return;
    }
}

// Checks that a file, if there is one, is a log. Returns whether its last line is cut off.
bool checkLog(const std::filesystem::path &path)
{
    std::error_code error;
    if (!std::filesystem::exists(path, error))
        return false;
    if (!std::filesystem::is_regular_file(path, error))
        throw Error(utf8Text(path) + " cannot be a log: it is not a file");
    forEachLine(path, [](const std::string &) { return false; });
    std::ifstream file(path, std::ios::binary);
    return file.seekg(-1, std::ios::end) && file.get() != '\n';
}

// In UTC, so that texts are ordered like times.
std::string now()
{
    const auto time = std::chrono::floor<std::chrono::milliseconds>(std::chrono::system_clock::now());
    const auto day = std::chrono::floor<std::chrono::days>(time);
    const std::chrono::year_month_day date(day);
    const std::chrono::hh_mm_ss clock(time - day);
    std::array<char, 32> text{};
    std::snprintf(text.data(), text.size(), "%04d-%02u-%02uT%02d:%02d:%02d.%03dZ", static_cast<int>(date.year()),
                  static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()),
                  static_cast<int>(clock.hours().count()), static_cast<int>(clock.minutes().count()),
                  static_cast<int>(clock.seconds().count()), static_cast<int>(clock.subseconds().count()));
    return text.data();
}

constexpr std::string_view kEscape = "\xef\xbf\xbd"; // U+FFFD
constexpr std::string_view kDigits = "0123456789abcdef";

// A location as logs have it. A byte that is not UTF-8 becomes U+FFFD and its hexadecimal digits, and so do the bytes
// of a U+FFFD.
std::string nameOf(const std::filesystem::path &path)
{
    const std::string text = utf8Text(locationOf(path));
    std::string name;
    for (std::string_view rest = text; !rest.empty();) {
        const size_t length = rest.starts_with(kEscape) ? 0 : utf8Sequence(rest);
        const auto byte = static_cast<uint8_t>(rest[0]);
        name += length == 0 ? std::string(kEscape) + kDigits[byte >> 4] + kDigits[byte & 15]
                            : std::string(rest.substr(0, length));
        rest.remove_prefix(std::max<size_t>(length, 1));
    }
    return name;
}

// The location of such a name. Throws Error.
std::filesystem::path locationNamed(const std::string &name)
{
    std::string text;
    for (size_t at = 0; at < name.size();) {
        if (name.compare(at, kEscape.size(), kEscape) != 0) {
            text += name[at++];
            continue;
        }
        const auto byte = parseHexadecimal("0x" + name.substr(at + kEscape.size(), 2));
        if (!byte)
            throw Error("no name of a file");
        text += static_cast<char>(*byte);
        at += kEscape.size() + 2;
    }
    return utf8Path(text);
}

} // namespace

Log::Log(const std::filesystem::path &path) : inLine_(checkLog(path)), file_(path) {}

void Log::add(const LogLine &line)
{
    uint64_t outputBytes = 0;
    for (const auto &[path, bytes] : line.files)
        outputBytes += bytes;
    JsonWriter json(JsonStyle::Compact);
    json.beginObject().member("input", nameOf(line.input)).member("output", nameOf(line.output));
    json.member("time", now()).member("status", line.status).member("options", line.options);
    json.member("bytes", line.bytes).member("outputBytes", outputBytes);
    json.list("files", line.files, [&](const auto &file) {
        json.beginObject().member("file", nameOf(file.first)).member("bytes", file.second).end();
    });
    json.member("milliseconds", line.milliseconds).member("message", line.message).end();
    const std::lock_guard lock(adding_);
    const bool afterCut = std::exchange(inLine_, true);
    file_.append((afterCut ? "\n" : "") + json.text() + "\n");
    inLine_ = false;
}

void DoneFiles::add(const std::filesystem::path &log)
{
    forEachLine(log, [&](const std::string &line) {
        try {
            const JsonReader json(line);
            State state{.time = json.text("time"),
                        .options = json.textOr("options"),
                        .bytes = json.number("bytes"),
                        .done = json.text("status") != kFailed,
                        .written = {}};
            json.forEach("files", [&](const rapidjson::Value &file) {
                state.written.emplace_back(locationNamed(JsonReader::textOf(file, "file")),
                                           JsonReader::numberOf(file, "bytes"));
            });
            State &known = files_[{locationNamed(json.text("input")), locationNamed(json.text("output"))}];
            if (known.time <= state.time)
                known = std::move(state);
        } catch (const Error &) {
            // cut off
        }
        return true;
    });
}

bool DoneFiles::NamesOrder::operator()(const Names &a, const Names &b) const
{
    const LocationOrder before;
    return before(a.first, b.first) || (!before(b.first, a.first) && before(a.second, b.second));
}

const DoneFiles::State *DoneFiles::find(const std::filesystem::path &input, const std::filesystem::path &output) const
{
    const auto file = files_.find({locationOf(input), locationOf(output)});
    return file == files_.end() ? nullptr : &file->second;
}

bool DoneFiles::names(const std::filesystem::path &input, const std::filesystem::path &output) const
{
    return find(input, output) != nullptr;
}

bool DoneFiles::isDone(const std::filesystem::path &input, const State &state)
{
    const auto hasSize = [](const std::filesystem::path &file, uint64_t bytes) {
        std::error_code error;
        return std::filesystem::file_size(file, error) == bytes && !error;
    };
    return state.done && hasSize(input, state.bytes) &&
           std::all_of(state.written.begin(), state.written.end(),
                       [&](const auto &file) { return hasSize(file.first, file.second); });
}

bool DoneFiles::contains(const std::filesystem::path &input, const std::filesystem::path &output) const
{
    const State *const state = find(input, output);
    return state != nullptr && state->options == options_ && isDone(input, *state);
}

bool DoneFiles::hasOtherOptions(const std::filesystem::path &input, const std::filesystem::path &output) const
{
    const State *const state = find(input, output);
    return state != nullptr && state->options != options_ && isDone(input, *state);
}

} // namespace vellum::job
