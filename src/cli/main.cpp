#include <cstdio>
#include <exception>

#include "cli/command_line.h"

int main(int argc, char **argv)
{
    try {
        const int code = vellum::cli::runCommandLine(argc, argv);
        // A full disk behind a pipe or redirection shows when the last of it is written.
        if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0)
            return code;
        std::fprintf(stderr, "vellum: stdout cannot be written\n");
    } catch (const std::bad_alloc &) {
        std::fprintf(stderr, "vellum: out of memory\n");
    } catch (const std::exception &error) {
        std::fprintf(stderr, "vellum: %s\n", error.what());
    }
    return 1;
}
