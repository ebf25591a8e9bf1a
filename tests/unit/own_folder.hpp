#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <string>

namespace femxdem {

/// A folder of its own for each test and process, not there at the beginning and removed at the end.
class OwnFolder : public testing::Test {
 protected:
  OwnFolder() { std::filesystem::remove_all(folder_); }
  ~OwnFolder() override { std::filesystem::remove_all(folder_); }

  const std::filesystem::path folder_ = std::filesystem::temp_directory_path() /
                                        ("femxdem_" + std::to_string(getpid()) + "_" +
                                         testing::UnitTest::GetInstance()->current_test_info()->test_suite_name() +
                                         "_" + testing::UnitTest::GetInstance()->current_test_info()->name());
};

}  // namespace femxdem
