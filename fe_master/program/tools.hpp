#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace femxdem {

/// A subcommand that is a Python script of this folder: it gets the words behind its name.
struct Tool {
  std::string_view name;
  std::string_view script;
  std::string_view help;
};

std::span<const Tool> tools();

/// The tool of that name, or nothing.
const Tool* find_tool(std::string_view name);

/// This process becomes Debian's Python on that script, which finds this program's modules, and its path as FEMXDEM in
/// the environment. Throws UserError where it cannot be started.
[[noreturn]] void become_python(const std::filesystem::path& script, const std::vector<std::string>& arguments);
[[noreturn]] void become(const Tool& tool, const std::vector<std::string>& arguments);

}  // namespace femxdem
