#include <algorithm>
#include <map>
#include <optional>
#include <sys/stat.h>

#include "cli/bake_command.h"
#include "cli/base/error.h"
#include "gltf/file/container.h"
#include "gltf/file/gltf_error.h"
#include "gltf/file/output_files.h"

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

// One name for a place in the file system, whichever way leads there. A link in that place is what is replaced there.
fs::path placeOf(const fs::path &path)
{
    std::error_code error;
    const fs::path whole = fs::absolute(path).lexically_normal();
    return fs::weakly_canonical(whole.parent_path(), error) / whole.filename();
}

void checkDistinct(const std::vector<BakeJob> &jobs)
{
    std::map<fs::path, fs::path> inputOf;
    for (const BakeJob &job : jobs) {
        const auto [found, isNew] = inputOf.try_emplace(placeOf(job.output), job.input);
        if (!isNew)
            throw Error(found->second.string() + " and " + job.input.string() + " would both be written to " +
                        job.output.string());
    }
}

// What there is to know of the jobs before the first one is baked, so that it does not matter which is quicker.
class Conflicts
{
public:
    explicit Conflicts(const std::vector<BakeJob> &jobs);
    // Why this job, the next one in order, cannot be baked; empty where it can.
    std::string refusalOf(size_t number);

private:
    using FileId = std::pair<dev_t, ino_t>;
    static std::optional<FileId> idOf(const fs::path &path);
    void addRead(const fs::path &path, const fs::path &input);

    const std::vector<BakeJob> &jobs_;
    std::vector<FilesBeside> beside_;
    std::vector<std::string> refusals_;
    std::map<FileId, fs::path> reads_; // what is read, and the input that it is or that names it
    struct Write {
        fs::path input;
        fs::path copied; // the file that is copied; empty for an output
    };
    std::map<fs::path, Write> writes_;
};

std::optional<Conflicts::FileId> Conflicts::idOf(const fs::path &path)
{
    struct stat status {
    };
    if (stat(path.c_str(), &status) != 0)
        return std::nullopt;
    return FileId{status.st_dev, status.st_ino};
}

void Conflicts::addRead(const fs::path &path, const fs::path &input)
{
    if (const auto id = idOf(path))
        reads_.try_emplace(*id, input);
}

Conflicts::Conflicts(const std::vector<BakeJob> &jobs) : jobs_(jobs), beside_(jobs.size()), refusals_(jobs.size())
{
    for (const BakeJob &job : jobs)
        addRead(job.input, job.input);
    for (size_t i = 0; i < jobs.size(); ++i) {
        std::optional<Container> container;
        try {
            container = readContainer(jobs[i].input);
        } catch (const GltfError &) {
            continue; // whoever bakes it says so
        }
        try {
            const JsonTree tree(container->json());
            beside_[i] = filesBeside(tree.root(), jobs[i].input, jobs[i].output);
        } catch (const GltfError &error) {
            refusals_[i] = error.what();
        }
        for (const fs::path &file : beside_[i].read)
            addRead(file, jobs[i].input);
    }
}

std::string Conflicts::refusalOf(size_t number)
{
    const BakeJob &job = jobs_[number];
    if (!refusals_[number].empty())
        return refusals_[number];
    if (const auto id = idOf(job.output))
        if (const auto read = reads_.find(*id); read != reads_.end() && read->second != job.input)
            return "the output " + job.output.string() + " is read for " + read->second.string();
    std::map<fs::path, Write> writes = {{placeOf(job.output), {job.input, {}}}};
    for (const FilesBeside::Copy &copy : beside_[number].copies)
        writes.try_emplace(placeOf(copy.to), Write{job.input, copy.from});
    for (const auto &[place, write] : writes) {
        const auto other = writes_.find(place);
        std::error_code error;
        if (other != writes_.end() &&
            (write.copied.empty() || other->second.copied.empty() || !sameBytes(write.copied, other->second.copied)))
            return place.string() + " would be another file for " + other->second.input.string();
        if (other == writes_.end() && !write.copied.empty() && fs::exists(place, error) &&
            !sameBytes(write.copied, place))
            return place.string() + ": is there already and differs from " + write.copied.string();
    }
    writes_.merge(writes);
    return "";
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
    const fs::path output = toFolder ? fs::weakly_canonical(*options.output, ignored) : fs::path();
    std::vector<BakeJob> jobs;
    for (const fs::path &input : options.inputs) {
        if (fs::is_directory(input, ignored)) {
            // What was baked into the folder is not baked again. One that is its own output is refused file by file.
            const fs::path folder = fs::weakly_canonical(input, ignored);
            const bool within = output != folder && isInside(output, folder);
            for (const fs::path &file : findFiles(input, within ? output : fs::path()))
                jobs.push_back({file, *options.output / file.lexically_relative(input), {}});
        } else {
            jobs.push_back({input,
                            toFolder         ? *options.output / input.filename()
                            : options.output ? *options.output
                                             : besideInput(input),
                            {}});
        }
    }
    if (jobs.empty())
        throw Error("there are no .glb or .gltf files in " + options.inputs.front().string());
    checkDistinct(jobs);
    Conflicts conflicts(jobs);
    for (size_t i = 0; i < jobs.size(); ++i)
        jobs[i].refusal = conflicts.refusalOf(i);
    return jobs;
}

} // namespace vellum::cli
