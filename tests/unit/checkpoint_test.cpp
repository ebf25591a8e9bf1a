#include "checkpoint.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <fstream>
#include <limits>

#include "errors.hpp"
#include "hdf5_file.hpp"
#include "output_folder.hpp"
#include "own_folder.hpp"
#include "sealed_file.hpp"

namespace femxdem {
namespace {

namespace fs = std::filesystem;

/// Points that are nothing but their states.
class StatesOnly : public MaterialPoints {
 public:
  explicit StatesOnly(SavedStates states) : states_(std::move(states)) {}
  std::size_t size() const override { return states_.size(); }
  std::vector<Response> evaluate(std::span<const Tensor2>, Operator) override { return {}; }
  void commit() override {}
  void save_each(const TakeState& take) override {
    for (std::size_t i = 0; i < size(); ++i) take(states_[i], std::array{i});
  }
  void load_each(const StateSource& source) override {
    require_states_of(size(), source);
    for (const auto& [number, points] : source.points_of_states())
      for (const std::size_t i : points) states_[i] = source.read(number);
  }
  const SavedStates& states() const { return states_; }

 private:
  SavedStates states_;
};

SavedStates sample_states() {
  std::string binary = "state";
  for (int byte = 0; byte < 256; ++byte) binary += static_cast<char>(byte);
  return {binary, "other", binary, ""};
}

Checkpoint sample(int step = 17) {
  return {
      step,
      1.0 / 3.0,
      1e-3 / 7.0,
      {{"zeta", {1.0 / 3.0, -0.0, std::numeric_limits<double>::denorm_min(), 1e308}}, {"alpha/beta", {}}, {"u", {2}}},
      "[mesh]\n",
      {{"yade", "2023.02a"}, {"boost", "1.74"}}};
}

class CheckpointTest : public OwnFolder {
 protected:
  CheckpointTest() { fs::create_directories(folder_); }

  void write(int step = 17) const {
    StatesOnly points(sample_states());
    write_checkpoint(file(), sample(step), points);
  }
  int step_on_disk() const { return CheckpointFile(file()).read({}).step; }
  /// Why it is refused; "accepted" else.
  std::string sentence(const std::map<std::string, std::string>& versions = {}) const {
    try {
      StatesOnly points(SavedStates(4));
      const CheckpointFile checkpoint(file());
      checkpoint.read(versions);
      points.load_each(checkpoint.states());
    } catch (const UserError& error) {
      return error.what();
    }
    return "accepted";
  }
  fs::path file() const { return folder_ / "checkpoint.h5"; }
};

void put_bytes(const fs::path& file, const std::string& bytes) { std::ofstream(file, std::ios::binary) << bytes; }

TEST_F(CheckpointTest, IsReadBackToTheLastBit) {
  write();
  const Checkpoint written = sample();
  const CheckpointFile checkpoint(file());
  const Checkpoint read = checkpoint.read(written.versions);
  EXPECT_EQ(read.step, 17);
  EXPECT_EQ(read.time, written.time);
  EXPECT_EQ(read.dt, written.dt);
  EXPECT_EQ(read.versions, written.versions);
  EXPECT_EQ(read.case_text, written.case_text);
  StatesOnly points(SavedStates(4));
  points.load_each(checkpoint.states());
  EXPECT_EQ(points.states(), sample_states());
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

TEST_F(CheckpointTest, EqualStatesAreStoredOnceAndAreOneNumber) {
  write();
  EXPECT_EQ(Hdf5File(file(), Hdf5File::Mode::read).members("/states").size(), 3U);
  EXPECT_EQ(CheckpointFile(file()).states().number_of_point, (std::vector<int>{0, 1, 0, 2}));
}

TEST_F(CheckpointTest, AWriteThatFailsLeavesTheOldOne) {
  write(17);
  fs::create_directories(folder_ / "checkpoint.h5.new");
  EXPECT_THROW(write(18), std::runtime_error);
  EXPECT_EQ(step_on_disk(), 17);
  fs::remove(folder_ / "checkpoint.h5.new");
  write(18);
  EXPECT_EQ(step_on_disk(), 18);
  EXPECT_FALSE(fs::exists(folder_ / "checkpoint.h5.new"));
}

TEST_F(CheckpointTest, TheOneBeforeIsKept) {
  for (const int step : {17, 18, 19}) write(step);
  EXPECT_EQ(step_on_disk(), 19);
  EXPECT_EQ(CheckpointFile(folder_ / "checkpoint.previous.h5").read({}).step, 18);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 2);
}

TEST_F(CheckpointTest, AnotherVersionIsRefused) {
  write();
  EXPECT_EQ(sentence({{"yade", "2024.1"}}),
            file().string() +
                ": written with yade 2023.02a, this program has 2024.1: states cannot be read across versions; use the "
                "version it was written with or start without --restart");
  EXPECT_EQ(sentence({{"yade", "2023.02a"}, {"python", "3.11"}}), "accepted");
}

TEST_F(CheckpointTest, AMissingOrForeignFileIsRefused) {
  const std::string name = file().string();
  EXPECT_EQ(sentence(), name + ": no checkpoint to restart from; start without --restart");
  put_bytes(file(), "no HDF5");
  EXPECT_EQ(sentence(), name + ": is cut off, or not a checkpoint of this program; start without --restart");
  seal(file());
  EXPECT_NE(sentence().find(name + ": is no checkpoint of this program ("), std::string::npos) << sentence();
}

TEST_F(CheckpointTest, EveryDamageIsSeenAndTheOneBeforeIsOffered) {
  write(17);
  write(18);
  const std::string whole = read_file(file()), name = file().string(), before = folder_ / "checkpoint.previous.h5";
  const std::string offer = fmt::format(
      "; the one before it, after step 17, is whole: `mv {} {}`, then --restart goes on from there", before, name);
  for (std::size_t byte = 0; byte < whole.size(); byte += 101) {
    std::string damaged = whole;
    damaged[byte] ^= 1;
    put_bytes(file(), damaged);
    ASSERT_TRUE(sentence().ends_with(offer)) << "byte " << byte << ": " << sentence();
  }
  for (const std::size_t size : {std::size_t{0}, std::size_t{31}, whole.size() / 2, whole.size() - 1}) {
    put_bytes(file(), whole.substr(0, size));
    EXPECT_EQ(sentence(), name + ": is cut off, or not a checkpoint of this program" + offer) << size;
  }
  put_bytes(file(), whole + "x");
  EXPECT_NE(sentence(), "accepted");
  std::string later = whole;
  later[whole.size() - 17] = '3';
  put_bytes(file(), later);
  EXPECT_EQ(sentence(), name + ": has version 3 of the format, this program reads version 2" + offer);
  fs::remove(file());
  EXPECT_EQ(sentence(), name + ": no checkpoint to restart from" + offer);
  put_bytes(before, "x");
  EXPECT_EQ(sentence(), name + ": no checkpoint to restart from; start without --restart");
}

}  // namespace
}  // namespace femxdem
