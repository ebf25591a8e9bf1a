#include <gtest/gtest.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <fstream>
#include <iostream>
#include <numeric>

#include "hdf5_file.hpp"
#include "output_folder.hpp"
#include "own_folder.hpp"
#include "undo_driver.hpp"

namespace {

int writes_left = -1;  // before this process kills itself; negative: it does not
bool in_the_midst = false;

}  // namespace

/// HDF5's and our own: the one that the kill meets writes nothing, or half.
extern "C" ssize_t pwrite(int descriptor, const void* bytes, std::size_t size, off_t at) {
  if (writes_left >= 0 && writes_left-- == 0) {
    if (in_the_midst) syscall(SYS_pwrite64, descriptor, bytes, size / 2, at);
    std::raise(SIGKILL);
  }
  return syscall(SYS_pwrite64, descriptor, bytes, size, at);
}

namespace femxdem {
namespace {

namespace fs = std::filesystem;
using Mode = Hdf5File::Mode;

constexpr int kSteps = 40;  // so that the tables of the group have been split

std::string group(int step) { return "/steps/" + std::to_string(1000 + step); }

void write_step(const fs::path& file, int step) {
  std::vector<double> values(100);
  std::iota(values.begin(), values.end(), step);
  Hdf5File h5(file, Mode::update);
  h5.reserve(2000, 3);
  if (h5.exists(group(step))) h5.remove(group(step));
  h5.make_group(group(step));
  h5.set_attribute(group(step), "time", 0.1 * step);
  h5.write(group(step) + "/u", values, {10, 10});
  h5.write(group(step) + "/v", values, {100});
  h5.finish();
}

/// As after a restart: steps from kSteps / 2 on are removed.
void go_back(const fs::path& file) {
  Hdf5File h5(file, Mode::update);
  for (int step = kSteps / 2; step < kSteps; ++step) h5.remove(group(step));
  h5.finish();
}

class KilledUpdate : public OwnFolder {
 protected:
  KilledUpdate() {
    fs::create_directories(folder_);
    Hdf5File(file_, Mode::create).make_group("/steps");
    for (int step = 0; step < kSteps; ++step) write_step(file_, step);
  }

  /// A process that updates and is killed at its write number `writes`; false where it comes to its end.
  template <class Update>
  bool killed(int writes, bool half, Update update) const {
    const pid_t child = fork();
    if (child == 0) {
      writes_left = writes;
      in_the_midst = half;
      try {
        update();
      } catch (const std::exception& error) {
        std::cerr << error.what() << "\n";
        _exit(1);
      }
      _exit(0);
    }
    int status = 0;
    waitpid(child, &status, 0);
    EXPECT_TRUE(WIFSIGNALED(status) || WEXITSTATUS(status) == 0);
    return WIFSIGNALED(status);
  }

  /// Kills the update at each of its writes: undone, the file has the bytes of before. Returns the number of writes.
  template <class Update>
  int kill_at_each_write(bool half, Update update) const {
    const std::string before = read_file(file_);
    int writes = 0, torn = 0;
    for (; killed(writes, half, update); ++writes) {
      torn += read_file(file_).substr(0, before.size()) != before;
      undo_unfinished_update(file_);
      EXPECT_TRUE(read_file(file_) == before) << "killed at write " << writes;
    }
    EXPECT_GT(torn, 0) << "no write overwrites anything: nothing is tested";
    EXPECT_FALSE(fs::exists(undo_file(file_)));
    EXPECT_FALSE(read_file(file_) == before);
    return writes;
  }

  fs::path file_ = folder_ / "results.h5";
};

TEST_F(KilledUpdate, OneThatIsGivenUpIsUndoneAtOnce) {
  const std::string before = read_file(file_);
  {
    Hdf5File file(file_, Mode::update);
    file.write("/given_up", std::vector<double>(1000, 1.0), {1000});
  }
  EXPECT_EQ(read_file(file_), before);
  EXPECT_FALSE(fs::exists(undo_file(file_)));
}

TEST_F(KilledUpdate, OfANewStepIsUndone) {
  for (const bool half : {false, true}) {
    const int step = kSteps + half;
    EXPECT_GT(kill_at_each_write(half, [&] { write_step(file_, step); }), 3);
    EXPECT_EQ(Hdf5File(file_, Mode::read).members("/steps").size(), static_cast<std::size_t>(step + 1));
    EXPECT_EQ(Hdf5File(file_, Mode::read).read(group(step) + "/v").at(7), step + 7);
  }
}

TEST_F(KilledUpdate, OfAStepWrittenAgainIsUndone) {
  EXPECT_GT(kill_at_each_write(false, [&] { write_step(file_, 3); }), 3);
}

TEST_F(KilledUpdate, OfAFileThatBecomesShorterIsUndone) {
  EXPECT_GT(kill_at_each_write(false, [&] { go_back(file_); }), 3);
  EXPECT_EQ(Hdf5File(file_, Mode::read).members("/steps").size(), kSteps / 2);
}

TEST_F(KilledUpdate, IsUndoneByTheNextUpdateAlsoWhereThatIsKilledWhileItUndoes) {
  const std::string before = read_file(file_);
  ASSERT_TRUE(killed(3, false, [&] { write_step(file_, kSteps); }));
  for (int writes = 0; killed(writes, false, [&] { undo_unfinished_update(file_); }); ++writes)
    ASSERT_TRUE(fs::exists(undo_file(file_)));
  EXPECT_TRUE(read_file(file_) == before);
  ASSERT_TRUE(killed(3, false, [&] { write_step(file_, kSteps); }));
  write_step(file_, kSteps + 1);
  EXPECT_EQ(Hdf5File(file_, Mode::read).read(group(kSteps + 1) + "/u").at(7), kSteps + 8);
  EXPECT_FALSE(Hdf5File(file_, Mode::read).exists(group(kSteps)));
}

TEST_F(KilledUpdate, OfAFileThatIsReplacedIsForgotten) {
  ASSERT_TRUE(killed(3, false, [&] { write_step(file_, kSteps); }));
  Hdf5File(file_, Mode::create).make_group("/steps");
  write_step(file_, 0);
  EXPECT_EQ(Hdf5File(file_, Mode::read).members("/steps").size(), 1U);
}

}  // namespace
}  // namespace femxdem
