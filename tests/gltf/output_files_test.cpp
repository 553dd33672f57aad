// SPDX-License-Identifier: Apache-2.0
#include "gltf/file/output_files.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <set>
#include <unistd.h>
#ifndef _WIN32
#include <sched.h>
#include <sys/mount.h>
#include <sys/wait.h>
#endif

#include "bake/bake.h"
#include "glb_file.h"
#include "gltf/file/gltf_error.h"
#include "gltf/file/open_file.h"

using namespace vellum;
using namespace vellum::test;

namespace
{

FileContent contentOf(const std::string &text)
{
    FileContent content;
    content.keep({text.begin(), text.end()});
    return content;
}

size_t entries(const std::filesystem::path &folder)
{
    const std::filesystem::directory_iterator begin(folder);
    return static_cast<size_t>(std::distance(begin, {}));
}

const std::function<bool()> kNever;

} // namespace

TEST(OutputFiles, AppearWhenTheyArePublished)
{
    const TemporaryFolder folder;
    writeFile(folder / "old", {'x'});
    {
        OutputFiles files(kNever);
        files.write(folder / "a/b/new", contentOf("new"));
        files.write(folder / "old", contentOf("newer"));
        EXPECT_EQ(readText(folder / "old"), "x");
        EXPECT_FALSE(std::filesystem::exists(folder / "a/b/new"));
        files.publish();
    }
    EXPECT_EQ(readText(folder / "a/b/new"), "new");
    EXPECT_EQ(readText(folder / "old"), "newer");
    EXPECT_EQ(entries(folder.path()), 2u);
    EXPECT_EQ(entries(folder / "a/b"), 1u);
}

#ifndef _WIN32
// As in a chroot.
TEST(OutputFiles, AppearWithoutProc)
{
    const TemporaryFolder folder;
    constexpr int kUnsupported = 77;
    const pid_t child = fork();
    if (child == 0) {
        if (unshare(CLONE_NEWUSER | CLONE_NEWNS) != 0 || mount("none", "/proc", "tmpfs", 0, nullptr) != 0)
            _exit(kUnsupported);
        try {
            OutputFiles files(kNever);
            files.write(folder / "new", contentOf("new"));
            files.publish();
        } catch (const GltfError &) {
            _exit(1);
        }
        _exit(0);
    }
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    if (WIFEXITED(status) && WEXITSTATUS(status) == kUnsupported)
        GTEST_SKIP() << "nothing can be mounted";
    EXPECT_EQ(status, 0);
    EXPECT_EQ(readText(folder / "new"), "new");
    EXPECT_EQ(entries(folder.path()), 1u);
}

// As on a file server that repeated the request.
TEST(OutputFiles, NoOtherNameStaysOfAFileThatHasAppearedAlready)
{
    const TemporaryFolder folder;
    NewFile file(folder / "new");
    file.write(std::vector<uint8_t>{'x'});
    ASSERT_EQ(linkat(AT_FDCWD, file.readable().c_str(), AT_FDCWD, file.path().c_str(), AT_SYMLINK_FOLLOW), 0);
    EXPECT_EQ(file.appear(), NewFile::Appeared::No);
    file.replace();
    EXPECT_EQ(readText(folder / "new"), "x");
    EXPECT_EQ(entries(folder.path()), 1u);
}
#endif

TEST(OutputFiles, NamesMayHaveAnyCharacters)
{
    const TemporaryFolder folder;
    const std::filesystem::path path = folder.path() / u8"\u5c4b\u00e9/\U0001f33f.gltf";
    OutputFiles files(kNever);
    files.write(path, contentOf("leaf"));
    files.publish();
    EXPECT_EQ(readText(path), "leaf");
    OutputFiles again(kNever);
    again.write(path, contentOf("newer leaf"));
    again.publish();
    EXPECT_EQ(readText(path), "newer leaf");
    EXPECT_EQ(entries(path.parent_path()), 1u);
}

TEST(OutputFiles, RemovesThemOtherwise)
{
    const TemporaryFolder folder;
    {
        OutputFiles files(kNever);
        files.write(folder / "a/b/new", contentOf("new"));
    }
    EXPECT_EQ(entries(folder.path()), 0u);
    int calls = 0;
    {
        OutputFiles files([&] { return ++calls > 1; });
        files.write(folder / "one", contentOf("1"));
        EXPECT_THROW(files.write(folder / "two", contentOf("2")), BakeCancelled);
    }
    EXPECT_EQ(entries(folder.path()), 0u);
}

// An output of another job, which found the file there, may name it.
TEST(OutputFiles, WhenOneCannotAppearThoseBeforeItStay)
{
    const TemporaryFolder folder;
    writeFile(folder / "source", {'s'});
    {
        OutputFiles files(kNever);
        files.write(folder / "one", contentOf("1"));
        files.copy(folder / "source", folder / "two", folder.path());
        files.write(folder / "model", contentOf("m"));
        writeFile(folder / "two", {'t'}); // written by another process meanwhile
        EXPECT_THROW(files.publish(), GltfError);
    }
    EXPECT_EQ(readText(folder / "one"), "1");
    EXPECT_EQ(readText(folder / "two"), "t");
    EXPECT_EQ(entries(folder.path()), 3u);
}

