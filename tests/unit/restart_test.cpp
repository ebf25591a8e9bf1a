#include "restart.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <fstream>

#include "analytic_points.hpp"
#include "checkpoint.hpp"
#include "errors.hpp"
#include "output_folder.hpp"

namespace femxdem {
namespace {

namespace fs = std::filesystem;

fs::path fresh_folder(const std::string& name) {
  const fs::path folder = fs::path(testing::TempDir()) / (name + std::to_string(getpid()));
  fs::remove_all(folder);
  return folder;
}

Case small_case(LoadKind kind) {
  Case c;
  c.control.end_time = 1;
  c.control.step = 0.1;
  Load load;
  load.kind = kind;
  load.edge = "top";
  load.value = -0.1;
  c.loads = {load};
  return c;
}

fs::path checkpoint_of(const Case& c, double time) {
  const fs::path folder = fresh_folder("restart_test_");
  fs::create_directories(folder);
  AnalyticPoints points({JaumannLaw{1e7, 0.3, 0}});
  write_checkpoint(folder / "checkpoint.h5", {3, time, 0.1, {}, case_hash(c), {}, comparable_toml(c)}, points);
  return folder / "checkpoint.h5";
}

std::string refusal(const fs::path& file, const Case& c) {
  try {
    hash_of_restart(CheckpointFile(file), c);
    return "none";
  } catch (const UserError& error) {
    return error.what();
  }
}

TEST(Restart, NamesTheKeysThatDiffer) {
  Case c = small_case(LoadKind::velocity);
  const fs::path file = checkpoint_of(c, 0.3);
  EXPECT_EQ(hash_of_restart(CheckpointFile(file), c), case_hash(c));
  c.ve.friction = 0.3;
  c.loads[0].value = -0.2;
  const std::string said = refusal(file, c);
  EXPECT_NE(said.find("load.0.value (-0.1, now -0.2), ve.friction (0.5, now 0.3)"), std::string::npos) << said;
}

TEST(Restart, ALaterEndIsAllowedWhereNoLoadDependsOnIt) {
  for (const auto& [kind, allowed] :
       {std::pair{LoadKind::velocity, true}, {LoadKind::pressure, true}, {LoadKind::displacement, false}}) {
    Case c = small_case(kind);
    const fs::path file = checkpoint_of(c, 0.3);
    const std::string then = case_hash(c);
    c.control.end_time = 2;
    if (allowed) {
      EXPECT_EQ(hash_of_restart(CheckpointFile(file), c), then);
    } else {
      EXPECT_NE(refusal(file, c).find("load.0 depends on it (its factor is time / end_time)"), std::string::npos);
    }
    c.control.end_time = 0.2;
    EXPECT_NE(refusal(file, c), "none");
  }
  Case c = small_case(LoadKind::displacement);
  c.loads[0].table = {{0, 0}, {1, 1}};
  const fs::path file = checkpoint_of(c, 0.3);
  const std::string then = case_hash(c);
  c.control.end_time = 2;
  EXPECT_EQ(hash_of_restart(CheckpointFile(file), c), then);
}

TEST(FolderLock, OneRunAtATime) {
  const fs::path folder = fresh_folder("lock_test_");
  {
    const auto lock = prepare_output_folder(folder, Existing::refuse);
    EXPECT_THROW(prepare_output_folder(folder, Existing::overwrite), UserError);
    EXPECT_TRUE(lock->remark().empty());
  }
  EXPECT_TRUE(fs::is_empty(folder));
}

/// The words of this process's lock, with one of them changed.
std::string changed_lock(const fs::path& folder, int word) {
  std::array<std::string, 4> words;
  {
    const FolderLock lock(folder);
    std::ifstream stream(folder / "running.lock");
    for (std::string& w : words) stream >> w;
  }
  words.at(static_cast<std::size_t>(word)) = word == 2 ? "4194303" : "1";
  std::string text;
  for (const std::string& w : words) text += w + " ";
  return text;
}

TEST(FolderLock, OfADeadProcessIsTakenOver) {
  const fs::path folder = fresh_folder("stale_lock_test_");
  fs::create_directories(folder);
  for (const int word : {1, 2, 3}) {  // another boot, no such process, a process of that number that started later
    const std::string text = changed_lock(folder, word);
    std::ofstream(folder / "running.lock") << text;
    const FolderLock lock(folder);
    EXPECT_NE(lock.remark().find("taken over from process"), std::string::npos) << text;
  }
}

TEST(FolderLock, OfAnotherHostIsRefusedWithWhatToRemove) {
  const fs::path folder = fresh_folder("foreign_lock_test_");
  fs::create_directories(folder);
  const std::string text = changed_lock(folder, 0);
  std::ofstream(folder / "running.lock") << text;
  try {
    const FolderLock lock(folder);
    FAIL();
  } catch (const UserError& error) {
    EXPECT_NE(std::string(error.what()).find("running.lock says, and cannot be asked from this host"),
              std::string::npos);
    EXPECT_NE(std::string(error.what()).find("remove that file"), std::string::npos);
  }
}

}  // namespace
}  // namespace femxdem
