#include "ve_templates.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>

namespace femxdem {
namespace {

namespace fs = std::filesystem;

/// An empty folder for scripts, gone at the end.
struct Scripts {
  Scripts() { fs::create_directory(folder); }
  ~Scripts() { fs::remove_all(folder); }
  void write(const std::string& name, const std::string& text) const { std::ofstream(folder / name) << text; }
  const fs::path folder = fs::temp_directory_path() / ("femxdem_scripts_" + std::to_string(getpid()));
};

TEST(VeTemplates, EveryScriptThatDecidesAPackingCounts) {
  const std::string all = makers(fs::path(TEST_ENGINES) / ".." / ".." / "yade_scripts");
  for (const char* name : {"adoption.py", "contact_laws.py", "contact_loop.py", "packing.py", "time_step.py",
                           "unit_of_time.py", "user_scenes.py", "volume_element.py", "yade_modules.py"})
    EXPECT_NE(all.find(std::string(name) + '\0'), std::string::npos) << name;
  EXPECT_EQ(all.find(std::string("protocol.py") + '\0'), std::string::npos);
  EXPECT_EQ(all.find(std::string("inspect_ve.py") + '\0'), std::string::npos);
}

TEST(VeTemplates, AChangedANewAndARenamedScriptCountOthersDoNot) {
  const Scripts scripts;
  scripts.write("packing.py", "dense");
  scripts.write("adoption.py", "at rest");
  const std::string before = makers(scripts.folder);
  for (const char* name : {"protocol.py", "inspect_ve.py", "notes.txt"}) scripts.write(name, "whatever");
  EXPECT_EQ(makers(scripts.folder), before);
  scripts.write("packing.py", "loose");
  const std::string changed = makers(scripts.folder);
  EXPECT_NE(changed, before);
  scripts.write("new.py", "");
  const std::string added = makers(scripts.folder);
  EXPECT_NE(added, changed);
  fs::rename(scripts.folder / "new.py", scripts.folder / "newer.py");
  EXPECT_NE(makers(scripts.folder), added);
  fs::remove(scripts.folder / "newer.py");
  scripts.write("packing.py", "dense");
  EXPECT_EQ(makers(scripts.folder), before);
}

}  // namespace
}  // namespace femxdem
