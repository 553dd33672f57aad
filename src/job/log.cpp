// SPDX-License-Identifier: Apache-2.0
#include "job/log.h"

#include <algorithm>
#include <fstream>
#include <string_view>

#include "base/error.h"
#include "base/json_reader.h"
#include "base/json_writer.h"
#include "core/utf8_path.h"

namespace vellum::job
{
namespace
{

// No string of a line has it: in strings, quotes are escaped.
constexpr std::string_view kLineStart = R"({"input":")";

// Checks that a file, if there is one, is a log. Returns whether its last line is cut off.
bool checkLog(const std::filesystem::path &path)
{
    std::error_code error;
    if (!std::filesystem::exists(path, error))
        return false;
    if (!std::filesystem::is_regular_file(path, error))
        throw Error(utf8Text(path) + " cannot be a log: it is not a file");
    std::ifstream file(path, std::ios::binary);
    std::string start(kLineStart.size(), '\0');
    file.read(start.data(), static_cast<std::streamsize>(start.size()));
    start.resize(static_cast<size_t>(file.gcount()));
    if (!kLineStart.starts_with(start))
        throw Error(utf8Text(path) + " exists and is not a log of vellum bake");
    file.clear();
    return !start.empty() && file.seekg(-1, std::ios::end) && file.get() != '\n';
}

} // namespace

Log::Log(const std::filesystem::path &path) : inLine_(checkLog(path)), file_(path) {}

void Log::add(const LogLine &line)
{
    JsonWriter json(JsonStyle::Compact);
    json.beginObject().member("input", utf8Text(line.input)).member("output", utf8Text(line.output));
    json.member("status", line.status).member("bytes", line.bytes).member("outputBytes", line.outputBytes);
    json.member("milliseconds", line.milliseconds).member("message", line.message).end();
    const std::lock_guard lock(adding_);
    const bool afterCut = std::exchange(inLine_, true);
    file_.append((afterCut ? "\n" : "") + json.text() + "\n");
    inLine_ = false;
}

void DoneFiles::add(const std::filesystem::path &log)
{
    std::error_code error;
    std::ifstream file(log, std::ios::binary);
    if (!file || std::filesystem::is_directory(log, error))
        throw Error(utf8Text(log) + " cannot be read");
    for (std::string line; std::getline(file, line);) {
        // One that is cut off can stand in front, where logs were merged.
        const size_t start = line.rfind(kLineStart);
        if (start == std::string::npos)
            continue;
        try {
            const JsonReader json(line.substr(start));
            const std::string status = json.text("status");
            std::pair names(json.text("input"), json.text("output"));
            if (status == kBaked || status == kUnchanged || status == kSkipped)
                files_[std::move(names)] = json.json("outputBytes") != "0";
            else
                files_.erase(names);
        } catch (const Error &) {
            continue; // cut off
        }
    }
}

bool DoneFiles::contains(const std::filesystem::path &input, const std::filesystem::path &output) const
{
    const auto file = files_.find({utf8Text(input), utf8Text(output)});
    std::error_code error;
    return file != files_.end() && (!file->second || std::filesystem::exists(output, error));
}

} // namespace vellum::job
