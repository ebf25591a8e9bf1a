#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace femxdem {

/// What the program reads of a manifest: JSON as Python's json.dumps writes it, keys unique.

/// All texts within the value of `key` (a text, or lists of texts within one another), in order; empty without the key.
std::vector<std::string> manifest_texts(std::string_view json, std::string_view key);

/// The number that is the value of `key`.
std::optional<double> manifest_number(std::string_view json, std::string_view key);

/// "SIZE-CRC32" of bytes, as yade_scripts/script_inputs.py (hash_of) and volume_element.py find it.
std::string fingerprint(std::string_view bytes);

/// The first file that a script has read and that is not what it was ("NAME has changed", "NAME is missing", "NAME is
/// there now"); empty where all are as they were. Relative names are looked for in the working folder.
std::string changed_input(std::string_view json);

}  // namespace femxdem
