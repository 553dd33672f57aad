#include <algorithm>
#include <map>

#include "cli/bake_command.h"
#include "cli/base/error.h"

namespace vellum::cli
{
namespace
{

namespace fs = std::filesystem;

std::string lowerExtension(const fs::path &path)
{
    std::string extension = path.extension().string();
    std::transform(extension.begin(), extension.end(), extension.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return extension;
}

bool isInside(const fs::path &path, const fs::path &folder)
{
    const fs::path relative = path.lexically_relative(folder);
    return !relative.empty() && *relative.begin() != "..";
}

// The glTF files in a folder and in all folders in it, but for those in `except`.
std::vector<fs::path> findFiles(const fs::path &folder, const fs::path &except)
{
    std::vector<fs::path> found;
    std::error_code error;
    fs::recursive_directory_iterator entry(folder, fs::directory_options::skip_permission_denied, error);
    for (; !error && entry != fs::recursive_directory_iterator(); entry.increment(error)) {
        const std::string extension = lowerExtension(entry->path());
        std::error_code unreadable;
        if ((extension == ".glb" || extension == ".gltf") && entry->is_regular_file(unreadable) &&
            !isInside(fs::weakly_canonical(entry->path(), unreadable), except))
            found.push_back(entry->path());
    }
    if (error)
        throw Error(folder.string() + " cannot be searched: " + error.message());
    std::sort(found.begin(), found.end());
    return found;
}

fs::path besideInput(const fs::path &input)
{
    fs::path output = input;
    return output.replace_filename(input.stem().string() + ".omm" + input.extension().string());
}

void checkDistinct(const std::vector<BakeJob> &jobs)
{
    std::map<fs::path, fs::path> inputOf;
    const auto claim = [&](const fs::path &output, const fs::path &input) {
        const auto [found, isNew] = inputOf.try_emplace(fs::absolute(output).lexically_normal(), input);
        if (!isNew)
            throw Error(found->second.string() + " and " + input.string() + " would both be written to " +
                        output.string());
    };
    for (const BakeJob &job : jobs) {
        claim(job.output, job.input);
        if (lowerExtension(job.output) == ".gltf")
            claim(bufferPath(job.output), job.input);
    }
}

} // namespace

std::vector<BakeJob> planBake(const BakeCommandOptions &options)
{
    std::error_code ignored;
    const bool anyFolder = std::any_of(options.inputs.begin(), options.inputs.end(),
                                       [&](const fs::path &input) { return fs::is_directory(input, ignored); });
    const bool several = options.inputs.size() > 1 || anyFolder;
    if (several && !options.output)
        throw Error("several files need a folder to be written to: --output FOLDER");
    const bool toFolder =
        options.output && (several || !options.output->has_filename() || fs::is_directory(*options.output, ignored));
    if (toFolder && fs::exists(*options.output, ignored) && !fs::is_directory(*options.output, ignored))
        throw Error(options.output->string() + " is a file, and several inputs need a folder");
    const fs::path except = toFolder ? fs::weakly_canonical(*options.output, ignored) : fs::path();
    std::vector<BakeJob> jobs;
    for (const fs::path &input : options.inputs) {
        if (fs::is_directory(input, ignored)) {
            // A folder that is its own output is refused file by file.
            const bool own = fs::equivalent(input, *options.output, ignored);
            for (const fs::path &file : findFiles(input, own ? fs::path() : except))
                jobs.push_back({file, *options.output / file.lexically_relative(input)});
        } else {
            jobs.push_back({input, toFolder         ? *options.output / input.filename()
                                   : options.output ? *options.output
                                                    : besideInput(input)});
        }
    }
    if (jobs.empty())
        throw Error("there are no .glb or .gltf files in " + options.inputs.front().string());
    checkDistinct(jobs);
    return jobs;
}

} // namespace vellum::cli
