#define TOML_HEADER_ONLY 1
#define TOML_ASSERT(expr) \
  static_assert(true)  // toml++ 3.3 asserts that a key begins as one, and refuses it right after
#include <fmt/core.h>
#include <toml++/toml.h>

#include <cmath>
#include <filesystem>
#include <sstream>

#include "case.hpp"
#include "case_check.hpp"
#include "case_completion.hpp"
#include "case_mistakes.hpp"
#include "case_parameters.hpp"
#include "errors.hpp"

namespace femxdem {

namespace {

std::vector<std::string> split(const std::string& dotted) {
  std::vector<std::string> parts;
  std::istringstream stream(dotted);
  for (std::string part; std::getline(stream, part, '.');) parts.push_back(part);
  return parts;
}

std::string text_of(const toml::node& node) {
  std::ostringstream out;
  node.visit([&out](const auto& n) { out << n; });
  std::string text = out.str();
  return text.size() > 40 ? text.substr(0, 37) + "..." : text;
}

// ---- overrides

/// An override as a node of its own: TOML, or else a bare word as a text.
toml::table parse_value(const std::string& text) {
  try {
    return toml::parse("value = " + text);
  } catch (const toml::parse_error&) {
    return toml::table{{"value", text}};
  }
}

toml::node* child(toml::node& parent, const std::string& part) {
  if (toml::table* table = parent.as_table()) {
    if (!table->contains(part)) table->insert(part, toml::table{});
    return table->get(part);
  }
  toml::array* array = parent.as_array();
  const bool number = !part.empty() && part.find_first_not_of("0123456789") == std::string::npos;
  return array && number && part.size() < 9 ? array->get(std::stoul(part)) : nullptr;
}

/// Puts key=value into the tree.
void apply_override(toml::table& root, const std::string& text, Mistakes& mistakes) {
  const std::size_t equal = text.find('=');
  const std::string place = "--set " + text;
  if (equal == std::string::npos || equal == 0)
    throw UserError(place + ": not of the form key=value; write for example --set control.step=1e-3");
  std::vector<std::string> parts = split(text.substr(0, equal));
  const std::string last = parts.back();
  parts.pop_back();
  toml::node* at = &root;
  for (const std::string& part : parts) {
    at = child(*at, part);
    if (!at) throw UserError(fmt::format("{}: there is no '{}' to set; count entries of arrays from 0", place, part));
  }
  toml::table* table = at->as_table();
  if (!table) throw UserError(place + ": the key names a value inside another value; give the key of a table");
  toml::table value = parse_value(text.substr(equal + 1));
  value.get("value")->visit([&](auto& node) { table->insert_or_assign(last, std::move(node)); });
  mistakes.found(text.substr(0, equal), place);
}

// ---- values

std::optional<int> integer(const toml::node& node) {
  const auto value = node.value_exact<std::int64_t>();
  const bool fits = value && *value >= std::numeric_limits<int>::min() && *value <= std::numeric_limits<int>::max();
  return fits ? std::optional<int>(static_cast<int>(*value)) : std::nullopt;
}

std::optional<double> number(const toml::node& node) {
  if (!node.is_integer() && !node.is_floating_point()) return std::nullopt;
  const auto value = node.value<double>();
  return value && std::isfinite(*value) ? value : std::nullopt;
}

std::optional<std::string> text(const toml::node& node) { return node.value_exact<std::string>(); }

std::optional<std::array<double, 2>> pair_of_numbers(const toml::node& node) {
  const toml::array* array = node.as_array();
  if (!array || array->size() != 2) return std::nullopt;
  const auto first = number(*array->get(0)), second = number(*array->get(1));
  return first && second ? std::optional(std::array{*first, *second}) : std::nullopt;
}

template <class T>
std::optional<Value> list(const toml::node& node, std::optional<T> (*convert)(const toml::node&), std::size_t size) {
  const toml::array* array = node.as_array();
  if (!array || (size > 0 && array->size() != size)) return std::nullopt;
  std::vector<T> values;
  for (const toml::node& item : *array) {
    const std::optional<T> value = convert(item);
    if (!value) return std::nullopt;
    values.push_back(*value);
  }
  return Value(values);
}

/// The node as a value of the kind, or nothing if it is of another.
std::optional<Value> value_of(const toml::node& node, Kind kind, std::size_t size) {
  const auto wrap = [](const auto& value) { return value ? std::optional<Value>(*value) : std::nullopt; };
  switch (kind) {
    case Kind::boolean:
      return wrap(node.value_exact<bool>());
    case Kind::integer:
      return wrap(integer(node));
    case Kind::number:
      return wrap(number(node));
    case Kind::text:
    case Kind::word:
    case Kind::path:
      return wrap(text(node));
    case Kind::integers:
      return list<int>(node, integer, size);
    case Kind::numbers:
      return list<double>(node, number, size);
    case Kind::texts:
      return list<std::string>(node, text, size);
    case Kind::pairs:
      return list<std::array<double, 2>>(node, pair_of_numbers, size);
  }
  return std::nullopt;
}

bool in_bounds(const Value& value, const Bounds& bounds) {
  const auto contains = [&bounds](double x) { return bounds.contain(x); };
  if (const int* x = std::get_if<int>(&value)) return contains(*x);
  if (const double* x = std::get_if<double>(&value)) return contains(*x);
  if (const auto* x = std::get_if<std::vector<int>>(&value)) return std::all_of(x->begin(), x->end(), contains);
  if (const auto* x = std::get_if<std::vector<double>>(&value)) return std::all_of(x->begin(), x->end(), contains);
  return true;
}

std::string a_value_of(Kind kind, std::size_t size) {
  const char* article = size > 0 ? "" : kind == Kind::integer ? "an " : kind == Kind::number ? "a " : "";
  return article + kind_name(kind, size);
}

// ---- sections

template <class S>
S fresh(const Case&, const std::vector<S>&) {
  return {};
}
RegionMaterial fresh(const Case& c, const std::vector<RegionMaterial>&) { return {"", c.material}; }
RegionVe fresh(const Case& c, const std::vector<RegionVe>&) { return {"", c.ve}; }

/// Names of all tables, "mesh", "ve", "ve.region", ...; true for an array of tables.
std::map<std::string, bool> section_names() {
  std::map<std::string, bool> names;
  const Case none;
  for_each_section(none, [&names]<class S, class V>(const Section<S>& section, const V&) {
    names[section.name] = !std::is_same_v<S, V>;
  });
  return names;
}

class Reader {
 public:
  Reader(const std::string& file, Mistakes& mistakes) : file_(file), mistakes_(mistakes) {}

