// SPDX-License-Identifier: Apache-2.0
#include "job/depfile.h"

#include "base/error.h"
#include "base/text.h"
#include "core/utf8_path.h"

namespace vellum::job
{
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