TEST(OutputFiles, CopiesDoNotReplaceDifferentFiles)
{
    const TemporaryFolder folder;
    writeFile(folder / "source", {'s'});
    writeFile(folder / "same", {'s'});
    writeFile(folder / "different", {'d'});
    OutputFiles files(kNever);
    files.copy(folder / "source", folder / "copy", folder.path());
    files.copy(folder / "source", folder / "same", folder.path());
    EXPECT_THROW(files.copy(folder / "source", folder / "different", folder.path()), GltfError);
    files.publish();
    EXPECT_EQ(readText(folder / "copy"), "s");
    EXPECT_EQ(readText(folder / "different"), "d");
    OutputFiles replacing(kNever);
    replacing.copy(folder / "source", folder / "different", folder.path(), true);
    replacing.publish();
    EXPECT_EQ(readText(folder / "different"), "s");
}

TEST(OutputFiles, ContentNamedFilesAreNeverReplaced)
{
    const TemporaryFolder folder;
    writeFile(folder / "old", {'o'});
    writeFile(folder / "same", {'s'});
    {
        OutputFiles files(kNever);
        files.writeOnce(folder / "same", contentOf("s"));
        files.writeOnce(folder / "new", contentOf("n"));
        files.write(folder / "old", contentOf("newer"));
        files.publish();
    }
    EXPECT_EQ(readText(folder / "new"), "n");
    EXPECT_EQ(readText(folder / "old"), "newer");
    OutputFiles files(kNever);
    files.writeOnce(folder / "other", contentOf("o"));
    files.writeOnce(folder / "same", contentOf("different"));
    files.write(folder / "old", contentOf("newest"));
    EXPECT_THROW(files.publish(), GltfError);
    EXPECT_EQ(readText(folder / "same"), "s");
    EXPECT_EQ(readText(folder / "old"), "newer");
    EXPECT_EQ(readText(folder / "other"), "o");
}

TEST(OutputFiles, ReplacedFilesKeepTheirMode)
{
    const TemporaryFolder folder;
    writeFile(folder / "old", {'o'});
    const auto mode =
        std::filesystem::perms::owner_read | std::filesystem::perms::owner_write | std::filesystem::perms::group_read;
    std::filesystem::permissions(folder / "old", mode);
    OutputFiles files(kNever);
    files.write(folder / "old", contentOf("newer"));
    files.publish();
    EXPECT_EQ(readText(folder / "old"), "newer");
    EXPECT_EQ(std::filesystem::status(folder / "old").permissions(), mode);
}

TEST(OutputFiles, OnlyFilesAreReplaced)
{
    const TemporaryFolder folder;
    writeFile(folder / "file", {'f'});
    std::filesystem::create_directory(folder / "sub");
    OutputFiles files(kNever);
    EXPECT_THROW(files.write("/dev/null", contentOf("x")), GltfError);
    EXPECT_THROW(files.write(folder / "sub", contentOf("x")), GltfError);
    EXPECT_THROW(files.write(folder / "file/x", contentOf("x")), GltfError);
}

// Process numbers come again, in containers all the time: files that a killed process left must not matter.
TEST(OutputFiles, TemporaryFilesOfAnEarlierProcessDoNotMatter)
{
    const TemporaryFolder folder;
    writeFile(folder / "old", {'o'});
    for (int i = 0; i < 1000; ++i)
        writeFile(folder / (".old." + std::to_string(getpid()) + "-" + std::to_string(i) + ".tmp"), {});
    OutputFiles files(kNever);
    files.write(folder / "old", contentOf("new"));
    files.publish();
    EXPECT_EQ(readText(folder / "old"), "new");
    EXPECT_EQ(entries(folder.path()), 1001u);
}

TEST(OutputFiles, ATemporaryNameThatIsTakenIsFollowedByAnother)
{
    const std::filesystem::path path = std::filesystem::path("folder") / "tree.glb";
    std::set<std::filesystem::path> names;
    const std::filesystem::path free = temporaryName(
        path, [&](const std::filesystem::path &name) { return names.insert(name).second && names.size() == 4; });
    EXPECT_EQ(names.size(), 4u);
    EXPECT_TRUE(names.contains(free));
    for (const std::filesystem::path &name : names) {
        EXPECT_EQ(name.parent_path(), "folder");
        EXPECT_TRUE(name.filename().string().starts_with(".tree.glb.")) << name;
    }
    size_t tries = 0;
    temporaryName(path, [&](const std::filesystem::path &) { return ++tries > 1000; });
    EXPECT_LE(tries, 1000u);
}
