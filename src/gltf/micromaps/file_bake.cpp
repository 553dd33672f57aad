#include "gltf/micromaps/file_bake.h"

#include <algorithm>
#include <set>

#include "gltf/file/gltf_error.h"
#include "gltf/file/output_files.h"
#include "gltf/file/relative_uri.h"
#include "gltf/micromaps/document_writer.h"

namespace vellum
{
namespace
{

std::filesystem::path folderOf(const std::filesystem::path &path)
{
    return path.has_parent_path() ? path.parent_path() : ".";
}

bool isGltf(const std::filesystem::path &path)
{
    std::string extension = path.extension().string();
    std::transform(extension.begin(), extension.end(), extension.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return extension == ".gltf";
}

// A name for the file of micromaps that no other file of the document has.
std::string bufferName(const std::filesystem::path &output, const std::vector<std::filesystem::path> &named)
{
    const std::filesystem::path first = bufferPath(output).filename();
    std::filesystem::path name = first;
    for (int i = 2; std::find(named.begin(), named.end(), name) != named.end(); ++i)
        name = first.stem().string() + "-" + std::to_string(i) + first.extension().string();
    return name.string();
}

// Copies the files that a document names to where its output will look for them.
std::vector<std::filesystem::path> copyNamed(const Document &document, const std::filesystem::path &output,
                                             const std::vector<std::filesystem::path> &named, OutputFiles &files)
{
    const std::filesystem::path from = folderOf(document.path());
    const std::filesystem::path to = folderOf(output);
    std::vector<std::filesystem::path> copied;
    std::error_code error;
    if (std::filesystem::equivalent(from, to, error))
        return copied;
    std::set<std::filesystem::path> seen;
    for (const std::filesystem::path &name : named) {
        const std::filesystem::path normal = name.lexically_normal();
        if (!seen.insert(normal).second || !std::filesystem::is_regular_file(from / normal, error))
            continue;
        if (normal.is_absolute() || normal.begin()->string() == "..")
            throw GltfError("it names the file " + name.string() +
                            ", which is not in its folder or below it, so that " + output.string() +
                            " cannot have a copy");
        files.copy(from / normal, to / normal);
        copied.push_back(normal);
    }
    return copied;
}

void checkPaths(const Document &document, const std::filesystem::path &output)
{
    std::error_code error;
    if (std::filesystem::equivalent(document.path(), output, error))
        throw GltfError("the output is the input, which is never written");
    if (document.binary() && isGltf(output))
        throw GltfError("it is a GLB, and " + output.string() + " would be a .gltf");
    if (!document.binary() && !isGltf(output))
        throw GltfError("it is a .gltf file, and " + output.string() + " would not be");
}

} // namespace

std::filesystem::path bufferPath(const std::filesystem::path &output)
{
    std::filesystem::path stem = output.stem();
    if (stem.extension() != ".omm")
        stem += ".omm";
    return folderOf(output) / (stem.string() + ".bin");
}

FileBake bakeFile(const std::filesystem::path &input, const std::filesystem::path &output,
                  const FileBakeOptions &options)
{
    const Document document(input);
    return document.named([&] {
        checkPaths(document, output);
        FileBake result;
        result.inputBytes = document.bytes().size();
        result.replaced = hasMicromaps(document);
        result.bake = bakeDocument(document, options);
        for (const BakedPrimitive &primitive : result.bake.primitives)
            result.names.push_back(document.nameOf(primitive.place));
        for (const LeftPrimitive &primitive : result.bake.left)
            result.leftNames.push_back(document.nameOf(primitive.place));
        const std::vector<std::filesystem::path> named = namedFiles(document.json());
        const std::string name = document.binary() || options.embed ? "" : bufferName(output, named);
        const RewrittenFile rewritten = withMicromaps(document, result.bake, name);
        result.outputBytes = rewritten.file.size() + rewritten.buffer.size();
        OutputFiles files(options.bake.cancelled);
        result.copied = copyNamed(document, output, named, files);
        if (rewritten.buffer.size() != 0)
            files.write(folderOf(output) / name, rewritten.buffer);
        files.write(output, rewritten.file);
        files.publish();
        return result;
    });
}

} // namespace vellum
