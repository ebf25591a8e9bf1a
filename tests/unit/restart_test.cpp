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

Checkpoint checkpoint_of(const Case& c, double time) { return {3, time, 0.1, {}, comparable_toml(c), {}}; }

std::string refusal(const Checkpoint& checkpoint, const Case& c) {
  try {
    refuse_other_case("checkpoint.h5", checkpoint, c);
    return "none";
  } catch (const UserError& error) {
    return error.what();
  }
}

TEST(Restart, NamesTheKeysThatDiffer) {
  Case c = small_case(LoadKind::velocity);
  const Checkpoint checkpoint = checkpoint_of(c, 0.3);
  EXPECT_EQ(refusal(checkpoint, c), "none");
  c.ve.friction = 0.3;
  c.loads[0].value = -0.2;
  const std::string said = refusal(checkpoint, c);
  EXPECT_NE(said.find("load.0.value (-0.1, now -0.2), ve.friction (0.5, now 0.3)"), std::string::npos) << said;
}

TEST(Restart, ALaterEndIsAllowedWhereNoLoadDependsOnIt) {
  for (const auto& [kind, allowed] :
       {std::pair{LoadKind::velocity, true}, {LoadKind::pressure, true}, {LoadKind::displacement, false}}) {
    Case c = small_case(kind);
    const Checkpoint checkpoint = checkpoint_of(c, 0.3);
    c.control.end_time = 2;
    if (allowed) {
      EXPECT_EQ(refusal(checkpoint, c), "none");
    } else {
      EXPECT_NE(refusal(checkpoint, c).find("load.0 depends on it (its factor is time / end_time)"), std::string::npos);
    }
    c.control.end_time = 0.2;
    EXPECT_NE(refusal(checkpoint, c), "none");
  }
  Case c = small_case(LoadKind::displacement);
  c.loads[0].table = {{0, 0}, {1, 1}};
  const Checkpoint checkpoint = checkpoint_of(c, 0.3);
  c.control.end_time = 2;
  EXPECT_EQ(refusal(checkpoint, c), "none");
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
