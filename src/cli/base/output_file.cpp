#include "cli/base/output_file.h"

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <unistd.h>

#include "cli/base/error.h"

namespace vellum::cli
{
namespace
{

// Deletes an unfinished file.
struct Unfinished {
    std::string path;
    int descriptor = -1;
    ~Unfinished()
    {
        if (descriptor >= 0)
            close(descriptor);
        if (!path.empty())
            unlink(path.c_str());
    }
};

} // namespace

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

void writeWhole(const std::filesystem::path &path, std::span<const std::uint8_t> bytes)
{
    Unfinished unfinished;
    std::string name = path.string() + ".XXXXXX";
    unfinished.descriptor = mkstemp(name.data());
    const auto fail = [&] { return Error(path.string() + " cannot be written: " + std::strerror(errno)); };
    if (unfinished.descriptor < 0)
        throw fail();
    unfinished.path = name;
    for (std::size_t done = 0; done < bytes.size();) {
        const ssize_t count = write(unfinished.descriptor, bytes.data() + done, bytes.size() - done);
        if (count < 0)
            throw fail();
        done += static_cast<std::size_t>(count);
    }
    // mkstemp's files are private; this one is like any other.
    std::filesystem::permissions(name, std::filesystem::perms(0644));
    if (std::rename(name.c_str(), path.c_str()) != 0)
        throw fail();
    unfinished.path.clear();
}

} // namespace vellum::cli
