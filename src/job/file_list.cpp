// SPDX-License-Identifier: Apache-2.0
#include "job/file_list.h"

#include <string_view>
#include <system_error>

#include "base/error.h"
#include "base/text.h"
#include "core/utf8_path.h"

namespace vellum::job
{
namespace
{

// Throws std::system_error where a path of this system cannot be made of it.
ListedFile parseLine(std::string_view line)
{
    if (line.find('\0') != std::string_view::npos)
        throw UsageError("it has a zero byte; the list must be UTF-8");
    const size_t tab = line.find('\t');
    const std::string_view input = line.substr(0, tab);
    const std::string_view output = tab == std::string_view::npos ? std::string_view() : line.substr(tab + 1);
    if (input.empty())
        throw UsageError("it has no input in front of the tab");
    if (output.find('\t') != std::string_view::npos)
        throw UsageError("it has more than one tab; expected INPUT or INPUT<TAB>OUTPUT");
    ListedFile file{.line = 0, .input = utf8Path(input), .output = {}};
    if (!output.empty())
        file.output = utf8Path(output);
    return file;
}

} // namespace

std::string lineError(const std::string &name, size_t line, const std::string &what)
{
    return name + ": line " + std::to_string(line) + ": " + what;
}

std::vector<ListedFile> parseFileList(const std::string &text, const std::string &name)
{
    constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";
    std::vector<ListedFile> files;
    std::string_view rest = text;
    if (rest.starts_with(kByteOrderMark))
        rest.remove_prefix(kByteOrderMark.size());
    for (size_t number = 1; !rest.empty(); ++number) {
        const size_t end = rest.find('\n');
        std::string_view line = rest.substr(0, end);
        rest.remove_prefix(end == std::string_view::npos ? rest.size() : end + 1);
        if (line.ends_with('\r'))
            line.remove_suffix(1);
        if (line.empty())
            continue;
        try {
            files.push_back(parseLine(line));
            files.back().line = number;
        } catch (const UsageError &error) {
            throw UsageError(lineError(name, number, error.what()));
        } catch (const std::system_error &) {
            throw UsageError(lineError(name, number, "it is not UTF-8"));
        }
    }
    return files;
}

namespace
{

[[noreturn]] void reject(const std::filesystem::path &path, const char *why)
{
    throw Error("a depfile cannot name " + printable(utf8Text(path)) + ", which " + why);
}

std::string escaped(const std::filesystem::path &path)
{
    std::string text;
    size_t backslashes = 0; // at the end of `text`
    const std::string drive = utf8Text(path.root_name());
    for (const char c : utf8Text(path)) {
        if (c == '\n' || c == '\r')
            reject(path, "has a line break");
        if (c == ' ' || c == '\t') // backslashes before it are doubled, others are not
            text.append(backslashes + 1, '\\');
        else if (c == '#' || (c == ':' && text.size() >= drive.size()))
            text += '\\';
        else if (c == '$')
            text += '$';
        backslashes = c == '\\' ? backslashes + 1 : 0;
        text += c;
    }
    return text;
}

} // namespace

// Make takes `a=b: c` and `c: a=b` as assignments, but not `c: d a=b`.
std::string depfileRule(const std::filesystem::path &output, const std::vector<std::filesystem::path> &dependencies)
{
    const auto has = [](const std::filesystem::path &path, char c) {
        return utf8Text(path).find(c) != std::string::npos;
    };
    if (has(output, '%'))
        reject(output, "Make would take as a pattern");
    if (has(output, '='))
        reject(output, "Make would take as an assignment");
    if (!dependencies.empty() && has(dependencies.front(), '='))
        reject(dependencies.front(), "Make would take as an assignment");
    std::string rule = escaped(output) + ":";
    std::string others;
    for (const std::filesystem::path &dependency : dependencies) {
        rule += " \\\n  " + escaped(dependency);
        if (!has(dependency, '='))
            others += escaped(dependency) + ":\n";
    }
    return rule + "\n" + others;
}

} // namespace vellum::job
