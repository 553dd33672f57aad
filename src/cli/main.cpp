#include <cstdio>
#include <exception>

#include "cli/command_line.h"

int main(int argc, char **argv)
{
    try {
        return vellum::cli::runCommandLine(argc, argv);
    } catch (const std::bad_alloc &) {
        std::fprintf(stderr, "vellum: out of memory\n");
    } catch (const std::exception &error) {
        std::fprintf(stderr, "vellum: %s\n", error.what());
    }
    return 1;
}
