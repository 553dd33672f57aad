// Writes the manual page and the completions of shells into a folder, at build time:
// vellum-reference FOLDER VERSION DATE
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "cli/manual/completions.h"
#include "cli/manual/man_page.h"

int main(int argc, char **argv)
{
    using namespace vellum::cli;
    if (argc != 4) {
        std::fprintf(stderr, "usage: vellum-reference FOLDER VERSION DATE\n");
        return 1;
    }
    const std::filesystem::path folder = argv[1];
    const auto write = [&](const char *name, const std::string &text) {
        std::ofstream file(folder / name, std::ios::binary);
        file << text;
        file.close();
        if (!file)
            std::fprintf(stderr, "%s cannot be written\n", (folder / name).c_str());
        return !file.fail();
    };
    const std::vector<ReferenceCommand> commands = readCommands();
    const bool written = write("vellum.1", manPage(commands, argv[2], argv[3])) &&
                         write("vellum.bash", bashCompletion(commands)) && write("_vellum", zshCompletion(commands)) &&
                         write("vellum.fish", fishCompletion(commands));
    return written ? 0 : 1;
}
