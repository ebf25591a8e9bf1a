#pragma once

#include <functional>
#include <optional>
#include <string>

namespace femxdem {

/// Does it in a process of its own, which leaves nothing behind: damaged files end the libraries that read them by a
/// signal, or never. How that process has ended ("signal 11, Segmentation fault") if not by itself within half an hour,
/// an exception or not; nothing too where no process can be made.
std::optional<std::string> what_ends(const std::function<void()>& act);

}  // namespace femxdem
