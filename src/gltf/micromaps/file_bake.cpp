// SPDX-License-Identifier: Apache-2.0
#include "gltf/micromaps/file_bake.h"

#include <set>

#include "core/utf8_path.h"
#include "gltf/file/gltf_error.h"
#include "gltf/file/open_file.h"
#include "gltf/file/uri.h"
#include "gltf/micromaps/document_writer.h"

namespace vellum
{
namespace
{

bool isGltf(const std::filesystem::path &path)
{
    return suffixOf(path) == ".gltf";
}

// The first part of the name of the file of micromaps: `tree.omm` for `tree.gltf` and `tree.omm.gltf`.
std::string bufferStem(const std::filesystem::path &output)
{
    std::filesystem::path stem = output.stem();
    if (stem.extension() != ".omm")
        stem += ".omm";
    return utf8Text(stem);
}

void checkPaths(const Document &document, const std::filesystem::path &output)
{
    std::error_code error;
    if (std::filesystem::equivalent(document.path(), output, error))
        throw GltfError("the output is the input, which is never written");
    if (document.binary() && isGltf(output))
        throw GltfError("it is a GLB, and " + utf8Text(output) + " would be a .gltf");
    if (!document.binary() && !isGltf(output))
        throw GltfError("it is a .gltf file, and " + utf8Text(output) + " would not be");
}

// The output comes last: as long as it is unchanged, so is all that belongs to it. Returns FileBake::files.
std::vector<std::pair<std::filesystem::path, uint64_t>> writeFiles(const Document &document,
                                                                   const std::filesystem::path &output,
                                                                   const RewrittenFile &rewritten,
                                                                   const FileBakeOptions &options)
{
    const FilesBeside beside = filesBeside(document.root(), document.path(), output);
    std::vector<std::pair<std::filesystem::path, uint64_t>> written;
    OutputFiles files(options.bake.cancelled);
    for (const FilesBeside::Copy &copy : beside.copies) {
        files.copy(copy.from, copy.to, document.path(), options.replaceCopies);
        written.emplace_back(copy.to, std::filesystem::file_size(copy.from));
    }
    if (rewritten.buffer.size() != 0) {
        written.emplace_back(folderOf(output) / utf8Path(rewritten.bufferName), rewritten.buffer.size());
        files.writeOnce(written.back().first, rewritten.buffer);
    }
    written.emplace_back(output, rewritten.file.size());
    files.write(output, rewritten.file);
    files.publish();
    return written;
}

} // namespace

FilesBeside filesBeside(const JsonValue &root, const std::filesystem::path &input, const std::filesystem::path &output)
{
    const std::filesystem::path from = folderOf(input);
    const std::filesystem::path to = folderOf(output);
    FilesBeside files;
    std::error_code error;
    const bool sameFolder = std::filesystem::equivalent(from, to, error);
    std::set<std::filesystem::path> seen;
    for (const std::filesystem::path &name : namedFiles(root)) {
        const std::filesystem::path normal = name.lexically_normal();
        if (!seen.insert(normal).second || (sameFolder && leadsOut(normal))) // that is not read, and not copied
            continue;
        if (!std::filesystem::is_regular_file(from / normal, error))
            continue;
        files.read.push_back(from / normal);
        if (std::filesystem::equivalent(files.read.back(), output, error))
            throw GltfError("the output is the file " + utf8Text(name) + ", which it names");
        if (sameFolder)
            continue;
        if (leadsOut(normal))
            throw GltfError("it names the file " + utf8Text(name) +
                            ", which is not in its folder or below it, so that " + utf8Text(output) +
                            " cannot have a copy");
        try {
            InputFile(files.read.back()).requireBeside(input);
        } catch (const GltfError &failure) {
            throw GltfError("it names the file " + utf8Text(name) + ", which cannot be copied: " + failure.what());
        }
        files.copies.push_back({from / normal, to / normal});
    }
    return files;
}

FileBake bakeFile(const std::filesystem::path &input, const std::filesystem::path &output,
                  const FileBakeOptions &options)
{
    return bakeFile(Document(input), output, options);
}

FileBake bakeFile(const Document &document, const std::filesystem::path &output, const FileBakeOptions &options)
{
    return document.named([&] {
        if (!options.sink)
            checkPaths(document, output);
        FileBake result;
        result.inputBytes = document.fileBytes();
        result.replaced = hasMicromaps(document);
        result.replacedLoss = lossOfMicromaps(document).value_or("");
        const bool weighs = options.bake.budget || options.targetKnown;
        const SurfaceAreas areas = options.measure || weighs ? surfaceAreas(document) : SurfaceAreas();
        result.bake = bakeDocument(document, options, &areas);
        if (options.measure) {
            const StoredMicromaps stored = storedOf(result.bake);
            result.surface = StoredShares(stored).of(areas);
        }
        const RewrittenFile rewritten = withMicromaps(
            document, result.bake, document.binary() || options.embed ? "" : bufferStem(output), options.mark);
        std::error_code error;
        if ((options.requireMicromaps && result.bake.primitives.empty()) ||
            (options.skipUnchanged && !rewritten.changed && !std::filesystem::exists(output, error)))
            return result;
        result.written = true;
        result.outputBytes = rewritten.file.size() + rewritten.buffer.size();
        if (options.dryRun)
            return result;
        if (options.bake.cancelled && options.bake.cancelled()) // since the last triangle
            throw BakeCancelled();
        if (options.sink)
            options.sink(rewritten.file);
        else
            result.files = writeFiles(document, output, rewritten, options);
        return result;
    });
}

} // namespace vellum
