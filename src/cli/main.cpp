// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <exception>
#include <new>
#include <stdexcept>
#include <system_error>

#include "base/error.h"
#include "base/process.h"
#include "cli/base/exit_code.h"
#include "cli/options/commands.h"

int main(int argc, char **argv)
{
    auto code = vellum::cli::ExitCode::Failed;
    try {
        const int result = vellum::cli::runCommandLine(vellum::prepareProcess(argc, argv));
        // A full disk behind a redirection is noticed when the last bytes are written.
        if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0)
            return result;
        std::fprintf(stderr, "vellum: stdout cannot be written\n");
    } catch (const std::bad_alloc &) {
        std::fprintf(stderr, "vellum: out of memory\n");
    } catch (const vellum::UsageError &error) {
        std::fprintf(stderr, "vellum: %s\n", error.what());
        code = vellum::cli::ExitCode::Usage;
    } catch (const std::logic_error &error) { // such as "stoul", which means nothing to users
        std::fprintf(stderr, "vellum: internal error (%s); please report it\n", error.what());
    } catch (const std::system_error &error) { // of fmt::print(), where stdout fails
        std::fprintf(stderr, "vellum: %s\n", std::ferror(stdout) != 0 ? "stdout cannot be written" : error.what());
    } catch (const std::exception &error) {
        std::fprintf(stderr, "vellum: %s\n", error.what());
    }
    return static_cast<int>(code);
}
