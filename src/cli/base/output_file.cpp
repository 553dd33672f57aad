#include "cli/base/output_file.h"

#include <cerrno>
#include <cstring>
#include <string>
#include <unistd.h>

#include "cli/base/error.h"
#include "gltf/file/gltf_error.h"
#include "gltf/file/output_files.h"

namespace vellum::cli
{

void checkWritable(const std::filesystem::path &path)
{
    const std::filesystem::path folder = path.parent_path().empty() ? "." : path.parent_path();
    std::error_code error;
    if (!std::filesystem::is_directory(folder, error))
        throw Error(path.string() + " cannot be written: " + folder.string() + " is not a directory");
    if (std::filesystem::is_directory(path, error))
        throw Error(path.string() + " cannot be written: it is a directory");
    if (access(folder.c_str(), W_OK) != 0)
        throw Error(path.string() + " cannot be written: " + std::strerror(errno));
}

void writeWhole(const std::filesystem::path &path, std::span<const uint8_t> bytes)
{
    try {
        OutputFiles files([] { return false; });
        FileContent content;
        content.add(bytes);
        files.write(path, content);
        files.publish();
    } catch (const GltfError &error) {
        throw Error(error.what());
    }
}

} // namespace vellum::cli
