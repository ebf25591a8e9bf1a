#include <fmt/core.h>

#include <cmath>

#include "case.hpp"
#include "case_parameters.hpp"
#include "hash.hpp"
#include "output_folder.hpp"
#include "summary.hpp"

namespace femxdem {

namespace {

/// A number with the fewest digits that read back to the same bits; always a float, for TOML.
std::string number_text(double x) {
  const std::string text = fmt::format("{}", x);
  return text.find_first_of(".einf") == std::string::npos ? text + ".0" : text;
}

std::string item_text(bool x) { return x ? "true" : "false"; }
std::string item_text(int x) { return std::to_string(x); }
std::string item_text(double x) { return number_text(x); }
std::string item_text(const std::string& x) { return quoted_text(x); }
std::string item_text(const std::array<double, 2>& x) {
  return fmt::format("[{}, {}]", number_text(x[0]), number_text(x[1]));
}
template <class T>
std::string item_text(const std::vector<T>& list) {
  std::string text;
  for (const T& x : list) text += (text.empty() ? "" : ", ") + item_text(x);
  return "[" + text + "]";
}

template <class S>
void write_parameters(std::string& out, const Section<S>& section, const S& values) {
  for (const Parameter<S>& p : section.parameters) {
    const Value value = p.get(values);
    if (says_something(value, p.bounds)) out += fmt::format("{} = {}\n", p.key, toml_text(value));
  }
}

template <class S>
void write_section(std::string& out, const Section<S>& section, const S& values) {
  out += fmt::format("[{}]\n", section.name);
  write_parameters(out, section, values);
  out += "\n";
}

template <class S>
void write_section(std::string& out, const Section<S>& section, const std::vector<S>& array) {
  for (const S& values : array) {
    out += fmt::format("[[{}]]\n", section.name);
    write_parameters(out, section, values);
    out += "\n";
  }
}

template <class S>
std::string default_text(const Parameter<S>& p) {
  const Value value = p.get(S{});
  return says_something(value, p.bounds) ? toml_text(value) : "-";
}

template <class S>
void describe(std::string& out, const Parameter<S>& p) {
  const std::string allowed = p.kind == Kind::word ? either(p.words) : bounds_text(p.bounds);
  const std::string separator = allowed.empty() || p.text.empty() ? "" : "; ";
  out += fmt::format("  {:<24}{:<18}{:<12}{:<18}{}{}{}\n", p.key, kind_name(p.kind, p.size),
                     p.unit.empty() ? "-" : p.unit, default_text(p), allowed, separator, p.text);
}

template <class S>
void describe(std::string& out, const Section<S>& section, bool array) {
  const bool region = section.name.ends_with(".region");
  out += fmt::format("{}{}{}  {}\n", array ? "[[" : "[", section.name, array ? "]]" : "]", section.text);
  std::string others;
  for (const Parameter<S>& p : section.parameters) {
    if (!region || p.key == "region")
      describe(out, p);
    else
      others += (others.empty() ? "" : ", ") + p.key;
  }
  if (region) out += fmt::format("  and any of: {}\n", others);
  out += "\n";
}

/// For a cell of a table in Markdown.
std::string cell_text(const std::string& text) {
  std::string out;
  for (const char character : text) {
    if (character == '|' || character == '*') out += '\\';
    out += character;
  }
  return out.empty() ? "-" : out;
}

template <class S>
void describe_as_row(std::string& out, const Parameter<S>& p) {
  std::string allowed = cell_text(bounds_text(p.bounds));
  if (p.kind == Kind::word) {
    allowed.clear();
    for (const std::string& word : p.words)
      if (!word.empty()) allowed += fmt::format("{}`{}`", allowed.empty() ? "" : ", ", word);
  }
  const std::string value = default_text(p);
  out += fmt::format("| `{}` | {} | {} | {} | {} | {} |\n", p.key, kind_name(p.kind, p.size), cell_text(p.unit),
                     value == "-" ? value : "`" + value + "`", allowed, cell_text(p.text));
}

template <class S>
void describe_as_table(std::string& out, const Section<S>& section, bool array) {
  const bool region = section.name.ends_with(".region");
  const std::string name = array ? "[[" + section.name + "]]" : "[" + section.name + "]";
  out += fmt::format("\n## `{}`\n{}.\n\n| key | type | unit | default | allowed | |\n|---|---|---|---|---|---|\n", name,
                     cell_text(section.text));
  std::string others;
  for (const Parameter<S>& p : section.parameters) {
    if (!region || p.key == "region")
      describe_as_row(out, p);
    else
      others += fmt::format("{}`{}`", others.empty() ? "" : ", ", p.key);
  }
  if (region) out += "\nand any of: " + others + "\n";
}

/// The packing's files by their contents, where they are cached not at all.
void forget_places(VeParameters& ve) {
  ve.script = hash_text(read_file(ve.script));
  ve.scene = hash_text(read_file(ve.scene));
  ve.scene_sha256.clear();
  ve.engine = {};
  ve.check_every = ve.threads = 0;
  ve.balance = true;
  ve.sorted_contacts = false;
  ve.cache.clear();
}

}  // namespace

std::string kind_name(Kind kind, std::size_t size) {
  constexpr std::array<const char*, 10> names = {"true or false", "integer", "number",           "text", "integers",
                                                 "numbers",       "texts",   "pairs of numbers", "word", "path"};
  const std::string name = names.at(static_cast<std::size_t>(kind));
  return size == 0 ? name : fmt::format("{} {}", size, name);
}

std::string either(const std::vector<std::string>& words) {
  std::string out;
  for (const std::string& word : words) {
    if (!word.empty()) out += (out.empty() ? "" : " | ") + word;
  }
  return out;
}

std::string bounds_text(const Bounds& bounds) {
  const char* equal = bounds.open ? "" : "=";
  std::string text;
  if (std::isfinite(bounds.min)) text += fmt::format(">{} {:g}", equal, bounds.min);
  if (std::isfinite(bounds.max)) text += fmt::format("{}<{} {:g}", text.empty() ? "" : " and ", equal, bounds.max);
  return text;
}

bool says_something(const Value& value, const Bounds& bounds) {
  return std::visit(
      [&bounds](const auto& x) {
        using T = std::decay_t<decltype(x)>;
        if constexpr (std::is_same_v<T, bool>)
          return true;
        else if constexpr (std::is_same_v<T, int>)
          return bounds.contain(x);
        else if constexpr (std::is_same_v<T, double>)
          return is_given(x);
        else
          return !x.empty();
      },
      value);
}

std::string toml_text(const Value& value) {
  return std::visit([](const auto& x) { return item_text(x); }, value);
}

std::string effective_toml(const Case& c) {
  std::string out = "# Every parameter of the run with its value.\n\n";
  for_each_section(c, [&out](const auto& section, const auto& values) { write_section(out, section, values); });
  return out;
}

std::string describe_parameters() {
  std::string out = fmt::format("  {:<24}{:<18}{:<12}{:<18}{}\n\n", "key", "type", "unit", "default", "allowed; text");
  const Case defaults;
  for_each_section(defaults, [&out]<class S, class V>(const Section<S>& section, const V&) {
    describe(out, section, !std::is_same_v<S, V>);
  });
  return out;
}

std::string parameters_markdown() {
  std::string out =
      "# Parameters of a case\n\nMade by `femxdem parameters --markdown`; a test holds it to the program. `[name]` is "
      "a "
      "table that stands once in a case file, `[[name]]` one that may stand several times. Default `-`: none; what a "
      "case needs and does not give, `femxdem check` says.\n";
  const Case defaults;
  for_each_section(defaults, [&out]<class S, class V>(const Section<S>& section, const V&) {
    describe_as_table(out, section, !std::is_same_v<S, V>);
  });
  return out;
}

std::string comparable_toml(const Case& c) {
  Case placeless = c;
  placeless.output = {};
  placeless.mesh.file = hash_text(read_file(c.mesh.file));
  forget_places(placeless.ve);
  for (RegionVe& region : placeless.ve_regions) forget_places(region.ve);
  return effective_toml(placeless);
}

std::string case_hash(const Case& c) { return hash_text(comparable_toml(c)); }

std::string ve_spec_json(const VeParameters& ve) {
  std::string out;
  const RegionVe one{"", ve};
  for (const Parameter<RegionVe>& p : case_sections().ve_region.parameters) {
    const Value value = p.get(one);
    if (says_something(value, p.bounds))
      out += fmt::format("{}\"{}\": {}", out.empty() ? "" : ", ", p.key, toml_text(value));
  }
  return "{" + out + "}";
}

}  // namespace femxdem
