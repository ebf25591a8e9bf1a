#include "checkpoint.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <fstream>
#include <limits>

#include "errors.hpp"
#include "hdf5_file.hpp"
#include "own_folder.hpp"

namespace femxdem {
namespace {

namespace fs = std::filesystem;

class CheckpointTest : public OwnFolder {
 protected:
  CheckpointTest() { fs::create_directories(folder_); }

  std::string sentence(const std::map<std::string, std::string>& versions) const {
    try {
      read_checkpoint(file(), versions);
    } catch (const UserError& error) {
      return error.what();
    }
    return "accepted";
  }
  fs::path file() const { return folder_ / "checkpoint.h5"; }
};

Checkpoint sample() {
  std::string binary = "state";
  for (int byte = 0; byte < 256; ++byte) binary += static_cast<char>(byte);
  return {
      17,
      1.0 / 3.0,
      1e-3 / 7.0,
      {{"zeta", {1.0 / 3.0, -0.0, std::numeric_limits<double>::denorm_min(), 1e308}}, {"alpha/beta", {}}, {"u", {2}}},
      {binary, "other", binary, ""},
      "[mesh]\n",
      {{"yade", "2023.02a"}, {"boost", "1.74"}}};
}

TEST_F(CheckpointTest, IsReadBackToTheLastBit) {
  const Checkpoint written = sample();
  write_checkpoint(file(), written);
  const Checkpoint read = read_checkpoint(file(), written.versions);
  EXPECT_EQ(read.step, 17);
  EXPECT_EQ(read.time, written.time);
  EXPECT_EQ(read.dt, written.dt);
  EXPECT_EQ(read.states, written.states);
  EXPECT_EQ(read.versions, written.versions);
  EXPECT_EQ(read.case_text, written.case_text);
  ASSERT_EQ(read.arrays.size(), written.arrays.size());
  for (std::size_t k = 0; k < read.arrays.size(); ++k) {
    const auto& [name, values] = written.arrays[k];
    EXPECT_EQ(read.arrays[k].first, name);
    ASSERT_EQ(read.arrays[k].second.size(), values.size());
    if (values.empty()) continue;
    EXPECT_EQ(std::memcmp(read.arrays[k].second.data(), values.data(), 8 * values.size()), 0);
  }
  EXPECT_EQ(find_array(read.arrays, "u"), std::vector<double>{2});
  EXPECT_THROW(static_cast<void>(find_array(read.arrays, "w")), std::out_of_range);
}

TEST_F(CheckpointTest, EqualStatesAreStoredOnce) {
  write_checkpoint(file(), sample());
  EXPECT_EQ(Hdf5File(file(), Hdf5File::Mode::read).members("/states").size(), 3U);
}

TEST_F(CheckpointTest, AWriteThatFailsLeavesTheOldOne) {
  write_checkpoint(file(), sample());
  fs::create_directories(folder_ / "checkpoint.h5.new");
  Checkpoint later = sample();
  later.step = 18;
  EXPECT_THROW(write_checkpoint(file(), later), std::runtime_error);
  EXPECT_EQ(read_checkpoint(file(), {}).step, 17);
  fs::remove(folder_ / "checkpoint.h5.new");
  write_checkpoint(file(), later);
  EXPECT_EQ(read_checkpoint(file(), {}).step, 18);
  EXPECT_FALSE(fs::exists(folder_ / "checkpoint.h5.new"));
}

TEST_F(CheckpointTest, AnotherVersionIsRefused) {
  write_checkpoint(file(), sample());
  EXPECT_EQ(sentence({{"yade", "2024.1"}}),
            file().string() +
                ": written with yade 2023.02a, this program has 2024.1: states cannot be read across versions; use the "
                "version it was written with or start without --restart");
  EXPECT_EQ(sentence({{"yade", "2023.02a"}, {"python", "3.11"}}), "accepted");
}

TEST_F(CheckpointTest, AMissingOrForeignFileIsRefused) {
  EXPECT_EQ(sentence({}), file().string() + ": no checkpoint to restart from; start without --restart");
  std::ofstream(file()) << "no HDF5";
  EXPECT_EQ(sentence({}), file().string() + ": is not a whole checkpoint; start without --restart");
}

}  // namespace
}  // namespace femxdem