  template <class S>
  void read(const toml::table& root, const Section<S>& section, S& values) {
    const toml::node* node = find(root, section.name);
    if (!node) return;
    note(section.name, node->source());
    if (const toml::table* table = node->as_table())
      read_table(*table, section, section.name, values);
    else
      mistakes_.add(section.name, fmt::format("'{0}' is one table; write [{0}]", section.name));
  }

  template <class S>
  void read(const toml::table& root, const Section<S>& section, std::vector<S>& values, const Case& base) {
    const toml::node* node = find(root, section.name);
    if (!node) return;
    note(section.name, node->source());
    const toml::array* array = node->as_array();
    if (!array || !array->is_homogeneous(toml::node_type::table))
      return mistakes_.add(section.name, fmt::format("'{0}' is a list of tables; write [[{0}]]", section.name));
    for (std::size_t i = 0; i < array->size(); ++i) {
      const std::string key = fmt::format("{}.{}", section.name, i);
      note(key, array->get(i)->source());
      values.push_back(fresh(base, values));
      read_table(*array->get(i)->as_table(), section, key, values.back());
    }
  }

  void unknown_tables(const toml::table& root) {
    std::vector<std::string> names;
    for (const auto& [name, array] : section_names()) names.push_back(name);
    for (const auto& [key, node] : root) {
      const std::string name(key.str());
      if (section_names().count(name) > 0) continue;
      note(name, key.source());
      const std::string near = nearest(name, names);
      mistakes_.add(name, fmt::format("unknown {} '{}'; {}", node.is_value() ? "key" : "table", name,
                                      near.empty() ? "the tables are " + either(names)
                                                   : fmt::format("did you mean '{}'?", near)));
    }
  }

 private:
  static const toml::node* find(const toml::table& root, const std::string& name) {
    const toml::node* node = &root;
    for (const std::string& part : split(name)) {
      const toml::table* table = node->as_table();
      node = table ? table->get(part) : nullptr;
      if (!node) return nullptr;
    }
    return node;
  }

  /// Notes the place of a key, unless an override has put it there.
  void note(const std::string& key, const toml::source_region& source) {
    if (!mistakes_.has(key) && source.begin)
      mistakes_.found(key, fmt::format("{}:{}:{}", file_, source.begin.line, source.begin.column));
  }

  template <class S>
  void read_table(const toml::table& table, const Section<S>& section, const std::string& where, S& values) {
    for (const auto& [key, node] : table) {
      const std::string name(key.str());
      const std::string full = where + "." + name;
      const auto p = std::find_if(section.parameters.begin(), section.parameters.end(),
                                  [&name](const Parameter<S>& parameter) { return parameter.key == name; });
      if (p != section.parameters.end()) {
        note(full, node.source());
        read_value(node, *p, full, values);
        continue;
      }
      note(full, key.source());
      if (section_names().count(section.name + "." + name) == 0) unknown_key(section, name, where);
    }
  }

  template <class S>
  void unknown_key(const Section<S>& section, const std::string& name, const std::string& where) {
    const std::string full = where + "." + name;
    std::vector<std::string> keys;
    for (const Parameter<S>& p : section.parameters) keys.push_back(p.key);
    const std::string near = nearest(name, keys);
    const std::string home = home_of(name);
    const std::string advice = !near.empty()   ? fmt::format("did you mean '{}'?", near)
                               : !home.empty() ? fmt::format("it belongs to [{}]", home)
                                               : "its keys are " + either(keys);
    mistakes_.add(full, fmt::format("unknown key '{}' in [{}]; {}", name, section.name, advice));
    // The key that was meant counts as given: one mistake, one line.
    if (!near.empty()) mistakes_.found(where + "." + near, mistakes_.place(full));
  }

  /// First section that has a parameter of this name.
  static std::string home_of(const std::string& key) {
    std::string home;
    const Case none;
    for_each_section(none, [&](const auto& section, const auto&) {
      for (const auto& p : section.parameters) {
        if (p.key == key && home.empty()) home = section.name;
      }
    });
    return home;
  }

  template <class S>
  void read_value(const toml::node& node, const Parameter<S>& p, const std::string& full, S& values) {
    const std::optional<Value> value = value_of(node, p.kind, p.size);
    const std::string bounds = bounds_text(p.bounds);
    const std::string wanted = a_value_of(p.kind, p.size) + (bounds.empty() ? "" : " " + bounds);
    if (!value) {
      mistakes_.add(full, fmt::format("{} = {} is of the wrong type; give {}", full, text_of(node), wanted));
    } else if (!in_bounds(*value, p.bounds)) {
      mistakes_.add(full, fmt::format("{} = {} is out of bounds; give {}", full, text_of(node), wanted));
    } else if (p.kind == Kind::word && !is_word(std::get<std::string>(*value), p.words)) {
      const std::string near = nearest(std::get<std::string>(*value), p.words);
      mistakes_.add(full, fmt::format("{} = {} is none of {}; {}", full, text_of(node), either(p.words),
                                      near.empty() ? "choose one" : fmt::format("did you mean '{}'?", near)));
    } else if (p.kind == Kind::path) {
      read_path(std::get<std::string>(*value), p, full, values);
    } else {
      p.set(values, *value);
    }
  }

  static bool is_word(const std::string& text, const std::vector<std::string>& words) {
    return !text.empty() && std::find(words.begin(), words.end(), text) != words.end();
  }

  template <class S>
  void read_path(const std::string& path, const Parameter<S>& p, const std::string& full, S& values) {
    const auto absolute = std::filesystem::absolute(file_).parent_path() / path;
    if (!std::filesystem::is_regular_file(absolute))
      return mistakes_.add(full, fmt::format("{}: no file '{}'; correct the path (from the case file's folder)", full,
                                             absolute.lexically_normal().string()));
    p.set(values, Value(absolute.lexically_normal().string()));
  }

  std::string file_;
  Mistakes& mistakes_;
};

toml::table parse_file(const std::string& path) {
  if (!std::filesystem::is_regular_file(path)) throw UserError(path + ": no such case file; correct the path");
  try {
    return toml::parse_file(path);
  } catch (const toml::parse_error& error) {
    const auto at = error.source().begin;
    throw UserError(
        fmt::format("{}:{}:{}: not TOML: {}; correct this line", path, at.line, at.column, error.description()));
  }
}

}  // namespace

Case read_case(const std::string& path, const std::vector<std::string>& overrides, Purpose purpose) {
  toml::table root = parse_file(path);
  Mistakes mistakes(path);
  for (const std::string& text : overrides) apply_override(root, text, mistakes);
  Case c;
  c.file = std::filesystem::absolute(path).lexically_normal().string();
  Reader reader(path, mistakes);
  for_each_section(c, [&]<class S, class V>(const Section<S>& section, V& values) {
    if constexpr (std::is_same_v<S, V>)
      reader.read(root, section, values);
    else
      reader.read(root, section, values, c);
  });
  reader.unknown_tables(root);
  complete_case(c, purpose, mistakes);
  check_case(c, purpose, mistakes);
  if (!mistakes.empty()) throw UserError(mistakes.text());
  return c;
}

}  // namespace femxdem
